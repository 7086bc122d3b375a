"""Mass, its place, and added mass."""

from bayesid.model.effects.declare import Effect, EffectParameter


def _pulled(towards: str) -> str:
    """Centre of buoyancy with that of the ballast, which displaces as much as it weighs."""
    return f"value + mass_fraction*W*({towards} - value)/max(B + mass_fraction*W, 1e-9)"


# Trapped water at (x, y_G, z_G): its weight and its buoyancy act at one point and leave no trim behind.
NEUTRAL = {
    "m": "value*(1 + mass_fraction)",
    "x_G": "(value + mass_fraction*x)/(1 + mass_fraction)",
    "W": "value*(1 + mass_fraction)",
    "B": "value + mass_fraction*W",
    "x_B": _pulled("x"),
    "y_B": _pulled("y_G"),
    "z_B": _pulled("z_G"),
}
EFFECTS = (
    Effect(
        name="cg_offset_x",
        says="The centre of gravity lies {x_G:m:forward:aft} of where the simulator has it.",
        family="cg_offset_x",
        port="force",
        where=("N", "Y+N", "Y"),
        parameters=(
            EffectParameter(
                "x_G", "m", 0.022, "L", low=-0.1, high=0.1, about="change of x_G, forward positive"
            ),
        ),
        adjust={"x_G": "value + x_G"},
        source="Newton-Euler with a shifted centre of mass",
        magnitude="1-2 % of the length",
        form="The centre of gravity moves, the moments of inertia about the origin stay: ballast shifted"
        " by a little. Trim follows in 6-DOF through the weight; the centre of buoyancy stays.",
    ),
    Effect(
        name="cg_offset_y",
        says="The centre of gravity lies {y_G:m:to starboard:to port} of where the simulator has it.",
        family="cg_offset_y",
        port="force",
        where=("N", "Y+N", "X"),
        parameters=(
            EffectParameter(
                "y_G", "m", 0.015, "L", low=-0.05, high=0.05, about="change of y_G, starboard positive"
            ),
        ),
        adjust={"y_G": "value + y_G"},
        source="Newton-Euler with a shifted centre of mass",
        magnitude="mm to cm",
        form="The centre of gravity moves, the moments of inertia about the origin stay. Heel follows in"
        " 6-DOF through the weight; the centre of buoyancy stays.",
    ),
    Effect(
        name="ballast_mass",
        says="The vehicle carries {mass_fraction:%:more:less} mass than the simulator's.",
        family="ballast_mass",
        port="force",
        where=("X", "Y", "N", "Y+N", "X+Y+N"),
        parameters=(
            EffectParameter(
                "mass_fraction",
                "-",
                0.06,
                low=0.0,
                high=0.5,
                about="trapped, neutrally buoyant mass over mass",
            ),
            EffectParameter(
                "x", "m", 0.1, "L", low=-0.5, high=0.5, shape=True, about="its position, forward positive"
            ),
        ),
        adjust={
            **NEUTRAL,
            # spread like the hull's own mass, but about x instead of x_G (parallel axes)
            "Ixx": "value*(1 + mass_fraction)",
            "Iyy": "value + mass_fraction*(value + m*(x*x - x_G*x_G))",
            "Izz": "value + mass_fraction*(value + m*(x*x - x_G*x_G))",
            "Ixy": "value + mass_fraction*(value + m*(x - x_G)*y_G)",
            "Ixz": "value + mass_fraction*(value + m*(x - x_G)*z_G)",
            "Iyz": "value*(1 + mass_fraction)",
        },
        source="Newton-Euler with flooded water spread like the hull's own mass and centred at x",
        magnitude="2-8 % where free-flood spaces are uncertain",
        form="Water spread like the hull's own mass about (x, y_G, z_G), so it brings its own moment of "
        "inertia and m r^2; neutral, so it leaves no trim; added mass stays. Alternative: "
        "ballast_mass_point, a lump at x with m r^2 alone.",
    ),
    Effect(
        name="added_mass_error",
        says="The added mass differs from the simulator's: surge {e_X:+%}, sway {e_Y:+%}, yaw {e_N:+%}.",
        family="added_mass_error",
        port="force",
        where=("X", "Y", "N", "Y+N"),
        parameters=(
            EffectParameter("e_X", "-", 0.1, low=-1, high=3, about="X_udot times (1 + e_X)"),
            EffectParameter("e_Y", "-", 0.1, low=-0.7, high=1.5, about="Y_vdot times (1 + e_Y)"),
            EffectParameter("e_N", "-", 0.1, low=-0.7, high=1.5, about="N_rdot times (1 + e_N)"),
        ),
        adjust={"X_udot": "value*(1 + e_X)", "Y_vdot": "value*(1 + e_Y)", "N_rdot": "value*(1 + e_N)"},
        source="strip and panel methods against tests",
        magnitude="5-15 %",
        form="The accelerations alone: X_udot, Y_vdot, N_rdot. The moments potential flow ties to them "
        "(X_vr, Munk) are coefficients of their own and stay, as does heave.",
    ),
)
