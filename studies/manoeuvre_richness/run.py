"""Which manoeuvre tells what, which to run next, and does the advice hold? Three vehicles, two ships' logs.

Usage: bayesid study manoeuvre_richness [--data FOLDER] [--out FOLDER] [--quick] [--seed N]. FOLDER
holds `kvlcc2_hsva` and `esso_osaka` as in studies/real_logs/run.py; without it the part on logs is left out.
Every part is kept in OUT/parts as it ends; an interrupted study goes on where it was.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from bayesid.analysis.design import (
    ManoeuvrePlan,
    PlanningCase,
    SearchEffort,
    causes,
    limits,
    next_manoeuvre,
    usual_logging,
)
from bayesid.analysis.design.criteria import contraction
from bayesid.analysis.design.discrimination import VIRTUAL_FORCE_LEVEL, evidence
from bayesid.analysis.design.freeform import frame, random_design
from bayesid.analysis.design.goals import shrink
from bayesid.analysis.design.information import planned, run_information
from bayesid.analysis.design.limits import library_within
from bayesid.analysis.design.paired_comparison import paired_outcomes
from bayesid.analysis.design.planning_case import known_of
from bayesid.analysis.design.posterior_check import sampled
from bayesid.api.compare import compared
from bayesid.diagnosis.data.problem import build_problem
from bayesid.equations.model import build_model
from bayesid.estimation.parameters import effect_prior
from bayesid.files import write_json
from bayesid.lock import lock_or_exit
from bayesid.manoeuvres import OpenLoop, on_grid
from bayesid.model.terms import term
from bayesid.model.vehicles import load_vehicle
from bayesid.progress import Progress, Stage
from bayesid.report import writer
from bayesid.report.compare import comparison_record
from bayesid.report.design import plan_record
from bayesid.simulation.virtual_trial import virtual_trial
from bayesid.trials import Environment
from studies.manoeuvre_richness.independent_plant import PlantVehicles
from studies.manoeuvre_richness.real_runs import real
from studies.manoeuvre_richness.report import richness_report
from studies.real_logs.run import INERTIA, SETTINGS

VEHICLES = ("generic_sub", "remus100", "nps_auv2")
BEFORE, WANTED = "zigzag_10", "turn"  # executed already; to be predicted
GOALS = ("shrink", "predict")
SAMPLED = VEHICLES[:2]
CAUSES = ("rudder_offset", "propeller_side_force")
SMALL = 0.2  # size of a cause in its prior sd: seen, but not told from the other, after one zig-zag


@dataclass(frozen=True)
class Size:
    """How much is done: drawn vehicles, true vehicles of the maps and of the paired test, search, chains."""

    draws: int
    truths: int
    pairs: int
    effort: SearchEffort
    steps: int


FULL = Size(12, 4, 20, SearchEffort(4, 12, 1200, 20), 4000)
QUICK = Size(3, 1, 5, SearchEffort(2, 3, 50, 2), 0)


def main(data: Path | None, out: Path, quick: bool, seed: int, names: Sequence[str] = VEHICLES) -> Path:
    """All parts, then the report."""
    size, progress = QUICK if quick else FULL, Progress()
    key = {"quick": quick, "seed": seed}

    def part(name: str, work: Callable[[], Any]) -> Any:
        return kept(out / "parts" / f"{name}.json", key, work)

    vehicles = {}
    for name in names[:1] if quick else names:
        case = case_of(name)
        record = {"comparison": part(f"{name}_compare", partial(library_part, case, size, seed, progress))}
        record |= part(f"{name}_design", partial(design_part, case, size, seed, progress))
        if size.steps and name in SAMPLED:
            work = partial(sampled_part, case, record["orders"]["shrink"], name, size, seed, progress)
            record["sampled"] = part(f"{name}_sampled", work)
        vehicles[name] = record
    deep = part("six_dof", lambda: vertical("generic_sub", progress))
    discrimination = part("tell", lambda: tell_part(case_of(VEHICLES[0]), size, seed, progress))
    logs = {}
    for name in () if quick else SETTINGS:
        if data is not None and (data / name).is_dir():
            logs[name] = part(name, partial(real, name, data / name, progress, seed))
    plain = {n: {k: v for k, v in r.items() if k != "orders"} for n, r in vehicles.items()}
    results = {"seeds": [seed], "vehicles": plain, "six_dof": deep, "tell": discrimination, "logs": logs}
    page = writer.write(richness_report(vehicles, deep, discrimination, logs, quick), out, results)
    return page


def kept(path: Path, key: dict[str, Any], work: Callable[[], Any]) -> Any:
    """A part's record, made if it is not there yet."""
    if path.is_file():
        found = json.loads(path.read_text(encoding="utf-8"))
        if found["key"] == key:
            return found["record"]
    path.parent.mkdir(parents=True, exist_ok=True)
    write_json(path, {"key": key, "record": work()})
    return json.loads(path.read_text(encoding="utf-8"))["record"]


