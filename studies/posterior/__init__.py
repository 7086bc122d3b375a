"""Study: the posterior of a spiral's coefficients, and what further runs add."""
