"""A prediction as a table, beside the readings it was not shown, and as bands of standard measures.

Takes a `Prediction`. Gives CSV text and plain numbers. Does not simulate.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from bayesid.diagnosis.diagnosed_model import DiagnosedModel
from bayesid.measures.angle_errors import counted_on
from bayesid.model.channels import channel
from bayesid.prediction.prediction import INTERVAL_LEVEL, Centre, Prediction
from bayesid.trials import Run

Array = np.ndarray
Measure = Callable[[str, Array, Mapping[str, Array]], list[dict[str, Any]]]
DIGITS = 6
DIAMETER = "diameter"  # ends the names of measures that no circle has below zero
FULL_TURN = 2 * math.pi  # width of the heading's band from which on where a vehicle goes is not predicted


def prediction_csv(p: Prediction, noise_seed: int | None = None, widen: float = 1.0) -> str:
    """CSV text: `t[s]`, per channel what is told, band (`x[m],x_low[m],x_high[m]`), orders; deg for angles.

    Parameters
    ----------
    noise_seed : widens the band by the white noise of the sensors; without it the band is for what they
        would read on average
    widen : factor on the band's distance from what is told, where held-out runs have shown it too narrow
    """
    rng = None if noise_seed is None else p.sensor_noise(noise_seed)
    low, high = p.band(rng=rng)
    names, columns = ["t[s]"], [p.t]
    for j, name in enumerate(p.channels):
        factor, unit = channel(name).shown
        for ending, values in (("", p.told), ("_low", low), ("_high", high)):
            names.append(f"{name}{ending}[{unit}]")
            columns.append(factor * (p.told + widen * (values - p.told))[:, j])
    for name, values in p.commands.items():
        factor, unit = channel(name).shown
        names.append(f"{name}[{unit}]")
        columns.append(factor * np.asarray(values))
    rows = [",".join(f"{v:.{DIGITS}g}" for v in row) for row in np.column_stack(columns)]
    return "\n".join([",".join(names), *rows]) + "\n"


def beside_readings(p: Prediction, run: Run, seed: int = 0) -> dict[str, dict[str, float]]:
    """Per channel: rms error of what is told, its largest, and share of the readings inside the 95 % band,
    sensor noise included; after the lead-in, SI. Neighbouring readings share their error: the share is no
    binomial.
    """
    low, high = p.band(rng=p.sensor_noise(seed))
    out = {}
    about_told = {name: error for _, name, error, _ in reading_errors(p, run, p.told)}
    for j, name, error, seen in reading_errors(p, run):
        inside = (error >= low[:, j] - p.mean[:, j]) & (error <= high[:, j] - p.mean[:, j])
        error = about_told[name]
        out[name] = {
            "rms": float(np.sqrt(np.mean(error[seen] ** 2))),
            "largest": float(np.abs(error[seen]).max()),
            "inside": float(inside[seen].mean()),
        }
    return out


def shares_of_draws(p: Prediction, run: Run, seed: int = 0) -> dict[str, Array]:
    """Channel -> (m,) share of the band that each of the m drawn vehicles would fill were it the truth, read
    where the log was; nan for one that diverged, so that position k is vehicle k in every run.

    What `beside_readings` finds inside is told from chance by these: errors of a run go together, so that a
    share far from the level may be one error (posterior predictive check, Gelman et al. 2013, section 6.3).
    """
    rng = p.sensor_noise(seed)
    read = p.draws + np.nan_to_num(p.noise) * rng.standard_normal(p.draws.shape)
    low, high = np.quantile(read, (0.5 - 0.5 * INTERVAL_LEVEL, 0.5 + 0.5 * INTERVAL_LEVEL), axis=0)
    inside = (read >= low) & (read <= high)
    out = {}
    for j, name, _, seen in reading_errors(p, run):
        out[name] = np.full(len(p.draws) + p.lost, np.nan)
        out[name][p.vehicles] = inside[:, seen, j].mean(axis=1)
    return out


def band_checks(
    found: Sequence[Mapping[str, Mapping[str, float]]], draws: Sequence[Mapping[str, Array]]
) -> dict[str, dict[str, float]]:
    """Channel -> mean share `inside` over runs, the `chance` that vehicles of the model fill no more of their
    bands, the `least` chance that as many can tell, and how many are `lost`: they diverge in one of the runs.

    Parameters
    ----------
    found : per run, as `beside_readings`
    draws : per run, as `shares_of_draws`, each of them another occasion of `predict_run` with one seed
    """
    out = {}
    for name in dict.fromkeys(n for one in found for n in one):
        seen = [one[name]["inside"] for one in found if name in one]
        drawn = [one[name] for one in draws if name in one]
        mean = np.mean(drawn, axis=0)
        whole = mean[np.isfinite(mean)]
        if not whole.size:
            continue
        inside = float(np.mean(seen))
        chance = float((1 + np.sum(whole <= inside)) / (1 + whole.size))
        lost = mean.size - whole.size
        out[name] = {"inside": inside, "chance": chance, "least": 1.0 / (1 + whole.size), "lost": lost}
    return out


def standard_errors(p: Prediction, run: Run) -> dict[str, Array]:
    """Channel -> (m,) readings after the lead-in minus the mean, over the predicted sd, noise included."""
    sd = np.hypot(p.draws.std(axis=0, ddof=1), np.nan_to_num(p.noise))
    return {name: error[seen] / sd[seen, j] for j, name, error, seen in reading_errors(p, run)}


def log_density(p: Prediction, run: Run) -> float:
    """Mean over channels of the log density of a reading after the lead-in, each in its SI unit, as normal
    with the mean and sd predicted, sensor noise included.
    """
    sd = np.hypot(p.draws.std(axis=0, ddof=1), np.nan_to_num(p.noise))
    return float(
        np.mean(
            [
                -np.mean(np.log(sd[seen, j]) + 0.5 * (error[seen] / sd[seen, j]) ** 2)
                for j, _, error, seen in reading_errors(p, run)
            ]
        )
        - 0.5 * math.log(2 * math.pi)
    )


def reading_errors(
    p: Prediction, run: Run, about: Array | None = None
) -> Iterator[tuple[int, str, Array, Array]]:
    """Per channel read: position, name, (n,) reading minus the mean of the draws, or minus `about` (n, q)
    (angles through whole turns), which count.
    """
    centre = p.mean if about is None else about
    late = p.t - p.t[0] > p.lead
    for j, name in enumerate(p.channels):
        if name not in run.data:
            continue
        error = counted_on((run.data[name] - centre[:, j])[:, None], (name,))[:, 0]
        seen = late & np.isfinite(error)
        if seen.any():
            yield j, name, error, seen


def measure_bands(p: Prediction, measure: Measure, level: float = INTERVAL_LEVEL) -> list[dict[str, Any]]:
    """Mean and band of every standard measure of a manoeuvre over the draws.

    Parameters
    ----------
    measure : (description, t, channel -> series) -> measures, as `bayesid.cli.run_measures.measure`

    Returns
    -------
    list of dict    kind, quantity, unit, mean, low, high and the share of the draws that have it
    """
    found: dict[tuple[str, str, str], list[float]] = {}
    fixed = {n.removesuffix("_cmd"): np.asarray(v) for n, v in p.commands.items()}
    for k, draw in enumerate(p.draws):
        data = fixed | {c: draw[:, j] for j, c in enumerate(p.channels)}
        if p.orders is not None:
            data |= {n.removesuffix("_cmd"): v[k] for n, v in p.orders.items()}
        for result in measure(f"{p.manoeuvre} {p.name}", p.t, data):
            if any(quantity.endswith(DIAMETER) and value <= 0.0 for quantity, value, _ in result["rows"]):
                continue  # it is carried to the other side than it turns to: no circle to measure
            for quantity, value, unit in result["rows"]:
                found.setdefault((result["kind"], quantity, unit), []).append(float(value))
    return [_row(key, values, len(p.draws), level) for key, values in found.items()]


def _row(key: tuple[str, str, str], values: Sequence[float], draws: int, level: float) -> dict[str, Any]:
    good = np.array([v for v in values if math.isfinite(v)])
    low = mean = high = math.nan
    if good.size:
        mean = float(good.mean())
        low, high = (float(q) for q in np.quantile(good, (0.5 - 0.5 * level, 0.5 + 0.5 * level)))
    return {
        "kind": key[0],
        "quantity": key[1],
        "unit": key[2],
        "mean": mean,
        "low": low,
        "high": high,
        "share": good.size / draws,
    }


def open_from(p: Prediction) -> float | None:
    """Time [s] from the start at which the heading's band becomes wider than a full turn, None if never."""
    if "psi" not in p.channels:
        return None
    low, high = (edge[:, p.channels.index("psi")] for edge in p.band())
    wide = np.flatnonzero((high - low > FULL_TURN) & (p.t - p.t[0] > p.lead))
    return float(p.t[wide[0]] - p.t[0]) if wide.size else None


