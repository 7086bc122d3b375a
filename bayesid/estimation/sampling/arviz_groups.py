"""What ArviZ wants beside the draws: prior, predictive readings, what was read, log likelihood of runs.

Takes a `TrialDensity` and its `Posterior`. Gives xarray datasets by group name, for `Posterior.to_netcdf`.
Does not sample, judge or write.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from bayesid.errors import BayesidError
from bayesid.estimation.output_error import readings_batch
from bayesid.estimation.sampling.posterior import Posterior, stored_name
from bayesid.estimation.sampling.predictive_noise import sensor_noise, start_moves
from bayesid.estimation.sampling.trial_posterior import TrialDensity, width
from bayesid.model.channels import channel as channel_of
from bayesid.model.terms import TERMS, term

Array = np.ndarray
TERM_NAMES = frozenset(t.name for t in TERMS)
CHAINS = 4
LIKELIHOOD_DRAWS, PREDICTIVE_DRAWS = 250, 50  # per chain
MOST_INSTANTS = 200  # of a run in the predictive groups
RUNS_APART = (
    "log likelihood of whole runs: with initial states integrated out the channels of a run are not "
    "independent, so a run is the unit; arviz.loo on it leaves one run out"
)


def arviz_groups(density: TrialDensity, posterior: Posterior, seed: int = 0) -> dict[str, Any]:
    """Datasets by group, in SI units, of draws taken at random.

    `prior` and `log_likelihood` have 4 x 250 draws, the predictive groups 4 x 50, with sensor noise as the
    density has it and the uncertain start of every run, at up to 200 instants of it. Every variable has
    `units`. `log_likelihood` is left out where the likelihood is no sum over runs: noise integrated out, or
    adjusted to what `fit` finds.
    """
    rng = np.random.default_rng(seed)
    drawn = density.prior_draws(CHAINS * LIKELIHOOD_DRAWS, rng)
    few = CHAINS * PREDICTIVE_DRAWS
    found = {
        "prior": _dataset(
            {n: drawn[:, i] for i, n in enumerate(posterior.names)}, LIKELIHOOD_DRAWS, variable_units(density)
        ),
        "observed_data": _observed(density),
        "constant_data": _constant(density, posterior),
        "posterior_predictive": _predicted(density, posterior.subset(few, rng), rng, False),
        "prior_predictive": _predicted(density, drawn[:few], rng, True),
    }
    if density.adjustment is None and density.choice.noise != "marginal":
        chosen = posterior.subset(CHAINS * LIKELIHOOD_DRAWS, rng)
        found["log_likelihood"] = _likelihood(density, chosen)
    return found


def log_likelihood_of_runs(density: TrialDensity, v: Array) -> Array:
    """(b, runs) log likelihood of each run at (b, k) points in natural units; they add up to that of all."""
    rest = slice(density._initial.stop, None)
    at, first, columns = density.k, density.k, []
    for number, run in enumerate(density.problem.runs):
        m = len(run.initial)
        alone = replace(
            density,
            problem=replace(density.problem, runs=(run,)),
            z=np.r_[density.z[: density.k], density.z[first : first + m]],
            data=(density.data[number],),
        )
        own = v[:, at : at + m] if width(density._initial) else v[:, :0]
        at += own.shape[1]
        first += m
        columns.append(alone.log_likelihood(np.hstack([v[:, : density.k], own, v[:, rest]])))
    return np.stack(columns, axis=1)


def _likelihood(density: TrialDensity, v: Array) -> Any:
    import xarray

    values = log_likelihood_of_runs(density, v).reshape(CHAINS, -1, len(density.problem.runs))
    names = [r.name for r in density.problem.runs]
    coords = {"chain": np.arange(CHAINS), "draw": np.arange(values.shape[1]), "run": names}
    laid = {"runs": (("chain", "draw", "run"), values, {"units": "1", "long_name": "natural logarithm"})}
    return xarray.Dataset(laid, coords, {"description": RUNS_APART})


def variable_units(density: TrialDensity) -> dict[str, str]:
    """Unit of every unknown, in SI with radians and rpm: "kg/m", "m" of `sigma:x`, "1" of a pure number."""
    out = {}
    for name in density.unknowns.names:
        known, own = density.problem.model, name.rpartition(":")[2]
        if name.startswith("phi:"):
            unit = "1"
        elif name.startswith("sigma:"):
            unit = channel_of(own).unit
        elif name.endswith("(0)"):
            unit = _state_unit(own.removesuffix("(0)"))
        else:
            unit = known.parameter_unit(name) or (term(name).unit if name in TERM_NAMES else "1")
        out[name] = unit or "1"
    return out


def _state_unit(name: str) -> str:
    try:
        return str(channel_of(name).unit)
    except BayesidError:  # a state of an effect
        return "1"


def _dataset(values: dict[str, Array], draws: int, units: dict[str, str]) -> Any:
    import xarray

    coords = {"chain": np.arange(CHAINS), "draw": np.arange(draws)}
    laid = {
        stored_name(n): (("chain", "draw"), x.reshape(CHAINS, draws), {"units": units[n]})
        for n, x in values.items()
    }
    return xarray.Dataset(laid, coords)


def _instants(run: Any) -> Array:
    """Samples of a run at which something was read, evenly thinned."""
    read = np.flatnonzero(run.valid.any(axis=1))
    if read.size <= MOST_INSTANTS:
        return read
    return read[np.unique(np.linspace(0, read.size - 1, MOST_INSTANTS).astype(int))]


def _observed(density: TrialDensity) -> Any:
    import xarray

    variables: dict[str, Any] = {}
    coords: dict[str, Any] = {}
    for i, run in enumerate(density.problem.runs):
        at = _instants(run)
        coords[f"t_{i}"] = (f"t_{i}", run.plan.t[at], {"units": "s"})
        for j, channel in enumerate(run.channels):
            variables[stored_name(f"{run.name}:{channel}")] = (
                (f"t_{i}",), run.readings[at, j], {"units": channel_of(channel).unit},
            )  # fmt: skip
    return xarray.Dataset(variables, coords)


def _constant(density: TrialDensity, posterior: Posterior) -> Any:
    import xarray

    vehicle = density.problem.model.vehicle
    sigma = {
        f"{r.name}:{c}": s for r in density.problem.runs for c, s in zip(r.channels, r.sigma, strict=True)
    }
    known = {
        "reading": list(sigma), "parameter": list(posterior.names[: posterior.n_params]),
    }  # fmt: skip
    mixed = {"units": "SI, by name"}
    variables = {
        "stated_sigma": (("reading",), np.array(list(sigma.values())), mixed),
        "estimate": (("parameter",), density.z[: posterior.n_params], mixed),
    }
    about = {
        "vehicle": vehicle.name, "model": density.problem.model.digest, "density": density.digest,
        "dof": density.problem.model.dof,
    }  # fmt: skip
    return xarray.Dataset(variables, known, about)


def _predicted(density: TrialDensity, v: Array, rng: np.random.Generator, prior: bool) -> Any:
    """Readings at draws, float32: simulated, moved by the start where it is integrated out, plus noise."""
    import xarray

    asked = v[:, : density.k]
    if density.adjustment is not None and not prior:
        asked = density.adjustment.argument(asked)
    with np.errstate(all="ignore"):
        simulated = readings_batch(density.problem, asked, density._starts(v), density.threads)
    variables: dict[str, Any] = {}
    coords: dict[str, Any] = {"chain": np.arange(CHAINS), "draw": np.arange(len(v) // CHAINS)}
    first = density.k
    for i, (run, row, values) in enumerate(zip(density.problem.runs, density.data, simulated, strict=True)):
        at = _instants(run)
        coords[f"t_{i}"] = (f"t_{i}", run.plan.t[at], {"units": "s"})
        offset = density.problem.start[first : first + len(run.initial)]
        offset = offset - density.z[first : first + len(run.initial)]
        first += len(run.initial)
        moved = start_moves(density, v, run, row, values, offset, rng, prior)
        for j, channel in enumerate(run.channels):
            read = values[j][:, at]
            if moved is not None:
                read = read + moved @ row[j].slopes[at].T
            read = read + sensor_noise(density, v, run, j, row, rng)[:, at]
            variables[stored_name(f"{run.name}:{channel}")] = (
                ("chain", "draw", f"t_{i}"), read.reshape(CHAINS, -1, at.size).astype(np.float32),
                {"units": channel_of(channel).unit},
            )  # fmt: skip
    return xarray.Dataset(variables, coords)
