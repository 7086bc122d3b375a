"""Study: why a simulator parts from the vehicle: planted, published and real gaps."""
