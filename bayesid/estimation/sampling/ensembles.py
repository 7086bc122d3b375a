"""Sample a density: independent ensembles of walkers, round by round, until the convergence check is passed.

Takes a `Density` and its `Laplace` approximation. Gives a `Posterior`, and in a folder a chain that a killed
run goes on with. Does not know trials or models.
"""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from bayesid.errors import SampleError
from bayesid.estimation.sampling.convergence import (
    ConvergenceCheck,
    ConvergenceLimits,
    autocorrelation_time,
    check_convergence,
    long_enough,
)
from bayesid.estimation.sampling.density import Density, Laplace, Unknowns
from bayesid.estimation.sampling.moves import WEIGHTS, Reference, make_moves
from bayesid.estimation.sampling.posterior import Posterior
from bayesid.estimation.sampling.store import Block, RandomState, Store
from bayesid.words import first_few

Array = np.ndarray
ADAPTATION_ROUNDS = 3  # the Gaussian of the third move is renewed after each of them, then never again
START_TRIES = 40
AT_BOUND = 1e-6  # standard deviations from a bound within which the mode is at it
MOST_NAMED = 3
# A chain is given up where two estimates in a row ask for so many times the steps allowed. Correlation times
# of short chains come out too short, so that more steps would ask for more.
HOPELESS = 1.5
SAME_DENSITY = 1e-6  # share by which a log density computed again may differ: batches round otherwise


@dataclass(frozen=True)
class SamplerOptions:
    """How to sample.

    ensembles : independent ones, side by side: they share calls of the density, not walkers
    walkers : per ensemble; by default the next multiple of 32 above 2.2 times the unknowns, so that halves
        fill the lanes of the simulation kernels
    spread : how much wider than the Laplace approximation walkers start
    thin : every so many steps are stored
    first : steps of the first rounds; later ones grow by `growth` each
    max_steps : per ensemble, warm-up not counted
    discard : share of each ensemble left out as warm-up, at least the first rounds
    weights : of the moves "gaussian", "de", "stretch"
    """

    ensembles: int = 4
    walkers: int | None = None
    spread: float = 2.0
    thin: int = 5
    first: int = 200
    growth: float = 1.25
    max_steps: int = 20_000
    discard: float = 0.2
    weights: Mapping[str, float] = field(default_factory=lambda: dict(WEIGHTS))
    seed: int = 0
    limits: ConvergenceLimits = field(default_factory=ConvergenceLimits)

    def size(self, k: int) -> int:
        """Walkers per ensemble for k unknowns."""
        return self.walkers or 32 * int(np.ceil(2.2 * k / 32))

    def round_steps(self, number: int) -> int:
        """Stored steps of a round."""
        grown = self.first * self.growth ** max(number - ADAPTATION_ROUNDS, 0)
        return max(int(np.ceil(grown / self.thin)), 2)


