"""The vehicle of a public simulator's file, whichever it is.

Takes: files and numbers that override or complete them. Gives a `NewVehicle`. Does not: know a format itself.
"""

from __future__ import annotations

import json
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from bayesid.errors import VehicleError
from bayesid.model.vehicles.new.estimate import estimate
from bayesid.model.vehicles.new.gazebo import parse_xml, read_gazebo, read_uuv_parameters
from bayesid.model.vehicles.new.new_vehicle import NewVehicle
from bayesid.model.vehicles.new.python_simulator import read_python_simulator
from bayesid.model.vehicles.new.sheet import sheet_of
from bayesid.model.vehicles.new.simulator_build import Stated, build
from bayesid.model.vehicles.new.stonefish import read_stonefish

_OWN = ("length", "mass", "speed", "rpm", "rho")


def from_simulator(paths: Sequence[Path], also: Mapping[str, float] | None = None) -> NewVehicle:
    """Vehicle from files of UUV simulator or DAVE (.sdf .urdf .xacro .yaml), gz-sim (.sdf), Stonefish (.scn
    .xml) or the Python Vehicle Simulator (.json .toml).

    Parameters
    ----------
    also : numbers of a data sheet (`sheet.KEYS`) that the files lack or have wrong

    Raises
    ------
    VehicleError
        if no file is of such a simulator, or a number is missing; says which and how to give it
    """
    name = " and ".join(path.name for path in paths)
    try:
        return _read(paths, name, dict(also or {}))
    except (ValueError, TypeError, IndexError, OverflowError, ZeroDivisionError) as error:
        raise VehicleError(f"{name}: a number or matrix cannot be read: {error}") from None


def _read(paths: Sequence[Path], name: str, also: dict[str, float]) -> NewVehicle:
    trees = [path for path in paths if path.suffix.lower() in (".json", ".toml", ".yaml", ".yml")]
    if trees:
        tree = {key: value for path in trees for key, value in _tree(path).items()}
        if "diam" in tree or "MRB" in tree:
            return build(_with(read_python_simulator(tree, name), also))
        for key in ("hydrodynamic_model", "vehicle"):  # some nest it
            tree = {**tree, **tree[key]} if isinstance(tree.get(key), dict) else tree
        if not {"Ma", "added_mass"} & set(tree):
            raise VehicleError(
                f"{name}: holds neither Ma (UUV simulator) nor diam (Python Vehicle Simulator); it has "
                f"{', '.join(list(tree)[:12])}"
            )
        return build(_with(read_uuv_parameters(tree, name), also))
    roots = [parse_xml(path) for path in paths]
    if any(root.tag == "scenario" or next(root.iter("base_link"), None) is not None for root in roots):
        entries = {**read_stonefish(roots[0], name), **also}
        try:
            made = estimate(sheet_of(entries, name))
        except VehicleError as error:
            raise VehicleError(
                f"{error}\nStonefish computes forces from geometry and states no coefficients; found here: "
                f"{', '.join(k for k in entries if k != 'name') or 'nothing'}. Give the rest as "
                "options or in a "
                "data sheet (bayesid vehicle new --template)."
            ) from None
        note = "From geometry alone: Stonefish computes forces of meshes and states no coefficients."
        return NewVehicle(made.vehicle, made.comments, (note, *made.notes))
    return build(_with(read_gazebo(roots, name), also))


def _with(stated: Stated, also: Mapping[str, float]) -> Stated:
    for key in _OWN:
        if key in also:
            setattr(stated, key, also[key])
    if "diameter" in also:
        stated.breadth = stated.height = also["diameter"]
    return stated


def _tree(path: Path) -> dict[str, Any]:
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise VehicleError(f"{path}: cannot be read ({error})") from None
    try:
        if path.suffix.lower() == ".json":
            tree = json.loads(text)
        elif path.suffix.lower() == ".toml":
            tree = tomllib.loads(text)
        else:
            tree = _yaml(text)
    except ValueError as error:
        raise VehicleError(f"{path}: cannot be read: {error}") from None
    if not isinstance(tree, dict):
        raise VehicleError(f"{path}: holds no table of parameters")
    return tree


def _yaml(text: str) -> Any:
    try:
        import yaml
    except ModuleNotFoundError:
        raise VehicleError("YAML needs PyYAML; install it with: pip install 'bayesid[simulators]'") from None
    try:
        return yaml.safe_load(text)
    except yaml.YAMLError as error:
        raise ValueError(" ".join(str(error).split())) from None