def told_measures(p: Prediction, measure: Measure) -> list[dict[str, Any]]:
    """Bands of the measures with what is told of each, `told`: of the explanations with coefficients as given
    where all of them have it, else the mean.
    """
    whole = sum(c.weight for c in p.centres)
    values = [
        {m["quantity"]: c.weight / whole * m["mean"] for m in rows if math.isfinite(m["mean"])}
        for c in p.centres
        for rows in [measure_bands(_alone(p, c.readings, c.orders), measure)]
    ]
    return [
        row | {"told": sum(v[row["quantity"]] for v in values)}
        if values and all(row["quantity"] in v for v in values)
        else row | {"told": row["mean"]}
        for row in measure_bands(p, measure)
    ]


def _alone(p: Prediction, readings: Array, orders: Mapping[str, Array] | None) -> Prediction:
    """The same of one vehicle: one draw, no band."""
    one = None if orders is None else {n: v[None] for n, v in orders.items()}
    return replace(p, draws=readings[None], orders=one, vehicles=np.zeros(1, dtype=np.int64), centres=())


def as_given(p: Prediction) -> Prediction | None:
    """The same of the vehicle as given alone: one draw, no band; None where it has none."""
    return None if p.given is None else _alone(p, p.given, p.given_orders)


def of_estimate(p: Prediction) -> Prediction | None:
    """The same of the estimate of a fit alone: one draw, no band; None of a diagnosis, or where it
    diverges."""
    return None if p.estimate is None else _alone(p, p.estimate.readings, p.estimate.orders)