def sample(
    density: Density,
    laplace: Laplace,
    options: SamplerOptions | None = None,
    folder: Path | str | None = None,
    *,
    resume: bool = False,
    watch: Callable[[int, str], None] | None = None,
) -> Posterior:
    """Sample until the convergence check is passed, cannot be passed any more, or `max_steps` are done.

    Parameters
    ----------
    folder : gets the chain as it grows, and posterior.nc
    resume : go on with the chain in the folder; it becomes the very chain an unbroken run would have given
    watch : called with steps done per ensemble since the last call, and a note

    Raises
    ------
    SampleError
        no start of finite density, a folder that holds another chain, a disk that is full
    """
    options = options or SamplerOptions()
    k = len(density.unknowns.names)
    _check(options, k)
    store = Store(None if folder is None else Path(folder) / "chain")
    identity = {"density": density.digest, "unknowns": density.unknowns.names, "start": _digest(laplace)}
    made_with = {n: v for n, v in asdict(options).items() if n not in ("max_steps", "limits")}
    store.begin({**identity, **made_with}, resume)
    crew = _Crew(density, laplace, options, store)
    crew.check()
    number, judged, hopeless = 0, 0, 0
    while True:
        if watch is not None and number <= ADAPTATION_ROUNDS:
            steps = options.round_steps(number) * options.thin
            warm = f"warm-up, round {number + 1} of {ADAPTATION_ROUNDS}, {steps} steps"
            watch(0, warm if number < ADAPTATION_ROUNDS else "sampling")
        crew.round(number, watch)
        kept = crew.stored(number) - crew.discarded(number)
        last = (crew.stored(number) - crew.warm) * options.thin >= options.max_steps
        if last or (number >= ADAPTATION_ROUNDS + 1 and kept >= 1.15 * judged):
            judged, draws = kept, crew.draws(number)[0]
            enough, length, tau = long_enough(draws, options.thin, options.limits)
            need = options.limits.n_tau * tau
            hopeless = hopeless + 1 if need > HOPELESS * options.max_steps else 0
            if watch is not None:
                words = f"{length:.0f} of {options.limits.n_tau:g} autocorrelation times of {tau:.0f} steps"
                more = max(options.limits.n_tau / max(length, 1e-9) - 1, 0) * kept * options.thin
                seconds = min(more, options.max_steps) / (1 - options.discard) * crew.pace
                watch(0, words + (f", about {seconds:.0f} s left" if seconds > 1 else ""))
            if enough or last or hopeless > 1:
                convergence = check_convergence(draws, density.unknowns.names, options.thin, options.limits)
                if hopeless > 1 and not convergence.converged:
                    given_up = (
                        f"cannot pass in the {options.max_steps} steps allowed: {options.limits.n_tau:g} "
                        f"autocorrelation times of {tau:.0f} steps are {need:.0f}, and the estimate grows "
                        "with the chain; fix or tie coefficients, state a narrower prior, or raise the limit"
                    )
                    convergence = replace(convergence, reasons=(given_up, *convergence.reasons))
                if watch is not None:
                    watch(
                        0,
                        "converged" if convergence.converged else f"not converged: {convergence.reasons[0]}",
                    )
                if convergence.converged or last or hopeless > 1:
                    break
        number += 1
    posterior = _posterior(crew, number, convergence, laplace)
    if folder is not None:
        posterior.to_netcdf(Path(folder) / "posterior.nc")
    return posterior


def _check(options: SamplerOptions, k: int) -> None:
    if options.size(k) < 2 * k or options.size(k) % 2:
        raise SampleError(
            f"{options.size(k)} walkers for {k} unknowns: an even number of at least {2 * k} is needed"
        )
    unknown = [n for n in options.weights if n not in WEIGHTS]
    if unknown or not sum(options.weights.values()) > 0:
        raise SampleError(f"moves {', '.join(unknown) or 'have no weight'}; there are {', '.join(WEIGHTS)}")


def _digest(laplace: Laplace) -> str:
    joined = np.concatenate([laplace.mode, laplace.covariance.ravel()])
    return hashlib.sha256(np.ascontiguousarray(joined).tobytes()).hexdigest()[:16]


