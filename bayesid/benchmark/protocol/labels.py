"""Labels of a foreign plant turned into answers: what was planted, how much, and how plainly it shows.

Takes one label of a list as trial collections carry them. Gives an `Answer`. A parameter is converted where
contract and label mean the same quantity; what a maker states in a unit of his own is left out. Does not
read verdicts.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from bayesid.benchmark.protocol.answers import Answer, Cause
from bayesid.benchmark.protocol.cause_families import CATALOGUE_NAMES, family_of, name_of
from bayesid.benchmark.protocol.commitment import BlindError
from bayesid.benchmark.protocol.detectability import Detectability
from bayesid.errors import BayesidError
from bayesid.model.vehicles import Vehicle, load_vehicle

Label = Mapping[str, Any]
Convert = Callable[[Label, Vehicle], float]


def _same(key: str) -> Convert:
    return lambda label, vehicle: float(label[key])


def _degrees(key: str, times: float = 1.0) -> Convert:
    return lambda label, vehicle: times * math.radians(float(label[key]))


def _rate_excess(label: Label, vehicle: Vehicle) -> float:
    return 1.0 / math.radians(float(label["a_rate_deg_s"])) - 1.0 / vehicle.rates["delta_r"]


# Effect of the contract -> its parameter -> the label's value in SI. Drag of a line, compass deviation, strip
# drag and decay of thrust are stated in units of the maker and not compared.
CONVERTED: Mapping[str, Mapping[str, Convert]] = {
    "ocean_current": {"V_north": _same("cur_n"), "V_east": _same("cur_e")},
    "ocean_current_varying": {
        "V_north": _same("cur_n"), "V_east": _same("cur_e"),
        "dV_north": _same("cur_dn"), "dV_east": _same("cur_de"),
    },
    "rudder_offset": {"offset": _degrees("r_off_deg")},
    "rudder_effectiveness": {"loss": _same("r_loss")},
    "rudder_asymmetry": {"asymmetry": _same("r_asym")},
    "rudder_stall": {"inverse_stall_angle": _same("r_stallinv")},
    "actuator_lag": {"tau": _same("a_lag")},
    "actuator_dead_time": {"delay": _same("a_dead")},
    "actuator_rate_limit": {"inverse_rate_excess": _rate_excess},
    "actuator_backlash": {"half_width": _degrees("a_play_deg", 0.5)},  # the label states the whole play
    "thrust_loss": {"loss": _same("t_loss")},
    "hull_fouling": {"drag_increase": _same("foul")},
    "propeller_side_force": {"side_force": _same("p_side")},
    "cg_offset_x": {"x_G": _same("cg_x")},
    "ballast_mass": {
        "mass_fraction": lambda label, vehicle: float(label["bal_m"]) / vehicle.mass,
        "x": _same("bal_x"),
    },
    "added_mass_error": {"e_Y": _same("am_y"), "e_N": _same("am_n")},
    "fluid_memory": {"fraction": _same("mem_k"), "lag": _same("mem_len")},
    "heading_bias": {"bias": _degrees("s_psi_deg")},
    "gyro_scale": {"scale": _same("s_gyro")},
    "position_lever_arm": {"l_x": _same("s_lx"), "l_y": _same("s_ly")},
    "velocity_scale": {"scale": _same("s_dvl")},
    "velocity_misalignment": {"angle": _degrees("s_mis_deg")},
}  # fmt: skip
ALIASES: Mapping[str, Mapping[str, Convert]] = {"time_offset": {"delay": _same("s_off")}}


def parameters_of(effect: Label, vehicle: Vehicle | None) -> dict[str, float]:
    """Parameters of a labelled effect under the names of the contract, SI, where they can be compared."""
    name = str(effect["name"])
    table = ALIASES.get(name) or CONVERTED.get(name, {})
    if vehicle is None:
        return {}
    out = {}
    for parameter, convert in table.items():
        try:
            out[parameter] = convert(effect["params"], vehicle)
        except KeyError:  # the label does not state it
            continue
    return out


def answer_of_label(label: Label, path: Path) -> Answer:
    """One label as an answer; `path` is for messages.

    Noncentrality is the label's `delta_cost`: the fall of chi-square, with the noise of the trial, from a
    refit of the coefficients alone to one with the true effect. Share absorbed and nearest rival are unknown.

    Raises
    ------
    BlindError                 a field is missing or is something else; names the file and the bundle
    """
    try:
        return _answer(label)
    except (KeyError, TypeError, ValueError, AttributeError, ZeroDivisionError) as error:
        name = label.get("name", "?") if isinstance(label, Mapping) else "?"
        raise BlindError(
            f"{path.name}: the label of {name} cannot be read ({type(error).__name__}: {error})"
        ) from None


def _answer(label: Label) -> Answer:
    planted = [e for e in label["effects"] if e["name"] != "none"]
    outside = label["label"] == "outside"
    vehicle = _vehicle(str(label.get("vehicle", "")))
    detect, causes = label.get("detect") or {}, []
    each = detect.get("delta_cost_each") or {}
    for e in planted:
        cost = each.get(e["name"], detect.get("delta_cost"))
        shown = None
        if cost is not None:
            shown = Detectability(e["name"], max(float(cost), 0.0), math.nan, math.nan, "")
        variant = e.get("variant", "")
        other = "" if variant in ("", "none", e["name"]) else variant
        values = None if outside or other else parameters_of(e, vehicle)
        causes.append(
            Cause(name_of(e["name"]), other, float(e["params"].get("size", "nan")), values or None, shown)
        )
    factors = {
        "vehicle": str(label.get("vehicle", "")),
        "dof": "6" if label.get("six_dof") else "3",
        "sensors": str(label.get("channels", "")),
        "sea": "still" if not label.get("environment") else "moving",
        "campaign": "",
        "prior": str(label.get("prior_relative_sd", "")),
    }
    draws = label.get("coefficient_draw_relative") or {}
    return Answer(str(label["name"]), _kind(causes, outside), tuple(causes), factors, draws, "", label)


def _kind(causes: list[Cause], outside: bool) -> str:
    if outside:
        return "outside"
    if len(causes) > 1:
        return "two"
    known = {family_of(n) for n in (*CATALOGUE_NAMES, "coefficient_error")}
    if causes and causes[0].variant and family_of(causes[0].name) in known:
        return "variant"
    return "effect" if causes else "none"


def _vehicle(name: str) -> Vehicle | None:
    try:
        return load_vehicle(name)
    except BayesidError:
        return None
