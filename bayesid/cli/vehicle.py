"""`bayesid vehicle`: the built-in sets, and what stands in a vehicle file."""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING, Annotated, Any

import typer

from bayesid.cli.choices import VehicleName
from bayesid.cli.options import Json, Verbose
from bayesid.words import and_list

if TYPE_CHECKING:
    from bayesid.model.vehicles import Vehicle

Axes = Annotated[str, typer.Argument(metavar="[axes]", help="Letters of axes, e.g. XYN.")]


def listing(as_json: Json = False, verbose: Verbose = False) -> None:
    """List the built-in vehicles."""
    from bayesid.cli.output import print_json, print_table
    from bayesid.model.vehicles import builtin_names, load_vehicle

    vehicles = {name: load_vehicle(name) for name in builtin_names()}
    if as_json:
        print_json({name: _head(vehicle) for name, vehicle in vehicles.items()})
        return
    print_table(
        ["vehicle", "L [m]", "mass [kg]", "dof", "coefficients", "propulsion", "source"],
        [
            [
                name,
                v.L,
                v.mass,
                3 if v.planar_only else 6,
                len(v.coef),
                v.propulsion.model,
                v.source if verbose else _short(v.source),
            ]
            for name, v in vehicles.items()
        ],
    )


def show(vehicle: VehicleName, as_json: Json = False, verbose: Verbose = False) -> None:
    """Show a vehicle: particulars, limits and coefficients, prime and SI."""
    from bayesid.cli.output import print_json, print_table, print_text
    from bayesid.model.vehicles import load_vehicle
    from bayesid.model.vehicles.orders import has_propeller
    from bayesid.report import coefficient_cells

    found = load_vehicle(vehicle)
    rows = _coefficient_rows(found)
    if as_json:
        print_json({**_head(found), "actuators": _actuator_rows(found), "coefficients": rows})
        return
    print_text(f"{found.name}\n{found.source}\n")
    shaft = "usual speed of the shaft [rpm]"
    by_thrusters = bool(found.thrusters) and not has_propeller(found)
    renamed = {shaft: "usual speed of the thrusters [rpm]"} if by_thrusters else {}
    head = {renamed.get(k, k): value for k, value in _head(found).items() if k not in ("name", "source")}
    width = max(map(len, head))
    for key, value in head.items():
        print_text(f"{key.ljust(width)}  {_plain(value)}")
    print_text()
    if found.actuators:
        by_name = [[r["name"], r["kind"], ", ".join(r["columns"]), _plain(r["numbers"])]
                   for r in _actuator_rows(found)]  # fmt: skip
        print_table(["actuator", "kind", "columns (or with _cmd)", "numbers as in the file"], by_name)
        print_text()
    columns = ["coefficient", *coefficient_cells.COLUMNS, "prior sd [%]", "regressor"]
    keys = ["name", "prime", "si", "unit", "prior_sd_percent", "regressor"]
    if verbose:
        columns, keys = [*columns, "source of the term"], [*keys, "source"]
    print_table(columns, [[row[key] for key in keys] for row in rows])
    if said := _convention(found, {row["name"] for row in rows}):
        print_text(f"\n{said}")


def _convention(vehicle: Vehicle, shown: Collection[str]) -> str:
    """One sentence on rows that hold what the convention of the file leaves out; "" where there are none."""
    from bayesid.report.writer.blocks import cell_text

    both = [
        f"{name} {cell_text(vehicle.coef[name])} ({cell_text(value)} in the file)"
        for name, value in vehicle.in_file.items()
        if name in shown
    ]
    new = [name for name in vehicle.completed if name in shown]
    if not both and not new:
        return ""
    alone = f"{and_list(new)} {'is' if len(new) == 1 else 'are'} that part alone" if new else ""
    return (
        "The file is in Fossen's convention; rows here hold the part of the added mass too (Munk, Coriolis): "
        + "; ".join([*both, *([alone] if alone else [])])
        + "."
    )


