"""What an effect is, in words: equation, parameters, what was chosen, source, size.

Takes a declaration. Gives lines of text; every word and number of them is the declaration's. Does not print.
"""

from __future__ import annotations

import math

from bayesid.model.effects.alternatives import ALTERNATIVES, of
from bayesid.model.effects.declare import Effect
from bayesid.model.effects.shown import shown

_PORTS = {
    "input": "between command and actuator",
    "flow": "moving water",
    "force": "force on the hull",
    "sensor": "between state and reading",
}
_AS_FORM = {
    "also": "part of it where the equations lack a force that depends on the motion, else a cause",
    "only": "part of it, never a cause",
    "alone": "no part of it, and beside one no more than a rival of what it explains better",
}


def alternatives(effect: Effect) -> tuple[Effect, ...]:
    """Declarations that stand in for a catalogue effect in another form."""
    return tuple(other for other in ALTERNATIVES if of(other.name) == effect.name)


def equations(effect: Effect) -> tuple[str, ...]:
    """Lines "left side = formula" of everything the effect changes, in the symbols of `declare`."""
    lines = [f"velocity of the water, {k} = {text}" for k, text in effect.flow.items()]
    forces = {axis: shown(text) for axis, text in effect.force.items()}
    lines += [f"{axis} += {text}" for axis, text in forces.items() if text != "0"]
    lines += [f"d {s.name}/dt = {shown(s.rate)}, from {s.initial}" for s in effect.states]
    lines += [f"{name} becomes {text}" for name, text in effect.adjust.items()]
    for stage in effect.stages:
        held = f"the command of {stage.delay} ago" if stage.delay else stage.end
        lines.append(f"{stage.signal} becomes {held}")
    lines += [f"reading of {channel} = {text}" for channel, text in effect.sensor.items()]
    lines += [f"{', '.join(names)} read {delay} late" for delay, names in effect.sensor_delay.items()]
    return tuple(lines)


def describe(effect: Effect) -> str:
    """Text of one effect: name, family, equation, parameters with unit and prior, form, source, magnitude.

    Returns
    -------
    str : lines separated by newlines, plain text; formulas longer than 200 characters are cut, with "..."
    """
    also = f", also called {', '.join(effect.aliases)}" if effect.aliases else ""
    dof = ", six degrees of freedom only" if effect.dof == 6 else ", planar models only" * effect.planar
    lines = [f"{effect.name} ({_PORTS[effect.port]}; family {effect.family}{dof}{also})"]
    for p in effect.parameters:
        sides = ", never negative" if p.one_sided else ""
        scale = "" if p.scale == "1" else f" {p.scale}"
        off = f"; off at {p.off:g}"
        if math.isfinite(p.low) or math.isfinite(p.high):
            off += f"; this effect from {p.low:g} to {p.high:g}{scale}"
        lines.append(f"  {p.name} [{p.unit}]: {p.about}; prior {p.mean:g} +- {p.sd:.3g}{scale}{sides}{off}")
    lines += [f"  {line if len(line) <= 200 else line[:197] + '...'}" for line in equations(effect)]
    lines.append(f"  form: {effect.form}")
    if effect.as_form:
        lines.append(f"  model form: {_AS_FORM[effect.as_form]}")
    lines.append(f"  source: {effect.source}")
    lines.append(f"  magnitude: {effect.magnitude}")
    lines += [f"  other form: {other.name}. {other.form}" for other in alternatives(effect)]
    return "\n".join(lines)
