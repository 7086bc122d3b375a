"""The sim-to-real gap: where it lies, which unmodelled effect causes it, how far it shrinks.

Takes a trial and a model. Gives a frozen `Diagnosis`. Drawing and prose live in `bayesid.report`.
"""
