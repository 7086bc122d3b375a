"""The report of a trial's fit: verdict, coefficients, what the data leave open, residuals, runs, search.

Takes a `TrialFit`. Does not fit or simulate.
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from bayesid.diagnosis.failed_checks import MOST_RUNS as MOST_NAMED
from bayesid.diagnosis.failed_checks import prediction_step
from bayesid.estimation.likelihood.posterior import CONFLICT
from bayesid.estimation.likelihood.predictive_check import MISSED, missed
from bayesid.estimation.output_error import Fit
from bayesid.estimation.trial_fit import RunOutcome, TrialFit
from bayesid.measures.angle_errors import turns_note
from bayesid.model.terms import TERMS, term
from bayesid.model.vehicles.orders import rudder_limits, steers
from bayesid.places import NOWHERE, Places
from bayesid.prediction.draws import MOST_DIVERGED
from bayesid.prediction.fitted_model import Calibration
from bayesid.report import coefficient_cells, writer
from bayesid.report import fit_figures as figures
from bayesid.report import fit_first_screen as first_screen
from bayesid.report.fit_form import form_rows_of
from bayesid.report.fit_held import actuator_words, freeing_words, held_words
from bayesid.report.manoeuvre_words import APART
from bayesid.report.writer import Block, Figure, Report, Section, Table, Text, literal
from bayesid.words import counted, first_few

USUAL_TURN = 20.0  # degrees of rudder
MISFIT = 3.0  # residuals of so many times the noise are not noise
HOLDOUT_GROWTH = 1.1  # of the rms heading error, from which a held-out run counts as predicted worse
MOST_CHANNELS = 3  # named one by one where they miss a kind of motion
MOST_RUNS = 12  # figures; the residual table has all runs
_LABELS = {t.name: t.label for t in TERMS}
_SHARES = {
    "line_search": "line search (cost)",
    "gradient": "gradient and Jacobian",
    "subproblem": "quadratic sub-problem and Hessian update",
    "other": "other",
}


def write_fit_report(
    found: TrialFit,
    folder: str | os.PathLike[str],
    calibration: Calibration | None = None,
    places: Places = NOWHERE,
    no_model: str = "",
) -> Path:
    """Write report.html, report.md, results.json and figures; returns the path of the HTML file."""
    results = {
        "inputs": {
            "trial": found.trial.name,
            "trial_digest": found.trial.digest,
            "vehicle": found.vehicle.name,
            "vehicle_digest": found.vehicle.digest,
            "attribution": found.trial.attribution,
        },
        "seeds": [found.fit.seed],
        "verdict": found.fit.verdict,
        "converged": found.fit.converged,
        "fit": found.fit,
        "prediction": calibration,
        "runs": [
            {
                "name": r.name, "role": r.role, "channels": r.channels, "sigma": r.sigma, "memory": r.memory,
                "rms_nominal": r.rms_nominal, "rms_fitted": r.rms_fitted,
            }
            for r in found.runs
        ],
    }  # fmt: skip
    return writer.write(fit_report(found, calibration, places, no_model), folder, results)


def fit_report(
    found: TrialFit, calibration: Calibration | None = None, places: Places = NOWHERE, no_model: str = ""
) -> Report:
    """The report as plain data; `no_model` says why there is none for predictions."""
    sections = [
        _coefficients(found),
        *_certainty(found, calibration),
        _open_directions(found.fit),
        _residuals(found),
        _runs(found),
        Section("Appendix: the search and the inputs", [_search(found.fit), _inputs(found)]),
    ]
    lead = f"**{literal(first_screen.headline(found))}**\n\n{_verdict_words(found)}"
    return Report(
        f"{found.trial.name}: coefficients fitted",
        lead,
        sections,
        failed_checks(found),
        first_screen.first_blocks(found, next_steps(found, calibration is not None, places, no_model)),
    )


def failed_checks(found: TrialFit) -> list[str]:
    """Checks that failed, one sentence each: search, open combinations, held-out runs, coefficients held that
    the runs move, runs that disagree, a force that is asked for and could not be fitted.
    """
    others = [*holdout_words(found.runs), *map(literal, held_words(found))]
    if found.posterior is not None:
        others += found.posterior.not_final()
    if found.fit.uncertainty.get("form_failed"):
        others += form_words(found.fit)
    return first_screen.failures(found, others)


def _verdict_words(found: TrialFit) -> str:
    """How many coefficients from how many runs, how well, and how the search ended."""
    before, after = (noise_level(found.runs, "identify", key) for key in ("rms_nominal", "rms_fitted"))
    end = "The search converged" if found.fit.converged else "The search did not converge"
    return (
        f"{found.fit.n_params} coefficients of {literal(found.vehicle.name)} from "
        f"{counted(len(found.trial.identify), 'run')}; residuals of the fitted runs fall from {before} to "
        f"{after} times the noise{force_left_out(found)}. {end}."
    )


def force_left_out(found: TrialFit) -> str:
    """What residuals of a fit with a random force are of; empty for another fit."""
    by_filter = found.posterior is not None and found.posterior.parts.disturbance
    return ", simulated without the random force" if by_filter else ""


def next_steps(
    found: TrialFit, model_written: bool = True, places: Places = NOWHERE, no_model: str = ""
) -> list[str]:
    """What to do with this fit; `model_written` where `bayesid predict` finds its model, `no_model` why there
    is none."""
    out = [*freeing_words(found), *actuator_words(found)]
    if not found.fit.converged:
        out.append(
            "To end the search, fit pieces of the runs (`--pieces SECONDS`, in which errors grow less), or "
            f"free fewer than {found.fit.n_params} coefficients (`--free`; those of sway, yaw and rudder "
            "first, then more from there)."
        )
    if any(d.decided_by != "prior" for d in found.fit.flat):
        runs = f"a manoeuvre that tells: `bayesid design {places.fitted}`" if steers(found.vehicle) else APART
        out.append(f"Keep what is known (`--free`, `--fix`), or run {runs}.")
    if not any(r.role == "holdout" for r in found.runs):
        out.append("No run was held out: keep one back (`--runs`, role `holdout`) to see what it is worth.")
    if noise_of(found.runs) > MISFIT and not force_left_out(found):
        out.append(
            f"Residuals are several times the noise: `bayesid diagnose {places.fitted}` asks for the cause."
        )
    why_not = literal(no_model) if found.fit.converged else "its search did not converge"
    if holdout_words(found.runs):
        why_not = "it predicts held-out runs worse than the vehicle as given"
    if first_screen.unphysical(found):
        why_not = "no real vehicle has its coefficients"
    if first_screen.diverging(found):
        why_not = "its simulation diverges"
    return [*out, prediction_step(why_not, model_written, places, _example(found))]


def _example(found: TrialFit) -> str:
    """A turn the vehicle can make, or a run of the trial where it has no rudder."""
    if not steers(found.vehicle):
        return found.trial.runs[0].name
    most = math.degrees(rudder_limits(found.vehicle)[0])
    return f"turn:{math.floor(min(USUAL_TURN, most))}" if most >= 1.0 else f"turn:{most:.6g}"


def noise_of(runs: tuple[RunOutcome, ...]) -> float:
    """Rms of the fitted runs' residuals as found, in units of the noise; nan where nothing is finite."""
    ratios = np.concatenate([r.rms_fitted / r.sigma for r in runs if r.role == "identify"] or [np.zeros(0)])
    ratios = ratios[np.isfinite(ratios)]
    return float(np.sqrt(np.mean(ratios**2))) if ratios.size else float("nan")


