"""What data can tell before or beside a fit: excitation, identifiability, design of manoeuvres.

Takes logged or planned runs and a model. Does not fit a vehicle for use; that is `bayesid.estimation`.
"""
