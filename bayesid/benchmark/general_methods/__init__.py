"""Two published general methods for models that may be wrong, answering the bundles a diagnosis answers.

Takes a trial and a model. Gives a verdict in the form of diagnosis.json, so that `bayesid blind score` lays
it beside the diagnosis. They share its readings, noise, prior and catalogue, and none of its rules.
"""

from bayesid.benchmark.general_methods.methods import METHODS, methods_code

__all__ = ["METHODS", "methods_code"]
