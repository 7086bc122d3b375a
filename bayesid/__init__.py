"""Hydrodynamic coefficient identification and sim-to-real gap diagnosis for marine vehicles.

`import bayesid` is cheap: a public name loads its module when it is first used.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

__version__ = "0.1.0"

# public name -> module that defines it
_PUBLIC: dict[str, str] = {
    "BayesidError": "bayesid.errors",
    "TrialError": "bayesid.errors",
    "VehicleError": "bayesid.errors",
    "ManoeuvreError": "bayesid.errors",
    "ModelError": "bayesid.errors",
    "CacheError": "bayesid.errors",
    "FitError": "bayesid.errors",
    "Term": "bayesid.model.terms",
    "TERMS": "bayesid.model.terms",
    "term": "bayesid.model.terms",
    "Vehicle": "bayesid.model.vehicles",
    "load_vehicle": "bayesid.model.vehicles",
    "write_vehicle": "bayesid.model.vehicles",
    "coef_si": "bayesid.model.vehicles",
    "Trial": "bayesid.trials",
    "Run": "bayesid.trials",
    "load_trial": "bayesid.trials",
    "write_trial": "bayesid.trials",
    "Parameter": "bayesid.model.params",
    "ParameterSet": "bayesid.model.params",
    "Prior": "bayesid.model.params",
    "Model": "bayesid.equations.model",
    "build_model": "bayesid.equations.model",
    "virtual_trial": "bayesid.simulation.virtual_trial",
    "Fit": "bayesid.estimation.output_error",
    "FitOptions": "bayesid.estimation.output_error",
    "TrialFit": "bayesid.estimation.output_error",
    "fit_trial": "bayesid.estimation.output_error",
    "load_fit": "bayesid.estimation.output_error",
    "OpenLoop": "bayesid.manoeuvres",
    "ClosedLoop": "bayesid.manoeuvres",
    "turning_circle": "bayesid.measures",
    "zigzag": "bayesid.measures",
}

__all__ = ["__version__", *_PUBLIC]


def __getattr__(name: str) -> Any:
    if name not in _PUBLIC:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(_PUBLIC[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
