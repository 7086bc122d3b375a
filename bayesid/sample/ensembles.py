"""Sample a density: independent ensembles of walkers, round by round, until the gate is passed.

Takes a `Density` and its `Laplace` approximation. Gives a `Posterior`, and in a folder a chain that a killed
run goes on with. Does not know trials or models.
"""

from __future__ import annotations

import hashlib
import threading
import time
from collections.abc import Callable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor, wait
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from bayesid.errors import SampleError
from bayesid.sample.density import Density, Laplace
from bayesid.sample.gate import Gate, Limits, judge
from bayesid.sample.moves import WEIGHTS, Reference, make_moves
from bayesid.sample.posterior import Posterior
from bayesid.sample.store import Block, RandomState, Store

Array = np.ndarray
WARM_ROUNDS = 3  # the Gaussian of the third move is renewed after each of them, then never again
START_TRIES = 40


@dataclass(frozen=True)
class Options:
    """How to sample.

    ensembles : independent ones, each with its own random numbers
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
    limits: Limits = field(default_factory=Limits)

    def size(self, k: int) -> int:
        """Walkers per ensemble for k unknowns."""
        return self.walkers or 32 * int(np.ceil(2.2 * k / 32))

    def round_steps(self, number: int) -> int:
        """Stored steps of a round."""
        grown = self.first * self.growth ** max(number - WARM_ROUNDS, 0)
        return max(int(np.ceil(grown / self.thin)), 2)


def sample(
    density: Density,
    laplace: Laplace,
    options: Options | None = None,
    folder: Path | str | None = None,
    *,
    resume: bool = False,
    threads: int = 2,
    watch: Callable[[int, str], None] | None = None,
) -> Posterior:
    """Sample until the gate is passed or `max_steps` are done.

    Parameters
    ----------
    folder : gets the chain as it grows, and posterior.nc
    resume : go on with the chain in the folder; it becomes the very chain an unbroken run would have given
    threads : ensembles at work at the same time; does not change the chain
    watch : called from this thread with steps done per ensemble since the last call, and a note

    Raises
    ------
    SampleError
        no start of finite density, a folder that holds another chain, a disk that is full
    """
    options = options or Options()
    k = len(density.unknowns.names)
    _check(options, k)
    store = Store(None if folder is None else Path(folder) / "chain")
    identity = {"density": density.digest, "unknowns": density.unknowns.names, "start": _digest(laplace)}
    made_with = {n: v for n, v in asdict(options).items() if n not in ("max_steps", "limits")}
    store.begin({**identity, **made_with}, resume)
    crew = _Crew(density, laplace, options, store)
    number, judged, gate = 0, 0, None
    while True:
        crew.round(number, threads, watch)
        kept = crew.stored(number) - crew.discarded(number)
        last = (crew.stored(number) - crew.warm) * options.thin >= options.max_steps
        if last or (number >= WARM_ROUNDS + 1 and kept >= 1.15 * judged):
            judged = kept
            gate = judge(crew.draws(number)[0], density.unknowns.names, options.thin, options.limits)
            if watch is not None:
                watch(0, _note(gate, options))
            if gate.converged or last:
                break
        number += 1
    posterior = _posterior(crew, number, gate, laplace)
    if folder is not None:
        posterior.to_netcdf(Path(folder) / "posterior.nc")
    return posterior


def _check(options: Options, k: int) -> None:
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


def _note(gate: Gate, options: Options) -> str:
    if gate.converged:
        return "converged"
    return (
        f"R-hat {np.nanmax(gate.rhat):.3f}, {gate.n_tau:.0f} of {options.limits.n_tau:g} autocorrelation "
        f"times of {gate.tau.max():.0f} steps, effective size {gate.ess_bulk.min():.0f}"
    )


class _Crew:
    """All ensembles of a run: brings them round by round to the same length."""

    def __init__(self, density: Density, laplace: Laplace, options: Options, store: Store) -> None:
        self.density, self.laplace, self.options, self.store = density, laplace, options, store
        self.k = len(density.unknowns.names)
        self.walkers = options.size(self.k)
        self.stop = threading.Event()
        self.done = [0] * options.ensembles

    @property
    def warm(self) -> int:
        """Stored steps of the first rounds."""
        return sum(self.options.round_steps(i) for i in range(WARM_ROUNDS))

    def stored(self, number: int) -> int:
        return sum(self.options.round_steps(i) for i in range(number + 1))

    def discarded(self, number: int) -> int:
        """Stored steps left out, after this round."""
        return max(self.warm, int(np.ceil(self.options.discard * self.stored(number))))

    def round(self, number: int, threads: int, watch: Callable[[int, str], None] | None) -> None:
        """Do a round of every ensemble that has not done it yet."""
        todo = [e for e in range(self.options.ensembles) if self.store.get(e, number) is None]
        shown = self.done = [0] * self.options.ensembles
        reported = 0
        with ThreadPoolExecutor(max(min(threads, len(todo)), 1)) as pool:
            futures: set[Future[None]] = {pool.submit(self._advance, e, number) for e in todo}
            try:
                while futures:
                    finished, futures = wait(futures, timeout=0.5)
                    for future in finished:
                        future.result()
                    if watch is not None:
                        total = sum(shown) // self.options.ensembles
                        watch((total - reported) * self.options.thin, "")
                        reported = total
            except BaseException:
                self.stop.set()
                raise

    def draws(self, number: int) -> tuple[Array, Array]:
        """(ensembles, steps, walkers, k) natural units and log densities, warm-up left out."""
        from_ = self.discarded(number)
        coords, log_prob = [], []
        for e in range(self.options.ensembles):
            blocks = self.blocks(e, number)
            coords.append(np.concatenate([b.coords for b in blocks])[from_:])
            log_prob.append(np.concatenate([b.log_prob for b in blocks])[from_:])
        return self.density.natural(self.laplace.points(np.stack(coords))), np.stack(log_prob)

    def blocks(self, ensemble: int, number: int) -> list[Block]:
        found = [self.store.get(ensemble, i) for i in range(number + 1)]
        return [b for b in found if b is not None]

    # ---- one ensemble ----
    def _advance(self, ensemble: int, number: int) -> None:
        from emcee import EnsembleSampler, State

        counts = np.zeros(3, dtype=np.int64)
        begin = time.thread_time()

        def log_prob(x: Array) -> Array:
            values = np.asarray(self.density.log_prob(self.laplace.points(x)), dtype=float)
            counts[0] += values.size
            counts[1] += int(np.isneginf(values).sum())
            broken = ~np.isfinite(values) & ~np.isneginf(values)
            counts[2] += int(broken.sum())
            return np.where(np.isfinite(values), values, -np.inf)

        before = self.store.get(ensemble, number - 1) if number else None
        if before is None:
            random, coords, values = self._start(ensemble, log_prob)
            reference = Reference.standard(self.k)
        else:
            random, reference = before.random, before.reference
            coords, values = before.coords[-1], before.log_prob[-1]
        sampler = EnsembleSampler(
            self.walkers, self.k, log_prob, vectorize=True,
            moves=make_moves(reference, self.options.weights),
        )  # fmt: skip
        steps, thin = self.options.round_steps(number), self.options.thin
        chain = sampler.sample(
            State(coords, log_prob=values, random_state=random), iterations=steps, thin_by=thin,
            skip_initial_state_check=True,
        )  # fmt: skip
        for _ in chain:
            self.done[ensemble] += 1
            if self.stop.is_set():
                return
        found = sampler.get_chain()
        if number < WARM_ROUNDS:
            reference = Reference.of(found[steps // 2 :].reshape(-1, self.k))
        block = Block(
            found, sampler.get_log_prob(), float(np.mean(sampler.acceptance_fraction)), reference,
            sampler.random_state, counts, time.thread_time() - begin,
        )  # fmt: skip
        self.store.put(ensemble, number, block)

    def _start(self, ensemble: int, log_prob: Callable[[Array], Array]) -> tuple[RandomState, Array, Array]:
        """Walkers around the mode, wider than the Laplace approximation; those of no density drawn again,
        ever nearer."""
        words = np.random.SeedSequence([self.options.seed, ensemble]).generate_state(8)
        random = np.random.RandomState(words)
        coords = self._drawn(self.walkers, self.options.spread, random)
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
            f"{int(bad.sum())} of {self.walkers} walkers find no start of finite density around the mode: "
            "the simulation fails or the bounds end there; fit again, or widen the bounds"
        )

    def _drawn(self, count: int, spread: float, random: np.random.RandomState) -> Array:
        return self.laplace.whitened(self.laplace.draw(count, spread, random))


def _posterior(crew: _Crew, number: int, gate: Gate | None, laplace: Laplace) -> Posterior:
    assert gate is not None
    options, density = crew.options, crew.density
    draws, log_prob = crew.draws(number)
    blocks = [crew.blocks(e, number) for e in range(options.ensembles)]
    every = [b for rows in blocks for b in rows]
    counts = np.sum([b.counts for b in every], axis=0)
    log_prior = getattr(density, "log_prior", None)
    prior = np.full(log_prob.shape, np.nan)
    if log_prior is not None:
        prior = np.asarray(log_prior(draws.reshape(-1, crew.k))).reshape(log_prob.shape)
    mode = density.natural(laplace.mode)
    columns = laplace.points(np.concatenate([np.eye(crew.k), -np.eye(crew.k)]))
    spread = density.natural(columns) - mode
    settings = {**getattr(density, "settings", {}), "sampler": asdict(options)}
    return Posterior(
        density.unknowns, draws, log_prob, prior, gate, mode,
        np.sqrt(0.5 * np.sum(spread**2, axis=0)),
        np.array([np.average([b.accepted for b in r], weights=[len(b.coords) for b in r]) for r in blocks]),
        options.thin, crew.discarded(number) * options.thin,
        {"all": int(counts[0]), "out of bounds": int(counts[1]), "diverged": int(counts[2])},
        float(sum(b.seconds for b in every)), options.seed, density.digest, settings,
    )  # fmt: skip
