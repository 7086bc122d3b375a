"""Effects a ship by the MMG method has in a form of its own: wind, and a rudder that is stronger to one side.

Wind: coefficients over the direction of the relative wind, measured wind as an uncertain input; of every
vehicle that states the areas the air pushes on.
"""

from dataclasses import replace

from bayesid.model.effects import rudder
from bayesid.model.effects.declare import Effect, EffectParameter
from bayesid.model.effects.environment import before_the_beam

_RHO_AIR = 1.2
# Blendermann (1994), loaded tanker: drag abeam, drag from ahead and from astern over the front, cross-force,
# and how far the centre of the side force moves forward per radian of wind before the beam
_ABEAM, _AHEAD, _ASTERN, _CROSS, _MOVES = 0.70, 0.90, 0.55, 0.40, 0.18


def _air(axis: str, north: str, east: str) -> str:
    """Force of the air that blows to north and east [m/s] past a moving hull; (a, b) is its speed along and
    across the ship."""
    a = f"(({north})*cos(psi) + ({east})*sin(psi) - ug)"
    b = f"(({east})*cos(psi) - ({north})*sin(psi) - vg)"
    square = f"({a}*{a} + {b}*{b} + 1e-6)"
    along = f"({_AHEAD} + {_ASTERN - _AHEAD}*step({a}))"
    share = f"{along}*air_front/({_ABEAM}*max(air_side, 1e-9))"
    down = f"(1 - {2 * _CROSS}*(1 - {share})*{a}*{a}*{b}*{b}/({square}*{square}))"
    pressure = f"0.5*{_RHO_AIR}*L*L*sqrt{square}/{down}"
    side = f"{pressure}*air_side*{_ABEAM}*(1 + side)*{b}"
    if axis == "X":
        return f"{pressure}*air_front*(1 + front)*{along}*{a}"
    if axis == "Y":
        return side
    before = before_the_beam(a, b, f"sqrt{square}")
    return f"{side}*L*(air_centroid + centre + {_MOVES}*(1 + centre_moves)*{before})"


# a vane whose zero is off turns the measured vector
_BLOWING = {
    "north": "blowing_north + gain*(cos(vane_zero)*wind_north - sin(vane_zero)*wind_east)",
    "east": "blowing_east + gain*(sin(vane_zero)*wind_north + cos(vane_zero)*wind_east)",
}


def air_beyond_still(axis: str, north: str, east: str) -> str:
    """Force of the air that blows to north and east [m/s] less what still air already does."""
    return f"{_air(axis, north, east)} - ({_air(axis, '0', '0')})"


def _wind(axis: str) -> str:
    return air_beyond_still(axis, *_BLOWING.values())


# the force of a rudder behind a drifting hull has no sign of delta_r: it is stronger to the side it pushes to
_ASYMMETRY = replace(
    next(e for e in rudder.EFFECTS if e.name == "rudder_asymmetry"),
    force={
        "Y": "asymmetry*abs(rows('Y', 'delta_r'))",
        "N": "-asymmetry*abs(rows('N', 'delta_r'))",
    },
    form="Force and moment of the rudder, more where it pushes the stern to starboard and less to port.",
)

WIND_ON_AREAS = Effect(
    name="wind",
    says="A wind of {V_wind:m/s} from {from:bearing} acts that the simulator leaves out.",
    says_over="The wind that acts is not the measured one: {gain:-} times that, and {V_wind:m/s} from "
    "{from:bearing} beside it.",
    at_surface=True,
    family="earth_force",
    port="force",
    where=("X+Y+N", "X", "Y", "N", "Y+N", "current"),
    parameters=(
        EffectParameter("blowing_north", "m/s", 2.0, about="air to the north beyond the measured"),
        EffectParameter("blowing_east", "m/s", 2.0, about="air to the east beyond the measured"),
        EffectParameter(
            "gain", "-", 1.0, one_sided=True,
            about="speed at the hull over the measured one: anemometer, its height and its place",
        ),
        EffectParameter("vane_zero", "rad", 0.15, low=-1, high=1, about="zero of the vane, added to it"),
        EffectParameter("side", "-", 0.3, low=-1, about="side force beyond that of the table, its share"),
        EffectParameter("front", "-", 0.3, low=-1, about="drag beyond that of the table, its share"),
        EffectParameter("centre", "-", 0.05, about="centre of the side force before that stated, over L"),
        EffectParameter(
            "centre_moves", "-", 0.4, low=-2, about="how far it moves with direction, beyond the table"
        ),
        EffectParameter(
            "water", "-", 0.015, low=-0.05, high=0.05,
            about="velocity of the water at the hull over that of the air, which drives the surface",
        ),
    ),
    flow={axis: f"water*({air})" for axis, air in _BLOWING.items()},
    force={axis: _wind(axis) for axis in "XYN"},
    source="Blendermann (1994), J. Wind Eng. Ind. Aerodyn. 51, 339-351, loaded tanker; less still air",
    magnitude="first-order for surface models in the open",
    form="Drag, side force and moment over the direction of the relative wind on the areas of the "
    "vehicle file: wind from ahead pushes the bow, from astern the stern. Measured wind is not filtered. "
    "The water at the hull may go with a share of the wind: 2 to 3 % at the very surface (Wu 1983, J. "
    "Phys. Oceanogr. 13, 1441), less over the draught.",
)  # fmt: skip

#: in place of the effects of the same names in the catalogue
SHIP_EFFECTS = (_ASYMMETRY, WIND_ON_AREAS)
