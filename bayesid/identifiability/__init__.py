"""What data can tell about coefficients, and what they leave open, in words."""

from bayesid.identifiability.directions import Open
from bayesid.identifiability.identify import Identifiability, identify
from bayesid.identifiability.information import Information, as_if_read, information, with_assumed_priors
from bayesid.identifiability.ledger import Entry, ledger
from bayesid.identifiability.profile import Profile, profiles
from bayesid.identifiability.scalings import Scaling, row_scaled, scalings, yaw_mixed
from bayesid.identifiability.spectrum import Spectrum, sensitivity_columns, spectrum

__all__ = [
    "Entry",
    "Identifiability",
    "Information",
    "Open",
    "Profile",
    "Scaling",
    "Spectrum",
    "as_if_read",
    "identify",
    "information",
    "ledger",
    "profiles",
    "row_scaled",
    "scalings",
    "sensitivity_columns",
    "spectrum",
    "with_assumed_priors",
    "yaw_mixed",
]
