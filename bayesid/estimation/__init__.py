"""Estimators of coefficients and effect parameters from logged runs.

`output_error` fits without process noise (maximum likelihood by SLSQP), `filter_error` with process noise (a
Kalman filter, Gauss-Newton), `sampling` draws from a posterior. Takes a model and run data. Does not
diagnose or report.
"""
