"""Data of a diagnosis: the problem it works on, outliers and events taken out, windows of consistency.

Takes a model and a trial. Tests no hypothesis.
"""
