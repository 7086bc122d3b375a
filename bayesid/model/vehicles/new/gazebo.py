"""Gazebo files: UUV simulator and DAVE (Fossen matrices in SDF, URDF, xacro or YAML), gz-sim's
Hydrodynamics plugin.

Takes: one or more files. Gives a `Stated`. Does not: run xacro, or follow includes.

Axes of Gazebo's bodies are forward-port-up. UUV simulator turns its matrices into forward-starboard-down
itself; the numbers of gz-sim are turned here. Both write derivatives: damping is negative. What is left out
is noted.
"""

from __future__ import annotations

import math
import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from bayesid.errors import VehicleError
from bayesid.model.notation import AXES, VELOCITY
from bayesid.model.terms import TERMS
from bayesid.model.vehicles.new.simulator_build import Stated, StatedFin

TURN = np.array([1.0, -1.0, -1.0, 1.0, -1.0, -1.0])  # forward-port-up to forward-starboard-down
ROWS = frozenset(row.name for row in TERMS)
LARGEST = 20_000_000  # bytes
_GZ = re.compile(r"([xyzkmn])(Dot)?([UVWPQR])(?:abs)?([UVWPQR])?")
_PROPERTY = re.compile(r"\$\{\s*([A-Za-z_]\w*)\s*\}")


def parse_xml(path: Path) -> ET.Element:
    """Root of an XML file, `${name}` replaced where a xacro:property of the file is a plain number.

    Raises
    ------
    VehicleError
        if it cannot be read or is no XML
    """
    try:
        if path.stat().st_size > LARGEST:
            raise VehicleError(f"{path}: larger than {LARGEST} bytes, so it describes no vehicle")
        text = path.read_text(encoding="utf-8", errors="replace")
    except OSError as error:
        raise VehicleError(f"{path}: cannot be read ({error.strerror})") from None
    known = dict(re.findall(r'<xacro:property\s+name="(\w+)"\s+value="([^"$]*)"', text))
    text = _PROPERTY.sub(lambda found: known.get(found[1], found[0]), text)
    try:
        return ET.fromstring(text.encode())
    except ET.ParseError as error:
        raise VehicleError(f"{path}: not valid XML: {error}") from None


def read_gazebo(roots: Sequence[ET.Element], name: str) -> Stated:
    """What the files state together.

    Raises
    ------
    VehicleError
        if none holds a Fossen model or a Hydrodynamics plugin, or a matrix has not 6 or 36 numbers
    """
    stated = Stated(name, "")
    for root in roots:
        _inertial(root, stated)
        for element in root.iter("hydrodynamic_model"):
            _fossen(element, stated)
            stated.source = "UUV simulator or DAVE, Fossen model"
        for plugin in root.iter("plugin"):
            named = (plugin.get("filename", "") + plugin.get("name", "")).lower()
            if "hydrodynamics" in named and any(_GZ.fullmatch(child.tag) for child in plugin):
                _hydrodynamics(plugin, stated)
                stated.source = "gz-sim, Hydrodynamics plugin"
        _boxes(root, stated)
    if not stated.source:
        raise VehicleError(
            f"{name}: holds neither <hydrodynamic_model> (UUV simulator) nor a Hydrodynamics plugin (gz-sim)"
        )
    for root in roots:
        _actuators(root, stated)
    stated.source += f", read by `bayesid vehicle new` from {name}"
    return stated


def read_uuv_parameters(tree: dict[str, Any], name: str) -> Stated:
    """What the vehicle parameters of UUV simulator's controllers (YAML) state."""
    stated = Stated(name, f"UUV simulator, vehicle parameters, read by `bayesid vehicle new` from {name}")
    matrices = {}
    for key, own in (("added_mass", "Ma"), ("linear_damping", ""), ("linear_damping_forward_speed", ""),
                     ("quad_damping", "quadratic_damping")):  # fmt: skip
        value = tree.get(own, tree.get(key))
        if value is not None:
            matrices[key] = _matrix(np.ravel(np.array(value, dtype=float)).tolist(), key, name)
    _set_fossen(stated, matrices.get("added_mass"), matrices.get("linear_damping"),
                matrices.get("linear_damping_forward_speed"), matrices.get("quad_damping"))  # fmt: skip
    stated.rho = float(tree.get("density", stated.rho))
    for key, attribute in (
        ("length", "length"),
        ("width", "breadth"),
        ("height", "height"),
        ("mass", "mass"),
    ):
        if key in tree:
            setattr(stated, attribute, float(tree[key]))
    inertial = tree.get("inertial", {})
    if {"ixx", "iyy", "izz"} <= set(inertial):
        # the tensor in forward-port-up, as in `_inertial`
        products = [sign * float(inertial.get(k, 0.0)) for k, sign in (("ixy", 1), ("ixz", 1), ("iyz", -1))]
        stated.inertia = (*(float(inertial[k]) for k in ("ixx", "iyy", "izz")), *products)
    for key in ("cog", "cob"):
        if key in tree:
            x, y, z = (float(v) for v in tree[key])
            setattr(stated, key, (x, -y, -z))
    return stated