def noise_level(runs: tuple[RunOutcome, ...], role: str, which: str) -> str:
    """Rms over channels of the errors in units of the weights, in words."""
    ratios = [getattr(r, which) / r.sigma for r in runs if r.role == role]
    found = np.concatenate(ratios) if ratios else np.zeros(0)
    found = found[np.isfinite(found)]
    return f"{np.sqrt(np.mean(found**2)):.3g}" if found.size else "– (the simulation diverges)"


def _coefficients(found: TrialFit) -> Section:
    fit, k = found.fit, found.fit.n_params
    rows = []
    open_names = [d for d in fit.flat if d.decided_by != "prior"]
    unsure = () if found.posterior is None else found.posterior.wider_than_prior
    for i, name in enumerate(fit.names[:k]):
        flags = []
        if name in fit.at_bound:
            flags.append("on a bound")
        if fit.sd[i] > 0.9 * fit.prior_sd[i]:
            flags.append("less sure than the prior" if name in unsure else "the prior decides")
        if any(abs(d.vector[i]) > 0.3 for d in open_names):
            flags.append("part of an open combination")
        if name in form_rows_of(fit):
            flags.append("model form: a row the vehicle lacks")
        if found.posterior is not None and abs(found.posterior.conflict[i]) > CONFLICT:
            flags.append(f"prior conflict of {abs(found.posterior.conflict[i]):.1f} sd")
        first = coefficient_cells.prime(found.vehicle, name, fit.start[i])
        value = coefficient_cells.cells(found.vehicle, name, fit.z[i])
        size = abs(fit.z[i]) or 1.0
        prior = 100 * fit.prior_sd[i] / size if np.isfinite(fit.prior_sd[i]) else None
        rows.append([name, first, *value, 100 * fit.sd[i] / size, prior, ", ".join(flags)])
    columns = [
        "coefficient", "start (prime)", *coefficient_cells.COLUMNS, "sd [%]", "prior sd [%]", "remark",
    ]  # fmt: skip
    start = np.where(fit.start[:k] == 0, fit.scale[:k], fit.start[:k])
    change = np.where(fit.start[:k] == 0, 1 + fit.z[:k] / start, fit.z[:k] / start)
    labels = [_LABELS.get(n, n) for n in fit.names[:k]]
    drawn = figures.estimates(labels, change, fit.sd[:k] / abs(start), fit.prior_sd[:k] / abs(start))
    rests = "what the residuals show of memory and of differences between runs (next section)."
    if found.posterior is None or found.posterior.parts.white:
        rests = "takes the residuals as white noise."
    text = f"{coefficient_cells.FORM} The standard deviation includes the prior and {rests}"
    caption = (
        "Estimates over their start values; a parameter that starts at zero is shown as 1 + value / scale. "
        "Triangles: outside the figure."
    )
    return Section(
        "Coefficients",
        [Text(text), Table(columns, rows), Figure("estimates", drawn, caption)],
    )


