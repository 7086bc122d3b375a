"""The verbs of bayesid for Python, the same as those of the command line.

Takes what a user has (a bundle, a `Trial`, a name or file of a vehicle) and choices in plain words. Gives
results with `summary()`, `record()`, `to_dataframe()`, `plot()` and `save()`. Does not compute: the packages
below do.
"""
