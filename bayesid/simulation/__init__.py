"""Run a model: states, readings and their exact sensitivities for one or many parameter vectors.

Takes a `Model`, a `TimePlan` (time steps and inputs of one run) and parameters in SI. Gives arrays.
Does not read files, choose parameters or judge a fit.

Signal order: command -> actuator chain -> forces in moving water -> state -> sensors. RK4 with fixed steps,
actuator positions on a straight line over each step, commands held between their samples.
"""

from bayesid.simulation.accelerations import rates_on
from bayesid.simulation.actuation import actuate, mean_positions, positions_at_samples
from bayesid.simulation.batch import THREADED_FROM, gradient_batch, simulate_batch
from bayesid.simulation.closed_loop import carried_by_water, run_manoeuvre, steady_start
from bayesid.simulation.interval_maps import (
    Chain,
    Maps,
    Readings,
    chain_of,
    inertia_ratio,
    interval_maps,
    part_of,
    readings_on,
)
from bayesid.simulation.prepare import with_own_states
from bayesid.simulation.sensors import observe, observe_sensitivity
from bayesid.simulation.shaft_speed import (
    shaft_speed_note,
    shaft_speed_words,
    with_shaft_speed,
)
from bayesid.simulation.single import Sensitivity, Track, gradient, sensitivities, simulate
from bayesid.simulation.time_plan import STEP_PER_LENGTH, TimePlan, plan_run, plan_trial_run

__all__ = [
    "STEP_PER_LENGTH",
    "THREADED_FROM",
    "Maps",
    "TimePlan",
    "Readings",
    "Sensitivity",
    "Track",
    "actuate",
    "carried_by_water",
    "run_manoeuvre",
    "gradient",
    "gradient_batch",
    "inertia_ratio",
    "Chain",
    "chain_of",
    "interval_maps",
    "mean_positions",
    "observe",
    "observe_sensitivity",
    "part_of",
    "positions_at_samples",
    "plan_run",
    "plan_trial_run",
    "rates_on",
    "readings_on",
    "sensitivities",
    "shaft_speed_note",
    "shaft_speed_words",
    "simulate",
    "simulate_batch",
    "steady_start",
    "with_own_states",
    "with_shaft_speed",
]