class _Crew:
    """All ensembles of a run, brought forward round by round."""

    def __init__(self, density: Density, laplace: Laplace, options: SamplerOptions, store: Store) -> None:
        self.density, self.laplace, self.options, self.store = density, laplace, options, store
        self.k = len(density.unknowns.names)
        self.shape = (options.ensembles, options.size(self.k), self.k)
        self.pace = 0.0  # wall seconds per step of the last round

    @property
    def warm(self) -> int:
        """Stored steps of the first rounds."""
        return sum(self.options.round_steps(i) for i in range(ADAPTATION_ROUNDS))

    def stored(self, number: int) -> int:
        return sum(self.options.round_steps(i) for i in range(number + 1))

    def discarded(self, number: int) -> int:
        """Stored steps left out, after this round."""
        return max(self.warm, int(np.ceil(self.options.discard * self.stored(number))))

    def blocks(self, number: int) -> list[Block]:
        """All rounds up to this one."""
        found = [self.store.get(i) for i in range(number + 1)]
        return [b for b in found if b is not None]

    def draws(self, number: int) -> tuple[Array, Array]:
        """(ensembles, steps, walkers, k) natural units and log densities, warm-up left out."""
        blocks, first = self.blocks(number), self.discarded(number)
        coords = np.concatenate([b.coords for b in blocks])[first:]
        log_prob = np.concatenate([b.log_prob for b in blocks])[first:]
        points = self.laplace.points(np.moveaxis(coords, 1, 0))
        return self.density.natural(points), np.moveaxis(log_prob, 1, 0)

    def check(self) -> None:
        """Compute the last densities of a chain that is resumed again; they must be those of its points."""
        number = 0
        while self.store.get(number + 1) is not None:
            number += 1
        block = self.store.get(number)
        if block is None:
            return
        if block.coords.shape[1:] != self.shape or block.log_prob.shape != block.coords.shape[:3]:
            raise SampleError(f"round {number} of the chain has another shape; sample into another folder")
        told = block.log_prob[-1].ravel()
        found = self._counted(np.zeros(3, dtype=np.int64))(block.coords[-1].reshape(-1, self.k))
        with np.errstate(invalid="ignore"):
            off = ~((found == told) | (np.abs(found - told) <= SAME_DENSITY * (1.0 + np.abs(told))))
        if off.any():
            i = int(np.argmax(off))
            raise SampleError(
                f"round {number} of the chain tells log density {told[i]:.8g} where it is {found[i]:.8g}: "
                "it was made with another model or was damaged; sample into another folder"
            )

    def round(self, number: int, watch: Callable[[int, str], None] | None) -> None:
        """Do a round if it is not there yet."""
        from emcee import EnsembleSampler, State

        if self.store.get(number) is not None:
            return
        counts = np.zeros(3, dtype=np.int64)
        begin, clock = time.process_time(), time.monotonic()
        log_prob = self._counted(counts)
        before = self.store.get(number - 1) if number else None
        if before is None:
            random, coords, values = self._start(log_prob)
            references = [Reference.standard(self.k)] * self.shape[0]
        else:
            random, references = before.random, before.references
            coords, values = before.coords[-1], before.log_prob[-1]
        stops: list[KeyboardInterrupt] = []
        sampler = EnsembleSampler(
            values.size,
            self.k,
            _stoppable(log_prob, stops),
            vectorize=True,
            moves=make_moves(references, self.options.weights),
        )
        steps, thin = self.options.round_steps(number), self.options.thin
        state = State(coords.reshape(-1, self.k), log_prob=values.ravel(), random_state=random)
        for _ in sampler.sample(state, iterations=steps, thin_by=thin, skip_initial_state_check=True):
            if stops:
                raise stops[0]
            if watch is not None:
                watch(thin, "")
        found = sampler.get_chain().reshape(steps, *self.shape)
        self.pace = (time.monotonic() - clock) / (steps * thin)
        if number < ADAPTATION_ROUNDS:
            references = self._renewed(number, found)
        self.store.put(
            number,
            Block(
                found, sampler.get_log_prob().reshape(found.shape[:3]),
                sampler.acceptance_fraction.reshape(self.shape[:2]).mean(axis=1),
                np.stack([r.mean for r in references]), np.stack([r.root for r in references]),
                sampler.random_state, counts, time.process_time() - begin,
            ),
        )  # fmt: skip

    def _renewed(self, number: int, found: Array) -> list[Reference]:
        """References from the later half of what every ensemble has done so far."""
        late = np.concatenate([*(b.coords for b in self.blocks(number - 1)), found])
        late = late[late.shape[0] // 2 :]
        references = []
        for e in range(self.shape[0]):
            one = late[:, e]
            worth = self.shape[1] * one.shape[0] / float(np.mean(autocorrelation_time(one[None])))
            references.append(Reference.of(one.reshape(-1, self.k), worth))
        return references

    def _counted(self, counts: Array) -> Callable[[Array], Array]:
        """Density of whitened points, never NaN, that counts what it could not tell."""

        def log_prob(x: Array) -> Array:
            values = np.asarray(self.density.log_prob(self.laplace.points(x)), dtype=float)
            outside, finite = np.isneginf(values), np.isfinite(values)
            counts[:] += values.size, int(outside.sum()), int((~finite & ~outside).sum())
            return np.where(finite, values, -np.inf)

        return log_prob

    def _start(self, log_prob: Callable[[Array], Array]) -> tuple[RandomState, Array, Array]:
        """Walkers around the mode, wider than the Laplace approximation; those of no density drawn again,
        ever nearer."""
        random = np.random.RandomState(np.random.SeedSequence(self.options.seed).generate_state(8))
        count = self.shape[0] * self.shape[1]
        coords = self._drawn(count, self.options.spread, random)
        values = log_prob(coords)
        for attempt in range(START_TRIES):
            bad = ~np.isfinite(values)
            if not bad.any():
                state: Any = random.get_state()
                return state, coords, values
            reach = self.options.spread * 0.85 ** max(attempt - 3, 0)
            coords[bad] = self._drawn(int(bad.sum()), reach, random)
            values[bad] = log_prob(coords[bad])
        raise SampleError(
            f"{int(bad.sum())} of {count} walkers find no start of finite density around the mode; "
            + _why_no_start(self.density.unknowns, self.laplace)
        )

    def _drawn(self, count: int, spread: float, random: np.random.RandomState) -> Array:
        return self.laplace.whitened(self.laplace.draw(count, spread, random))


def _why_no_start(unknowns: Unknowns, laplace: Laplace) -> str:
    """Which unknowns the mode has at which bound, and what to do."""
    sd, told = np.sqrt(np.diag(laplace.covariance)), []
    sides = (("lower", laplace.low, unknowns.low), ("upper", laplace.high, unknowns.high))
    for side, ends, natural in sides:
        if ends is not None:
            at = np.abs(laplace.mode - ends) <= AT_BOUND * sd
            told += [f"{unknowns.names[i]} at its {side} bound {natural[i]:.4g}" for i in np.flatnonzero(at)]
    if not told:
        return "no unknown is at a bound there: the simulation fails; fit again"
    verb, whom = ("is", "it") if len(told) == 1 else ("are", "them")
    return (
        f"there {verb} {first_few(told, MOST_NAMED)}: fit again with {whom} held there, or widen the bounds"
    )


def _stoppable(
    log_prob: Callable[[Array], Array], stops: list[KeyboardInterrupt]
) -> Callable[[Array], Array]:
    """The density, a stop asked for within it kept in `stops`: emcee prints all that passes through it.

    From then on the density is zero, so that a step ends at once.
    """

    def kept(x: Array) -> Array:
        if not stops:
            try:
                return log_prob(x)
            except KeyboardInterrupt as stop:
                stops.append(stop)
        return np.full(len(x), -np.inf)

    return kept


def _posterior(crew: _Crew, number: int, convergence: ConvergenceCheck, laplace: Laplace) -> Posterior:
    options, density, blocks = crew.options, crew.density, crew.blocks(number)
    draws, log_prob = crew.draws(number)
    counts = np.sum([b.counts for b in blocks], axis=0)
    log_prior = getattr(density, "log_prior", None)
    prior = np.full(log_prob.shape, np.nan)
    if log_prior is not None:
        prior = np.asarray(log_prior(draws.reshape(-1, crew.k))).reshape(log_prob.shape)
    mode = density.natural(laplace.mode)
    columns = laplace.points(np.concatenate([np.eye(crew.k), -np.eye(crew.k)]))
    spread = density.natural(columns) - mode
    settings = {**getattr(density, "settings", {}), "sampler": asdict(options)}
    return Posterior(
        density.unknowns, draws, log_prob, prior, convergence, mode,
        np.sqrt(0.5 * np.sum(spread**2, axis=0)),
        np.average([b.accepted for b in blocks], axis=0, weights=[len(b.coords) for b in blocks]),
        options.thin, crew.discarded(number) * options.thin,
        {"all": int(counts[0]), "out of bounds": int(counts[1]), "diverged": int(counts[2])},
        float(sum(b.seconds for b in blocks)), options.seed, density.digest, settings,
    )  # fmt: skip
