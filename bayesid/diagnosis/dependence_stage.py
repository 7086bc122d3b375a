"""What a force that the best explanation leaves depends on, with what that gains where no effect acts.

Takes `Compared`. Gives a `Dependence`, or none, and how much more a free force gains than one of the motion.
Does not decide.
"""

from __future__ import annotations

from dataclasses import replace

from numpy.linalg import LinAlgError

from bayesid.diagnosis.cut_runs import Joint, Sought, sought_in
from bayesid.diagnosis.data.dependence import Dependence
from bayesid.diagnosis.dependence_search import dependence
from bayesid.diagnosis.force_of_motion import force_of_motion
from bayesid.diagnosis.form_stage import Compared, force_left
from bayesid.diagnosis.hypotheses.candidate import RefittedHypothesis, explains
from bayesid.diagnosis.threshold_table import EVEN_ODDS, NAMING_PROBABILITY
from bayesid.errors import BayesidError


def dependence_beside(found: Compared, best: RefittedHypothesis, sought: Sought) -> Dependence | None:
    """What a force that is left depends on; None where motion, controls, time or sensors may do.

    Raises
    ------
    ModelError, LinAlgError
        if a run cannot be linearised along its path
    """
    if not explains(best):  # what it does not follow is no small force beside it
        return None
    beside, none = dependence(sought, best.fit.par), found.candidates.none
    if beside is None or best is none:
        return beside
    if not explains(none):  # what it does not follow may look like a place
        return replace(beside, alone=0.0)
    try:
        alone = dependence(sought_in(found.problem, none.fit.free, none.fit.followed), none.fit.par)
    except (BayesidError, LinAlgError, ValueError):
        alone = None
    same = alone is not None and (alone.on, alone.acts) == (beside.on, beside.acts)
    return replace(beside, alone=alone.evidence if alone is not None and same else 0.0)


def over_motion(found: Compared, sought: Sought) -> float:
    """By how much a free force beside the best explanation gains more than one of the motion [nats]; infinite
    where a cause outside the list is not probable.

    Raises
    ------
    ModelError, LinAlgError
        if a run cannot be linearised along its path
    """
    shared, acts = found.candidates.probabilities["outside"], found.candidates.inside.get("outside", 0.0)
    if not (shared > EVEN_ODDS or acts >= NAMING_PROBABILITY):
        return float("inf")
    runs, known = sought.runs, sought.known
    of_motion = force_of_motion(sought).log_evidence(runs, known, ())
    return force_left(found) - of_motion + Joint(runs, known, ()).log_evidence
