"""`bayesid vehicle new`: a complete, commented vehicle file from a built-in one, a data sheet or a
simulator."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from bayesid.cli.options import Verbose

if TYPE_CHECKING:
    from bayesid.model.vehicles.new import NewVehicle


Target = Annotated[
    Path | None,
    typer.Argument(metavar="FILE", help="Vehicle file to write (.toml).", show_default=False),
]
Like = Annotated[
    str | None, typer.Option("--like", help="Built-in name or vehicle file to scale.", show_default=False)
]
SheetFile = Annotated[
    Path | None, typer.Option("--sheet", help="Data sheet (TOML); see --template.", show_default=False)
]
Simulator = Annotated[
    list[Path] | None,
    typer.Option(
        "--simulator",
        help="Parameters of a simulator: UUV simulator or DAVE (sdf, urdf, xacro, yaml), gz-sim (sdf), "
        "Stonefish (scn, xml), Python Vehicle Simulator (json, toml). May be given again for a further file.",
        show_default=False,
    ),
]
STOPS = ("rudder_max_deg", "plane_max_deg", "rate_deg_s")
TO_SCALE = ("length", "mass", "speed", "rho")  # numbers that another vehicle is scaled by
Fins = Annotated[
    str | None,
    typer.Option(help="Pair of fins: AREA,SPAN,FROM_NOSE of one [m2, m, m].", show_default=False),
]


def new(
    target: Target = None,
    like: Like = None,
    sheet: SheetFile = None,
    simulator: Simulator = None,
    length: Annotated[float | None, typer.Option(help="[m] over all.", show_default=False)] = None,
    diameter: Annotated[float | None, typer.Option(help="[m] of the hull.", show_default=False)] = None,
    mass: Annotated[
        float | None, typer.Option(help="[kg] with the water inside.", show_default=False)
    ] = None,
    speed: Annotated[
        float | None,
        typer.Option(help="[m/s] design speed; with --like default Froude's.", show_default=False),
    ] = None,
    rpm: Annotated[float | None, typer.Option(help="[rpm] at that speed.", show_default=False)] = None,
    propeller: Annotated[
        float | None, typer.Option(help="[m] diameter of the propeller.", show_default=False)
    ] = None,
    rho: Annotated[float | None, typer.Option(help="[kg/m3] of the water.", show_default=False)] = None,
    rudder: Fins = None,
    planes: Fins = None,
    rudder_max: Annotated[
        float | None, typer.Option(help="[deg] largest rudder angle.", show_default=False)
    ] = None,
    plane_max: Annotated[
        float | None, typer.Option(help="[deg] largest plane angle.", show_default=False)
    ] = None,
    rate: Annotated[
        float | None,
        typer.Option(help="[deg/s] largest rate of rudder and planes.", show_default=False),
    ] = None,
    name: Annotated[str | None, typer.Option(help="Name of the vehicle.", show_default=False)] = None,
    template: Annotated[
        bool, typer.Option("--template", help="Print a data sheet to fill in and stop.")
    ] = False,
    ship: Annotated[bool, typer.Option("--ship", help="With --template: the data sheet of a ship.")] = False,
    force: Annotated[bool, typer.Option("--force", help="Overwrite the file.")] = False,
    verbose: Verbose = False,
) -> int:
    """Make a vehicle file: scaled from another (--like), estimated from a data sheet, or read from a
    simulator.

    A data sheet that states a draught is that of a ship: it becomes a planar vehicle by the MMG method. Of a
    submerged vehicle the options alone will do: --length --diameter --mass --speed. Every coefficient is
    written with its source, [prior] with how far it may be off; what was assumed is said first. A
    coefficient is as good as the formulas are (docs: new vehicles); fits start from it.
    """
    import tomllib

    from bayesid.cli.output import command, print_text
    from bayesid.errors import VehicleError
    from bayesid.files import write_atomic
    from bayesid.model.vehicles.new import commented_toml, ship_template
    from bayesid.model.vehicles.new import template as template_text
    from bayesid.model.vehicles.reading import read_vehicle
    from bayesid.model.vehicles.schema import write_schema

    if template:
        print(ship_template() if ship else template_text(), end="")
        return 0
    if ship:
        raise VehicleError(
            "--ship goes with --template; a data sheet that states a draught is that of a ship: "
            "bayesid vehicle new --template --ship > my_ship.toml"
        )
    if target is None:
        raise VehicleError("FILE is missing: bayesid vehicle new my_vehicle.toml --sheet my_sheet.toml")
    if target.suffix != ".toml":
        raise VehicleError(f"{target}: a vehicle file ends in .toml")
    if target.exists() and not force:
        raise VehicleError(f"{target}: is there already; choose another name, or --force")
    numbers = {
        key: value
        for key, value in (
            ("length", length), ("diameter", diameter), ("mass", mass), ("speed", speed), ("rpm", rpm),
            ("propeller_diameter", propeller), ("rho", rho), ("rudder_max_deg", rudder_max),
            ("plane_max_deg", plane_max), ("rate_deg_s", rate),
        )
        if value is not None
    }  # fmt: skip
    if sum(bool(x) for x in (like, sheet, simulator)) > 1:
        raise VehicleError("give one of --like, --sheet and --simulator")
    made = _make(like, sheet, simulator, numbers, _fins(rudder, planes), name)
    text = commented_toml(made)
    read_vehicle(tomllib.loads(text), target.name, None)  # a simulator's numbers may describe no vehicle
    target.parent.mkdir(parents=True, exist_ok=True)
    write_atomic(target, write_schema(target.parent) + text)
    _say(target, made, verbose)
    print_text(f"\nNext: {command('vehicle', 'check', target)}")
    return 0


def _make(
    like: str | None,
    sheet: Path | None,
    simulator: list[Path] | None,
    numbers: dict[str, float],
    fins: list[dict[str, Any]],
    name: str | None,
) -> NewVehicle:
    from dataclasses import replace

    from bayesid.errors import VehicleError
    from bayesid.model.vehicles import load_vehicle
    from bayesid.model.vehicles.new import (
        ShipSheet,
        estimate,
        estimate_ship,
        from_simulator,
        read_sheet,
        scaled,
        sheet_of,
    )

    if like is not None:
        spare = [key for key in numbers if key not in TO_SCALE]
        if spare or fins:
            raise VehicleError(f"--like scales; it does not take {', '.join(spare) or 'fins'}")
        made = scaled(load_vehicle(like), **numbers, name=name)
    elif simulator:
        if fins:
            raise VehicleError(
                "--simulator takes its fins from the files; add others in a data sheet (--sheet)"
            )
        if stops := [key for key in STOPS if key in numbers]:
            raise VehicleError(
                f"--simulator does not take {', '.join(stops)}; write them into the file it makes"
            )
        made = from_simulator(simulator, numbers)
    elif sheet is not None:
        found = read_sheet(sheet, {**numbers, **({"fins": fins} if fins else {})})
        made = estimate_ship(found) if isinstance(found, ShipSheet) else estimate(found)
    else:
        entries: dict[str, Any] = {**numbers, "fins": fins}
        made = estimate(sheet_of(entries, "options"))
    return made if name is None else replace(made, vehicle=replace(made.vehicle, name=name))


def _fins(rudder: str | None, planes: str | None) -> list[dict[str, Any]]:
    from bayesid.errors import VehicleError

    found = []
    for kind, text in (("rudder", rudder), ("stern_plane", planes)):
        if text is None:
            continue
        try:
            area, span, from_nose = (float(word) for word in text.split(","))
        except ValueError:
            raise VehicleError(
                f"{text!r}: AREA,SPAN,FROM_NOSE are three numbers, e.g. 0.0067,0.086,1.25"
            ) from None
        found.append({"kind": kind, "area": area, "span": span, "from_nose": from_nose})
    return found


def _say(target: Path, made: NewVehicle, verbose: bool) -> None:
    """The notes, and how the vehicle behaves, on one screen."""
    from bayesid.cli.output import print_table, print_text
    from bayesid.errors import VehicleError
    from bayesid.model.vehicles import load_vehicle
    from bayesid.model.vehicles.check import check_vehicle
    from bayesid.model.vehicles.new import stable_share
    from bayesid.model.vehicles.orders import steers
    from bayesid.model.vehicles.stability import stability

    vehicle = load_vehicle(target)
    print_text(f"{vehicle.name} written to {target}: {len(vehicle.coef)} coefficients, L {vehicle.L:.4g} m, "
               f"{vehicle.mass:.4g} kg")  # fmt: skip
    for note in made.notes:
        print_text(f"  - {note}")
    try:
        straight = stability(vehicle)
        word = (
            "stable"
            if (straight.G_H or 0.0) > 0.0
            else "unstable: it turns by itself "
            + ("with the rudder amidships" if steers(vehicle) else "with equal thrusts to both sides")
        )
        share = stable_share(vehicle)
        odds = "" if share is None else f"; {100.0 * share:.0f} % of the vehicles within [prior] are stable"
        print_text(f"\nstraight run: {straight.U:.3g} m/s at {vehicle.rpm_ref:.4g} rpm, "
                   f"G_H = {straight.G_H or 0.0:.2f} ({word}{odds})")  # fmt: skip
    except VehicleError as error:
        print_text(f"\nstraight run: {error}")
    for finding in check_vehicle(vehicle):
        if finding.level == "warning":
            print_text(f"  - {finding.text}")
    if verbose:
        spread = vehicle.prior.relative_sd if vehicle.prior else {}
        print_text()
        print_table(
            ["coefficient", "value", "prior sd [%]", "from"],
            [
                [key, value, 100.0 * spread[key] if key in spread else None, made.comments.get(("coef", key))]
                for key, value in vehicle.coef.items()
            ],
        )
