"""A wind that changes on the way: `wind` with a trend over each run, as of a current that varies.

Takes nothing. Gives declarations that are not part of the catalogue: who wants them weighed names them, for
`bayesid fit --effects` and `diagnose --effects` by a file with one line,
`from bayesid.model.effects.wind_in_time import VARYING as EFFECTS`, or SHIP_VARYING for a ship told by the
MMG method, whose areas and table of coefficients its file states. Does not: know gusts, which are left to the
noise, or a wind that turns back within a run.
"""

from __future__ import annotations

from dataclasses import replace

from bayesid.model.effects import environment, of_ships
from bayesid.model.effects.declare import Effect, EffectParameter

_NORTH, _EAST = (f"blowing_{axis} + d{axis}*t/600" for axis in ("north", "east"))
_FIRST = ("blowing_north", "blowing_east")


def _varying(steady: Effect, force: dict[str, str], areas: float, shape: tuple[str, ...] = ()) -> Effect:
    """The steady declaration, its two components at the start of a run and their change per 600 s; `shape`
    are parameters it keeps."""
    start = [
        EffectParameter(p.name, "m/s", p.sd, assumed=areas, about="air velocity at the start of a run")
        for p in steady.parameters
        if p.name in _FIRST
    ]
    change = [
        EffectParameter(f"d{axis}", "m/s", 1.5, about="its change per 600 s of each run")
        for axis in ("north", "east")
    ]
    return replace(
        steady,
        name="wind_varying",
        says="A wind acts that the simulator leaves out and changes on the way: it blows with "
        "{blowing_north,blowing_east:m/s} at the start and changes by {dnorth,deast:m/s} in ten minutes.",
        aliases=(),
        parameters=(*start, *change, *(p for p in steady.parameters if p.name in shape)),
        flow={},
        force=force,
        source=f"{steady.source}; linear in time: assumed",
        magnitude="0.5-2 m/s in ten minutes; a front more",
        form="As wind where none is measured, uniform in space and linear in time, over each run anew. A run "
        "of much less than ten minutes tells the mean alone.",
    )


def _of(steady: tuple[Effect, ...]) -> Effect:
    return next(e for e in steady if e.name == "wind")


#: areas assumed as in the catalogue
VARYING = (
    _varying(
        _of(environment.EFFECTS),
        {axis: environment.air_force(axis, _NORTH, _EAST) for axis in "XYN"},
        environment.AREAS_SD,
        ("front", "centre", "centre_moves"),
    ),
)
#: areas and coefficients of a ship
SHIP_VARYING = (
    _varying(
        _of(of_ships.SHIP_EFFECTS),
        {axis: of_ships.air_beyond_still(axis, _NORTH, _EAST) for axis in "XYN"},
        0.0,
        ("side", "front", "centre", "centre_moves"),
    ),
)
