"""Predictions of a diagnosed model: what a run or a manoeuvre will do, with 95 % prediction intervals.

Takes a diagnosed model read back from its file, and the orders of a run. Does not estimate anything anew but
the initial state of the run it predicts.
"""
