"""Between the state and its reading."""

from bayesid.model.effects.declare import Effect, EffectParameter

_DEG = 0.017453292519943295

EFFECTS = (
    Effect(
        name="heading_bias",
        says="The compass reads {bias:deg:too much:too little}.",
        family="heading_bias",
        port="sensor",
        where=("psi",),
        parameters=(
            EffectParameter(
                "bias", "rad", 2 * _DEG, low=-30 * _DEG, high=30 * _DEG, about="added to the true heading"
            ),
        ),
        sensor={"psi": "psi + bias"},
        source="assumed: alignment or declination error",
        magnitude="0.5-3 degrees",
        form="A constant in the reading.",
    ),
    Effect(
        name="heading_drift",
        says="The heading reading drifts by {drift_per_600s:deg:to starboard:to port} in ten minutes.",
        family="heading_drift",
        port="sensor",
        where=("psi",),
        parameters=(
            EffectParameter(
                "drift_per_600s",
                "rad",
                5 * _DEG,
                low=-60 * _DEG,
                high=60 * _DEG,
                about="added to the true heading by 600 s after the start of each run",
            ),
        ),
        sensor={"psi": "psi + drift_per_600s*t/600"},
        source="assumed: a gyro's bias integrated to a heading (Titterton and Weston 2004, ch. 12)",
        magnitude="1-10 degrees an hour for tactical gyros, some degrees a minute for MEMS",
        form="Linear in time, from the first sample of each run; a compass that settles is another form.",
    ),
    Effect(
        name="compass_deviation",
        says="The compass deviates with heading by up to {A,B:deg:in:all}.",
        family="compass_deviation",
        port="sensor",
        where=("psi",),
        parameters=(
            EffectParameter("A", "rad", 2 * _DEG, low=-30 * _DEG, high=30 * _DEG, about="times sin psi"),
            EffectParameter("B", "rad", 2 * _DEG, low=-30 * _DEG, high=30 * _DEG, about="times cos psi"),
        ),
        sensor={"psi": "psi + A*sin(psi) + B*cos(psi)"},
        source="one-cycle deviation: Hench & Rosman (2010), J. Atmos. Ocean. Tech. 27, 1229",
        magnitude="position errors of up to 5 % of the track",
        form="One cycle per turn; two cycles (soft iron) are another form.",
    ),
    Effect(
        name="gyro_scale",
        says="The yaw-rate gyro reads {scale:%:too high:too low}.",
        family="gyro_scale",
        port="sensor",
        where=("r",),
        parameters=(
            EffectParameter(
                "scale", "-", 0.03, roll_from=-0.0097, low=-0.3, high=0.3, about="r times (1 + scale)"
            ),
        ),
        sensor={"r": "r*(1 + scale)"},
        source="assumed: scale-factor error",
        magnitude="0.1-3 % for MEMS",
        form="The same to both sides. A list of 8 degrees reads as -0.97 %.",
    ),
    Effect(
        name="heel_in_yaw_rate",
        says="Heel makes the yaw-rate gyro read {heel:%:too high:too low} in a turn.",
        family="heel_in_yaw_rate",
        port="sensor",
        where=("r",),
        parameters=(
            EffectParameter("heel", "-", 0.06, about="share of the rate at r = U/L by heel in turns"),
            EffectParameter("list", "-", 0.05, about="the same by heel in turns on top of a list, odd"),
        ),
        sensor={"r": "r*(1 + list*r*L/U_ref + heel*(r*L/U_ref)**2)"},
        source="body yaw rate under roll, r = (d psi/dt) cos(phi) cos(theta) (Fossen 2021, 2.3)",
        magnitude="1.5 % at a heel of 10 degrees",
        form="Heel is a list plus a part that goes with the yaw rate; its cosine to second order. What a "
        "list alone does is a scale and is not in it.",
        as_form="only",
        planar=True,
    ),
    Effect(
        name="gyro_bias",
        says="The yaw-rate gyro reads {bias:deg/s:too much:too little}.",
        family="gyro_bias",
        port="sensor",
        where=("r",),
        parameters=(EffectParameter("bias", "rad/s", 0.005, "U/L", about="added to the yaw rate"),),
        sensor={"r": "r + bias"},
        source="assumed: constant rate bias",
        magnitude="0.01-0.5 deg/s for MEMS",
        form="A constant; a creep with time is another form.",
    ),
    Effect(
        name="position_lever_arm",
        says="The position sensor sits {l_x:m:forward:aft} and {l_y:m:to starboard:to port} of where "
        "it is assumed.",
        family="position_lever_arm",
        port="sensor",
        where=("x,y",),
        parameters=(
            EffectParameter(
                "l_x", "m", 0.3, "L", low=-1, high=1, about="position sensor forward of the assumed point"
            ),
            EffectParameter("l_y", "m", 0.15, "L", low=-0.5, high=0.5, about="to starboard of it"),
        ),
        sensor={"x": "x + l_x*cos(psi) - l_y*sin(psi)", "y": "y + l_x*sin(psi) + l_y*cos(psi)"},
        source="rigid-body kinematics",
        magnitude="0.1-1 m for small vehicles",
        form="In level axes: heel and trim do not move the sensor.",
    ),
    Effect(
        name="position_latency",
        says="The position is {delay:s} old when it is logged.",
        family="position_latency",
        port="sensor",
        where=("x,y",),
        parameters=(
            EffectParameter(
                "delay",
                "s",
                0.5,
                "L/U",
                one_sided=True,
                low=0,
                high=20,
                about="age of the position when logged",
            ),
        ),
        sensor_delay={"delay": ("x", "y")},
        source="assumed: pure delay",
        magnitude="0.3-2 s for acoustic positioning",
        form="A pure delay; a smoothing filter is another form.",
    ),
    Effect(
        name="velocity_scale",
        says="The velocity log reads {scale:%:too high:too low}.",
        family="velocity_scale",
        port="sensor",
        where=("u,v",),
        parameters=(
            EffectParameter("scale", "-", 0.02, low=-0.3, high=0.3, about="u and v times (1 + scale)"),
        ),
        sensor={"u": "u*(1 + scale)", "v": "v*(1 + scale)"},
        source="assumed: scale-factor error of the velocity log",
        magnitude="0.2-0.7 % after calibration",
        form="One scale for both axes.",
    ),
    Effect(
        name="velocity_misalignment",
        says="The velocity log is turned {angle:deg:to starboard:to port}.",
        family="velocity_misalignment",
        port="sensor",
        where=("u,v",),
        parameters=(
            EffectParameter(
                "angle",
                "rad",
                2 * _DEG,
                low=-20 * _DEG,
                high=20 * _DEG,
                about="velocity log turned to starboard",
            ),
        ),
        sensor={"u": "u*cos(angle) + v*sin(angle)", "v": "v*cos(angle) - u*sin(angle)"},
        source="rotation of the velocity log's frame",
        magnitude="1-2 degrees before calibration",
        form="Turned about the vertical alone.",
    ),
    Effect(
        name="velocity_latency",
        says="The velocity is {delay:s} old when it is logged.",
        family="velocity_latency",
        port="sensor",
        where=("u,v",),
        parameters=(
            EffectParameter(
                "delay",
                "s",
                0.3,
                "L/U",
                one_sided=True,
                low=0,
                high=20,
                about="age of the velocity when logged",
            ),
        ),
        sensor_delay={"delay": ("u", "v", "w")},
        source="assumed: pure delay, as a causal filter makes",
        magnitude="0.2-1 s",
        form="A pure delay of all axes.",
    ),
    Effect(
        name="ground_velocity_latency",
        says="The velocity over ground is {delay:s} old when it is turned into the axes of the vehicle.",
        family="velocity_latency",
        port="sensor",
        where=("u,v",),
        parameters=(
            EffectParameter(
                "delay",
                "s",
                0.3,
                "L/U",
                one_sided=True,
                low=0,
                high=20,
                about="age, when logged, of the velocity over ground that the present heading turns",
            ),
        ),
        sensor={
            "u": "u*cos(delay*r) + v*sin(delay*r)",
            "v": "v*cos(delay*r) - u*sin(delay*r)",
        },
        sensor_delay={"delay": ("u", "v")},
        source="kinematics: a filter of the velocity in earth axes (GNSS, differentiated track), turned by "
        "the heading of the moment",
        magnitude="0.2-1 s",
        form="A pure delay in earth axes; the heading turns at the rate of the moment read, to first order "
        "in the delay.",
    ),
    Effect(
        name="depth_bias",
        says="The depth sensor reads {bias:m:too deep:too shallow}.",
        family="depth_bias",
        port="sensor",
        where=("z",),
        parameters=(EffectParameter("bias", "m", 0.05, "L", low=-1, high=1, about="added to the depth"),),
        sensor={"z": "z + bias"},
        dof=6,
        source="assumed: zero of the pressure sensor",
        magnitude="cm to dm",
        form="A constant.",
    ),
    Effect(
        name="depth_latency",
        says="The depth is {delay:s} old when it is logged.",
        family="depth_latency",
        port="sensor",
        where=("z",),
        parameters=(
            EffectParameter(
                "delay", "s", 0.5, "L/U", one_sided=True, low=0, high=20, about="age of the depth when logged"
            ),
        ),
        sensor_delay={"delay": ("z",)},
        dof=6,
        source="assumed: pure delay",
        magnitude="0.1-1 s",
        form="A pure delay.",
    ),
)
