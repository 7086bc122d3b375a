"""Run a model: states, readings and their exact sensitivities for one or many parameter vectors.

Takes a `Model`, a `Plan` (time steps and inputs of one run) and parameters in SI. Gives arrays.
Does not read files, choose parameters or judge a fit.

Signal order: command -> actuator chain -> forces in moving water -> state -> sensors. RK4 with fixed steps,
actuator positions held at their mean over each step, commands held between their samples.
"""

from bayesid.simulate.batch import THREADED_FROM, gradient_batch, simulate_batch
from bayesid.simulate.closed import fly, steady_start
from bayesid.simulate.maps import Maps, Readings, inertia_ratio, interval_maps, readings_on
from bayesid.simulate.plan import STEP_PER_LENGTH, Plan, plan_run, plan_trial_run
from bayesid.simulate.prepare import actuate
from bayesid.simulate.rates import rates_on
from bayesid.simulate.sensors import observe, observe_sensitivity
from bayesid.simulate.single import Sensitivity, Track, gradient, sensitivities, simulate

__all__ = [
    "STEP_PER_LENGTH",
    "THREADED_FROM",
    "Maps",
    "Plan",
    "Readings",
    "Sensitivity",
    "Track",
    "actuate",
    "fly",
    "gradient",
    "gradient_batch",
    "inertia_ratio",
    "interval_maps",
    "observe",
    "observe_sensitivity",
    "plan_run",
    "plan_trial_run",
    "rates_on",
    "readings_on",
    "sensitivities",
    "simulate",
    "simulate_batch",
    "steady_start",
]
