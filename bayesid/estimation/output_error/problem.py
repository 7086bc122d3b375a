"""How far a parameter vector is from the data: whitened residuals, their exact Jacobian, cost and gradient.

Takes a `Model`, a `ParameterSet` and `RunData`. Unknowns z = free parameters, then the free initial states
run by run. Does not optimise or sample, and knows white noise only.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from bayesid.equations.model import Model
from bayesid.errors import ModelError
from bayesid.estimation.run_data import RunData
from bayesid.model.params import ParameterSet
from bayesid.simulation import (
    Sensitivity,
    Track,
    gradient,
    observe,
    observe_sensitivity,
    sensitivities,
    simulate,
)
from bayesid.threads import each, several_threads

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class FitProblem:
    """Cost of a parameter vector: half the sum of squared residuals, prior included.

    With unit noise, no initial states and no prior, twice the cost is the paper's V(p) (`unweighted`).

    Attributes
    ----------
    base : (n,) model parameters the parameter set writes into; nominal plus what the data fix (measured
        point)
    threads : runs simulated at the same time
    adjoint : gradient by the adjoint instead of the Jacobian where every reading is a state; None: in 3-DOF
        only, where it halves the time (in 6-DOF a fit is over before the adjoint is compiled)
    """

    model: Model
    params: ParameterSet
    runs: tuple[RunData, ...]
    base: Array
    threads: int = 1
    adjoint: bool | None = None

    # ---- layout of the unknowns ----
    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of all unknowns; an initial state is "run:psi(0)"."""
        return self.params.names + tuple(f"{r.name}:{s}(0)" for r in self.runs for s in r.initial)

    @cached_property
    def start(self) -> Array:
        return np.concatenate([self.params.start, *(self._initial(r) for r in self.runs)])

    @cached_property
    def low(self) -> Array:
        return np.concatenate([self.params.vector("low"), np.full(self.n_initial, -np.inf)])

    @cached_property
    def high(self) -> Array:
        return np.concatenate([self.params.vector("high"), np.full(self.n_initial, np.inf)])

    @cached_property
    def scale(self) -> Array:
        """Size of a change that matters, of every unknown."""
        return np.concatenate([self.params.vector("scale"), *(r.initial_sd for r in self.runs)])

    @property
    def n_initial(self) -> int:
        return sum(len(r.initial) for r in self.runs)

    @property
    def n_readings(self) -> int:
        """Finite readings compared."""
        return int(sum(np.isfinite(r.readings).sum() for r in self.runs))

    def _initial(self, run: RunData) -> Array:
        return run.x0[[self.model.states.index(s) for s in run.initial]]

    def split(self, z: Array) -> tuple[Array, list[Array]]:
        """Model parameter vector, and the initial state of every run."""
        k = len(self.params.names)
        starts, at = [], k
        for run in self.runs:
            x0 = np.array(run.x0, dtype=float)
            for name in run.initial:
                x0[self.model.states.index(name)] = z[at]
                at += 1
            starts.append(x0)
        return self.params.place(self.base, self.model.index, z[:k]), starts

    def _columns(self, number: int) -> slice:
        """Columns of the initial states of one run."""
        before = len(self.params.names) + sum(len(r.initial) for r in self.runs[:number])
        return slice(before, before + len(self.runs[number].initial))

    # ---- simulation ----
    @cached_property
    def _chain(self) -> tuple[Array, Array]:
        return self.params.chain(self.model.index)

    @cached_property
    def _full(self) -> bool:
        """Whether an effect is on, or may be switched on by a free parameter."""
        effects = set(self.model.effect_off)
        return bool(effects & set(self._chain[0].tolist())) or not self.model.is_off(
            self.params.place(self.base, self.model.index, self.params.start)
        )

    @cached_property
    def _direct(self) -> bool:
        """Whether every reading is a state as it is: no sensor effect, no lever arm."""
        points = [self.model.index[n] for n in self.model.index if n.startswith("point_")]
        moving = set(points) & set(self._chain[0].tolist())
        states = all(c in self.model.states for run in self.runs for c in run.channels)
        return not self._full and not moving and states and not np.any(self.base[points])

    def _picked(self, run: RunData) -> list[int]:
        names = self.model.states if self._direct else self.model.kernel.channels
        return [names.index(c) for c in run.channels]

    def tracks(self, z: Array) -> list[Track]:
        """Simulated states of every run.

        Raises
        ------
        ModelError
            if a run diverges
        """
        par, starts = self.split(z)
        return self._each(lambda i: simulate(self.model, par, self.runs[i].plan, starts[i], full=self._full))

    def readings(self, z: Array) -> list[Array]:
        """(n, c) simulated readings of every run."""
        par, _ = self.split(z)
        found = []
        for run, track in zip(self.runs, self.tracks(z), strict=True):
            states = track.states
            if not self._direct:
                states = observe(self.model, par, run.plan, states, full=self._full)
            found.append(states[:, self._picked(run)])
        return found

    def _each(self, work: Callable[[int], Any]) -> list[Any]:
        with several_threads(min(self.threads, len(self.runs))):
            return each(work, range(len(self.runs)))

    # ---- residuals ----
    def residuals(self, z: Array) -> Array:
        """All residuals: readings run by run and sample by sample, then the prior."""
        parts = [r.residuals(y).ravel() for r, y in zip(self.runs, self.readings(z), strict=True)]
        return np.concatenate([*parts, self.prior(z)[0]])

    def prior(self, z: Array) -> tuple[Array, Array]:
        """Residuals of the prior and of the initial states, and their slopes by z."""
        k = len(self.params.names)
        resid, slopes = self.params.prior_residuals(z[:k])
        spread = np.concatenate([np.zeros(0), *(r.initial_sd for r in self.runs)])
        centre = self.start[k:]
        block = np.zeros((resid.size + spread.size, z.size))
        block[: resid.size, :k] = slopes
        block[resid.size + np.arange(spread.size), k + np.arange(spread.size)] = 1.0 / spread
        return np.concatenate([resid, (z[k:] - centre) / spread]), block

    def jacobian(self, z: Array) -> tuple[Array, Array]:
        """Residuals and their exact Jacobian (rows as in `residuals`) by all unknowns."""
        return self._stacked(z, self.run_blocks(z))

    def compressed(self, z: Array) -> tuple[Array, Array]:
        """Residuals and Jacobian turned, run by run, into as few rows as there are unknowns, plus one.

        An orthogonal change of rows: norms, J^T J and J^T r are those of `jacobian`, which for long logs with
        many initial states would not fit into memory. The prior's rows stay as they are and come last.
        """
        turned = self.triangles(z)
        return self._stacked(z, lambda i: (turned[i][:, -1], turned[i][:, :-1]))

    def triangles(self, z: Array) -> list[Array]:
        """Triangle of every run's Jacobian, by the parameters and its own initial states, and residuals, the
        last column, after an orthogonal change of rows; without the prior."""
        block = self.run_blocks(z)

        def one(i: int) -> Array:
            resid, jac = block(i)
            return np.asarray(np.linalg.qr(np.column_stack([jac, resid]), mode="r"))

        return self._each(one)

    def _stacked(self, z: Array, block: Callable[[int], tuple[Array, Array]]) -> tuple[Array, Array]:
        k = len(self.params.names)
        resids, rows = [], []
        for i, (resid, jac) in enumerate(self._each(block)):
            out = np.zeros((resid.size, z.size))
            out[:, :k], out[:, self._columns(i)] = jac[:, :k], jac[:, k:]
            resids.append(resid)
            rows.append(out)
        resid, prior = self.prior(z)
        return np.concatenate([*resids, resid]), np.vstack([*rows, prior])

    def run_blocks(self, z: Array) -> Callable[[int], tuple[Array, Array]]:
        """Residuals of one run and their Jacobian by the parameters and the run's own initial states."""
        par, starts = self.split(z)
        positions, slopes = self._chain

        def one(i: int) -> tuple[Array, Array]:
            run = self.runs[i]
            result = self._sensitivities(par, i, starts[i])
            if self._direct:
                states, jac = result.track.states, result.jacobian
            else:
                states, jac = observe_sensitivity(
                    self.model, par, run.plan, result, positions, full=self._full
                )
            picked = self._picked(run)
            resid = run.residuals(states[:, picked])
            jac = jac[:, picked] / np.asarray(run.sigma)[:, None]
            jac[~np.isfinite(run.readings)] = 0.0
            flat = jac.reshape(-1, jac.shape[2])
            where = [positions.size + self.model.states.index(s) for s in run.initial]
            return resid.ravel(), np.hstack([flat[:, : positions.size] @ slopes, flat[:, where]])

        return one

    def _sensitivities(self, par: Array, i: int, x0: Array) -> Sensitivity:
        run = self.runs[i]
        delayed = bool(not self._direct and self.model.kernel.full.delays) and self._full
        return sensitivities(
            self.model, par, run.plan, x0, self._chain[0], bool(run.initial), full=self._full, rates=delayed
        )

    # ---- cost ----
    def cost(self, z: Array) -> float:
        """Half the sum of squared residuals; inf where the simulated vehicle diverges."""
        try:
            resid = self.residuals(z)
        except ModelError:
            return np.inf
        value = 0.5 * float(resid @ resid)
        return value if np.isfinite(value) else np.inf

    def cost_gradient(self, z: Array) -> tuple[float, Array]:
        """Cost and its exact gradient; see `adjoint`."""
        if not self._direct or not (self.model.dof == 3 if self.adjoint is None else self.adjoint):
            resid, jac = self.compressed(z)
            return 0.5 * float(resid @ resid), jac.T @ resid
        par, starts = self.split(z)
        positions, slopes = self._chain
        k = len(self.params.names)

        def one(i: int) -> tuple[float, Array, Array]:
            run, picked, kept = self.runs[i], self._picked(self.runs[i]), []

            def cotangent(states: Array) -> Array:
                resid = run.residuals(states[:, picked])
                kept.append(0.5 * float(np.sum(resid**2)))
                out = np.zeros_like(states)
                for j, state in enumerate(picked):
                    out[:, state] += resid[:, j] / run.sigma[j]
                return out

            _, by_par, by_x0 = gradient(self.model, par, run.plan, starts[i], cotangent, full=False)
            return kept[0], slopes.T @ by_par[positions], by_x0

        resid, block = self.prior(z)
        total, slope = 0.5 * float(resid @ resid), block.T @ resid
        for i, (value, by_par, by_x0) in enumerate(self._each(one)):
            total += value
            slope[:k] += by_par
            slope[self._columns(i)] += by_x0[[self.model.states.index(s) for s in self.runs[i].initial]]
        return total, slope

    # ---- variants ----
    def with_params(self, params: ParameterSet) -> FitProblem:
        """The same data with other unknowns."""
        return replace(self, params=params)

    def with_sigma(self, sigma: Mapping[str, float]) -> FitProblem:
        """The same problem with other noise per channel."""
        return replace(self, runs=tuple(r.with_sigma(sigma) for r in self.runs))

    def channel_rms(self, z: Array) -> dict[str, float]:
        """Root mean square difference per channel over all runs [SI]."""
        total: dict[str, list[float]] = {}
        for run, simulated in zip(self.runs, self.readings(z), strict=True):
            squares = (run.residuals(simulated) * run.sigma) ** 2
            finite = np.isfinite(run.readings)
            for j, c in enumerate(run.channels):
                entry = total.setdefault(c, [0.0, 0.0])
                entry[0] += float(squares[:, j].sum())
                entry[1] += float(finite[:, j].sum())
        return {c: float(np.sqrt(s / max(n, 1.0))) for c, (s, n) in total.items()}

    @cached_property
    def digest(self) -> str:
        """Hash of the model, the unknowns and the data."""
        text = [self.model.digest, repr(self.params.entries), repr(self.base.tolist())]
        if self.params.joint is not None:
            text.append(repr((self.params.joint.names, self.params.joint.covariance.tolist())))
        hashed = hashlib.sha256("|".join(text).encode())
        for run in self.runs:
            hashed.update(f"{run.name}|{run.channels}|{run.initial}".encode())
            arrays = (run.readings, run.sigma, run.x0, run.initial_sd, run.plan.t, run.plan.steps)
            for array in (*arrays, run.plan.command, run.plan.exogenous, run.plan.sooner):
                hashed.update(np.ascontiguousarray(array, dtype=float).tobytes())
        return hashed.hexdigest()[:16]
