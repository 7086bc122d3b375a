"""The report of the coverage study: which intervals hold the truth, which do not, and what a fit says of it.

Takes plain records of replicates. Judges them against the study's bars. Does not fit.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from bayesid.estimation.likelihood.checks import HALVES_P
from bayesid.estimation.sampling.rank_statistics import bands, coverage, distribution
from bayesid.report.figure_style import COLOURS, styled, subplots
from bayesid.report.writer import Figure, Report, Section, Table, Text
from studies.coverage.predictions_report import (
    judged_predictions,
    prediction_targets,
    prediction_words,
    predictions_section,
)

Array = np.ndarray
Records = Mapping[str, Sequence[Mapping[str, Any]]]
WHITE = "white noise"
OTHER = "other equations"
LEAST, MOST_FLAGGED, CONTROL = 0.88, 0.05, 0.75
CONTROL_CONDITION = "noise remembers 20 samples, read 4 times as often"
PROJECTED = "as the fitted equations come nearest"
STANDARD_ERRORS = 2.0  # a bar is met within so many


def judged(
    records: Records, ranks: int, fresh: Records, theory: Mapping[str, float] | None = None
) -> dict[str, Any]:
    """Coverage, flags, predictions and targets as plain numbers.

    Parameters
    ----------
    records : condition -> replicates
    ranks : draws among which the truth is ranked
    fresh : group of vehicles -> what their fits predict of fresh runs
    theory : condition -> share of intervals that hold the truth with white noise assumed, by linear theory
    """
    cases = {name: _case(rows, ranks) for name, rows in records.items()}
    for name, share in (theory or {}).items():
        cases[name]["white_theory"] = share
    predicted = judged_predictions(fresh)
    targets = _targets(cases) | prediction_targets(predicted)
    return {"cases": cases, "predictions": predicted, "targets": targets}


def _case(rows: Sequence[Mapping[str, Any]], ranks: int) -> dict[str, Any]:
    good = [r for r in rows if not r["failed"]]
    found: dict[str, Any] = {"replicates": len(rows), "fitted": len(good)}
    if len(good) < 2:
        return found
    names = good[0]["names"]
    z, white_z = (np.array([r[k] for r in good]) for k in ("z", "white_z"))
    inside = np.array([r["inside"] for r in good], dtype=float)
    calm = np.array([r["final"] for r in good])
    found |= {
        "coverage": coverage(inside),
        "white_coverage": coverage(np.array([r["white_inside"] for r in good], dtype=float)),
        "rms_z": float(np.sqrt(np.mean(z**2))), "white_rms_z": float(np.sqrt(np.mean(white_z**2))),
        "each": dict(zip(names, inside.mean(axis=0).tolist(), strict=True)),
        "not_final": float(np.mean([not r["final"] for r in good])),
        "runs_disagree": float(np.mean([(r["halves_p"] or 1.0) < HALVES_P for r in good])),
        "run_spread": float(np.mean([r["run_spread"] > 0 for r in good])),
        "conflict": float(np.mean([r["conflicts"] > 0 for r in good])),
        "white_not_final": float(np.mean([not r["white_final"] for r in good])),
        "weight": float(np.mean([r["weight"] for r in good])),
        "efficient": float(np.mean([r["efficient"] and not r["filtered"] for r in good])),
        "filtered": float(np.mean([r["filtered"] for r in good])),
        "order": float(np.mean([r["order"] for r in good])),
        "final_coverage": coverage(inside[calm]) if calm.sum() > 1 else None,
        "sd_over_prior": float(np.median([r["sd_over_prior"] for r in good])),
        "white_sd_over_prior": float(np.median([r["white_sd_over_prior"] for r in good])),
        "cpu_seconds": float(np.sum([r["cpu_seconds"] for r in good])),
    }  # fmt: skip
    band = bands(len(good), len(names), ranks)
    for key in ("rank", "white_rank"):
        shares = distribution(np.array([r[key] for r in good], dtype=np.int64), ranks)
        found[f"{key}s_in_band"] = int(band.holds(shares).sum())
    found["unknowns"] = len(names)
    known = [r for r in good if "projected_z" in r]
    if len(known) > 1:
        held = np.array([r["projected_inside"] for r in known], dtype=float)
        moves = [r["projected_move"] for r in known]
        found["projected"] = {
            "coverage": coverage(held),
            "rms_z": float(np.sqrt(np.mean(np.square([r["projected_z"] for r in known])))),
            "each": dict(zip(names, held.mean(axis=0).tolist(), strict=True)),
            "move": dict(zip(names, np.median(moves, axis=0).tolist(), strict=True)),
        }
    return found


def _standing(value: float, error: float, least: float) -> str:
    if value >= least:
        return "met"
    return "undecided" if value + STANDARD_ERRORS * error >= least else "missed"


def _targets(cases: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    out: dict[str, Any] = {}
    for name, c in cases.items():
        if "coverage" not in c:
            continue
        value, error = c["coverage"]["share"], c["coverage"]["standard_error"]
        out[f"90 % intervals, {name}"] = {
            "value": value, "bar": f">= {LEAST:.2f}", "standing": _standing(value, error, LEAST),
        }  # fmt: skip
        if "projected" in c:
            value, error = (c["projected"]["coverage"][key] for key in ("share", "standard_error"))
            out[f"90 % intervals, {name}, {PROJECTED}"] = {
                "value": value, "bar": f">= {LEAST:.2f}", "standing": _standing(value, error, LEAST),
            }  # fmt: skip
    good = cases.get(WHITE, {})
    if "coverage" in good:
        flagged = good["not_final"]
        out["clean campaigns called not final"] = {
            "value": flagged, "bar": f"<= {MOST_FLAGGED:.2f}",
            "standing": "met" if flagged <= MOST_FLAGGED else "missed",
        }  # fmt: skip
    for name, c in cases.items():
        if "coverage" in c and not name.startswith(OTHER):
            out[f"ranks uniform, {name}"] = {
                "value": c["ranks_in_band"], "bar": f"all {c['unknowns']} in the band",
                "standing": "met" if c["ranks_in_band"] == c["unknowns"] else "missed",
            }  # fmt: skip
    control = cases.get(CONTROL_CONDITION, {})
    if "coverage" in control:
        share = control["white_coverage"]["share"]
        out[f"control: white noise assumed, {CONTROL_CONDITION}"] = {
            "value": share, "bar": f"< {CONTROL:.2f}", "standing": "met" if share < CONTROL else "missed",
        }  # fmt: skip
    return out


def coverage_report(findings: Mapping[str, Any], inputs: Mapping[str, Any]) -> Report:
    """Report of the study."""
    cases = {n: c for n, c in findings["cases"].items() if "coverage" in c}
    rows = tuple((n, t["value"], t["bar"], t["standing"]) for n, t in findings["targets"].items())
    sections = (
        _coverage_section(cases),
        _said_section(cases),
        predictions_section(findings["predictions"]),
        Section("Targets", (Table(("target", "found", "bar", "standing"), rows),)),
        _design_section(findings["cases"], inputs),
    )
    words = lead(cases, bool(inputs["quick"]))
    words = " ".join(filter(None, (words, prediction_words(findings["predictions"]))))
    return Report("Do the intervals of a fit hold the truth?", words, sections, failures(cases))


def lead(cases: Mapping[str, Mapping[str, Any]], quick: bool) -> str:
    """The answer; what fails is in `failures`."""
    if not cases:
        return "No campaign could be fitted: cannot tell."
    right, wrong = _by_equations(cases)
    words = []
    if right:
        shares = [100 * c["coverage"]["share"] for c in right.values()]
        white = [100 * c["white_coverage"]["share"] for c in right.values()]
        words.append(
            f"**Where the equations are right, {min(shares):.0f} to {max(shares):.0f} % of the 90 % "
            f"intervals hold the truth; fitted as if errors were independent, {min(white):.0f} to "
            f"{max(white):.0f} %.**"
        )
    if wrong:
        listed = " and ".join(
            f"{100 * c['coverage']['share']:.0f} % ({n.removeprefix(OTHER + ': ')})" for n, c in wrong.items()
        )
        conflict, calm = (
            100 * float(np.mean([c["conflict"] for c in some.values()])) if some else 0.0
            for some in (wrong, right)
        )
        parted = 100 * float(np.mean([c["not_final"] for c in wrong.values()]))
        words.append(
            f"Where the vehicle obeys other equations than the fit, {listed} hold it. The fit calls "
            f"{parted:.0f} % of these campaigns not final, {conflict:.0f} % for a conflict with the prior "
            f"({calm:.0f} % where the equations are right); `bayesid diagnose` is for that."
        )
    return " ".join(words) + (" A quick run of few replicates: it decides nothing." if quick else "")


def failures(cases: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Every bar that is missed, a sentence each."""
    right, _ = _by_equations(cases)
    out = []
    low = [n for n, c in right.items() if c["coverage"]["share"] < LEAST]
    if low:
        out.append(f"Fewer than {100 * LEAST:.0f} % of the 90 % intervals hold the truth: {'; '.join(low)}.")
    crooked = [n for n, c in right.items() if c["ranks_in_band"] < c["unknowns"]]
    if crooked:
        out.append(
            f"Ranks of the truth are not uniform for some coefficients in {len(crooked)} of {len(right)} "
            f"conditions: {'; '.join(crooked)}."
        )
    if CONTROL_CONDITION in right and right[CONTROL_CONDITION]["white_coverage"]["share"] >= CONTROL:
        out.append(
            "The control does not fail: with errors taken as independent though they are not, "
            f"{_percent(right[CONTROL_CONDITION], 'white_coverage')} % hold the truth (it should be below "
            f"{100 * CONTROL:.0f} %)."
        )
    return out


