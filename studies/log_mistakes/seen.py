"""Can a mistake be seen at all: by the plan of the runs, the stated noise and the vehicle as stated.

Takes a clean trial and a model; gives yes or no before any log is judged.
Five need it, as what they do to the log has another account: a fast clock is as well the scale of every
instrument of a rate, an order logged as measured as well the angle of a fast fin, another vehicle is as well
wrong coefficients, a stated noise as well that of motion between two readings, a sample's delay as well the
latency of a sensor. The first two are seen where
the log odds they are expected to bring, their prior among them, exceed those from which on they are named;
another vehicle where the files differ by the factors that are declared, noise where readings follow each
other as closely as is declared, a sample's delay where a sample is as long as the shortest delay tried.
Does not: use a reading, its noise or an outcome. Every other mistake counts as seen.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from bayesid.diagnosis.input.wrong_vehicle import BOTH_SPEED, BOTH_TURN, FAR_SPEED, FAR_TURN
from bayesid.equations.model import Model
from bayesid.model.vehicles import self_propulsion_speed
from bayesid.simulation import plan_run, simulate
from bayesid.trials import Run, Trial
from bayesid.trials.kinematics.relations import BLOCKS, READINGS, relations
from bayesid.trials.mistakes.judge import NAMED_AT
from bayesid.trials.mistakes.orders import RATE_SD
from bayesid.trials.mistakes.sized import LARGEST_CLOCK, LEAST_CLOCK, SHORT_DELAYS, scale_by_itself
from bayesid.trials.mistakes.table import COMMON, USUAL
from bayesid.trials.noise_stated import FINER
from studies.log_mistakes.plant import FAST_FIN

SETTLED, ORDER = 8.0, math.radians(10.0)  # L/U and rudder of the turn by which two files are compared
NAMED = math.log(NAMED_AT / (1.0 - NAMED_AT))  # nats


def can_be_seen(name: str, clean: Trial, model: Model) -> bool:
    """Whether a mistake of the table can be seen in logs of this trial."""
    if name.startswith("clock"):
        error = float(name.split()[1]) / 100.0
        return clock_log_odds(clean, model, 1.0 / (1.0 + error) - 1.0) > NAMED
    if name == "order logged as measured":
        return faster_than_the_fin(clean, model)
    step = max(float(np.median(np.diff(run.t))) for run in clean.identify)
    travel = model.scales["L"] / model.scales["U"]
    if name.startswith("noise stated"):
        return step <= FINER * travel
    if name in ("psi late by a sample", "r late by a sample"):
        return round(SHORT_DELAYS[0] * travel / step) <= 1
    return True


def differ(own: Model, other: Model) -> bool:
    """Whether two vehicle files differ by factors from which on one is called another vehicle: in speed at
    the usual revolutions of the first, or in turn for one rudder angle from one speed."""
    rpm = own.vehicle.rpm_ref or 0.0
    speeds = [self_propulsion_speed(one.vehicle, rpm) for one in (own, other)]
    speed = abs(math.log(speeds[0] / speeds[1]))
    t = np.linspace(0.0, SETTLED * own.scales["L"] / speeds[0], 200)
    turns = []
    for one in (own, other):
        orders = {"delta_r_cmd": np.full(t.shape, ORDER), "n_cmd": np.full(t.shape, rpm)}
        start = np.zeros(len(one.states))
        start[one.states.index("u")] = speeds[0]
        states = simulate(one, one.nominal, plan_run(one, t, orders), start).states
        turns.append(float(np.ptp(states[:, one.states.index("psi")])))
    turn = abs(math.log(turns[0] / turns[1]))
    return speed > FAR_SPEED or turn > FAR_TURN or (speed > BOTH_SPEED and turn > BOTH_TURN)


def clock_log_odds(clean: Trial, model: Model, scale: float) -> float:
    """Expected log odds [nats] of one factor on the time against a scale of every instrument."""
    information: dict[str, float] = {}
    for run in clean.identify:
        for key, sd in scale_sd(run, clean.noise, model.scales["L"] / model.scales["U"]).items():
            information[key] = information.get(key, 0.0) + sd**-2
    if not {"track", "yaw"} <= set(information):
        return -math.inf
    sd = 1.0 / np.sqrt(np.array(list(information.values())))
    alike = float(np.sum(_normal(np.zeros(sd.size), sd))) + 0.5 * math.log(2 * math.pi / np.sum(sd**-2))
    alike -= math.log(2.0 * abs(scale) * math.log(LARGEST_CLOCK / LEAST_CLOCK))
    return COMMON + alike - sum(scale_by_itself(scale, float(s)) for s in sd)


def _normal(x: np.ndarray, sd: np.ndarray) -> np.ndarray:
    return -0.5 * (x / sd) ** 2 - np.log(sd * math.sqrt(2 * math.pi))


def scale_sd(run: Run, noise: Mapping[str, float], travel: float) -> dict[str, float]:
    """Relation -> Cramer-Rao bound of its scale, beside what sensors honestly do, at the stated noise."""
    out = {}
    for key, relation in relations(run, travel=travel).items():
        if "scale" not in relation.columns:
            continue
        place, rates = _NOISE[key]
        two = 2 if key == "track" else 1
        n = relation.response.size // two
        span = run.duration / max(2, min(BLOCKS, (run.n_samples - 1) // READINGS))
        step = run.duration / (run.n_samples - 1)
        variance = sum(noise.get(r, 0.0) ** 2 for r in rates) / max(1, len(rates)) * step * span
        block = (2 * noise[place] ** 2 + variance) * np.eye(n)
        block -= noise[place] ** 2 * (np.eye(n, k=1) + np.eye(n, k=-1))  # neighbours share a reading
        names = list(relation.columns)
        x = np.column_stack([relation.columns[k] for k in names])
        weighted = np.linalg.solve(np.kron(np.eye(two), block), x)
        prior = np.diag([0.0 if k == "scale" else relation.sd[k] ** -2 for k in names])
        out[key] = math.sqrt(
            np.linalg.inv(x.T @ weighted + prior)[names.index("scale"), names.index("scale")]
        )
    return out


_NOISE = {
    "track": ("x", ("u", "v")), "yaw": ("psi", ("r",)), "depth": ("z", ("u", "w")),
    "pitch": ("theta", ("q",)), "roll": ("phi", ("p",)),
}  # fmt: skip


def faster_than_the_fin(clean: Trial, model: Model) -> bool:
    """Whether orders jump from reading to reading faster than small vehicles' fins move, or by more than the
    fin of this vehicle moves at any rate that is as likely as the mistake."""
    jumps = []
    for run in clean.identify:
        jump = np.abs(np.diff(run.commands["delta_r_cmd"])) / np.diff(run.t)
        if jump.any():
            jumps.append(jump[jump > 0])
    fast = np.mean([np.median(one) > FAST_FIN for one in jumps]) >= 0.5
    least = model.vehicle.rates["delta_r"] * math.exp(RATE_SD * math.sqrt(2.0 * (NAMED - USUAL)))
    return bool(fast) or max(float(one.max()) for one in jumps) > least
