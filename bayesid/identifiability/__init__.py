"""What data can tell about coefficients, and what they leave open, in words."""

from bayesid.identifiability.derived import Derived, Standard, derived, full_vectors, indices
from bayesid.identifiability.directions import Open
from bayesid.identifiability.identify import Identifiability, identify
from bayesid.identifiability.information import Information, as_if_read, information, with_assumed_priors
from bayesid.identifiability.ledger import Entry, ledger
from bayesid.identifiability.predictive import Bands, predict
from bayesid.identifiability.profile import Profile, profiles
from bayesid.identifiability.scalings import Scaling, row_scaled, scalings, yaw_mixed
from bayesid.identifiability.spectrum import Spectrum, sensitivity_columns, spectrum

__all__ = [
    "Bands",
    "Derived",
    "Entry",
    "Identifiability",
    "Information",
    "Open",
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
    "ledger",
    "predict",
    "profiles",
    "row_scaled",
    "scalings",
    "sensitivity_columns",
    "spectrum",
    "with_assumed_priors",
    "yaw_mixed",
]