def holdout_words(runs: tuple[RunOutcome, ...]) -> list[str]:
    """A sentence where the found vehicle predicts the heading of held-out runs worse than the given one."""
    worse, held = [], 0
    for run in runs:
        if run.role != "holdout" or "psi" not in run.channels:
            continue
        held += 1
        j = run.channels.index("psi")
        given, found = (float(np.degrees(x[j])) for x in (run.rms_nominal, run.rms_fitted))
        if not found <= HOLDOUT_GROWTH * given:
            worse.append((run.name, given, found))
    if not worse:
        return []
    name, given, found = max(worse, key=lambda w: w[2] if np.isfinite(w[2]) else np.inf)
    return [
        f"The heading of {len(worse)} of {held} held-out runs is predicted worse than by the vehicle as "
        f"given (largest: {literal(name)}, {given:.3g} to {found:.3g} degrees rms): whole runs of an "
        "unstable vehicle amplify small errors; try shorter pieces, hold what is known, or predict with "
        "a band."
    ]


def form_words(fit: Fit) -> list[str]:
    """A sentence where the runs ask for a force the equations lack."""
    rows = form_rows_of(fit)
    if failed := fit.uncertainty.get("form_failed"):
        return [
            "These runs ask for a force the equations of this vehicle lack, of "
            f"{failed['size']:.0e} of 1/2 rho L^2 U^2; the fit with it failed ({literal(failed['reason'])}), "
            "so these coefficients may stand in for it."
        ]
    if not rows:
        return []
    first = sorted(rows, key=lambda n: -abs(rows[n]))[:3]
    told = ", ".join(f"{literal(n)} {rows[n]:+.1e}" for n in first)
    return [
        "These runs ask for a force the equations of this vehicle lack: every row of the table its symmetry "
        "allows, but for planes that stay at zero, is free about zero with "
        f"{fit.uncertainty['form']['size']:.0e} of 1/2 rho L^2 U^2. Largest "
        f"at v' = 0.2, r' = 0.3, 0.25 rad of rudder: {told}."
    ]


