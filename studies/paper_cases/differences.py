"""What the paper states beside what is found here: same or not, and the likely reason.

Takes records and facts; every "same" is decided from numbers. Does not simulate.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from studies.paper_cases.counts import axis_errors, errors_by_name, names_on_bound, on_bound, strays
from studies.paper_cases.similar import LIKE, UNLIKE
from studies.paper_cases.targets import Records, values

ON_BOUND = 5  # coefficients on the 25 % bounds in the paper's Case 3
POOR = 1.5  # "particularly": the axis' error over that of the next worst
SMALL = 0.02  # share of the force of an equation
NEAR, FAR = 1.0, 10.0  # m: predicted reasonably within a hundredth of the length; badly beyond a tenth


@dataclass(frozen=True)
class Statement:
    """One statement of the paper; `short` says the difference in the headline, empty where there is none."""

    what: str
    paper: str
    ours: str
    same: bool
    reason: str = ""
    short: str = ""


def statements(records: Records, facts: Mapping[str, Any]) -> list[Statement]:
    """The statements of the paper's results and discussion that numbers can decide."""
    return [
        _yaw(records, facts),
        _strays(records, facts),
        _bounds(records, facts),
        _final_cost(records),
        _similar(facts),
        _unusual(facts),
        _small(records, facts),
    ]


def _percent(found: Mapping[str, float]) -> str:
    return ", ".join(f"{axis} {error:.1f}" for axis, error in found.items()) + " %"


def _yaw(records: Records, facts: Mapping[str, Any]) -> Statement:
    found = axis_errors(records["1"], "goal")
    same = found["N"] > POOR * max(found["X"], found["Y"])
    plain = _percent(axis_errors(facts["plain"]["1"], None))
    by_name = errors_by_name(records["1"], "goal")
    worst = ", ".join(f"{n} {e:.0f} %" for n, (e, _) in list(by_name.items())[:3])
    return Statement(
        "Case 1, error per axis",
        'N "particularly poorly"',
        f"{_percent(found)} (rms, median of seeds); worst {worst}",
        bool(same),
        "" if same else (
            "Here X is as poor as N: v and r rise together, X_vv, X_vr and X_rr trade (explanation 4), and "
            "they "
            f"are three of only five coefficients of X. An early stop alone does not single out N: one plain "
            f"SQP call leaves {plain}. The paper's boat has other coefficients and is classified, so this "
            "cannot be settled here."
        ),
        "" if same else f"N is not particularly poor ({_percent(found)})",
    )  # fmt: skip


def _strays(records: Records, facts: Mapping[str, Any]) -> Statement:
    found = strays(records["2"], "goal")
    axes = sorted({n[0] for n in found})
    share = {n: row["share"] for n, row in facts["forces"].items()}
    weak = {a: min((n for n in share if n[0] == a), key=share.__getitem__) for a in "YN"}
    same = axes == ["X", "Y"] and len(found) == 2
    worst_y = next((n, e) for n, (e, _) in errors_by_name(records["2"], "goal").items() if n[0] == "Y")
    plain = axis_errors(facts["plain"]["2"], None)
    plain_strays = ", ".join(strays(facts["plain"]["2"], None)) or "none"
    named = ", ".join(f"{n} {e:.1f} %" for n, (e, _) in found.items()) or "none"
    return Statement(
        "Case 2, coefficients that stray",
        "one in X (X_vr and X_rr cancel), one in Y (small effect)",
        f"{named} (median error above 5 %); largest in Y: {worst_y[0]} {worst_y[1]:.1f} %",
        same,
        "" if same else (
            f"Smallest forces along the spiral: {weak['N']} in N, {weak['Y']} in Y. With exact gradients "
            f"those of Y "
            "come right before V has fallen by the paper's factor, N_vdot does not. Stopped earlier, Y is "
            "worse too: "
            f"one plain SQP call leaves Y {plain['Y']:.1f} % (rms; strays: {plain_strays})."
        ),
        "" if same else f"Case 2 strays in {' and '.join(found) or 'nothing'}, none in Y",
    )  # fmt: skip


