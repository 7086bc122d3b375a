"""Forces of air, gravity and boundaries."""

from bayesid.model.effects.declare import Effect, EffectParameter

# Air drag on 3 % of L^2 ahead and 10 % abeam at a yaw arm of L/20: a low deck, where a file states no areas.
_AX, _AY, _ARM = 0.03, 0.10, 0.05
_RHO_AIR = 1.2
# Areas are known to a factor of two (sd .7 of their logarithm); a speed found from the force goes
# with their root.
AREAS_SD = 0.35
# Half of what the centre of a loaded tanker's side force moves per radian (Blendermann 1994), as far from it
# as from a plate whose centre stays.
_MOVES = 0.09
# Of each component [m/s], a mean speed of 6.3: that at 10 m is 6.6 over the sea and 3.3 over land (Archer and
# Jacobson 2005, J. Geophys. Res. 110, D12110).
WIND_SD = 5.0


def before_the_beam(a: str, b: str, speed: str) -> str:
    """Angle [rad] by which air comes from before the beam, of its velocity along and across a vehicle."""
    return f"(-2*atan({a}/(abs({b}) + {speed})))"


def air_force(axis: str, north: str, east: str) -> str:
    """Quadratic air force in the relative wind less what still air already does."""

    def drag(north: str, east: str) -> str:
        a = f"(({north})*cos(psi) + ({east})*sin(psi) - ug)"
        b = f"(({east})*cos(psi) - ({north})*sin(psi) - vg)"
        speed = f"sqrt({a}*{a} + {b}*{b})"
        before = before_the_beam(a, b, f"sqrt({a}*{a} + {b}*{b} + 1e-12)")  # nought in no wind
        return {
            "X": f"{_AX}*(1 + front)*{a}*{speed}",
            "Y": f"{_AY}*{b}*{speed}",
            "N": f"{_AY}*({_ARM} + centre + centre_moves*{before})*L*{b}*{speed}",
        }[axis]

    return f"0.5*{_RHO_AIR}*L*L*({drag(north, east)} - {drag('0', '0')})"


def _wind(axis: str) -> str:
    unknown = air_force(axis, "blowing_north", "blowing_east")
    measured = air_force(axis, "wind_north", "wind_east")
    return f"{unknown} + area_coefficients*({measured})"


