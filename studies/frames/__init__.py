"""Study: causes confounded with coefficients, and look-alikes told apart by one more run."""
