"""The first screen of a fit: errors in metres and degrees, failed checks, picture, what moved, what next.

Takes a `TrialFit`. Gives text and blocks for report and terminal. Does not fit or simulate.
"""

from __future__ import annotations

import math

import numpy as np

from bayesid.diagnosis.failed_checks import MOST_RUNS, completed_far, out_of_reason
from bayesid.diagnosis.plain_words import number
from bayesid.diagnosis.run_errors import ErrorRow, miss, missed, missed_too, name_of_run, whole_turns
from bayesid.estimation.output_error import Fit
from bayesid.estimation.trial_fit import RunOutcome, TrialFit
from bayesid.model.terms import ADDED_MASSES
from bayesid.model.vehicles.check import check_vehicle
from bayesid.report import run_picture
from bayesid.report.fit_effects import effect_words
from bayesid.report.fit_form import form_rows_of
from bayesid.report.writer import Block, Figure, Row, Section, Table, Text, literal
from bayesid.simulation import shaft_speed_note
from bayesid.trials.held_out_log import held_out_notes
from bayesid.trials.noise_stated import noise_warning
from bayesid.words import and_list, counted, digits, first_few

LABELS = ("as given", "as found")
MOST_MOVED = 4
SAME = 1.1
MOVED = 2.0  # standard deviations
LEAST_PERCENT = 0.01
SIGN_TOLD = 2.0  # standard deviations from zero
DEGREE = 180 / math.pi
NO_VALUE = 1e-3  # of the value given: a coefficient that the search took to zero


def shown_run(found: TrialFit) -> RunOutcome | None:
    """The held-out run that the vehicle as given misses most, else the fitted one."""
    held = [r for r in found.runs if r.role == "holdout"] or list(found.runs)

    def misfit(r: RunOutcome) -> float:
        ratio = r.rms_nominal / r.sigma
        known = ratio[~np.isnan(ratio)] if np.isfinite(r.nominal).any() else np.array([np.inf])
        return float(np.mean(known**2)) if known.size else 0.0

    return max(held, key=misfit, default=None)


def errors_of(run: RunOutcome) -> tuple[ErrorRow, ...]:
    """Position and heading (depth where logged) as given and as found; else the first channel."""
    pairs = {c: (float(run.rms_nominal[j]), float(run.rms_fitted[j])) for j, c in enumerate(run.channels)}
    rows = []
    if {"x", "y"} <= set(pairs):
        both = tuple(math.hypot(pairs["x"][k], pairs["y"][k]) for k in range(2))
        rows.append(ErrorRow("position", "m", both))
    for channel, what, unit, scale in (("psi", "heading", "degrees", DEGREE), ("z", "depth", "m", 1.0)):
        if channel in pairs:
            rows.append(ErrorRow(what, unit, tuple(scale * v for v in pairs[channel])))
    if not rows:
        for channel, unit, scale in (("r", "degrees a second", DEGREE), ("u", "m/s", 1.0)):
            if channel in pairs:
                rows.append(ErrorRow(channel, unit, tuple(scale * v for v in pairs[channel])))
    return tuple(rows)


def headline(found: TrialFit) -> str:
    """One sentence: how far the run shown is missed, as found and as given."""
    run = shown_run(found)
    if run is None or not (rows := errors_of(run)):
        return f"{found.fit.n_params} coefficients fitted."
    verb = "predicted" if run.role == "holdout" else "simulated"
    name = name_of_run(run.name, run.manoeuvre, run.role)
    better = any(
        math.isfinite(r.values[1]) and not r.values[0] <= SAME * r.values[1] for r in rows
    ) and not any(math.isfinite(r.values[0]) and not r.values[1] <= SAME * r.values[0] for r in rows[:1])
    if better and not miss(rows, 0):
        return (
            f"With the coefficients found, the {verb} {name} is within {miss(rows, 1)} of the log (rms); as "
            "given, the simulation diverges."
        )
    if better:
        return (
            f"With the coefficients found, the {verb} {name} is within {miss(rows, 1)} of the log (rms) "
            f"instead of {miss(rows, 0)}."
        )
    return (
        f"With the coefficients found, the {verb} {name} {missed(rows, 1, ' (rms)')}, which is no gain: as "
        f"given, {missed_too(rows, 0, 1)}."
    )


