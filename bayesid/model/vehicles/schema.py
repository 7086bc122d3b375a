"""JSON Schema of vehicle.toml, from the tables its reader reads by.

Takes: nothing. Gives the schema as plain data. Does not: validate; what needs two numbers at once (a mass
matrix, a prime row without U_ref) only the reader finds.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

from bayesid.model.actuators import KINDS, NAMES
from bayesid.model.file_keys import DIALECT, schema_text, table_schema, write_beside
from bayesid.model.propulsion import MODELS
from bayesid.model.terms import TERMS
from bayesid.model.vehicles.reading import SECTIONS
from bayesid.model.vehicles.tables import CONTROL, CROSSFLOW, HEAD

FILE = "vehicle.schema.json"
_OTHER_SPELLING = r"^(param)?[XYZKMNxyzkmn].+$"


def vehicle_schema() -> dict[str, Any]:
    """Schema of a vehicle file of format 1."""
    sections = {
        "vehicle": table_schema(HEAD, "Particulars, SI."),
        "control": table_schema(CONTROL, "Limits and rates; a fin without one has none."),
        "propulsion": _propulsion(),
        "crossflow": table_schema(CROSSFLOW, "Strip drag on constant height and width."),
        "coef": _by_coefficient({"type": "number"}, "Coefficients, prime or SI as [vehicle] says."),
        "prior": _prior(),
        "validation": {"description": "Measured behaviour, kept as it is.", "type": "object"},
        "actuators": {
            "description": "Thrusters, waterjets and fins by name; the name is that of their columns.",
            "type": "object",
            "properties": {name: {"$ref": "#/$defs/actuator"} for name in NAMES},
            "additionalProperties": False,
        },
        "effects": {
            "description": "Effects of the catalogue that are part of the vehicle: name -> parameters [SI].",
            "type": "object",
            "additionalProperties": {
                "type": "object",
                "additionalProperties": {
                    "oneOf": [
                        {"type": "number"},
                        {
                            "type": "object",
                            "properties": {"value": {"type": "number"}, "sd": {"type": "number"}},
                            "required": ["value"],
                            "additionalProperties": False,
                        },
                    ]
                },
            },
        },
        "confidence": {
            "description": "How sure: word -> names of coefficients.",
            "type": "object",
            "additionalProperties": {"type": "array", "items": {"type": "string"}},
        },
        "sources": _by_coefficient({"type": "string"}, "Where a coefficient is from."),
    }
    return {
        "$schema": DIALECT,
        "title": "bayesid vehicle, format 1",
        "type": "object",
        "properties": {"format": {"const": 1}, **{name: sections[name] for name in SECTIONS}},
        "required": ["vehicle", "propulsion", "coef"],
        "additionalProperties": False,
        "$defs": {"actuator": _actuator()},
    }


@cache
def text() -> str:
    """The schema as it is written."""
    return schema_text(vehicle_schema())


def write_schema(folder: Path) -> str:
    """First line of a vehicle file in a folder that now holds the schema (`#:schema` as by Taplo)."""
    return write_beside(folder / FILE, text())


def _by_coefficient(value: dict[str, Any], meaning: str) -> dict[str, Any]:
    return {
        "description": meaning,
        "type": "object",
        "properties": {
            row.name: {**value, "description": row.about or f"{row.regressor} ({row.unit})"}
            for row in TERMS
            if row.group != "propulsion"
        },
        "patternProperties": {_OTHER_SPELLING: value},  # Yvv, Y_vabsv, ...: the reader knows many spellings
        "additionalProperties": False,
    }


def _propulsion() -> dict[str, Any]:
    branches = []
    for model in MODELS.values():
        numbers = {
            name: {
                "type": "number",
                "description": p.unit,
                **({"exclusiveMinimum": p.low} if p.low > -1e300 else {}),
                **({"exclusiveMaximum": p.high} if p.high < 1e300 else {}),
                **({"default": p.default} if p.default is not None else {}),
            }
            for name, p in model.parameters.items()
        }
        branches.append(
            {
                "description": model.equation,
                "properties": {"model": {"const": model.name}, **numbers},
                "required": [
                    "model",
                    *(n for n, p in model.parameters.items() if p.required and p.default is None),
                ],
                "additionalProperties": False,
            }
        )
    return {
        "description": "Thrust.",
        "type": "object",
        "properties": {"model": {"enum": list(MODELS)}},
        "required": ["model"],
        "oneOf": branches,
    }


def _actuator() -> dict[str, Any]:
    """One of the kinds; a table without `kind` is a thruster."""
    branches = []
    for word, kind in KINDS.items():
        one = table_schema(kind.keys, kind.meaning, {"kind": {"const": word}})
        branches.append({**one, "required": [*one["required"], *(["kind"] if word != "thruster" else [])]})
    return {"oneOf": branches}


def _prior() -> dict[str, Any]:
    share = {"type": "number", "minimum": 0.0, "maximum": 100.0}
    names = {"type": "array", "items": {"type": "string"}}
    rows = {"type": "array", "items": {"type": "array", "items": {"type": "number"}}}
    return {
        "description": "How far the true coefficients may be off, one sigma.",
        "type": "object",
        "properties": {
            "relative_sd": {"oneOf": [share, _by_coefficient(share, "sigma over |value|")]},
            "covariance": {
                "description": "a file beside this one, or names and rows of the matrix",
                "oneOf": [
                    {"type": "string"},
                    {
                        "type": "object",
                        "properties": {"names": names, "matrix": rows},
                        "required": ["names", "matrix"],
                        "additionalProperties": False,
                    },
                ],
            },
        },
        "additionalProperties": False,
    }
