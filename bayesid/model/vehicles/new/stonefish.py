"""Stonefish scenarios: geometry, mass, propellers and rudders; there are no hydrodynamic coefficients in
them.

Takes: the root of the XML. Gives the entries of a data sheet. Does not: read meshes.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from typing import Any

from bayesid.errors import VehicleError


def read_stonefish(root: ET.Element, name: str) -> dict[str, Any]:
    """Keys of a data sheet (`sheet.KEYS`) and its fins, as far as the file has them.

    Raises
    ------
    VehicleError
        if it holds no robot
    """
    robot = root if root.tag == "robot" else next(iter(root.iter("robot")), None)
    if robot is None:
        raise VehicleError(f"{name}: holds no <robot>; give the scenario of one vehicle")
    found: dict[str, Any] = {"name": robot.get("name", name)}
    base = robot.find("base_link")
    bodies = [base, *base.iter("external_part")] if base is not None else []
    sizes = [_size(body) for body in bodies if body is not None]
    long = max((size for size in sizes if size), key=lambda s: s[0], default=None)
    if long is not None:
        found |= {"length": long[0], "breadth": long[1], "height": long[2]}
    masses = [
        float(m.get("value", "nan")) for body in bodies if body is not None for m in body.findall("mass")
    ]
    if masses and math.isfinite(total := sum(masses)):
        found["mass"] = total
    water = next(iter(root.iter("water")), None)
    if water is not None and water.get("density"):
        found["rho"] = float(water.get("density", "1025"))
    fins = []
    for actuator in robot.iter("actuator"):
        specs = actuator.find("specs")
        kind = actuator.get("type", "")
        if kind in ("thruster", "propeller", "simple_thruster") and "propeller_diameter" not in found:
            propeller = actuator.find("propeller")
            if propeller is not None and propeller.get("diameter"):
                found["propeller_diameter"] = float(propeller.get("diameter", "0"))
        elif kind == "rudder" and specs is not None and specs.get("area") and "length" in found:
            origin = actuator.find("origin")
            x = float((origin.get("xyz", "0 0 0") if origin is not None else "0 0 0").split()[0])
            roll = float((origin.get("rpy", "0 0 0") if origin is not None else "0 0 0").split()[0])
            kind = "rudder" if abs(math.cos(roll)) > 0.7 else "stern_plane"
            at = min(max(0.5 * found["length"] - x, 0.0), found["length"])
            fins.append({"kind": kind, "area": float(specs.get("area", "0")), "aspect_ratio": 1.5,
                         "from_nose": at, "count": 1})  # fmt: skip
    if fins:
        found["fins"] = fins
    return found


def _size(body: ET.Element) -> tuple[float, float, float] | None:
    """(length, breadth, height) [m] of a parametric solid; None of a mesh."""
    dimensions = body.find("dimensions")
    if dimensions is None:
        return None
    if xyz := dimensions.get("xyz"):
        x, y, z = (float(word) for word in xyz.split())
        return x, y, z
    radius = float(dimensions.get("radius", "0"))
    height = float(dimensions.get("height", str(2.0 * radius)))
    return max(height, 2.0 * radius), 2.0 * radius, 2.0 * radius
