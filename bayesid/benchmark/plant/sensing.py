"""What the sensors read of a track: the true state, turned, shifted, late or scaled as the settings say.

Takes: a `PlantTrack` and settings. Gives channels at the samples, SI, without noise.
Does not: drop or disturb samples (`noise`).
"""

from __future__ import annotations

import math

import numpy as np

from bayesid.benchmark.plant.execute_run import PlantTrack
from bayesid.model.notation import POSE as POSE_NAMES
from bayesid.model.notation import VELOCITY

FULL = {3: ("x", "y", "psi", "r", "u", "v"),
        6: ("x", "y", "psi", "r", "u", "v", "z", "phi", "theta", "p", "q", "w")}  # fmt: skip
NO_LOG = {3: ("x", "y", "psi", "r"), 6: ("x", "y", "psi", "r", "z", "phi", "theta", "p", "q")}
POSE = {3: ("x", "y", "psi"), 6: ("x", "y", "psi", "z", "phi", "theta")}
SUITES = {"full": FULL, "no velocity log": NO_LOG, "pose only": POSE}
_COLUMN = {name: k for k, name in enumerate(POSE_NAMES + VELOCITY)}


def _late(fine: np.ndarray, values: np.ndarray, at: np.ndarray, before: float) -> np.ndarray:
    """Values at earlier times; before the start they ran on at slope `before`."""
    out = np.interp(at, fine, values)
    return np.where(at < fine[0], values[0] + before * (at - fine[0]), out)


def _smooth(fine: np.ndarray, values: np.ndarray, lag: float, before: float) -> np.ndarray:
    """First-order filter; it had settled on the slope `before`."""
    out = np.empty_like(values)
    out[0] = values[0] - lag * before
    keep = math.exp(-(fine[1] - fine[0]) / lag)
    rise = 1.0 - lag * (1.0 - keep) / (fine[1] - fine[0])  # exact where the signal is linear over a step
    for k in range(1, values.size):
        out[k] = keep * out[k - 1] + (1.0 - keep) * values[k - 1] + rise * (values[k] - values[k - 1])
    return out


def heading_read(psi: np.ndarray | float, t: np.ndarray | float, gap: np.void) -> np.ndarray | float:
    """Compass reading [rad] of a true heading."""
    once = gap["psi_sin"] * np.sin(psi) + gap["psi_cos"] * np.cos(psi)
    twice = gap["psi_sin2"] * np.sin(2 * np.asarray(psi)) + gap["psi_cos2"] * np.cos(2 * np.asarray(psi))
    slow = gap["psi_creep"] * t + gap["psi_swing"] * np.sin(gap["psi_swing_w"] * t)
    if gap["psi_settle_t"] > 0.0:
        turn = np.cos(gap["psi_settle_w"] * np.asarray(t))
        slow = slow + gap["psi_settle"] * turn * np.exp(-np.asarray(t) / gap["psi_settle_t"])
    return psi + gap["psi_bias"] + slow + once + twice


def read(track: PlantTrack, gap: np.void) -> dict[str, np.ndarray]:
    """All twelve channels at the samples: position of the reference point, velocity over ground.

    Returns
    -------
    channel -> (n,) array      psi unwrapped [rad]
    """
    t, fine, state = track.t, track.fine, {name: track.states[:, k] for name, k in _COLUMN.items()}
    psi = state["psi"]
    c, s = np.cos(psi), np.sin(psi)
    state["x"] = state["x"] + gap["arm_x"] * c - gap["arm_y"] * s
    state["y"] = state["y"] + gap["arm_x"] * s + gap["arm_y"] * c
    along, across = state["u"], state["v"]
    turn_c, turn_s = math.cos(gap["turned"]), math.sin(gap["turned"])
    state["u"] = (along * turn_c + across * turn_s) * (1.0 + gap["u_scale"])
    state["v"] = (across * turn_c - along * turn_s) * (1.0 + gap["v_scale"])
    r = state["r"]
    scale = 1.0 + gap["r_scale"] + gap["r_oneside"] * (r > 0)
    state["r"] = r * scale + gap["r_bias"] + gap["r_creep"] * fine
    state["psi"] = np.asarray(heading_read(psi, fine, gap))
    state["z"] = state["z"] + gap["z_bias"]
    delays = {"x": "p_late", "y": "p_late", "u": "v_late", "v": "v_late", "w": "v_late", "z": "z_late"}
    filters = {"x": "p_smooth", "y": "p_smooth", "u": "v_smooth", "v": "v_smooth", "w": "v_smooth"}
    out = {}
    for name, values in state.items():
        before = (values[1] - values[0]) / (fine[1] - fine[0]) if name in "xyz" else 0.0
        lag = gap[filters[name]] if name in filters else 0.0
        if lag > 0.0:
            values = _smooth(fine, values, lag, before)
        late = gap[delays[name]] if name in delays else 0.0
        out[name] = _late(fine, values, t - late, before) if late else values[:: track.parts].copy()
    return out
