"""Held-out runs of a ship beside the 95 % band that the fit of the others gives them by `bayesid predict`.

Takes a fit and runs it has not read. Gives shares per kind of motion and channel, and the section of the
report. Does not fit.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from bayesid.errors import BayesidError
from bayesid.estimation.likelihood.predictive_check import kind_of
from bayesid.estimation.trial_fit import TrialFit
from bayesid.prediction.fitted_model import predictive_model
from bayesid.prediction.intervals import beside_readings, shares_of_draws
from bayesid.prediction.prediction import predict_run
from bayesid.report.writer import Section, Table, Text
from bayesid.trials import Run

DRAWS, CALIBRATION_DRAWS = 200, 60
LEAST, MOST = 0.90, 0.98  # share of the time inside the 95 % band that is asked for
CHANCE = (0.05, 0.95)


def held_out_bands(found: TrialFit, runs: Sequence[Run], seed: int) -> dict[str, Any]:
    """Kind of motion -> number of runs and, per channel, the mean share of the time inside and what chance
    makes of it: the same share of vehicles drawn from the model, 5 to 95 % of them.
    """
    try:
        model, sized = predictive_model(found, CALIBRATION_DRAWS, seed)
    except BayesidError as error:
        return {"kinds": {}, "good_by_chance": good_by_chance([]), "not_predicted": {"all": str(error)}}
    shares: dict[str, list[tuple[dict[str, Any], dict[str, Any]]]] = {}
    lost = {}
    for run in runs:
        try:
            p = predict_run(model, run, DRAWS, seed)
        except BayesidError as error:
            lost[run.name] = str(error)
            continue
        kind = kind_of(run.manoeuvre).removesuffix(" starboard").removesuffix(" port")
        shares.setdefault(kind, []).append((beside_readings(p, run, seed), shares_of_draws(p, run, seed)))
    kinds, counts = {}, []
    for kind, each in shares.items():
        channels, good = _channels(each)
        kinds[kind] = {"runs": len(each), "channels": channels}
        counts.append(good)
    return {
        "kinds": kinds, "good_by_chance": good_by_chance(counts), "not_predicted": lost,
        "disturbance": sized.level, "tau": sized.tau,
        "errors_of_channels": dict(sized.channel), "keeps_prior": sized.keeps_prior,
    }  # fmt: skip


def _channels(
    each: Sequence[tuple[Mapping[str, Any], Mapping[str, Any]]],
) -> tuple[dict[str, Any], np.ndarray]:
    """Of one kind of motion: shares per channel, and (draws,) channels of a drawn vehicle that are where they
    are asked for."""
    out, means = {}, []
    for name in dict.fromkeys(name for seen, draws in each for name in seen if name in draws):
        drawn = [draws[name] for _, draws in each if name in draws]
        count = min(len(d) for d in drawn)  # of a run in which some draws diverge there are fewer
        mean = np.mean([d[:count] for d in drawn], axis=0)
        means.append(mean)
        low, high = np.quantile(mean, CHANCE)
        inside = float(np.mean([seen[name]["inside"] for seen, _ in each if name in seen]))
        out[name] = {"inside": inside, "chance": [float(low), float(high)]}
    count = min((len(m) for m in means), default=0)
    return out, np.sum([_asked_for(m[:count]) for m in means], axis=0)


def good_by_chance(counts: Sequence[np.ndarray]) -> list[float]:
    """How many cells of a vehicle drawn from the model are where they are asked for: median, 5 and 95 %.

    Parameters
    ----------
    counts : per kind of motion, (draws,) such channels of every draw
    """
    draws = min((len(c) for c in counts if np.ndim(c)), default=0)
    if draws == 0:
        return [0.0, 0.0, 0.0]
    total = np.sum([c[:draws] for c in counts], axis=0)
    return [float(q) for q in np.quantile(total, (0.5, *CHANCE))]


def _asked_for(share: np.ndarray) -> np.ndarray:
    return (share >= LEAST) & (share <= MOST)


def bands_section(bands: Mapping[str, Any]) -> Section:
    """The table, and how many cells are where they are asked for."""
    kinds = bands["kinds"]
    cells = [c["inside"] for kind in kinds.values() for c in kind["channels"].values()]
    good = int(_asked_for(np.array(cells)).sum())
    median, low, high = bands["good_by_chance"]
    short = sum(c < LEAST for c in cells)
    text = (
        "Share of the time that held-out runs spend inside their 95 % band, in percent: "
        f"{good} of {len(cells)} cells lie within {100 * LEAST:.0f} to {100 * MOST:.0f}, {short} below. Of "
        f"vehicles drawn from the model, whose bands are right, {median:.0f} do ({low:.0f} to {high:.0f} in "
        "90 % of them): errors of a run go together, so that a few runs all inside tell little of a band "
        "that is too wide. In brackets what those vehicles fill of a band, 5 to 95 % of them."
    )
    if bands["not_predicted"]:
        text += (
            " Not predicted: " + "; ".join(f"{n}: {why}" for n, why in bands["not_predicted"].items()) + "."
        )
    names = list(dict.fromkeys(c for kind in kinds.values() for c in kind["channels"]))
    rows = [
        [f"{kind['runs']} {name}", *(_cell(kind["channels"].get(c)) for c in names)]
        for name, kind in kinds.items()
    ]
    return Section("Bands of the held-out runs", [Text(text), Table(["motion", *names], rows)])


def _cell(found: Mapping[str, Any] | None) -> str:
    if found is None:
        return "–"
    low, high = found["chance"]
    return f"{100 * found['inside']:.0f} ({100 * low:.0f} to {100 * high:.0f})"
