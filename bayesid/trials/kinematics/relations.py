"""The relations of rigid-body kinematics between the channels of one run, as regressions over blocks of time.

Takes a `Run`. The columns of each are what sensors honestly do: scale, misalignment, compass deviation, lever
arm, latency, bias. Their prior deviations follow the catalogue of effects; where a length is needed, it is
the speed times the time of turning, as no vehicle is known here.
Does not: weigh (`evidence`), or know what is a mistake.
"""

from __future__ import annotations

import math
from collections.abc import Container, Mapping

import numpy as np

from bayesid.trials.kinematics.blocks import Blocks, joined, middle
from bayesid.trials.kinematics.evidence import Relation
from bayesid.trials.trial import Floats, Run

BLOCKS = 40  # long enough to beat position noise, short enough to see turns
FEWEST = 5  # blocks, below which nothing is said
READINGS = 2  # in a block
# Prior standard deviations: of gain and angle, of latency in L/U, of lever arms in L, of a rate over rate, of
# drifts over speed
SCALE, ANGLE, DEVIATION, LATENCY, LEVER, RATE_BIAS, DRIFT, CURRENT = 0.1, 0.1, 0.06, 0.6, 0.5, 0.03, 0.02, 0.3
PATH = 0.3  # angle of attack over pitch
SIDEWAYS = 0.3  # drift angle, or sway over surge, at a rate of one over the time of turning
MOST_NOISE = 0.3  # of a motion, that the rates of other axes may bring
LENGTHS = 5.0  # lengths travelled in the time of turning, where no length is known

NEEDS = {
    "track": ("x", "y", "psi", "u", "v", "w", "phi", "theta", "u_water", "v_water", "t"),
    "course": ("x", "y", "psi", "t"),
    "yaw": ("psi", "r", "q", "phi", "theta", "t"),
    "depth": ("z", "x", "y", "u", "v", "w", "phi", "theta", "u_water", "v_water", "w_water", "t"),
    "pitch": ("theta", "q", "r", "phi", "t"),
    "roll": ("phi", "p", "q", "r", "theta", "t"),
}  # fmt: skip


class Joined:
    """Channels of a run, joined across empty cells; what is not logged is None."""

    def __init__(self, run: Run, travel: float | None = None) -> None:
        self.t, self._travel = run.t, travel
        self._run, self._kept = run, dict[str, tuple[Floats, np.ndarray]]()
        self._finite = {name: np.isfinite(values) for name, values in run.data.items()}
        self._there = {name for name, finite in self._finite.items() if np.count_nonzero(finite) >= 2}

    def travel_time(self, period: float) -> float:
        """Time to travel a length [s]."""
        return period / LENGTHS if self._travel is None else min(self._travel, period)

    def has(self, *names: str) -> bool:
        """Whether all are logged with at least two readings."""
        return self._there.issuperset(names)

    def __getitem__(self, name: str) -> Floats:
        return self._of(name)[0]

    def known(self, *names: str) -> np.ndarray:
        """Where all are known."""
        return np.logical_and.reduce([self._of(name)[1] for name in names])

    def read(self, *names: str) -> np.ndarray:
        """Where all were read."""
        return np.logical_and.reduce([self._finite[name] for name in names])

    def _of(self, name: str) -> tuple[Floats, np.ndarray]:
        if name not in self._kept:
            self._kept[name] = joined(self.t, self._run.data[name])
        return self._kept[name]


def relations(
    run: Run,
    logged: Mapping[str, float] | None = None,
    travel: float | None = None,
    only: Container[str] | None = None,
) -> dict[str, Relation]:
    """Every relation the run's channels allow.

    Parameters
    ----------
    travel : time in which the vehicle travels its length [s]; where it is not known, a fifth of the time of
        turning. With a length instead, one unit mistaken for another would be paid for in every run
    only : names of relations; all by default
    logged : channel -> factor a correction put on it, for the density of the readings as logged
    """
    with np.errstate(all="ignore"):
        asked = [one for one, names in _ALL.items() if only is None or any(name in only for name in names)]
        series = Joined(run, travel)
        found = [one(series, logged or {}) for one in asked]
    return {r.name: r for r in found if r is not None and r.size > 0 and np.isfinite(r.response).all()}


