"""One verdict laid beside its answer.

Takes an `Answer` and a verdict (the plain data of diagnosis.json; None where the diagnosis failed). Gives a
frozen `ScoredCase`: every count that scoring needs, and in one sentence why a miss was missed. Does not
average.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from bayesid.benchmark.protocol.answers import Answer
from bayesid.benchmark.protocol.cause_families import FAMILIES, by_family, families_of, family_of, places_of
from bayesid.benchmark.protocol.noise_scale import largest_overestimate

# Design note, section 9: detectable; told apart from every other family; hidden by the coefficients.
DETECTABLE_NONCENTRALITY, ISOLABLE_NONCENTRALITY, CONFOUNDED_SHARE = 25.0, 10.0, 0.98
NAMING_VERDICTS = ("effect", "effect_with_remainder", "several")
REJECTING_VERDICTS = ("outside", "effect_with_remainder")
LEAST_SCORED_PROBABILITY = 1e-6  # a stated probability below one in a million is scored as that
LOCATED_EVIDENCE = 20.0  # evidence of a free signal from which its place counts
# What a failed diagnosis is taken to have said: the prior.
_PRIOR = {"none": 0.5, "outside": 0.1}


@dataclass(frozen=True)
class ScoredCase:
    """A judged verdict; nan and None where a quantity does not apply.

    Attributes
    ----------
    stratum : "none", "outside", "faint" (D < 25), "hidden", "not isolable", "clear", "unweighed"
    noncentrality, absorbed, margin, rival : of the plainest cause (see `detectability`)
    least, deepest : smallest noncentrality and largest absorbed share of all its causes
    word, named, top, stated : verdict, named families, most probable family, and the stated probability that
        it acts, alone or with others
    right : families that are right
    acceptable : families that are right, and none where the cause is below detectability
    p_right, brier, log : probability of the right families and scores
    covered, size : whether the 95 % set holds what is acceptable, and how many families it has
    outcome : right, in part, set, missed, wrong name, false alarm, ...
    reason : of a miss, from the numbers
    parameters : (effect, parameter, error, error in stated sd) where the right effect is named
    coefficients : (number within two stated sd, number) under the chosen model
    place, located : channel the verdict gives, all hypotheses counted, and whether it is allowed (None:
        evidence of a free signal below 20)
    alone : whether the channel in which a free signal gains most is allowed
    before, after, shrink : held-out excess of the recalibrated and of the diagnosed model, and the ratio
    worst_absorbed : largest absorbed share among effects named alone
    """

    name: str
    kind: str
    factors: Mapping[str, str]
    planted: tuple[str, ...]
    sizes: tuple[float, ...]
    stratum: str
    noncentrality: float
    absorbed: float
    margin: float
    rival: str
    least: float
    deepest: float
    word: str
    named: frozenset[str]
    top: str
    stated: float
    right: frozenset[str]
    acceptable: frozenset[str]
    p_right: float
    brier: float
    log: float
    covered: bool
    size: int
    outcome: str
    reason: str
    parameters: tuple[tuple[str, str, float, float], ...]
    coefficients: tuple[int, int]
    place: str | None
    located: bool | None
    alone: bool | None
    before: float
    after: float
    shrink: float
    worst_absorbed: float
    cost: float
    dof: int

    @property
    def fate(self) -> str:
        """Where the verdict went: right, nearest rival, other family, none, outside, coefficients, ..."""
        if self.outcome in ("right", "rejected"):
            return "right"
        if self.word in ("none", "outside", "coefficients", "model_form", "failed"):
            return self.word
        if self.word == "ambiguous":
            return "cannot tell"
        if self.named & self.right:
            return "right"
        return "nearest rival" if family_of(self.rival) in self.named else "other family"


def judge(answer: Answer, verdict: Mapping[str, Any] | None, cost: float = math.nan) -> ScoredCase:
    """Judge one bundle; `cost` is its CPU time [s]."""
    record: Mapping[str, Any] = verdict or {
        "verdict": "failed",
        "effects": [],
        "set95": [],
        "probabilities": {},
    }
    right = answer.families
    shown = [c.shown for c in answer.causes if c.shown is not None]
    plain = max(shown, key=lambda s: s.noncentrality, default=None)
    stratum = _stratum(answer, plain)
    probability = by_family(record["probabilities"] or _PRIOR | dict.fromkeys(FAMILIES, 0.4 / len(FAMILIES)))
    total = sum(probability.values())
    probability = {n: p / total for n, p in probability.items()} if total > 0 else probability
    top = max(probability, key=lambda n: probability[n])
    acceptable = right | {"none"} if stratum == "faint" else right
    if stratum == "hidden" and record["verdict"] == "coefficients":
        acceptable = acceptable | {"coefficient_error"}
    names = [e["name"] for e in record["effects"]]
    named = families_of(names) if record["verdict"] in NAMING_VERDICTS else frozenset()
    stated_set = families_of(record["set95"])
    p_right = sum(probability.get(f, 0.0) for f in right)
    target = dict.fromkeys(right, 1.0 / len(right))
    brier = sum((p - target.get(n, 0.0)) ** 2 for n, p in probability.items())
    gap = record.get("gap") or {}
    shrink, before, after = (_number(gap.get(k)) for k in ("shrink", "before", "after"))
    place, located, alone = _located(answer, record)
    covered = bool(stated_set & acceptable) if answer.kind != "two" else right <= stated_set or (
        stratum == "faint" and "none" in stated_set)  # fmt: skip
    outcome = _outcome(answer, record, named, stated_set, bool(plain and plain.absorbed > CONFOUNDED_SHARE))
    return ScoredCase(
        name=answer.name,
        kind=answer.kind,
        factors=answer.factors,
        planted=tuple(c.name + (f" ({c.variant})" if c.variant else "") for c in answer.causes),
        sizes=tuple(c.size for c in answer.causes),
        stratum=stratum,
        noncentrality=plain.noncentrality if plain else (0.0 if not answer.causes else math.nan),
        absorbed=plain.absorbed if plain else math.nan,
        margin=plain.margin if plain else math.nan,
        rival=plain.rival if plain else "",
        least=min((s.noncentrality for s in shown), default=math.nan),
        deepest=max((s.absorbed for s in shown), default=math.nan),
        word=record["verdict"],
        named=named,
        top=top,
        stated=_acting(record, top, probability[top]),
        right=right,
        acceptable=acceptable,
        p_right=p_right,
        brier=brier,
        log=-math.log(max(min(p_right, 1.0), LEAST_SCORED_PROBABILITY)),
        covered=covered,
        size=len(stated_set),
        outcome=outcome,
        reason=_explained(answer, outcome, plain, record, named),
        parameters=_parameters(answer, record),
        coefficients=_coefficients(answer, record),
        place=place,
        located=located,
        alone=alone,
        before=before,
        after=after,
        shrink=shrink,
        worst_absorbed=_absorbed(record, names),
        cost=cost,
        dof=int(answer.factors.get("dof") or 3),
    )


def _acting(record: Mapping[str, Any], top: str, alone: float) -> float:
    """Stated probability that a family acts, alone or with others; older verdicts state only shares."""
    acting = record.get("acting")
    return min(by_family(acting).get(top, 0.0), 1.0) if acting else alone


def _stratum(answer: Answer, plain: Any) -> str:
    if answer.kind == "none":
        return "none"
    if plain is None:
        return "outside" if answer.kind == "outside" else "unweighed"
    if plain.noncentrality < DETECTABLE_NONCENTRALITY:
        return "faint"
    if answer.kind == "outside":
        return "outside"
    if plain.absorbed > CONFOUNDED_SHARE and answer.causes[0].name != "coefficient_error":
        return "hidden"
    return "not isolable" if plain.margin < ISOLABLE_NONCENTRALITY else "clear"


def _outcome(answer: Answer, record: Mapping[str, Any], named: frozenset[str], stated_set: frozenset[str],
             hidden: bool) -> str:  # fmt: skip
    word, right = record["verdict"], answer.families
    if word == "failed":
        return "failed"
    if answer.kind == "none":
        if word == "none":
            return "right"
        return "wrong name" if named else "false alarm"
    if answer.kind == "outside":
        if word in REJECTING_VERDICTS or (word == "ambiguous" and "outside" in stated_set):
            return "right"
        if named:
            return "wrong name"
        return "no gap" if word == "none" else "missed"
    if named:
        if named - right:
            return "in part" if named & right and answer.kind == "two" else "wrong name"
        return "right" if right <= named else "in part"
    if word == "coefficients" and ("coefficient_error" in right or hidden):
        return "right"
    if word == "none":
        return "no gap"
    if word == "outside" and answer.kind == "variant":
        return "rejected"
    return "set" if right & stated_set else "missed"


def _explained(
    answer: Answer, outcome: str, plain: Any, record: Mapping[str, Any], named: frozenset[str]
) -> str:
    """Reason of a miss, and whether the environment was misjudged meanwhile."""
    reason = _reason(answer, outcome, plain, record, named)
    return (
        "; ".join(part for part in (reason, largest_overestimate(answer, record)) if part) if reason else ""
    )


def _reason(
    answer: Answer, outcome: str, plain: Any, record: Mapping[str, Any], named: frozenset[str]
) -> str:
    """Why a verdict is not simply right, from the numbers of answer and verdict."""
    if outcome == "right" or outcome == "rejected":
        return ""
    if outcome == "failed":
        return "the diagnosis did not end"
    if answer.kind == "none":
        where = record.get("where", {}).get("channel")
        names = ", ".join(sorted(named)) or record["verdict"]
        sea = answer.factors.get("sea", "")
        place = where or "no channel"
        return f"nothing planted; {names}; a free signal gains {_top_gain(record)} in {place}, sea {sea}"
    if plain is None:
        return "detectability of the cause is not known"
    d = f"D = {plain.noncentrality:.3g}"
    if plain.noncentrality < DETECTABLE_NONCENTRALITY:
        hidden = f", {plain.absorbed:.1%} absorbed by the coefficients" if plain.absorbed > 0.9 else ""
        return f"below detectability ({d}{hidden})"
    if answer.kind == "outside" and not named:
        return f"a free signal gains {_top_gain(record)} over the environment the verdict assumes ({d})"
    if answer.kind == "outside":
        return f"named what is most like it ({d}, {_top_gain(record)} of a free signal)"
    if answer.kind == "two" and outcome == "in part":
        faint = [
            c.name for c in answer.causes if c.shown and c.shown.noncentrality < DETECTABLE_NONCENTRALITY
        ]
        if faint:
            return f"{' and '.join(faint)} below detectability"
    if plain.absorbed > CONFOUNDED_SHARE:
        return f"absorbed by the coefficients to {plain.absorbed:.1%} ({d})"
    if plain.margin == plain.margin and plain.margin < ISOLABLE_NONCENTRALITY:
        return f"expected margin over {plain.rival} only {plain.margin:.1f} ({d})"
    if family_of(plain.rival) in named:
        return f"named its nearest rival {plain.rival}, expected margin {plain.margin:.0f} ({d})"
    groups = [g for g in record.get("ambiguity_groups", []) if families_of(g) & answer.families]
    if named and any(families_of(g) & named for g in groups):
        return f"named another of a group the diagnosis itself called alike ({d})"
    if answer.kind == "variant":
        return f"the catalogue words this cause otherwise: {answer.causes[0].variant} ({d})"
    if record["verdict"] == "outside":
        return f"the best refit left a remainder or did not arrive ({d})"
    if outcome == "set":
        return f"in the set without being named ({d})"
    return f"detectable ({d}), margin {plain.margin:.3g} over {plain.rival or 'none'}; unexplained"


def _top_gain(record: Mapping[str, Any]) -> str:
    evidence = [v for v in record.get("where", {}).get("evidence", {}).values() if v is not None]
    return f"{max(evidence):.1f} nats" if evidence else "nothing known"


def _located(answer: Answer, record: Mapping[str, Any]) -> tuple[str | None, bool | None, bool | None]:
    where = record.get("where") or {}
    evidence = {n: float(v) for n, v in where.get("evidence", {}).items() if v is not None}
    place = where.get("channel")
    allowed = {p for c in answer.causes for p in places_of(c.name)}
    if not allowed or not evidence or max(evidence.values()) <= LOCATED_EVIDENCE:
        return place, None, None
    return place, place in allowed, max(evidence, key=lambda n: evidence[n]) in allowed


def _parameters(answer: Answer, record: Mapping[str, Any]) -> tuple[tuple[str, str, float, float], ...]:
    out = []
    named = {e["name"]: e["parameters"] for e in record["effects"] if record["verdict"] in NAMING_VERDICTS}
    for cause in answer.causes:
        for name, true in (cause.parameters or {}).items():
            found = named.get(cause.name, {}).get(name)
            if found is None:
                continue
            error = float(found["value"]) - float(true)
            if cause.name == "wind" and name == "from":
                error = (error + math.pi) % (2 * math.pi) - math.pi
            sd = float(found["sd"])
            out.append(
                (cause.name, name, error / abs(true) if true else math.nan, error / sd if sd else math.nan)
            )
    return tuple(out)


def _coefficients(answer: Answer, record: Mapping[str, Any]) -> tuple[int, int]:
    """Coefficients within two stated deviations, where the chosen structure is right."""
    stated = record.get("coefficients") or {}
    named = (
        families_of(e["name"] for e in record["effects"])
        if record["verdict"] in NAMING_VERDICTS
        else frozenset()
    )
    sound = record["verdict"] == "none" if answer.kind == "none" else named == answer.families
    if not stated or not answer.coefficients or not sound or answer.kind == "variant":
        return 0, 0
    from bayesid.errors import BayesidError
    from bayesid.model.vehicles import load_vehicle

    try:
        nominal = load_vehicle(answer.factors["vehicle"]).coef
    except (BayesidError, KeyError):
        return 0, 0
    inside = count = 0
    for name, draw in answer.coefficients.items():
        if name in stated and name in nominal and stated[name]["sd"]:
            true = nominal[name] * (1.0 + draw)
            inside += abs(stated[name]["value"] - true) <= 2.0 * stated[name]["sd"]
            count += 1
    return inside, count


def _absorbed(record: Mapping[str, Any], names: list[str]) -> float:
    if record["verdict"] not in ("effect", "effect_with_remainder") or len(names) != 1:
        return math.nan
    return _number((record.get("detectability") or {}).get(names[0], {}).get("absorbed"))


def _number(value: Any) -> float:
    return float(value) if isinstance(value, int | float) and math.isfinite(value) else math.nan
