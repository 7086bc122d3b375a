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

    found = _catalogue(effects, vehicle)
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

    known = {other: e for e in _catalogue(effects, vehicle) for other in (e.name, *e.aliases)}
    if name not in known:
        near = difflib.get_close_matches(name, known, n=3, cutoff=0.5)
        other = "" if vehicle else ", with --vehicle those of its actuators"
        hint = f"; did you mean {', '.join(near)}?" if near else f"; `bayesid effect list` names all{other}"
        raise ModelError(f"no effect {name!r}{hint}")
    effect = known[name]
    if as_json:
        print_json(_plain(effect))
        return
    print_text(describe(effect))
    key = effect.key(effect.parameters[0].name)
    whom = f"{vehicle} MANOEUVRE" if vehicle else "remus100 zigzag:10/10"
    print_text(f"\ntry it: bayesid simulate {whom} --set {key}=VALUE")


def _catalogue(path: Any, vehicle: str | None) -> tuple[Effect, ...]:
    from bayesid.api.inputs import declared_effects
    from bayesid.model.effects import CATALOGUE, catalogue_of
    from bayesid.model.effects.named import named_effects
    from bayesid.model.vehicles import load_vehicle

    if vehicle is None:
        return (*CATALOGUE, *declared_effects(path))
    found = load_vehicle(vehicle)
    of_its_own = named_effects(found.actuators, found.rpm_ref)
    return (*catalogue_of(found.propulsion.model == "mmg"), *of_its_own, *declared_effects(path))


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
