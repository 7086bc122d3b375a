"""Effects of the catalogue in another form that is as plausible: the evidence may prefer it.

Takes nothing. Gives `ALTERNATIVES`, declarations as in the catalogue but not part of it: who wants them
weighed adds them (`build_model(..., declared=ALTERNATIVES)`, or, for `bayesid diagnose --effects`, a file
with the line `from bayesid.model.effects.alternatives import ALTERNATIVES as EFFECTS`). Each one is absent
at its off value and belongs to the family of the effect it stands in for, `of(name)`.
"""

from __future__ import annotations

from bayesid.model.effects.declare import RUDDER_WHERE, Effect, EffectParameter
from bayesid.model.effects.inertia import NEUTRAL

# Inflow to the rudder as far as the hull's drift makes it; below a tenth of the usual speed it stops growing.
_INFLOW = "(delta_r - (v - 0.5*L*r)/max(abs(u), 0.1*U_ref))"
# Five-point Gauss-Legendre over the length, weights with 3/2 (1 - xi^2): strips that end in points.
_GAUSS = (
    (-0.9061798459386640, 0.2369268850561891),
    (-0.5384693101056831, 0.4786286704993665),
    (0.0, 0.5688888888888889),
    (0.5384693101056831, 0.4786286704993665),
    (0.9061798459386640, 0.2369268850561891),
)


def of(name: str) -> str:
    """Name of the catalogue effect an alternative stands in for."""
    return _STANDS_FOR[name]


def _stalled(axis: str) -> str:
    s = f"(inverse_stall_angle*{_INFLOW})*(inverse_stall_angle*{_INFLOW})"
    return f"-{s}/(3 + {s})*rows('{axis}', 'delta_r')"


def _race(fin: str) -> str:
    """The race holds what thrust adds; thrust falls linearly with speed, from twice its usual at rest."""
    uc = "(U_ref*n/rpm_ref)"
    return f"k*(abs({uc})*(2*{uc} - u) - u*abs(u))*coef('{fin}')*delta_r"


def _strips(arm: bool) -> str:
    parts = []
    for xi, weight in _GAUSS:
        speed = f"(v + {0.5 * xi!r}*L*r)"
        lever = f"*{0.5 * xi!r}*L" if arm else ""
        parts.append(f"{0.75 * weight * (1.0 - xi * xi)!r}{lever}*{speed}*abs({speed})")
    return "-0.5*rho*Cd*height*L*(" + " + ".join(parts) + ")"


