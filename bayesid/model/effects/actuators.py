"""Between the command and the fin or propeller: offsets, timing, backlash and limits."""

from bayesid.model.effects.declare import RUDDER_WHERE, Effect, EffectParameter, InputStage

_DEG = 0.017453292519943295

EFFECTS = (
    Effect(
        name="rudder_offset",
        says="The rudder stands {offset:deg:to port:to starboard} of where it is ordered.",
        family="rudder_offset",
        port="input",
        where=RUDDER_WHERE,
        parameters=(
            EffectParameter(
                "offset", "rad", 2 * _DEG, low=-20 * _DEG, high=20 * _DEG, about="added to the rudder angle"
            ),
        ),
        stages=(InputStage("delta_r", 60, "x + offset", "x + offset"),),
        source="assumed: constant error of the rudder zero",
        magnitude="neutral rudder 0.5-2 degrees",
        form="A constant, added behind play, servo and stops: the fin is askew on its stock.",
    ),
    Effect(
        name="actuator_lag",
        says="The rudder follows its orders with a lag of {tau:s}.",
        family="actuator_timing",
        port="input",
        where=RUDDER_WHERE,
        parameters=(
            EffectParameter(
                "tau", "s", 0.47, "L/U", one_sided=True, low=0, high=20, about="first-order time constant"
            ),
        ),
        smooth=False,
        adjust={"servo_lag_r": "value + tau"},
        source="first-order servo inside its rate limit, solved exactly over a step so that tau = 0 is exact",
        magnitude="0.1-0.5 s for AUVs, 1-3 s for ships",
        form="First order inside the rate limit; a second-order servo is another form.",
    ),
    Effect(
        name="actuator_dead_time",
        says="The rudder acts {delay:s:later:earlier} than its order is logged.",
        aliases=("time_offset",),
        family="actuator_timing",
        port="input",
        where=RUDDER_WHERE,
        parameters=(
            EffectParameter(
                "delay", "s", 0.47, "L/U", low=0, high=20, about="commands act this much later than logged"
            ),
        ),
        stages=(InputStage("delta_r", 10, delay="delay"),),
        source="pure delay of a held command; the step a switch falls in gets its time-weighted mean",
        magnitude="0.05-0.5 s, or a clock offset of either sign",
        smooth=False,
        form="Rudder only; the same for all commands.",
    ),
    Effect(
        name="actuator_rate_limit",
        says="The rudder moves at {inverse_rate_r+inverse_rate_excess:1/deg/s} instead of "
        "{inverse_rate_r:1/deg/s}.",
        family="actuator_rate_limit",
        port="input",
        where=RUDDER_WHERE,
        parameters=(
            EffectParameter(
                "inverse_rate_excess",
                "s/rad",
                3.5,
                "L/U",
                one_sided=True,
                about="1/R - 1/R_nominal of the rudder rate R",
            ),
        ),
        adjust={"inverse_rate_r": "value + inverse_rate_excess"},
        smooth=False,
        source="SOLAS II-1/29: 65 degrees in 28 s for ships",
        magnitude="2.3 deg/s (SOLAS) to 10-60 deg/s (AUV)",
        form="Hard limit of the rate; reciprocal, so that no limit is zero.",
    ),
    Effect(
        name="actuator_backlash",
        says="The rudder has a play of {half_width:deg} to either side.",
        family="actuator_backlash",
        port="input",
        where=RUDDER_WHERE,
        parameters=(
            EffectParameter(
                "half_width",
                "rad",
                1.5 * _DEG,
                one_sided=True,
                low=0,
                high=10 * _DEG,
                about="half of the play",
            ),
        ),
        stages=(
            InputStage(
                "delta_r",
                25,
                "min(max(y, x - half_width), x + half_width)",
                "min(max(y, x - half_width), x + half_width)",
            ),
        ),
        smooth=False,
        source="play operator",
        magnitude="0.3-2 degrees",
        form="Play between command and fin, before the servo; the fin stays where play leaves it.",
    ),
    Effect(
        name="stern_plane_offset",
        says="The stern planes stand {offset:deg:above:below} their order, as the vehicle counts delta_s.",
        family="stern_plane_offset",
        port="input",
        where=("M", "Z+M"),
        parameters=(
            EffectParameter(
                "offset",
                "rad",
                2 * _DEG,
                low=-20 * _DEG,
                high=20 * _DEG,
                about="added to the stern-plane angle",
            ),
        ),
        stages=(InputStage("delta_s", 60, "x + offset", "x + offset"),),
        dof=6,
        source="assumed: constant error of the plane zero",
        magnitude="0.5-2 degrees",
        form="A constant, added behind servo and stops.",
    ),
)