def _numbers(text: str | None, what: str) -> list[float]:
    try:
        return [float(word) for word in (text or "").replace(",", " ").split()]
    except ValueError:
        shown = " ".join((text or "").split())[:40]
        raise VehicleError(f"{what} is {shown!r}, not numbers; run xacro on the file first") from None


def _matrix(values: Sequence[float], what: str, where: str) -> np.ndarray:
    if len(values) == 36:
        return np.array(values).reshape(6, 6)
    if len(values) == 6:
        return np.diag(values)
    raise VehicleError(f"{where}: {what} has {len(values)} numbers; 6 or 36 are needed")


def _fossen(element: ET.Element, stated: Stated) -> None:
    found = {}
    for key in ("added_mass", "linear_damping", "linear_damping_forward_speed", "quadratic_damping"):
        child = element.find(key)
        if child is not None and (values := _numbers(child.text, key)):
            found[key] = _matrix(values, key, stated.name)
    if (np.any(stated.added) and found) or not found:
        return  # further links are thrusters and sensors
    _set_fossen(stated, found.get("added_mass"), found.get("linear_damping"),
                found.get("linear_damping_forward_speed"), found.get("quadratic_damping"))  # fmt: skip


def _set_fossen(
    stated: Stated,
    added: np.ndarray | None,
    linear: np.ndarray | None,
    forward: np.ndarray | None,
    quadratic: np.ndarray | None,
) -> None:
    """Rows of tau = (D_lin + u D_forward + D_quad |nu|) nu; of D_quad the diagonal acts, as in the plugin."""
    left: list[str] = []
    if added is not None:
        stated.added = added
    for i, axis in enumerate(AXES):
        for j, velocity in enumerate(VELOCITY):
            entries = []
            if linear is not None:
                entries.append((f"{axis}_{velocity}0", linear[i, j]))
            if forward is not None:
                own = "X_u|u|" if (i, j) == (0, 0) else f"{axis}_{velocity}"
                entries.append((own, forward[i, j]))
            if quadratic is not None:
                entries.append((f"{axis}_{velocity}|{velocity}|" if i == j else "", quadratic[i, j]))
            for name, value in entries:
                if value == 0.0:
                    continue
                if name in ROWS:
                    stated.coef[name] = stated.coef.get(name, 0.0) + float(value)
                elif name:
                    left.append(f"{name} = {value:g}")
                else:
                    stated.notes.append(
                        f"Left out: quadratic damping of {axis} by {velocity} ({value:g}); the plugin "
                        "uses the "
                        "diagonal."
                    )
    if left:
        stated.notes.append(f"Left out, the force table has no such rows: {', '.join(left)}.")


def _hydrodynamics(plugin: ET.Element, stated: Stated) -> None:
    left = []
    for child in plugin:
        if child.tag in ("water_density", "waterDensity"):
            stated.rho = _numbers(child.text, child.tag)[0]
        if child.tag == "disable_coriolis" and (child.text or "").strip() in ("true", "1"):
            stated.coriolis = False
            stated.notes.append("The simulator adds no Coriolis force of the added mass (disable_coriolis).")
        found = _GZ.fullmatch(child.tag)
        if not found or not (values := _numbers(child.text, child.tag)) or values[0] == 0.0:
            continue
        axis, dot, first, second = found[1].upper(), found[2], found[3].lower(), (found[4] or "").lower()
        i, j = AXES.index(axis), VELOCITY.index(second or first)
        value = values[0] * TURN[i] * TURN[j]
        if dot:
            # signs of added mass differ between versions of the plugin; on the diagonal it is positive
            stated.added[i, j] = abs(value) if i == j else -value
            continue
        name = f"{axis}_{first}0" if not second else f"{axis}_{first}|{second}|"
        if second and first != second:
            name = next(
                (n for n in (f"{axis}_{second}|{first}|", f"{axis}_|{first}|{second}") if n in ROWS), name
            )
        if name in ROWS:
            stated.coef[name] = stated.coef.get(name, 0.0) + value
        else:
            left.append(f"{child.tag} = {values[0]:g}")
    if left:
        stated.notes.append(f"Left out, the force table has no such rows: {', '.join(left)}.")