def predictive_words(fit: Fit) -> list[str]:
    """A sentence where a channel's errors in one kind of motion are larger than those assumed."""
    low = missed(fit.uncertainty.get("predictive_p", {}))
    if not low:
        return []
    told = "; ".join(f"{literal(kind)}: {_channels(each)}" for kind, each in low.items())
    return [
        "The errors of these channels are larger than the noise of this fit makes them, by posterior "
        f"predictive p below {MISSED:g}: {told}. The model misses this motion, or the noise is larger there."
    ]


def _channels(each: Mapping[str, float]) -> str:
    if len(each) > MOST_CHANNELS:
        return f"{len(each)} channels (p up to {max(each.values()):.1g})"
    return ", ".join(f"{c} (p = {p:.1g})" for c, p in each.items())


def _predictive_table(fit: Fit) -> list[Block]:
    found = fit.uncertainty.get("predictive_p", {})
    names = list(dict.fromkeys(c for each in found.values() for c in each))
    rows = [[literal(kind), *(each.get(c) for c in names)] for kind, each in found.items()]
    text = (
        "Posterior predictive p: probability that the noise of this fit makes errors at least as large as "
        "those of the readings, per kind of motion and channel."
    )
    return [Text(text), Table(["motion", *names], rows, digits=2)] if rows else []


def calibration_words(calibration: Calibration) -> str:
    """How well the fitted runs are predicted, in a sentence."""
    inside = ", ".join(f"{c} {100 * share:.0f} %" for c, share in calibration.inside.items())
    if not calibration.apart:
        return (
            "Predicted by the fit that read it, the run lies inside the 95 % band for this share of the "
            f"time: {inside}. One run alone says nothing of the next: fit several."
        )
    shown = ((c, s, *_unit(c)) for c, s in calibration.channel.items())
    own = ", ".join(f"{c} {factor * s:.2g} {unit}" for c, s, factor, unit in shown)
    told = f" Beside the force in the bands, channels err by themselves (one sd): {own}." if own else ""
    return (
        "Each predicted from the others, the fitted runs lie inside the 95 % band for this share of the "
        f"time: {inside}.{told}"
    )


def diverging_words(calibration: Calibration) -> list[str]:
    """Whether vehicles drawn from the covariance of the fit diverge, and what a prediction makes of it."""
    if not calibration.diverge:
        return []
    ranked = sorted(calibration.diverge.items(), key=lambda item: -item[1])
    told = first_few((f"{share:.0%} in `{run}`" for run, share in ranked), MOST_NAMED)
    refused = ranked[0][1] > MOST_DIVERGED
    what = "refuses such a run" if refused else "tells the estimate there, with the band of the others"
    return [
        f"Of vehicles drawn from the covariance of this fit some diverge ({told}): it reaches further than "
        f"the estimate can be trusted, and `bayesid predict` {what}."
    ]


