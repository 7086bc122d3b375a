"""The catalogue of effects a nominal model may lack: every module beside this one that defines `EFFECTS`.

Adding an effect means adding one declaration to one of those modules (or one module).
"""

from __future__ import annotations

import importlib
import pkgutil

from bayesid.model.effects.declare import PORTS, Effect, EffectParameter, InputStage, State
from bayesid.model.effects.of_ships import SHIP_EFFECTS, WIND_ON_AREAS

__all__ = ["CATALOGUE", "PORTS", "Effect", "EffectParameter", "InputStage", "State", "catalogue_of"]


def _collect() -> tuple[Effect, ...]:
    found: list[Effect] = []
    for info in sorted(pkgutil.iter_modules(__path__), key=lambda i: i.name):
        found.extend(getattr(importlib.import_module(f"{__name__}.{info.name}"), "EFFECTS", ()))
    names = [e.name for e in found]
    if len(set(names)) != len(names):
        raise ValueError(f"effect declared twice: {sorted({n for n in names if names.count(n) > 1})}")
    return tuple(found)


CATALOGUE: tuple[Effect, ...] = _collect()


def catalogue_of(ship: bool, air: bool = False) -> tuple[Effect, ...]:
    """The catalogue of a vehicle; a ship by the MMG method has its own declarations of some effects, and any
    vehicle that states the areas the air pushes on (`air`) has its wind.

    The names stay: who asks for `wind` gets that of the vehicle.
    """
    own = {e.name: e for e in (SHIP_EFFECTS if ship else (WIND_ON_AREAS,) if air else ())}
    return tuple(own.get(e.name, e) for e in CATALOGUE)
