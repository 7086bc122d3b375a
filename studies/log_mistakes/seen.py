"""Can a mistake be seen at all: by the plan of the runs, the stated noise and the vehicle as stated.

Takes a clean trial and a model; gives yes or no before any log is judged.
Two mistakes need it, as what they do to the log has another account: a fast clock is as well the scale of
every instrument of a rate, an order logged as measured as well the angle of a fast fin. A mistake is seen
where the log odds it is expected to bring, its prior among them, exceed those from which on it is named.
Does not: use a reading, its noise or an outcome. Every other mistake counts as seen.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from bayesid.equations.model import Model
from bayesid.trials import Run, Trial
from bayesid.trials.kinematics.relations import BLOCKS, READINGS, relations
from bayesid.trials.mistakes.judge import NAMED_AT
from bayesid.trials.mistakes.orders import RATE_SD
from bayesid.trials.mistakes.sized import LARGEST_CLOCK, LEAST_CLOCK, scale_by_itself
from bayesid.trials.mistakes.table import COMMON, USUAL
from studies.log_mistakes.plant import FAST_FIN

NAMED = math.log(NAMED_AT / (1.0 - NAMED_AT))  # nats


def can_be_seen(name: str, clean: Trial, model: Model) -> bool:
    """Whether a mistake of the table can be seen in logs of this trial."""
    if name.startswith("clock"):
        error = float(name.split()[1]) / 100.0
        return clock_log_odds(clean, model, 1.0 / (1.0 + error) - 1.0) > NAMED
    if name == "order logged as measured":
        return faster_than_the_fin(clean, model)
    return True


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