def moved(found: TrialFit) -> str:
    """A sentence: which coefficients moved by more than their standard deviations allow, the surest first."""
    fit, k = found.fit, found.fit.n_params
    rows, asked = [], 0
    form = form_rows_of(fit)
    for i, name in enumerate(fit.names[:k]):
        if "." in name or name in form:
            continue
        asked += 1
        change, sd, size = fit.z[i] - fit.start[i], fit.sd[i], abs(fit.start[i])
        least = 0.01 * LEAST_PERCENT * size
        if not (math.isfinite(sd) and abs(change) > MOVED * sd and abs(change) >= least):
            continue
        told = (
            percent(math.copysign(change, change * fit.start[i]) / size, sd / size)
            if size
            else (f"from 0 to {digits(fit.z[i], 3)} ± {digits(sd, 2)}")
        )
        rows.append((abs(change) / sd if sd > 0.0 else math.inf, f"{name} {told}"))
    if not rows:
        return "No coefficient moved by more than two standard deviations." if asked else ""
    rows.sort(reverse=True)
    left = len(rows) - MOST_MOVED
    if left > 0:
        rest = f", and {left} more"
    elif len(rows) < asked:
        rest = f"; no other of {asked} by more than two sd"
    else:
        rest = ""
    return f"Moved, the surest first (with one sd): {', '.join(text for _, text in rows[:MOST_MOVED])}{rest}."


def percent(change: float, sd: float) -> str:
    """A relative change and its sd: "+90.3 ± 7.4 %", "-340 ± 120 %"."""
    size = 100 * abs(change)
    whole = digits(size, 3)
    sign = "+" if change > 0 else "-"
    spread = digits(100 * sd, 2) if 100 * sd >= LEAST_PERCENT else f"less than {LEAST_PERCENT:g}"
    return f"{sign}{whole} ± {spread} %"


def failures(found: TrialFit, others: list[str]) -> list[str]:
    """Checks that failed: convergence, what the data leave open, and `others`."""
    out = [] if found.fit.converged else ["The search did not converge; the coefficients are not final."]
    if lost := diverging(found):
        out.append(
            f"With the coefficients found, the simulation of {first_few(lost, MOST_RUNS)} diverges: nothing "
            "can be predicted with them."
        )
    moved, completed = _stated(found), found.vehicle.completed
    if far := out_of_reason(moved, completed):
        out.append(
            f"Coefficients are found far from those stated ({far}): they stand in for something the "
            "equations or the data lack, and are no values of this vehicle."
        )
    if beside := completed_far(moved, completed):
        out.append(f"The fit needs {beside}")
    left = [d.name for d in found.fit.flat if d.decided_by != "prior"]
    if left:
        some = first_few((f"`{n}`" for n in left), 2, "; ")
        out.append(f"These runs do not determine {counted(len(left), 'combination')}: {some}.")
    if odd := unphysical(found):
        out.append(f"No real vehicle has these coefficients: {first_few(odd, MOST_RUNS, '; ')}.")
    if none := without_added_mass(found.fit):
        ended = f"{and_list(none)} ended at zero: no hull is without added mass"
        out.append(
            f"{ended}. Hold what is known of it (--fix {','.join(none)}), or say when orders acted "
            "([corrections] late in trial.toml): those that change between two stamps of the log act before "
            "they are logged, by half a step in the mean."
        )
    for wrong in filter(None, (shaft_speed_note(found.trial), noise_warning(found.trial))):
        out.append(f"{wrong[0].upper()}{wrong[1:]}.")
    out += held_out_notes(found.trial.warnings)
    return out + others


