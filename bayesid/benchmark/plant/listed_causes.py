"""What can be wrong with the plant, by the names of the effect contract, with sizes drawn for a vehicle.

Takes: a size (1 = the reference magnitude), a random generator, the scales of a vehicle. Gives parameters as
the contract names them and the settings that make them happen.
Does not: apply anything. Other forms of a named effect and effects without a name are in `unlisted_causes`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

DEG = math.pi / 180
Numbers = dict[str, float]


@dataclass(frozen=True)
class Scales:
    """Sizes of the vehicle: length [m], speed [m/s], density, mass [kg], z_G - z_B [m], run [s], dof."""

    L: float
    U: float
    rho: float
    mass: float
    arm: float
    run: float
    dof: int = 3

    @property
    def LU(self) -> float:
        return self.L / self.U

    @property
    def force(self) -> float:
        return 0.5 * self.rho * self.L**2 * self.U**2


Draw = Callable[[np.random.Generator, float, Scales], tuple[Numbers, Numbers]]


@dataclass(frozen=True)
class PlantedCause:
    """One thing to plant.

    kind : "effect" (as the catalogue words it), "variant" (same cause, other form) or "outside"
    needs : "" or a channel that has to be logged for it to show at all
    surface : acts on a vehicle at the surface only, as those in six degrees of freedom are not
    """

    name: str
    draw: Draw
    dof: int = 3
    kind: str = "effect"
    variant: str = ""
    needs: str = ""
    surface: bool = False


def sign(rng: np.random.Generator) -> float:
    return float(rng.choice([-1.0, 1.0]))


def direction(rng: np.random.Generator) -> tuple[float, float]:
    angle = rng.uniform(0.0, 2.0 * math.pi)
    return math.cos(angle), math.sin(angle)


def simple(parameter: str, field: str, reference: float, scale: str = "1", one_sided: bool = False) -> Draw:
    """A single number: reference times size times a scale of the vehicle, either sign unless one-sided."""

    def draw(rng: np.random.Generator, size: float, s: Scales) -> tuple[Numbers, Numbers]:
        scales = {"1": 1.0, "L/U": s.LU, "U/L": 1.0 / s.LU, "L": s.L, "U": s.U, "line": 0.5 * s.rho * s.L**2,
                  "yaw": 0.5 * s.rho * s.L**3, "list": s.mass * 9.81 * s.arm}  # fmt: skip
        value = reference * size * scales[scale] * (1.0 if one_sided else sign(rng))
        return {parameter: value}, {field: value}

    return draw


def _pair(names: tuple[str, str], fields: tuple[str, str], reference: float, scale: str = "1") -> Draw:
    """A vector of the given length in a random direction."""
    one = simple("value", "value", reference, scale, one_sided=True)

    def draw(rng: np.random.Generator, size: float, s: Scales) -> tuple[Numbers, Numbers]:
        length = one(rng, size, s)[0]["value"]
        pair = [length * part for part in direction(rng)]
        return dict(zip(names, pair, strict=True)), dict(zip(fields, pair, strict=True))

    return draw


def _varying(rng, size, s):
    (a, b), (c, d) = direction(rng), direction(rng)
    first, change = 0.08 * s.U * size, 0.1 * s.U * size / s.run
    parameters = {"V_north": first * a, "V_east": first * b}
    parameters |= {"dV_north": 600 * change * c, "dV_east": 600 * change * d}
    return parameters, {"vn": first * a, "ve": first * b, "an": change * c, "ae": change * d}


def _decay(rng, size, s):
    lost = 0.2 * size / s.run
    return {"loss_per_600s": 600.0 * lost}, {"t_decay": lost}


def _drift(rng, size, s):
    creep = 4.0 * DEG * size * sign(rng) / s.run
    return {"drift_per_600s": 600.0 * creep}, {"psi_creep": creep}


def _settling(rng, size, s):
    start, time = 4.0 * DEG * size * sign(rng), float(rng.uniform(0.2, 0.5)) * s.run
    return {"start": start, "settling_time": time}, {"psi_settle": start, "psi_settle_t": time}


def _ballast(rng, size, s):
    share, x = 0.08 * size, float(rng.uniform(-0.1, 0.1)) * s.L
    return {"mass_fraction": share, "x": x}, {"ballast": share, "ballast_x": x}


def _centre(parameter: str, field: str, share: float, tilt: float) -> Draw:
    """Shift of the centre of mass: a share of the length in the plane; in 6-DOF what heels or trims the
    vehicle by `tilt` [rad], since its righting arm is short."""

    def draw(rng: np.random.Generator, size: float, s: Scales) -> tuple[Numbers, Numbers]:
        value = size * sign(rng) * (share * s.L if s.dof == 3 else min(share * s.L, tilt * s.arm))
        return {parameter: value}, {field: value}

    return draw


def _added(rng, size, s):
    e = [0.3 * size * sign(rng) * float(rng.uniform(0.5, 1.0)) for _ in range(3)]
    return dict(zip(("e_X", "e_Y", "e_N"), e, strict=True)), dict(zip(("e_x", "e_y", "e_n"), e, strict=True))


def _crossflow(rng, size, s):
    cd, tilt = 0.5 * size, float(rng.uniform(-0.3, 0.3))
    return {"Cd": cd, "tilt": tilt}, {"cd": cd, "tilt": tilt}


def _cubic(rng, size, s):
    # damping only: the other sign lets a hull run away
    sway = -2.0 * size * 0.5 * s.rho * s.L**2 / s.U
    yaw = -0.02 * size * 0.5 * s.rho * s.L**6 / s.U
    return {"Y_vvv": sway, "N_rrr": yaw}, {"vvv": sway, "rrr": yaw}


def _memory(rng, size, s):
    share, lag = min(0.4 * size, 0.8), float(rng.uniform(0.8, 2.0))
    return {"fraction": share, "lag": lag}, {"mem": share, "mem_lag": lag}


def _wind(rng, size, s):
    north, east = direction(rng)
    speed = 1.8 * s.U * size
    area = float(rng.uniform(0.7, 1.4))
    fields = {"air_n": -speed * north, "air_e": -speed * east}
    fields |= {"air_x": 0.03 * area, "air_y": 0.1 * area, "air_arm": float(rng.uniform(0.0, 0.1))}
    come = math.atan2(east, north) % (2 * math.pi)
    return {"V_wind": speed, "from": come, "area_coefficients": area}, fields


def _step(rng, size, s):
    drag, onset = 6e-4 * s.force * size, float(rng.uniform(0.2, 0.7)) * s.run
    return {"extra_drag": drag, "onset": onset}, {"step_d": drag / s.U**2, "step_t": onset}


def _twist(rng, size, s):
    moment, arm = 2e-4 * s.force * s.L * size * sign(rng), float(rng.uniform(-0.5, 0.8)) * s.L
    side = moment * arm / s.L**2 * 3.0
    parameters = {"side_force": side, "yaw_moment": moment}
    return parameters, {"twist_y": side / s.U**2, "twist_n": moment / s.U**2}


def _trim(rng, size, s):
    weight, x = 5e-4 * s.force * size * sign(rng), float(rng.uniform(-0.2, 0.2)) * s.L
    return {"weight_excess": weight, "x": x}, {"heavy": weight, "heavy_x": x}


def _suction(rng, size, s):
    z, m, d = 1e-3 * size, 3e-4 * size * sign(rng), float(rng.uniform(0.3, 0.7))
    return {"Z_s": z, "M_s": m, "decay": d}, {"suck_z": z, "suck_m": m, "suck_d": d}


E = PlantedCause
CATALOGUE = (
    E("ocean_current", _pair(("V_north", "V_east"), ("vn", "ve"), 0.15, "U")),
    E("ocean_current_varying", _varying),
    E("rudder_offset", simple("offset", "offset", 2.0 * DEG)),
    E("rudder_effectiveness", simple("loss", "loss", 0.25, one_sided=True)),
    E("rudder_asymmetry", simple("asymmetry", "asym", 0.12)),
    E("rudder_stall", simple("inverse_stall_angle", "stall", 2.5, one_sided=True)),
    E("rudder_propeller_interaction", simple("k", "slip", 0.4)),
    E("actuator_lag", simple("tau", "tau", 0.4, "L/U", True)),
    E("actuator_dead_time", simple("delay", "dead", 0.3, "L/U", True)),
    E("actuator_rate_limit", simple("inverse_rate_excess", "slow", 2.0, "L/U", True)),
    E("actuator_backlash", simple("half_width", "play", 1.5 * DEG, one_sided=True)),
    E("thrust_loss", simple("loss", "t_loss", 0.15, one_sided=True)),
    E("thrust_decay", _decay),
    E("hull_fouling", simple("drag_increase", "foul", 0.25, one_sided=True)),
    E("propeller_side_force", simple("side_force", "side", 0.1)),
    E("propeller_torque", simple("torque", "torque", 0.06, "list"), dof=6),
    E("cg_offset_x", _centre("x_G", "x_g", 0.02, 0.05)),
    E("cg_offset_y", _centre("y_G", "y_g", 0.015, 0.1)),
    E("ballast_mass", _ballast),
    E("added_mass_error", _added),
    E("crossflow_drag", _crossflow),
    E("cubic_damping", _cubic),
    E("fluid_memory", _memory),
    E("hull_asymmetry", simple("N_u_abs_v", "bent", 0.002, "yaw")),
    E("hull_misalignment", _twist),
    E("drag_step", _step),
    E("steady_force", lambda r, z, s: _pair(("F_north", "F_east"), ("fn", "fe"), 3e-4 * s.force)(r, z, s)),
    E("wind", _wind, surface=True),
    E("tether_drag", simple("k", "tether", 2.5e-4, "line", True)),
    E("heading_bias", simple("bias", "psi_bias", 2.0 * DEG)),
    E("heading_drift", _drift),
    E("heading_settling", _settling),
    E("compass_deviation", _pair(("A", "B"), ("psi_sin", "psi_cos"), 2.0 * DEG)),
    E("gyro_scale", simple("scale", "r_scale", 0.03), needs="r"),
    E("gyro_bias", simple("bias", "r_bias", 0.006, "U/L"), needs="r"),
    E("position_lever_arm", _pair(("l_x", "l_y"), ("arm_x", "arm_y"), 0.3, "L")),
    E("position_latency", simple("delay", "p_late", 0.5, "L/U", True)),
    E("velocity_scale", lambda r, z, s: _scaled(r, z), needs="u"),
    E("velocity_misalignment", simple("angle", "turned", 2.0 * DEG), needs="u"),
    E("velocity_latency", simple("delay", "v_late", 0.3, "L/U", True), needs="u"),
    E("trim_weight", _trim, dof=6),
    E("stern_plane_offset", simple("offset", "s_offset", 1.5 * DEG), dof=6),
    E("stern_plane_effectiveness", simple("loss", "s_loss", 0.2, one_sided=True), dof=6),
    E("depth_bias", simple("bias", "z_bias", 0.05, "L"), dof=6),
    E("depth_latency", simple("delay", "z_late", 0.5, "L/U", True), dof=6),
    E("heave_current", simple("V_down", "vd", 0.02, "U"), dof=6),
    E("surface_suction", _suction, dof=6),
)


def _scaled(rng, size):
    value = 0.02 * size * sign(rng)
    return {"scale": value}, {"u_scale": value, "v_scale": value}
