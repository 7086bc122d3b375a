"""A trial that was never sailed: manoeuvres executed by a model, read by its sensors, with white noise on
top.

Takes a `Model`, parameters in SI and manoeuvres. Gives a `Trial` like any logged one.
Does not write files, and adds no process noise.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

import numpy as np

from bayesid.equations.model import Model
from bayesid.errors import ModelError
from bayesid.manoeuvres import Manoeuvre, OpenLoop
from bayesid.model.vehicles.orders import own_orders
from bayesid.simulation.balanced_speed import balanced_speed
from bayesid.simulation.closed_loop import carried_by_water, run_manoeuvre, steady_start
from bayesid.simulation.sensors import observe
from bayesid.simulation.shaft_speed import ordered_with_shaft_speed
from bayesid.simulation.time_plan import plan_run
from bayesid.trials import Run, Trial


def virtual_run(
    model: Model,
    par: np.ndarray,
    manoeuvre: Manoeuvre,
    *,
    name: str,
    description: str = "",
    role: str = "identify",
    noise: Mapping[str, float] | None = None,
    rng: np.random.Generator | None = None,
) -> Run:
    """Run one manoeuvre from a straight run at its first orders and log every channel over ground.

    Parameters
    ----------
    par : (n,) array             parameter vector of the model, SI
    manoeuvre : open or closed loop; its own time steps become the samples. Without a shaft speed the
        vehicle's usual one is held
    description : free text on the manoeuvre; by default the manoeuvre's name
    noise : channel -> sigma of white noise, SI; channels not named are logged exactly
    rng : needed with noise

    Raises
    ------
    ModelError
        a noise channel the model does not give, a negative sigma, noise without a generator, or a vehicle
        that diverges
    """
    manoeuvre = ordered_with_shaft_speed(manoeuvre, model.vehicle.rpm_ref or 0.0)
    names = [channel for channel in model.kernel.channels if not channel.endswith("_water")]
    noise = dict(noise or {})
    unknown = [channel for channel in noise if channel not in names]
    if unknown:
        more = set(unknown) & {"z", "phi", "theta", "w", "p", "q"} and model.dof == 3
        raise ModelError(
            f"no channel {', '.join(unknown)} to put noise on; there are {', '.join(names)}"
            + (" (in the plane; six degrees of freedom: --dof 6)" if more else "")
        )
    wrong = [f"{channel} = {sigma:g}" for channel, sigma in noise.items() if not 0 <= sigma < math.inf]
    if wrong:
        raise ModelError(f"noise {', '.join(wrong)}: a standard deviation is finite and not negative")
    if any(noise.values()) and rng is None:
        raise ModelError("noise needs a random generator")
    start = carried_by_water(model, par, _start(model, manoeuvre))
    track, commands = run_manoeuvre(model, par, manoeuvre, start)
    plan = plan_run(model, track.t, commands)
    readings = observe(model, par, plan, track.states)
    data = {channel: readings[:, model.kernel.channels.index(channel)].copy() for channel in names}
    if rng is not None:
        for channel in names:  # in the order of the model: a seed means the same whatever the order given
            data[channel] += noise.get(channel, 0.0) * rng.standard_normal(track.t.size)
    orders = own_orders(model.vehicle, commands)
    return Run(name, description or manoeuvre.name, role, track.t, data, orders)


def virtual_trial(
    model: Model,
    par: np.ndarray,
    manoeuvres: Mapping[str, Manoeuvre],
    *,
    title: str,
    vehicle_ref: str,
    noise: Mapping[str, float] | None = None,
    rng: np.random.Generator | None = None,
    descriptions: Mapping[str, str] | None = None,
    holdout: tuple[str, ...] = (),
) -> Trial:
    """Run several manoeuvres, each from its own straight run; see `virtual_run`.

    Parameters
    ----------
    manoeuvres : run name -> manoeuvre
    vehicle_ref : what the trial says its vehicle is: a built-in name or a file. With other parameters than
        the vehicle's the trial holds a gap that was planted
    descriptions : run name -> free text
    holdout : names of runs kept for judging
    """
    runs = []
    for name, manoeuvre in manoeuvres.items():
        role = "holdout" if name in holdout else "identify"
        text = (descriptions or {}).get(name, "")
        run = virtual_run(model, par, manoeuvre, name=name, description=text, role=role, noise=noise, rng=rng)
        runs.append(run)
    stated = {channel: sigma for channel, sigma in (noise or {}).items() if sigma > 0}
    return Trial(title, Path("."), vehicle_ref, model.dof, tuple(runs), noise=stated)


def _start(model: Model, manoeuvre: Manoeuvre) -> np.ndarray:
    """State straight ahead at the speed of the first orders; at rest where theirs does not balance."""
    named = {f"{s}_cmd" for thruster in model.vehicle.thrusters for s in thruster.signals}
    if not isinstance(manoeuvre, OpenLoop) or not named & set(manoeuvre.commands):
        return steady_start(model, _first_shaft_speed(manoeuvre))
    first = {name: float(values[0]) for name, values in manoeuvre.commands.items()}
    out = steady_start(model, 0.0)
    with suppress(ModelError):
        out[model.states.index("u")] = balanced_speed(model, model.nominal, first)[0]
    return out


def _first_shaft_speed(manoeuvre: Manoeuvre) -> float | None:
    if isinstance(manoeuvre, OpenLoop):
        return float(manoeuvre.commands["n_cmd"][0])
    return manoeuvre.start.get("n_cmd")
