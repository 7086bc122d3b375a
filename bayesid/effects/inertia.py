"""Mass, its place, and added mass."""

from bayesid.effects.declare import Effect, EffectParameter


def _pulled(towards: str) -> str:
    """Centre of buoyancy with that of the ballast, which displaces as much as it weighs."""
    return f"value + mass_fraction*W*({towards} - value)/max(B + mass_fraction*W, 1e-9)"


EFFECTS = (
    Effect(
        name="cg_offset_x",
        family="cg_offset_x",
        port="force",
        where=("N", "Y+N", "Y"),
        parameters=(EffectParameter("x_G", "m", 0.022, "L", about="change of x_G, forward positive"),),
        adjust={"x_G": "value + x_G"},
        source="Newton-Euler with a shifted centre of mass",
        magnitude="1-2 % of the length",
    ),
    Effect(
        name="cg_offset_y",
        family="cg_offset_y",
        port="force",
        where=("N", "Y+N", "X"),
        parameters=(EffectParameter("y_G", "m", 0.015, "L", about="change of y_G, starboard positive"),),
        adjust={"y_G": "value + y_G"},
        source="Newton-Euler with a shifted centre of mass",
        magnitude="mm to cm",
    ),
    Effect(
        name="ballast_mass",
        family="ballast_mass",
        port="force",
        where=("X", "Y", "N", "Y+N", "X+Y+N"),
        parameters=(
            EffectParameter("mass_fraction", "-", 0.06, about="trapped, neutrally buoyant mass over mass"),
            EffectParameter("x", "m", 0.1, "L", about="its position, forward positive"),
        ),
        adjust={
            "m": "value*(1 + mass_fraction)",
            "x_G": "(value + mass_fraction*x)/(1 + mass_fraction)",
            "Izz": "value*(1 + mass_fraction) + mass_fraction*m*x*x",
            "Iyy": "value*(1 + mass_fraction) + mass_fraction*m*x*x",
            "Ixx": "value*(1 + mass_fraction)",
            # its own weight and buoyancy act at one point, (x, y_G, z_G), and leave no trim behind
            "W": "value*(1 + mass_fraction)",
            "B": "value + mass_fraction*W",
            "x_B": _pulled("x"),
            "y_B": _pulled("y_G"),
            "z_B": _pulled("z_G"),
        },
        source="Newton-Euler with flooded water spread like the hull's own mass and centred at x",
        magnitude="2-8 % where free-flood spaces are uncertain",
    ),
    Effect(
        name="added_mass_error",
        family="added_mass_error",
        port="force",
        where=("X", "Y", "N", "Y+N"),
        parameters=(
            EffectParameter("e_X", "-", 0.1, about="X_udot times (1 + e_X)"),
            EffectParameter("e_Y", "-", 0.1, about="Y_vdot times (1 + e_Y)"),
            EffectParameter("e_N", "-", 0.1, about="N_rdot times (1 + e_N)"),
        ),
        adjust={"X_udot": "value*(1 + e_X)", "Y_vdot": "value*(1 + e_Y)", "N_rdot": "value*(1 + e_N)"},
        source="strip and panel methods against tests",
        magnitude="5-15 %",
    ),
)
