"""JSON Schema of trial.toml, from the tables its reader reads by.

Takes: nothing. Gives the schema as plain data. Does not: validate; whether files are there only the reader
finds.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from functools import cache
from pathlib import Path
from typing import Any, get_args, get_origin, get_type_hints

from bayesid.model.channels import CHANNELS
from bayesid.model.file_keys import DIALECT, schema_text, table_schema, write_beside
from bayesid.trials import left_out
from bayesid.trials.correction import TEXTS, Correction
from bayesid.trials.left_out import LeftOut
from bayesid.trials.stated import ENVIRONMENT, KEYS, MAX_RUNS, RUN_KEYS

FILE = "trial.schema.json"  # beside trial.toml, so that an editor finds it wherever the folder goes


def trial_schema() -> dict[str, Any]:
    """Schema of a trial.toml of format 1."""
    measured = [c.name for c in CHANNELS if c.kind not in ("time", "command")]
    tables = {
        "noise": _by_channel(measured, {"type": "number", "exclusiveMinimum": 0.0}),
        "environment": table_schema(ENVIRONMENT),
        "columns": _by_channel([c.name for c in CHANNELS], {"type": "string"}),
        "corrections": _corrections(),
        "runs": {"type": "array", "items": table_schema(RUN_KEYS), "minItems": 1, "maxItems": MAX_RUNS},
    }
    about = {name: {"description": KEYS[name].meaning, **table} for name, table in tables.items()}
    plain = {name: key for name, key in KEYS.items() if name not in tables}
    schema = table_schema(plain, more=about)
    return {
        "$schema": DIALECT,
        "title": "bayesid trial, format 1",
        **schema,
        "required": [name for name, key in KEYS.items() if key.required],
    }


@cache
def text() -> str:
    """The schema as it is written."""
    return schema_text(trial_schema())


def write_schema(folder: Path) -> str:
    """First line of a trial.toml in a folder that now holds the schema (`#:schema` as by Taplo)."""
    return write_beside(folder / FILE, text())


def _by_channel(names: list[str], value: dict[str, Any]) -> dict[str, Any]:
    meaning = {c.name: f"{c.meaning} [{c.unit}]" for c in CHANNELS}
    any_unit = "|".join(names)
    return {
        "type": "object",
        "properties": {name: {**value, "description": meaning[name]} for name in names},
        "patternProperties": {rf"^({any_unit})\[[^\[\]]+\]$": value},
        "additionalProperties": False,
    }


def _corrections() -> dict[str, Any]:
    hints = get_type_hints(Correction)
    return {
        "type": "object",
        "properties": {
            item.name: {"enum": list(TEXTS[item.name])} if item.name in TEXTS else _of_type(hints[item.name])
            for item in fields(Correction)
        },
        "additionalProperties": False,
    }


def _of_type(kind: Any) -> dict[str, Any]:
    """Schema of the type of a field of `Correction`."""
    if kind in (str, bool, float):
        return {"type": {str: "string", bool: "boolean", float: "number"}[kind]}
    if kind is LeftOut:
        return left_out.schema()
    inner = get_args(kind)
    if get_origin(kind) is tuple and inner[-1] is Ellipsis:
        return {"type": "array", "items": _of_type(inner[0])}
    if get_origin(kind) is tuple:
        items = {"type": "array", "items": _of_type(inner[0])}
        return items | {"minItems": len(inner), "maxItems": len(inner)}
    if get_origin(kind) in (dict, Mapping):
        return {"type": "object", "additionalProperties": _of_type(inner[1])}
    raise TypeError(f"no schema for {kind}")
