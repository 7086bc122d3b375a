"""Propulsion: from the parameters a vehicle file states to the surge force and heeling moment they mean.

Takes: a model name and its numbers. Gives: the SI coefficients of the X_prop_* rows, or, for `kt`, a force.
Does not: know hull or shaft dynamics; n is the shaft speed [rpm], u the speed through the water.

One triple (a, b, c) holds over the whole range here; Gertler and Hagen's switch of triples by ranges of eta
is not covered, so a `polynomial` set is trustworthy near eta = 1 and ahead.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from bayesid.model.ship_forces import ship_forces
from bayesid.model.terms import TERMS

WHATEVER_J = 1e12  # advance ratio at which a torque vanishes that does not change with it
ROWS = tuple(row.name for row in TERMS if row.group == "propulsion")


@dataclass(frozen=True)
class PropulsionParameter:
    """One number of a model: its unit, the open interval it lies in, and a default if it may be missing."""

    unit: str
    low: float = -math.inf
    high: float = math.inf
    default: float | None = None
    required: bool = True


@dataclass(frozen=True)
class PropulsionModel:
    """One way to state thrust; `rows` turns (values, rho, L) into X_prop_* [SI], None for `kt` and `mmg`.

    With `holds_drag` the hull's drag is part of the model, so a drag row in [coef] would count it twice.
    """

    name: str
    equation: str
    parameters: Mapping[str, PropulsionParameter]
    source: str
    rows: Callable[[Mapping[str, float], float, float], dict[str, float]] | None
    holds_drag: bool = False


def _positive(unit: str, required: bool = True) -> PropulsionParameter:
    """A positive number far enough from 0 and infinity that its square can be divided by."""
    return PropulsionParameter(unit, 1e-9, 1e12, required=required)


_RPM_REF = _positive("rpm", required=False)


def _polynomial(values: Mapping[str, float], rho: float, length: float) -> dict[str, float]:
    scale, k = 0.5 * rho * length**2, values["uc_per_rpm"]
    return {
        "X_prop_u|u|": scale * values["a"],
        "X_prop_un": scale * values["b"] * k,
        "X_prop_n|n|": scale * values["c"] * k**2,
    }


def _nps(values: Mapping[str, float], rho: float, length: float) -> dict[str, float]:
    drag = 0.5 * rho * length**2 * values["Cd0"]
    return {"X_prop_u|u|": -drag, "X_prop_n|n|": drag * values["k"] ** 2}


MODELS: dict[str, PropulsionModel] = {
    model.name: model
    for model in (
        PropulsionModel(
            "polynomial",
            "X = rho/2 L^2 (a u|u| + b u u_c + c u_c|u_c|), u_c = uc_per_rpm n; holds the hull drag",
            {
                "a": PropulsionParameter("-"),
                "b": PropulsionParameter("-"),
                "c": PropulsionParameter("-"),
                "uc_per_rpm": _positive("m/s/rpm"),
                "rpm_ref": _RPM_REF,
            },
            "gertler1967",
            _polynomial,
            holds_drag=True,
        ),
        PropulsionModel(
            "thrust",
            "X = T_ref (n/rpm_ref) |n/rpm_ref|",
            {
                "T_ref": _positive("N"),
                "rpm_ref": _positive("rpm"),
                "Q_ref": PropulsionParameter("N m", required=False),
            },
            "prestero2001",
            lambda values, rho, length: {"X_prop_n|n|": values["T_ref"] / values["rpm_ref"] ** 2},
        ),
        PropulsionModel(
            "linear_thrust",
            "X = T_max n/rpm_max",
            {
                "T_max": _positive("N"),
                "rpm_max": _positive("rpm"),
                "rpm_ref": _RPM_REF,
            },
            "dasilva2007",
            lambda values, rho, length: {"X_prop_n": values["T_max"] / values["rpm_max"]},
        ),
        PropulsionModel(
            "nps",
            "X = rho/2 L^2 Cd0 (k^2 n|n| - u|u|); holds the hull drag",
            {
                "Cd0": _positive("-"),
                "k": _positive("m/s/rpm"),
                "rpm_ref": _RPM_REF,
            },
            "healey1993",
            _nps,
            holds_drag=True,
        ),
        PropulsionModel(
            "kt",
            "X = (1-t) rho n|n| D^4 Kt0 (1 - (J/a)^b), J = max(0, u (1-w)/(n D)), n in rev/s; 0 at n = 0; "
            "K = -rho n|n| D^5 Kq0 (1 - (J/Kq_a)^Kq_b), Kq0 < 0 if left-handed; without Kq_a whatever J",
            {
                "Kt0": _positive("-"),
                "a": _positive("-"),
                "b": _positive("-"),
                "w": PropulsionParameter("-", -1.0, 1.0, default=0.0),
                "t": PropulsionParameter("-", -1.0, 1.0, default=0.0),
                "D": _positive("m"),
                "Kq0": PropulsionParameter("-", -1.0, 1.0, required=False),
                "Kq_a": _positive("-", required=False),
                "Kq_b": _positive("-", required=False),
                "rpm_ref": _RPM_REF,
            },
            "yasukawa2015",
            None,
        ),
        PropulsionModel(
            "mmg",
            "X = (1-t_P) rho D_P^2 (k_0 n|n| D_P^2 + k_1 u_P |n| D_P + k_2 u_P|u_P|), n in rev/s, "
            "and the rudder in its race; numbers in [coef]",
            {
                "D_P": _positive("m"),
                "H_R": _positive("m"),
                "A_R": _positive("m^2"),
                "x_R": PropulsionParameter("-", -1.0, 1.0, default=-0.5),
                "rpm_ref": _RPM_REF,
            },
            "yasukawa2015",
            None,
        ),
        PropulsionModel(
            "quadratic",
            "X = X_prop_u|u| u|u| + X_prop_un u n + X_prop_n|n| n|n| + X_prop_n n; SI, as a fit leaves it",
            {
                **{name: PropulsionParameter("SI", default=0.0) for name in ROWS},
                "rpm_ref": _RPM_REF,
            },
            "assumed: the general form of all models above but kt",
            lambda values, rho, length: {name: values[name] for name in ROWS},
        ),
    )
}


def propulsion_problems(model: str, values: Mapping[str, float]) -> dict[str, str]:
    """What is wrong with a set of finite numbers: parameter -> sentence."""
    found = {}
    for name, parameter in MODELS[model].parameters.items():
        if name not in values:
            if parameter.required and parameter.default is None:
                found[name] = f"{name} [{parameter.unit}] is missing for model {model!r}"
        elif not parameter.low < values[name] < parameter.high:
            found[name] = (
                f"{name} = {values[name]:g} must lie between {parameter.low:g} and {parameter.high:g}"
            )
    alone = [name for name in ("Kq_a", "Kq_b") if name in values and "Kq0" not in values]
    for name in alone:
        found.setdefault(name, f"{name} shapes a torque that is not stated: give Kq0 too")
    return found


def with_defaults(model: str, values: Mapping[str, float]) -> dict[str, float]:
    """The numbers in the order of the model, its defaults filled in."""
    filled = {
        name: values.get(name, parameter.default) for name, parameter in MODELS[model].parameters.items()
    }
    return {name: float(value) for name, value in filled.items() if value is not None}


def propulsion_rows(model: str, values: Mapping[str, float], rho: float, length: float) -> dict[str, float]:
    """SI values of all four X_prop_* rows (N per (m/s)^2, (m/s) rpm, rpm^2, rpm); all 0 for `kt`, `mmg`."""
    rows = MODELS[model].rows
    return dict.fromkeys(ROWS, 0.0) | (rows(values, rho, length) if rows else {})


def propulsion_force(
    model: str, values: Mapping[str, float], rho: float, length: float, u: ArrayLike, n: ArrayLike
) -> np.ndarray:
    """Surge force [N] at speed u [m/s] through the water and shaft speed n [rpm]; u and n broadcast.

    For `mmg`, `values` hold the numbers of [coef] beside those of [propulsion].
    """
    u, n = np.broadcast_arrays(np.asarray(u, dtype=float), np.asarray(n, dtype=float))
    if model == "kt":
        rps, advance = _advance(values, u, n)
        thrust_coefficient = values["Kt0"] * (1.0 - (advance / values["a"]) ** values["b"])
        return (1.0 - values["t"]) * rho * rps * np.abs(rps) * values["D"] ** 4 * thrust_coefficient
    if model == "mmg":
        usual = {"U_ref": 1.0, **values, "rho": rho, "L": length}
        return ship_forces(usual, u, n=n)["propeller X"]
    c = propulsion_rows(model, values, rho, length)
    drag = c["X_prop_u|u|"] * u * np.abs(u) + c["X_prop_un"] * u * n
    return drag + c["X_prop_n|n|"] * n * np.abs(n) + c["X_prop_n"] * n


def torque_curve(values: Mapping[str, float]) -> tuple[float, float, float]:
    """Kq0, Kq_a and Kq_b of a `kt` propeller: 0 without a torque, the same at every J without Kq_a."""
    return values.get("Kq0", 0.0), values.get("Kq_a", WHATEVER_J), values.get("Kq_b", 1.0)


def propeller_moment(
    model: str, values: Mapping[str, float], rho: float, u: ArrayLike, n: ArrayLike
) -> np.ndarray:
    """Heeling moment of the propeller on the hull [N m] at speed u [m/s] through the water and shaft speed n
    [rpm], as `Kq0` or `Q_ref` states it, else 0; u and n broadcast.
    """
    u, n = np.broadcast_arrays(np.asarray(u, dtype=float), np.asarray(n, dtype=float))
    if model != "kt":
        return values.get("Q_ref", 0.0) * n * np.abs(n) / values.get("rpm_ref", 1.0) ** 2
    rps, advance = _advance(values, u, n)
    at_rest, zero, power = torque_curve(values)
    coefficient = at_rest * (1.0 - (advance / zero) ** power)
    return -rho * rps * np.abs(rps) * values["D"] ** 5 * coefficient


def _advance(values: Mapping[str, float], u: np.ndarray, n: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Revolutions [rev/s] and advance ratio of a `kt` propeller, not below 0."""
    rps = n / 60.0
    turning = np.where(rps == 0.0, 1.0, rps)
    return rps, np.maximum(0.0, u * (1.0 - values["w"]) / (turning * values["D"]))
