"""What a vehicle says of a log: speed at its revolutions, how much it turns for its fins, how it slides then.

Takes a model and a run. Gives log likelihoods under wide densities: a simulator that is to be judged may be
wrong by tens of percent, not by a sign or a unit.
Does not: know mistakes.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from bayesid.diagnosis.input.pieces import SLIDE, change_between, line_at, speed_of, start_of
from bayesid.diagnosis.input.single_fins import SINGLE, fins_density, mistakes_of_fins
from bayesid.diagnosis.input.steering import RUDDER, mistakes_of_steering, pushes_along, with_rudder
from bayesid.equations.model import Model
from bayesid.errors import BayesidError
from bayesid.model.vehicles import self_propulsion_speed
from bayesid.model.vehicles.orders import missing_actuators
from bayesid.simulation import plan_run, plan_trial_run, simulate
from bayesid.trials import Run
from bayesid.trials.mistakes.signs import sign_evidence
from bayesid.trials.mistakes.table import Mistake

Array = np.ndarray

SPEED_SD = 0.2  # of the logarithm of speed over self-propulsion speed
GAIN_SD = 0.4  # of the logarithm of turn over simulated turn
TAIL = 2.0  # standard deviations from which on the log density falls linearly
WRONG_SIDE = -12.0  # nats of a vehicle that turns away from where it is steered
SURE_SIDE = 3.0  # standard deviations of a gain that is surely on one side
PIECES, PIECE = 12, 4.0  # of a run; length of a piece in L/U
LAST = 1 / 3  # of a run, its end
# what the behaviour of the vehicle tells -> channels that matter to it
NEEDS = {
    "speed": frozenset({"t", "u", "u_water", "x", "y", "n", "n_cmd"}),
    "turn": frozenset(
        {"t", "u", "v", "r", "psi", "x", "y", "n", "n_cmd", "delta_r", "delta_r_cmd", "u_water"}
    ),
    "drift": frozenset({"u", "u_water", "v", "v_water", "r", "psi", "delta_r", "delta_r_cmd"}),
    "pitch": frozenset({"t", "u", "w", "q", "theta", "delta_s", "delta_s_cmd", "x", "y"}),
    "heave": frozenset({"u", "u_water", "w", "w_water", "q", "theta", "delta_s", "delta_s_cmd"}),
}
# fins -> the angle they turn, what is told of turn and slide
FINS = {("delta_r",): ("psi", "turn", "drift"), ("delta_s",): ("theta", "pitch", "heave")}


@dataclass(frozen=True, eq=False)
class VehicleBehaviour:
    """Log likelihood of a run by a vehicle.

    Attributes
    ----------
    weight : of one run: runs of one trial share the vehicle's errors and count as two together
    seen : whether a turn has to be seen: a simulator in question that scatters must not be excused by it
    needs : what is told -> channels that matter to it
    steering : what turns it; named fins or angles of thrusts where it has no `delta_r`
    single : named fins asked one by one, as they turn, pitch and roll it together
    """

    model: Model
    weight: float = 1.0
    seen: bool = False
    needs: Mapping[str, frozenset[str]] = field(default_factory=lambda: dict(NEEDS))
    steering: tuple[str, ...] = RUDDER
    single: tuple[str, ...] = ()

    @property
    def mistakes(self) -> tuple[Mistake, ...]:
        """Mistakes of channels that only this vehicle has: named fins or angles of
        thrusts with the opposite sign, fins exchanged."""
        of_fins = mistakes_of_fins(self.model) if self.single else ()
        return of_fins if self.steering == RUDDER else (*mistakes_of_steering(self.steering), *of_fins)

    def __call__(self, run: Run) -> dict[str, float]:
        """What is told -> log likelihood [nats]."""
        out = {}
        density = _seen_density if self.seen else _gain_density
        with np.errstate(all="ignore"):
            speed = speed_ratio(self.model, run)
            if speed is not None:
                out["speed"] = self.weight * _log_density(math.log(speed) / SPEED_SD)
            for fins, (angle, turn, slide) in FINS.items():
                try:
                    steered = self.steering if angle == "psi" else fins
                    gains = fin_gains(self.model, run, steered, angle)
                except BayesidError:
                    continue
                for name, gain in zip((turn, slide), gains, strict=True):
                    if gain is not None:
                        out[name] = self.weight * density(*gain)
                if gains[0] is not None and gains[1] is not None and _turned(*gains[0]):
                    # steered the other way round: how it slides tells nothing of the sign of v or w
                    out[slide] = min(out[slide], self.weight * WRONG_SIDE)
            if self.single:
                # not weighted: how much a fin pushes is an error all runs share, to which side is none
                told = fins_density(self.model, run, self.single)
                out |= {} if told is None else {SINGLE: told}
            if self.steering != RUDDER:  # the sign of that one the channels tell by themselves
                signs = sign_evidence(with_rudder(self.model, run, self.steering), ("rudder",))
                out |= {"steering": signs["rudder"]} if "rudder" in signs else {}
                along = pushes_along(self.model, run)
                out |= {} if along is None else {"thrust": along}
                # of a reading that contradicts its order the turn says which is right
                for fin in self.steering:
                    if fin in run.measured_inputs and f"{fin}_cmd" in run.commands:
                        alone = sign_evidence(with_rudder(self.model, run, (fin,)), ("rudder",))
                        out |= {turn_after(fin): alone["rudder"]} if "rudder" in alone else {}
        return {k: v for k, v in out.items() if math.isfinite(v)}


def turn_after(fin: str) -> str:
    """What the turn tells of one named fin alone, as a key of what is told."""
    return f"turn after {fin}"


def _log_density(z: float) -> float:
    z = abs(z)
    return -0.5 * z * z if z < TAIL else -TAIL * z + 0.5 * TAIL * TAIL


def _turned(gain: float, sd: float) -> bool:
    """Whether a gain surely has the wrong sign."""
    return gain < -SURE_SIDE * sd


def _gain_density(gain: float, sd: float) -> float:
    """Log density of a gain that should be one, up to tens of percent."""
    if _turned(gain, sd):
        return WRONG_SIDE + _log_density(math.log(-gain) / GAIN_SD)
    if gain < SURE_SIDE * sd:  # no turn to be seen: the gain is at most what its deviation allows
        return _log_density(min(0.0, math.log(max(SURE_SIDE * sd, 1e-6))) / GAIN_SD)
    return _log_density(math.log(gain) / math.hypot(GAIN_SD, sd / gain))


def _seen_density(gain: float, sd: float) -> float:
    """Log density of such a gain over its largest one where it is exactly known."""
    if abs(gain) > SURE_SIDE * sd:
        spread = math.hypot(GAIN_SD, sd / gain)
        return _gain_density(gain, sd) - math.log(spread / GAIN_SD)
    spread = math.hypot(GAIN_SD, sd)
    return _log_density((gain - 1.0) / spread) - math.log(spread / GAIN_SD)


def speed_ratio(model: Model, run: Run) -> float | None:
    """Speed reached over self-propulsion speed at the usual revolutions of the run.

    None where unknown, and of a vehicle without a propeller of its own, whose thrusters make its speed.
    """
    n, speed = run.input("n"), speed_of(run)
    if n is None or speed is None or "n" in missing_actuators(model.vehicle):
        return None
    usual = float(np.median(n))
    if not usual > 0:
        return None
    at = np.isfinite(speed) & (np.abs(n - usual) < 0.05 * usual)
    if at.sum() < 5:
        return None
    try:
        steady = self_propulsion_speed(model.vehicle, usual)
    except BayesidError:
        return None
    reached = float(np.percentile(speed[at], 80))
    return reached / steady if reached > 0 and steady > 0 else None


def speed_beside_simulation(model: Model, run: Run) -> float | None:
    """Speed over self-propulsion speed or over that of a simulated run at its end, whichever is nearer to 1.

    A run that begins at rest, or turns hard, does not reach the first. 1 where one is above and the other
    below; None as in `speed_ratio`.
    """
    steady, speed = speed_ratio(model, run), speed_of(run)
    if steady is None or speed is None:
        return steady
    simulated = _simulated_speed(model, run, speed)
    if simulated is None:
        return steady
    end = run.t >= run.t[-1] - LAST * run.duration
    if not np.isfinite(speed[end]).any():
        return steady
    behind = float(np.nanmedian(speed[end])) / float(np.median(simulated[end]))
    if not behind > 0 or (behind - 1.0) * (steady - 1.0) < 0:
        return steady if not behind > 0 else 1.0
    return min(steady, behind, key=lambda ratio: abs(math.log(ratio)))


def _simulated_speed(model: Model, run: Run, speed: Array) -> Array | None:
    """(n,) speed ahead of a simulation from the first readings; None where it diverges."""
    travel = min(model.scales["L"] / model.scales["U"], 0.2 * run.duration)
    start = start_of(model, run, speed, "psi", float(run.t[0]), travel)
    if start is None:
        return None
    try:
        plan = plan_trial_run(model, run)
        return simulate(model, model.nominal, plan, start).states[:, model.states.index("u")]
    except BayesidError:
        return None


Gain = tuple[float, float] | None


def fin_gains(model: Model, run: Run, fins: Sequence[str], angle: str) -> tuple[Gain, Gain]:
    """Turn that fins give over the turn they give in the simulator, and sway (heave) over the simulated one,
    over pieces.

    Returns
    -------
    tuple                      (gain, sd) each; None where the run does not say, and of a fin there is not
    """
    orders = [order for fin in fins if (order := run.input(fin)) is not None]
    speed = speed_of(run)
    if speed is None or angle not in run.data or not any(np.ptp(order) > 0.0 for order in orders):
        return None, None
    if missing_actuators(model.vehicle) & set(fins):
        return None, None
    usual = float(np.nanmedian(speed))
    if angle not in model.states or not usual > 0:
        return None, None
    travel = model.scales["L"] / usual
    length = max(PIECE * travel, 3.0 * float(np.median(np.diff(run.t))))
    if run.duration < 3 * length:
        return None, None
    starts = np.linspace(run.t[0] + travel, run.t[-1] - length, min(PIECES, int(run.duration / length)))
    rows = [row for t0 in starts if (row := _piece(model, run, speed, fins, angle, t0, length, travel))]
    if len(rows) < 4:
        return None, None
    turned, steered, slid, simulated = np.array(rows).T
    return _slope(turned, steered), _slope(slid, simulated)


def _slope(logged: Array, simulated: Array) -> Gain:
    """Logged over simulated beside a constant, and its sd."""
    if not (np.isfinite(logged).all() and np.ptp(simulated) > 0):
        return None
    x = simulated - simulated.mean()
    power = float(x @ x)
    gain = float(x @ logged) / power
    left = logged - logged.mean() - gain * x
    return gain, math.sqrt(max(float(left @ left) / max(1, logged.size - 2) / power, 1e-12))


def _piece(
    model: Model,
    run: Run,
    speed: Array,
    fins: Sequence[str],
    angle: str,
    t0: float,
    length: float,
    travel: float,
) -> tuple[float, float, float, float] | None:
    """Turn beyond what a free start gives and last sway or heave, logged and simulated; None if not read."""
    inside = (run.t >= t0) & (run.t <= t0 + length)
    if inside.sum() < 3:
        return None
    t = run.t[inside]
    turned = change_between(run.t, run.data[angle], t[0], t[-1], travel)
    start = start_of(model, run, speed, angle, t[0], travel)
    if turned is None or start is None:
        return None
    *groups, wind = (
        {k: v[inside] for k, v in group.items()}
        for group in (run.commands, run.measured_inputs, run.exogenous)
    )
    names = {name for fin in fins for name in (f"{fin}_cmd", fin)}
    free = [{k: np.zeros(v.shape) if k in names else v for k, v in group.items()} for group in groups]
    j, slide = model.states.index(angle), SLIDE[angle][1]
    ends, last = [], []
    for commands, measured in (groups, free):
        plan = plan_run(model, t, commands, measured, wind, acts_before=run.acts_before)
        states = simulate(model, model.nominal, plan, start).states
        ends.append(states[-1, j] - states[0, j])
        last.append(states[-1, model.states.index(slide)])
    if not np.isfinite(ends).all():
        return None
    side = next((run.data[k] for k in (slide, f"{slide}_water") if k in run.data), None)
    slid = None if side is None else line_at(run.t, side, t[-1], travel)
    return turned - ends[1], ends[0] - ends[1], math.nan if slid is None else slid[0], last[0]