def _certainty(found: TrialFit, calibration: Calibration | None) -> list[Section]:
    """What the standard deviations rest on; nothing for a fit without a posterior."""
    posterior = found.posterior
    if posterior is None:
        return []
    parts, half = posterior.parts, posterior.halves
    counted = (
        f"A reading counts for {100 * parts.weight:.3g} % of what it would with white noise beside the prior"
    )
    if parts.disturbance:
        counted = (
            "A filter has that force in the equations of motion; what it foretells from sample to sample "
            "errs as sensors do, without memory"
        )
    elif parts.efficient:
        counted = "Every run is weighed by the covariance of its score"
    text = [
        f"Errors of the fit: {parts.describe()}. {counted}, and the standard deviations are "
        f"{np.median(posterior.sd / posterior.white_sd):.2g} times those of white noise (median)."
    ]
    if half is None:
        text.append("A single run: whether runs agree cannot be checked.")
    elif not half.counted.any():
        text.append("Odd and even runs cannot be compared: they determine no coefficient.")
    else:
        text.append(
            f"Odd and even runs, fitted apart, differ by {half.rms:.2g} standard deviations rms over the "
            f"{int(half.counted.sum())} coefficients the data determine (1 is expected; p = {half.p:.2g})."
        )
    if posterior.determined:
        names = ", ".join(f"`{n}`" for n in posterior.determined)
        text.append(f"Determined by the data, to less than half their prior standard deviation: {names}.")
    text += [*_ridge_words(found.fit), *form_words(found.fit), *posterior.doubts()]
    text += predictive_words(found.fit)
    if calibration is not None:
        text += [calibration_words(calibration), *diverging_words(calibration)]
    blocks = [Text(" ".join(text)), *_predictive_table(found.fit)]
    return [Section("What the standard deviations rest on", blocks)]


def _ridge_words(fit: Fit) -> list[str]:
    """A sentence on ridges that bend, where the fit has some."""
    if not (told := fit.uncertainty.get("nonlinear")):
        return []
    if not told["pairs"]:
        return [
            "Whether combinations the runs leave open bend away from straight lines could not be told: the "
            f"vehicle diverges along them, or leaves what it can have ({told['lost']} of the pairs of draws "
            "tried). Standard deviations are those of linear theory."
        ]
    return [
        "Combinations the runs leave open bend away from straight lines: some that are fixed at the estimate "
        f"are up to {told['widest_over_linear']:.2g} times less sure than linear theory says, which the "
        "covariance of the identified vehicle counts."
    ]


def _open_directions(fit: Fit) -> Section:
    if not fit.flat:
        text = (
            "None: every combination of the free coefficients is determined by the data alone to better "
            "than half "
            f"the coefficients' size. Smallest singular value {fit.singular_values.min():.3g} per relative "
            f"change."
        )
        return Section("What the data leave open", [Text(text)])
    holder = {"prior": "the prior", "bounds": "the bounds", "nothing": "nothing"}
    rows = [
        [d.name, "none at all" if d.exact else f"{100 * d.sd:.0f} %", holder[d.decided_by]] for d in fit.flat
    ]
    text = (
        "Combinations (relative changes) along which these runs, by themselves, leave more than 50 % of "
        "uncertainty. "
        "What the last column names decides them, not the data; moving along them changes the coefficients "
        "but not "
        "the fit."
    )
    table = Table(["combination", "uncertainty from the data", "held by"], rows)
    return Section("What the data leave open", [Text(text), table])


