"""What may be wrong with one named actuator: of its shaft, of what turns it, of a fin as such.

Takes: the `Shape` of an actuator and the column it is ordered by. Gives declarations as in the catalogue.
Does not: know a kind of actuator; what it needs stands in its shape.
"""

from __future__ import annotations

from bayesid.model.actuators import Shape, kind_of
from bayesid.model.actuators.declare import servo_names
from bayesid.model.effects.declare import Effect, EffectParameter, InputStage

_DEG = 0.017453292519943295
_PUSHES = ("X", "N", "X+Y+N")
_STEERS = ("N", "Y+N", "X+Y+N")
_OFFSET = 0.03  # of the usual revolutions
_WORDS = {
    "azimuth": "The thruster {} turns", "nozzle": "The nozzle {} turns", "bucket": "The bucket {} moves",
    "delta": "The fin {} turns",
}  # fmt: skip
ALONE = "This actuator only."


def share_of_force(shape: Shape, share: str) -> dict[str, str]:
    """A share of all forces of an actuator, by axis."""
    parts = kind_of(shape).parts(shape)
    return {
        axis: f"{share}*({' + '.join(f'({force})*{arms[axis]}' for force, arms in parts)})"
        for axis in parts[0][1]
    }


def _late(column: str, prefix: str, says: str, where: tuple[str, ...]) -> Effect:
    return Effect(
        name=f"{prefix}_dead_time",
        says=f"{says} {{delay:s:later:earlier}} than its order is logged.",
        family=f"{prefix}_timing",
        port="input",
        where=where,
        parameters=(
            EffectParameter("delay", "s", 0.3, "L/U", low=0, high=20, about="acts later than logged"),
        ),
        stages=(InputStage(column, 10, delay="delay"),),
        source="pure delay of a held command",
        magnitude="0.05-0.5 s",
        form=ALONE,
    )  # fmt: skip


def _lag_parameter() -> tuple[EffectParameter, ...]:
    return (
        EffectParameter(
            "tau", "s", 0.3, "L/U", one_sided=True, low=0, high=20, about="first-order time constant"
        ),
    )


def of_shaft(shape: Shape, column: str, rpm_ref: float) -> list[Effect]:
    """Effects of what turns at the revolutions of a column."""
    prefix, who = f"thruster_{shape.name}", f"Thruster {shape.name}"
    rest = "exp(-h/max(tau, 1e-12))"
    lag = Effect(
        name=f"{prefix}_lag",
        says=f"{who} follows its orders with a lag of {{tau:s}}.",
        family=f"{prefix}_timing",
        port="input",
        where=_PUSHES,
        parameters=_lag_parameter(),
        stages=(InputStage(column, 30, f"x - (x - y)*{rest}", f"x - (x - y)*tau/h*(1 - {rest})"),),
        smooth=False,
        source="first-order shaft, solved exactly over a step so that tau = 0 is exact",
        magnitude="0.05-0.5 s",
        form="First order in the revolutions.",
    )
    gain = Effect(
        name=f"{prefix}_gain",
        says=f"{who} gives {{share:%:more:less}} thrust than stated.",
        family=prefix,
        port="force",
        where=_PUSHES,
        parameters=(EffectParameter("share", "-", 0.15, low=-1.0, about="thrust beyond that stated, share"),),
        force=share_of_force(shape, "share"),
        source="assumed: the whole curve scaled",
        magnitude="port and starboard of one type differ by 5-15 %",
        form="The same share ahead and astern, at every inflow.",
    )
    moving = "min(abs(x - y)*per_1000rpm/1000, h)"
    left = "max(abs(x - y) - 1000*h/max(per_1000rpm, 1e-12), 0)"
    rate = Effect(
        name=f"{prefix}_rate_limit",
        says=f"{who} takes {{per_1000rpm:s}} to change by 1000 rpm.",
        family=f"{prefix}_rate_limit",
        port="input",
        where=_PUSHES,
        parameters=(
            EffectParameter(
                "per_1000rpm", "s", 1.0, "L/U", one_sided=True, about="time for 1000 rpm of change, 0: none"
            ),
        ),
        stages=(
            InputStage(
                column,
                35,
                f"x - sgn(x - y)*{left}",
                f"x - sgn(x - y)*({left} + 0.5*(abs(x - y) - {left})*{moving}/h)",
            ),
        ),
        smooth=False,
        source="ramp of a motor controller, solved exactly over a step",
        magnitude="0.2-5 s from rest to full ahead",
        form="Hard limit of the rate of the revolutions, the same up and down; reciprocal, so that no limit "
        "is zero.",
    )
    offset = Effect(
        name=f"{prefix}_offset",
        says=f"{who} turns {{offset:rpm:faster:slower}} than ordered, to the side of ahead.",
        family=f"{prefix}_offset",
        port="input",
        where=_PUSHES,
        parameters=(
            EffectParameter(
                "offset", "rpm", _OFFSET * rpm_ref, low=-rpm_ref, high=rpm_ref, about="added to the orders"
            ),
        ),
        stages=(InputStage(column, 60, "x + offset", "x + offset"),),
        source="assumed: constant error of the zero of a controller",
        magnitude="a few per cent of the usual revolutions",
        form="A constant, added behind lag and rate limit; the dead band of the file is about the true zero.",
    )
    out = [gain, lag, _late(column, prefix, f"{who} acts", _PUSHES), rate, offset]
    astern = f"{shape.kind}_{shape.name}_reverse"
    if astern in kind_of(shape).constants_of(shape):
        out.append(
            Effect(
                name=f"{prefix}_astern",
                says=f"{who} gives {{share:%:more:less}} thrust astern than stated, ahead as stated.",
                family=prefix,
                port="force",
                where=_PUSHES,
                parameters=(
                    EffectParameter("share", "-", 0.2, low=-1.0, about="thrust astern beyond that stated"),
                ),
                force=_astern(shape, column),
                source="assumed: blades of a propeller made for ahead",
                magnitude="5-30 %",
                form="The whole curve of negative revolutions scaled.",
            )
        )
    return out