EFFECTS = (
    Effect(
        name="steady_force",
        says="A steady force of {F_north,F_east:N} pushes the vehicle.",
        aliases=("wind_or_steady_force",),
        family="earth_force",
        port="force",
        where=("X+Y+N", "X", "Y", "Y+N", "current"),
        parameters=(
            EffectParameter("F_north", "N", 2e-4, "rho*L**2*U**2/2", about="force to the north"),
            EffectParameter("F_east", "N", 2e-4, "rho*L**2*U**2/2", about="force to the east"),
        ),
        force={
            "X": "F_north*cos(theta)*cos(psi) + F_east*cos(theta)*sin(psi)",
            "Y": "F_north*(sin(phi)*sin(theta)*cos(psi) - cos(phi)*sin(psi))"
            " + F_east*(cos(phi)*cos(psi) + sin(phi)*sin(theta)*sin(psi))",
            "Z": "F_north*(sin(phi)*sin(psi) + cos(phi)*sin(theta)*cos(psi))"
            " + F_east*(cos(phi)*sin(theta)*sin(psi) - sin(phi)*cos(psi))",
        },
        source="assumed: constant earth-fixed force",
        magnitude="wind and waves at periscope depth or on the surface",
        form="Horizontal, at the body origin, the same at every heading.",
    ),
    Effect(
        name="wind",
        says="A wind of {V_wind:m/s} from {from:bearing} acts that the simulator leaves out.",
        says_over="The measured wind acts on {area_coefficients:-} times the areas assumed of a low deck, "
        "and {V_wind:m/s} from {from:bearing} beside it.",
        at_surface=True,
        family="earth_force",
        port="force",
        where=("X+Y+N", "X", "Y", "N", "Y+N", "current"),
        parameters=(
            EffectParameter(
                "blowing_north",
                "m/s",
                WIND_SD,
                assumed=AREAS_SD,
                about="air velocity to the north where no wind was measured, for the assumed areas",
            ),
            EffectParameter(
                "blowing_east",
                "m/s",
                WIND_SD,
                assumed=AREAS_SD,
                about="air velocity to the east where no wind was measured, for the assumed areas",
            ),
            EffectParameter(
                "area_coefficients",
                "-",
                1.0,
                one_sided=True,
                about="exposed areas over the assumed ones, measured wind",
            ),
            EffectParameter(
                "front",
                "-",
                0.3,
                low=-1,
                shape=True,
                about="area ahead beyond that assumed beside the one abeam, its share",
            ),
            EffectParameter(
                "centre",
                "-",
                0.05,
                shape=True,
                about="centre of the side force before that assumed, over L",
            ),
            EffectParameter(
                "centre_moves",
                "-",
                _MOVES,
                mean=_MOVES,
                shape=True,
                about="how far that centre moves forward per radian of wind before the beam, over L",
            ),
        ),
        force={"X": _wind("X"), "Y": _wind("Y"), "N": _wind("N")},
        source="quadratic drag of the relative wind (Fossen 2021, wind forces), less that of still air",
        magnitude="first-order for surface models in the open",
        form="Quadratic in the air that passes the hull; 3 % of L^2 exposed ahead and 10 % abeam, at a "
        "yaw arm of L/20 that may move forward (0.09 L per radian of wind before the beam expected, 0 unless "
        "stated), all but the area abeam uncertain; heel, trim and depth are left out. A vehicle "
        "whose file states its areas (`air_front`, `air_side`) has coefficients over the direction instead.",
    ),
    Effect(
        name="trim_weight",
        says="The vehicle is {weight_excess:N:heavier:lighter} in the water than the simulator's.",
        family="trim_weight",
        port="force",
        where=("Z", "M", "Z+M"),
        parameters=(
            EffectParameter(
                "weight_excess", "N", 5e-4, "rho*L**2*U**2/2", about="W - B over that of the vehicle"
            ),
            EffectParameter(
                "x", "m", 0.2, "L", low=-0.5, high=0.5, shape=True, about="where the excess weight sits"
            ),
        ),
        force={
            "X": "-weight_excess*sin(theta)",
            "Y": "weight_excess*cos(theta)*sin(phi)",
            "Z": "weight_excess*cos(theta)*cos(phi)",
            "M": "-x*weight_excess*cos(theta)*cos(phi)",
            "N": "x*weight_excess*cos(theta)*sin(phi)",
        },
        dof=6,
        source="hydrostatics",
        magnitude="0.5-2 % of the weight",
        form="Weight or lost buoyancy at (x, 0, 0), without inertia.",
    ),
    Effect(
        name="surface_suction",
        says="The surface pulls the vehicle up (suction coefficient {Z_s:-}).",
        family="surface_suction",
        port="force",
        where=("Z", "M", "Z+M"),
        parameters=(
            EffectParameter(
                "Z_s", "-", 1e-3, one_sided=True, about="upward suction over rho/2 L^2 u^2 at the surface"
            ),
            EffectParameter("M_s", "-", 3e-4, about="pitch moment over rho/2 L^3 u^2 at the surface"),
            EffectParameter("decay", "L", 0.2, off=0.5, mean=0.5, about="depth over which it falls by e"),
        ),
        force={
            "Z": "-0.5*rho*L*L*u*u*Z_s*exp(-z/(max(decay, 0.02)*L))",
            "M": "0.5*rho*L*L*L*u*u*M_s*exp(-z/(max(decay, 0.02)*L))",
        },
        dof=6,
        source="assumed: exponential in depth, quadratic in speed",
        magnitude="matters within a few diameters of the surface",
        form="Falls exponentially with depth of the origin and goes with speed squared; one length for "
        "force and moment.",
    ),
)
