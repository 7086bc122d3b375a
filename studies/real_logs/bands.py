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
from bayesid.prediction.run_prediction import predict_run
from bayesid.report.writer import Section, Table, Text
from bayesid.trials import Run

# With 200 draws a run whose error lies along the edge of its band is inside for 37 to 100 % of the time, by
# the seed, which moves the mean of three runs by 20 %; with 2000 that moves by 3 %.
DRAWS, CALIBRATION_DRAWS = 2000, 60
LEAST, MOST = 0.90, 0.98  # share of the time inside the 95 % band that is asked for
CHANCE = (0.05, 0.95)


def held_out_bands(found: TrialFit, runs: Sequence[Run], seed: int) -> dict[str, Any]:
    """Kind of motion -> number of runs and, per channel, the mean share of the time inside and what chance
    makes of it: the same share of vehicles drawn from the model, 5 to 95 % of them.

    A vehicle is followed through all runs, with another disturbance in each; `lost` are those that diverge in
    one of them.
    """
    try:
        model, sized = predictive_model(found, CALIBRATION_DRAWS, seed)
    except BayesidError as error:
        return {
            "kinds": {}, "good_by_chance": good_by_chance([]), "above_by_chance": above_by_chance([]),
            "lost": 0, "drawn": DRAWS, "not_predicted": {"all": str(error)},
        }  # fmt: skip
    shares: dict[str, list[tuple[dict[str, Any], dict[str, Any]]]] = {}
    whole, missed = np.ones(DRAWS, dtype=bool), {}
    for occasion, run in enumerate(runs):
        try:
            p = predict_run(model, run, DRAWS, seed, occasion=occasion)
        except BayesidError as error:
            missed[run.name] = str(error)
            continue
        if not (seen := beside_readings(p, run, seed)):
            missed[run.name] = f"nothing is read after its first {p.lead:.3g} s"
            continue
        whole &= np.isin(np.arange(DRAWS), p.vehicles)
        kind = kind_of(run.manoeuvre).removesuffix(" starboard").removesuffix(" port")
        shares.setdefault(kind, []).append((seen, shares_of_draws(p, run, seed)))
    kinds, counts, beyond = {}, [], []
    for kind, each in shares.items():
        channels, good, above = _channels(each)
        kinds[kind] = {"runs": len(each), "channels": channels}
        counts.append(good)
        beyond.append(above)
    return {
        "kinds": kinds, "good_by_chance": good_by_chance(counts), "above_by_chance": above_by_chance(beyond),
        "not_predicted": missed, "lost": int(np.sum(~whole)), "drawn": DRAWS,
        "disturbance": sized.level, "tau": sized.tau,
        "errors_of_channels": dict(sized.channel), "keeps_prior": sized.keeps_prior,
    }  # fmt: skip


def _channels(
    each: Sequence[tuple[Mapping[str, Any], Mapping[str, Any]]],
) -> tuple[dict[str, Any], np.ndarray, np.ndarray]:
    """Of one kind of motion: shares per channel, (draws,) channels of a drawn vehicle that are where they are
    asked for, and (draws,) those above what chance makes of them; nan of a vehicle that diverged in a run, no
    draws without a channel.

    Parameters
    ----------
    each : per run, as `beside_readings` and `shares_of_draws`; share k is of vehicle k in every run
    """
    out: dict[str, Any] = {}
    good, above = [], []
    for name in dict.fromkeys(name for seen, draws in each for name in seen if name in draws):
        mean = np.mean([draws[name] for _, draws in each if name in draws], axis=0)
        low, high = _quantiles(mean, CHANCE)
        whole = np.isfinite(mean)
        good.append(np.where(whole, _asked_for(mean), np.nan))
        above.append(np.where(whole, mean > high, np.nan))
        inside = float(np.mean([seen[name]["inside"] for seen, _ in each if name in seen]))
        out[name] = {"inside": inside, "chance": [low, high]}
    return (out, np.sum(good, axis=0), np.sum(above, axis=0)) if out else (out, np.zeros(0), np.zeros(0))


def good_by_chance(counts: Sequence[np.ndarray]) -> list[float]:
    """How many cells of a vehicle drawn from the model are where they are asked for: median, 5 and 95 %.

    Parameters
    ----------
    counts : per kind of motion, as `_channels`
    """
    some = [c for c in counts if np.size(c)]
    return _quantiles(np.sum(some, axis=0), (0.5, *CHANCE)) if some else [0.0, 0.0, 0.0]


def above_by_chance(counts: Sequence[np.ndarray]) -> list[float]:
    """How many cells of a vehicle drawn from the model are above what 95 % of such vehicles fill: mean, 95 %.

    A cell that more than 5 % of them fill wholly cannot be.

    Parameters
    ----------
    counts : per kind of motion, as `_channels`
    """
    some = [c for c in counts if np.size(c)]
    if not some:
        return [0.0, 0.0]
    total = np.sum(some, axis=0)
    return [float(np.nanmean(total)), *_quantiles(total, CHANCE[1:])]


def _quantiles(values: np.ndarray, levels: Sequence[float]) -> list[float]:
    """Of the values of vehicles that have one."""
    whole = values[np.isfinite(values)]
    return [float(q) for q in np.quantile(whole, levels)] if whole.size else [np.nan] * len(levels)


def _asked_for(share: np.ndarray) -> np.ndarray:
    return (share >= LEAST) & (share <= MOST)


def bands_section(bands: Mapping[str, Any]) -> Section:
    """The table, and how many cells are where they are asked for."""
    kinds = bands["kinds"]
    cells = [c["inside"] for kind in kinds.values() for c in kind["channels"].values()]
    good = int(_asked_for(np.array(cells)).sum())
    median, low, high = bands["good_by_chance"]
    short = sum(c < LEAST for c in cells)
    above = sum(c["inside"] > c["chance"][1] for kind in kinds.values() for c in kind["channels"].values())
    mean, most = bands["above_by_chance"]
    text = (
        "Share of the time that held-out runs spend inside their 95 % band, in percent: "
        f"{good} of {len(cells)} cells lie within {100 * LEAST:.0f} to {100 * MOST:.0f}, {short} below. For "
        "vehicles drawn from the model, whose bands are right, the number of such cells has a median of "
        f"{median:.0f} and lies within {low:.0f} to {high:.0f} for 90 % of them: errors of a run go "
        "together, so that a few runs all inside tell little of a band that is too wide. Each of these "
        "vehicles is followed through all runs, with another disturbance and start in each. In brackets what "
        f"they fill of a band, 5 to 95 % of them: {above} of the cells lie above it, of such a vehicle "
        f"{mean:.1f} on average and at most {most:.0f} for 95 % of them."
    )
    if bands["lost"]:
        text += f" Left out, as they diverge in one of the runs: {bands['lost']} of {bands['drawn']}."
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
