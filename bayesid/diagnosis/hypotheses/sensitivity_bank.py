"""One bank of whitened columns: coefficients and every effect of the catalogue, along one path.

Takes a `DiagnosisProblem` and linearisation points. Gives normal equations per run from which any
combination of effects is scored without another simulation, and what the manoeuvres can tell apart before
any data. Does not refit or judge.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from bayesid.diagnosis.data.problem import DiagnosisProblem, at_time, sizes_tried
from bayesid.diagnosis.hypotheses.size_scales import over_usual_size, sizes_of_effect
from bayesid.equations.model import Model
from bayesid.estimation.filter_error.evidence import NormalEquations, posterior
from bayesid.estimation.filter_error.linearise import Linearisation, Trajectory, linearise, wrap
from bayesid.estimation.filter_error.noise_model import NoiseModel, force_unit
from bayesid.estimation.filter_error.normal_equations import run_equations
from bayesid.estimation.parameters import GaussianPrior, effect_prior
from bayesid.estimation.run_data import Array, RunData
from bayesid.model.effects import Effect
from bayesid.model.effects.declare import SERVO_STAGES
from bayesid.simulation import interval_maps, readings_on
from bayesid.threads import each
from bayesid.words import and_list

# Share of a coefficient within which it is known: ten times that is no other force.
KNOWN = 0.01
# A prior that is too narrow as a whole: how many times its standard deviations.
EVERY = {"every coefficient x3": 3.0, "every coefficient x10": 10.0}


@dataclass(frozen=True, eq=False)
class EffectColumns:
    """Columns of one effect in the bank; several `variants` where secants of several sizes stand in for a
    slope, or where it begins at a time that is not known: `sizes` in prior sd, empty for a slope."""

    effect: Effect
    variants: tuple[Array, ...]
    sizes: tuple[float, ...] = ()

    def sizes_of(self, variant: int) -> Array:
        """Which columns of a variant are sizes of the effect; a secant is one."""
        if self.sizes:
            return np.arange(self.variants[variant].size)
        return np.array(sizes_of_effect(self.effect), dtype=int)


@dataclass(frozen=True, eq=False)
class SensitivityBank:
    """Whitened products along one path.

    Attributes
    ----------
    equations : normal equations per environment level and run; columns are coefficients, then effects
    levels : the environments
    n_coef : number of coefficient columns
    effects : name -> Column
    par : parameters of the path
    """

    equations: tuple[tuple[NormalEquations, ...], ...]
    levels: tuple[NoiseModel, ...]
    n_coef: int
    effects: dict[str, EffectColumns]
    par: Array = field(default_factory=lambda: np.zeros(0))

    def total(self, level: int) -> NormalEquations:
        """All runs together."""
        equations = self.equations[level]
        return sum(equations[1:], equations[0])

    def columns(self, chosen: Sequence[str], variants: Sequence[int] = ()) -> Array:
        """Positions of the coefficients and of the chosen effects."""
        out = [np.arange(self.n_coef)]
        for i, name in enumerate(chosen):
            column = self.effects[name]
            out.append(column.variants[variants[i] if i < len(variants) else 0])
        return np.concatenate(out)


def testable(problem: DiagnosisProblem, effect: Effect) -> bool:
    """Whether an effect can show in this trial at all."""
    names = set(problem.channels)
    if not effect.acts_in(problem.model.dof) or effect.as_form == "only":
        return False
    if any(effect.key(p.name) in problem.coefficients.names for p in effect.parameters):
        return False  # part of the model form, which every hypothesis has
    if problem.form is not None and effect.as_form == "alone":
        return False  # equations that lack a force do not tell it from a single screw
    if effect.at_surface and _submerged(problem):
        return False
    if own_rows(problem, effect):
        return False  # wrong values of its own rows are hypotheses of their own
    if effect.name == "position_lever_arm" and problem.velocity_from_track:
        return False
    slowed = _slowed(problem.model, effect)
    if slowed and slowed <= _measured(problem):
        return False  # the position is logged as it came to be, with whatever slows it
    seen = set(effect.sensor) | {c for group in effect.sensor_delay.values() for c in group}
    return not (effect.port == "sensor" and not (seen & names))


def not_asked(problem: DiagnosisProblem) -> tuple[str, ...]:
    """Sentences where effects cannot show because a position is measured, or far below the surface."""
    slow = {name for effect in problem.model.effects.values() for name in _slowed(problem.model, effect)}
    names = sorted(slow & _measured(problem))
    out = []
    if names:
        many = len(names) > 1
        late = "they lag behind their" if many else "it lags behind its"
        told = f"{and_list(names)} {'are' if many else 'is'} measured in every run"
        out.append(f"{told}: whether {late} orders is not asked")
    for effect in problem.model.effects.values():
        if own := own_rows(problem, effect):
            said = effect.name.replace("_", " ")
            out.append(f"the vehicle file has {and_list(own)}: {said} is told as an error of these rows")
    if _submerged(problem):
        above = [e.name.replace("_", " ") for e in problem.model.effects.values() if e.at_surface]
        out.append(f"every run is deeper than half the length of the vehicle: {and_list(above)} is not asked")
    return tuple(out)


def own_rows(problem: DiagnosisProblem, effect: Effect) -> tuple[str, ...]:
    """Uncertain coefficients of the vehicle that are the force of the motion an effect adds, all of it."""
    if effect.as_form != "also":
        return ()
    known = problem.stated
    free = {n for n, m, sd in zip(known.names, known.mean, known.sd, strict=True) if sd > KNOWN * abs(m)}
    own = [n for p in effect.parameters for n in (p.name, f"{p.name},U") if n in free]
    return tuple(own) if {n.partition(",")[0] for n in own} == {p.name for p in effect.parameters} else ()


def _submerged(problem: DiagnosisProblem) -> bool:
    """Whether every run stays deeper than half the length of the vehicle, by its readings of z."""
    if "z" not in problem.channels:
        return False
    depths = [log.readings[:, log.channels.index("z")] for log in problem.logs]
    return all(np.isfinite(z).any() and np.nanmin(z) > 0.5 * problem.model.scales["L"] for z in depths)


def _measured(problem: DiagnosisProblem) -> set[str]:
    """Actuators whose position is logged in every run."""
    every = [set(log.plan.measured) for log in problem.logs]
    return set.intersection(*every) if every else set()


def _slowed(model: Model, effect: Effect) -> frozenset[str]:
    """Actuators whose positions an effect makes slower than their orders: by a lag or a limit of the rate."""
    own = {
        f"{number}_{servo}": signal
        for signal, servo in model.kernel.spec.servos.items()
        for number in ("servo_lag", "inverse_rate")
    }
    first, last = SERVO_STAGES
    return frozenset(own[k] for k in effect.adjust if k in own) | frozenset(
        stage.signal for stage in effect.stages if first <= stage.order < last
    )


def build_bank(
    problem: DiagnosisProblem,
    points: Sequence[Trajectory],
    levels: Sequence[NoiseModel],
    effects: Sequence[Effect],
    with_effects: GaussianPrior | None = None,
) -> SensitivityBank:
    """Bank along a path.

    Parameters
    ----------
    levels : environments under which to whiten
    effects : the effects to give columns
    with_effects : parameters free besides the coefficients (effects already in the model)
    """
    model = problem.model
    base = problem.coefficients if with_effects is None else problem.coefficients + with_effects
    smooth = [e for e in effects if e.smooth]
    free = base
    position = {}
    for effect in smooth:
        more = effect_prior(model, effect)
        position[effect.name] = np.arange(len(free.names), len(free.names) + len(more.names))
        free = free + more
    kinked = [e for e in effects if not e.smooth]
    n_free = len(free.names)
    columns = {e.name: EffectColumns(e, (position[e.name],)) for e in smooth}
    first = n_free
    for effect in kinked:
        sizes = sizes_tried(problem, effect)
        last = first + len(sizes)
        columns[effect.name] = EffectColumns(effect, tuple(np.array([j]) for j in range(first, last)), sizes)
        first = last

    def of_run(log: RunData, point: Trajectory, k: int) -> list[NormalEquations]:
        # a run at a time, and let go of: the columns of all effects are the largest thing a diagnosis makes
        path = linearise(model, log, point, free.where)
        extra = secants(problem, path, kinked) if kinked else None
        return [run_equations(model, path, free, level, run=k, extra=extra) for level in levels]

    by_run = each(of_run, problem.logs, points, range(len(problem.logs)))
    equations = tuple(zip(*by_run, strict=True))
    return SensitivityBank(equations, tuple(levels), len(base.names), columns, points[0].par)


def secants(problem: DiagnosisProblem, path: Linearisation, effects: Sequence[Effect]) -> tuple[Array, Array]:
    """Difference quotients of readings and interval ends, in units of one prior standard deviation.

    Of a dated effect those to the size of one standard deviation, for every time tried.
    """
    model, log, point = problem.model, path.log, path.point
    nothing = np.zeros(0, dtype=np.int64)
    picked = log.positions(model)
    where = path.aside
    direct, drive = [], []
    for effect in effects:
        prior = effect_prior(model, effect)
        for size in sizes_tried(problem, effect):
            par = point.par.copy()
            if effect.dated is None:
                par[prior.where] = np.maximum(par[prior.where], prior.mean) + size * prior.sd
            else:
                par[prior.where] = prior.mean + np.array(at_time(effect, 1.0, size)) * prior.sd
                size = 1.0
            maps = interval_maps(model, par, where.plan, where.states, (), nothing)
            values = readings_on(model, par, where.plan, where.states, maps, nothing).values[:, picked]
            change = wrap(model, log, values - where.values)
            direct.append(np.where(log.valid, change, 0.0) / size)
            drive.append((maps.ends - where.ends) / size)
    return np.stack(direct, axis=2), np.stack(drive, axis=2)


@dataclass(frozen=True)
class ScreenScore:
    """Screen of one effect: gain in log evidence over no effect, best level and secant, and for one without a
    slope when off where a refit begins (`Starts`)."""

    name: str
    gain: float
    level: int
    variant: int
    start: tuple[float, ...] = ()


def levels_between(problem: DiagnosisProblem, path_level: float) -> list[NoiseModel]:
    """Environments from the real one up to what the following path needed."""
    real = problem.environment.noise_model
    unit = force_unit(problem.model)
    quiet = max(float((np.array(real.force) / unit).max()), 1e-6)
    out = [real]
    level = quiet * 6.0
    while level < path_level:
        out.append(replace(real, force=tuple(np.maximum(real.force, level * unit))))
        level *= 6.0
    if path_level > quiet:
        out.append(replace(real, force=tuple(np.maximum(real.force, path_level * unit))))
    return out


def screen(bank: SensitivityBank) -> list[ScreenScore]:
    """All effects of the bank, best first; every level counts, as the true effect lowers the noise that is
    needed."""
    base = [posterior(bank.total(i).pick(bank.columns(()))).log_evidence for i in range(len(bank.levels))]
    none = max(base)
    out = []
    for name, column in bank.effects.items():
        best = ScreenScore(name, -np.inf, 0, 0)
        for i in range(len(bank.levels)):
            total = bank.total(i)
            for v in range(len(column.variants)):
                columns = bank.columns((name,), (v,))
                own = total.pick(columns)
                found = posterior(own)
                gain = found.log_evidence + over_usual_size(own, [bank.n_coef + column.sizes_of(v)]) - none
                if gain > best.gain:
                    start = () if column.effect.smooth else _start(column, v, float(found.mean[-1]))
                    best = ScreenScore(name, float(gain), i, v, start)
        out.append(best)
    return sorted(out, key=lambda s: -s.gain)


def _start(column: EffectColumns, variant: int, estimate: float) -> tuple[float, ...]:
    """Where a refit begins: at the size of the secant, or at a time tried in the size asked for there."""
    size = column.sizes[variant]
    if column.effect.dated is None:
        return (size,)
    return at_time(column.effect, float(np.clip(estimate, -3.0, 3.0)), size)


def widened(bank: SensitivityBank, names: Sequence[str], factor: float = 10.0) -> dict[str, float]:
    """Gain in log evidence when the prior sd of one coefficient is multiplied, or of all (`EVERY`); best over
    the levels."""
    out: dict[str, float] = {}
    base = [posterior(bank.total(i).pick(bank.columns(()))).log_evidence for i in range(len(bank.levels))]
    scales = {}
    for j, name in enumerate(names):
        scales[name] = np.ones(bank.n_coef)
        scales[name][j] = factor
    for name, times in EVERY.items():
        scales[name] = np.ones(bank.n_coef)
        scales[name][: len(names)] = times
    for name, scale in scales.items():
        gains = []
        for i in range(len(bank.levels)):
            g = bank.total(i).pick(bank.columns(()))
            wide = NormalEquations(g.ss * np.outer(scale, scale), g.se * scale, g.ee, g.logdet, g.used)
            gains.append(posterior(wide).log_evidence - max(base))
        out[name] = float(max(gains))
    return out


@dataclass(frozen=True, eq=False)
class Isolability:
    """What the manoeuvres can tell, from information alone.

    Attributes
    ----------
    names : effects
    detect : (k,) noncentrality of each effect after the coefficients took their part, at one prior sd in all:
        parameters have equal shares of it, also those that change nothing alone (a place, a lag, areas in
        no wind), so that of a mass and its place half of the mass's is told
    absorbed : (k,) share of the signature the coefficients can hide
    margin : (k, k) expected log-evidence margin of truth i over explanation j at the stated size
    groups : effects that cannot be told apart at the stated size
    size : in prior standard deviations
    """

    names: tuple[str, ...]
    detect: Array
    absorbed: Array
    margin: Array
    groups: tuple[tuple[str, ...], ...]
    size: float

    def rivals(self, name: str, share: float = 0.5) -> tuple[str, ...]:
        """Effects expected to take more than a share of what one shows of itself, the most alike first."""
        if name not in self.names:
            return ()
        i = self.names.index(name)
        shows = 0.5 * self.size**2 * self.detect[i]
        like = np.argsort(self.margin[i], kind="stable")
        return tuple(self.names[j] for j in like if j != i and self.margin[i, j] < (1.0 - share) * shows)


def isolability(bank: SensitivityBank, size: float = 0.3, level: int = 0) -> Isolability:
    """Detectability, absorption and isolability of all effects of a bank."""
    names = tuple(bank.effects)
    a = bank.total(level).ss
    c = bank.n_coef
    inner = np.linalg.inv(np.eye(c) + a[:c, :c])
    blocks = [bank.effects[n].variants[0] for n in names]
    schur = a[c:, c:] - a[c:, :c] @ inner @ a[:c, c:]
    detect, absorbed = np.zeros(len(names)), np.ones(len(names))
    units = np.zeros((schur.shape[0], len(names)))
    for i, b in enumerate(blocks):
        units[b - c, i] = 1.0 / np.sqrt(b.size)
        u = units[b - c, i]
        detect[i] = u @ schur[np.ix_(b - c, b - c)] @ u
        whole = u @ a[np.ix_(b, b)] @ u
        absorbed[i] = 1.0 - detect[i] / whole if whole > 0 else 1.0
    # what each explanation j takes of the signature of every truth i, and its own cost
    shown = schur @ (size * units)
    taken, occam = np.zeros((len(names), len(names))), np.zeros(len(names))
    for j, b in enumerate(blocks):
        own = schur[np.ix_(b - c, b - c)]
        wide = own + np.eye(b.size)
        taken[:, j] = (shown[b - c] * np.linalg.solve(wide, shown[b - c])).sum(axis=0)
        occam[j] = 0.5 * float(np.trace(np.linalg.solve(wide, own)) - np.linalg.slogdet(wide)[1])
    margin = 0.5 * (np.diag(taken)[:, None] - taken) + occam[:, None] - occam
    np.fill_diagonal(margin, 0.0)
    return Isolability(names, detect, absorbed, margin, _groups(names, detect, margin, size), size)


def _groups(names: tuple[str, ...], detect: Array, margin: Array, size: float) -> tuple[tuple[str, ...], ...]:
    """Connected components of detectable effects whose expected margin is below 5 either way."""
    seen: set[int] = set()
    out = []
    visible = [i for i in range(len(names)) if size**2 * detect[i] >= 10.0]
    for i in visible:
        if i in seen:
            continue
        stack, group = [i], []
        while stack:
            k = stack.pop()
            if k in seen:
                continue
            seen.add(k)
            group.append(k)
            stack += [j for j in visible if j not in seen and min(margin[k, j], margin[j, k]) < 5.0]
        if len(group) > 1:
            out.append(tuple(names[k] for k in sorted(group)))
    return tuple(out)
