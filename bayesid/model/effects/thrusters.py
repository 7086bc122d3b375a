"""What may be wrong with each thruster of a vehicle, by its name."""

from __future__ import annotations

from collections.abc import Iterable

from bayesid.model.effects.declare import Effect, EffectParameter, InputStage
from bayesid.model.thrusters import thrust, wrench

_WHERE = ("X", "N", "X+Y+N")


def thruster_effects(names: Iterable[str]) -> tuple[Effect, ...]:
    """Thrust beyond the stated, lag and dead time of every thruster, as `thruster_<name>_gain` and so on."""
    return tuple(effect for name in names for effect in (_gain(name), _lag(name), _late(name)))


def _gain(name: str) -> Effect:
    return Effect(
        name=f"thruster_{name}_gain",
        says=f"Thruster {name} gives {{share:%:more:less}} thrust than stated.",
        family=f"thruster_{name}",
        port="force",
        where=_WHERE,
        parameters=(EffectParameter("share", "-", 0.15, low=-1.0, about="thrust beyond that stated, share"),),
        force={axis: f"share*({thrust(name)})*{arm}" for axis, arm in wrench(name).items()},
        source="assumed: the whole curve scaled",
        magnitude="port and starboard of one type differ by 5-15 %",
        form="The same share ahead and astern, at every inflow.",
    )


def _lag(name: str) -> Effect:
    rest = "exp(-h/max(tau, 1e-12))"
    return Effect(
        name=f"thruster_{name}_lag",
        says=f"Thruster {name} follows its orders with a lag of {{tau:s}}.",
        family=f"thruster_{name}_timing",
        port="input",
        where=_WHERE,
        parameters=(
            EffectParameter(
                "tau", "s", 0.3, "L/U", one_sided=True, low=0, high=20, about="first-order time constant"
            ),
        ),
        stages=(InputStage(f"n_{name}", 30, f"x - (x - y)*{rest}", f"x - (x - y)*tau/h*(1 - {rest})"),),
        smooth=False,
        source="first-order shaft, solved exactly over a step so that tau = 0 is exact",
        magnitude="0.05-0.5 s",
        form="First order in the revolutions.",
    )


def _late(name: str) -> Effect:
    return Effect(
        name=f"thruster_{name}_dead_time",
        says=f"Thruster {name} acts {{delay:s:later:earlier}} than its order is logged.",
        family=f"thruster_{name}_timing",
        port="input",
        where=_WHERE,
        parameters=(
            EffectParameter("delay", "s", 0.3, "L/U", low=0, high=20, about="acts later than logged"),
        ),
        stages=(InputStage(f"n_{name}", 10, delay="delay"),),
        source="pure delay of a held command",
        magnitude="0.05-0.5 s",
        form="This thruster only.",
    )