def turning_time(rate: Floats, span: float) -> float:
    """Time of turning [s]: one over the rms yaw rate, at most the duration of the run."""
    rms = float(np.sqrt(np.mean(np.square(rate)))) if rate.size else 0.0
    return min(1.0 / rms, span) if rms > 0 else span


def _track(s: Joined, logged: Mapping[str, float]) -> Relation | None:
    if not s.has("x", "y", "psi"):
        return None
    if s.has("u"):
        water, along = False, "u"
    elif s.has("u_water"):
        water, along = True, "u_water"
    else:
        return _course(s)
    side = "v_water" if water else "v"
    names = ["x", "y", "psi", along] + ([side] if s.has(side) else [])
    blocks = Blocks(s.t, s.read("x", "y"), s.known(*names), BLOCKS, READINGS)
    if blocks.span.size < FEWEST:
        return None
    velocity, psi = level_velocity(s, along, side), s["psi"]
    turned = velocity * np.exp(1j * psi)
    moved = blocks.change(s["x"]) + 1j * blocks.change(s["y"])
    swung = np.gradient(psi, s.t)
    parts = np.column_stack((turned, turned * swung, turned * np.sin(psi), turned * np.cos(psi)))
    reckoned, swept, east_west, north_south = blocks.integral(parts).T
    turning = blocks.change(psi)
    period = turning_time(turning / blocks.span, float(s.t[-1] - s.t[0]))
    speed = float(np.sqrt(np.mean(np.abs(reckoned / blocks.span) ** 2)))
    if not speed > 0:
        return None
    travel = s.travel_time(period)
    by_turn = 1j * swept
    head = blocks.change(np.exp(1j * psi))
    complexes = {
        "scale": (reckoned, SCALE),
        "angle": (1j * reckoned, ANGLE),
        "lever_x": (head, LEVER * speed * travel),
        "lever_y": (1j * head, LEVER * speed * travel),
        "late_position": (-blocks.change(turned), LATENCY * travel),
        "late_velocity": (blocks.change(turned) - by_turn, LATENCY * travel),
        "deviation_sin": (1j * east_west, DEVIATION),
        "deviation_cos": (1j * north_south, DEVIATION),
        "drift_north": (blocks.span + 0j, (CURRENT if water else DRIFT) * speed),
        "drift_east": (1j * blocks.span, (CURRENT if water else DRIFT) * speed),
    }
    if not s.has(side):
        complexes["sway"] = (1j * swept * period, SIDEWAYS)
        complexes["sway_bias"] = (1j * reckoned, ANGLE)
    columns = {k: _stacked(c) for k, (c, _) in complexes.items()}
    sd = {k: v for k, (_, v) in complexes.items()}
    jacobian = sum(moved.size * math.log(abs(logged.get(k, 1.0))) for k in ("x", "y"))
    size = float(np.sqrt(0.5 * np.mean(np.abs(moved) ** 2)))
    return Relation("track", _stacked(moved - reckoned), columns, sd, size, jacobian)


def _course(s: Joined) -> Relation | None:
    """Direction of the track against heading, where no velocity is logged."""
    blocks = Blocks(s.t, s.read("x", "y"), s.known("x", "y", "psi"), BLOCKS, READINGS)
    if blocks.span.size < FEWEST:
        return None
    psi = s["psi"]
    moved = blocks.change(s["x"]) + 1j * blocks.change(s["y"])
    head = blocks.integral(np.exp(1j * psi))
    far = (np.abs(moved) > 0.3 * np.median(np.abs(moved))) & (np.abs(head) > 0)
    if far.sum() < FEWEST or not np.median(np.abs(moved)) > 0:
        return None
    moved, head, turning, span = moved[far], head[far], blocks.change(psi)[far], blocks.span[far]
    ahead = head / np.abs(head)
    off = moved / np.abs(moved) / ahead
    period = turning_time(turning / span, float(s.t[-1] - s.t[0]))
    speed = np.abs(moved) / span
    slower = np.median(speed) / speed  # a current turns the course the more, the slower the vehicle is
    complexes = {
        "angle": (1j * np.ones(off.size), ANGLE),
        "sway": (1j * turning / span * period, SIDEWAYS),
        "drift_north": (1j * (1.0 / ahead).imag * slower, CURRENT),
        "drift_east": (1j * (1j / ahead).imag * slower, CURRENT),
    }
    columns = {k: _stacked(c) for k, (c, _) in complexes.items()}
    return Relation(
        "course", _stacked(off - 1.0), columns, {k: v for k, (_, v) in complexes.items()}, 0.5**0.5
    )


