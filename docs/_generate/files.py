"""What files hold: channels, vehicles, propulsion models, fields of diagnosis.json. Reads no user file."""

from __future__ import annotations

from typing import Any

from _generate.markdown import code, plain, table
from bayesid.diagnosis.result import schema
from bayesid.model.channels import CHANNELS
from bayesid.model.propulsion import MODELS
from bayesid.model.vehicles import load_vehicle
from bayesid.model.vehicles.reading import SECTIONS, builtin_names
from bayesid.model.vehicles.tables import HEAD


def channels() -> str:
    """Names a CSV header may have."""
    return table(
        ("name", "unit inside", "kind", "meaning"),
        [[code(c.name), plain(c.unit), c.kind, plain(c.meaning)] for c in CHANNELS],
    )


def vehicles() -> str:
    """The built-in coefficient sets."""
    rows = []
    for name in builtin_names():
        v = load_vehicle(name)
        rows.append([code(name), plain(v.name), f"{v.L:g} m", str(len(v.coef)), plain(v.source)])
    return table(("name", "vehicle", "L", "coefficients", "source"), rows)


def propulsion() -> str:
    """Ways to state thrust."""
    rows = [
        [
            code(m.name), plain(m.equation),
            ", ".join(
                f"{code(k)} {plain(p.unit)}" + ("" if p.required else " (optional)")
                for k, p in m.parameters.items()
            ),
        ]
        for m in MODELS.values()
    ]  # fmt: skip
    return table(("model", "surge force", "numbers"), rows)


def coefficients_read() -> str:
    """Sections and keys the reader of vehicle files knows."""
    return (
        f"Sections: {', '.join(code(f'[{s}]') for s in SECTIONS)}.\n\n"
        f"Keys of `[vehicle]`: {', '.join(code(k) for k in HEAD)}."
    )


def _kind(part: dict[str, Any]) -> str:
    if "enum" in part:
        return "one of " + ", ".join(plain(v) for v in part["enum"])
    if part.get("type") == "array":
        return "list of " + _kind(part.get("items", {}))
    if part.get("type") == "object":
        more = part.get("additionalProperties")
        return "table of " + _kind(more) if isinstance(more, dict) else "table"
    kind = part.get("type", "any")
    return " or ".join(kind) if isinstance(kind, list) else str(kind)


def _below(part: dict[str, Any]) -> dict[str, Any]:
    """The part of a list or table whose own fields are worth listing."""
    while True:
        inner = part.get("items") or part.get("additionalProperties")
        if not isinstance(inner, dict) or "properties" in part:
            return part
        part = inner


def _tables(part: dict[str, Any], title: str, required: list[str]) -> list[str]:
    """A table of the fields of one object, then those of the objects within it, each under its own name."""
    rows, inner = [], []
    for name, field in part["properties"].items():
        below = _below(field)
        always = ", always there" if name in required else ""
        rows.append([code(name), f"*{_kind(field)}{always}.* {plain(field.get('description', ''))}"])
        if "properties" in below:
            mark = "[]" if field.get("type") == "array" else ".*" if "additionalProperties" in field else ""
            inner += _tables(below, f"{title}{'.' if title else ''}{name}{mark}", below.get("required", []))
    head = f"## {code(title)}" if title else "## Top level"
    return [head, table(("field", "what it holds"), rows), *inner]


def diagnosis_fields() -> str:
    """Every field of diagnosis.json, the nested ones under the path of what holds them."""
    found = schema()
    return "\n\n".join(_tables(found, "", found["required"]))
