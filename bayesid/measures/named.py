"""The standard measures of a run, chosen by the words that describe its manoeuvre, as rows to print.

Takes arrays of a logged or simulated run. Does not guess: a run whose description names no standard
manoeuvre has no measures.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from bayesid.measures.pullout import pull_out
from bayesid.measures.turning import turning_circle
from bayesid.measures.zigzag import spiral, zigzag
from bayesid.model.notation import ORDER_TIMES

Rows = list[tuple[str, float, str]]
DEG = math.pi / 180


def named_measures(manoeuvre: str, t: np.ndarray, data: Mapping[str, np.ndarray]) -> list[dict[str, Any]]:
    """Measures of every standard manoeuvre that the description names.

    Parameters
    ----------
    manoeuvre : free text, e.g. "turning circle port 15, pull-out"
    t : (n,) array             time [s]
    data : channel -> (n,) array   SI; x, y, psi, delta_r (u, v, theta, delta_s where there are any);
        orders_t, since when the order of a sample is given [s], where that is known

    Returns
    -------
    list of dict    kind, rows (quantity, value, unit; angles in degrees), reasons (why a value is missing)
    """
    text = manoeuvre.lower().replace("-", "").replace(" ", "").replace("_", "")
    found: list[dict[str, Any]] = []
    for words, kind, function in KINDS:
        if any(word in text for word in words):
            if kind == "zig-zag" and ("vzigzag" in text or "verticalzigzag" in text):
                kind, function = "vertical zig-zag", _vertical_zigzag
            missing = [name for name in NEEDS[kind] if name not in data]
            rows: Rows = []
            reasons: Mapping[str, str] = {"all": f"not logged: {', '.join(missing)}"}
            if not missing:
                rows, reasons = function(t, data)
            found.append({"kind": kind, "rows": rows, "reasons": dict(reasons)})
    return found


def _turn(t: np.ndarray, data: Mapping[str, np.ndarray]) -> tuple[Rows, Mapping[str, str]]:
    m = turning_circle(t, data["x"], data["y"], data["psi"], data["delta_r"], data.get("u"), data.get("v"))
    rows: Rows = [
        ("rudder", m.rudder / DEG, "deg"),
        ("approach speed", m.approach_speed, "m/s"),
        ("advance", m.advance, "m"),
        ("transfer", m.transfer, "m"),
        ("tactical diameter", m.tactical_diameter, "m"),
        ("steady diameter", m.steady_diameter, "m"),
        ("steady yaw rate", m.steady_yaw_rate / DEG, "deg/s"),
        ("drift angle", m.drift_angle / DEG, "deg"),
        ("speed loss", 100 * m.speed_loss, "%"),
    ]
    return rows, m.reasons


def _zigzag_rows(m: Any, fin: str = "rudder") -> Rows:
    rows: Rows = [(fin, m.rudder / DEG, "deg"), ("switch", m.switch / DEG, "deg")]
    rows += [(f"overshoot {k}", value / DEG, "deg") for k, value in enumerate(m.overshoots, 1)]
    rows += [
        ("initial turning time", m.initial_turning_time, "s"),
        ("initial turning distance", m.initial_turning_distance, "m"),
        ("reach", m.reach, "s"),
        ("period", m.period, "s"),
    ]
    return rows


def _zigzag(t: np.ndarray, data: Mapping[str, np.ndarray]) -> tuple[Rows, Mapping[str, str]]:
    m = zigzag(t, data["psi"], data["delta_r"], data.get("x"), data.get("y"), data.get(ORDER_TIMES))
    return _zigzag_rows(m), m.reasons


def _vertical_zigzag(t: np.ndarray, data: Mapping[str, np.ndarray]) -> tuple[Rows, Mapping[str, str]]:
    m = zigzag(t, data["theta"], data["delta_s"], orders_t=data.get(ORDER_TIMES))
    rows = [row for row in _zigzag_rows(m, "stern plane") if row[0] != "initial turning distance"]
    reasons = {k: why for k, why in m.reasons.items() if k != "initial_turning_distance"}
    for of_course, upright in _UPRIGHT_WORDS:
        reasons = {k: why.replace(of_course, upright) for k, why in reasons.items()}
    return rows, reasons


def _pull_out(t: np.ndarray, data: Mapping[str, np.ndarray]) -> tuple[Rows, Mapping[str, str]]:
    m = pull_out(t, data["psi"], data["delta_r"])
    rows: Rows = [
        ("yaw rate in the turn", m.turning_rate / DEG, "deg/s"),
        ("yaw rate that remains", m.residual_rate / DEG, "deg/s"),
    ]
    return rows, m.reasons


def _dieudonne(t: np.ndarray, data: Mapping[str, np.ndarray]) -> tuple[Rows, Mapping[str, str]]:
    m = spiral(t, data["psi"], data["delta_r"], shortest=float(t[-1] - t[0]) / 60)
    rows: Rows = [("loop width", m.loop_width / DEG, "deg"), ("loop height", m.loop_height / DEG, "deg/s")]
    return rows, m.reasons


# words of a reason about course and rudder, in the vertical plane
_UPRIGHT_WORDS = (
    ("rudder", "stern plane"),
    ("headings", "pitch angles"),
    ("heading", "pitch"),
    ("the base course", "that"),
)
Measure = Callable[[np.ndarray, Mapping[str, np.ndarray]], tuple[Rows, Mapping[str, str]]]
KINDS: tuple[tuple[tuple[str, ...], str, Measure], ...] = (
    (("zigzag",), "zig-zag", _zigzag),
    (("turn",), "turning circle", _turn),
    (("pullout",), "pull-out", _pull_out),
    (("dieudonn", "spiral"), "spiral", _dieudonne),
)
NEEDS = {
    "zig-zag": ("psi", "delta_r"),
    "vertical zig-zag": ("theta", "delta_s"),
    "turning circle": ("x", "y", "psi", "delta_r"),
    "pull-out": ("psi", "delta_r"),
    "spiral": ("psi", "delta_r"),
}
