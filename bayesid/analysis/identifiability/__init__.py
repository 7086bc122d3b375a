"""What data can tell about coefficients, and what they leave open, in words."""

from bayesid.analysis.identifiability.coefficient_table import CoefficientRow, coefficient_rows
from bayesid.analysis.identifiability.derived import Derived, Standard, derived, full_vectors, indices
from bayesid.analysis.identifiability.identify import Identifiability, identify
from bayesid.analysis.identifiability.information import (
    Information,
    as_if_read,
    information,
    with_assumed_priors,
)
from bayesid.analysis.identifiability.open_directions import OpenDirection
from bayesid.analysis.identifiability.prediction_bands import TrackBands, predict
from bayesid.analysis.identifiability.profile import Profile, profiles
from bayesid.analysis.identifiability.scalings import Scaling, row_scaled, scalings, yaw_mixed
from bayesid.analysis.identifiability.spectrum import Spectrum, sensitivity_columns, spectrum

__all__ = [
    "TrackBands",
    "Derived",
    "CoefficientRow",
    "Identifiability",
    "Information",
    "OpenDirection",
    "Profile",
    "Scaling",
    "Spectrum",
    "Standard",
    "as_if_read",
    "derived",
    "full_vectors",
    "identify",
    "indices",
    "information",
    "coefficient_rows",
    "predict",
    "profiles",
    "row_scaled",
    "scalings",
    "sensitivity_columns",
    "spectrum",
    "with_assumed_priors",
    "yaw_mixed",
]