def case_of(name: str) -> PlanningCase:
    """A vehicle before its trial; the added mass along the axes is taken as known."""
    model = build_model(load_vehicle(name), 3)
    known = known_of(model, fixed=[n for n in INERTIA if n in model.coefficients])
    return PlanningCase(model, known, usual_logging(model), limits(model))


def library_part(case: PlanningCase, size: Size, seed: int, progress: Progress) -> dict[str, Any]:
    """Every manoeuvre of the library by information, refits and sparse regression."""
    coast = {"coast": library_within(case.model, case.bounds)["coast"]} if case.steady else {}
    return comparison_record(compared(case, (), coast, size.draws, size.truths, seed, progress))


def design_part(case: PlanningCase, size: Size, seed: int, progress: Progress) -> dict[str, Any]:
    """Designs for two goals after a zig-zag, and the paired test of both against all rivals, executed by the
    independent plant."""
    library = library_within(case.model, case.bounds)
    before, wanted = {BEFORE: library[BEFORE]}, library[WANTED]
    after = replace(case, executed=(case.execution(library[BEFORE], name=BEFORE).run,))
    plans = {}
    for goal in GOALS:
        with progress.stage(f"design to {goal}", size.effort.evaluations) as stage:
            plans[goal] = next_manoeuvre(
                after, goal, np.random.default_rng(seed), wanted=wanted, effort=size.effort,
                watch=partial(shown, stage),
            )  # fmt: skip
    rng = np.random.default_rng(seed + 1)
    open_ones = shrink(after.now(after.draws(rng, size.draws)))
    rivals = {f"designed to {g}": p.orders for g, p in plans.items()} | case.allowed()[0]
    shape = frame(case.bounds, case.model.scales["L"] / case.model.scales["U"])
    randoms = [random_design(shape, rng) for _ in range(size.pairs)]
    truths = case.draws(rng, size.pairs)
    with progress.stage("paired test", len(truths) * (len(rivals) + 1)) as stage:
        test = paired_outcomes(
            case, before, rivals, open_ones, wanted, truths, seed, stage.step,
            varied=lambda s: randoms[s], vehicles=PlantVehicles(case),
        )  # fmt: skip
    return {
        "plans": {g: plan_record(after, p, seed, ()) for g, p in plans.items()},
        "orders": {g: orders_of(p) for g, p in plans.items()},
        "test": test,
    }


def shown(stage: Stage, done: int, best: float) -> None:
    """One manoeuvre tried."""
    stage.step(info=f"best {best:.4g}")


def orders_of(plan: ManoeuvrePlan) -> dict[str, Any]:
    """Orders and nominal track of a design."""
    track = plan.execution.track
    return {"t": plan.orders.t, "x": track["x"], "y": track["y"], **plan.orders.commands}


def sampled_part(
    case: PlanningCase, orders: dict[str, Any], name: str, size: Size, seed: int, progress: Progress
) -> dict[str, Any]:
    """emcee on a few campaigns of one true vehicle."""
    library = library_within(case.model, case.bounds)
    commands = {c: np.array(v) for c, v in orders.items() if c.endswith("_cmd")}
    designed = OpenLoop("designed", np.array(orders["t"]), commands)
    campaigns = {f"{BEFORE} + designed to shrink": [library[BEFORE], designed]}
    if name == VEHICLES[0]:
        campaigns["zigzag_20"] = [library["zigzag_20"]]
    rng = np.random.default_rng(seed + 2)
    draws, (truth, *_) = case.draws(rng, size.draws), case.draws(rng, 4)
    return {
        n: sampled(case, runs, truth, draws, seed, size.steps)
        for n, runs in progress.track(campaigns.items(), f"{name}: emcee")
    }


