"""`bayesid compare`: which manoeuvre reveals which coefficient, adds what, and predicts which other."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from bayesid.cli import planning as p
from bayesid.cli.guard import OK
from bayesid.cli.options import Json, Out, Quick, Seed, Verbose

if TYPE_CHECKING:
    from bayesid.sections.planning_compare import Comparison

Extra = Annotated[
    list[str] | None,
    typer.Option("--also", metavar="MANOEUVRE", help="Compared with the library, e.g. table:mine.csv."),
]
Refits = Annotated[
    int, typer.Option("--refits", min=0, max=200, help="True vehicles flown and refitted to check; 0: none.")
]


def compare(
    source: p.Source,
    vehicle: p.Other = None,
    dof: p.Dof = None,
    flown: p.Flown = None,
    also: Extra = None,
    duration: p.Duration = None,
    rudder: p.Rudder = None,
    plane: p.Plane = None,
    noise: p.Noise = None,
    dt: p.Step = None,
    fixed: p.Fixed = None,
    known: p.Known = 0.1,
    draws: p.Draws = 8,
    refits: Refits = 3,
    out: Out = None,
    seed: Seed = 0,
    quick: Quick = False,
    as_json: Json = False,
    verbose: Verbose = False,
) -> int:
    """Compare manoeuvres before anything is flown: information, contraction, cross prediction.

    --out gets comparison.json and a report.
    """
    from bayesid.cli.output import say, say_json, say_table
    from bayesid.files import write_json
    from bayesid.progress import Progress
    from bayesid.sections import planning_compare as words

    model, trial = p.read(source, vehicle, dof)
    made = p.set_up(
        model, trial, flown=flown, fixed=fixed, known=known, noise=noise, dt=dt, duration=duration,
        rudder=rudder, plane=plane,
    )  # fmt: skip
    found = compared(
        made.case, made.notes, p.orders(model, also), 4 if quick else draws, 0 if quick else refits, seed,
        Progress(quiet=as_json),
    )  # fmt: skip
    record = words.comparison_record(found)
    report = None
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
        write_json(out / "comparison.json", record)
        report = words.write_comparison(found, out, record)
    if as_json:
        say_json(record)
        return OK
    p.say_notes(found.notes)
    say_table(words.RICHNESS_COLUMNS, words.richness_rows(found.case.knowledge, found.richness), digits=3)
    for name, why in found.refused.items():
        say(f"left out: {name}: {why}")
    for what, value in found.ranks.items():
        say(f"rank correlation, {what}: {value:.2f}")
    if report is not None:
        say(f"\nreport: {report}")
    return OK


def compared(
    case: Any, notes: tuple[str, ...], also: dict[str, Any], draws: int, refits: int, seed: int, progress: Any
) -> Comparison:
    """The comparison of the library and of manoeuvres given."""
    import numpy as np

    from bayesid.design.compare import crossed, crossing, rank_correlation, richness, tried
    from bayesid.design.criteria import flat_names
    from bayesid.design.witness import inclusion
    from bayesid.sections.planning_compare import Comparison

    rng = np.random.default_rng(seed)
    vehicles = case.draws(rng, draws)
    allowed, refused = case.allowed()
    manoeuvres = {**allowed, **also}
    with progress.stage("information", len(manoeuvres)) as stage:
        rich, infos = richness(case, manoeuvres, vehicles, lambda name: stage.step(info=name))
    refused |= {n: "not every vehicle drawn survives it" for n in manoeuvres if n not in infos}
    flown = {c.name: manoeuvres[c.name] for c in rich.criteria}
    table = crossing(case, flown, {n: infos[n] for n in flown}, vehicles)
    trials = []
    for k, par in enumerate(case.draws(rng, refits) if refits else ()):
        with progress.stage(f"refits of vehicle {k + 1} of {refits}", len(flown)) as stage:
            trials.append(tried(case, flown, par, seed + k, lambda _: stage.step()))
    actual = included = None
    if trials:
        table = crossed(case, table, trials)
        actual = np.array([
            np.mean([t.refits[n].contraction(case.knowledge) for t in trials if n in t.refits], axis=0)
            for n in flown
        ])  # fmt: skip
        with progress.stage("sparse regression", len(flown)) as stage:
            seen = inclusion(case, flown, case.model.nominal, seed, watch=lambda _: stage.step())
        included = np.array([seen.get(n, np.full(len(case.knowledge.names), np.nan)) for n in flown])
    fisher = rich.contraction()
    gains = np.array([c.gain for c in rich.criteria])
    ranks = {"richness and (small) predicted error over the other manoeuvres": rank_correlation(
        gains, -table.others(table.predicted))}  # fmt: skip
    if actual is not None and included is not None:
        ranks |= {
            "expected contraction and contraction of refits": rank_correlation(fisher, actual),
            "expected contraction and inclusion by sparse regression": rank_correlation(fisher, included),
            "contraction of refits and inclusion by sparse regression": rank_correlation(actual, included),
            "predicted and actual cross error": rank_correlation(table.predicted, table.actual),
            "richness and (small) actual error over the other manoeuvres": rank_correlation(
                gains, -table.others(table.actual)),
        }  # fmt: skip
    return Comparison(
        case, rich, {n: flat_names(case.knowledge, infos[n]) for n in flown}, actual, included, table, ranks,
        refused, notes, seed, len(vehicles), len(trials),
    )  # fmt: skip
