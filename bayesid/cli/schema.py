"""`bayesid schema`: the JSON Schemas of trial.toml and vehicle.toml, for editors and other programs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from bayesid.cli.options import Verbose

Kind = Annotated[str, typer.Argument(metavar="trial|vehicle", help="Which file.", show_default=False)]
Target = Annotated[
    Path | None, typer.Option("--out", "-o", help="File to write; default: the screen.", dir_okay=False)
]


def schema(kind: Kind, out: Target = None, verbose: Verbose = False) -> None:
    """Print the JSON Schema of trial.toml or vehicle.toml.

    Files written by `trial import`, `vehicle new` and `start` name it in their first line (#:schema), so
    that an editor with a TOML language server (Even Better TOML, Taplo) completes keys and marks what the
    reader refuses.
    """
    import json

    from bayesid.errors import BayesidError
    from bayesid.files import write_atomic
    from bayesid.model.vehicles.schema import vehicle_schema
    from bayesid.trials.schema import trial_schema

    made = {"trial": trial_schema, "vehicle": vehicle_schema}
    if kind not in made:
        raise BayesidError(f"{kind!r} has no schema; one of trial, vehicle")
    text = json.dumps(made[kind](), indent=1, ensure_ascii=False) + "\n"
    if out is None:
        print(text, end="")
    else:
        write_atomic(out, text)
