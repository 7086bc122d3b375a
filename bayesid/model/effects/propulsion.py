"""Thrust, drag and what the propeller does besides pushing."""

from bayesid.model.effects.declare import Effect, EffectParameter

EFFECTS = (
    Effect(
        name="thrust_loss",
        says="The propeller gives {loss:%:less:more} thrust than the simulator's.",
        family="thrust_or_drag",
        port="force",
        where=("X", "rpm"),
        parameters=(
            EffectParameter("loss", "-", 0.15, low=-1, high=1, about="share of the thrust that is missing"),
        ),
        force={"X": "-loss*thrust()"},
        source="assumed: thrust in proportion",
        magnitude="2-10 % of revolutions, twice that of thrust",
        form="The rows that read the revolutions, by the same share at every speed; wake and deduction stay.",
    ),
    Effect(
        name="thrust_decay",
        says="The thrust changes by {loss_per_600s:-%} in ten minutes.",
        family="thrust_decay",
        port="force",
        where=("X", "rpm"),
        parameters=(
            EffectParameter(
                "loss_per_600s",
                "-",
                0.2,
                low=-1,
                high=1,
                about="thrust falls by this share in 600 s of each run",
            ),
        ),
        force={"X": "-loss_per_600s*t/600*thrust()"},
        source="assumed: linear in time (battery voltage under load)",
        magnitude="5-15 % over a charge",
        form="Linear in time from the first sample of each run. Alternative: thrust_decay_late, with the"
        " square of time, as a battery at its end.",
    ),
    Effect(
        name="hull_fouling",
        says="The hull has {drag_increase:%:more:less} drag straight ahead than the simulator's.",
        family="thrust_or_drag",
        port="force",
        where=("X", "rpm"),
        parameters=(
            EffectParameter(
                "drag_increase",
                "-",
                0.25,
                low=-0.5,
                high=3,
                about="straight-ahead drag that goes with speed squared, times (1 + drag_increase)",
            ),
        ),
        force={"X": "drag_increase*quadratic_drag()"},
        source="Schultz et al. (2015), Biofouling 31, 759; Schultz (2007), Biofouling 23, 331",
        magnitude="slime up to +70 % skin friction",
        form="Roughness raises turbulent friction, which goes with speed squared: X_u|u|, X_uu and the "
        "u|u| row of the propulsion. A linear row X_u0 stays, and so does drag by drift. "
        "Alternative: hull_fouling_all, every straight-ahead row.",
    ),
    Effect(
        name="power_of_drag",
        says="Drag goes with another power of the speed than the simulator's: {power:+} beside two.",
        family="power_of_drag",
        port="force",
        where=("X",),
        parameters=(EffectParameter("power", "-", 0.2, low=-1, high=2, about="of the speed, beyond two"),),
        force={"X": "quadratic_drag()*((max(abs(u), 0.02*U_ref)/U_ref)**power - 1)"},
        source="friction of turbulent flow (1.8 to 1.9), waves of a hull at the surface (more than two)",
        magnitude="powers of 1.8 to 2.3",
        form="Nothing at the reference speed, where the simulator was tuned; below a fiftieth of it the "
        "share of drag stays.",
        as_form="only",
    ),
    Effect(
        name="propeller_side_force",
        says="The propeller pushes the stern aside with {side_force:%:of its thrust to starboard:"
        "of its thrust to port}.",
        family="propeller_side_force",
        port="force",
        where=("Y", "N", "Y+N", "rudder"),
        parameters=(
            EffectParameter(
                "side_force",
                "-",
                0.1,
                low=-0.5,
                high=0.5,
                about="share of thrust to starboard at the propeller",
            ),
        ),
        force={"Y": "side_force*thrust()", "N": "-0.5*L*side_force*thrust()"},
        source="assumed: proportional to thrust, propeller at x = -L/2",
        magnitude="1-3 % of thrust; equal to about 1 degree of rudder",
        form="A share of thrust at x = -L/2, where a stern propeller works when the origin is near "
        "midships; no file states the place. Alternative: propeller_side_force_arm, its place "
        "unknown.",
    ),
    Effect(
        name="propeller_torque",
        says="The propeller lists the vehicle with {torque:N m} more torque than the simulator's.",
        family="propeller_torque",
        port="force",
        where=("K",),
        parameters=(
            EffectParameter(
                "torque", "N*m", 2e-5, "rho*L**3*U**2/2", about="beyond the file's, at the reference rpm"
            ),
        ),
        force={"K": "torque*n*abs(n)/rpm_ref**2"},
        dof=6,
        source="reaction of the propeller torque; list of 5 degrees on REMUS",
        magnitude="a list of a few degrees",
        form="With revolutions squared, whatever the speed; the torque of the file is kept.",
    ),
)
