"""Targets of the richness study: what was asked, what was measured, whether it is met.

Takes the study's records (plain data). Gives rows of a table.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from bayesid.analysis.design.compare import rank_correlation
from studies.manoeuvre_richness.summaries import (
    ALPHA,
    FACTOR,
    WELL,
    crossing_of,
    error_over_others,
    margins_of,
    paired_tests,
    vector_of,
    well_determined,
)


def vehicle_targets(
    vehicles: Mapping[str, Any], deep: Mapping[str, Any], logs: Mapping[str, Any]
) -> list[list[Any]]:
    upright = [
        row[1] for row in deep["rows"] if row[0] not in ("depth", "vzigzag", "combined", "combinedheld")
    ]
    rows: list[list[Any]] = [
        [
            "vertical-plane coefficients: no contraction under any horizontal manoeuvre (vehicle upright)",
            f"largest {max(upright):.1e} in {len(upright)} manoeuvres", max(upright) == 0.0,
        ]
    ]  # fmt: skip
    for name, v in vehicles.items():
        expected, found = well_determined(v)
        if expected.size:
            ratio = found / expected
            inside = bool(np.all((ratio < FACTOR) & (ratio > 1 / FACTOR)))
            rows.append([
                f"{name}: expected against actual posterior sd of well-determined coefficients "
                f"within {FACTOR}",
                f"{ratio.min():.2f} to {ratio.max():.2f} over {ratio.size}", inside,
            ])  # fmt: skip
        for label, c in (v.get("sampled") or {}).items():
            e, s = (vector_of(c[k]) for k in ("expected", "sampled"))
            good = e > WELL
            ratio = (1 - s[good]) / (1 - e[good])
            out = [n for n, g, x in zip(c["names"], good, (1 - s) / (1 - e), strict=True)
                   if g and not 1 / FACTOR < x < FACTOR]  # fmt: skip
            rows.append([
                f"{name}, {label}: the same against emcee",
                f"{ratio.min():.2f} to {ratio.max():.2f} over {ratio.size}"
                + (f"; outside: {', '.join(out)}" if out else "")
                if good.any()
                else "none is",
                bool(good.any() and np.all((ratio < FACTOR) & (ratio > 1 / FACTOR))),
            ])  # fmt: skip
        for goal, plan in v["plans"].items():
            kinds: dict[str, list[float]] = {c["kind"]: [] for c in plan["candidates"]}
            for c in plan["candidates"]:
                kinds[c["kind"]].append(c["after"])
            best, random = min(kinds["library"]), min(plan["random_designs"])
            ours = kinds["designed"][0]
            rows.append([
                f"{name}, {goal}: the design beats the library and random designs on its criterion",
                f"{ours:.3g} against {best:.3g} and {random:.3g}", ours < min(best, random),
            ])  # fmt: skip
            pairs = paired_tests(v, goal)
            closest = pairs[0]
            rows.append([
                f"{name}, {goal}: and in the actual posterior, pair by pair, all rivals",
                f"closest: {closest[0]}, {closest[1]:.2f} times ours, won {closest[2]:.0%}, p "
                f"{closest[3]:.1e}",
                all(r[1] > 1 and r[3] < ALPHA for r in pairs),
            ])  # fmt: skip
        _, gains, predicted, actual = crossing_of(v)
        if np.isfinite(actual).any():
            informative = gains > 1.0  # runs that tell nothing would make the ranking look better than it is
            made, foreseen = error_over_others(actual)[informative], error_over_others(predicted)[informative]
            rho = rank_correlation(gains[informative], -made)
            rows.append([
                f"{name}: richness ranks the cross error of the {informative.sum()} runs that tell "
                f"(Spearman > 0.5)",
                f"{rho:.2f} (from expected errors "
                f"{rank_correlation(foreseen, made):.2f})",
                rho > 0.5,
            ])  # fmt: skip
    for name, v in logs.items():
        gains, made = vector_of(v["table"]["gains"]), vector_of(v["others"])
        rho = rank_correlation(gains, -made)
        foretold = rank_correlation(vector_of(v["predicted_others"]), made)
        rows.append([
            f"{name} logs: richness ranks the cross-run error (Spearman > 0.5)",
            f"{rho:.2f} (from expected errors {foretold:.2f})",
            rho > 0.5,
        ])  # fmt: skip
        for words, told in v["likelihoods"].items():
            found, theory = told["ranks"]["gain"]["made"], told["theory"]["gain"]
            rows.append([
                f"{name} logs, {words}: no less than 95 % of what right posteriors would give",
                f"{found:.2f}; theory {theory[1]:.2f} ({theory[0]:.2f} to {theory[2]:.2f})",
                found >= theory[0],
            ])  # fmt: skip
    return rows


def tell_targets(discrimination: Mapping[str, Any]) -> list[list[Any]]:
    plan, margins = discrimination["plan"], margins_of(discrimination)
    after: dict[str, list[float]] = {}
    for c in plan["candidates"]:
        after.setdefault(c["kind"], []).append(c["after"])
    best, random, ours = max(after["library"]), max(plan["random_designs"]), after["designed"][0]
    rival = next(k for k in margins if k not in ("nothing more", "designed"))
    mean = {k: float(np.mean(v)) for k, v in margins.items()}
    return [
        [
            "two causes: the design beats library and random designs on the expected margin",
            f"{ours:.3g} nats against {best:.3g} and {random:.3g}; {plan['before']:.2g} before",
            ours > max(best, random),
        ],
        [
            "two causes planted: mean evidence for the true one is largest with the design",
            f"{mean['designed']:.3g} nats, {rival} {mean[rival]:.3g}, without {mean['nothing more']:.3g}",
            mean["designed"] > max(mean[rival], mean["nothing more"]),
        ],
    ]
