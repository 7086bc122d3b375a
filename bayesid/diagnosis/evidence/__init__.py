"""Evidence behind a decision: posterior of effect parameters, hold-out validation, form of a missing force.

Takes refitted hypotheses. Does not decide between them.
"""
