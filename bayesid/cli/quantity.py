"""Quantities on the command line, with or without a unit: `0.3deg`, `500ms`, `5kn`, `20`.

Takes texts. Gives numbers in the unit used inside the program. A number without a unit is in the unit an
option names in its help.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable

import typer

_NUMBER = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(.*?)\s*")


def quantity(inside: str, bare: str | None = None, low: float | None = None) -> Callable[[str], float]:
    """Reader of one quantity for an option.

    Parameters
    ----------
    inside : unit of the number given back, e.g. "rad"
    bare : unit of a number written without one; by default `inside`
    low : least number allowed, in `inside`
    """

    def read(text: str) -> float:
        value = number_of(str(text), inside, bare)
        if low is not None and value < low:
            raise typer.BadParameter(f"{text} is less than {low:g} {inside}")
        return value

    return read


def number_of(text: str, inside: str, bare: str | None = None) -> float:
    """One quantity as a number in the unit `inside`.

    Raises
    ------
    typer.BadParameter
        not a finite number, or a unit that does not measure this
    """
    from bayesid.model.units import UnitError, scale

    found = _NUMBER.fullmatch(text)
    if found is None or not math.isfinite(float(found[1])):
        raise typer.BadParameter(f"{text!r} is not a number with or without a unit, such as 20 or 20{inside}")
    try:
        return float(found[1]) * scale(found[2] or bare or inside, inside, repr(text))
    except UnitError as error:
        raise typer.BadParameter(str(error)) from None


def noise_of(pairs: list[str] | None, option: str = "--noise") -> dict[str, float]:
    """CHANNEL=SIGMA[unit] texts as channel -> sigma [SI].

    Raises
    ------
    typer.BadParameter
        a channel that is not measured, or a unit that does not measure it
    """
    from bayesid.model.channels import MEASURED, channel, nearest_hint

    found = {}
    for name, text, _ in _split(pairs, option):
        if name not in MEASURED:
            raise typer.BadParameter(f"no channel {name} is measured{nearest_hint(name)}", param_hint=option)
        found[name] = number_of(text, channel(name).unit)
    return found


def changes_of(pairs: list[str] | None, option: str = "--set") -> dict[str, float | str]:
    """NAME=VALUE texts; a value with a unit stays text, for whoever knows what the name measures."""
    found: dict[str, float | str] = {}
    for name, text, _ in _split(pairs, option):
        try:
            found[name] = float(text)
        except ValueError:
            found[name] = text
    return found


def range_of(text: str | None, option: str) -> tuple[float, float] | None:
    """LOW:HIGH as two numbers; a single number stands for both."""
    if text is None:
        return None
    low, colon, high = text.partition(":")
    try:
        return float(low), float(high if colon else low)
    except ValueError:
        raise typer.BadParameter(f"{text!r} is not LOW:HIGH", param_hint=option) from None


def _split(pairs: list[str] | None, option: str) -> list[tuple[str, str, str]]:
    found = []
    for pair in pairs or ():
        name, _, text = pair.rpartition("=")
        if not name.strip() or not text.strip():
            raise typer.BadParameter(f"{pair!r} is not NAME=VALUE with a number", param_hint=option)
        found.append((name.strip(), text.strip(), pair))
    return found
