"""Hydrodynamic coefficient identification and sim-to-real gap diagnosis for marine vehicles.

`import bayesid` is cheap: a public name loads its module when it is first used.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

__version__ = "0.1.0"

# public name -> module that defines it; the verbs of the command line first, then what they take and give
_PUBLIC: dict[str, str] = {
    "load_trial": "bayesid.trials",
    "load_vehicle": "bayesid.model.vehicles",
    "simulate": "bayesid.api.simulate",
    "fit": "bayesid.api.fit",
    "sample": "bayesid.api.sample",
    "identify": "bayesid.api.identify",
    "excite": "bayesid.api.excite",
    "compare": "bayesid.api.compare",
    "design": "bayesid.api.design",
    "diagnose": "bayesid.api.diagnose",
    "predict": "bayesid.api.predict",
    "export": "bayesid.api.export",
    "write_trial": "bayesid.trials",
    "write_vehicle": "bayesid.model.vehicles",
    "Trial": "bayesid.trials",
    "Vehicle": "bayesid.model.vehicles",
    "FitResult": "bayesid.api.fit",
    "SampleResult": "bayesid.api.sample",
    "IdentifyResult": "bayesid.api.identify",
    "ExciteResult": "bayesid.api.excite",
    "CompareResult": "bayesid.api.compare",
    "DesignResult": "bayesid.api.design",
    "DiagnoseResult": "bayesid.api.diagnose",
    "PredictResult": "bayesid.api.predict",
    "BayesidError": "bayesid.errors",
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