def terms(axes: Axes = "XYZKMN", as_json: Json = False, verbose: Verbose = False) -> None:
    """Print the force table: every coefficient a vehicle file may state, and what it multiplies.

    AXES are letters, e.g. XYN. Numbers of an MMG ship, which are no rows, come last, by their axis.
    """
    from bayesid.cli.output import print_json, print_table, print_text
    from bayesid.errors import VehicleError
    from bayesid.model.terms import TERMS

    axes = axes.upper()
    if unknown := sorted(set(axes) - set("XYZKMN")):
        raise VehicleError(f"there is no axis {', '.join(unknown)}: X, Y, Z (forces), K, M, N (moments)")
    rows = [
        {
            "name": t.name, "axis": t.axis, "multiplies": t.regressor, "unit": t.unit,
            "length_power": t.length_power, "velocity_power": t.velocity_power, "group": t.group,
            "source": t.source, "about": t.about, "row": not t.is_number,
        }
        for t in sorted(TERMS, key=lambda t: (t.is_number, "XYZKMN".find(t.axis)))
        if t.axis in axes
    ]  # fmt: skip
    if as_json:
        print_json(rows)
        return
    print_table(
        ["coefficient", "multiplies (SI, radians)", "SI unit", "prime", *(["source"] if verbose else [])],
        [
            [
                r["name"], r["multiplies"], r["unit"],
                f"L^{r['length_power']}"
                + ("" if r["velocity_power"] == 2 else f" U^{r['velocity_power']}"),
                *([r["source"]] if verbose else []),
            ]
            for r in rows
            if r["row"]
        ],
    )  # fmt: skip
    numbers = [[r["name"], r["about"], r["multiplies"]] for r in rows if not r["row"]]
    if numbers:
        print_text()
        print_table(["number of a ship (MMG)", "what it is", "acts in"], numbers)


def _actuator_rows(vehicle: Vehicle) -> list[dict[str, Any]]:
    """Actuators of [actuators.NAME]: kind, columns of a log, what the file states beyond the defaults."""
    from bayesid.model.channels import channel
    from bayesid.model.vehicles.tables import shaft_lag

    rows = []
    for a in vehicle.actuators:
        columns = [f"{s}[{channel(s).shown[1]}]" for s in a.signals]
        stated = {k: v for k, v in vars(a).items() if k in a.keys and v != a.keys[k].default}
        numbers = {
            k: " ".join(f"{x:.4g}" for x in v) if isinstance(v, tuple) else v for k, v in stated.items()
        }
        if lag := vehicle.effects.get(shaft_lag(a.name)):
            numbers["lag"] = lag
        rows.append({"name": a.name, "kind": a.kind, "columns": columns, "numbers": numbers})
    return rows


def _coefficient_rows(vehicle: Vehicle) -> list[dict[str, Any]]:
    from bayesid.model.terms import term
    from bayesid.model.vehicles import coef_si
    from bayesid.report import coefficient_cells

    si = coef_si(vehicle)
    spread = vehicle.prior.relative_sd if vehicle.prior else {}
    rows = []
    for name, value in si.items():
        row = term(name)
        if (value == 0.0 and name not in vehicle.coef) or (vehicle.planar_only and row.axis in "ZKM"):
            continue
        rows.append(
            {
                "name": name,
                "value": vehicle.coef.get(name),
                "prime": coefficient_cells.prime(vehicle, name, value),
                "si": value,
                "unit": row.unit,
                "prior_sd_percent": 100.0 * spread[name] if name in spread else None,
                "regressor": row.regressor,
                "source": row.source,
            }
        )
    return rows


def _head(vehicle: Vehicle) -> dict[str, Any]:
    """Particulars as plain data; angles in degrees where the key says so."""
    from math import degrees, isfinite

    return {
        "name": vehicle.name,
        "source": vehicle.source,
        "dof": 3 if vehicle.planar_only else 6,
        "units of the set": "prime system" if vehicle.nondimensional else "SI",
        "L [m]": vehicle.L,
        "mass [kg]": vehicle.mass,
        "rho [kg/m3]": vehicle.rho,
        "Ixx Iyy Izz [kg m2]": [vehicle.Ixx, vehicle.Iyy, vehicle.Izz],
        "centre of gravity [m]": list(vehicle.r_G),
        "centre of buoyancy [m]": list(vehicle.r_B),
        "weight, buoyancy [N]": [vehicle.W, vehicle.B],
        "largest angles [deg]": {fin: degrees(a) for fin, a in vehicle.limits.items() if isfinite(a)},
        "largest rates [deg/s]": {fin: degrees(a) for fin, a in vehicle.rates.items() if isfinite(a)},
        "cross-flow drag": _crossflow(vehicle),
        "propulsion": vehicle.propulsion.model,
        "usual speed of the shaft [rpm]": vehicle.rpm_ref,
        "digest": vehicle.digest,
    }


def _crossflow(vehicle: Vehicle) -> dict[str, float]:
    strips = vehicle.crossflow
    if strips is None:
        return {}
    upright = {} if vehicle.planar_only else {"Cdz": strips.Cdz, "width [m]": strips.width}
    return {"Cdy": strips.Cdy, "height [m]": strips.height, **upright, "sections": strips.sections}


def _plain(value: Any) -> str:
    from bayesid.report.writer.blocks import cell_text

    if isinstance(value, list):
        return "  ".join(cell_text(item) for item in value)
    if isinstance(value, dict):
        return ", ".join(f"{key} {cell_text(item)}" for key, item in value.items()) or "not stated"
    return cell_text(value)


def _short(text: str, length: int = 60) -> str:
    text = " ".join(text.split())
    return text if len(text) <= length else text[: length - 1].rsplit(" ", 1)[0] + "…"
