"""The checkable statements about the reproduction of Furlong et al. (2003), each with its number, bar and
verdict.

Takes the plain records of `simulated_recovery` and the facts the study collected. Does not simulate or draw.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

Records = Mapping[str, Sequence[Mapping[str, Any]]]
# With 14 unknowns these may stay off by more than 5 %: the track hardly depends on them (weakest singular
# vectors).
WEAK = {"X_rr", "N_vdot", "N_r|r|", "Y_rdot", "N_|v|r"}
NO_BAR = "-"  # a number shown beside the others; it decides nothing
STOPPED = "at the paper's stopping factor (V/V0 about 1e-11)"  # the stage "goal"; "carried on" is "end"


def values(records: Sequence[Mapping[str, Any]], *path: str) -> np.ndarray:
    """One number per seed, found by following keys."""
    found = []
    for record in records:
        item: Any = record
        for key in path:
            item = item[key]
        found.append(item)
    return np.array(found, dtype=float)


def _target(what: str, checks: Mapping[str, tuple[Any, str, bool]]) -> dict[str, Any]:
    return {
        "what": what,
        "value": {name: value for name, (value, _, _) in checks.items()},
        "bar": {name: bar for name, (_, bar, _) in checks.items()},
        "passes": {name: bool(ok) for name, (_, _, ok) in checks.items()},
        "pass": bool(all(ok for _, _, ok in checks.values())),
    }


def paper_targets(records: Records, facts: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """T1-T8 and T10. A bar over seeds holds for the worst seed unless it says median or share."""
    return {
        "T1": _case1(records["1"]),
        "T2": _case2(records["2"], records["2a"]),
        "T3": _case3(records["3"], records["3a"]),
        "T4": _rich(records["1"]),
        "T5": _redundancy(facts["equivalent"]),
        "T6": _spread(facts["norms"]),
        "T7": _coupling(facts["coupling"]),
        "T8": _ranks(facts["ranks"]),
        "T10": _combined(records["1"], records["joint"], records.get("sixdof", ())),
    }


def _case1(runs: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    v0, ratio = values(runs, "V_start"), values(runs, "goal", "V") / values(runs, "V_start")
    worst = 1e3 * values(runs, "goal", "max_position_error").max()
    off = 100 * values(runs, "goal", "rms_ratio_error")
    later = 100 * values(runs, "end", "rms_ratio_error")
    return _target(
        f"Case 1, {STOPPED}: the track is matched, the coefficients are not",
        {
            "V at the start, median": (np.median(v0), "1e6 .. 1e9", 1e6 <= np.median(v0) <= 1e9),
            "V/V0, largest": (ratio.max(), "< 1e-8", ratio.max() < 1e-8),
            "position error, largest [mm]": (worst, "< 2", worst < 2),
            "rms coefficient error, median [%]": (np.median(off), "> 3", np.median(off) > 3),
            "rms coefficient error carried on, median [%] (no bar)": (np.median(later), NO_BAR, True),
        },
    )


def _case2(with_inertia: Sequence[Mapping[str, Any]], without: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    ratio = max((values(r, "end", "V") / values(r, "V_start")).max() for r in (with_inertia, without))
    worst = 1e3 * max(values(r, "end", "max_position_error").max() for r in (with_inertia, without))
    nine = 100 * np.abs(values(without, "end", "ratio") - 1).max()
    off = np.abs(values(with_inertia, "end", "ratio") - 1).max(axis=0)
    names = with_inertia[0]["names"]
    strays = sorted(n for n, e in zip(names, off, strict=True) if e > 0.05)
    return _target(
        "Case 2, carried on: with the towing-tank coefficients known the others are found",
        {
            "V/V0, largest": (ratio, "< 1e-9", ratio < 1e-9),
            "position error, largest [mm]": (worst, "< 1", worst < 1),
            "coefficient error with 9 unknowns, largest [%]": (nine, "< 0.1", nine < 0.1),
            "coefficients off by more than 5 % with 14 unknowns": (
                strays, f"a subset of {', '.join(sorted(WEAK))}", bool(set(strays) <= WEAK)
            ),
        },
    )  # fmt: skip


def _case3(with_inertia: Sequence[Mapping[str, Any]], without: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    both = [*with_inertia, *without]
    gain = values(both, "V_truth") / values(both, "end", "V")
    truth = values(both, "V_truth")
    worst = values(both, "end", "max_position_error").max()
    start, end = (
        np.median(values(both, "start", "rms_ratio_error")),
        np.median(values(both, "end", "rms_ratio_error")),
    )
    bound = float(np.mean([bool(r["at_bound"]) for r in both]))
    first = sum("X_rr" in r["at_bound"] for r in both)
    return _target(
        "Case 3, carried on: knowns wrong by up to 1 % make the unknowns very poor, the track stays good",
        {
            "V(true unknowns)/V(found), smallest": (gain.min(), "> 500", gain.min() > 500),
            "V(true unknowns), median": (np.median(truth), "1e3 .. 1e6", 1e3 <= np.median(truth) <= 1e6),
            "position error, largest [m]": (worst, "< 0.5", worst < 0.5),
            "rms coefficient error end over start, medians": (end / start, "> 1", bool(end > start)),
            "share of fits with a coefficient on a bound": (bound, "> 0.5", bound > 0.5),
            "fits with X_rr on a bound (no bar)": (f"{first} of {len(both)}", NO_BAR, True),
        },
    )


def _rich(runs: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    spiral = values(runs, "goal", "max_position_error")
    zigzag, rich = (values(runs, "goal", "prediction", n) for n in ("zig-zag", "rich"))
    ratio = np.median(np.minimum(zigzag, rich) / spiral)
    low, high = np.median(zigzag), np.median(rich)
    return _target(
        f"Explanation 1, {STOPPED}: the Case-1 set repeats the spiral but not an unusual manoeuvre",
        {
            "spiral, largest error [mm]": (1e3 * spiral.max(), "< 2", spiral.max() < 2e-3),
            "zig-zag error, median [m]": (low, "0.05 .. 1", 0.05 <= low <= 1),
            "rich input error, median [m]": (high, "0.05 .. 1", 0.05 <= high <= 1),
            "unusual over spiral, median": (ratio, "> 100", ratio > 100),
        },
    )


def _redundancy(found: Mapping[str, Mapping[str, float]]) -> dict[str, Any]:
    checks: dict[str, tuple[Any, str, bool]] = {}
    for name in ("sway row x 1.05", "yaw row x 0.95"):
        worst = max(found[name].values())
        checks[f"{name}: any track changes by [m]"] = (worst, "< 1e-9", worst < 1e-9)
    mixed = found["yaw + 0.01 L sway"]
    checks["yaw + 0.01 L sway: the spiral changes by [m]"] = (
        mixed["spiral"],
        "< 1e-9",
        mixed["spiral"] < 1e-9,
    )
    checks["yaw + 0.01 L sway: a zig-zag changes by [m]"] = (
        mixed["zig-zag"],
        "> 0.01",
        mixed["zig-zag"] > 0.01,
    )
    return _target(
        "Explanation 2: linear combinations of the Y and N coefficients leave the track as it is", checks
    )


def _spread(norms: Mapping[str, float]) -> dict[str, Any]:
    low, high = min(norms, key=norms.__getitem__), max(norms, key=norms.__getitem__)
    ratio = norms[high] / norms[low]
    return _target(
        "Explanation 3: some terms are too small to matter",
        {f"sensitivity of {high} over that of {low}": (ratio, "> 100", ratio > 100)},
    )


def _coupling(found: Mapping[str, float]) -> dict[str, Any]:
    bars = {"v^2, v r": 0.999, "v r, r^2": 0.999}
    return _target(
        "Explanation 4: v and r rise and fall together",
        {
            f"|corr| of {n}": (v, f"> {bars.get(n, 0.9999)}", v > bars.get(n, 0.9999))
            for n, v in found.items()
        },
    )


def _ranks(found: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    return _target(
        "Singular values at rounding level",
        {n: (f["lost"], f"= {f['expected']}", f["lost"] == f["expected"]) for n, f in found.items()},
    )


def _combined(
    alone: Sequence[Mapping[str, Any]],
    joint: Sequence[Mapping[str, Any]],
    sixdof: Sequence[Mapping[str, Any]],
) -> dict[str, Any]:
    seeds = {r["seed"] for r in joint}
    before = 100 * np.median(values([r for r in alone if r["seed"] in seeds], "goal", "rms_ratio_error"))
    after = 100 * np.median(values(joint, "goal", "rms_ratio_error"))
    checks: dict[str, tuple[Any, str, bool]] = {
        "rms coefficient error, spiral alone, median [%]": (before, NO_BAR, True),
        "rms coefficient error, three manoeuvres, median [%]": (
            after,
            "below the spiral alone",
            after < before,
        ),
    }
    if sixdof:
        weak = 100 * np.abs(values(sixdof, "end", "ratio") - 1).max()
        checks["6-DOF: largest coefficient error [%]"] = (weak, "< 1", weak < 1)
    return _target("The remedy: manoeuvres combined, and six degrees of freedom", checks)
