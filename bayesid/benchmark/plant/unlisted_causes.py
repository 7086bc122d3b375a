"""Causes of the catalogue in another form, and causes that have no name there.

Takes and gives the same as `listed_causes`. The parameters of these are the plant's own and not to be scored.
Does not: claim that the list is complete; that is the point of it.
"""

from __future__ import annotations

import math

from bayesid.benchmark.plant.listed_causes import (
    CATALOGUE,
    DEG,
    Numbers,
    PlantedCause,
    direction,
    sign,
    simple,
)


def _tide(rng, size, s):
    north, east = direction(rng)
    amplitude, period = 0.12 * s.U * size, s.run * float(rng.uniform(0.8, 2.0))
    fields = {"tide_n": amplitude * north, "tide_e": amplitude * east, "tide_w": 2 * math.pi / period}
    return _same(fields | {"tide_p": float(rng.uniform(0.0, 2 * math.pi))})


def _eddy(rng, size, s):
    north, east = direction(rng)
    fields = {"vn": 0.12 * s.U * size * north, "ve": 0.12 * s.U * size * east}
    return _same(fields | {"eddy": sign(rng) * float(rng.uniform(0.4, 0.8)), "eddy_len": 30.0 * s.L})


def _servo(rng, size, s):
    return _same({"servo_w": 3.0 / (0.4 * s.LU * size), "servo_z": float(rng.uniform(0.5, 0.9))})


def _two_cycles(rng, size, s):
    a, b = direction(rng)
    return _same({"psi_sin2": 2.0 * DEG * size * a, "psi_cos2": 2.0 * DEG * size * b})


def _settling(rng, size, s):
    """As a gyrocompass does: through the meridian and back, ever less."""
    time = float(rng.uniform(0.2, 0.5)) * s.run
    fields = {"psi_settle": 4.0 * DEG * size * sign(rng), "psi_settle_t": time}
    return _same(fields | {"psi_settle_w": float(rng.uniform(2.0, 4.0)) / time})


def _swing(rng, size, s):
    period = float(rng.uniform(0.3, 1.0)) * s.run
    return _same({"psi_swing": 2.0 * DEG * size * sign(rng), "psi_swing_w": 2 * math.pi / period})


def _memory(lag: float, yaw: float):
    def draw(rng, size, s):
        share = min(0.4 * size, 0.8)
        return _same({"mem": share, "mem_r": yaw * share, "mem_lag": lag * float(rng.uniform(0.8, 1.25))})

    return draw


def _fast_loss(rng, size, s):
    return _same({"loss": 0.25 * size, "loss_speed": float(rng.uniform(1.5, 3.0))})


def _gusts(rng, size, s):
    north, east = direction(rng)
    force = 3e-4 * s.force * size
    return _same({"fn": force * north, "fe": force * east, "gust": 0.8, "gust_w": 1.0 / s.LU})


def _midships(rng, size, s):
    return _same({"cd": 0.5 * size, "bow": float(rng.choice([-1.0, 1.0]))})


def _fifth(rng, size, s):
    sway, yaw = -2.0 * size * 0.5 * s.rho * s.L**2 / s.U, -0.02 * size * 0.5 * s.rho * s.L**6 / s.U
    return _same({"v5": sway * (4.0 / s.U) ** 2, "r5": yaw * (2.5 * s.LU) ** 2})


def _hunting(rng, size, s):
    return _same({"hunt": 1.0 * DEG * size, "hunt_w": float(rng.uniform(1.0, 3.0)) / s.LU})


def _stuck(rng, size, s):
    first = float(rng.uniform(0.3, 0.7)) * s.run
    return _same({"stuck_from": first, "stuck_to": first + 6.0 * size * s.LU})


def _wall(rng, size, s):
    n, e = direction(rng)
    place = {"wall_n": 3.0 * s.L * n, "wall_e": 3.0 * s.L * e, "wall_dir": float(rng.uniform(0, 2 * math.pi))}
    return _same(place | {"wall": 0.004 * size, "wall_len": 0.7 * s.L})


def _vortex(rng, size, s):
    return _same({"vortex": 6e-4 * size, "vortex_w": 2 * math.pi * float(rng.uniform(0.15, 0.4)) / s.LU})


