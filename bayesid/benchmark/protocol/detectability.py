"""How plainly a planted cause shows in a campaign: noncentrality, share the coefficients hide, nearest rival.

Takes a `plant.Campaign`, whose truth is known. Gives a frozen `Detectability`. Does not read noisy logs or
verdicts: the true vehicle runs its orders without noise, and what the nominal structure with the true
coefficients leaves of that track is weighed with the true noise and the true environment.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from bayesid.benchmark.plant import Campaign, ExecutedRun, Planted, execute_campaign, still, true_response
from bayesid.benchmark.protocol.cause_families import family_of
from bayesid.diagnosis.data.problem import DiagnosisProblem
from bayesid.diagnosis.hypotheses.sensitivity_bank import SensitivityBank, build_bank, testable
from bayesid.equations.model import Model, build_model
from bayesid.estimation.filter_error.evidence import NormalEquations
from bayesid.estimation.filter_error.linearise import Trajectory, first_trajectory
from bayesid.estimation.filter_error.noise_identification import NoiseIdentification, no_process_noise
from bayesid.estimation.filter_error.noise_model import NoiseModel
from bayesid.estimation.filter_error.read_run import filter_error_run
from bayesid.estimation.parameters import coefficient_prior
from bayesid.estimation.run_data import RunData
from bayesid.model.notation import POSE, VELOCITY
from bayesid.model.vehicles import CoefficientPrior
from bayesid.simulation import with_own_states
from bayesid.trials import Run

PLANT_AXES = ("X", "Y", "N", "Z", "M")  # order of the plant's process forces


@dataclass(frozen=True)
class Detectability:
    """Of one planted cause.

    Attributes
    ----------
    name : of the cause
    noncentrality : D, squared distance from the nominal structure in noise units after the coefficients took
        what their prior lets them
    absorbed : share the coefficients take
    margin : expected log evidence over the best explanation of another family (nan: not weighed)
    rival : that explanation
    """

    name: str
    noncentrality: float
    absorbed: float
    margin: float
    rival: str


def from_json(stored: Mapping[str, Any]) -> Detectability:
    """A detectability that has been through JSON, where nan is null."""
    plain: dict[str, Any] = {k: math.nan if v is None else v for k, v in stored.items()}
    return Detectability(**plain)


def detectability(campaign: Campaign, rivals: bool = True) -> tuple[Detectability, ...]:
    """One entry per planted cause, each as if it were there alone; none for a campaign without.

    Parameters
    ----------
    rivals : also weigh every effect of the catalogue against a cause that is alone and has a name there

    Raises
    ------
    ModelError                 the vehicle cannot be executed with one of its causes alone
    """
    out = []
    for planted in campaign.planted:
        wrong = campaign.coefficient_error if planted.name == "coefficient_error" else {}
        weigh = rivals and len(campaign.planted) == 1 and planted.kind != "outside"
        out.append(_of(replace(campaign, planted=(planted,), coefficient_error=dict(wrong)), planted, weigh))
    return tuple(out)


def _of(campaign: Campaign, planted: Planted, rivals: bool) -> Detectability:
    problem = true_problem(campaign)
    model = problem.model
    effects = [e for e in model.kernel.effects if testable(problem, e)] if rivals else []
    bank = build_bank(problem, problem.path, [problem.environment.noise_model], effects)
    total, n = bank.total(0), bank.n_coef
    coefficients = np.arange(n)
    distance = total.ee
    left = distance - _taken(total, coefficients)
    absorbed = 1.0 - left / distance if distance > 0 else 1.0
    margin, rival = _nearest(bank, planted.name) if rivals else (float("nan"), "")
    return Detectability(planted.name, max(left, 0.0), absorbed, margin, rival)


def true_problem(campaign: Campaign) -> DiagnosisProblem:
    """Noise-free readings of the identify runs, the nominal structure with the true coefficients, and the
    true noise and environment."""
    calm = still(campaign)
    execution, disturbance = execute_campaign(calm), campaign.disturbance
    # a coefficient that is the planted cause stays at its nominal value: its error is what is to be seen
    true = {n: campaign.vehicle.coef[n] if n in campaign.coefficient_error else v
            for n, v in campaign.coef.items()}  # fmt: skip
    prior = CoefficientPrior(dict.fromkeys(true, campaign.prior_sd))
    model = build_model(replace(campaign.vehicle, coef=true, prior=prior), campaign.dof)
    channels = tuple(c for c in model.kernel.channels if c in campaign.sigma)
    logs: list[RunData] = []
    points: list[Trajectory] = []
    for executed in execution.runs:
        if executed.plan.role != "identify":
            continue
        clean = true_response(calm, executed.plan.name)
        data = {c: clean[c] for c in channels}
        run = Run(
            executed.plan.name, executed.plan.manoeuvre, "identify", executed.t, data, executed.commands
        )
        logs.append(filter_error_run(model, run, campaign.sigma, channels))
        points.append(_true_path(model, logs[-1], executed))
    noise_model = no_process_noise(model)
    if any(disturbance.amplitude):
        level = dict(zip(PLANT_AXES, np.array(disturbance.amplitude) * _typical(campaign), strict=True))
        axes = [n[-1] for n in model.kernel.exogenous if n.startswith("force_")]
        force = tuple(float(level.get(a, 0.0)) for a in axes)
        noise_model = NoiseModel(force, disturbance.tau, disturbance.drift, disturbance.drift_tau, depth=0.0)
    return DiagnosisProblem(
        model, tuple(logs), coefficient_prior(model), NoiseIdentification(noise_model, "stated", 0.0),
        channels, (), (),
        tuple(points), 0.0,
    )  # fmt: skip


def _true_path(model: Model, log: RunData, executed: ExecutedRun) -> Trajectory:
    """Where to linearise: the true track, from which the nominal structure departs in every interval."""
    true = executed.track.states[:: executed.track.parts]
    at = dict(zip(POSE + VELOCITY, true[:, :12].T, strict=True))
    states = with_own_states(model, np.column_stack([at[name] for name in model.states]))
    return replace(first_trajectory(model, log, model.nominal), states=states)


def _typical(campaign: Campaign) -> np.ndarray:
    return execute_campaign(campaign).typical


def _taken(g: NormalEquations, columns: np.ndarray) -> float:
    """Squared distance that columns with unit-normal unknowns explain."""
    se = g.se[columns]
    return float(se @ np.linalg.solve(np.eye(columns.size) + g.ss[np.ix_(columns, columns)], se))


def expected_gain(bank: SensitivityBank, columns: np.ndarray, level: int = 0) -> float:
    """Mean log evidence over the coefficients alone when the bank's residual is the mean of the data.

    Design note A6: noise adds 1/2 tr((C + I)^-1 C), the prior volume costs 1/2 ln|I + C|; C is the
    information on the columns after the coefficients took their part.
    """
    g, n = bank.total(level), bank.n_coef
    base = np.arange(n)
    inner = np.linalg.solve(np.eye(n) + g.ss[:n, :n], g.ss[:n, columns])
    c = g.ss[np.ix_(columns, columns)] - g.ss[columns, :n] @ inner
    eye = np.eye(columns.size)
    mean = 0.5 * (_taken(g, np.concatenate([base, columns])) - _taken(g, base))
    noise = 0.5 * float(np.trace(np.linalg.solve(c + eye, c)))
    return mean + noise - 0.5 * float(np.linalg.slogdet(eye + c)[1])


def widened_gain(bank: SensitivityBank, j: int, factor: float = 10.0, level: int = 0) -> float:
    """Mean log evidence of one coefficient with a wider prior over the stated one."""
    g, n = bank.total(level).pick(np.arange(bank.n_coef)), bank.n_coef
    out = []
    for scale in (factor, 1.0):
        unit = np.ones(n)
        unit[j] = scale
        wide = NormalEquations(g.ss * np.outer(unit, unit), g.se * unit, g.ee, g.logdet, g.used)
        h = np.eye(n) + wide.ss
        noise = float(np.trace(np.linalg.solve(h, wide.ss)))
        out.append(0.5 * (_taken(wide, np.arange(n)) + noise - float(np.linalg.slogdet(h)[1])))
    return out[0] - out[1]


def _nearest(bank: SensitivityBank, name: str) -> tuple[float, str]:
    """Margin of the named cause over the best explanation of another family, and which that is."""
    gains = {n: max(expected_gain(bank, v) for v in c.variants) for n, c in bank.effects.items()}
    gains["coefficient_error"] = max(widened_gain(bank, j) for j in range(bank.n_coef))
    gains["none"] = 0.0
    family = family_of(name)
    others = {n: g for n, g in gains.items() if family_of(n) != family}
    rival = max(others, key=lambda n: others[n])
    own = max((g for n, g in gains.items() if family_of(n) == family), default=float("nan"))
    return float(own - others[rival]), rival
