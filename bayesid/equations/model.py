"""A model: one vehicle, its kernel, and the parameter vector both agree on.

Takes a `Vehicle` and the number of degrees of freedom. Gives names, SI values at nominal, scales to the
vehicle file's units, prior standard deviations and effect scales. Does not simulate.
"""

from __future__ import annotations

import difflib
import hashlib
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from bayesid.equations.layout import KT_TURNS, KernelSpec
from bayesid.equations.runtime import Declared, Kernel, load_kernel
from bayesid.errors import ModelError, VehicleError
from bayesid.model.effects import CATALOGUE, Effect
from bayesid.model.effects.named import named_effects
from bayesid.model.propulsion import torque_curve
from bayesid.model.terms import ADDED_MASSES, TERMS
from bayesid.model.terms.mmg import AIR, GEOMETRY
from bayesid.model.vehicles import Vehicle, coef_si, prime_scale, self_propulsion_speed
from bayesid.model.vehicles.orders import missing_actuators

_UNLIMITED_RATE = 1e6
_UNLIMITED_ANGLE = 10.0


@dataclass(frozen=True, eq=False)
class Model:
    """Equations and nominal numbers of one vehicle.

    Attributes
    ----------
    vehicle : Vehicle
    dof : 3 (surge, sway, yaw) or 6
    kernel : Kernel
    nominal : (n,) array, SI, in the order of `kernel.parameters`; effects at their off values, or as the
        vehicle file states them
    withheld : effects no longer on offer; one that the vehicle file states acts all the same
    """

    vehicle: Vehicle
    dof: int
    kernel: Kernel
    nominal: np.ndarray
    withheld: tuple[Effect, ...] = ()

    @cached_property
    def index(self) -> dict[str, int]:
        """Position of every parameter name."""
        return {name: i for i, name in enumerate(self.kernel.parameters)}

    def limit(self, actuator: str) -> float:
        """Largest deflection of a fin, or of a thruster that turns [rad]; infinite for any other actuator."""
        servo = self.kernel.spec.servos.get(actuator)
        return math.inf if servo is None else float(self.nominal[self.index[f"limit_{servo}"]])

    @cached_property
    def states(self) -> tuple[str, ...]:
        """States of the bare model, pose first."""
        return self.kernel.bare.states

    @cached_property
    def coefficients(self) -> tuple[str, ...]:
        """Coefficients the vehicle file states and this model reads."""
        return tuple(n for n in self.kernel.parameters if n in self.vehicle.coef)

    @cached_property
    def candidate_rows(self) -> tuple[str, ...]:
        """Rows of the table the vehicle leaves at zero."""
        rows = {t.name for t in TERMS if t.group == "base"}
        return tuple(n for n in self.kernel.parameters if n in rows and n not in self.vehicle.coef)

    @cached_property
    def effects(self) -> dict[str, Effect]:
        return {e.name: e for e in self.kernel.effects}

    @cached_property
    def effect_off(self) -> dict[int, float]:
        """Off value of every effect parameter by position."""
        return {self.index[e.key(p.name)]: p.off for e in self.kernel.effects for p in e.parameters}

    @cached_property
    def without_effects(self) -> np.ndarray:
        """(n,) nominal parameters, effects that the vehicle file has on switched off."""
        out = self.nominal.copy()
        out[list(self.effect_off)] = list(self.effect_off.values())
        out.setflags(write=False)
        return out

    @cached_property
    def own_state_sd(self) -> dict[str, float]:
        """Prior standard deviation of the effects' own states at the start of a run [SI]."""
        own = (s for e in self.kernel.effects for s in e.states)
        return {s.name: s.sd * eval_scale(s.scale, self.scales) for s in own}

    @cached_property
    def causes(self) -> tuple[Effect, ...]:
        """Effects that may be named; the others are part of a model form only."""
        return tuple(e for e in self.kernel.effects if e.as_form != "only")

    @cached_property
    def effect_limits(self) -> dict[int, tuple[float, float]]:
        """Range in which an effect parameter is that of the effect [SI], by position."""
        out = {}
        for e in self.kernel.effects:
            for p in e.parameters:
                unit = eval_scale(p.scale, self.scales)
                low = max(p.low * unit, p.off if p.one_sided else -math.inf)
                out[self.index[e.key(p.name)]] = (low, p.high * unit)
        return out

    @cached_property
    def coefficient_limits(self) -> dict[int, tuple[float, float]]:
        """Range in which a coefficient is that of a hull [SI], by position: an added mass is not negative,
        unless the file says so."""
        added = (self.index[name] for name in ADDED_MASSES if name in self.index)
        return {i: (-math.inf, 0.0) for i in added if self.nominal[i] < 0.0}

    @cached_property
    def limits(self) -> dict[int, tuple[float, float]]:
        """Physical ranges of effect parameters and coefficients [SI], by position."""
        return self.effect_limits | self.coefficient_limits

    @cached_property
    def scales(self) -> dict[str, float]:
        """Vehicle scales that size priors: L [m], U [m/s], rho [kg/m3] at the reference revolutions."""
        return {"L": self.vehicle.L, "U": float(self.nominal[self.index["U_ref"]]), "rho": self.vehicle.rho}

    @property
    def digest(self) -> str:
        """Hash of equations and numbers; wording, files and the printer of kernels leave it as it is."""
        text = f"{self.kernel.digest}|{self.vehicle.digest}|{self.dof}"
        return hashlib.sha256(text.encode()).hexdigest()[:16]

    def file_scale(self, name: str) -> float:
        """SI value over value in the vehicle file, 1 for anything but a coefficient."""
        return prime_scale(self.vehicle, name) if name in _ROW_NAMES else 1.0

    def with_values(self, values: Mapping[str, float], units: str = "si") -> np.ndarray:
        """Parameter vector with some entries replaced.

        Parameters
        ----------
        values : name -> value
        units : "si", or "file" for the vehicle file's own (possibly non-dimensional) units

        Raises
        ------
        ModelError
            for a name the model does not have
        """
        out = self.nominal.copy()
        for name, value in values.items():
            if name not in self.index:
                raise ModelError(f"model of {self.vehicle.name!r} ({self.dof}-DOF) has no parameter {name!r}")
            out[self.index[name]] = value * (self.file_scale(name) if units == "file" else 1.0)
        return out

    def positions(self, names: Iterable[str]) -> np.ndarray:
        """Indices of parameter names."""
        try:
            return np.array([self.index[n] for n in names], dtype=np.int64)
        except KeyError as exc:
            raise ModelError(
                f"model of {self.vehicle.name!r} ({self.dof}-DOF) has no parameter {exc.args[0]!r}"
            ) from None

    def parameter_unit(self, name: str) -> str | None:
        """Unit of an effect parameter inside the program; None for coefficients, which are in file units."""
        effect, _, parameter = name.partition(".")
        declared = self.effects[effect].parameters if effect in self.effects else ()
        return next((p.unit for p in declared if p.name == parameter), None)

    def prior_sd(self, name: str) -> float:
        """Prior standard deviation (SI) of a coefficient or an effect parameter; nan where none is stated."""
        if name in self.vehicle.coef:
            prior = self.vehicle.prior
            if prior is None:
                return math.nan
            if name in prior.names and prior.covariance is not None:
                i = prior.names.index(name)
                return math.sqrt(prior.covariance[i, i]) * abs(self.file_scale(name))
            return abs(prior.relative_sd.get(name, math.nan) * self.nominal[self.index[name]])
        if "." in name:
            if name in self.vehicle.effects_sd:
                return self.vehicle.effects_sd[name]
            effect, parameter = name.split(".", 1)
            for p in self.effects[effect].parameters:
                if p.name == parameter:
                    return p.sd * eval_scale(p.scale, self.scales)
        return math.nan

    def is_off(self, par: np.ndarray) -> bool:
        """Whether every effect parameter sits at its off value (last axis of `par` is the parameter)."""
        where, off = self._off_values
        return bool(np.all(par[..., where] == off))

    @cached_property
    def _off_values(self) -> tuple[np.ndarray, np.ndarray]:
        """Positions and off values of the parameters of all effects, withheld ones too."""
        off = {
            self.index[e.key(p.name)]: p.off for e in self.withheld for p in e.parameters
        } | self.effect_off
        return np.fromiter(off, dtype=np.int64), np.fromiter(off.values(), dtype=float)


