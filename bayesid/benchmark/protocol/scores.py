"""Scores of a whole campaign of verdicts against bars stated beforehand, with intervals and counts.

Takes judged `ScoredCase`s. Gives frozen `Quantity` rows. A bar is met when the score itself is within it,
undecided when only the 95 % interval reaches it, missed otherwise; every sheet has a control that must be
missed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bayesid.benchmark.protocol.answers import Answer
from bayesid.benchmark.protocol.count_intervals import bootstrap, clopper
from bayesid.benchmark.protocol.judgement import (
    CONFOUNDED_SHARE,
    DETECTABLE_NONCENTRALITY,
    ISOLABLE_NONCENTRALITY,
    NAMING_VERDICTS,
    REJECTING_VERDICTS,
    ScoredCase,
    judge,
)

LEAST_BIN_CASES = 20  # cases in a bin of the calibration
CALIBRATION_EDGES = (0.0, 0.5, 0.8, 0.95, 0.99, 1.0)
CPU_MINUTES = {3: 10.0, 6: 120.0}
MET, UNDECIDED, MISSED = STANDINGS = ("met", "undecided", "missed")


@dataclass(frozen=True)
class Quantity:
    """One line of the sheet.

    Attributes
    ----------
    name, about : what is scored, and over which cases
    value, interval : score and 95 % interval
    hits, count : of a share; `hits` is -1 for a mean or quantile over `count` cases
    bar : (low, high) the score may have, None where none is set
    standing : one of STANDINGS; "" without cases or without a bar
    """

    name: str
    about: str
    value: float
    interval: tuple[float, float]
    hits: int
    count: int
    bar: tuple[float, float] | None
    standing: str


def standing(value: float, interval: tuple[float, float], bar: tuple[float, float] | None) -> str:
    """Met where the score itself is within its bar, undecided where only its interval is, else missed.

    "" without a bar, without a score, or without an interval.
    """
    if bar is None or not all(math.isfinite(x) for x in (value, *interval)):
        return ""
    if bar[0] <= value <= bar[1]:
        return MET
    return UNDECIDED if interval[1] >= bar[0] and interval[0] <= bar[1] else MISSED


def share(name: str, about: str, hits: Sequence[bool], bar: tuple[float, float] | None = None) -> Quantity:
    """A proportion."""
    k, n = int(sum(hits)), len(hits)
    interval = clopper(k, n)
    value = k / n if n else math.nan
    return Quantity(name, about, value, interval, k, n, bar, standing(value, interval, bar))


def average(name: str, about: str, values: Sequence[float], bar: tuple[float, float] | None = None,
            statistic: Callable[..., np.ndarray] = np.mean) -> Quantity:  # fmt: skip
    """A mean, or another statistic that takes `axis`."""
    x = np.array([v for v in values if math.isfinite(v)])
    interval = bootstrap(x, statistic)
    value = float(statistic(x, axis=0)) if x.size else math.nan
    return Quantity(name, about, value, interval, -1, x.size, bar, standing(value, interval, bar))


def _tenth(x: np.ndarray, axis: int) -> np.ndarray:
    return np.quantile(x, 0.1, axis=axis)


def at_least(x: float) -> tuple[float, float]:
    return x, math.inf


def at_most(x: float) -> tuple[float, float]:
    return -math.inf, x


def score_quantities(
    cases: Sequence[ScoredCase], oracle: Mapping[str, float] | None = None, dof: int = 3
) -> list[Quantity]:
    """All quantities with a bar stated beforehand.

    Parameters
    ----------
    cases : of one number of degrees of freedom
    oracle : bundle -> shrink of a refit with the true effects on the same data; 1 where not given
    """
    effect = [c for c in cases if c.kind == "effect"]
    isolable = [
        c
        for c in effect
        if c.noncentrality >= DETECTABLE_NONCENTRALITY and c.margin >= ISOLABLE_NONCENTRALITY
    ]
    clear = [c for c in isolable if c.stratum == "clear"]
    none = [c for c in cases if c.kind == "none"]
    outside = [c for c in cases if c.kind == "outside"]
    variant = [c for c in cases if c.kind == "variant" and c.noncentrality >= DETECTABLE_NONCENTRALITY]
    two = [c for c in cases if c.kind == "two" and c.least >= DETECTABLE_NONCENTRALITY]
    named = [c for c in cases if c.word in NAMING_VERDICTS]
    single = [*none, *effect, *outside]
    plain = [c for c in single if c.kind == "none" or c.noncentrality >= DETECTABLE_NONCENTRALITY]
    located = [c for c in cases if c.located is not None]
    gap = [c for c in outside if c.before >= 0.5]
    costs = [c.cost for c in cases if math.isfinite(c.cost)]
    out = [
        share("top-1 by family", "one effect, D >= 25, margin >= 10", [c.top in c.right for c in isolable],
              at_least(0.95)),
        share("named by family", "the same, not hidden; the verdict names it",
              [c.outcome == "right" for c in clear]),
        share("95 % set holds the answer", "none, one effect, outside; none counts where D < 25",
              [c.covered for c in single], at_least(0.93)),
        average("families in the 95 % set", "the same", [float(c.size) for c in single], at_most(2.5)),
        share("false alarm on none", "any verdict but none", [c.word != "none" for c in none], at_most(0.02)),
        share("wrong name", "of all verdicts that name effects", [bool(c.named - c.right) for c in named],
              at_most(0.03)),
        share("outside rejected or with remainder", "outside, held-out gap >= 0.5",
              [c.outcome == "right" for c in gap], at_least(0.85)),
        share("false name on outside", "outside, named without a remainder",
              [c.word in NAMING_VERDICTS and c.word not in REJECTING_VERDICTS for c in outside],
              at_most(0.05)),
        share("variants: right class", "another form of a named cause, D >= 25",
              [c.top in c.right or bool(c.named & c.right) for c in variant], at_least(0.8)),
        share("variants: misfit flagged", "named, and more than 10 % of the gap left",
              [c.word in REJECTING_VERDICTS for c in variant if c.named and c.shrink < 0.9]),
        share("channel right", "the verdict's; evidence of a free signal above 20",
              [bool(c.located) for c in located], at_least(0.9)),
        share("channel right", "of the free signal alone", [bool(c.alone) for c in located]),
        share("two effects both found", "both D >= 25", [c.right <= c.named for c in two], at_least(0.85)),
        share("two effects both found", "the same, neither hidden",
              [c.right <= c.named for c in two if c.deepest <= CONFOUNDED_SHARE]),
        average("log score", "none; outside and one effect with D >= 25", [c.log for c in plain],
                at_most(0.5)),
        average("log score", "all of one class", [c.log for c in single]),
        average("Brier score", "all of one class", [c.brier for c in single]),
    ]  # fmt: skip
    out += _shrinks(cases, oracle or {})
    parameters = [abs(z) <= 2.0 for c in cases for *_, z in c.parameters if math.isfinite(z)]
    inside, count = (sum(c.coefficients[k] for c in cases) for k in (0, 1))
    out += [
        share("effect parameters within 2 sd", "right effect named", parameters, (0.90, 0.99)),
        share("coefficients within 2 sd", "right structure chosen",
              [True] * inside + [False] * (count - inside), (0.90, 0.99)),
        share("hidden effects named alone", "absorbed above 0.98 by the diagnosis' own account",
              [c.worst_absorbed > CONFOUNDED_SHARE for c in named if c.word != "several"], at_most(0.0)),
        average("CPU per bundle [s]", "median", costs, at_most(CPU_MINUTES[dof]), np.median),
    ]  # fmt: skip
    return out + _of_competitions(cases)


def _of_competitions(cases: Sequence[ScoredCase]) -> list[Quantity]:
    """What competitions of fault diagnosis report of every entry (Kurtoglu et al. 2009), without bars.

    A verdict that says that something is there is a detection; one that failed says nothing.
    """
    caused = [c for c in cases if c.kind != "none"]
    plain = [c for c in caused if c.noncentrality >= DETECTABLE_NONCENTRALITY]
    silent = ("none", "failed")
    nulls = [c for c in cases if c.kind == "none"]
    one = [c for c in caused if c.kind != "two"]
    return [
        share("detection rate", "something planted; any verdict but none",
              [c.word not in silent for c in caused]),
        share("detection rate", "the same, D >= 25", [c.word not in silent for c in plain]),
        share("false-alarm rate", "nothing planted; any verdict but none",
              [c.word not in silent for c in nulls]),
        average("mean probability of the true cause", "one cause planted", [c.p_right for c in one]),
        average("mean probability of the true cause", "the same, D >= 25",
                [c.p_right for c in one if c.noncentrality >= DETECTABLE_NONCENTRALITY]),
    ]  # fmt: skip


def _shrinks(cases: Sequence[ScoredCase], oracle: Mapping[str, float]) -> list[Quantity]:
    known = [
        c
        for c in cases
        if c.kind in ("effect", "two", "variant") and c.noncentrality >= DETECTABLE_NONCENTRALITY
    ]
    gaps = [c for c in known if c.before > 0.1 and math.isfinite(c.shrink)]
    ratio = [max(c.shrink, -1.0) / o for c in gaps if (o := oracle.get(c.name, 1.0)) > 0.05]
    against = "the refit with the true effects" if oracle else "the floor (no oracle given: a lower bound)"
    about = f"planted effects, held-out gap > 0.1, against {against}"
    return [
        average("shrink efficiency, median", about, ratio, at_least(0.97), np.median),
        average("shrink efficiency, 10th percentile", about, ratio, at_least(0.85), _tenth),
    ]


@dataclass(frozen=True)
class Bin:
    """Answers stated with similar probability: mean stated, share of hits, interval, number, standing."""

    stated: float
    hit: float
    interval: tuple[float, float]
    count: int
    standing: str


def calibration(cases: Sequence[ScoredCase], slack: float = 0.07) -> list[Bin]:
    """Most probable answer, alone or with others, against how often it is acceptable.

    In bins of at least `LEAST_BIN_CASES` where there are so many.
    """
    ordered = sorted(cases, key=lambda c: c.stated)
    groups: list[list[ScoredCase]] = []
    for low, high in zip(CALIBRATION_EDGES[:-1], CALIBRATION_EDGES[1:], strict=True):
        inside = [c for c in ordered if low < c.stated <= high or (low == 0.0 and c.stated == 0.0)]
        if groups and (len(groups[-1]) < LEAST_BIN_CASES):
            groups[-1] += inside
        elif inside:
            groups.append(inside)
    if len(groups) > 1 and len(groups[-1]) < LEAST_BIN_CASES:
        last = groups.pop()
        groups[-1] += last
    out = []
    for group in groups:
        hits = sum(c.top in c.acceptable for c in group)
        stated, interval = float(np.mean([c.stated for c in group])), clopper(hits, len(group))
        share_hit = hits / len(group)
        state = standing(share_hit, interval, (stated - slack, stated + slack))
        out.append(Bin(stated, share_hit, interval, len(group), state))
    return out


def shuffled(answers: Mapping[str, Answer], verdicts: Mapping[str, dict], seed: int = 0) -> Quantity:
    """Control that must fail: every bundle is judged by the verdict of another one of its dof."""
    rng = np.random.default_rng(seed)
    cases: list[ScoredCase] = []
    for dof in sorted({a.factors.get("dof", "3") for a in answers.values()}):
        names = [n for n in sorted(answers) if answers[n].factors.get("dof", "3") == dof and n in verdicts]
        if len(names) < 2:
            continue
        order = rng.permutation(names)
        cases += [
            judge(answers[a], verdicts[b]) for a, b in zip(order, np.roll(order, 1), strict=True)
        ]  # a ring: nobody keeps his own
    hits = [
        c.top in c.right for c in cases if c.kind == "effect" and c.noncentrality >= DETECTABLE_NONCENTRALITY
    ]
    return share(
        "control: verdicts of other bundles, top-1", "one effect, D >= 25; must fail", hits, at_least(0.95)
    )


def table(cases: Sequence[ScoredCase], key: Callable[[ScoredCase], str]) -> list[list[object]]:
    """Per value of `key`: number, right, top-1 acceptable, covered, mean set, wrong names, log score."""
    out: list[list[object]] = []
    for value in sorted({key(c) for c in cases}):
        some = [c for c in cases if key(c) == value]
        n = len(some)
        out.append([
            value, n, sum(c.outcome == "right" for c in some), sum(c.top in c.acceptable for c in some),
            sum(c.covered for c in some), float(np.mean([c.size for c in some])),
            sum(c.outcome == "wrong name" for c in some), float(np.mean([c.log for c in some])),
        ])  # fmt: skip
    return out
