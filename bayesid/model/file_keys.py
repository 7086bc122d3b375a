"""What a key of trial.toml or vehicle.toml may hold: one declaration for the reader and for its JSON Schema.

Takes: nothing. Gives `FileKey` and its schema. Does not: read files.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from bayesid.files import write_atomic

Kind = Literal["text", "flag", "number", "whole", "numbers", "texts", "table"]
_TYPES = {"text": "string", "flag": "boolean", "number": "number", "whole": "integer", "table": "object",
          "numbers": "array", "texts": "array"}  # fmt: skip
DIALECT = "https://json-schema.org/draft/2020-12/schema"


@dataclass(frozen=True)
class FileKey:
    """One key.

    Parameters
    ----------
    low, high : of a number, both allowed; above : of a number, itself not allowed
    choices : of a text
    length : of a list
    default : what the reader takes where the key is missing
    """

    kind: Kind
    meaning: str
    required: bool = False
    low: float | None = None
    high: float | None = None
    above: float | None = None
    choices: tuple[Any, ...] = ()
    length: int | None = None
    default: Any = None

    def schema(self) -> dict[str, Any]:
        out: dict[str, Any] = {"description": self.meaning, "type": _TYPES[self.kind]}
        if self.choices:
            out["enum"] = list(self.choices)
        for word, value in (
            ("minimum", self.low),
            ("maximum", self.high),
            ("exclusiveMinimum", self.above),
            ("default", self.default),
        ):
            if value is not None:
                out[word] = value
        if self.kind in ("numbers", "texts"):
            out["items"] = {"type": "number" if self.kind == "numbers" else "string"}
            if self.length is not None:
                out |= {"minItems": self.length, "maxItems": self.length}
        return out


def table_schema(
    keys: Mapping[str, FileKey], meaning: str = "", more: Mapping[str, Any] | None = None
) -> dict[str, Any]:
    """Schema of a table of these keys and no others; `more` are schemas of further keys."""
    return {
        **({"description": meaning} if meaning else {}),
        "type": "object",
        "properties": {**{name: key.schema() for name, key in keys.items()}, **(more or {})},
        "required": [name for name, key in keys.items() if key.required],
        "additionalProperties": False,
    }


def schema_text(schema: Mapping[str, Any]) -> str:
    """A schema as it is written."""
    return json.dumps(schema, indent=1, ensure_ascii=False) + "\n"


def write_beside(path: Path, text: str) -> str:
    """First line of a file whose schema now lies beside it (`#:schema` as by Taplo); one that is there
    already is not written again."""
    try:
        there = path.is_file() and path.read_text(encoding="utf-8") == text
    except (OSError, ValueError):
        there = False
    if not there:
        write_atomic(path, text)
    return f"#:schema ./{path.name}\n"