def _growing(rng, size, s):
    first = float(rng.uniform(0.1, 0.4)) * s.run
    fields = {"step_d": 6e-4 * size * 0.5 * s.rho * s.L**2, "step_t": first}
    return _same(fields | {"step_ramp": float(rng.uniform(0.2, 0.5)) * s.run})


def _damage(rng, size, s):
    """A fin that is bent on the way."""
    moment = 2e-4 * size * sign(rng) * 0.5 * s.rho * s.L**3
    fields = {"twist_n": moment, "twist_y": -1.5 * moment / s.L}
    return _same(fields | {"twist_t": float(rng.uniform(0.3, 0.6)) * s.run})


def _governor(rng, size, s):
    """Revolutions that swing about their order."""
    period = float(rng.uniform(8.0, 30.0)) * s.LU
    return _same({"revs_swing": 0.04 * size, "revs_swing_w": 2 * math.pi / period})


def _slosh(rng, size, s):
    fields = {"slosh": min(0.12 * size, 0.3), "slosh_x": float(rng.uniform(-0.2, 0.2)) * s.L}
    return _same(fields | {"slosh_w": float(rng.uniform(0.8, 2.0)) / s.LU, "slosh_z": 0.1})


def _same(fields: Numbers) -> tuple[Numbers, Numbers]:
    return dict(fields), fields


def _variant(name: str, variant: str, draw, needs: str = "") -> PlantedCause:
    return PlantedCause(name, draw, 3, "variant", variant, needs)


def _own(field: str, reference: float, scale: str = "1", one_sided: bool = False):
    return simple(field, field, reference, scale, one_sided)


VARIANTS = (
    _variant("ocean_current_varying", "tide", _tide),
    _variant("ocean_current", "eddy", _eddy),
    _variant("rudder_stall", "hard", _own("hard_stall", 3.0, one_sided=True)),
    _variant("actuator_lag", "second order", _servo),
    _variant("compass_deviation", "two cycles", _two_cycles),
    _variant("heading_settling", "oscillating", _settling),
    _variant("fluid_memory", "slow", _memory(4.0, 0.0)),
    _variant("fluid_memory", "fast, also yaw", _memory(0.5, 1.0)),
    _variant("rudder_effectiveness", "depends on speed", _fast_loss),
    _variant("rudder_propeller_interaction", "whole race", _own("jet", 0.3, one_sided=True)),
    _variant("actuator_backlash", "dead band", _own("band", 2.5 * DEG, one_sided=True)),
    _variant(
        "thrust_decay", "late", lambda r, z, s: _same({"t_late": 0.4 * z / s.run, "late_from": 0.4 * s.run})
    ),
    _variant("drag_step", "growing", _growing),
    _variant("hull_fouling", "linear", _own("foul_linear", 0.25, one_sided=True)),
    _variant("crossflow_drag", "midships or ends", _midships),
    _variant("cubic_damping", "fifth power", _fifth),
    _variant("steady_force", "gusts", _gusts),
    _variant("tether_drag", "linear", lambda r, z, s: _same({"tether_linear": 2.5e-4 * z * s.force / s.U})),
    _variant("gyro_scale", "one side", _own("r_oneside", 0.04), "r"),
    _variant("gyro_bias", "creeping", lambda r, z, s: _same({"r_creep": 0.012 * z / s.LU / s.run}), "r"),
    _variant("velocity_scale", "ahead only", _own("u_scale", 0.02), "u"),
    _variant("velocity_latency", "filtered", _own("v_smooth", 0.3, "L/U", True), "u"),
    _variant("position_latency", "filtered", _own("p_smooth", 0.5, "L/U", True)),
)


def _outside(name: str, draw) -> PlantedCause:
    return PlantedCause(name, draw, 3, "outside")


OUTSIDE = (
    _outside("bank_suction", _wall),
    _outside("vortex_shedding", _vortex),
    _outside("stuck_rudder", _stuck),
    _outside("servo_hunting", _hunting),
    _outside("bent_fin", _damage),
    _outside("governor_hunting", _governor),
    _outside("sloshing_mass", _slosh),
    _outside("compass_swing", _swing),
)
CASES = CATALOGUE + VARIANTS + OUTSIDE
