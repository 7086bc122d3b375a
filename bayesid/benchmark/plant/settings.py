"""Every way the plant may differ from its vehicle file, as one flat record whose zero is the plain vehicle.

Takes: numbers by name. Gives a numpy record the compiled motion reads.
Does not: draw sizes or know what a difference is called outside (`listed_causes`).
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from bayesid.errors import ModelError

GROUPS: dict[str, tuple[str, ...]] = {
    # m/s; change per second; tide: amplitude, rad/s, rad; eddy: share of change over a distance [m]
    "flow": ("vn", "ve", "vd", "an", "ae", "tide_n", "tide_e", "tide_w", "tide_p", "eddy", "eddy_len"),
    # rad, s; the second-order servo has a frequency [rad/s] and a damping ratio
    "rudder input": ("offset", "dead", "play", "band", "tau", "slow", "servo_w", "servo_z", "hunt", "hunt_w",
                     "stuck_from", "stuck_to", "s_offset"),
    "rudder force": ("loss", "loss_speed", "asym", "stall", "hard_stall", "slip", "jet", "s_loss"),
    "propulsion": ("t_loss", "t_decay", "t_late", "late_from", "foul", "foul_linear", "side", "torque"),
    "hull": ("cd", "tilt", "bow", "vvv", "rrr", "v5", "r5", "mem", "mem_lag", "mem_r", "bent",
             "tether", "tether_linear"),
    # N, N; gust share and rad/s; m/s of air and areas over L^2
    "earth": ("fn", "fe", "gust", "gust_w", "air_n", "air_e", "air_x", "air_y", "air_arm"),
    "vertical": ("heavy", "heavy_x", "suck_z", "suck_m", "suck_d"),
    "mass": ("x_g", "y_g", "ballast", "ballast_x", "e_x", "e_y", "e_n"),
    "outside": ("wall", "wall_n", "wall_e", "wall_dir", "wall_len", "vortex", "vortex_w", "step_t", "step_d",
                "step_ramp", "twist_y", "twist_n", "twist_t", "revs_swing", "revs_swing_w",
                "slosh", "slosh_x", "slosh_w", "slosh_z"),
    "sensors": ("psi_bias", "psi_sin", "psi_cos", "psi_sin2", "psi_cos2", "psi_creep", "psi_settle",
                "psi_settle_t", "psi_settle_w", "psi_swing", "psi_swing_w", "r_scale", "r_oneside",
                "r_bias", "r_creep", "arm_x", "arm_y", "p_late", "p_smooth", "u_scale", "v_scale",
                "turned", "v_late", "v_smooth", "z_bias", "z_late"),
}  # fmt: skip
FIELDS = tuple(name for names in GROUPS.values() for name in names)
_KIND = np.dtype([(name, "f8") for name in FIELDS])


def settings(values: Mapping[str, float] | None = None) -> np.void:
    """Record of all fields; those not named are 0.

    Raises
    ------
    ModelError                 for a name that is no field
    """
    out = np.zeros(1, _KIND)[0]
    for name, value in (values or {}).items():
        if name not in FIELDS:
            raise ModelError(f"plant settings have no field {name!r}")
        out[name] = float(value)
    return out