def _inertial(root: ET.Element, stated: Stated) -> None:
    """Mass, centre and inertia of the heaviest link."""
    for inertial in root.iter("inertial"):
        mass = inertial.find("mass")
        if mass is None:
            continue
        values = _numbers(mass.get("value") or mass.text, "mass")
        if not values or values[0] <= (stated.mass or 0.0):
            continue
        stated.mass = values[0]
        place = inertial.find("origin")
        pose = inertial.find("pose")
        text = place.get("xyz") if place is not None else pose.text if pose is not None else None
        x, y, z = (*_numbers(text, "inertial pose"), 0.0, 0.0, 0.0)[:3]
        stated.cog = (x, -y, -z)
        tensor = inertial.find("inertia")
        if tensor is not None:

            def entry(key: str, tensor: ET.Element = tensor) -> float:
                child = tensor.find(key)
                numbers = _numbers(tensor.get(key) or (child.text if child is not None else "0"), key)
                return numbers[0] if numbers else 0.0

            # files hold the tensor (products are minus integrals); turning about x flips xy and xz
            stated.inertia = (
                entry("ixx"),
                entry("iyy"),
                entry("izz"),
                entry("ixy"),
                entry("ixz"),
                -entry("iyz"),
            )


def _boxes(root: ET.Element, stated: Stated) -> None:
    for parent in root.iter():
        box, volume = parent.find("box"), parent.find("volume")
        if box is not None and box.find("length") is not None and stated.length is None:
            for tag, attribute in (("length", "length"), ("width", "breadth"), ("height", "height")):
                child = box.find(tag)
                if child is not None and (values := _numbers(child.text, tag)):
                    setattr(stated, attribute, values[0])
        if volume is not None and stated.mass is None and (values := _numbers(volume.text, "volume")):
            stated.mass = values[0] * stated.rho
            stated.notes.append("The mass is that of the displaced water; the file states none.")
        centre = parent.find("center_of_buoyancy")
        if centre is not None and len(values := _numbers(centre.text, "center_of_buoyancy")) == 3:
            stated.cob = (values[0], -values[1], -values[2])
    density = next(iter(root.iter("fluid_density")), None)
    if density is not None and density.text and stated.source.startswith("UUV"):
        stated.rho = _numbers(density.text, "fluid_density")[0]


def _poses(root: ET.Element) -> Iterator[tuple[str, list[float]]]:
    """(name, x y z roll pitch yaw) of joints of URDF and of links of SDF."""
    for joint in root.iter("joint"):
        origin = joint.find("origin")
        if origin is not None:
            xyz, rpy = (
                _numbers(origin.get("xyz", "0 0 0"), "xyz"),
                _numbers(origin.get("rpy", "0 0 0"), "rpy"),
            )
            pose = [*xyz, *rpy]
            yield joint.get("name", ""), pose
            child = joint.find("child")
            if child is not None:
                yield child.get("link", child.text or ""), pose
    for link in root.iter("link"):
        at = link.find("pose")
        if at is not None and len(values := _numbers(at.text, "pose")) == 6:
            yield link.get("name", ""), values


def _actuators(root: ET.Element, stated: Stated) -> None:
    try:
        poses = dict(_poses(root))
    except VehicleError:
        poses = {}
    for plugin in root.iter("plugin"):
        kind = (plugin.get("filename", "") + " " + plugin.get("name", "")).lower()

        def text(tag: str, plugin: ET.Element = plugin) -> str | None:
            found = next(plugin.iter(tag), None)
            return found.text.strip() if found is not None and found.text else None

        try:
            if "thruster" in kind and (constant := text("rotorConstant")):
                stated.thrust = (stated.thrust or 0.0) + float(constant) * (2.0 * math.pi / 60.0) ** 2
            elif "thruster" in kind and (constant := text("thrust_coefficient")):
                diameter = float(text("propeller_diameter") or 0.02)
                rho = float(text("fluid_density") or 1000.0)
                stated.thrust = (stated.thrust or 0.0) + abs(float(constant)) * rho * diameter**4 / 3600.0
            elif "fin" in kind and (constant := text("lift_constant")):
                pose = poses.get(text("joint_name") or "", poses.get(text("link_name") or "", []))
                _fin(stated, float(constant), pose, None)
            elif "lift" in kind and "drag" in kind and text("cla") and text("area"):
                rho = float(text("air_density") or stated.rho)
                lift = 0.5 * rho * float(text("area") or 0.0) * float(text("cla") or 0.0)
                pose = poses.get(text("link_name") or "", [])
                _fin(stated, lift, pose, _numbers(text("upward"), "upward") or None)
        except ValueError:
            stated.notes.append(
                f"Left out: a {kind.split()[0]} whose numbers are expressions; run xacro first."
            )


def _fin(stated: Stated, lift: float, pose: list[float], upward: list[float] | None) -> None:
    if len(pose) != 6:
        stated.notes.append("Left out: a fin whose place the file does not say.")
        return
    if upward is not None and len(upward) == 3:
        vertical = abs(upward[1]) > abs(upward[2])
    else:  # UUV simulator: the fin stands up in its own axes
        vertical = abs(math.cos(pose[3])) > 0.7
    stated.fins.append(StatedFin("rudder" if vertical else "stern_plane", lift, pose[0]))
