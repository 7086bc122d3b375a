"""Are mistakes of a simulator told from a cause: which planted ones are named, and what is named wrongly?

Usage: bayesid study simulator_mistakes [--out FOLDER] [--quick] [--vehicles A,B] [--seeds 0,21]
[--every] [--render FOLDER]. Without --every a vehicle has each mistake at one of the seeds, in turn. Logs are
made with the right numbers; the vehicle file gets one mistake at a time. The log goes through the check of
the input, the comparison of causes and the search for mistakes of the simulator, as in `bayesid diagnose`;
held-out runs are not asked. Results are kept: a second call goes on.
"""

from __future__ import annotations

import argparse
import json
import time
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bayesid.diagnosis.data.problem import build_problem, fit_with
from bayesid.diagnosis.events_counted import verdict_of
from bayesid.diagnosis.exclusions import compare_without
from bayesid.diagnosis.form_stage import Compared
from bayesid.diagnosis.hypotheses.candidate import weighted_hypothesis
from bayesid.diagnosis.input import check_trial, mended
from bayesid.diagnosis.simulator import find_mistakes
from bayesid.diagnosis.simulator.judge import LEAD
from bayesid.equations.model import Model, build_model
from bayesid.errors import BayesidError
from bayesid.lock import lock_or_exit
from bayesid.model.vehicles import load_vehicle, with_relative_prior
from bayesid.report import writer
from bayesid.report.writer import Report, Section, Table, Text
from bayesid.trials import Trial
from bayesid.trials.mistakes import SIMULATOR
from studies.log_mistakes.campaigns import PRIOR_SD, VEHICLES, campaign
from studies.simulator_mistakes.plant import Planted, planted
from studies.simulator_mistakes.public import SIGN_LOST, SIMULATORS

SEEDS = (0, 21, 42)
STEP = 0.2  # L/U between readings and orders
SET = 3  # names at most that count as a set
BAR = 0.9
BESIDE = "beside.jsonl"
NOTHING = Planted("nothing", lambda v: v, ())
# in what made the log: no vehicle file can hold it, so that none of the mistakes is its name
LOST = Planted("sign of v v lost in the log", lambda v: v, (), ("hull_asymmetry",))


@dataclass(frozen=True)
class Outcome:
    """One log judged.

    Attributes
    ----------
    word : "named", "in the set", "as an effect", "as a mistake of the log", "missed", "wrong name", "silent",
        "false alarm", "not to be seen" where both agree within the stated uncertainty, "diverges"
        where a simulator with the mistake writes no log, "in no file" where the mistake is in what made the
        log and gets no name, "too faint" where even the right simulator leads every other explanation by
        less than a name asks for
    names : mistakes of the simulator that are named
    verdict, effects : the ordinary verdict, and mistakes of the log
    seconds, extra : of the processor (of the clock in rows judged before), all and the search of mistakes
    """

    vehicle: str
    seed: int
    row: str
    word: str
    names: tuple[str, ...]
    verdict: str
    effects: tuple[str, ...]
    seconds: float
    extra: float