def _residuals(found: TrialFit) -> Section:
    rows: list[list[Any]] = []
    for run in found.runs:
        for j, c in enumerate(run.channels):
            factor, unit = _unit(c)
            row = [run.name, run.role, f"{c} [{unit}]", factor * run.sigma[j], factor * run.rms_nominal[j]]
            rows.append([*row, factor * run.rms_fitted[j], run.rms_fitted[j] / run.sigma[j], run.memory[j]])
    columns = ["run", "role", "channel", "sigma", "given", "found", "ratio", "memory"]
    headings = (
        float(rms[run.channels.index("psi")])
        for run in found.runs
        if "psi" in run.channels
        for rms in (run.rms_nominal, run.rms_fitted)
    )
    text = (
        "`sigma` is the noise used as weight, `given` and `found` are rms errors of the vehicle as given and "
        "as found, `ratio` is found over sigma. `memory` is the correlation time of the residuals as found, "
        "in samples: 1 is white noise; at 100 the errors of a hundred neighbouring samples go together, "
        "which points at the model, a disturbance or a filter rather than at sensor noise. Held-out runs are "
        "predicted; only their initial state is read from their first seconds." + turns_note(headings)
    )
    return Section("Residuals", [Text(text), Table(columns, rows, digits=3)])


def _unit(name: str) -> tuple[float, str]:
    from bayesid.model.channels import channel

    unit = channel(name).unit
    return (180 / np.pi, unit.replace("rad", "deg")) if unit.startswith("rad") else (1.0, unit)


def _runs(found: TrialFit) -> Section:
    shown = sorted(found.runs, key=lambda r: r.role != "holdout")[:MOST_RUNS]
    blocks: list[Block] = []
    for number, run in enumerate(shown, 1):
        drawn = figures.overlay(run.t, run.channels, run.readings, run.nominal, run.fitted)
        word = "held out: predicted" if run.role == "holdout" else "fitted"
        caption = f"{literal(run.name)} ({literal(run.manoeuvre)}), {word}: is the line on the dots?"
        blocks.append(Figure(f"run{number:02d}", drawn, caption))
    left = len(found.runs) - len(shown)
    if left:
        blocks.append(Text(f"{left} more runs are in the table of residuals only."))
    return Section("Runs", blocks)


def _search(fit: Fit) -> Section:
    by_filter = fit.uncertainty.get("filter_seconds", 0.0)
    searched = fit.seconds - by_filter
    rows = [[_SHARES[key], 100 * share, share * searched] for key, share in fit.shares.items()]
    told = f" The filter took {by_filter:.3g} s, the search of output error before it:" if by_filter else ""
    text = (
        f"Stop reason: {fit.message}.{told} Cost {fit.cost_start:.6g} -> {fit.cost:.6g} in {len(fit.costs)} "
        f"iterations of {fit.rounds} rounds; {fit.n_cost} evaluations of the cost, {fit.n_gradient} of its "
        f"gradient, seed {fit.seed}. On a bound: {', '.join(f'`{n}`' for n in fit.at_bound) or 'none'}."
    )
    blocks: list[Block] = [Text(text), Table(["work", "share [%]", "time [s]"], rows, digits=3)]
    if len(fit.starts) > 1:
        starts = [[i, s["cost_start"], s["cost"], s["reason"]] for i, s in enumerate(fit.starts)]
        blocks.append(Table(["start", "first cost", "last cost", "stop reason"], starts))
    which = "search that went before the filter" if by_filter else "winning start"
    if fit.costs:
        blocks.append(
            Figure("search", figures.search(fit.costs, fit.steps), f"Cost and step of the {which}.")
        )
    return Section("Search", blocks)


def _inputs(found: TrialFit) -> Section:
    sources = sorted({term(n).source for n in found.fit.names[: found.fit.n_params] if n in _LABELS})
    lines = [
        f"- Trial: {literal(found.trial.name)}, {counted(len(found.trial.runs), 'run')}, digest "
        f"`{found.trial.digest[:16]}`",
        f"- Vehicle: {literal(found.vehicle.name)}, digest `{found.vehicle.digest[:16]}`",
        f"- Readings compared: {found.fit.n_readings}",
        f"- Sources of the rows: {', '.join(f'`{s}`' for s in sources)}",
    ]
    if found.trial.attribution:
        lines.append(f"- Data: {literal(found.trial.attribution.removeprefix('Data: '))}")
    return Section("Inputs", [Text("\n".join(lines))])
