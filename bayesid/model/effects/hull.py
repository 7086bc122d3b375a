"""Hull forces beyond the coefficient set."""

from bayesid.model.effects.declare import Effect, EffectParameter, State

# Five-point Gauss-Legendre over the length: exact for the quadratic parts, 0.3 % where v + x r changes sign.
_GAUSS = (
    (-0.9061798459386640, 0.2369268850561891),
    (-0.5384693101056831, 0.4786286704993665),
    (0.0, 0.5688888888888889),
    (0.5384693101056831, 0.4786286704993665),
    (0.9061798459386640, 0.2369268850561891),
)


# From 0 to 1 within about two lengths travelled, which the surge of a hull cannot tell from at once.
_BEGUN = "0.5*(1 + tanh(2*(t - onset)*U_ref/L))"


def _strip(arm: bool) -> str:
    parts = []
    for xi, weight in _GAUSS:
        speed = f"(v + {0.5 * xi!r}*L*r)"
        lever = f"*{0.5 * xi!r}*L" if arm else ""
        parts.append(f"{0.5 * weight!r}*(1 + tilt*{xi!r}){lever}*{speed}*abs({speed})")
    return "-0.5*rho*Cd*height*L*(" + " + ".join(parts) + ")"


EFFECTS = (
    Effect(
        name="crossflow_drag",
        says="The hull's cross-flow drag coefficient is {Cd:-:higher:lower} than the simulator's.",
        family="crossflow_drag",
        port="force",
        where=("Y", "N", "Y+N"),
        parameters=(
            EffectParameter("Cd", "-", 0.5, low=-1, high=3, about="extra strip drag coefficient"),
            EffectParameter(
                "tilt",
                "-",
                0.3,
                low=-1,
                high=1,
                shape=True,
                about="its fore-aft imbalance, bow heavier if positive",
            ),
        ),
        force={"Y": _strip(arm=False), "N": _strip(arm=True)},
        source="strip theory as in Healey & Lienard (1993)",
        magnitude="10-50 % of the cross-flow drag",
        form="Strips of constant height (diameter, or strip height of the file) in sway and yaw only, "
        "quadratic, weighed 1 + tilt 2x/L; heave of the strip is left out. Alternative: "
        "crossflow_drag_midships, strips that end in points.",
        as_form="also",
    ),
    Effect(
        name="cubic_damping",
        says="The hull resists large drift or turning with a cubic force.",
        family="cubic_damping",
        port="force",
        where=("Y", "N", "Y+N"),
        parameters=(
            EffectParameter("Y_vvv", "N*s^3/m^3", 3.0, "rho*L**2/(2*U)", about="sway force over v^3"),
            EffectParameter("N_rrr", "N*m*s^3", 0.03, "rho*L**6/(2*U)", about="yaw moment over r^3"),
        ),
        force={"Y": "Y_vvv*v*v*v", "N": "N_rrr*r*r*r"},
        source="cubic terms of ship models (Abkowitz form)",
        magnitude="matters at large drift angles only",
        form="Pure cubes of sway and yaw rate; mixed terms and any other odd power are left out.",
        as_form="also",
    ),
    Effect(
        name="fluid_memory",
        says="{fraction:%} of the hull's lift follows the drift with a lag of {lag:L/U}.",
        family="fluid_memory",
        port="force",
        where=("Y", "N", "Y+N"),
        parameters=(
            EffectParameter(
                "fraction", "-", 0.4, low=0, high=1, about="share of the hull lift that answers with a lag"
            ),
            EffectParameter(
                "lag",
                "L/U",
                0.7,
                off=1.5,
                mean=1.5,
                low=0,
                high=10,
                about="time constant in hull lengths travelled",
            ),
        ),
        states=(State("v_lagged", "(v - v_lagged)*abs(u)/(max(lag, 0.05)*L)", "v"),),
        force={
            "Y": "fraction*coef('Y_v')*u*(v_lagged - v)",
            "N": "fraction*coef('N_v')*u*(v_lagged - v)",
        },
        source="first-order form of a memory integral (Cummins 1962)",
        magnitude="time constants of one to two L/U",
        form="One lag for the lift by sway (Y_v, N_v), none for that by yaw rate; measured in lengths "
        "travelled.",
    ),
    Effect(
        name="hull_asymmetry",
        says="The hull turns to one side when it drifts: it is not symmetric.",
        family="hull_asymmetry",
        port="force",
        where=("N", "Y+N", "rudder"),
        parameters=(EffectParameter("N_u_abs_v", "N*s^2/m", 0.0017, "rho*L**3/2", about="N += a u |v|"),),
        force={"N": "N_u_abs_v*u*abs(v)"},
        source="assumed: appendages or list that add the same moment at either drift side",
        magnitude="a few per cent of N_v",
        form="A yaw moment alone, even in sway; no side force with it. One propeller behind a rudder makes a "
        "hull asymmetric as well, so it is part of a model form.",
        as_form="also",
    ),
    Effect(
        name="hull_misalignment",
        says="Something on the hull is out of line: at the usual speed it pushes {side_force:N:to starboard:"
        "to port} and turns {yaw_moment:N m:to starboard:to port}.",
        family="hull_misalignment",
        port="force",
        where=("N", "Y+N", "Y", "rudder"),
        parameters=(
            EffectParameter(
                "side_force", "N", 3e-4, "rho*L**2*U**2/2", about="at the usual speed, to starboard"
            ),
            EffectParameter(
                "yaw_moment", "N*m", 3e-4, "rho*L**3*U**2/2", about="at the usual speed, to starboard"
            ),
        ),
        force={"Y": "side_force*u*abs(u)/U_ref**2", "N": "yaw_moment*u*abs(u)/U_ref**2"},
        source="Y_* and N_* of the standard equations (Gertler & Hagen 1967)",
        magnitude="equal to some degrees of rudder after damage, one where a fin is bolted on askew",
        form="A side force and a yaw moment with the square of the speed, each of its own size; that of a "
        "rudder set askew is rudder_offset, that of a propeller goes with its thrust. One propeller behind a "
        "hull has as much: where the equations lack a force it is told only beside a cause in whose place it "
        "explains more.",
        as_form="alone",
    ),
    Effect(
        name="drag_step",
        says="From {onset:s} after the start of a run on, the vehicle has {extra_drag:N:more:less} drag at "
        "its usual speed.",
        family="drag_step",
        port="force",
        where=("X", "rpm"),
        parameters=(
            EffectParameter("extra_drag", "N", 1e-3, "rho*L**2*U**2/2", about="at the usual speed"),
            EffectParameter(
                "onset",
                "s",
                1000.0,
                off=1.0,
                mean=600.0,
                low=0,
                dated=True,
                about="time from the first sample of each run",
            ),
        ),
        force={"X": f"-extra_drag*u*abs(u)/U_ref**2*{_BEGUN}"},
        smooth=False,
        source="assumed: a mast, a flap or a line put out, something caught on the hull",
        magnitude="10-30 % of the drag",
        form="With the square of the speed, from nothing to all of it within two lengths travelled, at the "
        "same time of every run; drag all along is hull_fouling or tether_drag.",
    ),
    Effect(
        name="tether_drag",
        says="Something dragged at the stern, such as a tether, brakes the vehicle.",
        family="tether_drag",
        port="force",
        where=("X+Y+N", "X", "Y+N", "N", "rpm"),
        parameters=(
            EffectParameter(
                "k", "N*s^2/m^2", 2e-4, "rho*L**2/2", one_sided=True, about="quadratic drag at the stern"
            ),
        ),
        force={
            "X": "-k*u*sqrt(u*u + (v - 0.5*L*r)**2)",
            "Y": "-k*(v - 0.5*L*r)*sqrt(u*u + (v - 0.5*L*r)**2)",
            "N": "0.5*L*k*(v - 0.5*L*r)*sqrt(u*u + (v - 0.5*L*r)**2)",
        },
        source="line drag at x = -L/2",
        magnitude="2-10 % of the hull drag",
        form="Quadratic line drag in the water at the stern, x = -L/2, horizontal.",
    ),
    Effect(
        name="asymmetry_in_turns",
        says="Turns to port and to starboard are no mirror images of each other, as when the vehicle lists.",
        family="asymmetry_in_turns",
        port="force",
        where=("Y+N", "Y", "N"),
        parameters=(
            EffectParameter("Y_vv", "N*s^2/m^2", 0.00125, "rho*L**2/2", about="side force over v^2"),
            EffectParameter("Y_vr", "N*s^2/m", 0.0008, "rho*L**3/2", about="side force over v r"),
            EffectParameter("Y_rr", "N*s^2", 0.00055, "rho*L**4/2", about="side force over r^2"),
            EffectParameter("N_vv", "N*s^2/m", 0.00038, "rho*L**3/2", about="yaw moment over v^2"),
            EffectParameter("N_vr", "N*s^2", 0.00024, "rho*L**4/2", about="yaw moment over v r"),
            EffectParameter("N_rr", "N*m*s^2", 0.00016, "rho*L**5/2", about="yaw moment over r^2"),
        ),
        force={"Y": "Y_vv*v*v + Y_vr*v*r + Y_rr*r*r", "N": "N_vv*v*v + N_vr*v*r + N_rr*r*r"},
        source="even part of second order in drift and turning (Abkowitz 1964), which the port-starboard "
        "symmetry of a hull forbids",
        magnitude="1 % of the hull's force in a turn at a list of 8 degrees",
        form="Products of drift and turning, none on a straight course: a side force there is a cause of its "
        "own. Those with the rudder are asymmetry_under_rudder.",
        as_form="only",
        planar=True,
    ),
    Effect(
        name="asymmetry_under_rudder",
        says="Rudder to port and to starboard turns the vehicle differently, as when it lists.",
        family="asymmetry_in_turns",
        port="force",
        where=("Y+N", "Y", "N"),
        parameters=(
            EffectParameter("Y_v_dr", "N*s^2/m^2", 0.001, "rho*L**2/2", about="side force over u v delta"),
            EffectParameter("Y_r_dr", "N*s^2/m", 0.00065, "rho*L**3/2", about="side force over u r delta"),
            EffectParameter(
                "Y_dr_dr", "N*s^2/m^2", 0.0008, "rho*L**2/2", about="side force over u^2 delta^2"
            ),
            EffectParameter("N_v_dr", "N*s^2/m", 0.0003, "rho*L**3/2", about="yaw moment over u v delta"),
            EffectParameter("N_r_dr", "N*s^2", 0.00019, "rho*L**4/2", about="yaw moment over u r delta"),
            EffectParameter("N_dr_dr", "N*s^2/m", 0.00024, "rho*L**3/2", about="yaw moment over u^2 delta^2"),
        ),
        force={
            "Y": "Y_v_dr*u*v*delta_r + Y_r_dr*u*r*delta_r + Y_dr_dr*u*u*delta_r*delta_r",
            "N": "N_v_dr*u*v*delta_r + N_r_dr*u*r*delta_r + N_dr_dr*u*u*delta_r*delta_r",
        },
        source="even part of second order in drift, turning and rudder (Abkowitz 1964), which port-starboard "
        "symmetry forbids",
        magnitude="1 % of the hull's force in a turn at a list of 8 degrees",
        form="Products with the rudder angle; those of drift and turning alone are asymmetry_in_turns.",
        as_form="only",
        planar=True,
    ),
    Effect(
        name="roll_motion",
        says="The vehicle rolls, which this model leaves out.",
        family="roll_motion",
        port="force",
        where=("Y+N", "Y", "N"),
        parameters=(
            EffectParameter("Y_heel", "N", 1e-3, "rho*L**2*U**2/2", about="side force by heel"),
            EffectParameter("N_heel", "N*m", 3e-4, "rho*L**3*U**2/2", about="yaw moment by heel"),
            EffectParameter(
                "frequency",
                "U/L",
                1.5,
                off=4.0,
                mean=4.0,
                low=0.2,
                high=50.0,
                about="natural frequency of roll",
            ),
        ),
        states=(
            State("heel", "heel_rate", "r*L/U_ref", sd=0.3, scale="1"),
            State(
                "heel_rate",
                "frequency*U_ref/L*(frequency*U_ref/L*(r*L/U_ref - heel) - 0.2*heel_rate)",
                sd=0.3,
                scale="U/L",
            ),
        ),
        force={"Y": "Y_heel*heel", "N": "N_heel*heel"},
        source="roll coupled to sway and yaw: Son and Nomoto (1982), J. Soc. Nav. Arch. Japan 150",
        magnitude="heel of some degrees in a turn",
        form="A resonance driven by the yaw rate, damping ratio 0.1; the heel is in units of its value in a "
        "steady turn of r = U/L, so that the forces hold how far the ship heels.",
        as_form="only",
        planar=True,
    ),
)
