"""Between the state and its reading."""

from bayesid.effects.declare import Effect, EffectParameter

_DEG = 0.017453292519943295

EFFECTS = (
    Effect(
        name="heading_bias",
        family="heading_bias",
        port="sensor",
        where=("psi",),
        parameters=(EffectParameter("bias", "rad", 2 * _DEG, about="added to the true heading"),),
        sensor={"psi": "psi + bias"},
        source="assumed: alignment or declination error",
        magnitude="0.5-3 degrees",
    ),
    Effect(
        name="compass_deviation",
        family="compass_deviation",
        port="sensor",
        where=("psi",),
        parameters=(
            EffectParameter("A", "rad", 2 * _DEG, about="times sin psi"),
            EffectParameter("B", "rad", 2 * _DEG, about="times cos psi"),
        ),
        sensor={"psi": "psi + A*sin(psi) + B*cos(psi)"},
        source="one-cycle deviation: Hench & Rosman (2010), J. Atmos. Ocean. Tech. 27, 1229",
        magnitude="position errors of up to 5 % of the track",
    ),
    Effect(
        name="gyro_scale",
        family="gyro_scale",
        port="sensor",
        where=("r",),
        parameters=(EffectParameter("scale", "-", 0.03, about="r times (1 + scale)"),),
        sensor={"r": "r*(1 + scale)"},
        source="assumed: scale-factor error",
        magnitude="0.1-3 % for MEMS",
    ),
    Effect(
        name="gyro_bias",
        family="gyro_bias",
        port="sensor",
        where=("r",),
        parameters=(EffectParameter("bias", "rad/s", 0.005, "U/L", about="added to the yaw rate"),),
        sensor={"r": "r + bias"},
        source="assumed: constant rate bias",
        magnitude="0.01-0.5 deg/s for MEMS",
    ),
    Effect(
        name="position_lever_arm",
        family="position_lever_arm",
        port="sensor",
        where=("x,y",),
        parameters=(
            EffectParameter("l_x", "m", 0.3, "L", about="position sensor forward of the assumed point"),
            EffectParameter("l_y", "m", 0.15, "L", about="to starboard of it"),
        ),
        sensor={"x": "x + l_x*cos(psi) - l_y*sin(psi)", "y": "y + l_x*sin(psi) + l_y*cos(psi)"},
        source="rigid-body kinematics",
        magnitude="0.1-1 m for small vehicles",
    ),
    Effect(
        name="position_latency",
        family="position_latency",
        port="sensor",
        where=("x,y",),
        parameters=(
            EffectParameter(
                "delay", "s", 0.5, "L/U", one_sided=True, about="age of the position when logged"
            ),
        ),
        sensor_delay={"delay": ("x", "y")},
        source="assumed: pure delay",
        magnitude="0.3-2 s for acoustic positioning",
    ),
    Effect(
        name="velocity_scale",
        family="velocity_scale",
        port="sensor",
        where=("u,v",),
        parameters=(EffectParameter("scale", "-", 0.02, about="u and v times (1 + scale)"),),
        sensor={"u": "u*(1 + scale)", "v": "v*(1 + scale)"},
        source="assumed: scale-factor error of the velocity log",
        magnitude="0.2-0.7 % after calibration",
    ),
    Effect(
        name="velocity_misalignment",
        family="velocity_misalignment",
        port="sensor",
        where=("u,v",),
        parameters=(EffectParameter("angle", "rad", 2 * _DEG, about="velocity log turned to starboard"),),
        sensor={"u": "u*cos(angle) + v*sin(angle)", "v": "v*cos(angle) - u*sin(angle)"},
        source="rotation of the velocity log's frame",
        magnitude="1-2 degrees before calibration",
    ),
    Effect(
        name="velocity_latency",
        family="velocity_latency",
        port="sensor",
        where=("u,v",),
        parameters=(
            EffectParameter(
                "delay", "s", 0.3, "L/U", one_sided=True, about="age of the velocity when logged"
            ),
        ),
        sensor_delay={"delay": ("u", "v", "w")},
        source="assumed: pure delay, as a causal filter makes",
        magnitude="0.2-1 s",
    ),
    Effect(
        name="depth_bias",
        family="depth_bias",
        port="sensor",
        where=("z",),
        parameters=(EffectParameter("bias", "m", 0.05, "L", about="added to the depth"),),
        sensor={"z": "z + bias"},
        dof=6,
        source="assumed: zero of the pressure sensor",
        magnitude="cm to dm",
    ),
    Effect(
        name="depth_latency",
        family="depth_latency",
        port="sensor",
        where=("z",),
        parameters=(
            EffectParameter("delay", "s", 0.5, "L/U", one_sided=True, about="age of the depth when logged"),
        ),
        sensor_delay={"delay": ("z",)},
        dof=6,
        source="assumed: pure delay",
        magnitude="0.1-1 s",
    ),
)