_ROW_NAMES = frozenset(t.name for t in TERMS)


def eval_scale(scale: str, values: Mapping[str, float]) -> float:
    """Number behind a scale such as "L/U" or "rho*L**2*U**2/2"."""
    return float(eval(compile(scale, "<scale>", "eval"), {"__builtins__": {}}, dict(values)))


def build_model(vehicle: Vehicle, dof: int | None = None, declared: Iterable[Effect] = ()) -> Model:
    """Model of a vehicle.

    Parameters
    ----------
    vehicle : Vehicle
    dof : 3 or 6; by default 3 for planar-only sets and 6 otherwise
    declared : effects beyond the catalogue

    Raises
    ------
    ModelError
        if a planar-only vehicle is asked for 6 degrees of freedom
    """
    dof = dof or (3 if vehicle.planar_only else 6)
    if dof not in (3, 6):
        raise ModelError(f"dof = {dof}: choose 3 (surge, sway, yaw) or 6")
    if dof == 6 and vehicle.planar_only:
        raise ModelError(f"vehicle {vehicle.name!r} is planar only; ask for dof = 3")
    declared = (*declared, *named_effects(vehicle.actuators, vehicle.rpm_ref))
    kernel = load_kernel(kernel_spec(vehicle, dof), tuple(Declared(e) for e in declared))
    _check_effects(vehicle, kernel, (*CATALOGUE, *declared))
    nominal = _nominal(vehicle, kernel)
    nominal.setflags(write=False)
    without = missing_actuators(vehicle)
    idle = {e.name for e in CATALOGUE if e.needs in without}
    kernel = replace(kernel, effects=tuple(e for e in kernel.effects if e.name not in idle))
    return Model(vehicle, dof, kernel, nominal)


