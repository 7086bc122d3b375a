"""True vehicles executed by the independent plant: equations, servo and integration are not those fitted.

Takes a `PlanningCase` and coefficients. Gives runs as its logger would write them, and what a prediction
misses of them. Does not fit.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from bayesid.analysis.design import PlanningCase
from bayesid.analysis.design.information import laid_out
from bayesid.benchmark.plant import RunPlan, ordered_run
from bayesid.benchmark.plant.body import Body, build, cruising_speed
from bayesid.benchmark.plant.execute_run import PlantTrack, execute_run, start_state
from bayesid.benchmark.plant.orders import orders_for
from bayesid.benchmark.plant.sensing import read
from bayesid.benchmark.plant.settings import settings
from bayesid.errors import ModelError
from bayesid.estimation.run_data import RunData
from bayesid.manoeuvres import Manoeuvre, OpenLoop
from bayesid.simulation import simulate

Array = np.ndarray
SETTLING = 12.0  # L/U of straight run before a record starts
PLAIN = settings({})


@dataclass(frozen=True, eq=False)
class PlantVehicles:
    """True vehicles of a case, as `paired_outcomes` asks for them."""

    case: PlanningCase

    def logged(self, par: Array, manoeuvre: Manoeuvre, rng: np.random.Generator, name: str = "") -> RunData:
        """A run as its sensors give it, with the noise they are stated to have."""
        run, clean = self._executed(par, manoeuvre, name)
        readings = clean + rng.standard_normal(clean.shape) * run.sigma
        begun = {c: float(readings[0, j]) for j, c in enumerate(run.channels)}
        x0 = np.array([begun.get(s, x) for s, x in zip(self.case.model.states, run.x0, strict=True)])
        return replace(run, readings=readings, x0=x0)

    def missed(self, values: Array, par: Array, manoeuvre: Manoeuvre) -> float:
        """Rms error over sensor noise, from the true start with the true orders; inf if it diverges."""
        model = self.case.model
        run, clean = self._executed(par, manoeuvre, "")
        guess = np.array(par)
        guess[self.case.knowledge.where] = values
        start = {c: float(clean[0, j]) for j, c in enumerate(run.channels)}
        x0 = np.array([start.get(s, x) for s, x in zip(self.case.model.states, run.x0, strict=True)])
        picked = [model.states.index(c) for c in run.channels]
        try:
            found = simulate(model, guess, run.plan, x0).states[:, picked]
        except ModelError:
            return float("inf")
        return float(np.sqrt(np.mean(((found - clean) / run.sigma) ** 2)))

    def _executed(self, par: Array, manoeuvre: Manoeuvre, name: str) -> tuple[RunData, Array]:
        """Layout of the run, and its readings without noise (n, c)."""
        case, model = self.case, self.case.model
        run, track = self._track(par, manoeuvre)
        seen = read(track, PLAIN)
        orders = dict(zip(("delta_r_cmd", "delta_s_cmd", "n_cmd"), track.orders.T, strict=True))
        commands = {n: orders[n] for n in ("delta_r_cmd", "n_cmd")}
        x0 = np.array([float(seen[s][0]) for s in model.states])
        layout = laid_out(model, track.t, commands, x0, case.logging, name or run.name)
        step = max(1, round(case.logging.dt / run.dt))
        return layout, np.stack([seen[c][::step] for c in layout.channels], axis=1)

    def _track(self, par: Array, manoeuvre: Manoeuvre) -> tuple[RunPlan, PlantTrack]:
        model = self.case.model
        ship, usual = model.vehicle, float(model.vehicle.rpm_ref or 0.0)
        coef = {n: float(par[model.index[n]]) / model.file_scale(n) for n in ship.coef if n in model.index}
        body = build(ship, coef, 3, PLAIN)
        dt = float(np.median(np.diff(manoeuvre.t))) if isinstance(manoeuvre, OpenLoop) else manoeuvre.dt
        like = RunPlan(
            "", "", "identify", "ordered", 0.0, dt, usual, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, (0.0, 0.0)
        )
        run = ordered_run(manoeuvre, like, manoeuvre.name)
        start = self._start(body, run)
        number = body.number
        given = orders_for(run, number["L"], number["L"] / number["U0"], 3, number["ds_max"], PLAIN)
        return run, execute_run(body, PLAIN, run.t, given, start)

    def _start(self, body: Body, run: RunPlan) -> Array:
        """State after a straight run at the first revolutions."""
        number = body.number
        count = round(SETTLING * number["L"] / number["U0"] / run.dt)
        t = np.arange(count + 1) * run.dt
        straight = np.tile([0.0, 0.0, run.rpm], (t.size, 1))
        speed = cruising_speed(self.case.model.vehicle, run.rpm)
        x = execute_run(body, PLAIN, t, straight, start_state(speed, 0.0, 0.0, PLAIN, (0.0, 0.0)), step=0.05)
        state = x.states[-1].copy()
        state[:2] = 0.0
        return state