def judge(
    trial: Trial, model: Model, row: Planted, right: Model
) -> tuple[str, tuple[str, ...], str, tuple[str, ...], float]:
    """What is said of one log: word, mistakes named, verdict, its names, seconds of the search.

    Parameters
    ----------
    right : the simulator without the mistake
    """
    check = check_trial(trial, model)
    inputs = tuple(f.name for f in check.findings)
    alike = {name for f in check.of_log.findings for name in (f.name, *f.also)}
    if alike & {f"{SIMULATOR}{name}" for name in row.right}:
        return "in the set", (), "input", tuple(sorted(alike)), 0.0
    if alike & set(row.inputs):
        return "as a mistake of the log", (), "input", inputs, 0.0
    if check.of_log.findings:
        return "wrong name" if row is not NOTHING else "false alarm", (), "input", inputs, 0.0
    trial = mended(trial, check.of_log)
    compared = compare_without(model, trial)
    verdict = verdict_of(compared)
    begin = time.process_time()
    found = find_mistakes(trial, compared, verdict)
    names = tuple(f.name for f in found)
    either = bool(found) and found[0].or_coefficients
    took = time.process_time() - begin
    effects = (*inputs, *verdict.effects)
    if inputs and not names:  # what the simulator would explain is then told of the log
        word = "as a mistake of the log" if set(inputs) & set(row.inputs) else "wrong name"
        return word if row is not NOTHING else "false alarm", (), "input", inputs, took
    if row is NOTHING:
        return ("false alarm" if names else "silent"), names, verdict.word, effects, took
    if names and names[0] in row.right and not either:
        word = "named"
    elif set(names[: SET - either]) & set(row.right):
        word = "in the set"
    elif names:
        word = "wrong name"
    elif verdict.word in ("effect", "effect_with_remainder", "several") and set(effects) & set(row.effects):
        word = "as an effect"
    else:
        word = "not to be seen" if verdict.word == "none" else "missed"
    if word == "missed" and row is not LOST and lead_of(right, trial, compared) < LEAD:
        word = "too faint"
    if row is LOST and word == "missed":
        word = "in no file"
    return word, names, verdict.word, effects, took


def lead_of(right: Model, trial: Trial, compared: Compared) -> float:
    """Log evidence [nats] of the right simulator over the best explanation of the mistaken one's gap."""
    problem = build_problem(right, trial)
    best = max(c.log_evidence for c in (compared.candidates.none, *compared.candidates.refits))
    return weighted_hypothesis(problem, (), fit_with(problem, ())).log_evidence - best


def in_turn(vehicle: str, seed: int, row: int) -> bool:
    """Whether a row falls to this campaign: one seed for each row of a vehicle, the next one for the next row
    and for the next vehicle."""
    return SEEDS[(row + list(VEHICLES).index(vehicle)) % len(SEEDS)] == seed


def study(out: Path, vehicles: tuple[str, ...], seeds: tuple[int, ...], every: bool = True) -> list[Outcome]:
    """Every mistake in every campaign; the report is written anew after every log.

    Parameters
    ----------
    every : otherwise each mistake of a vehicle at one of the seeds (`in_turn`), a right simulator at each
    """
    found = kept(out)
    done = {(o.vehicle, o.seed, o.row) for o in found}
    for k in seeds:
        for name in vehicles:
            trial = campaign(name, k, step=STEP)
            right = with_relative_prior(load_vehicle(name), PRIOR_SD)
            for i, row in enumerate((NOTHING, LOST, *planted())):
                if (name, k, row.name) in done or not (every or row is NOTHING or in_turn(name, k, i)):
                    continue
                wrong = row.change(right)
                same = VEHICLES[name] == 3 and wrong is not None and wrong.coef == right.coef
                if wrong is None or (row.spatial and VEHICLES[name] == 3):
                    continue
                if row not in (NOTHING, LOST) and (same or wrong == right):
                    continue
                begin = time.process_time()
                try:
                    model = build_model(with_relative_prior(wrong, PRIOR_SD), VEHICLES[name])
                    log = campaign(name, k, step=STEP, acts=SIGN_LOST) if row is LOST else trial
                    said = judge(log, model, row, build_model(right, VEHICLES[name]))
                except BayesidError as error:
                    said = ("diverges" if row is LOST else "missed", (), f"refused: {error}"[:120], (), 0.0)
                took = time.process_time() - begin
                found.append(Outcome(name, k, row.name, *said[:4], took, said[4]))
                print(f"{name} {k} {row.name}: {said} {took:.0f} s", flush=True)
                writer.write(report(found, both(out / BESIDE)), out, {"outcomes": [vars(o) for o in found]})
    return found


