"""The next manoeuvre: library candidates ranked, a set chosen and ordered, a free-form one made for the goal.

Takes a `PlanningCase`, what the manoeuvre is for, drawn vehicles. Gives a frozen `ManoeuvrePlan` with the
orders, the nominal track and the predicted gain, judged on vehicles the search has not seen. Does not write
files.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bayesid.analysis.design.compare import MOST_GROWTH, PlanningCase
from bayesid.analysis.design.criteria import Criteria, criteria
from bayesid.analysis.design.discrimination import Causes
from bayesid.analysis.design.freeform import Search, frame, random_design, search
from bayesid.analysis.design.goals import Goal, InformationGoal, predict, shrink
from bayesid.analysis.design.information import PlannedRun, RunInformation
from bayesid.analysis.design.run_selection import Choice, choose
from bayesid.errors import FitError, ModelError
from bayesid.manoeuvres import Manoeuvre, OpenLoop

Array = np.ndarray
Watch = Callable[[int, float], None]
GOALS = ("shrink", "predict", "gain", "tell")


@dataclass(frozen=True)
class SearchEffort:
    """How hard to look.

    search, judge : vehicles drawn to search with, and others to judge with
    evaluations : manoeuvres tried in the search for a free-form one
    random : random designs to compare with
    """

    search: int = 4
    judge: int = 12
    evaluations: int = 1500
    random: int = 20


@dataclass(frozen=True)
class CandidateManoeuvre:
    """One manoeuvre judged by the goal.

    kind : "library", "designed" or "random"
    shown : goal in its unit with this run added, `value` the same as larger-is-better
    """

    name: str
    kind: str
    shown: float
    value: float


@dataclass(frozen=True, eq=False)
class ManoeuvrePlan:
    """The next manoeuvre.

    Attributes
    ----------
    goal, unit : in words
    before : goal in its unit with the runs executed only
    candidates : library and designed manoeuvres, best first
    randoms : values of random designs within the same limits
    choice : set from the library; None for telling causes apart
    best : name of the first candidate
    orders, execution : of the designed manoeuvre, executed by the nominal vehicle
    after : criteria of the designed manoeuvre on top of the runs executed; None for telling causes apart
    search : how the search went
    refused : library manoeuvres left out, and why
    """

    goal: str
    unit: str
    before: float
    candidates: tuple[CandidateManoeuvre, ...]
    randoms: tuple[CandidateManoeuvre, ...]
    choice: Choice | None
    orders: OpenLoop
    execution: PlannedRun
    after: Criteria | None
    search: Search
    refused: Mapping[str, str]

    @property
    def best(self) -> CandidateManoeuvre:
        return self.candidates[0]

    @property
    def designed(self) -> CandidateManoeuvre:
        return next(c for c in self.candidates if c.kind == "designed")


def next_manoeuvre(
    case: PlanningCase,
    kind: str,
    rng: np.random.Generator,
    *,
    wanted: Manoeuvre | None = None,
    worst: bool = False,
    count: int = 3,
    effort: SearchEffort | None = None,
    causes: Causes | None = None,
    watch: Watch = lambda done, value: None,
) -> ManoeuvrePlan:
    """Plan the next run.

    Parameters
    ----------
    kind : "shrink" the directions left open, "predict" the wanted manoeuvre, "gain" on all coefficients,
        "tell" causes apart
    wanted, worst : the manoeuvre to predict, and whether its worst reading counts (G) or their mean (I)
    count : manoeuvres to choose and order from the library
    causes : needed for "tell"
    watch : called with (manoeuvres tried, best score)

    Raises
    ------
    FitError
        an unknown goal, or one that lacks what it needs
    """
    effort = effort or SearchEffort()
    if kind not in GOALS or (kind == "predict" and wanted is None) or (kind == "tell" and causes is None):
        needs = {"predict": " needs a wanted manoeuvre", "tell": " needs causes to tell apart"}.get(kind, "")
        raise FitError(f"goal {kind!r}{needs or ' is unknown'}; there are {', '.join(GOALS)}")
    draws = case.draws(rng, effort.search + effort.judge)
    search_draws, judging_draws = draws[: effort.search], draws[effort.search :]
    if not len(judging_draws):
        search_draws = judging_draws = draws
    library, refused = case.allowed()
    bench: _Bench = (
        _Margins(causes, search_draws, judging_draws) if kind == "tell" and causes is not None
        else _Matrices(case, kind, search_draws, judging_draws, wanted, worst)
    )  # fmt: skip
    entries = _judge(bench, library, "library", refused)
    shape = frame(case.bounds, case.model.scales["L"] / case.model.scales["U"])
    known = []
    for name in [c.name for c in sorted(entries, key=lambda c: -c.value)[:6]]:
        execution = case.execution(library[name])
        known.append((execution.track.t, execution.commands))

    def score(orders: OpenLoop) -> float:
        try:
            return bench.quick(orders) - penalty(case, orders)
        except ModelError:
            return -np.inf

    found = search(shape, score, rng, known, effort.evaluations, watch=watch)
    execution = case.execution(found.orders, name="designed")
    entries += _judge(bench, {"designed": found.orders}, "designed", {})
    if not any(c.kind == "designed" for c in entries):
        raise ModelError("the designed manoeuvre throws some of the vehicles drawn; narrow the limits")
    randoms: list[CandidateManoeuvre] = []
    for i in range(20 * effort.random):
        if len(randoms) >= effort.random:
            break
        anything = random_design(shape, rng)
        if not penalty(case, anything):
            randoms += _judge(bench, {f"random {i}": anything}, "random", {})
    choice, after = None, None
    if isinstance(bench, _Matrices):
        choice = choose(bench.infos, bench.goal, bench.now.matrices, count)
        after = criteria(case.knowledge, bench.now + case.of(found.orders, judging_draws, "designed"))
    ranked = tuple(sorted(entries, key=lambda c: -c.value))
    return ManoeuvrePlan(
        bench.name, bench.unit, bench.before, ranked, tuple(randoms), choice, found.orders, execution, after,
        found, refused,
    )  # fmt: skip


def penalty(case: PlanningCase, orders: OpenLoop) -> float:
    """0 within the limits, and large beyond them, growing with the excess."""
    if not case.bounds.bind and case.steady:
        return 0.0
    execution = case.execution(orders)
    over = sum(case.bounds.violations(execution.track).values())
    if over == 0.0 and not case.steady and case.growth(execution) > MOST_GROWTH:
        over = 1.0
    return 1e3 * (over + (over > 0))


def _judge(
    bench: _Bench, manoeuvres: Mapping[str, Manoeuvre], kind: str, refused: dict[str, str]
) -> list[CandidateManoeuvre]:
    out = []
    for name, manoeuvre in manoeuvres.items():
        try:
            shown, value = bench.full(name, manoeuvre)
        except ModelError as exc:
            refused[name] = f"not every vehicle drawn survives it ({exc})"
            continue
        out.append(CandidateManoeuvre(name, kind, shown, value))
    return out


class _Bench:
    """Where manoeuvres are judged: quickly on a few vehicles, fully on others."""

    name: str
    unit: str
    before: float

    def quick(self, manoeuvre: Manoeuvre) -> float:
        raise NotImplementedError

    def full(self, name: str, manoeuvre: Manoeuvre) -> tuple[float, float]:
        raise NotImplementedError


class _Matrices(_Bench):
    """Goals that are functions of Fisher information."""

    def __init__(
        self,
        case: PlanningCase,
        kind: str,
        search_draws: Array,
        judging_draws: Array,
        wanted: Manoeuvre | None,
        worst: bool,
    ) -> None:
        self.case, self.search_draws, self.judging_draws = case, search_draws, judging_draws
        self.first, self.now = case.now(search_draws), case.now(judging_draws)
        self.infos: dict[str, RunInformation] = {}
        self.goal, self.fast = self._goals(kind, wanted, worst)
        self.name, self.unit = self.goal.name, self.goal.unit
        self.before = self.goal.shown(self.now.matrices)

    def _goals(self, kind: str, wanted: Manoeuvre | None, worst: bool) -> Sequence[Goal]:
        c = self.case
        if kind == "shrink":
            one = shrink(self.first)
            return one, one
        if kind == "gain" or wanted is None:
            return InformationGoal(), InformationGoal()
        return tuple(
            predict(c.model, c.knowledge, d, wanted, c.logging, worst, c.scatter)
            for d in (self.judging_draws, self.search_draws)
        )

    def quick(self, manoeuvre: Manoeuvre) -> float:
        return self.fast.value(self.first.matrices + self.case.of(manoeuvre, self.search_draws).matrices)

    def full(self, name: str, manoeuvre: Manoeuvre) -> tuple[float, float]:
        info = self.case.of(manoeuvre, self.judging_draws, name)
        if not name.startswith(("random ", "designed")):
            self.infos[name] = info
        total = self.now.matrices + info.matrices
        return self.goal.shown(total), self.goal.value(total)


class _Margins(_Bench):
    """The goal of telling causes apart."""

    def __init__(self, causes: Causes, search_draws: Array, judging_draws: Array) -> None:
        self.causes, self.search_draws, self.judging_draws = causes, search_draws[:2], judging_draws[:4]
        self.name, self.unit, self.before = causes.name, causes.unit, causes.now

    def quick(self, manoeuvre: Manoeuvre) -> float:
        return self.causes.margin(self.causes.matrices(manoeuvre, self.search_draws))

    def full(self, name: str, manoeuvre: Manoeuvre) -> tuple[float, float]:
        value = self.causes.margin(self.causes.matrices(manoeuvre, self.judging_draws))
        return value, value
