"""Fin forces that differ from the model's."""

from bayesid.model.effects.declare import RUDDER_WHERE, Effect, EffectParameter


def _stalled(axis: str) -> str:
    """What 1/(1 + s/3) takes away, s = (delta/delta_stall)^2."""
    s = "inverse_stall_angle**2*delta_r**2"
    return f"-{s}/(3 + {s})*rows('{axis}', 'delta_r')"


EFFECTS = (
    Effect(
        name="rudder_effectiveness",
        says="The rudder gives {loss:%:less:more} side force than the simulator's.",
        family="rudder_effectiveness",
        port="force",
        where=RUDDER_WHERE,
        parameters=(
            EffectParameter(
                "loss",
                "-",
                0.2,
                low=-1,
                high=1,
                about="share missing of the side force and moment that go with the rudder's angle; "
                "what it does amidships stays",
            ),
        ),
        force={"Y": "-loss*rows('Y', 'delta_r')", "N": "-loss*rows('N', 'delta_r')"},
        source="scale effect on rudder and wake (ITTC 7.5-04-02-01)",
        magnitude="5-30 %",
        form="Every row of Y and N that reads the rudder, by the same share; roll by the rudder and its "
        "drag stay.",
    ),
    Effect(
        name="rudder_asymmetry",
        says="The rudder is {asymmetry:%:stronger:weaker} to port, the opposite to starboard.",
        family="rudder_asymmetry",
        port="force",
        where=RUDDER_WHERE,
        parameters=(
            EffectParameter(
                "asymmetry",
                "-",
                0.1,
                low=-1,
                high=1,
                about="rudder forces times (1 + asymmetry sgn(delta_r))",
            ),
        ),
        force={
            "Y": "asymmetry*sgn(delta_r)*rows('Y', 'delta_r')",
            "N": "asymmetry*sgn(delta_r)*rows('N', 'delta_r')",
        },
        source="port/starboard differences of free-running models, e.g. Phys. Fluids 33, 127117 (2021)",
        magnitude="3-10 %",
        form="Every row of Y and N that reads the rudder, more to one side and less to the other.",
    ),
    Effect(
        name="rudder_stall",
        says="The rudder stalls at an inflow of about {inverse_stall_angle:1/deg}.",
        family="rudder_stall",
        port="force",
        where=RUDDER_WHERE,
        parameters=(
            EffectParameter(
                "inverse_stall_angle",
                "1/rad",
                2.0,
                one_sided=True,
                about="reciprocal of the stall angle, 0 = none",
            ),
        ),
        force={"Y": _stalled("Y"), "N": _stalled("N")},
        smooth=False,
        source="assumed: lift factor 1/(1 + (delta/delta_stall)^2/3), a cubic or tanh stall to second order",
        magnitude="onset at 15-35 degrees of inflow angle",
        form="Smooth loss of lift with the rudder angle, no break; every row of Y and N that reads the "
        "rudder. Alternative: rudder_stall_inflow, by the angle of the flow at the stern.",
    ),
    Effect(
        name="rudder_propeller_interaction",
        says="The rudder's force follows the propeller's slipstream (share {k:%}) not the speed alone.",
        family="rudder_propeller_interaction",
        port="force",
        where=RUDDER_WHERE,
        parameters=(
            EffectParameter("k", "-", 0.4, low=-1, high=3, about="u^2 delta becomes (u^2 + k w_n^2) delta"),
        ),
        force={
            "Y": "k*(U_ref**2*n*abs(n)/rpm_ref**2 - u*abs(u))*coef('Y_dr')*delta_r",
            "N": "k*(U_ref**2*n*abs(n)/rpm_ref**2 - u*abs(u))*coef('N_dr')*delta_r",
        },
        source="slipstream over the rudder: Yasukawa & Yoshimura (2015); w_n^2 is zero when self-propelled",
        magnitude="rudder force rises by tens of per cent when the hull slows in a turn",
        form="Speed of the race by revolutions squared less speed squared, which is zero when self-"
        "propelled; Y_dr and N_dr alone. Alternative: rudder_propeller_interaction_loading, by a "
        "thrust that falls with advance.",
    ),
    Effect(
        name="stern_plane_effectiveness",
        says="The stern planes give {loss:%:less:more} force than the simulator's.",
        family="stern_plane_effectiveness",
        port="force",
        where=("M", "Z+M"),
        parameters=(
            EffectParameter(
                "loss",
                "-",
                0.2,
                low=-1,
                high=1,
                about="share of the stern planes' force and moment that is missing",
            ),
        ),
        force={"Z": "-loss*rows('Z', 'delta_s')", "M": "-loss*rows('M', 'delta_s')"},
        dof=6,
        source="scale effect on fins and wake",
        magnitude="5-30 %",
        form="Every row of Z and M that reads the stern planes, by the same share.",
    ),
)
