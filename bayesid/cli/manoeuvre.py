"""`bayesid manoeuvre`: the manoeuvres that can be simulated, compared and designed with, by name."""

from __future__ import annotations

from bayesid.cli.options import Json, Verbose

COLUMNS = ("manoeuvre", "write", "options", "dof", "what it is")


def listing(as_json: Json = False, verbose: Verbose = False) -> None:
    """List the manoeuvres with their options; -v with the unit of each option."""
    from bayesid.cli.output import print_json, print_table, print_text
    from bayesid.manoeuvres.catalogue import REGISTRY

    if as_json:
        print_json({
            name: {
                "summary": entry.summary, "dof": entry.dof, "positional": entry.positional,
                "required": entry.required, "options": {k: kind for k, (kind, _) in entry.options.items()},
            }
            for name, entry in REGISTRY.items()
        })  # fmt: skip
        return
    rows = []
    for name, entry in REGISTRY.items():
        pattern = name + (
            ":" + "/".join(word.upper() for word in entry.positional) if entry.positional else ""
        )
        taken = [f"{k} [{kind}]" if verbose else k for k, (kind, _) in entry.options.items()]
        rows.append([name, pattern, ", ".join(taken), entry.dof, entry.summary])
    print_table(COLUMNS, rows)
    print_text(
        "\ndegrees, seconds, metres and rpm unless a unit is written: turn:20,approach=4LU,side=starboard"
    )
