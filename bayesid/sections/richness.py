"""The report of the study of manoeuvre richness: what tells, what to fly next, whether the advice held.

Takes the study's records (plain data). Computes only summaries that a reader could check from them.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from bayesid.design.compare import rank_correlation
from bayesid.design.proof import paired
from bayesid.figures import design as figures
from bayesid.report import Block, Figure, Report, Section, Table, Text, literal

Array = np.ndarray
WELL = 0.5  # contraction from which a coefficient counts as well determined
FACTOR = 1.5
ALPHA = 0.05


def richness_report(
    vehicles: Mapping[str, Any],
    level_motion: Mapping[str, Any],
    told: Mapping[str, Any],
    logs: Mapping[str, Any],
    quick: bool,
) -> Report:
    """The report as plain data."""
    targets = [*_targets(vehicles, level_motion, logs), *_tell_targets(told)]
    missed = [row[0] for row in targets if not row[2]]
    lead = f"**{len(targets) - len(missed)} of {len(targets)} targets are met.** " + _finding(vehicles)
    if missed:
        lead += " Not met: " + "; ".join(literal(m) for m in missed) + "."
    if quick:
        lead += " Quick run: one vehicle, few draws; no conclusion."
    sections = [
        Section(
            "Targets",
            [Table(["target", "measured", "met"], targets, "Every number is of this run.", 3)],
        ),
        *[Section(f"{n}", _vehicle(n, v)) for n, v in vehicles.items()],
        Section("Contraction: expected, refitted, sampled", _contractions(vehicles)),
        Section("Two causes of a gap told apart", _tell(told)),
        Section("Vertical plane", _vertical(level_motion)),
        *[Section(literal(v["title"]), _logs(n, v)) for n, v in logs.items()],
        Section("What this does not show", [Text(LIMITS)]),
    ]
    return Report("Which manoeuvre tells what, and which to fly next", lead, sections)


def _finding(vehicles: Mapping[str, Any]) -> str:
    """What designs brought, in one sentence of numbers."""
    parts = []
    for name, v in vehicles.items():
        worst = {goal: _pairs(v, goal)[0] for goal in v["plans"]}
        words = ", ".join(f"to {g} {row[1]:.2f} times ({literal(row[0])})" for g, row in worst.items())
        parts.append(f"{name} {words}")
    return (
        "Left open by the posterior after the closest rival of each design, over that after the design "
        f"itself: {'; '.join(parts)}."
    )


LIMITS = (
    "- Noise is white and stated; forces of the sea and errors of the model cost information that is counted "
    "here.\n- Designs and their tests share the equations of motion: a coefficient the equations lack is not "
    "looked for by these criteria (that is what `bayesid excite` and `bayesid diagnose` are "
    "for).\n- The prior "
    "spread of 10 % per coefficient is assumed; another one changes the numbers, seldom the "
    "order.\n- Added mass "
    "X_udot, Y_vdot, N_rdot is taken as known: with it free every row of the equations can be scaled and no "
    "manoeuvre shows it.\n- SINDy's inclusion asks whether a row is needed, contraction whether its number "
    "becomes known; they agree only in part."
)  # fmt: skip


def _array(rows: Any) -> Array:
    """Numbers of a record; null is nan, "inf" is inf."""
    return np.array([[np.nan if x is None else float(x) for x in row] for row in rows])


def _vector(row: Any) -> Array:
    return np.array([np.nan if x is None else float(x) for x in row])


def _maps(v: Mapping[str, Any]) -> tuple[list[str], list[str], Array, Array | None, Array | None]:
    rows = v["comparison"]["manoeuvres"]
    names = list(v["comparison"]["coefficients"])
    out = [
        None if rows[0][key] is None else _array([[r[key][n] for n in names] for r in rows])
        for key in ("contraction", "contraction_refits", "sindy_inclusion")
    ]
    assert out[0] is not None
    return [r["name"] for r in rows], names, out[0], out[1], out[2]


def _well(v: Mapping[str, Any]) -> tuple[Array, Array]:
    """Posterior over prior sd of well-determined coefficients: expected and by refits."""
    _, _, expected, found, _ = _maps(v)
    if found is None:
        return np.zeros(0), np.zeros(0)
    good = expected > WELL
    return 1 - expected[good], 1 - found[good]


def _others(table: Array) -> Array:
    logs = np.log(np.maximum(table, 1e-12))
    np.fill_diagonal(logs, np.nan)
    return np.exp(np.nanmean(logs, axis=1))


def _cross(v: Mapping[str, Any]) -> tuple[list[str], Array, Array, Array]:
    """Names, gains, predicted and actual error over the others."""
    c = v["comparison"]["crossing"]
    gains = {m["name"]: m["gain_nats"] for m in v["comparison"]["manoeuvres"]}
    return c["names"], np.array([gains[n] for n in c["names"]]), _array(c["predicted"]), _array(c["refits"])


def _pairs(v: Mapping[str, Any], goal: str) -> list[list[Any]]:
    """Paired test of a design against every rival: ratio, share won, p; of the posterior, then of errors."""
    test = v["test"]
    names = test["names"]
    spread, error = (
        _array(test[k]) for k in (("left", "wrong") if goal == "shrink" else ("spread", "missed"))
    )
    ours = names.index(f"designed to {goal}")
    rows = []
    for k, name in enumerate(names):
        if name.startswith("designed"):
            continue
        rows.append([name, *paired(spread[ours], spread[k]), *paired(error[ours], error[k])])
    return sorted(rows, key=lambda row: row[1])


def _targets(
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
        expected, found = _well(v)
        if expected.size:
            ratio = found / expected
            inside = bool(np.all((ratio < FACTOR) & (ratio > 1 / FACTOR)))
            rows.append([
                f"{name}: expected against actual posterior sd of well-determined coefficients "
                f"within {FACTOR}",
                f"{ratio.min():.2f} to {ratio.max():.2f} over {ratio.size}", inside,
            ])  # fmt: skip
        for label, c in (v.get("sampled") or {}).items():
            e, s = (_vector(c[k]) for k in ("expected", "sampled"))
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
            pairs = _pairs(v, goal)
            closest = pairs[0]
            rows.append([
                f"{name}, {goal}: and in the actual posterior, pair by pair, all rivals",
                f"closest: {closest[0]}, {closest[1]:.2f} times ours, won {closest[2]:.0%}, p "
                f"{closest[3]:.1e}",
                all(r[1] > 1 and r[3] < ALPHA for r in pairs),
            ])  # fmt: skip
        _, gains, predicted, actual = _cross(v)
        if np.isfinite(actual).any():
            told = gains > 1.0  # runs that tell nothing would make the ranking look better than it is
            made, foreseen = _others(actual)[told], _others(predicted)[told]
            rho = rank_correlation(gains[told], -made)
            rows.append([
                f"{name}: richness ranks the cross error of the {told.sum()} runs that tell (Spearman > 0.5)",
                f"{rho:.2f} (from expected errors "
                f"{rank_correlation(foreseen, made):.2f})",
                rho > 0.5,
            ])  # fmt: skip
    for name, v in logs.items():
        gains, made = _vector(v["table"]["gains"]), _vector(v["others"])
        rho = rank_correlation(gains, -made)
        rows.append([
            f"{name} logs: richness ranks the cross-run error (Spearman > 0.5)",
            f"{rho:.2f} (from expected errors {rank_correlation(_vector(v['predicted_others']), made):.2f})",
            rho > 0.5,
        ])  # fmt: skip
    return rows


def _vehicle(name: str, v: Mapping[str, Any]) -> list[Block]:
    manoeuvres, names, expected, found, included = _maps(v)
    panels = {"expected from Fisher information": expected}
    if found is not None:
        panels["found by refits"] = found
    if included is not None:
        panels["inclusion frequency of SINDy"] = included
    rows = [
        [m["name"], m["gain_nats"], m["variance_left"], m["identified_directions"], m["condition_with_prior"]]
        for m in v["comparison"]["manoeuvres"]
    ]
    crossed, _, predicted, actual = _cross(v)
    tables = {"from information": predicted}
    if np.isfinite(actual).any():
        tables["by refits"] = actual
    blocks: list[Block] = [
        Table(["manoeuvre", "gain [nats]", "variance left", "directions", "condition"], rows,
              f"All of {v['comparison']['duration_s']:.0f} s, richest first; {len(names)} coefficients.", 3),
        Figure(f"map_{name}", _map(panels, manoeuvres, names), "Manoeuvres down, coefficients across."),
        Table(["measures", "rank correlation"], list(v["comparison"]["rank_correlations"].items()),
              "Spearman.", 2),
        Figure(f"cross_{name}", _table(tables, crossed), "Identify on the row, predict the column."),
    ]  # fmt: skip
    for goal, plan in v["plans"].items():
        orders = {k: np.array(x) for k, x in v["orders"][goal].items()}
        after = next(c["after"] for c in plan["candidates"] if c["kind"] == "designed")
        blocks.append(
            Figure(
                f"orders_{name}_{goal}",
                _drawn(orders),
                f"Designed after a 10/10 zig-zag to {plan['goal']}: {plan['unit']} "
                f"{plan['before']:.3g} before, "
                f"{after:.3g} after it.",
            )
        )
        blocks.append(
            Table(
                ["rival", "posterior, times ours", "won", "p", "error made, times ours", "won ", "p "],
                _pairs(v, goal),
                f"{plan['goal']}: {len(v['test']['left'][0])} true vehicles fly the zig-zag and "
                "one run more; ratio of "
                "medians, share of pairs the design wins, one-sided Wilcoxon p. Left: what the "
                "posterior expects; "
                "right: errors really made, which scatter.",
                3,
            )
        )
    blocks.append(Text(f"{v['test']['converged']:.1%} of the refits of the paired test converged."))
    return blocks


def _contractions(vehicles: Mapping[str, Any]) -> list[Block]:
    points = {f"{n}, refits": _well(v) for n, v in vehicles.items()}
    rows = []
    for n, v in vehicles.items():
        for label, c in (v.get("sampled") or {}).items():
            e, r, s = (_vector(c[k]) for k in ("expected", "refitted", "sampled"))
            good = e > WELL
            points[f"{n}, emcee: {label}"] = (1 - e[good], 1 - s[good])
            both = (1 - s) / (1 - r)
            rows.append([n, label, c["converged"], c["evaluations"], float(both.min()), float(both.max())])
    points = {k: p for k, p in points.items() if p[0].size}
    blocks: list[Block] = []
    if points:
        blocks.append(
            Figure(
                "contraction",
                figures.against(points, "expected sd / prior sd", "actual sd / prior sd", FACTOR),
                f"Coefficients expected to lose more than half of their spread; dotted: a factor {FACTOR}.",
            )
        )  # fmt: skip
    if rows:
        blocks.append(
            Table(
                ["vehicle", "runs", "converged", "evaluations", "least sd over Laplace", "most"], rows,
                "Sampled by emcee beside the Laplace refit of the same readings; all coefficients.", 3,
            )
        )  # fmt: skip
    return blocks


def _map(panels: Mapping[str, Array], rows: list[str], columns: list[str]) -> bytes:
    return figures.compact(figures.contraction_map(panels, rows, columns))


def _table(
    panels: Mapping[str, Array], names: list[str], label: str = "rms error over sensor noise"
) -> bytes:
    return figures.compact(figures.cross_map(panels, names, label))


def _drawn(orders: Mapping[str, Array]) -> bytes:
    commands = {k: x for k, x in orders.items() if k.endswith("_cmd")}
    return figures.compact(figures.orders(orders["t"], commands, {k: orders[k] for k in "xy"}))


def _margins(told: Mapping[str, Any]) -> dict[str, Array]:
    """Evidence of the true cause over the other [nats] per campaign."""
    labels = list(dict.fromkeys(row[2] for row in told["rows"]))
    return {k: np.array([row[3] for row in told["rows"] if row[2] == k], dtype=float) for k in labels}


def _tell_targets(told: Mapping[str, Any]) -> list[list[Any]]:
    plan, margins = told["plan"], _margins(told)
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


def _tell(told: Mapping[str, Any]) -> list[Block]:
    plan = told["plan"]
    orders = {k: np.array(x) for k, x in told["orders"].items()}
    rows = [
        [k, v.size, float(np.mean(v)), float(np.min(v)), f"{np.mean(v > 0):.0%}"]
        for k, v in _margins(told).items()
    ]
    return [
        Text(
            f"After a straight run and a 10/10 zig-zag: {plan['goal']}, each {told['size']:g} of its prior "
            "sd. Below, either is planted in vehicles drawn from what is known, the campaign is flown with "
            "noise, and the bank of the gap diagnosis weighs both."
        ),
        Figure(
            "orders_tell", _drawn(orders), "The design."
        ),
        Table(
            ["flown besides", "trials", "mean margin [nats]", "least", "true one ahead"], rows,
            "Log evidence of the planted cause over the other.", 3,
        ),
    ]  # fmt: skip


def _vertical(deep: Mapping[str, Any]) -> list[Block]:
    return [
        Text(
            f"generic_sub in six degrees of freedom; {len(deep['names'])} coefficients that act "
            "only out of the "
            "horizontal plane. Held upright (no rolling moments, centre of gravity on the axis) "
            "horizontal manoeuvres "
            "tell nothing of them, exactly. As built, the vehicle rolls in a turn and roll tips "
            "yaw into pitch, so a "
            "turn tells a little of the vertical plane."
        ),
        Table(
            ["manoeuvre", "largest contraction, upright", "as built", "of"], deep["rows"],
            "The last rows move out of the plane by their own planes.", 3,
        ),
    ]  # fmt: skip


def _logs(key: str, v: Mapping[str, Any]) -> list[Block]:
    table = v["table"]
    names = [literal(n) for n in table["names"]]
    gains, others = _vector(table["gains"]), _vector(v["others"])
    predicted = _vector(v["predicted_others"])
    order = np.argsort(-gains)
    rows = [[names[i], gains[i], float(others[i]), float(predicted[i])] for i in order]
    kinds = sorted({n.split(" ")[0] for n in table["names"]})
    excess = _array(v["excess"])
    where = {k: [i for i, n in enumerate(table["names"]) if n.startswith(k)] for k in kinds}
    grouped = []
    for a in kinds:
        cells = []
        for b in kinds:
            logs = [np.log(excess[i, j]) for i in where[a] for j in where[b] if i != j]
            cells.append(float(np.exp(np.mean(logs))) if logs else float("nan"))
        grouped.append([a, *cells])
    blocks: list[Block] = [
        Text(
            f"{literal(v['attribution'])}\n\nEach run is fitted alone (in pieces) and predicts "
            "every other from its "
            "first readings. Weights are what a fit of all runs misses, so the model, not the "
            "sensor, sets the scale; "
            "errors are over those of that joint fit, 1 being as good."
            + ("" if v["converged"] else " The joint fit did not converge; weights are its last ones.")
        ),
        Table(["identified on", "gain [nats]", "error over the others", "expected"], rows,
              "Richest first.", 3),
        Figure(
            f"logs_{key}", figures.against({key: (gains, others)}, "information gain [nats]",
            "error over the joint fit's", 1.0, False), "One point per run.",
        ),
        Figure(f"cross_{key}", _table({"each run alone": excess}, names, "error over the joint fit's"),
               "Identify on the row, predict the column."),
    ]  # fmt: skip
    if len(kinds) > 1:
        blocks.append(
            Table(["identified on", *kinds], grouped, "Geometric means by kind of run, columns predicted.", 3)
        )
    return blocks