def _check_effects(vehicle: Vehicle, kernel: Kernel, known: Iterable[Effect]) -> None:
    """Refuse effects of the vehicle file that nobody declares; what acts in 6-DOF only is no matter in 3."""
    keys = {e.key(p.name) for e in known for p in e.parameters} | set(kernel.parameters)
    problems = []
    for name in vehicle.effects:
        if name not in keys:
            near = difflib.get_close_matches(name, keys, n=2, cutoff=0.5)
            problems.append(f"{name}" + (f" (did you mean {', '.join(near)}?)" if near else ""))
    if problems:
        raise ModelError(
            f"vehicle {vehicle.name!r}: nobody declares {', '.join(problems)} of [effects]; "
            "`bayesid effect list` names those of the catalogue, --effects FILE adds others"
        )


def kernel_spec(vehicle: Vehicle, dof: int) -> KernelSpec:
    """Which equations a vehicle needs."""
    eta = {t.name for t in TERMS if t.group == "eta"}
    return KernelSpec(
        dof=dof,
        propulsion=vehicle.propulsion.model if vehicle.propulsion.model in ("kt", "mmg") else "quadratic",
        sections=vehicle.crossflow.sections if vehicle.crossflow else 0,
        eta=any(name in eta for name in vehicle.coef),
        air=vehicle.areas_stated and vehicle.propulsion.model != "mmg",
        named=tuple(a.shape for a in vehicle.actuators),
    )


def without_effects(model: Model, names: Iterable[str]) -> Model:
    """The same model and parameters, some effects no longer on offer: a towing tank has no wind.

    What the vehicle file, or a logged wind, has acting goes on acting.

    Raises
    ------
    ModelError
        for a name that is no effect of the model; says which come near
    """
    names = tuple(names)
    for name in names:
        if name not in model.effects:
            near = difflib.get_close_matches(name, model.effects, n=3, cutoff=0.5)
            raise ModelError(f"no effect {name!r}" + (f"; did you mean {', '.join(near)}?" if near else ""))
    kept = tuple(e for e in model.kernel.effects if e.name not in names)
    gone = tuple(e for e in model.kernel.effects if e.name in names)
    return replace(model, kernel=replace(model.kernel, effects=kept), withheld=(*model.withheld, *gone))