def _yaw(s: Joined, logged: Mapping[str, float]) -> Relation | None:
    if not s.has("psi", "r"):
        return None
    blocks = Blocks(s.t, s.read("psi"), s.known("psi", "r"), BLOCKS, READINGS)
    rate = s["r"]
    if s.has("phi", "theta", "q"):
        phi, theta = s["phi"], s["theta"]
        rate = (s["q"] * np.sin(phi) + rate * np.cos(phi)) / np.maximum(np.cos(theta), 0.05)
    return _angle("yaw", s, blocks, s["psi"], s["r"], rate, logged.get("psi", 1.0))


def _pitch(s: Joined, logged: Mapping[str, float]) -> Relation | None:
    if not s.has("theta", "q"):
        return None
    rate = s["q"]
    if s.has("phi", "r"):
        rate = rate * np.cos(s["phi"]) - s["r"] * np.sin(s["phi"])
    blocks = Blocks(s.t, s.read("theta"), s.known("theta", "q"), BLOCKS, READINGS)
    return _angle("pitch", s, blocks, s["theta"], s["q"], rate, logged.get("theta", 1.0))


def _roll(s: Joined, logged: Mapping[str, float]) -> Relation | None:
    if not s.has("phi", "p"):
        return None
    rate = s["p"]
    if s.has("theta", "q", "r"):
        phi = s["phi"]
        rate = rate + (s["q"] * np.sin(phi) + s["r"] * np.cos(phi)) * np.tan(s["theta"])
    blocks = Blocks(s.t, s.read("phi"), s.known("phi", "p"), BLOCKS, READINGS)
    return _angle("roll", s, blocks, s["phi"], s["p"], rate, logged.get("phi", 1.0))


def _angle(
    name: str, s: Joined, blocks: Blocks, angle: Floats, own: Floats, rate: Floats, factor: float
) -> Relation | None:
    """Change of an angle against the integral of its rate; `own` is that rate without those of other axes.

    None where neither moves more than the noise that the other axes bring: a noisy yaw rate in a dive without
    a turn rolls nobody, and whatever took it away would be a mistake.
    """
    if blocks.span.size < FEWEST:
        return None
    turned, reckoned = blocks.change(angle), blocks.integral(rate)
    moved = max(float(np.sqrt(np.mean(c**2))) for c in (turned, blocks.integral(own)))
    if _noise_of(rate - own, s.t, blocks) > MOST_NOISE * moved:
        return None
    period = turning_time(reckoned / blocks.span, float(s.t[-1] - s.t[0]))
    size = float(np.sqrt(np.mean(turned**2)))
    columns = {"scale": reckoned, "bias": blocks.span, "late": blocks.change(rate)}
    sd = {"scale": SCALE, "bias": RATE_BIAS / period, "late": LATENCY * period / LENGTHS}
    return Relation(name, turned - reckoned, columns, sd, size, turned.size * math.log(abs(factor)))


def _noise_of(rate: Floats, t: Floats, blocks: Blocks) -> float:
    """Standard deviation over a block of the integral of what changes from reading to reading."""
    if rate.size < 4:
        return 0.0
    white = middle(np.abs(np.diff(rate, 3))) / 0.6745 / math.sqrt(20.0)
    return white * math.sqrt(middle(np.diff(t)) * middle(blocks.span))


