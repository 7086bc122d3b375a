"""`bayesid.design`: the next manoeuvre, as a command table, for what is still open."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bayesid.analysis.design import Causes, ManoeuvrePlan, SearchEffort, next_manoeuvre
from bayesid.analysis.design.compare import PlanningCase
from bayesid.analysis.design.discrimination import VIRTUAL_FORCE_LEVEL, causes
from bayesid.api.inputs import Names, VehicleLike, names_of
from bayesid.api.planning import case_of, reference_scale, require_rudder, subject_of
from bayesid.api.result import Result, table
from bayesid.diagnosis.data.problem import build_problem
from bayesid.equations.model import Model
from bayesid.errors import FitError
from bayesid.files import write_json
from bayesid.manoeuvres import parse, write_table
from bayesid.model.vehicles import Vehicle
from bayesid.model.vehicles.orders import own_orders
from bayesid.progress import Progress
from bayesid.report import design as words
from bayesid.report import design_first_screen as screen
from bayesid.report.writer import Report
from bayesid.report.writer.text import table_text
from bayesid.simulation.virtual_trial import virtual_trial
from bayesid.threads import one_blas_thread
from bayesid.trials import Environment, Trial

if TYPE_CHECKING:
    import pandas

TABLE = "next_manoeuvre.csv"
MOST_TRIES, MOST_TRIES_CAUSES = 1500, 600


@one_blas_thread
def design(
    source: Trial | Vehicle | str | os.PathLike[str],
    vehicle: VehicleLike | None = None,
    *,
    data: str | os.PathLike[str] | None = None,
    resample: float | None = None,
    pieces: float | None = None,
    dof: int | None = None,
    model: str | os.PathLike[str] | None = None,
    executed: Iterable[str] = (),
    gain: bool = False,
    predict: str | None = None,
    worst: bool = False,
    tell: Names = None,
    size: float = 0.3,
    duration: float | None = None,
    rudder: float | None = None,
    rate: float | None = None,
    rpm: tuple[float, float] | None = None,
    box: float | None = None,
    depth: float | None = None,
    plane: float | None = None,
    hold: float | None = None,
    noise: Mapping[str, float] | None = None,
    dt: float | None = None,
    fix: Names = None,
    prior: float | None = None,
    count: int = 3,
    tries: int = MOST_TRIES,
    seed: int = 0,
    quick: bool = False,
    progress: Progress | None = None,
) -> DesignResult:
    """Design the next manoeuvre within limits: shrink what is open (default), predict, or tell causes apart.

    Parameters
    ----------
    source, vehicle, data, resample, pieces, dof, model, executed : as in `bayesid.compare`
    duration, rudder, plane, noise, dt, fix, prior : as in `bayesid.compare`
    gain : goal: most about all coefficients, open or not
    predict : goal: predict this manoeuvre better; `worst` its worst reading instead of the mean
    tell : goal: tell these causes of a gap apart, at `size` times their prior sd
    rate : rudder rate [rad/s]
    rpm : lowest and highest shaft speed
    box, depth : longest side of the area swept and largest change of depth [m]
    hold : orders of the designed manoeuvre change only every so many seconds, as an autopilot's table does;
        it is searched and judged so
    count : manoeuvres of the library chosen and ordered
    tries : manoeuvres tried in the search

    Raises
    ------
    FitError
        more than one goal
    TrialError, VehicleError, ManoeuvreError
        what cannot be read, set up or executed; a vehicle without a rudder
    """
    causes_to_tell = names_of(tell)
    goals = [
        name for name, given in (("gain", gain), ("predict", predict), ("tell", causes_to_tell)) if given
    ]
    if len(goals) > 1:
        raise FitError(f"one goal at a time: gain, predict or tell; given are {' and '.join(goals)}")
    subject, trial = subject_of(source, vehicle, dof, prior, data, resample)
    require_rudder(subject.vehicle, "designed")
    made = case_of(
        subject, trial, executed=executed, fitted=model, fix=fix, noise=noise, dt=dt, duration=duration,
        rudder=rudder, rate=rate, rpm=rpm, box=box, depth=depth, plane=plane, pieces=pieces, hold=hold,
    )  # fmt: skip
    case, notes = made.case, list(made.notes)
    between = _causes(case, subject, trial, causes_to_tell, size, seed, notes) if causes_to_tell else None
    most = (
        (200 if quick else tries)
        if causes_to_tell is None
        else (60 if quick else min(tries, MOST_TRIES_CAUSES))
    )
    effort = SearchEffort(2, 4, most, 6) if quick else SearchEffort(evaluations=most)
    with (progress or Progress(quiet=True)).stage("search", most) as stage:
        plan = next_manoeuvre(
            case, goals[0] if goals else "shrink", np.random.default_rng(seed),
            wanted=parse(predict, reference_scale(subject)) if predict else None, worst=worst, count=count,
            effort=effort, causes=between, watch=lambda done, best: stage.step(info=f"best {best:.4g}"),
        )  # fmt: skip
    return DesignResult(case, plan, seed, tuple(notes))


def _causes(
    case: PlanningCase,
    model: Model,
    trial: Trial | None,
    names: list[str],
    size: float,
    seed: int,
    notes: list[str],
) -> Causes:
    """The causes to tell apart, after the trial or after runs taken as executed."""
    if trial is None:
        coarse = replace(reference_scale(model), dt=case.logging.dt)
        texts = [r.name for r in case.executed] or ["zigzag:10/10"]
        executed = {t: parse(t, coarse) for t in ["straight", *texts]}
        trial = virtual_trial(
            model, model.nominal, executed, title="taken as executed", vehicle_ref=model.vehicle.name,
            noise=case.logging.sigma, rng=np.random.default_rng(seed),
        )  # fmt: skip
        trial = replace(trial, environment=Environment(VIRTUAL_FORCE_LEVEL, 0.0))
        notes.append(
            f"Taken as executed: {', '.join(executed)}, in a sea of {VIRTUAL_FORCE_LEVEL:g} of 1/2 rho "
            f"L^2 U^2 rms."
        )
    longest = case.bounds.duration * model.scales["U"] / model.scales["L"]
    return causes(build_problem(model, trial), names, size, longest * 1.01)


@dataclass(frozen=True, eq=False, repr=False)
class DesignResult(Result):
    """The manoeuvre to execute next, beside the library and random ones.

    Attributes
    ----------
    plan : orders, track, candidates and what they are worth; `plan.orders` is the command table
    """

    case: PlanningCase
    plan: ManoeuvrePlan
    seed: int
    notes: tuple[str, ...]

    def to_dataframe(self) -> pandas.DataFrame:
        return table(words.CANDIDATE_COLUMNS, words.candidate_rows(self.plan)).set_index(
            words.CANDIDATE_COLUMNS[0]
        )

    def report(self) -> Report:
        return words.plan_report(self.case, self.plan, list(self.notes), TABLE)

    def save(self, folder: str | os.PathLike[str]) -> Path:
        target, record = Path(folder), self.record()
        target.mkdir(parents=True, exist_ok=True)
        orders = self.plan.orders
        own = replace(orders, commands=own_orders(self.case.model.vehicle, orders.commands))
        write_table(own, target / TABLE)
        write_json(target / "design.json", record)
        return words.write_plan(self.case, self.plan, target, record, list(self.notes), TABLE)

    def record(self) -> Mapping[str, Any]:
        return words.plan_record(self.case, self.plan, self.seed, list(self.notes))

    def summary(self, verbose: bool = False) -> str:
        plan = self.plan
        lines = [screen.headline(self.case, plan, TABLE), *screen.cautions(plan), ""]
        lines += [*(f"note: {note}" for note in self.notes), f"goal: {plan.goal}; {plan.unit}"]
        lines.append(table_text(words.CANDIDATE_COLUMNS, words.candidate_rows(plan), digits=3))
        if plan.randoms:
            shown = [c.shown for c in plan.randoms]
            lines.append(f"random designs within the limits: {min(shown):.3g} to {max(shown):.3g}")
        if plan.choice is not None:
            steps = zip(plan.choice.names, plan.choice.values, strict=True)
            ordered = ", ".join(f"{name} ({value:.3g})" for name, value in steps)
            lines.append(f"from the library, in order: {ordered}")
        lines += [f"left out: {name}: {why}" for name, why in plan.refused.items()]
        return "\n".join(lines)
