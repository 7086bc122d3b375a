"""The paper's four explanations of wrong coefficients, each with a number, and its remedy.

Takes the plain records of `simulated_recovery` and the facts of the study. Does not simulate.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from bayesid.report.writer import Block, Figure, Section, Table, Text
from studies.paper_cases import figures
from studies.paper_cases.counts import AXES, errors_by_name, rank_correlation, shown
from studies.paper_cases.similar import LIKE, UNLIKE
from studies.paper_cases.targets import Records, values

Runs = Sequence[Mapping[str, Any]]


def median_error(runs: Runs, stage: str) -> float:
    """Median over seeds of the rms coefficient error [%]."""
    return float(100 * np.median(values(runs, stage, "rms_ratio_error")))


def explanations(records: Records, facts: Mapping[str, Any]) -> Section:
    """Input, linear combinations, small terms, coupling; singular values and what a lower cost would
    bring.
    """
    return Section(
        "The paper's four explanations, each with a number",
        [
            _input(records["1"], facts["predictions"]),
            _combinations(facts),
            _small_terms(records["1"], facts),
            _coupling(facts["coupling"]),
            _spectra(facts["spectra"]),
            _cost(records["1"]),
        ],
    )


def _input(runs: Runs, predictions: Mapping[str, Any]) -> Section:
    rows: list[list[Any]] = []
    for kind in (LIKE, UNLIKE):
        for name, found in predictions.items():
            if found["kind"] == kind:
                cells = [
                    float(np.median(found[stage][key]))
                    for key in ("position", "heading")
                    for stage in ("start", "goal")
                ]
                rows.append([kind, name, *cells])
    spiral = 1e3 * float(np.median(values(runs, "goal", "max_position_error")))
    reach = {kind: [row[3] for row in rows if row[0] == kind] for kind in (LIKE, UNLIKE)}
    text = (
        f"The Case-1 estimates repeat the fitted spiral to {spiral:.2g} mm (median). Manoeuvres like it - "
        f"other "
        f"rudder ranges, rates and revolutions, a steady turn, the ramp run backwards - they predict to "
        f"{min(reach[LIKE]):.2g} to {max(reach[LIKE]):.2g} m; manoeuvres unlike it to "
        f"{min(reach[UNLIKE]):.2g} to "
        f"{max(reach[UNLIKE]):.2g} m. The paper finds similar ones reasonable and unusual ones bad. The "
        f"order is "
        "the same here; with a perfect model and no noise none is bad beside what the start values miss, "
        "and the "
        "similar ones that begin with a large rudder at full speed come near the unlike ones."
    )
    columns = ["", "manoeuvre", "start [m]", "estimate [m]", "start [deg]", "estimate [deg]"]
    table = Table(columns, rows, "Largest error over ten minutes, medians over seeds, Case 1.", digits=2)
    caption = (
        f"Largest errors of every seed, bar: median. Above the dotted line {LIKE} manoeuvres, below "
        f"{UNLIKE} ones. "
        "Heading does not change in a coast-down."
    )
    figure = Figure("predictions", figures.prediction_errors(predictions, (LIKE, UNLIKE)), caption)
    return Section("1. The input is not rich enough", [Text(text), table, figure])


def _combinations(facts: Mapping[str, Any]) -> Section:
    inputs = ("spiral", "zig-zag", "rich")
    rows = [[name, *(1e3 * found[n] for n in inputs)] for name, found in facts["equivalent"].items()]
    columns = ["change of the coefficients", *(f"{n} [mm]" for n in inputs)]
    text = (
        "Only accelerations are seen, so an equation may be multiplied by any number as long as the added "
        "mass makes "
        "up for the rigid-body part. The changes below are finite, not small: 1.05 moves `Y_vdot` by 10.7 "
        "%. The "
        "third holds while v and r keep opposite signs and breaks on a zig-zag; the fourth needs the "
        "propulsion to be "
        "unknown as well."
    )
    listed = [
        f"- `{d['name']}` "
        + ("(exactly flat)" if d["exact"] else f"(singular value {d['singular_value']:.1e} m)")
        for d in facts["flat"]
    ]
    flat = (
        "Weakest directions of the spiral, all 22 free, from its exact sensitivities (relative changes; "
        "where "
        "several are exactly flat, any mixture of them is too):\n\n" + "\n".join(listed)
    )
    table = Table(columns, rows, "Largest change of the track.", digits=2)
    return Section("2. Linear combinations", [Text(text), table, Text(flat)])


def _small_terms(runs: Runs, facts: Mapping[str, Any]) -> Section:
    norms, forces = facts["norms"], facts["forces"]
    share = {n: f["share"] for n, f in forces.items()}
    error = {n: e for n, (e, _) in errors_by_name(runs, "goal").items()}
    rows: list[list[Any]] = []
    for axis in AXES:
        for name in sorted((n for n in share if n[0] == axis), key=share.__getitem__):
            unit = 1e-6 if axis == "N" else 1e-3
            size = f"{unit * forces[name]['rms']:.3g} {'MN m' if axis == 'N' else 'kN'}"
            rows.append([name, size, f"{100 * share[name]:.2g}", f"{norms[name]:.3g}", f"{error[name]:.1f}"])
    by_force = rank_correlation({n: share[n] for n in error}, error)
    by_track = rank_correlation({n: norms[n] for n in error}, error)
    ordered = sorted(norms, key=norms.__getitem__)
    text = (
        "The paper speaks of the size of a force. Share: mean size of the coefficient's force along the "
        "spiral "
        "over the sum of those of its equation (they sum to 100 %; the forces themselves largely cancel). "
        "Beside "
        "it the track sensitivity: metres, root sum of squares over the samples, for a change of 100 %; "
        "between "
        f"`{ordered[0]}` and `{ordered[-1]}` it grows {norms[ordered[-1]] / norms[ordered[0]]:.0f} times. "
        f"Small "
        f"forces go with large errors (rank correlation {by_force:.2f}; with the sensitivity "
        f"{by_track:.2f}), yet "
        "size alone does not decide: large forces stray where another force takes their place (explanation "
        "4), "
        "and small ones are found where none does."
    )
    columns = [
        "coefficient",
        "rms force",
        "share of its equation [%]",
        "track sensitivity [m]",
        "median error [%]",
    ]
    caption = "Smallest force first in each equation; errors of Case 1 at the paper's factor."
    drawn = figures.sizes({n: (100 * share[n], norms[n], error[n]) for n in error})
    figure = Figure("sizes", drawn, "Error over size, Case 1 at the paper's factor.")
    return Section("3. Terms too small to matter", [Text(text), Table(columns, rows, caption), figure])


def _coupling(found: Mapping[str, float]) -> Section:
    text = (
        "Along the spiral v and r keep an almost constant ratio, so v², v r and r² are one regressor and "
        "errors of "
        "their coefficients cancel. From 60 s on; the last three are columns of the track sensitivity."
    )
    table = Table(["pair", "absolute correlation"], [[k, f"{v:.6f}"] for k, v in found.items()])
    return Section("4. Sway and yaw are coupled", [Text(text), table])


def _spectra(spectra: Mapping[str, Any]) -> Section:
    caption = (
        "Track sensitivities by relative changes. The values at the bottom are rounding: exactly flat "
        "directions, "
        "three for the one-sided spiral, two for any two-sided input."
    )
    figure = figures.singular_spectra({name: np.array(v) for name, v in spectra.items()})
    return Section("Singular values", [Figure("singular_values", figure, caption)])


def _cost(runs: Runs) -> Section:
    first = values(runs, "V_start")
    groups = {"start": (np.ones(len(runs)), values(runs, "start", "rms_ratio_error"))}
    for stage, words in (("goal", "at the paper's factor"), ("end", "carried on")):
        groups[words] = (values(runs, stage, "V") / first, values(runs, stage, "rms_ratio_error"))
    caption = (
        "Case 1. Eleven orders of magnitude of V leave the coefficients as wrong as they started; even at "
        "rounding "
        "the three exactly flat directions keep their errors. With noise on the track, what lies to the "
        "right of "
        "the middle group is out of reach."
    )
    figure = Figure("error_against_cost", figures.error_against_cost(groups), caption)
    return Section("How far must V fall before the coefficients come right?", [figure])


def remedy(records: Records, facts: Mapping[str, Any]) -> Section:
    """Combined manoeuvres, and the fit in six degrees of freedom where there is one."""
    joint = records["joint"]
    seeds = {r["seed"] for r in joint}
    alone = [r for r in records["1"] if r["seed"] in seeds]
    rows = []
    for label, runs in (("spiral", alone), ("spiral + zig-zag + rich", joint)):
        for stage, word in (("goal", "paper's factor"), ("end", "carried on")):
            fell = float(np.median(values(runs, stage, "V") / values(runs, "V_start")))
            worst = float(100 * values(runs, stage, "rms_ratio_error").max())
            row = [label, word, fell, median_error(runs, "start"), median_error(runs, stage), worst]
            rows.append(row)
    columns = ["fitted", "stage", "V/V0", "rms error at start [%]", "at the end, median [%]", "largest [%]"]
    text = (
        "The paper suggests that combined manoeuvres may bring the coefficients closer. They do, down to "
        "the two "
        "combinations that no manoeuvre can show (the scale of the Y and of the N equation, explanation 2): "
        "what "
        "is left is the start's error in those two."
    )
    figure = figures.ratios(shown(joint, facts["names"], facts["zeros"], "goal"), (0.8, 1.22))
    caption = f"Three manoeuvres fitted together, {len(joint)} seeds, bounds as in Case 1."
    blocks: list[Block] = [
        Text(text),
        Table(columns, rows, digits=2),
        Figure("ratios_joint", figure, caption),
    ]
    if records.get("sixdof"):
        blocks.append(_sixdof(records, facts["sixdof"]))
    return Section("The remedy: combined manoeuvres, and six degrees of freedom", blocks)


def _sixdof(records: Records, facts: Mapping[str, Any]) -> Section:
    runs, about = records["sixdof"], facts["sixdof"]
    text = (
        f"The step the paper's title promises: {len(runs[0]['names'])} coefficients of all six equations of "
        f"`{about['vehicle']}`, vertical plane and coupling included (`X_wq`, `Y_wp`, `Z_vp`, `M_rp`, "
        f"`N_pq` ...), from "
        f"one meander ({about['manoeuvre']}); acceleration derivatives known. {_outcome(runs)}"
    )
    figure = figures.ratios(shown(runs, runs[0]["names"], (), "end"), (0.72, 1.28))
    caption = f"Full 6-DOF fit of {about['vehicle']}, coefficients over their true values, {len(runs)} seeds."
    blocks: list[Block] = [Text(text), Figure("ratios_sixdof", figure, caption)]
    for found in facts.values():
        flat = "; ".join(f"`{name}`" for name in found["flat"])
        words = f"Exactly flat: {flat}." if flat else "No equation can be scaled any more."
        text = (
            f"With the acceleration derivatives of `{found['vehicle']}` free as well, {found['rank']} of "
            f"{found['count']} singular values are above rounding. {words}"
        )
        blocks.append(Text(text))
    other = records.get("sixdof-sub")
    if other:
        text = (
            f"The same on `{facts['sixdof-sub']['vehicle']}`: {_outcome(other)} Its set has the "
            "Gertler-Hagen rows `Y_v|r|` = (v/|v|) R |r| and `Z_w|q|`, R = (v² + w²)^½. With sway and heave "
            "together these forces jump where v or w changes sign; the track then jumps, by millimetres to "
            "centimetres, as coefficients change, and a gradient search stops at a jump. In the plane, or "
            "with |v| and |w| for R, they are continuous."
        )
        blocks.append(Text(text))
    return Section("Six degrees of freedom", blocks)


def _outcome(runs: Runs) -> str:
    worst = 100 * np.abs(values(runs, "end", "ratio") - 1).max(axis=1)
    apart = 1e3 * values(runs, "end", "max_position_error")
    first, last = np.median(values(runs, "V_start")), np.median(values(runs, "end", "V"))
    return (
        f"V falls from {first:.2g} to {last:.2g} (medians of {len(runs)} seeds), the track is met within "
        f"{apart.max():.2g} mm and the largest coefficient error is {worst.max():.2g} % (median over seeds "
        f"{np.median(worst):.2g} %; start: up to 10 %)."
    )
