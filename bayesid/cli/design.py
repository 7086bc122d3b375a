"""`bayesid design`: the next manoeuvre, as a command table, for what is still open."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from bayesid.cli import planning as p
from bayesid.cli.guard import OK
from bayesid.cli.options import Json, Out, Quick, Seed, Verbose

if TYPE_CHECKING:
    from bayesid.design import Causes, Plan
    from bayesid.design.compare import Case
    from bayesid.model import Model
    from bayesid.trials import Trial

TABLE = "next_manoeuvre.csv"
Gain = Annotated[bool, typer.Option("--gain", help="Goal: most about all coefficients, open or not.")]
Predict = Annotated[
    str | None, typer.Option("--predict", metavar="MANOEUVRE", help="Goal: predict this one better.")
]
Worst = Annotated[bool, typer.Option("--worst", help="With --predict: its worst reading, not the mean.")]
Tell = Annotated[
    str | None, typer.Option("--tell", metavar="A,B", help="Goal: tell these causes of a gap apart.")
]
Size = Annotated[float, typer.Option("--size", help="With --tell: size of the causes over their prior sd.")]
Count = Annotated[int, typer.Option("--count", min=1, max=20, help="Library manoeuvres chosen and ordered.")]
Tries = Annotated[int, typer.Option("--tries", min=50, max=100_000, help="Manoeuvres tried in the search.")]


def design(
    source: p.Source,
    vehicle: p.Other = None,
    dof: p.Dof = None,
    flown: p.Flown = None,
    gain: Gain = False,
    predict: Predict = None,
    worst: Worst = False,
    tell: Tell = None,
    size: Size = 0.3,
    duration: p.Duration = None,
    rudder: p.Rudder = None,
    rate: p.Rate = None,
    rpm: p.Shaft = None,
    box: p.Box = None,
    depth: p.Depth = None,
    plane: p.Plane = None,
    noise: p.Noise = None,
    dt: p.Step = None,
    fixed: p.Fixed = None,
    known: p.Known = 0.1,
    count: Count = 3,
    tries: Tries = 1500,
    out: Out = None,
    seed: Seed = 0,
    quick: Quick = False,
    as_json: Json = False,
    verbose: Verbose = False,
) -> int:
    """Design the next manoeuvre within limits: shrink what is open (default), predict, or tell causes apart.

    --out gets next_manoeuvre.csv, design.json and a report.
    """
    import numpy as np

    from bayesid.cli.output import say, say_json
    from bayesid.design import Effort, next_manoeuvre
    from bayesid.files import write_json
    from bayesid.manoeuvres import parse, write_table
    from bayesid.progress import Progress
    from bayesid.sections import planning_next as words

    goals = [name for name, given in (("gain", gain), ("predict", predict), ("tell", tell)) if given]
    if len(goals) > 1:
        raise typer.BadParameter(
            "one goal at a time: --gain, --predict or --tell", param_hint="--" + goals[1]
        )
    model, trial = p.read(source, vehicle, dof)
    made = p.set_up(
        model, trial, flown=flown, fixed=fixed, known=known, noise=noise, dt=dt, duration=duration,
        rudder=rudder, rate=rate, rpm=rpm, box=box, depth=depth, plane=plane,
    )  # fmt: skip
    case, notes, progress = made.case, list(made.notes), Progress(quiet=as_json)
    causes = _causes(case, model, trial, tell, size, seed, notes) if tell else None
    most = (200 if quick else tries) if tell is None else (60 if quick else min(tries, 600))
    effort = Effort(2, 4, most, 6) if quick else Effort(evaluations=most)
    with progress.stage("search", most) as stage:
        plan = next_manoeuvre(
            case, goals[0] if goals else "shrink", np.random.default_rng(seed),
            wanted=parse(predict, p.scale(model)) if predict else None, worst=worst, count=count,
            effort=effort, causes=causes, watch=lambda done, best: stage.step(info=f"best {best:.4g}"),
        )  # fmt: skip
    record = words.plan_record(case, plan, seed, notes)
    report = None
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
        write_table(plan.orders, out / TABLE)
        write_json(out / "design.json", record)
        report = words.write_plan(case, plan, out, record, notes, TABLE)
    if as_json:
        say_json(record)
        return OK
    _answer(plan, notes)
    if out is None:
        say("\nGive --out FOLDER for the command table and the report.")
    else:
        say(f"\ncommand table: {out / TABLE}\nreport: {report}")
    return OK


def _answer(plan: Plan, notes: list[str]) -> None:
    from bayesid.cli.output import say, say_table
    from bayesid.sections.planning_next import CANDIDATE_COLUMNS, candidate_rows

    p.say_notes(notes)
    say(f"goal: {plan.goal}; {plan.unit}")
    say_table(CANDIDATE_COLUMNS, candidate_rows(plan), digits=3)
    if plan.randoms:
        shown = [c.shown for c in plan.randoms]
        say(f"random designs within the limits: {min(shown):.3g} to {max(shown):.3g}")
    if plan.choice is not None:
        steps = zip(plan.choice.names, plan.choice.values, strict=True)
        say("from the library, in order: " + ", ".join(f"{name} ({value:.3g})" for name, value in steps))
    for name, why in plan.refused.items():
        say(f"left out: {name}: {why}")


def _causes(
    case: Case, model: Model, trial: Trial | None, tell: str, size: float, seed: int, notes: list[str]
) -> Causes:
    """The causes to tell apart, after the trial or after runs taken as flown."""
    import numpy as np

    from bayesid.design.causes import CALM, causes
    from bayesid.diagnose.problem import pose
    from bayesid.manoeuvres import parse
    from bayesid.trials import Environment
    from bayesid.virtual import virtual_trial

    names = [n.strip() for n in tell.split(",") if n.strip()]
    if trial is None:
        from dataclasses import replace

        coarse = replace(p.scale(model), dt=case.logging.dt)
        texts = [r.name for r in case.flown] or ["zigzag:10/10"]
        flown = {t: parse(t, coarse) for t in ["straight", *texts]}
        trial = virtual_trial(
            model, model.nominal, flown, title="taken as flown", vehicle_ref=model.vehicle.name,
            noise=case.logging.sigma, rng=np.random.default_rng(seed),
        )  # fmt: skip
        trial = replace(trial, environment=Environment(CALM, 0.0))
        notes.append(
            f"Taken as flown: {', '.join(flown)}, in a sea of {CALM:g} of 1/2 rho L^2 U^2 rms."
        )
    posed = pose(model, trial)
    longest = case.bounds.duration * model.scales["U"] / model.scales["L"]
    return causes(posed, names, size, longest * 1.01)
