"""`bayesid effect`: the unmodelled effects a diagnosis can name, and what each of them is."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from bayesid.cli.choices import Effects
from bayesid.cli.options import Json, Verbose

if TYPE_CHECKING:
    from bayesid.model.effects import Effect

Name = Annotated[
    str, typer.Argument(help="Name of an effect, or another name it goes by.", show_default=False)
]
OfVehicle = Annotated[
    str | None,
    typer.Option(
        "--vehicle", help="Those of this vehicle: with its named actuators, and a ship's own forms."
    ),
]
LIST_COLUMNS = ("effect", "acts on", "family", "dof", "parameters [unit]")


def listing(
    effects: Effects = None, vehicle: OfVehicle = None, as_json: Json = False, verbose: Verbose = False
) -> None:
    """List the effects of the catalogue."""
    from bayesid.cli.output import print_json, print_table

    every, idle = _catalogue(effects, vehicle)
    found = [e for e in every if e.name not in idle]
    if as_json:
        print_json({e.name: _plain(e) for e in found})
        return
    rows = [
        [e.name, e.port, e.family, "3 only" if e.planar else e.dof, ", ".join(_parameters(e))] for e in found
    ]
    print_table(LIST_COLUMNS, rows)


def show(
    name: Name,
    effects: Effects = None,
    vehicle: OfVehicle = None,
    as_json: Json = False,
    verbose: Verbose = False,
) -> None:
    """Show an effect: parameters, usual size, equation and source."""
    import difflib

    from bayesid.cli.output import print_json, print_text
    from bayesid.errors import ModelError
    from bayesid.model.effects.describe import describe

    every, idle = _catalogue(effects, vehicle)
    known = {other: e for e in every for other in (e.name, *e.aliases)}
    if name not in known:
        near = difflib.get_close_matches(name, known, n=3, cutoff=0.5)
        hint = f"; did you mean {', '.join(near)}?" if near else "; `bayesid effect list` names all"
        if not vehicle:
            hint += (
                " Effects of named actuators are those of a vehicle: add --vehicle FILE"
                if near
                else (", with --vehicle FILE those of its named actuators")
            )
        raise ModelError(f"no effect {name!r}{hint}")
    effect = known[name]
    if effect.name in idle:
        raise ModelError(
            f"effect {name!r} cannot act on {vehicle}, which {idle[effect.name]}; "
            f"`bayesid effect list --vehicle {vehicle}` names those that can"
        )
    if as_json:
        print_json(_plain(effect))
        return
    print_text(describe(effect))
    key = effect.key(effect.parameters[0].name)
    whom = f"{vehicle} MANOEUVRE" if vehicle else "remus100 zigzag:10/10"
    print_text(f"\ntry it: bayesid simulate {whom} --set {key}=VALUE")


def _catalogue(path: Any, vehicle: str | None) -> tuple[tuple[Effect, ...], dict[str, str]]:
    """The effects, and which of them cannot act on the vehicle: name -> what it lacks."""
    from bayesid.api.inputs import declared_effects
    from bayesid.model.effects import CATALOGUE, catalogue_of
    from bayesid.model.effects.named import named_effects
    from bayesid.model.vehicles import load_vehicle
    from bayesid.model.vehicles.orders import missing_actuators

    if vehicle is None:
        return (*CATALOGUE, *declared_effects(path)), {}
    found = load_vehicle(vehicle)
    common = catalogue_of(found.propulsion.model == "mmg", found.areas_stated)
    missing = missing_actuators(found)
    idle = {e.name: "moves in the plane only" for e in common if found.planar_only and not e.acts_in(3)}
    idle |= {e.name: f"has no {e.needs}" for e in common if e.needs in missing}
    return (*common, *named_effects(found.actuators, found.rpm_ref), *declared_effects(path)), idle


def _parameters(effect: Effect) -> list[str]:
    return [f"{p.name} [{p.unit}]" for p in effect.parameters]


def _plain(effect: Effect) -> dict[str, Any]:
    from bayesid.model.effects.describe import equations

    return {
        "family": effect.family, "port": effect.port, "dof": effect.dof, "aliases": effect.aliases,
        "usual_size": effect.magnitude, "source": effect.source, "form": effect.form,
        "equations": equations(effect),
        "parameters": {
            p.name: {
                "unit": p.unit, "off": p.off, "prior_sd": p.sd, "prior_sd_in": p.scale, "meaning": p.about
            }
            for p in effect.parameters
        },
    }  # fmt: skip
