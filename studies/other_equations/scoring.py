"""One verdict on a vehicle with other equations laid beside its label.

Takes a label (see the README of `practice_foreign`) and a verdict (None where the diagnosis failed). Gives a
frozen `ScoredVerdict`. What counts as right depends on how large the effect is against what the tuned nominal
misses anyway. Verdict words are read as text, so that a new one needs no change of types here.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from bayesid.benchmark.protocol.cause_families import families_of, name_of
from bayesid.benchmark.protocol.judgement import NAMING_VERDICTS
from bayesid.benchmark.protocol.scores import Quantity, at_least, at_most, share
from bayesid.model.effects import CATALOGUE

LARGE, SMALL = 3.0, 1.0  # effect over form gap: above, a cause is to be found; below, only sensors show it
LARGEST_SET = 3
NO_CAUSE = ("none", "coefficients", "model_form")  # words that say no cause is needed
DENYING = ("none", "model_form")  # a set beside these words does not count as having found a cause
INSIDE = 1.96
FOUND, INSIDE_SHARE, ALL, WRONG_NAMES = 0.80, 0.90, 1.0, 0.05
SENSORS = families_of(e.name for e in CATALOGUE if e.port == "sensor")
REGIMES = ("large", "middle", "small", "none", "outside")


@dataclass(frozen=True)
class ScoredVerdict:
    """One bundle.

    Attributes
    ----------
    truth, regime, ratio : label, one of REGIMES, and effect over form gap
    word, named, stated_set : the verdict; named families (empty unless the word names), families of the set
    wrong : named families that are not labelled; no mistake of simulator or log is labelled
    how : in words what the verdict came to
    right : whether the rule of its regime is kept
    parameters : (effect, parameter, true, estimate, sd, inside) of rightly named effects
    """

    name: str
    truth: str
    regime: str
    ratio: float
    word: str
    named: frozenset[str]
    stated_set: frozenset[str]
    wrong: frozenset[str]
    how: str
    right: bool
    parameters: tuple[tuple[str, str, float, float, float, bool], ...]


def regime_of(label: Mapping[str, Any]) -> str:
    """One of REGIMES."""
    if label["label"] in ("none", "outside"):
        return str(label["label"])
    ratio = float(label["effect_over_form_gap"])
    return "large" if ratio > LARGE else "middle" if ratio >= SMALL else "small"


def scored(label: Mapping[str, Any], verdict: Mapping[str, Any] | None) -> ScoredVerdict:
    """Score one bundle."""
    regime, word = regime_of(label), verdict["verdict"] if verdict else "failed"
    causes = {name_of(e["name"]): e["params"] for e in label["effects"] if e["name"] != "none"}
    truth = frozenset() if regime in ("none", "outside") else families_of(causes)
    effects = verdict["effects"] if verdict else ()
    named = families_of(e["name"] for e in effects) if word in NAMING_VERDICTS else frozenset()
    for kind in ("simulator", "input"):  # verdicts kept before do not say
        named |= frozenset(f"{kind}: {name}" for name in (verdict.get(kind, ()) if verdict else ()))
    stated_set = families_of(verdict["set95"]) if verdict else frozenset()
    parameters = _parameters(causes, effects) if named & truth else ()
    inside = all(p[-1] for p in parameters)
    how, right = _outcome(regime, word, truth, named, stated_set, inside)
    return ScoredVerdict(
        label["name"], label["label"], regime, float(label["effect_over_form_gap"]), word, named, stated_set,
        named - truth, how, right, parameters,
    )  # fmt: skip


def _outcome(
    regime: str, word: str, truth: frozenset[str], named: frozenset[str], stated_set: frozenset[str],
    inside: bool,
) -> tuple[str, bool]:  # fmt: skip
    """What a verdict came to, and whether that is right in its regime."""
    if word == "failed":
        return "failed", False
    if regime == "none":
        told = _wrong(named) or ("no cause" if word in NO_CAUSE else f"alarm: {word}")
        return told, told == "no cause"
    if regime == "outside":
        told = _wrong(named) or ("outside" if word == "outside" else f"not rejected: {word}")
        return told, told == "outside"
    if named - truth:
        return ("cause and " if named & truth else "") + _wrong(named - truth), False
    if truth <= named:
        return ("named" if inside else "named, a parameter outside its interval"), inside
    small_set = len(stated_set) <= LARGEST_SET and word not in DENYING
    if truth <= named | (stated_set if small_set else frozenset()):
        return f"in a set of {len(stated_set)}", True
    if regime == "small" and (word in NO_CAUSE or (word == "ambiguous" and _open(truth, stated_set))):
        return ("silent" if word in NO_CAUSE else f"in a set of {len(stated_set)}"), True
    if named:
        return "one of two causes", False
    if truth <= stated_set:
        beside = f" beside the word {word}" if word in DENYING else ""
        return f"in a set of {len(stated_set)}{beside}", False
    if truth & stated_set:
        return "one of two causes in the set", False
    return ("silent" if word in NO_CAUSE else "not in the set"), False


def _open(truth: frozenset[str], stated_set: frozenset[str]) -> bool:
    return truth <= stated_set or bool(stated_set & {"none", "coefficient_error", "model_form"})


def _wrong(families: frozenset[str]) -> str:
    return f"wrong name: {', '.join(sorted(families))}" if families else ""


def _parameters(
    causes: Mapping[str, Mapping[str, float]], effects: Sequence[Mapping[str, Any]]
) -> tuple[tuple[str, str, float, float, float, bool], ...]:
    out = []
    for effect in effects:
        for name, true in causes.get(effect["name"], {}).items():
            if name not in effect["parameters"]:
                continue
            value, sd = (float(effect["parameters"][name][k]) for k in ("value", "sd"))
            error = value - float(true)
            if name == "from":
                error = (error + math.pi) % (2 * math.pi) - math.pi
            out.append((effect["name"], name, float(true), value, sd, abs(error) <= INSIDE * sd))
    return tuple(out)


def quantities(cases: Sequence[ScoredVerdict]) -> list[Quantity]:
    """The bars of the study, each with its count and whether it is met, missed or undecided."""

    def those(regime: str) -> list[bool]:
        return [c.right for c in cases if c.regime == regime]

    names = [family in c.wrong for c in cases for family in sorted(c.named)]
    inside = [p[-1] for c in cases for p in c.parameters]
    sensor = [
        bool(c.named) and not c.wrong
        for c in cases
        if c.regime == "small" and families_of(c.truth.split("+")) <= SENSORS
    ]
    found = "named, parameters within 95 %, or in a set of at most 3"
    return [
        share("cause found", f"effect over form gap above 3: {found}", those("large"), at_least(FOUND)),
        share("parameters within 95 %", "of effects rightly named", inside, at_least(INSIDE_SHARE)),
        share("cause found", "effect over form gap 1 to 3: the same; no bar", those("middle")),
        share("nothing overclaimed", "below 1: no cause, a set, or the cause itself", those("small"),
              at_least(ALL)),
        share("sensor cause named", "below 1, where sensors contradict each other; no bar", sensor),
        share("no cause where there is none", "`none`, `coefficients` or `model_form`", those("none"),
              at_least(ALL)),
        share("outside answered outside", "causes that are not in the list", those("outside"), at_least(ALL)),
        share("wrong names", "of all names given, second names too", names, at_most(WRONG_NAMES)),
    ]  # fmt: skip
