"""Print the equations of motion as numba source: forward runs, lanes, linearisation, adjoint, actuators,
sensors.

Takes the graph of `dynamics.build`. Gives the text of one Python module per `KernelSpec` with two sets of
functions, the bare model (`bare_...`) and the model with every catalogue effect (`full_...`), on one
parameter layout. Does not compile: numba does when a function is first called. Does not choose where the
text is kept (`kernel_cache`).
"""

from __future__ import annotations

from bayesid.equations.dynamics import build
from bayesid.equations.kernel_digest import equations_digest
from bayesid.equations.layout import KernelSpec
from bayesid.equations.print_actuators import actuate_lines
from bayesid.equations.print_adjoint import adjoint_lanes_lines, adjoint_lines
from bayesid.equations.print_context import LANES, Context, names_tuple
from bayesid.equations.print_forward import lanes_lines, simulate_lines
from bayesid.equations.print_mass import mass_lines, start_lines
from bayesid.equations.print_sensitivities import layout_lines, variational_lines
from bayesid.equations.print_sensors import sense_lines
from bayesid.model.effects import CATALOGUE, Effect

_HEAD = "Printed by bayesid.equations.generate from the term table and the effects: do not edit."
_PARTS = (
    mass_lines,
    start_lines,
    simulate_lines,
    lanes_lines,
    layout_lines,
    variational_lines,
    adjoint_lines,
    adjoint_lanes_lines,
    sense_lines,
    actuate_lines,
)


def module_source(spec: KernelSpec, effects: tuple[Effect, ...] = CATALOGUE) -> str:
    """Text of one kernel module.

    Parameters
    ----------
    spec : KernelSpec
    effects : declarations to compile in, each at its off value unless a parameter says otherwise
    """
    used = tuple(e for e in effects if e.acts_in(spec.dof))
    sets = [
        Context("bare", build(spec, effects, active=False), ()),
        Context("full", build(spec, effects, active=True), used),
    ]
    layout = sets[1].dyn
    out = [
        f'"""{_HEAD}"""',
        "",
        "import math",
        "",
        "import numpy as np",
        "from numba import njit",
        "",
        f'EQUATIONS = "{equations_digest(layout, used)}"',
        f"LANES = {LANES}",
        f"PARAMETERS = {names_tuple(layout.parameters)}",
        f"ACTUATORS = {names_tuple(layout.actuators)}",
        f"EXOGENOUS = {names_tuple(layout.exogenous)}",
        f"VELOCITIES = {names_tuple(layout.velocities)}",
        f"CHANNELS = {names_tuple(layout.channels)}",
        f"EFFECTS = {names_tuple(e.name for e in used)}",
    ]
    for one in sets:
        out += ["", f"{one.upper}_STATES = {names_tuple(one.dyn.states)}", ""]
        for part in _PARTS:
            out += ["", *part(one), ""]
    return "\n".join(out) + "\n"
