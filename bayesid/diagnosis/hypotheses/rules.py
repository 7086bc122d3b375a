"""The verdict as an ordered tuple of rules over `Facts`: the first whose condition holds decides.

A new rule is one entry of `RULES`. Takes numbers and booleans only; knows no trial, model or fit.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from bayesid.diagnosis.hypotheses.facts import Facts
from bayesid.diagnosis.threshold_table import (
    CAUSE_OVER_MOTION,
    CONFOUNDED_SHARE,
    EVEN_ODDS,
    NAMING_PROBABILITY,
    PRIOR_CONFLICT,
)

Word = Literal[
    "none", "effect", "effect_with_remainder", "several", "outside", "coefficients", "model_form", "ambiguous"
]
WORDS: tuple[Word, ...] = (
    "none", "effect", "effect_with_remainder", "several", "outside", "coefficients", "model_form",
    "ambiguous",
)  # fmt: skip
# Words that name an effect.
NAMING: tuple[Word, ...] = ("effect", "effect_with_remainder", "several")
TURNS_BY_ITSELF = "turns by itself"
LEEWAY = "leeway reads the same"
UNLISTED_BESIDE = "unlisted cause beside others"
UNLISTED_OVER_FORM = "unlisted cause in place of a model form"
UNLISTED_AMONG = (UNLISTED_BESIDE, UNLISTED_OVER_FORM)  # rules by which it acts beside whatever else may
CAUSE_OR_FORM = "unlisted cause or a force of the motion"
MOTION_EVENT = "motion nothing explains"  # said of a short time left out, after the rules
OTHER_DEPENDENCE = "depends on more than the motion"  # said of a force with the place or a period, after them
BESIDE_FORM = "coefficient beside a model form"
NO_SIZE_BESIDE_FORM = "no size beside a model form"
OUTSIDE_SAID = (MOTION_EVENT, OTHER_DEPENDENCE)  # rules that say what is outside the list
REFUTED = "refuted by held-out runs"  # said of a name under which they are predicted worse, last of all
LEFT_OUT_WORSE = "left-out runs predicted worse"  # said of two checks that fail, after the rules
UNSURE, NONE_LEFT, NONE_SURE = "unsure effect", "none not excluded", "several, none sure"
# Rules by which the first of several explanations lacks probability and nothing else.
LACKS_PROBABILITY = (UNSURE, NONE_LEFT, NONE_SURE)


@dataclass(frozen=True)
class Rule:
    """One rule.

    Attributes
    ----------
    name : short, unique
    condition : whether it decides
    word : its outcome
    effects : which names the outcome stands on: none, the rivals in the 95 % set, those of several that are
        sure, the best explanation, or the error of a coefficient
    confounded : which effects the coefficients can absorb are listed with it
    sentence : what it says to a reader
    silent : what is in the 95 % set however small its probability: no effect, or a force the equations lack
    """

    name: str
    condition: Callable[[Facts], bool]
    word: Word
    effects: Literal["nothing", "rivals", "sure", "best", "coefficient"]
    confounded: Literal["nothing", "all", "along"]
    sentence: str
    silent: Literal["", "none", "model_form"] = ""


def nobody_needs(word: str, rule: str) -> bool:
    """Whether a verdict stands on no effect: what gains is no more than a model form may leave."""
    return word in ("none", "model_form") or rule == UNLISTED_OVER_FORM


def _unlisted_acts(f: Facts) -> bool:
    """Whether a cause that is not listed acts for sure, whatever else does, and something is left that a free
    force explains better than one of the motion and the controls: asked, not assumed."""
    left = f.free_shows and (f.rest_shows or not f.explains)
    return left and f.outside_acts >= NAMING_PROBABILITY and CAUSE_OVER_MOTION <= f.over_motion < math.inf


RULES: tuple[Rule, ...] = (
    Rule(
        "unlisted cause",
        lambda f: f.free_shows and f.outside > EVEN_ODDS and not f.over_motion < CAUSE_OVER_MOTION,
        "outside", "nothing", "nothing",
        "a free signal gains more than chance allows, and a cause that is not listed is more probable than "
        "all others together",
    ),
    Rule(
        "force of the motion",
        lambda f: f.free_shows and f.outside > EVEN_ODDS and not f.over_motion > -CAUSE_OVER_MOTION,
        "model_form", "nothing", "nothing",
        "a free signal gains more than chance allows, and what is left beside all effects is explained "
        "better by a force of the motion and the controls of some shape",
        silent="model_form",
    ),
    Rule(
        CAUSE_OR_FORM,
        lambda f: f.free_shows and f.outside > EVEN_ODDS,
        "ambiguous", "rivals", "nothing",
        "a free signal gains more than chance allows, and a force of the motion and the controls of some "
        "shape explains about as much of what is left beside all effects",
        silent="model_form",
    ),
    Rule(
        UNLISTED_OVER_FORM,
        lambda f: _unlisted_acts(f)
        and f.form and (not f.gains or f.widens or f.none > EVEN_ODDS or f.covered),
        "outside", "nothing", "nothing",
        "what effects gain is no more than a force of the motion may leave, but a free force explains more "
        "of what is left than any such force, and a cause that is not listed acts with at least "
        f"{NAMING_PROBABILITY:.0%}",
    ),
    Rule(
        BESIDE_FORM,
        lambda f: f.form and f.moved and (not f.gains or f.widens or f.none > EVEN_ODDS or f.covered),
        "coefficients", "nothing", "nothing",
        "a force that depends on the motion and that the equations lack is needed; whatever it is, a "
        "coefficient lies further off than stated, and what effects gain beside it is no more than such a "
        "force may leave",
        silent="model_form",
    ),
    Rule(
        "model form",
        lambda f: f.form and (not f.gains or f.widens or f.none > EVEN_ODDS or f.covered),
        "model_form", "nothing", "nothing",
        "a force that depends on the motion and that the equations lack is needed, and what effects gain "
        "beside it is no more than such a force may leave; a coefficient further off than stated may stand "
        "for it",
        silent="model_form",
    ),
    Rule(
        "shapes of a model form",
        lambda f: f.of_motion,
        "model_form", "nothing", "nothing",
        "several effects explain most together, and those that are sure depend on the motion alone: shapes "
        "of a force that the equations lack",
        silent="model_form",
    ),
    Rule(
        "coefficients moved",
        lambda f: not f.gains and f.none_in_set and f.none < EVEN_ODDS
        and f.conflict > max(f.conflict_by_chance, PRIOR_CONFLICT),
        "coefficients", "nothing", "all",
        "no effect gains more than chance allows, and a coefficient moves further than chance and its prior "
        "allow",
    ),
    Rule(
        "nothing beyond chance",
        lambda f: not f.gains and f.none + f.undetectable + (0.0 if f.free_shows else f.outside) > EVEN_ODDS,
        "none", "nothing", "nothing",
        "no effect gains more than chance allows, and no effect, or what these runs cannot tell from it, is "
        "more probable than not",
        silent="none",
    ),
    Rule(
        "faint",
        lambda f: not f.gains,
        "ambiguous", "rivals", "nothing",
        "no effect gains more than chance allows, yet no effect is less probable than not",
    ),
    Rule(
        "faint coefficient, probably none",
        lambda f: f.widens and f.none_in_set and f.none > EVEN_ODDS,
        "none", "nothing", "nothing",
        "a wrong coefficient explains most, and no error at all is more probable than not",
        silent="none",
    ),
    Rule(
        "faint coefficient",
        lambda f: f.widens and f.none_in_set,
        "ambiguous", "nothing", "nothing",
        "a wrong coefficient explains most, and no error at all cannot be excluded",
    ),
    Rule(
        UNLISTED_BESIDE,
        lambda f: _unlisted_acts(f) and f.most_acts < NAMING_PROBABILITY,
        "outside", "nothing", "nothing",
        f"a cause that is not listed acts with at least {NAMING_PROBABILITY:.0%}, whichever others do, of "
        "which none is as probable, and a free force explains more of what is left than one of the motion "
        "and the controls",
    ),
    Rule(
        "unsure coefficient",
        lambda f: f.widens and f.acts < NAMING_PROBABILITY,
        "ambiguous", "rivals", "all",
        f"a wrong coefficient explains most, with less than {NAMING_PROBABILITY:.0%}",
    ),
    Rule(
        "wrong coefficient",
        lambda f: f.widens,
        "coefficients", "coefficient", "all",
        f"a wrong coefficient explains most, with at least {NAMING_PROBABILITY:.0%}",
    ),
    Rule(
        "refuted by the runs",
        lambda f: f.runs_refute and f.explains,
        "ambiguous", "rivals", "nothing",
        "runs are predicted worse from the others with the best explanation than without it",
    ),
    Rule(
        "several sure",
        lambda f: f.effects > 1 and f.sure > 1,
        "several", "sure", "all",
        f"several effects are each needed, and each acts with at least {NAMING_PROBABILITY:.0%}",
    ),
    Rule(
        NONE_SURE,
        lambda f: f.effects > 1 and f.sure == 0,
        "ambiguous", "rivals", "all",
        f"several effects explain most together, and none of them both acts with {NAMING_PROBABILITY:.0%} "
        "and passes what else a name asks for",
    ),
    Rule(
        "one sure beside a model form",
        lambda f: f.effects > 1 and f.others_covered and not (f.rest_shows or f.runs_disagree)
        and f.explains,
        "effect", "sure", "nothing",
        f"the effect acts with at least {NAMING_PROBABILITY:.0%}; others gain no more than what the model "
        "form may leave, and nothing else beyond chance is left",
    ),
    Rule(
        "several, one sure",
        lambda f: f.effects > 1,
        "effect_with_remainder", "sure", "all",
        f"of several effects one acts with at least {NAMING_PROBABILITY:.0%}; what is beside it is open",
    ),
    Rule(
        "confounded with coefficients",
        lambda f: f.absorbed > CONFOUNDED_SHARE and f.acts < NAMING_PROBABILITY
        and f.re_tuned > 1 - NAMING_PROBABILITY,
        "coefficients", "nothing", "along",
        "the coefficients' own uncertainty can imitate the best explanation on these runs, and with "
        f"{1 - NAMING_PROBABILITY:.0%} or more does",
    ),
    Rule(
        "probably none",
        lambda f: f.none_in_set and f.none > EVEN_ODDS,
        "none", "nothing", "nothing",
        "an effect gains, and no effect is still more probable than not",
        silent="none",
    ),
    Rule(
        NONE_LEFT,
        lambda f: f.none_in_set,
        "ambiguous", "rivals", "nothing",
        "an effect gains, and no effect cannot be excluded",
    ),
    Rule(
        UNSURE,
        lambda f: f.acts < NAMING_PROBABILITY,
        "ambiguous", "rivals", "nothing",
        f"the best explanation acts with less than {NAMING_PROBABILITY:.0%}",
    ),
    Rule(
        LEEWAY,
        lambda f: f.leeway,
        "ambiguous", "rivals", "nothing",
        "without a reading of v the leeway of a constant side force, as of one screw, reads the same as the "
        "best explanation",
    ),
    Rule(
        NO_SIZE_BESIDE_FORM,
        lambda f: f.form and f.idle,
        "model_form", "nothing", "nothing",
        "a force that depends on the motion and that the equations lack is needed, and the sizes of the best "
        "explanation beside it lie so near to off, by their own deviations, that they are worth less than a "
        "name asks for, or their intervals hold no effect at all",
        silent="model_form",
    ),
    Rule(
        "effect without size",
        lambda f: f.idle,
        "ambiguous", "rivals", "nothing",
        "the sizes of the best explanation lie so near to off, by their own deviations, that they are worth "
        "less than a name asks for, or their intervals hold no effect at all",
    ),
    Rule(
        TURNS_BY_ITSELF,
        lambda f: f.turns_beside,
        "ambiguous", "rivals", "nothing",
        "every run turns to one side with the rudder amidships, which no sensor does; what turns the vehicle "
        "also sets it aside, and these channels do not tell that from the error of the sensor",
    ),
    Rule(
        "effect with a remainder",
        lambda f: f.rest_shows or f.runs_disagree or not f.explains,
        "effect_with_remainder", "best", "nothing",
        f"the effect acts with at least {NAMING_PROBABILITY:.0%}; a free signal still gains, runs "
        f"disagree about it, or it "
        "does not follow the data",
    ),
    Rule(
        "effect",
        lambda f: True,
        "effect", "best", "nothing",
        f"the effect acts with at least {NAMING_PROBABILITY:.0%}, and nothing beyond chance is left",
    ),
)  # fmt: skip


def deciding(facts: Facts) -> Rule:
    """The first rule whose condition holds."""
    return next(rule for rule in RULES if rule.condition(facts))