def _astern(shape: Shape, column: str) -> dict[str, str]:
    return share_of_force(shape, f"share*step(-{column})")


def of_servo(signal: str, name: str) -> list[Effect]:
    """Effects of what is turned, or moved, to the position of a column."""
    what, bucket = _WORDS[signal.partition("_")[0]].format(name), signal.startswith("bucket")
    unit, size = ("-", 0.05) if bucket else ("rad", 2 * _DEG)
    inverse_rate, servo_lag, _ = servo_names(signal)
    angle, speed = ("-", "-") if bucket else ("deg", "deg/s")
    play = "min(max(y, x - half_width), x + half_width)"
    return [
        Effect(
            name=f"{signal}_offset",
            says=f"{what} {{offset:{angle}}} beyond what is ordered.",
            family=f"{signal}_offset",
            port="input",
            where=_STEERS,
            parameters=(
                EffectParameter("offset", unit, size, low=-10 * size, high=10 * size, about="added to it"),
            ),
            stages=(InputStage(signal, 60, "x + offset", "x + offset"),),
            source="assumed: constant error of the zero",
            magnitude="0.5-2 degrees",
            form="A constant, added behind play, servo and stops.",
        ),
        Effect(
            name=f"{signal}_lag",
            says=f"{what} with a lag of {{tau:s}}.",
            family=f"{signal}_timing",
            port="input",
            where=_STEERS,
            parameters=_lag_parameter(),
            smooth=False,
            adjust={servo_lag: "value + tau"},
            source="first-order servo inside its rate limit, solved exactly over a step, so tau = 0 is exact",
            magnitude="0.1-3 s",
            form="First order inside the rate limit, beside the lag of the file.",
        ),
        _late(signal, signal, what, _STEERS),
        Effect(
            name=f"{signal}_rate_limit",
            says=f"{what} by {{{inverse_rate}+inverse_rate_excess:1/{speed}}} instead of "
            f"{{{inverse_rate}:1/{speed}}}.",
            family=f"{signal}_rate_limit",
            port="input",
            where=_STEERS,
            parameters=(
                EffectParameter(
                    "inverse_rate_excess", "s" if bucket else "s/rad", 3.5, "L/U", one_sided=True,
                    about="1/R - 1/R_nominal of its rate R",
                ),
            ),
            adjust={inverse_rate: "value + inverse_rate_excess"},
            smooth=False,
            source="assumed: a pump or motor weaker than stated",
            magnitude="2-60 degrees a second",
            form="Hard limit of the rate; reciprocal, so that no limit is zero.",
        ),
        Effect(
            name=f"{signal}_backlash",
            says=f"{what} with a play of {{half_width:{angle}}} to either side.",
            family=f"{signal}_backlash",
            port="input",
            where=_STEERS,
            parameters=(
                EffectParameter(
                    "half_width", unit, 0.75 * size, one_sided=True, low=0, high=5 * size,
                    about="half of the play",
                ),
            ),
            stages=(InputStage(signal, 25, play, play),),
            smooth=False,
            source="play operator",
            magnitude="0.3-2 degrees",
            form="Play between order and angle, before the servo.",
        ),
    ]  # fmt: skip


def of_fin(shape: Shape, signal: str) -> list[Effect]:
    """Effects of the force of a fin."""
    said = (
        ("effectiveness", "gives {share:%:more:less} force than stated", "share", 0.2, "every angle alike"),
        ("asymmetry", "is {share:%:stronger:weaker} at positive angles, the opposite at negative",
         f"share*sgn({signal})", 0.1, "more to one side and less to the other"),
    )  # fmt: skip
    return [
        Effect(
            name=f"{signal}_{word}",
            says=f"The fin {shape.name} {text}.",
            family=f"{signal}_{word}",
            port="force",
            where=_STEERS,
            parameters=(
                EffectParameter("share", "-", sd, low=-1.0, about=f"force beyond that stated, {form}"),
            ),
            force=share_of_force(shape, share),
            source="scale effect on fins and wake (ITTC 7.5-04-02-01)",
            magnitude="5-30 %",
            form=f"Force, moment and drag of the fin, {form}.",
        )
        for word, text, share, sd, form in said
    ]
