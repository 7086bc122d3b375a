"""Predict a manoeuvre with a diagnosed model, begun from a straight run.

Takes a `DiagnosedModel` and a manoeuvre, open or closed loop. Gives a frozen `Prediction`.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from bayesid.diagnosis.diagnosed_model import DiagnosedModel, WeightedHypothesis
from bayesid.equations.model import Model
from bayesid.errors import BayesidError
from bayesid.estimation.filter_error.noise_model import NoiseModel
from bayesid.estimation.run_data import Array
from bayesid.manoeuvres import Manoeuvre, OpenLoop, first_orders
from bayesid.model.notation import ORDER_TIMES
from bayesid.prediction.draws import centres_of, disturbed, estimate_of, require_enough, slow_errors
from bayesid.prediction.initial_state import coloured_noise
from bayesid.prediction.prediction import Prediction
from bayesid.simulation import TimePlan, carried_by_water, observe, plan_run, run_manoeuvre
from bayesid.simulation.balanced_speed import balanced_speed
from bayesid.simulation.shaft_speed import ordered_with_shaft_speed


def predict_manoeuvre(
    found: DiagnosedModel,
    name: str,
    manoeuvre: Manoeuvre,
    draws: int = 200,
    seed: int = 0,
    speed: float | None = None,
) -> Prediction:
    """Predict a manoeuvre begun from a straight run at its first shaft speeds, heading north, at the origin.

    Parameters
    ----------
    speed : approach speed [m/s]; by default each draw's own, at which its thrust and drag balance

    Raises
    ------
    ModelError
        if thrust and drag do not balance, or too many draws diverge
    """
    model, rng = found.model, np.random.default_rng(seed)
    channels = tuple(c for c in model.kernel.channels if not c.endswith("_water"))
    picked = [model.kernel.channels.index(c) for c in channels]
    manoeuvre, first = _begun(model, manoeuvre)
    kept: list[Array] = []
    ordered: list[Mapping[str, Array]] = []
    whole: list[int] = []
    number = -1
    t = np.asarray(manoeuvre.t)
    for h, pars in found.draw(rng, draws):
        speeds = np.full(len(pars), speed) if speed is not None else balanced_speed(model, pars, first)
        for par, u in zip(pars, speeds, strict=True):
            number += 1
            executed = _simulated(model, par, manoeuvre, float(u), h, picked, rng)
            if executed is None:
                continue
            t, obs, commands = executed
            obs[:, [j for j, c in enumerate(channels) if c in ("x", "y", "z")]] += _fresh_drift(
                h.noise_model, t, slow_errors(h.noise_model, channels), rng
            )
            kept.append(obs)
            whole.append(number)
            ordered.append(commands)
    require_enough(name, len(kept), draws)
    closed = not isinstance(manoeuvre, OpenLoop)
    orders = {name: np.array([one[name] for one in ordered]) for name in ordered[0]} if closed else None

    def undisturbed(par: Array, noise_model: NoiseModel) -> tuple[Array, Mapping[str, Array] | None] | None:
        made = _undisturbed_manoeuvre(model, par, manoeuvre, speed, first, picked, t.size)
        return None if made is None else (made[0], made[1] if closed else None)

    given, given_orders = undisturbed(model.nominal, found.hypotheses[0].noise_model) or (None, None)
    noise = np.array([found.noise.get(c, np.nan) for c in channels])
    commands = {n: v for n, v in ordered[0].items() if n != ORDER_TIMES}
    return Prediction(
        name, manoeuvre.name, t, channels, np.array(kept), commands, orders, 0.0,
        draws - len(kept), noise, given, given_orders, np.array(whole, dtype=np.int64),
        centres=centres_of(found, undisturbed), estimate=estimate_of(found, undisturbed),
    ).about_estimate()  # fmt: skip


def _undisturbed_manoeuvre(
    model: Model,
    par: Array,
    manoeuvre: Manoeuvre,
    speed: float | None,
    first: Mapping[str, float],
    picked: list[int],
    n: int,
) -> tuple[Array, Mapping[str, Array]] | None:
    """Readings (n, q) of one vehicle without disturbance, and its orders, (n,) each."""
    try:
        begin = speed if speed is not None else float(balanced_speed(model, par[None], first)[0])
        x0 = np.zeros(len(model.states))
        x0[model.states.index("u")] = begin
        track, commands = run_manoeuvre(model, par, manoeuvre, carried_by_water(model, par, x0), exact=True)
        obs = observe(model, par, plan_run(model, track.t, commands), track.states)[:, picked]
    except BayesidError:
        return None
    if len(obs) != n or not np.isfinite(obs).all():
        return None
    return obs, commands


def _simulated(
    model: Model,
    par: Array,
    manoeuvre: Manoeuvre,
    speed: float,
    h: WeightedHypothesis,
    picked: list[int],
    rng: np.random.Generator,
) -> tuple[Array, Array, Mapping[str, Array]] | None:
    x0 = np.zeros(len(model.states))
    x0[model.states.index("u")] = speed
    sd = np.array(h.noise_model.force)

    def disturb(plan: TimePlan) -> TimePlan:
        decay = np.exp(-np.diff(plan.t) / h.noise_model.force_tau)[:, None] * np.ones(sd.size)
        return disturbed(model, par, plan, coloured_noise(decay, sd, rng)[:-1])

    try:
        start = carried_by_water(model, par, x0)
        track, commands = run_manoeuvre(model, par, manoeuvre, start, disturb=disturb, exact=True)
        plan = plan_run(model, track.t, commands)
        obs = observe(model, par, plan, track.states)[:, picked]
    except BayesidError:
        return None
    return (track.t, obs, commands) if np.isfinite(obs).all() else None


def _fresh_drift(noise_model: NoiseModel, t: Array, slow: Array, rng: np.random.Generator) -> Array:
    """Slow position errors (n, nd) counted from the first sample, whose position is the origin."""
    decay = np.exp(-np.diff(t) / noise_model.drift_tau)[:, None] * np.ones(slow.size)
    drift = coloured_noise(decay, slow, rng)
    return drift - drift[0]


def _begun(model: Model, manoeuvre: Manoeuvre) -> tuple[Manoeuvre, dict[str, float]]:
    """The manoeuvre with a shaft speed, and the orders it begins with."""
    usual = model.vehicle.rpm_ref or 0.0
    manoeuvre = ordered_with_shaft_speed(manoeuvre, usual)
    return manoeuvre, {"n_cmd": usual, **first_orders(manoeuvre)}