def tell_part(case: PlanningCase, size: Size, seed: int, progress: Progress) -> dict[str, Any]:
    """Two causes of a gap: the design that tells them apart, and the evidence when either is planted."""
    model, library = case.model, library_within(case.model, case.bounds)
    flown_before = {"straight": library["straight"], BEFORE: library[BEFORE]}

    def problem_of(plant: dict[str, float], more: dict[str, Any], rng: np.random.Generator) -> Any:
        par = case.draws(rng, 4)[0] if plant else model.nominal.copy()
        for key, value in plant.items():
            par[model.index[key]] = value
        dt = case.logging.dt
        coarse = {
            n: on_grid(m, dt) if isinstance(m, OpenLoop) else replace(m, dt=dt)
            for n, m in {**flown_before, **more}.items()
        }
        trial = virtual_trial(
            model, par, coarse, title="tell", vehicle_ref="", noise=case.logging.sigma, rng=rng
        )
        sea = Environment(VIRTUAL_FORCE_LEVEL, 0.0)
        return causes(build_problem(model, replace(trial, environment=sea)), CAUSES, SMALL, 46.0)

    goal = problem_of({}, {}, np.random.default_rng(seed))
    effort = replace(size.effort, evaluations=min(size.effort.evaluations, 300), random=6)
    with progress.stage("design to tell", effort.evaluations) as stage:
        plan = next_manoeuvre(
            case, "tell", np.random.default_rng(seed), causes=goal, effort=effort,
            watch=partial(shown, stage),
        )  # fmt: skip
    rival = next(c.name for c in plan.candidates if c.kind == "library")
    campaigns: dict[str, dict[str, Any]] = {
        "nothing more": {},
        rival: {rival: library[rival]},
        "designed": {"designed": plan.orders},
    }
    rows = []
    for cause in progress.track(CAUSES, "causes planted"):
        prior = effect_prior(model, model.effects[cause])
        other = next(n for n in CAUSES if n != cause)
        for k in range(1 if size is QUICK else 4):
            for label, more in campaigns.items():
                plant = {n: SMALL * float(s) for n, s in zip(prior.names, prior.sd, strict=True)}
                found = evidence(problem_of(plant, more, np.random.default_rng([seed, k])))
                rows.append([cause, k, label, found[cause] - found[other]])
    return {"plan": plan_record(case, plan, seed, ()), "orders": orders_of(plan), "rows": rows, "size": SMALL}


def vertical(name: str, progress: Progress) -> dict[str, Any]:
    """Largest contraction of a vertical-plane coefficient: vehicle held upright, and as it rolls."""
    model = build_model(load_vehicle(name), 6)
    known = known_of(model)
    case = PlanningCase(model, known, usual_logging(model), limits(model))
    where = [i for i, n in enumerate(known.names) if not term(n).planar and "p" not in term(n).regressor]
    upright = model.nominal.copy()
    upright[[i for n, i in model.index.items() if n.startswith("K_") or n in ("Y_pdot", "N_pdot")]] = 0.0
    upright[model.positions(["z_G", "z_B"])] = 0.0
    rows = []
    for key, manoeuvre in progress.track(
        library_within(model, case.bounds).items(), "six degrees of freedom"
    ):
        shares = []
        for par in (upright, model.nominal):
            run = planned(model, par, manoeuvre, case.logging, key).run
            shares.append(contraction(known, run_information(model, known, par, run))[where])
        best = int(np.argmax(shares[1]))
        rows.append([key, float(shares[0].max()), float(shares[1].max()), known.names[where[best]]])
    return {"names": [known.names[i] for i in where], "rows": rows}


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        prog="bayesid study manoeuvre_richness",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--data", type=Path, help="folder with kvlcc2_hsva and esso_osaka")
    parser.add_argument("--out", type=Path, default=Path("out/manoeuvre_richness"))
    parser.add_argument("--quick", action="store_true", help="one vehicle, few draws, no chains, no logs")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--vehicles", nargs="+", choices=VEHICLES, default=VEHICLES, help="not all of them")
    given = parser.parse_args()
    lock_or_exit(given.out, "studies/manoeuvre_richness/run.py")
    main(given.data, given.out, given.quick, given.seed, given.vehicles)