def _centre_of_buoyancy(vehicle: Vehicle) -> tuple[float, float, float]:
    """Of a planar set below or above the centre of gravity: it floats level, whatever its file says."""
    return (*vehicle.r_G[:2], vehicle.r_B[2]) if vehicle.planar_only else vehicle.r_B


def _nominal(vehicle: Vehicle, kernel: Kernel) -> np.ndarray:
    coef = coef_si(vehicle)
    rpm = vehicle.rpm_ref or 1.0
    try:
        speed = self_propulsion_speed(vehicle, rpm)
    except VehicleError:
        speed = vehicle.U_ref or 1.0
    diameter = vehicle.dimensions.get("diameter", 0.0) or (
        vehicle.crossflow.height if vehicle.crossflow else 0.1 * vehicle.L
    )
    values = {
        "m": vehicle.mass, "L": vehicle.L, "rho": vehicle.rho, "height": diameter,
        "rpm_ref": rpm, "U_ref": speed,
        "torque_ref": vehicle.propulsion.values.get("Q_ref", 0.0),
        "W": vehicle.W, "B": vehicle.B, "cross": 0.0 if vehicle.plain_abs else 1.0,
        "uc_per_rpm": vehicle.propulsion.values.get("uc_per_rpm", speed / rpm),
        "point_x": 0.0, "point_y": 0.0, "point_z": 0.0,
        **{n: getattr(vehicle, n) for n in ("Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz")},
        **dict(zip(("x_G", "y_G", "z_G"), vehicle.r_G, strict=True)),
        **dict(zip(("x_B", "y_B", "z_B"), _centre_of_buoyancy(vehicle), strict=True)),
    }  # fmt: skip
    for fin, letter in (("delta_r", "r"), ("delta_s", "s"), ("delta_b", "b")):
        values[f"inverse_rate_{letter}"] = 1.0 / min(vehicle.rates.get(fin, math.inf), _UNLIMITED_RATE)
        values[f"servo_lag_{letter}"] = 0.0
        values[f"limit_{letter}"] = min(vehicle.limits.get(fin, math.inf), _UNLIMITED_ANGLE)
    if vehicle.propulsion.model == "kt":
        p = vehicle.propulsion.values
        values |= {"Kt0": p["Kt0"], "kt_a": p["a"], "kt_b": p["b"], "w_p": p["w"], "t_p": p["t"], "D": p["D"]}
        values |= dict(zip(KT_TURNS, torque_curve(p), strict=True))  # read in six axes only
    if vehicle.propulsion.model == "mmg":
        values |= {name: vehicle.propulsion.values[name] for name in GEOMETRY}
    if kernel.spec.propulsion == "mmg" or kernel.spec.air:
        values |= {name: vehicle.dimensions.get(name, usual) for name, usual in AIR.items()}
    if vehicle.crossflow:
        values["strip_Y"] = 0.5 * vehicle.rho * vehicle.crossflow.Cdy * vehicle.crossflow.height
        values["strip_Z"] = 0.5 * vehicle.rho * vehicle.crossflow.Cdz * vehicle.crossflow.width
    for actuator in vehicle.actuators:
        values |= actuator.constants
    off = {e.key(p.name): p.off for e in kernel.effects for p in e.parameters} | vehicle.effects
    out = np.array([values.get(n, off.get(n, coef.get(n, 0.0))) for n in kernel.parameters], dtype=float)
    if not np.all(np.isfinite(out)):
        bad = [n for n, v in zip(kernel.parameters, out, strict=True) if not math.isfinite(v)]
        raise ModelError(f"vehicle {vehicle.name!r}: {', '.join(bad)} not finite; a prime row needs U_ref")
    return out