def both(file: Path) -> list[dict[str, Any]]:
    """Rows of `studies.simulator_mistakes.beside`, where they were judged."""
    return [json.loads(line) for line in file.read_text().splitlines()] if file.exists() else []


def report(found: list[Outcome], together: list[dict[str, Any]]) -> Report:
    """The table of mistakes, what was missed, and mistakes beside an effect."""
    planted_in = [o for o in found if o.row != NOTHING.name]
    real = [o for o in planted_in if o.word not in ("not to be seen", "diverges", "in no file")]
    unseen = sum(o.word == "not to be seen" for o in planted_in)
    faint = sum(o.word == "too faint" for o in planted_in)
    said = ", ".join(
        f"{o.vehicle} {o.verdict if o.word == 'in no file' else o.word}" for o in found if o.row == LOST.name
    )
    clean = [o for o in found if o.row == NOTHING.name]
    good = [o for o in real if o.word not in ("missed", "wrong name", "too faint")]
    share = len(good) / max(1, len(real))
    words = Counter(o.word for o in real)
    alarms = sum(o.word == "false alarm" for o in clean)
    told = ", ".join(f"{words[w]} {w}" for w in words if w not in ("missed", "wrong name", "too faint"))
    lead = (
        f"Of {len(real)} logs whose simulator has a mistake {len(good)} are told, {share:.0%} ({told}): the "
        f"bar of {BAR:.0%} is {'met' if share >= BAR else 'missed'}. {words['wrong name']} get a wrong name, "
        f"{words['missed'] + faint} none, {faint} of them because even the right simulator leads the best "
        f"other explanation by less than the {LEAD:g} nats a name asks for; {unseen} more, not counted, are "
        "too small to be seen, simulator and log agree. Mistakes "
        f"in what made the log, which no vehicle file can hold, have no name: {said or 'none planted'}. Of "
        f"{len(clean)} logs of a right simulator {alarms} are called mistaken. "
        f"The logs are of {', '.join(dict.fromkeys(o.vehicle for o in found))}{_design(found)}."
    )
    vehicles = list(dict.fromkeys(o.vehicle for o in found))
    rows: list[list[Any]] = []
    for name in dict.fromkeys(o.row for o in found):
        cells: list[Any] = [name]
        for vehicle in vehicles:
            of = [o for o in found if o.row == name and o.vehicle == vehicle]
            cells.append(
                ", ".join(f"{w} ({n})" if n > 1 else w for w, n in Counter(o.word for o in of).items())
            )
        cells.append("; ".join(dict.fromkeys(
            f"{o.verdict} {', '.join(o.effects[:3])}".strip() for o in found if o.row == name
        )))  # fmt: skip
        rows.append(cells)
    missed = [o for o in found if o.word in ("missed", "too faint", "wrong name", "false alarm")]
    table = [
        [o.vehicle, o.seed, o.row, o.word, ", ".join(o.names), o.verdict, ", ".join(o.effects)]
        for o in missed
    ]
    whole = sum(o.seconds for o in found)
    extra = sum(o.extra for o in found)
    return Report(
        "Mistakes planted into vehicle files",
        lead,
        [
            Section("By mistake", [Table(["mistake", *vehicles, "ordinary verdicts"], rows)]),
            Section(
                "Missed",
                [
                    Table(["vehicle", "seed", "mistake", "", "named", "verdict", "its names"], table)
                    if table
                    else Text("None.")
                ],
            ),
            *([_beside(together)] if together else []),
            Section(
                "Public simulators", [Table(["simulator", "what it does", "source", "said"], _public(found))]
            ),
            Section("Time", [Text(f"The search for mistakes takes {extra:.0f} of {whole:.0f} s.")]),
        ],
    )


