"""A manoeuvre in words that somebody can order: angles in degrees, band in Hz, times in s, revolutions.

Takes a manoeuvre. Gives text. Does not simulate; what is not in its parameters it does not say.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from bayesid.manoeuvres.core import Manoeuvre

Parameters = Mapping[str, Any]


def _degrees(angle: float) -> str:
    return f"{math.degrees(abs(angle)):.3g}"


def _side(angle: float) -> str:
    return "port" if angle > 0 else "starboard"


def _both_ways(name: str) -> Callable[[float], str]:
    return lambda angle: f"{name} up to {_degrees(angle)} degrees to either side"


def _several(values: tuple[float, ...]) -> str:
    return ", ".join(f"{v:.4g}" for v in values)


def _band(p: Parameters) -> str:
    return f"{p['f0']:.3g} to {p['f1']:.3g} Hz (periods of {1 / p['f0']:.3g} to {1 / p['f1']:.3g} s)"


def _shaft(p: Parameters) -> str:
    factors = tuple(p.get("rpm_factors", (1.0,)))
    turns = f" times {_several(factors)} in turn" if factors != (1.0,) else ""
    swing = f", swinging by {100 * p['rpm_swing']:.3g} %" if p.get("rpm_swing") else ""
    return f"shaft at {p['rpm']:.4g} rpm{turns}{swing}"


def _rudder(p: Parameters) -> str:
    if "period" in p or "f0" in p:  # it swings
        return _both_ways("rudder")(p["rudder"])
    return f"rudder {_degrees(p['rudder'])} degrees to {_side(p['rudder'])}"


def _ramp(p: Parameters) -> str:
    ends = [f"{_degrees(p[k])} degrees to {_side(p[k])}" for k in ("first", "last")]
    return f"rudder from {ends[0]} to {ends[1]}"


def _levels(p: Parameters) -> str:
    largest = max(p["levels"], key=abs)
    return f"{len(p['levels'])} rudder angles up to {_degrees(largest)} degrees to either side"


# what a parameter says, in the order in which it is said; a parameter that is not here is not told
SAYS: dict[str, Callable[[Parameters], str]] = {
    "amplitude": lambda p: _both_ways("rudder")(p["amplitude"]),
    "rudder": _rudder,
    "plane": lambda p: _both_ways("planes")(p["plane"]),
    "first": _ramp,
    "levels": _levels,
    "first side": lambda p: f"{p['name']} first {p['first side']}",
    "f0": _band,
    "period": lambda p: f"period of {p['period']:.3g} s",
    "clock": lambda p: f"may change every {p['clock']:.3g} s",
    "shortest": lambda p: f"each angle held for {p['shortest']:.3g} to {p['longest']:.3g} s",
    "turning": lambda p: f"held for {p['turning']:.3g} s, then midships",
    "change": lambda p: f"depth changed by {p['change']:.3g} m",
    "rpms": lambda p: f"shaft at {_several(p['rpms'])} rpm",
    "hold": lambda p: f"each held for {p['hold']:.3g} s",
    "rpm": _shaft,
}


def order_words(manoeuvre: Manoeuvre) -> str:
    """What is ordered, e.g. "rudder up to 10 degrees to either side, 0.01 to 0.2 Hz (periods of 100 to 5 s),
    shaft at 1500 rpm"."""
    p = {**manoeuvre.parameters, "name": manoeuvre.name}
    said = ", ".join(say(p) for key, say in SAYS.items() if key in p)
    shaft = getattr(manoeuvre, "commands", {}).get("n_cmd")
    return f"{said}, then stopped" if shaft is not None and shaft[-1] == 0.0 else said
