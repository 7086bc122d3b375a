"""Moving water: effects between velocity over ground and velocity through the water."""

from bayesid.model.effects.declare import Effect, EffectParameter

_SEEN = "0.05-1 m/s in coastal waters; IMO MSC/Circ.1053 3.4.2 estimates it from a 720 degree turn"

EFFECTS = (
    Effect(
        name="ocean_current",
        says="A current of {V_north,V_east:m/s} sets the vehicle.",
        family="current",
        port="flow",
        where=("current",),
        parameters=(
            EffectParameter(
                "V_north", "m/s", 0.13, "U", low=-2, high=2, about="velocity of the water to the north"
            ),
            EffectParameter(
                "V_east", "m/s", 0.13, "U", low=-2, high=2, about="velocity of the water to the east"
            ),
        ),
        flow={"north": "V_north", "east": "V_east"},
        source="Fossen (2021), equations of motion in irrotational currents",
        magnitude=_SEEN,
        form="The same velocity everywhere and always, horizontal: it carries the track and turns with "
        "the body axes.",
    ),
    Effect(
        name="ocean_current_varying",
        says="A current sets the vehicle and changes on the way: {V_north,V_east:m/s} at the start.",
        family="current",
        port="flow",
        where=("current",),
        parameters=(
            EffectParameter("V_north", "m/s", 0.13, "U", about="at the start of a run"),
            EffectParameter("V_east", "m/s", 0.13, "U", about="at the start of a run"),
            EffectParameter("dV_north", "m/s", 0.1, "U", about="change per 600 s"),
            EffectParameter("dV_east", "m/s", 0.1, "U", about="change per 600 s"),
        ),
        flow={"north": "V_north + dV_north*t/600", "east": "V_east + dV_east*t/600"},
        source="assumed: first-order change in time, the simplest departure from a steady current",
        magnitude="tide and shear: 0.05-0.3 m/s over a session",
        form="Uniform in space and linear in time, over each run anew; water that accelerates pushes "
        "with the displaced mass and the added mass. Tides, eddies and shear are other forms.",
    ),
    Effect(
        name="heave_current",
        says="The water moves {V_down:m/s:down:up}.",
        family="heave_current",
        port="flow",
        where=("Z", "current"),
        parameters=(
            EffectParameter(
                "V_down", "m/s", 0.03, "U", low=-0.5, high=0.5, about="velocity of the water downwards"
            ),
        ),
        flow={"down": "V_down"},
        dof=6,
        source="Fossen (2021), equations of motion in irrotational currents",
        magnitude="internal waves and upwelling: cm/s",
        form="The same vertical velocity everywhere and always.",
    ),
)
