"""Delphin2: published steady speeds and yaw rates against its simulator. Which effects explain both together?

The numbers come with the vehicle file ([validation]). Between set point and shaft lies a published map,
rps = -0.0055060 s^2 + 0.4135859 s - 1.7894599, itself a fit and a suspect: it is declared here as an effect
of its own, beside a drag that grows with speed, not its square. Effects that need time, heading or a sensor
cannot show in a table of steady values and are not asked.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from bayesid.diagnosis.data.problem import DiagnosisProblem, build_problem, fit_with
from bayesid.diagnosis.hypotheses.candidate import weighted_hypothesis
from bayesid.equations.model import Model, build_model
from bayesid.errors import ModelError
from bayesid.model.effects import Effect, EffectParameter
from bayesid.model.effects.declare import InputStage
from bayesid.model.vehicles import CoefficientPrior, load_vehicle
from bayesid.progress import Progress
from bayesid.simulation import observe, plan_trial_run, simulate
from bayesid.trials import Environment, Run, Trial
from studies.sim_to_real_gap.kept_results import keep

# Accuracy of the published numbers, assumed: they carry three digits and no error.
SPEED_SD, RATE_SD = 0.01, np.radians(0.2)
PRIOR = 0.1  # of every coefficient, assumed
READINGS, DURATION, STEP = 10, 160.0, 5.0

MAP = Effect(
    name="setpoint_map",
    family="setpoint_map",
    port="input",
    where=("rpm",),
    parameters=(
        EffectParameter("scale", "-", 0.2, about="revolutions times (1 + scale)"),
        EffectParameter("offset", "rpm", 30.0, about="and plus offset"),
    ),
    stages=(InputStage("n", 20, end="x*(1+scale)+offset", mean="x*(1+scale)+offset"),),
    source="assumed: linear error of the map from set point to revolutions",
    magnitude="",
)
DRAG = Effect(
    name="linear_drag",
    family="linear_drag",
    port="force",
    where=("X",),
    parameters=(EffectParameter("share", "-", 0.5, about="of 6.5 kg/m times reference speed"),),
    force={"X": "-share*6.5*U_ref*u"},
    source="assumed: drag in proportion to speed, as trim and control surfaces of a slow vehicle add",
    magnitude="",
)
RACE, CUBIC = "rudder_propeller_interaction", "cubic_damping"
HYPOTHESES: tuple[tuple[str, ...], ...] = (
    (), ("thrust_loss",), ("hull_fouling",), ("setpoint_map",), ("linear_drag",), (RACE,),
    ("setpoint_map", RACE), ("linear_drag", RACE), ("setpoint_map", CUBIC), ("linear_drag", CUBIC),
    ("setpoint_map", RACE, CUBIC), ("linear_drag", RACE, CUBIC),
)  # fmt: skip


def revolutions(setpoint: float) -> float:
    """Shaft speed [rpm] of a set point by the published map."""
    return 60.0 * (-0.0055060 * setpoint**2 + 0.4135859 * setpoint - 1.7894599)


def delphin2(store: Path, progress: Progress) -> dict[str, Any]:
    """Refit every hypothesis to the 16 published numbers; what each says of them."""
    vehicle = load_vehicle("delphin2")
    vehicle = replace(vehicle, prior=CoefficientPrior(dict.fromkeys(vehicle.coef, PRIOR)))
    model = build_model(vehicle, 3, declared=(MAP, DRAG))
    trial = published(vehicle.validation)
    problem = build_problem(model, trial)
    rows = []
    for effects in progress.track(HYPOTHESES, "Delphin2 hypotheses"):
        name = "delphin2-" + ("+".join(effects) or "none")
        rows.append(keep(store, name, partial(refitted, problem, trial, effects)))
    nominal = steady_values(model, trial, model.nominal)
    measured = [float(next(iter(r.data.values()))[-1]) for r in trial.runs]
    names = [(r.name, r.manoeuvre) for r in trial.runs]
    return {"runs": names, "measured": measured, "nominal": nominal, "hypotheses": rows}


def refitted(problem: DiagnosisProblem, trial: Trial, effects: tuple[str, ...]) -> dict[str, Any]:
    """One hypothesis: evidence, parameters and the steady values it says, none where it diverges."""
    model = problem.model
    fitted = fit_with(problem, tuple(model.effects[n] for n in effects))
    k = len(problem.coefficients.names)
    pull = (fitted.values - fitted.free.mean)[:k] / fitted.free.sd[:k]
    worst = int(np.abs(pull).argmax())
    try:
        values = steady_values(model, trial, fitted.par)
    except ModelError:
        values = []
    return {
        "effects": effects,
        "log_evidence": weighted_hypothesis(problem, effects, fitted).log_evidence,
        "chi2": misfit(trial, values) if values else None,
        "converged": fitted.converged,
        "parameters": {
            n: (float(v), float(s))
            for n, v, s in zip(fitted.free.names[k:], fitted.values[k:], fitted.sd[k:], strict=True)
        },
        "largest_pull": [fitted.free.names[worst], float(pull[worst])],
        "values": values,
    }


def published(table: Any) -> Trial:
    """The published numbers as runs that end steady: 7 straight with a speed, 9 turning with a yaw rate."""
    runs = [
        steady_run(f"speed at {s}", s, 0.0, "u", u)
        for s, u in zip(table["setpoint"], table["speed"], strict=True)
    ]
    for s in (10, 16, 22):
        rates = table[f"yaw_rate_sp{s}"]
        runs += [
            steady_run(f"yaw rate at {s}, rudder {d}", s, -np.radians(d), "r", np.radians(rate))
            for d, rate in zip(table["rudder_deg"], rates, strict=True)
        ]
    share = np.sqrt(READINGS)  # one number, told so many times
    noise = {"u": SPEED_SD * share, "r": float(RATE_SD * share)}
    calm = Environment(force_rms=0.0, nav_drift=0.0)
    return Trial("Delphin2, published", Path("."), "delphin2", 3, tuple(runs), noise=noise, environment=calm)


def steady_run(name: str, setpoint: float, rudder: float, channel: str, value: float) -> Run:
    t = np.arange(0.0, DURATION + 0.5 * STEP, STEP)
    reading = np.full(t.size, np.nan)
    reading[-READINGS:] = value
    orders = {
        "n_cmd": np.full(t.size, revolutions(setpoint)),
        "delta_r_cmd": np.full(t.size, rudder),
    }
    return Run(name, "straight" if rudder == 0.0 else "turn", "identify", t, {channel: reading}, orders)


def steady_values(model: Model, trial: Trial, par: np.ndarray) -> list[float]:
    """What a model reads at the end of every run, begun straight at half the reference speed."""
    out = []
    for run in trial.runs:
        plan = plan_trial_run(model, run)
        x0 = np.zeros(len(model.states))
        x0[model.states.index("u")] = 0.5 * model.scales["U"]
        states = simulate(model, par, plan, x0, full=True).states
        channel = next(iter(run.data))
        reading = observe(model, par, plan, states, full=True)[-1, model.kernel.channels.index(channel)]
        out.append(float(reading))
    return out


def misfit(trial: Trial, values: Sequence[float]) -> float:
    """Mean squared error of the 16 numbers in units of their assumed accuracy."""
    total = []
    for run, value in zip(trial.runs, values, strict=True):
        channel = next(iter(run.data))
        sd = SPEED_SD if channel == "u" else RATE_SD
        total.append(((value - run.data[channel][-1]) / sd) ** 2)
    return float(np.mean(total))