def _beside(rows: list[dict[str, Any]]) -> Section:
    """Mistakes beside an effect, and the same logs with the right simulator."""
    told = sum(row["told"] for row in rows)
    named = sum(row["effect_named"] for row in rows)
    wrong = sum(bool(row["wrong_names"]) for row in rows)
    right = [row["right_simulator"] for row in rows]
    alarms = sum(bool(one["mistakes"]) for one in right)
    others = sum(bool(one["wrong_names"]) for one in right)
    text = (
        f"Of {len(rows)} logs with an effect of the catalogue, judged with a mistaken simulator, the mistake "
        f"is told in {told} and the effect named in {named}; {wrong} get a wrong name. With the right "
        f"simulator {alarms} of the same logs are told a mistake of the simulator, {others} a wrong name. "
        "The rule was made after these logs had been judged without it (no mistake told then): no fresh "
        "count."
    )
    table = [
        [
            row["vehicle"], row["effect"], row["mistake"], row["verdict"], ", ".join(row["effects"]),
            ", ".join(row["mistakes"]), ", ".join(row["beside"]),
        ]
        for row in rows
    ]  # fmt: skip
    heads = ["vehicle", "acts", "mistaken", "verdict", "its effects", "mistake told", "effect beside it"]
    return Section("Beside an effect", [Text(text), Table(heads, table)])


def _design(found: list[Outcome]) -> str:
    """How many of its seeds a mistake has, where it has not all; decided before any log was judged."""
    six = [name for name in dict.fromkeys(o.vehicle for o in found) if VEHICLES[name] == 6]
    said = f" ({', '.join(six)} in 6-DOF)" if six else ""
    seeds = {o.seed for o in found}
    per = Counter((o.vehicle, o.row) for o in found if o.row != NOTHING.name)
    if not per or min(per.values()) == len(seeds):
        return said
    few, most = min(per.values()), max(per.values())
    each = f"{few}" if few == most else f"{few} to {most}"
    return f"{said}; each mistake of a vehicle at {each} of {len(seeds)} seeds, in turn"


def _public(found: list[Outcome]) -> list[list[Any]]:
    """What is said of a log with the right term, or made with the wrong one where no file can hold it."""
    rows = []
    for simulator, what, source, row in SIMULATORS:
        said = [
            f"{o.vehicle}: {o.word}"
            + (f" ({', '.join(o.names)})" if o.names else f" ({' '.join((o.verdict, *o.effects[:3]))})")
            for o in found
            if o.row == row
        ]
        rows.append([simulator, what, source, "; ".join(dict.fromkeys(said))])
    return rows


def kept(folder: Path) -> list[Outcome]:
    """Outcomes of an earlier call."""
    file = folder / "results.json"
    if not file.exists():
        return []
    rows = json.loads(file.read_text())["outcomes"]
    return [Outcome(**{**r, "names": tuple(r["names"]), "effects": tuple(r["effects"])}) for r in rows]


def main(
    out: Path,
    quick: bool = False,
    seeds: tuple[int, ...] = SEEDS,
    vehicles: tuple[str, ...] = tuple(VEHICLES),
    every: bool = False,
) -> None:
    """Run the study and write its report."""
    study(out, ("remus100",) if quick else vehicles, seeds[:1] if quick else seeds, quick or every)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="bayesid study simulator_mistakes", description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("out/simulator_mistakes"))
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--every", action="store_true")
    parser.add_argument("--render", type=Path, metavar="FOLDER")
    parser.add_argument("--vehicles", default=",".join(VEHICLES))
    parser.add_argument("--seeds", default=",".join(map(str, SEEDS)))
    given = parser.parse_args()
    lock_or_exit(given.out, "study simulator_mistakes")
    if given.render is not None:
        outcomes = kept(given.render)
        made = report(outcomes, both(given.render / BESIDE))
        writer.write(made, given.out, {"outcomes": [vars(o) for o in outcomes]})
    else:
        seeds = tuple(int(s) for s in given.seeds.split(","))
        main(given.out, given.quick, seeds, tuple(given.vehicles.split(",")), given.every)
