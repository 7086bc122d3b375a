"""Filter-error likelihood: sensor noise plus small latent forces and sensor drift, exact by a Kalman filter.

Takes a model linearised along a path. Gives whitened residuals and sensitivities, evidence and smoothed
forces. Does not know which effect is being tested.
"""