def _by_equations(cases: Mapping[str, Mapping[str, Any]]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Conditions whose vehicle obeys the equations of the fit, and those whose vehicle does not."""
    wrong = {n: c for n, c in cases.items() if n.startswith(OTHER)}
    return {n: c for n, c in cases.items() if n not in wrong}, wrong


def _percent(c: Mapping[str, Any], key: str) -> str:
    return f"{100 * c[key]['share']:.1f} ± {100 * c[key]['standard_error']:.1f}"


def _lowest(each: Mapping[str, float]) -> str:
    name = min(each, key=lambda n: each[n])
    return f"{100 * each[name]:.0f} ({name})"


def _coverage_section(cases: Mapping[str, Mapping[str, Any]]) -> Section:
    columns = (
        "condition", "campaigns", "90 % intervals [%]", "lowest of a coefficient [%]", "rms z",
        "with white noise [%]", "by linear theory [%]", "its rms z", "ranks in the band", "with white noise",
    )  # fmt: skip
    rows = tuple(
        (
            n, f"{c['fitted']} of {c['replicates']}", _percent(c, "coverage"),
            _lowest(c["each"]), f"{c['rms_z']:.2f}",
            _percent(c, "white_coverage"), f"{100 * c['white_theory']:.1f}" if "white_theory" in c else "–",
            f"{c['white_rms_z']:.2f}",
            f"{c['ranks_in_band']} of {c['unknowns']}", f"{c['white_ranks_in_band']} of {c['unknowns']}",
        )
        for n, c in cases.items()
    )  # fmt: skip
    text = (
        "Share of the 90 % intervals that hold the true coefficient, all coefficients together, with the "
        "standard error that takes a campaign as one observation; z is the error over the posterior sd and "
        "has rms 1 where intervals are right. Ranks: how many coefficients rank uniformly among 99 draws "
        "over all campaigns, in a band that chance makes one of them leave once in twenty conditions. With "
        "white noise: the same campaigns fitted as if their errors were independent and of the stated size; "
        "beside it what this design must give by linear theory, which need not be below 75 %. "
        f"The control is {CONTROL_CONDITION}: the error of four readings is that of one, which white noise "
        "takes for half of it. "
        "All conditions share truths and random numbers where they can, so that chance moves them together."
    )
    drawn = coverages(cases)
    caption = "90 % intervals that hold the truth, with two standard errors. Grey: white noise assumed."
    parts: list[Any] = [Text(text), Figure("coverage", drawn, caption), Table(columns, rows)]
    nearest = {n: c for n, c in cases.items() if "projected" in c}
    if nearest:
        parts += [Text(_PROJECTED_WORDS), _projected_table(nearest)]
    return Section("Coverage", tuple(parts))


_PROJECTED_WORDS = (
    "Where equations are wrong, an interval may be asked for two numbers: the coefficient of the vehicle, "
    "and the one with which the fitted equations (rows of a model form among them, where the fit has one) "
    "come nearest to its motion, found from readings 30 times as exact; more readings lead to the second. "
    "They differ where a row takes what another force does, or what the runs hardly show. The move is the "
    "median difference of the two, in prior sd. Where intervals hold neither, whether the fit calls itself "
    "final is in the next table."
)


def _projected_table(cases: Mapping[str, Mapping[str, Any]]) -> Table:
    rows = []
    for n, c in cases.items():
        p = c["projected"]
        move = sorted(p["move"].items(), key=lambda pair: -abs(pair[1]))[:3]
        moved = ", ".join(f"{name} {value:+.1f}" for name, value in move)
        rows.append((
            n, _percent(c, "coverage"), f"{c['rms_z']:.2f}", _lowest(c["each"]), _percent(p, "coverage"),
            f"{p['rms_z']:.2f}", _lowest(p["each"]), moved,
        ))  # fmt: skip
    columns = (
        "condition", "of the vehicle [%]", "rms z", "lowest [%]", "nearest [%]", "rms z", "lowest [%]",
        "largest moves [prior sd]",
    )  # fmt: skip
    return Table(columns, tuple(rows))


def _said_section(cases: Mapping[str, Mapping[str, Any]]) -> Section:
    columns = (
        "condition", "not final [%]", "90 % intervals where final [%]", "runs disagree [%]",
        "prior conflict [%]", "runs differ, allowed for [%]", "not final, white noise [%]",
        "by a filter [%]", "scores weighed by their covariance [%]", "mean power of the search", "mean order",
        "median sd over prior sd", "with white noise",
    )  # fmt: skip
    rows = tuple(
        (
            n, f"{100 * c['not_final']:.1f}",
            "–" if c["final_coverage"] is None else _percent(c, "final_coverage"),
            f"{100 * c['runs_disagree']:.1f}",
            f"{100 * c['conflict']:.1f}", f"{100 * c['run_spread']:.1f}",
            f"{100 * c['white_not_final']:.1f}", f"{100 * c['filtered']:.0f}",
            f"{100 * c['efficient']:.0f}", f"{c['weight']:.3g}",
            f"{c['order']:.1f}",
            f"{c['sd_over_prior']:.2f}", f"{c['white_sd_over_prior']:.2f}",
        )
        for n, c in cases.items()
    )  # fmt: skip
    text = (
        "Share of campaigns in which the fit says so. Its answer is not final where odd and even runs differ "
        "more than chance allows even after its intervals were widened, or where some estimate is more than "
        "3 sd from its prior; coefficients that differ from run to run may have been allowed for. The power "
        "is that of the readings' likelihood beside the prior in the search; the estimate then weighs every "
        "score by its own covariance, unless left-out runs speak for the power (neither where residuals are "
        "white). Where residuals remember and the innovations of a filter with a random force do not, the "
        "estimate is the filter's, and the power is the information of its readings over that of white "
        "noise. The order is that of the autoregression of the residuals, or of the innovations."
    )
    return Section("What the fit says", (Text(text), Table(columns, rows)))


def _design_section(cases: Mapping[str, Mapping[str, Any]], inputs: Mapping[str, Any]) -> Section:
    angles = ", ".join(f"{a:g}/{a:g}" for a in inputs["zigzags"])
    failed = sum(c["replicates"] - c["fitted"] for c in cases.values())
    text = (
        f"{inputs['vehicle']}, {len(inputs['unknown'])} coefficients, each with a normal prior of "
        f"{100 * inputs['prior_sd']:g} % from which the truth is drawn; zig-zags {angles} of "
        f"{inputs['duration']:g} L/U, six channels every {inputs['dt']:g} L/U, their noise stated. A "
        f"disturbing force acts on surge, sway and yaw, its correlation time {inputs['force_memory']:g} L/U, "
        "its sd 3e-5 or 3e-4 of 1/2 rho L^2 U^2 (moments: L^3). Coefficients of runs that differ do so by "
        "half a prior sd about the ship's. Pieces are 10 L/U long. Cross-flow drag has Cd 0.3; the three "
        "rows the fitted equations lack are Y_r|r|, N_v|v| and X_vv. Simulation and model are otherwise the "
        f"same code: this tests the inference. {failed} campaigns could not be fitted. Processor time: "
        f"{sum(c.get('cpu_seconds', 0.0) for c in cases.values()):.0f} s."
    )
    return Section("Design", (Text(text),))


@styled
def coverages(cases: Mapping[str, Mapping[str, Any]]) -> Any:
    """Coverage of every condition with two standard errors, beside that of white noise."""
    figure, axes = subplots(height=0.32 * len(cases) + 1.2)
    axes.axvline(0.9, color="black", linewidth=1.0, linestyle="--")
    axes.axvspan(LEAST, 1.0, color="#EEEEEE", linewidth=0)
    for j, c in enumerate(cases.values()):
        for key, colour, shift, word in (
            ("white_coverage", COLOURS["grey"], 0.12, "white noise assumed"),
            ("coverage", COLOURS["blue"], -0.12, "bayesid fit"),
        ):
            share, error = c[key]["share"], c[key]["standard_error"]
            axes.errorbar(share, j + shift, xerr=2 * error, fmt="o", color=colour,
                          label=word if j == 0 else None)  # fmt: skip
    axes.set_yticks(range(len(cases)), list(cases))
    axes.set_ylim(len(cases) - 0.5, -0.5)
    axes.set_xlim(0, 1)
    axes.set_xlabel("share of 90 % intervals that hold the truth (dashed: what they claim)")
    axes.legend(loc="upper left")
    return figure
