"""Which forces a manoeuvre reveals, and which manoeuvre to run next: information before data."""

from bayesid.analysis.design.compare import (
    Crossing,
    PlanningCase,
    Richness,
    crossing,
    refit_all,
    refit_crossing,
    richness,
)
from bayesid.analysis.design.criteria import Criteria, criteria, flat_names
from bayesid.analysis.design.discrimination import Causes, causes
from bayesid.analysis.design.information import Logging, RunInformation, information, usual_logging
from bayesid.analysis.design.limits import OrderLimits, library_within, limits
from bayesid.analysis.design.plan import (
    GOALS,
    CandidateManoeuvre,
    ManoeuvrePlan,
    SearchEffort,
    next_manoeuvre,
)
from bayesid.analysis.design.prior_knowledge import Knowledge, knowledge
from bayesid.analysis.design.run_selection import Choice, choose
from bayesid.analysis.design.virtual_refit import Refit, refitted

__all__ = [
    "GOALS",
    "CandidateManoeuvre",
    "PlanningCase",
    "Causes",
    "Choice",
    "Criteria",
    "Crossing",
    "SearchEffort",
    "Richness",
    "RunInformation",
    "Knowledge",
    "OrderLimits",
    "Logging",
    "ManoeuvrePlan",
    "Refit",
    "causes",
    "choose",
    "criteria",
    "refit_crossing",
    "crossing",
    "richness",
    "flat_names",
    "information",
    "knowledge",
    "library_within",
    "limits",
    "next_manoeuvre",
    "refitted",
    "refit_all",
    "usual_logging",
]
