"""The general methods by name."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bayesid.benchmark.general_methods.distortions import distortion_verdict
from bayesid.benchmark.general_methods.reproducibility import reproducibility_verdict
from bayesid.equations.model import Model
from bayesid.trials import Trial


@dataclass(frozen=True)
class Method:
    """One method.

    Attributes
    ----------
    about : what it asks, in a line
    verdict : of a trial and a model, with a seed; plain data in the form of diagnosis.json
    """

    about: str
    verdict: Callable[[Trial, Model, int], dict[str, Any]]


def methods_code() -> str:
    """Fingerprint of the modules of the methods, which that of the deciding code leaves out."""
    folder = Path(__file__).parent
    content = b"".join(path.read_bytes() for path in sorted(folder.glob("*.py")))
    return hashlib.sha256(content).hexdigest()[:16]


METHODS: Mapping[str, Method] = {
    "distortions": Method(
        "a bank of localised distortions, one global p-value (Anau Montel, Alvey and Weniger 2025)",
        distortion_verdict,
    ),
    "reproducibility": Method(
        "fitted models, rejected where another is reproducibly better (René and Longtin 2025)",
        reproducibility_verdict,
    ),
}