def without_added_mass(fit: Fit) -> list[str]:
    """Added masses that the search took to zero, where they end."""
    return [
        name
        for i, name in enumerate(fit.names[: fit.n_params])
        if name in fit.at_bound and abs(fit.z[i]) < NO_VALUE * abs(fit.start[i]) and name in ADDED_MASSES
    ]


def unphysical(found: TrialFit) -> list[str]:
    """What the check of a vehicle finds impossible in rows of the one found, and not of the one given.

    Rows of a model form are forces beside the vehicle's own, and a sign that is not told is none: what a
    check concludes from signs needs those of all its rows told, what it concludes otherwise does not.
    """
    fit, form = found.fit, form_rows_of(found.fit)
    sure = {n: abs(z) > SIGN_TOLD * sd for n, z, sd in zip(fit.names, fit.z, fit.sd, strict=False)}
    given, after = (
        {(f.rows, f.by_sign): f.text for f in check_vehicle(vehicle) if f.level == "warning" and f.rows}
        for vehicle in (found.problem.model.vehicle, found.identified)
    )
    return [
        text
        for (rows, by_sign), text in after.items()
        if (rows, by_sign) not in given
        and not set(rows) & set(form)
        and not (by_sign and any(not sure.get(name, True) for name in rows))
    ]


def _stated(found: TrialFit) -> dict[str, tuple[float, float, float]]:
    """Coefficients with value as given, value found and stated sd; rows of a model form state none."""
    fit = found.fit
    return {
        name: (float(fit.start[i]), float(fit.z[i]), float(fit.prior_sd[i]))
        for i, name in enumerate(fit.names[: fit.n_params])
        if fit.start[i] and "." not in name
    }


def diverging(found: TrialFit) -> list[str]:
    """Runs whose simulation with the coefficients found diverges."""
    return [run.name for run in found.runs if run.fitted.size and not np.isfinite(run.fitted[-1]).any()]


def first_blocks(found: TrialFit, steps: list[str]) -> list[Block]:
    """Errors, picture, what moved, what next."""
    run = shown_run(found)
    blocks: list[Block] = []
    if run is None:
        return blocks
    name = literal(name_of_run(run.name, run.manoeuvre, run.role))
    word = "predicted, the fit has not read it" if run.role == "holdout" else "fitted"
    blocks.append(
        Table(
            ["rms error", *LABELS],
            [[f"{r.what} [{r.unit}]", *(_cell(x) for x in r.values)] for r in errors_of(run)],
            f"{name[:1].upper()}{name[1:]}: {word}. Errors of the whole run; those of a diagnosis count "
            "after its first seconds, and begin otherwise." + whole_turns(errors_of(run)),
        )
    )
    picture = picture_of(run)
    band = "Blue: where 95 % of the small dots would lie by the noise used as weight."
    caption = f"{literal(run_picture.caption(picture, band))} A line that leaves its panel misses by more."
    blocks.append(
        Row(
            (
                Figure("picture_track", run_picture.track(picture), alt=f"Track of {name}"),
                Figure("picture_time", run_picture.over_time(picture), alt=f"Errors of {name}"),
            ),
            caption,
        )
    )
    blocks += [Text(literal(words)) for words in effect_words(found)]
    if words := moved(found):
        blocks.append(Text(literal(words)))
    if steps:
        blocks.append(Section("What to do next", [Text("\n".join(f"- {s}" for s in steps))]))
    return blocks


def picture_of(run: RunOutcome) -> run_picture.RunPicture:
    half = np.broadcast_to(1.96 * run.sigma, run.readings.shape)
    series = (
        run_picture.Series(LABELS[0], run_picture.GIVEN, run.nominal),
        run_picture.Series(LABELS[1], run_picture.BEST, run.fitted),
    )
    return run_picture.RunPicture(run.t, tuple(run.channels), run.readings, series, 0.0, half)


def _cell(x: float) -> str:
    return number(x) if math.isfinite(x) else "diverges"