def _bounds(records: Records, facts: Mapping[str, Any]) -> Statement:
    counts = on_bound(records["3"])
    low, middle, high = min(counts), float(np.median(counts)), max(counts)
    same = low <= ON_BOUND <= high
    which = ", ".join(f"{n} in {c}" for n, c in names_on_bound(records["3"]).most_common())
    plain = on_bound(facts["plain"]["3"])
    larger = "; ".join(
        f"{n.removeprefix('3-known')} %: {min(on_bound(runs))} to {max(on_bound(runs))}"
        for n, runs in records.items()
        if n.startswith("3-known")
    )
    return Statement(
        "Case 3, coefficients on the 25 % bounds",
        "five",
        f"{low} to {high} per fit, median {middle:g} ({which} of {len(counts)} fits)",
        same,
        "" if same else (
            "Here the 14 unknowns can make up for the wrong knowns almost wholly within the bounds. Knowns "
            f"wrong by more push more of them there ({larger or 'not tried'} on a bound per fit). An early "
            f"stop "
            f"is not the reason: one plain SQP call ends with {max(plain) or 'none'} at most. Which and how "
            f"many "
            "coefficients the paper freed, and how its errors of the knowns are distributed, is not stated."
        ),
        "" if same else f"{low} to {high} coefficients per fit end on a 25 % bound, not five",
    )  # fmt: skip


def _final_cost(records: Records) -> Statement:
    ends = values(records["3"], "end", "V")
    same = bool(ends.min() <= 2.3e2 <= ends.max())
    return Statement(
        "Case 3, V at the end",
        "2.3e2",
        f"{np.median(ends):.1g} ({ends.min():.1g} .. {ends.max():.1g})",
        same,
        "" if same else (
            "Exact gradients and restarts find a lower minimum. Five active bounds probably hold the "
            "paper's V "
            "up as well; here few are active."
        ),
        "" if same else f"V of Case 3 ends at {np.median(ends):.1g}, not 230",
    )  # fmt: skip


def _worst(facts: Mapping[str, Any], kind: str) -> list[tuple[float, float, str]]:
    found = [
        (
            float(np.median(row["goal"]["position"])),
            float(np.median(row["goal"]["heading"])),
            name,
        )
        for name, row in facts["predictions"].items()
        if row["kind"] == kind
    ]
    return sorted(found)


def _similar(facts: Mapping[str, Any]) -> Statement:
    like = _worst(facts, LIKE)
    same = like[-1][0] < NEAR
    return Statement(
        "Similar manoeuvres",
        "predicted reasonably",
        f"{like[0][0]:.2g} to {like[-1][0]:.2g} m, {like[0][1]:.2g} to {max(h for _, h, _ in like):.2g} deg "
        f"(medians; worst: {like[-1][2]})",
        same,
        short="" if same else f"a similar manoeuvre ({like[-1][2]}) is missed by {like[-1][0]:.2g} m",
    )


def _unusual(facts: Mapping[str, Any]) -> Statement:
    unlike, like = _worst(facts, UNLIKE), _worst(facts, LIKE)
    same = unlike[-1][0] > FAR
    return Statement(
        "Unusual manoeuvres",
        "predicted badly",
        f"{unlike[0][0]:.2g} to {unlike[-1][0]:.2g} m, {min(h for _, h, _ in unlike):.2g} to "
        f"{max(h for _, h, _ in unlike):.2g} deg (medians; worst: {unlike[-1][2]}), "
        f"{np.median([e for e, _, _ in unlike]) / np.median([e for e, _, _ in like]):.0f} times the similar "
        f"ones",
        same,
        "" if same else (
            "Worse, but not badly: model and records are perfect, so the search goes on until only "
            "combinations "
            "the spiral hardly shows are wrong, and two of these no manoeuvre shows at all. The paper "
            "prints no "
            "number for it."
        ),
        "" if same else f"unusual manoeuvres are missed by {unlike[-1][0]:.2g} m at most, worse but not "
        "badly",
    )  # fmt: skip


def _small(records: Records, facts: Mapping[str, Any]) -> Statement:
    share = {n: row["share"] for n, row in facts["forces"].items()}
    wrong = strays(records["1"], "goal")
    small = {n: share[n] for n in wrong if share[n] < SMALL}
    same = bool(small)
    listed = ", ".join(f"{n} {100 * s:.1g} %" for n, s in small.items()) or "none"
    others = ", ".join(f"{n} {100 * share[n]:.0f} %" for n in wrong if n not in small)
    beside = f"; but these stray with a larger force: {others}" if others else ""
    return Statement(
        "Small terms (explanation 3)",
        "some coefficients stray because their force is too small to matter",
        f"strays of Case 1 with a force below {100 * SMALL:.0f} % of their equation: {listed}{beside}",
        same,
        "A force can be large and still be unseen when another one takes its place: such strays come of "
        "coupling (explanation 4), not of size."
        if others
        else "",
        "" if same else "no coefficient strays because its force is small",
    )
