"""Sensor equations: from the state at a sample to the reading of every channel.

Takes the `Dynamics` under construction; fills its readings and delays.
"""

from __future__ import annotations

from bayesid.equations.derivatives import Node
from bayesid.equations.flow import Nodes, parse_effect
from bayesid.equations.formulas import LEVER
from bayesid.equations.layout import Dynamics
from bayesid.model.effects import Effect


def add_readings(
    dyn: Dynamics, effects: tuple[Effect, ...], const: Nodes, ground: Nodes, water: Nodes, time: Node
) -> None:
    """Fill `dyn.readings` and `dyn.delays`.

    Effects on one channel act one after the other; every other channel an effect names is the true state, so
    that a biased compass does not turn the lever arm of a position sensor.
    """
    g = dyn.graph
    true = {**ground, **{name: g.parse(text, {**const, **ground}) for name, text in LEVER.items()}}
    true |= {f"{k}_water": water[k] for k in "uvw"}
    reading = dict(true)
    for effect in effects:
        chained = {channel: reading[channel] for channel in effect.sensor}
        names = {**const, **true, **chained, "t": time}
        reading |= {c: parse_effect(g, effect, text, names) for c, text in effect.sensor.items()}
        for parameter, channels in effect.sensor_delay.items():
            for channel in channels:
                if channel in dyn.channels:
                    dyn.delays.setdefault(channel, []).append(effect.key(parameter))
    dyn.readings = {c: reading[c] for c in dyn.channels}