ALTERNATIVES = (
    Effect(
        name="rudder_stall_inflow",
        family="rudder_stall",
        port="force",
        where=RUDDER_WHERE,
        parameters=(
            EffectParameter(
                "inverse_stall_angle", "1/rad", 2.0, one_sided=True, about="reciprocal of the inflow angle"
            ),
        ),
        force={"Y": _stalled("Y"), "N": _stalled("N")},
        smooth=False,
        source="angle of attack of a rudder behind a drifting hull, without straightening (Yasukawa & "
        "Yoshimura 2015 scale it by 0.4-0.6)",
        magnitude="onset at 15-35 degrees of inflow angle",
        form="Same loss of lift as rudder_stall, by the angle between rudder and flow at x = -L/2: in a "
        "steady turn the stern swings outward, the angle falls and lift returns.",
    ),
    Effect(
        name="thrust_decay_late",
        family="thrust_decay",
        port="force",
        where=("X", "rpm"),
        parameters=(EffectParameter("loss_per_600s", "-", 0.2, about="share lost after 600 s of each run"),),
        force={"X": "-loss_per_600s*(t/600)*(t/600)*thrust()"},
        source="assumed: square of time, a discharge curve that bends down at its end",
        magnitude="5-15 % over a charge",
        form="As thrust_decay, but slow at first and fast at the end.",
    ),
    Effect(
        name="rudder_propeller_interaction_loading",
        family="rudder_propeller_interaction",
        port="force",
        where=RUDDER_WHERE,
        parameters=(EffectParameter("k", "-", 0.4, about="u^2 delta becomes (u^2 + k w^2) delta"),),
        force={"Y": _race("Y_dr"), "N": _race("N_dr")},
        source="momentum theory of the race; thrust at rest twice that of self-propulsion, as in the "
        "built-in submarines",
        magnitude="rudder force rises by tens of per cent when the hull slows in a turn",
        form="As rudder_propeller_interaction, w^2 by a thrust that falls with advance: zero when "
        "self-propelled, half as strong again when slowed a little, twice at rest.",
    ),
    Effect(
        name="crossflow_drag_midships",
        family="crossflow_drag",
        port="force",
        where=("Y", "N", "Y+N"),
        parameters=(EffectParameter("Cd", "-", 0.5, about="extra drag coefficient, mean over the length"),),
        force={"Y": _strips(arm=False), "N": _strips(arm=True)},
        source="strip theory as in Healey & Lienard (1993)",
        magnitude="10-50 % of the cross-flow drag",
        form="As crossflow_drag for strips 3/2 (1 - (2x/L)^2) as high: ends that taper give the same sway "
        "force and half the yaw damping.",
    ),
    Effect(
        name="ballast_mass_point",
        family="ballast_mass",
        port="force",
        where=("X", "Y", "N", "Y+N", "X+Y+N"),
        parameters=(
            EffectParameter("mass_fraction", "-", 0.06, about="trapped, neutrally buoyant mass over mass"),
            EffectParameter("x", "m", 0.1, "L", shape=True, about="its position, forward positive"),
        ),
        adjust={
            **NEUTRAL,
            "Ixx": "value + mass_fraction*m*(y_G*y_G + z_G*z_G)",
            "Iyy": "value + mass_fraction*m*(x*x + z_G*z_G)",
            "Izz": "value + mass_fraction*m*(x*x + y_G*y_G)",
            "Ixy": "value + mass_fraction*m*x*y_G",
            "Ixz": "value + mass_fraction*m*x*z_G",
            "Iyz": "value + mass_fraction*m*y_G*z_G",
        },
        source="Newton-Euler with a point mass",
        magnitude="2-8 % where free-flood spaces are uncertain",
        form="As ballast_mass, all of it at one point: m r^2 and no moment of inertia of its own.",
    ),
    Effect(
        name="hull_fouling_all",
        family="thrust_or_drag",
        port="force",
        where=("X", "rpm"),
        parameters=(EffectParameter("drag_increase", "-", 0.25, about="straight-ahead drag, every row"),),
        force={"X": "drag_increase*drag()"},
        source="assumed: the linear row of a set is a fit of the same friction",
        magnitude="slime up to +70 % skin friction",
        form="As hull_fouling, a linear row X_u0 grows too; the same on sets without one.",
    ),
    Effect(
        name="propeller_side_force_arm",
        family="propeller_side_force",
        port="force",
        where=("Y", "N", "Y+N", "rudder"),
        parameters=(
            EffectParameter("side_force", "-", 0.1, about="share of thrust to starboard at the propeller"),
            EffectParameter("arm", "L", 0.05, off=0.5, mean=0.5, about="propeller aft of the origin"),
        ),
        force={"Y": "side_force*thrust()", "N": "-arm*L*side_force*thrust()"},
        source="assumed: proportional to thrust",
        magnitude="1-3 % of thrust; equal to about 1 degree of rudder",
        form="As propeller_side_force, the place of the propeller unknown to 5 % of the length.",
    ),
)
_STANDS_FOR = {
    "rudder_stall_inflow": "rudder_stall",
    "thrust_decay_late": "thrust_decay",
    "rudder_propeller_interaction_loading": "rudder_propeller_interaction",
    "crossflow_drag_midships": "crossflow_drag",
    "ballast_mass_point": "ballast_mass",
    "hull_fouling_all": "hull_fouling",
    "propeller_side_force_arm": "propeller_side_force",
}
