"""What a run without rudder orders is by its motion: straight, a change of speed, steered otherwise.

Takes a run on one time base. Does not: read rudder orders; `cutting` does.
"""

from __future__ import annotations

import math

import numpy as np

from bayesid.trials.trial import Floats, Run

STRAIGHT = "straight"
SPEED_STEPS, COAST, FASTER, SLOWER = "speed steps", "coast", "acceleration", "slowing down"
OTHERWISE = "steered without rudder"
#: words of runs whose rudder and planes do nothing
UNSTEERED = frozenset({STRAIGHT, SPEED_STEPS, COAST, FASTER, SLOWER, OTHERWISE, ""})

# Share of the highest revolutions, and of the highest speed, by which they change in no straight run; after a
# turn a ship regains up to a third of its speed
REVOLUTIONS, SPEED = 0.2, 0.4
STOPPED = 0.05  # share of the revolutions below which a propeller is stopped
# rad; of a course that nothing is seen to steer, as by a wind or a hull that is not straight; of one beside
# thrusters that push sideways and are at work
COURSE, COURSE_BY_THRUSTER = np.radians(45.0), np.radians(15.0)
LEAST_ADVANCE = 0.5  # of the way, below which a run without a turn is noise about one place
SMOOTH = 0.1  # of the run, over which it is averaged
THRUSTERS = ("n_bow", "n_stern", "azimuth", "nozzle")  # begin inputs that steer
_PAIR = ("n_port", "n_stbd")


def motion_words(look: Run, start: float = -np.inf, end: float = np.inf) -> str:
    """What a stretch of a run whose rudder is amidships is.

    Parameters
    ----------
    start, end : of the stretch [s]
    """
    inside = (look.t >= start) & (look.t <= end)
    if inside.sum() < 20:
        return STRAIGHT
    inputs = {name: values[inside] for name, values in _inputs(look).items()}
    psi = _smooth(look.data["psi"][inside]) if "psi" in look.data else np.zeros(0)
    course = float(np.ptp(psi)) if psi.size else 0.0
    if course > (COURSE_BY_THRUSTER if _thrusters_work(inputs) else COURSE):
        return OTHERWISE
    speed = _speed(look, inside)
    shafts = [v for name, v in inputs.items() if name.startswith("n") and not name.startswith(THRUSTERS)]
    if shafts:
        turns = _smooth(np.mean(shafts, axis=0))
        top = float(np.max(np.abs(turns))) if turns.size else 0.0
        if top > 0.0 and float(np.ptp(turns)) > REVOLUTIONS * top:
            return (
                COAST if float(np.median(np.abs(turns[turns.size // 2 :]))) < STOPPED * top else SPEED_STEPS
            )
    if speed.size and float(np.ptp(speed)) > SPEED * float(np.max(speed)):
        return FASTER if speed[-1] > speed[0] else SLOWER
    return STRAIGHT


def _inputs(look: Run) -> dict[str, Floats]:
    """Input -> values, as ordered where that is logged, else as measured."""
    ordered = {name.removesuffix("_cmd"): values for name, values in look.commands.items()}
    return {**look.measured_inputs, **ordered}


def _thrusters_work(inputs: dict[str, Floats]) -> bool:
    """Whether something beside a rudder steers: a thruster that pushes sideways, or two shafts unlike."""
    top = max((float(np.max(np.abs(v))) for k, v in inputs.items() if k.startswith("n_")), default=0.0)
    moved = [values for name, values in inputs.items() if name.startswith(THRUSTERS)]
    if set(_PAIR) <= set(inputs):
        moved.append(inputs[_PAIR[0]] - inputs[_PAIR[1]])
    return any(float(np.ptp(values)) > max(REVOLUTIONS * top, 0.05) for values in moved)


def _speed(look: Run, inside: np.ndarray) -> Floats:
    """Speed, averaged; of the track where none is logged."""
    for name in ("u", "u_water"):
        if name in look.data:
            return np.abs(_smooth(look.data[name][inside]))
    if not {"x", "y"} <= set(look.data):
        return np.zeros(0)
    t, x, y = look.t[inside], look.data["x"][inside], look.data["y"][inside]
    good = np.isfinite(x) & np.isfinite(y)
    knots = np.unique(np.linspace(0, good.sum() - 1, int(1 / SMOOTH) + 1).astype(int))
    t, x, y = (v[good][knots] for v in (t, x, y)) if knots.size > 2 else (np.zeros(0),) * 3
    way = np.hypot(np.diff(x), np.diff(y))
    if way.size and math.hypot(x[-1] - x[0], y[-1] - y[0]) < LEAST_ADVANCE * float(way.sum()):
        return np.zeros(0)
    return way / np.maximum(np.diff(t), 1e-9)


def _smooth(values: Floats) -> Floats:
    """Means of finite values over tenths of a run; fewer where it has holes."""
    parts = np.array_split(values, int(1 / SMOOTH))
    return np.array([float(np.nanmean(p)) for p in parts if np.isfinite(p).any()])
