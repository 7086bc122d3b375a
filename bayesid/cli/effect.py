"""`bayesid effect`: the unmodelled effects a diagnosis can name, and what each of them is."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from bayesid.cli.choices import Effects
from bayesid.cli.options import Json, Verbose

if TYPE_CHECKING:
    from bayesid.effects import Effect

Name = Annotated[
    str, typer.Argument(help="Name of an effect, or another name it goes by.", show_default=False)
]
LIST_COLUMNS = ("effect", "acts on", "family", "dof", "parameters [unit]")


def listing(effects: Effects = None, as_json: Json = False, verbose: Verbose = False) -> None:
    """List the effects of the catalogue."""
    from bayesid.cli.output import say_json, say_table

    found = _catalogue(effects)
    if as_json:
        say_json({e.name: _plain(e) for e in found})
        return
    rows = [[e.name, e.port, e.family, e.dof, ", ".join(_parameters(e))] for e in found]
    say_table(LIST_COLUMNS, rows)


def show(name: Name, effects: Effects = None, as_json: Json = False, verbose: Verbose = False) -> None:
    """Show an effect: parameters, usual size, equation and source."""
    import difflib

    from bayesid.cli.output import say, say_json, say_table
    from bayesid.errors import ModelError

    known = {other: e for e in _catalogue(effects) for other in (e.name, *e.aliases)}
    if name not in known:
        near = difflib.get_close_matches(name, known, n=3, cutoff=0.5)
        hint = f"; did you mean {', '.join(near)}?" if near else "; `bayesid effect list` names all"
        raise ModelError(f"no effect {name!r}{hint}")
    effect = known[name]
    if as_json:
        say_json(_plain(effect))
        return
    say(f"{effect.name}: acts on the {effect.port}, family {effect.family}, from {effect.dof}-DOF models on")
    if effect.aliases:
        say(f"also called {', '.join(effect.aliases)}")
    say(f"usual size: {effect.magnitude}\n")
    rows = [[p.name, p.unit, p.off, f"{p.sd:g} x {p.scale}", p.about] for p in effect.parameters]
    say_table(("parameter", "unit", "off value", "prior sd", "meaning"), rows)
    say()
    for key, text in _equation(effect).items():
        say(f"  {key}: {text}")
    say(f"\nsource: {effect.source}")
    say(f"try it: bayesid simulate remus100 zigzag:10/10 --set {effect.key(effect.parameters[0].name)}=VALUE")


def _catalogue(path: Any) -> tuple[Effect, ...]:
    from bayesid.api.inputs import declared_effects
    from bayesid.effects import CATALOGUE

    every = CATALOGUE.values() if hasattr(CATALOGUE, "values") else CATALOGUE
    return (*every, *declared_effects(path))


def _parameters(effect: Effect) -> list[str]:
    return [f"{p.name} [{p.unit}]" for p in effect.parameters]


def _equation(effect: Effect) -> dict[str, str]:
    """Every formula of the declaration, by what it changes."""
    found: dict[str, str] = {}
    found |= {f"water velocity {key}": text for key, text in effect.flow.items()}
    found |= {f"force {key}": text for key, text in effect.force.items()}
    found |= {f"state {s.name}": f"rate {s.rate}, from {s.initial}" for s in effect.states}
    found |= {f"constant {key}": text for key, text in effect.adjust.items()}
    for stage in effect.stages:
        text = f"delayed by {stage.delay}" if stage.delay else f"end of step {stage.end}, mean {stage.mean}"
        found[f"actuator {stage.signal}"] = text
    found |= {f"reading {key}": text for key, text in effect.sensor.items()}
    found |= {f"reading {', '.join(v)}": f"delayed by {key}" for key, v in effect.sensor_delay.items()}
    return found


def _plain(effect: Effect) -> dict[str, Any]:
    return {
        "family": effect.family, "port": effect.port, "dof": effect.dof, "aliases": effect.aliases,
        "usual_size": effect.magnitude, "source": effect.source, "equation": _equation(effect),
        "parameters": {
            p.name: {
                "unit": p.unit, "off": p.off, "prior_sd": p.sd, "prior_sd_in": p.scale, "meaning": p.about
            }
            for p in effect.parameters
        },
    }  # fmt: skip