def of_mean(p: Prediction) -> Prediction | None:
    """The same told by the mean of the draws; None where that is told anyway."""
    return replace(p, centres=()) if p.centres else None


def thinned(p: Prediction, every: int) -> Prediction:
    """Every so many-th sample of a prediction, for tables that need not be as fine as the simulation."""
    pick = slice(None, None, every)

    def picked(orders: Mapping[str, Array] | None) -> Mapping[str, Array] | None:
        return None if orders is None else {n: np.asarray(v)[..., pick] for n, v in orders.items()}

    def fewer(c: Centre) -> Centre:
        return replace(c, readings=c.readings[pick], orders=picked(c.orders))

    return replace(
        p,
        t=p.t[pick],
        draws=p.draws[:, pick],
        commands=picked(p.commands) or {},
        orders=picked(p.orders),
        given=None if p.given is None else p.given[pick],
        given_orders=picked(p.given_orders),
        centres=tuple(map(fewer, p.centres)),
        estimate=None if p.estimate is None else fewer(p.estimate),
    )


def stated_spread(found: DiagnosedModel) -> tuple[float, float] | None:
    """Least and largest sd of the coefficients over their value where all are as given; None where fitted."""
    if not found.coefficients_as_given:
        return None
    shares, known = [], set(found.model.coefficients)
    for h in found.hypotheses:
        at = [i for i, name in enumerate(h.names) if name in known]
        shares += [float(s / abs(x)) for s, x in zip(h.sd_in_a_run[at], h.mean[at], strict=True) if x and s]
    return (min(shares), max(shares)) if shares else None
