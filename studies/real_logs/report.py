"""The report of a ship identified from logs: held-out runs predicted with several sets of rows, one in full.

Takes fits of the same runs with different rows. Does not fit or simulate, and stores no series.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from bayesid.estimation.trial_fit import RunOutcome, TrialFit
from bayesid.report.fit import fit_report
from bayesid.report.prediction_error import prediction_numbers
from bayesid.report.writer import Report, Section, Table, Text, literal
from studies.real_logs.bands import bands_section

KEYS = {"psi": "psi [deg]", "r": "r [deg/s]", "position": "position [m]"}
FAR = 3.0  # prior sd; beyond it an estimate has left what was known of the hull
SHORT = 20.0  # deg: a heading off by more is no prediction


@dataclass(frozen=True)
class Variant:
    """One set of rows: its fit, and held-out runs predicted piece by piece."""

    key: str
    words: str
    found: TrialFit
    pieces: tuple[RunOutcome, ...]


def logs_report(
    variants: Sequence[Variant], outside: Sequence[RunOutcome], facts: Mapping[str, Any]
) -> Report:
    """The report; the last variant is shown in full."""
    best = variants[-1]
    held = zigzags(best.found.runs)
    given, found = (_median([_errors(run, which) for run in held], "psi") for which in WHICH)
    short_given, short_found = (
        _median([_errors(run, which) for run in zigzags(best.pieces)], "psi") for which in WHICH
    )
    trial = best.found.trial
    short, long = min(r.t[-1] - r.t[0] for r in held), max(r.t[-1] - r.t[0] for r in held)
    lead = (
        f"**{len(held)} held-out zig-zags are predicted to {found:.2g} degrees of heading (median of rms "
        f"errors), {given:.2g} with the coefficients the fit starts from.** From their first readings, "
        f"rudder as logged, in one go of {short:.0f} to {long:.0f} s; in pieces of {facts['piece']:g} s: "
        f"{short_found:.2g} degrees, start {short_given:.2g}. {facts['note']} {_verdict(best.found)}"
    )
    own = fit_report(replace(best.found, runs=tuple(r for r in best.found.runs if r.role == "holdout")))
    sections = [
        _prediction(variants),
        _rows_that_matter(variants, facts),
        bands_section(facts["bands"]),
        _halves(facts["halves"]),
        *([_outside(outside)] if outside else []),
        _settings(best.found, facts),
        *own.sections,
    ]
    return Report(f"{trial.name}: identified from half of the runs", lead, sections)


WHICH = ("rms_nominal", "rms_fitted")


def zigzags(runs: Sequence[RunOutcome], role: str = "holdout") -> list[RunOutcome]:
    """Zig-zags of a role."""
    return [r for r in runs if r.role == role and r.manoeuvre.startswith("zigzag")]


def _errors(run: RunOutcome, which: str) -> dict[str, float]:
    """Heading [deg], yaw rate [deg/s], sway and surge [m/s] and position [m] rms; position as a distance."""
    rms = dict(zip(run.channels, (float(v) for v in getattr(run, which)), strict=True))
    degrees = 180 / np.pi
    return {
        "psi": degrees * rms["psi"], "r": degrees * rms["r"], "v": rms["v"], "u": rms["u"],
        "position": float(np.hypot(rms["x"], rms["y"])),
    }  # fmt: skip


def _verdict(found: TrialFit) -> str:
    """How the search ended, and whether the numbers can be the coefficients of a hull."""
    fit, k = found.fit, found.fit.n_params
    words = "The search converged." if fit.converged else "The search did not converge (see Search)."
    if fit.converged and not fit.success:
        words += " Some combinations of coefficients stay open (see below)."
    away = np.abs(fit.z[:k] - fit.start[:k]) / fit.prior_sd[:k]
    far = [name for name, a in zip(fit.names, away, strict=False) if a > FAR]
    if far:
        words += (
            f" {len(far)} of {k} estimates lie more than {FAR:g} prior standard deviations from where they "
            f"started ({', '.join(f'`{n}`' for n in far)}): they predict this ship on such manoeuvres, "
            "but they make up for forces the rows lack and are not to be read as coefficients of the hull."
        )
    return words


def _median(errors: Sequence[Mapping[str, float]], key: str) -> float:
    """Over runs; one that is lost is worse than all others."""
    return float(np.median(np.nan_to_num([e[key] for e in errors], nan=np.inf)))


def _pairs(given: Mapping[str, float], found: Mapping[str, float]) -> list[str]:
    """Given → found for every key, on one line each."""
    words = [["lost" if np.isnan(e[key]) else f"{e[key]:.3g}" for e in (given, found)] for key in KEYS]
    return [f"{a}\N{NO-BREAK SPACE}→\N{NO-BREAK SPACE}{b}" for a, b in words]


def _prediction(variants: Sequence[Variant]) -> Section:
    best = variants[-1]
    rows, lost = [], []
    for run in best.found.runs:
        if run.role == "holdout":
            given, found = _errors(run, WHICH[0]), _errors(run, WHICH[1])
            row: list[Any] = [run.name, run.manoeuvre, float(run.t[-1] - run.t[0])]
            row += _pairs(given, found)
            rows.append(row)
            if not found["psi"] <= SHORT:
                lost.append(run.name)
    columns = ["run", "manoeuvre", "time [s]", *KEYS.values()]
    text = (
        "Rms errors of held-out runs in one go, given → found: the fit has not read them, only the initial "
        "state comes from their first seconds. `given` is the set the fit starts from, rows fitted to a "
        "published MMG model of the hull; `found` the identified one. A ship that is unstable on course "
        "doubles a heading error every few lengths when the rudder is replayed without a helmsman, so the "
        "gentlest zig-zags are the hardest to predict in one go."
    )
    if lost:
        text += f"\n\nNot predicted (heading off by more than {SHORT:g} degrees rms): {', '.join(lost)}."
    return Section("Prediction of the held-out runs", [Text(text), Table(columns, rows, digits=3)])


def _rows_that_matter(variants: Sequence[Variant], facts: Mapping[str, Any]) -> Section:
    first = variants[-1]
    table: list[tuple[str, Any, Any, str, str]] = [
        ("the set the fits start from", first.found.runs, first.pieces, WHICH[0], "–")
    ]
    for v in variants:
        state = v.found.fit.status + (
            "" if v.found.fit.success or not v.found.fit.converged else ", open directions"
        )
        table.append(
            (f"{v.words} ({v.found.fit.n_params} unknowns)", v.found.runs, v.pieces, WHICH[1], state)
        )
    whole: list[list[Any]] = []
    short: list[list[Any]] = []
    for words, runs, pieces, which, state in table:
        for rows, chosen in ((whole, runs), (short, pieces)):
            errors = [_errors(run, which) for run in zigzags(chosen)]
            gone = sum(np.isnan(e["psi"]) for e in errors)
            said = f"{state}; {gone} of {len(errors)} lost" if gone else state
            rows.append([words, *(_median(errors, key) for key in KEYS), said])
    columns = ["rows", *KEYS.values(), "search"]
    text = (
        "Medians over the held-out zig-zags, a lost one the worst, in one go (whole) and restarted from "
        f"readings every {facts['piece']:g} s (pieces). The plain set has products of two velocities only; "
        "the others add cubic rows (`N_vvr` and its kin) and the propeller race on the rudder (`eta`). "
        "`Y_*` and `N_*`, a constant side force and moment of the single screw, are free in all fits but the "
        "one that says otherwise."
    )
    pieces = f"Held-out zig-zags restarted every {facts['piece']:g} s."
    tables = [Table(columns, whole, "Held-out zig-zags in one go.", 3), Table(columns, short, pieces, 3)]
    return Section("Which rows matter", [Text(text), *tables])


def _halves(halves: Mapping[str, Mapping[str, Any]]) -> Section:
    rows = [
        [words, "–" if h["rms"] is None else f"{h['rms']:.2g}", h["count"],
         ", ".join(f"`{n}` {z:+.1f}" for n, z in h["largest"].items()),
         "converged" if h["converged"] else "not converged"]
        for words, h in halves.items()
    ]  # fmt: skip
    text = (
        "The identify runs split into odd and even ones, each half fitted by itself: difference of the "
        "estimates over the root of the sum of both variances, rms over the coefficients that all runs "
        "together determine to less than half their prior sd. Intervals that hold give about 1 or less."
    )
    columns = ["errors of the fit", "rms difference [sd]", "coefficients", "largest", "search"]
    return Section("Do halves of the runs agree?", [Text(text), Table(columns, rows)])


def _outside(outside: Sequence[RunOutcome]) -> Section:
    text = (
        "Random four-quadrant runs: the propeller reverses and the ship moves astern and sideways, where the "
        "rows of this vehicle do not hold. They were not fitted and are shown so that nobody trusts the "
        "vehicle there; `lost` means that the simulation left all bounds."
    )
    rows = [[r.name, r.manoeuvre, *_pairs(_errors(r, WHICH[0]), _errors(r, WHICH[1]))] for r in outside]
    table = Table(["run", "manoeuvre", *KEYS.values()], rows)
    return Section("Outside the model", [Text(text), table])


def _settings(found: TrialFit, facts: Mapping[str, Any]) -> Section:
    held = sum(r.role == "holdout" for r in found.runs)
    text = (
        f"Logs thinned to a reading every {facts['dt']:g} s, orders at their own times. Runs to identify are "
        f"cut into {len(found.problem.runs)} pieces of about {facts['piece']:g} s with an initial state "
        f"each; {held} whole runs are held out. "
        f"Kept at published values: {', '.join(f'`{n}`' for n in facts['fixed'])}, because with them free "
        "all rows of an axis can be scaled together without a trace in the motion. The noise of a channel is "
        "the rms of its residuals times the root of their correlation time in samples: errors of a model "
        "persist, and a thousand readings that err together are not a thousand readings."
    )
    if facts["quick"]:
        text += "\n\n**A quick run**: half of the samples and few rounds; its numbers are not to be quoted."
    if facts["way"] is not None:
        text += (
            f"\n\nRuns begin where the ship has reached {100 * facts['way']:.0f} % of its speed: they were "
            "started from rest, where the rows do not hold."
        )
    if found.trial.attribution:
        text += f"\n\n{literal(found.trial.attribution)}."
    return Section("How", [Text(text)])


def logs_results(
    variants: Sequence[Variant], outside: Sequence[RunOutcome], facts: Mapping[str, Any], seed: int
) -> dict[str, Any]:
    """Numbers for results.json: settings, estimates and errors; no series and no initial states."""
    trial = variants[-1].found.trial
    fits: dict[str, Any] = {}
    for v in variants:
        fit, k = v.found.fit, v.found.fit.n_params
        fits[v.key] = {
            "rows": v.words, "verdict": fit.verdict, "status": fit.status, "success": fit.success,
            "cost": [fit.cost_start, fit.cost], "sigma": dict(fit.sigma), "at_bound": fit.at_bound,
            "estimates_SI": {
                n: {"start": float(fit.start[i]), "value": float(fit.z[i]), "sd": float(fit.sd[i])}
                for i, n in enumerate(fit.names[:k])
            },
            "uncertainty": fit.uncertainty,
            "open": [{"name": d.name, "held_by": d.decided_by} for d in fit.flat],
            "prediction": prediction_numbers(r for r in v.found.runs if r.role == "holdout"),
            "prediction_in_pieces": prediction_numbers(v.pieces),
        }  # fmt: skip
    return {
        "inputs": {
            "trial": trial.name, "trial_digest": trial.digest, "attribution": trial.attribution,
            "vehicle_digest": variants[-1].found.vehicle.digest, **facts,
        },
        "seeds": [seed], "fits": fits, "outside": prediction_numbers(outside),
    }  # fmt: skip
