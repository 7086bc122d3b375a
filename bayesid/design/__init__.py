"""Which forces a manoeuvre reveals, and which manoeuvre to fly next: information before data."""

from bayesid.design.causes import Causes, causes
from bayesid.design.choose import Choice, choose
from bayesid.design.compare import Case, Crossing, Richness, crossed, crossing, richness, tried
from bayesid.design.criteria import Criteria, criteria, flat_names
from bayesid.design.information import Information, Logging, information, usual_logging
from bayesid.design.knowledge import Knowledge, knowledge
from bayesid.design.limits import Limits, library_within, limits
from bayesid.design.plan import GOALS, Candidate, Effort, Plan, next_manoeuvre
from bayesid.design.refit import Refit, refitted

__all__ = [
    "GOALS",
    "Candidate",
    "Case",
    "Causes",
    "Choice",
    "Criteria",
    "Crossing",
    "Effort",
    "Richness",
    "Information",
    "Knowledge",
    "Limits",
    "Logging",
    "Plan",
    "Refit",
    "causes",
    "choose",
    "criteria",
    "crossed",
    "crossing",
    "richness",
    "flat_names",
    "information",
    "knowledge",
    "library_within",
    "limits",
    "next_manoeuvre",
    "refitted",
    "tried",
    "usual_logging",
]