def _depth(s: Joined, logged: Mapping[str, float]) -> Relation | None:
    water = not s.has("u") and s.has("u_water")
    u, v, w = ("u_water", "v_water", "w_water") if water else ("u", "v", "w")
    if not s.has("z", "theta", u):
        return _path_angle(s, logged)
    names = ["z", "theta", u] + [k for k in (v, w, "phi") if s.has(k)]
    blocks = Blocks(s.t, s.read("z"), s.known(*names), BLOCKS, READINGS)
    if blocks.span.size < FEWEST:
        return None
    theta = s["theta"]
    phi = s["phi"] if s.has("phi") else np.zeros(s.t.shape)
    across = (s[v] * np.sin(phi) if s.has(v) else 0.0) + (s[w] * np.cos(phi) if s.has(w) else 0.0)
    sink = -s[u] * np.sin(theta) + across * np.cos(theta)
    sunk, reckoned = blocks.change(s["z"]), blocks.integral(sink)
    advance = blocks.integral(s[u])
    speed = float(np.sqrt(np.mean((advance / blocks.span) ** 2)))
    travel = s.travel_time(turning_time(blocks.change(theta) / blocks.span, float(s.t[-1] - s.t[0])))
    columns = {
        "scale": reckoned, "trim": advance, "late": blocks.change(sink), "drift": blocks.span,
        "lever": blocks.change(np.sin(theta)),
    }  # fmt: skip
    sd = {
        "scale": SCALE, "trim": 0.05, "late": LATENCY * travel,
        "drift": (CURRENT if water else DRIFT) * speed,
        "lever": LEVER * speed * travel,
    }  # fmt: skip
    size = float(np.sqrt(np.mean(sunk**2)))
    return Relation(
        "depth", sunk - reckoned, columns, sd, size, sunk.size * math.log(abs(logged.get("z", 1.0)))
    )


def _path_angle(s: Joined, logged: Mapping[str, float]) -> Relation | None:
    """Depth against track and pitch, where no velocity is logged: the path is about as steep as the hull."""
    if not s.has("z", "theta", "x", "y"):
        return None
    blocks = Blocks(s.t, s.read("z", "x", "y"), s.known("z", "theta", "x", "y"), BLOCKS, READINGS)
    if blocks.span.size < FEWEST:
        return None
    slope = np.tan(s["theta"])
    advance = np.abs(blocks.change(s["x"]) + 1j * blocks.change(s["y"]))
    sunk, reckoned = blocks.change(s["z"]), -advance * blocks.mean(slope)
    speed = float(np.sqrt(np.mean((advance / blocks.span) ** 2)))
    period = turning_time(blocks.change(s["theta"]) / blocks.span, float(s.t[-1] - s.t[0]))
    columns = {"scale": reckoned, "trim": advance, "lever": blocks.change(slope)}
    sd = {"scale": PATH, "trim": 0.05, "lever": LEVER * speed * s.travel_time(period)}
    size = float(np.sqrt(np.mean(sunk**2)))
    return Relation(
        "depth", sunk - reckoned, columns, sd, size, sunk.size * math.log(abs(logged.get("z", 1.0)))
    )


def level_velocity(s: Joined, along: str, side: str) -> np.ndarray:
    """Velocity in level axes turned by heading only, u + i v; pitch and roll taken out where logged."""
    u = s[along]
    v = s[side] if s.has(side) else np.zeros(u.shape)
    heave = "w_water" if along == "u_water" else "w"
    if not s.has("phi", "theta", heave):
        return u + 1j * v
    phi, theta, w = s["phi"], s["theta"], s[heave]
    ahead = u * np.cos(theta) + np.sin(theta) * (v * np.sin(phi) + w * np.cos(phi))
    return ahead + 1j * (v * np.cos(phi) - w * np.sin(phi))


def _stacked(values: np.ndarray) -> Floats:
    return np.concatenate((values.real, values.imag))


_ALL = {
    _track: ("track", "course"), _yaw: ("yaw",), _depth: ("depth",), _pitch: ("pitch",), _roll: ("roll",),
}  # fmt: skip
