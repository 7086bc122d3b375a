"""Sizes of effects under the names a report tells them by, and back under those a simulation takes.

Takes values. Wind is told as speed and direction and simulated by its components; all others have one name.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence

import numpy as np

from bayesid.diagnosis.plain_words import Z95
from bayesid.diagnosis.result_parts import Value
from bayesid.equations.model import Model
from bayesid.model.effects.declare import Effect, EffectParameter

UNTOLD = 0.99  # part of a prior sd that is left of a parameter the log says nothing of
WIND = ("blowing_north", "blowing_east")  # told as V_wind and from


def contract(
    name: str, values: dict[str, Value], assumed: Mapping[str, float] | None = None
) -> dict[str, Value]:
    """Parameters under the names of the contract: wind as speed and direction.

    The speed is as uncertain as the fit leaves it and as the constants assumed in the form make it
    (`assumed`, relative); where the wind comes from does not depend on them.
    """
    if name != "wind" or "blowing_north" not in values:
        return values
    n, e = values["blowing_north"], values["blowing_east"]
    speed = float(np.hypot(n.value, e.value))
    spread = float(np.hypot(n.sd, e.sd) / np.sqrt(2))
    came = float((np.arctan2(e.value, n.value) + np.pi) % (2 * np.pi))
    form = (assumed or {}).get("blowing_north", 0.0) * speed
    return {
        "V_wind": _speed(speed, float(np.hypot(spread, form))),
        "from": Value(came, min(spread / max(speed, 1e-9), np.pi), "rad"),
        **{key: value for key, value in values.items() if not key.startswith("blowing")},
    }


def _speed(value: float, sd: float) -> Value:
    """A speed, which is not below nought, nor is its interval."""
    reach = Z95 * sd
    return Value(value, sd, "m/s", 0.0, value + reach) if reach > value else Value(value, sd, "m/s")


def declared_sizes(name: str, values: Mapping[str, float]) -> dict[str, float]:
    """Sizes under the names a simulation takes, from those of the contract."""
    if name != "wind" or "V_wind" not in values:
        return dict(values)
    speed, came = values["V_wind"], values.get("from", 0.0)
    rest = {key: x for key, x in values.items() if key not in ("V_wind", "from")}
    return {"blowing_north": -speed * np.cos(came), "blowing_east": -speed * np.sin(came), **rest}


def meanings(parameters: Sequence[EffectParameter]) -> dict[str, str]:
    """What each size means, under the names of the contract too."""
    out = {p.name: p.about for p in parameters if p.about}
    if "blowing_north" in out:
        sd = next(p.assumed for p in parameters if p.name == "blowing_north")
        of = f"; areas are assumed, which alone leaves {100 * sd:.0f} % (1 sd)" if sd else ""
        out |= {"V_wind": f"speed of the mean wind that is not measured{of}", "from": "where it comes from"}
    return out


def said_of(effect: Effect, model: Model, told: Collection[str]) -> str:
    """The sentence of a declaration beside what the simulator, or the log, already has of the effect.

    Parameters
    ----------
    told : its parameters that the data tell: the areas of a wind only where one was measured
    """
    if not effect.says_over:
        return effect.says
    has = any(model.nominal[model.index[effect.key(p.name)]] != p.off for p in effect.parameters)
    more = in_sentence(effect, effect.says_over) - in_sentence(effect)
    return effect.says_over if has or more & set(told) else effect.says


def in_sentence(effect: Effect, says: str = "") -> frozenset[str]:
    """Parameters of a declaration that a sentence of it tells, its own where none is given, under the names a
    simulation takes.
    """
    places = " ".join(re.findall(r"\{[^{}]*\}", says or effect.says))
    told = {p.name for p in effect.parameters if re.search(rf"\b{re.escape(p.name)}\b", places)}
    return frozenset(told | (set(WIND) if "V_wind" in places else set()))
