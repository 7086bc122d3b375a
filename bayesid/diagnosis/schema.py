"""JSON Schema of a frozen dataclass, from its types and from what is said of its fields.

Takes a dataclass whose fields are plain values, mappings, tuples and other such dataclasses. Gives the schema
as plain data, and the data itself. Does not validate.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import MISSING, dataclass, field, fields, is_dataclass
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

NAMES = {str: "string", int: "integer", float: "number", bool: "boolean", NoneType: "null"}


@dataclass(frozen=True)
class About:
    """What a field means, and what else the schema may check, e.g. {"minimum": 0}."""

    text: str = ""
    checks: Mapping[str, Any] = field(default_factory=dict)


def described(kind: Any) -> dict[str, Any]:
    """Schema of a type hint or dataclass. What has a default is not required."""
    if get_origin(kind) is Annotated:
        inner, *notes = get_args(kind)
        out = described(inner)
        for note in notes:
            if isinstance(note, About):
                out |= dict(note.checks) | ({"description": note.text} if note.text else {})
        return out
    if is_dataclass(kind):
        hints = get_type_hints(kind, include_extras=True)
        plain = [f for f in fields(kind) if "drawn" not in f.metadata]
        return {
            "type": "object",
            "required": [f.name for f in plain if f.default is MISSING and f.default_factory is MISSING],
            "properties": {f.name: described(hints[f.name]) for f in plain},
        }
    origin, arguments = get_origin(kind), get_args(kind)
    if origin is Literal:
        return {"enum": list(arguments)}
    if origin in (Union, UnionType):
        parts = [described(a) for a in arguments]
        return {k: v for part in parts for k, v in part.items()} | {"type": [p["type"] for p in parts]}
    if origin is tuple:
        return {"type": "array", "items": described(arguments[0])}
    if origin in (Mapping, dict):
        return {"type": "object", "additionalProperties": described(arguments[1])}
    return {"type": NAMES[kind]}


def plain(value: Any) -> Any:
    """Plain data of a dataclass of the kind `described` takes: dicts, lists, numbers, texts, None."""
    if is_dataclass(value):
        kept = [f.name for f in fields(value) if "drawn" not in f.metadata]
        return {name: plain(getattr(value, name)) for name in kept}
    if isinstance(value, Mapping):
        return {k: plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [plain(v) for v in value]
    return value
