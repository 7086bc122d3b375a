"""Are mistakes of a log told from a gap: which planted ones are named, and what is named wrongly?

Usage: bayesid study log_mistakes [--out FOLDER] [--quick] [--seed N] [--vehicles A,B] [--seeds 0,1]
[--half]. Results are kept after every campaign, and a second call goes on. Clean campaigns of
built-in vehicles get one mistake at a time, at 10 Hz and at 1 Hz, with all channels and with pose alone.
Mistakes are judged as `bayesid diagnose` does before it looks for a gap; no gap is diagnosed here, as a mend
that gives the clean log back gives its verdict back. --render FOLDER writes the report anew from the
results.json kept there, without judging a log again.
"""

from __future__ import annotations

import argparse
import json
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import binomtest

from bayesid.diagnosis.events_counted import verdict_of
from bayesid.diagnosis.exclusions import compare_without
from bayesid.diagnosis.input import check_trial, mended
from bayesid.diagnosis.simulator import find_mistakes
from bayesid.equations.model import Model, build_model
from bayesid.lock import lock_or_exit
from bayesid.model.vehicles import load_vehicle, with_relative_prior
from bayesid.report import writer
from bayesid.report.writer import Report, Section, Table, Text
from bayesid.trials import Trial
from bayesid.trials.health import check_run, check_runs
from bayesid.trials.mistakes import SIMULATOR, InputCheck
from bayesid.trials.noise_stated import seen_noise, stated_wrongly
from studies.log_mistakes.campaigns import FULL, POSE, PRIOR_SD, VEHICLES, campaign, with_channels
from studies.log_mistakes.harmless import harmless, unlisted_effects
from studies.log_mistakes.plant import Planted, controls, logged, planted
from studies.log_mistakes.seen import can_be_seen, differ

CLEAN = 20  # fresh clean campaigns per vehicle
SEEDS, QUICK_SEEDS = (0, 1, 2), (0,)
RATES = (10.0, 1.0)
SETS = {"all channels": FULL, "pose alone": POSE}
RESTORED = 1e-6  # of a channel's size: the mended log is the clean one
BAR = 0.95  # share of planted mistakes that must be named right or stand in the set
RULE = (
    "Decided by the plan of the runs, the stated noise and the vehicle file, before a log is read, for the "
    "mistakes whose log has another account; every other mistake counts as seen. A clock that is fast is "
    "seen where one factor on the time is expected to have 19 times the odds of a scale of every instrument "
    "(Cramer-Rao bounds of the scales, priors as in the check). An order logged as measured is seen where it "
    "jumps from reading to reading faster than 60 degrees per second, or by more than the fin moves at the "
    "rate its file states, known to 40 %, at the odds of the mistake: six times that rate. Else the measured "
    "angle would be the same column, and the diagnosis is the same too. Heading or yaw rate late by a sample "
    "is seen where a sample is a third of L/U or more: below it is what a sensor honestly does. Noise stated "
    "wrongly is seen where readings follow each other within 0.35 L/U. The file of another vehicle is seen "
    "where it differs by the factors that are declared: 2 in speed, 3.3 in turn, or 1.35 and 2.2 together. "
    "What nobody can see and no effect of the catalogue is, stands among the logs without a mistake, of "
    "which nothing must be told: a measured angle as order, a heading wrapped, rows left "
    "out, rounded stamps spread."
)
FRESH = "nothing, fresh"  # campaigns of other seeds, for false alarms alone


@dataclass(frozen=True)
class Outcome:
    """One log judged.

    Attributes
    ----------
    word : "named", "in the set" (of mistakes of the log, or with one of the simulator), "missed",
        "wrong name", "silent" or "false alarm"
    restored : whether the mended log is the clean one
    seen : whether the plan of the runs, the stated noise and the vehicle let it be seen (`seen`)
    """

    vehicle: str
    seed: int
    rate: float
    channels: str
    row: str
    word: str
    names: tuple[str, ...]
    restored: bool | None
    seconds: float
    seen: bool = True


def judge(clean: Trial, row: Planted, model: Model, seed: int) -> tuple[str, tuple[str, ...], bool | None]:
    """What is said of one planted mistake."""
    wrong = logged(clean, row, seed)
    if row.noise != 1.0:  # no finding reads the stated noise: those of the clean log stand
        said = stated_wrongly(seen_noise(wrong.identify, wrong.noise, (model.scales["L"], model.scales["U"])))
        return ("missed" if said is None else "named"), (), None
    if row.of:
        model = model_of(row.of, model.dof)
    check = check_trial(wrong, model)
    blamed = _simulator_blamed(wrong, model, check)
    check = check.of_log if blamed else check.insisted
    names = (*(f.name for f in check.findings), *blamed)
    if row.kind == "effect":
        return ("false alarm" if names else "silent"), names, None
    if row.kind == "note" and not names:
        runs = wrong.identify
        remarks = (*check.remarks, *(text for run in runs for text in check_run(run)), *check_runs(runs))
        return ("named" if any(row.says in text for text in remarks) else "missed"), names, None
    if not names:
        return "missed", names, None
    if not check.findings:
        return "wrong name", names, None
    restored = _restored(clean, mended(wrong, check), check)
    if names[0] in row.right:
        shared = any(name.startswith(SIMULATOR) for name in check.findings[0].also)
        return "in the set" if shared else "named", names, restored
    return ("in the set" if set(row.right) & set(check.findings[0].also) else "wrong name"), names, restored


def model_of(vehicle: str, dof: int) -> Model:
    """Model of a built-in vehicle as stated, known to 5 %."""
    return build_model(with_relative_prior(load_vehicle(vehicle), PRIOR_SD), dof)


def _simulator_blamed(logged: Trial, model: Model, check: InputCheck) -> tuple[str, ...]:
    """Mistakes of the simulator that a diagnosis names in the place of what is told of the log."""
    if not any(f.instead for f in check.findings) or any(f.correction is None for f in check.of_log.findings):
        return ()
    trial = mended(logged, check.of_log)
    compared = compare_without(model, trial)
    verdict = verdict_of(compared)
    return tuple(SIMULATOR + f.name for f in find_mistakes(trial, compared, verdict))


def _restored(clean: Trial, now: Trial, check: InputCheck) -> bool | None:
    """Whether every channel is the clean one; None where a column was dropped, or a size estimated."""
    if any(f.correction is None or f.correction.drop or f.correction.rename for f in check.findings):
        return None
    for a, b in zip(clean.identify, now.identify, strict=True):
        pairs = [(a.t, b.t)] + [(a.data[k], b.data[k]) for k in a.data if k in b.data]
        pairs += [(a.commands[k], b.commands[k]) for k in a.commands if k in b.commands]
        for was, got in pairs:
            size = float(np.nanmax(np.abs(was))) or 1.0
            off = got - was
            turns = 2 * np.pi * np.round(np.nanmedian(off) / (2 * np.pi))
            if not np.nanmax(np.abs(off - turns)) < RESTORED * size:
                return False
    return True


def study(
    out: Path,
    quick: bool,
    seed: int,
    vehicles: Sequence[str] = tuple(VEHICLES),
    seeds: Sequence[int] = SEEDS,
    half: bool = False,
) -> list[Outcome]:
    """Every mistake in every campaign; results are kept after each of them, and a second call goes on.

    Parameters
    ----------
    half : of rates and channels two pairs per campaign instead of four, in turn, so that every vehicle has
        all
    """
    if quick:
        vehicles, seeds = ("remus100",), QUICK_SEEDS
    found = kept(out) if not quick and (out / "results.json").exists() else []
    done = {(o.vehicle, o.seed, o.rate, o.channels, o.row) for o in found}
    for place, name in enumerate(vehicles):
        model = model_of(name, VEHICLES[name])
        rows = rows_of(name, model)
        for k in seeds:
            for i, rate in enumerate((10.0,) if quick else RATES):
                whole = campaign(name, seed + k, rate)
                for j, (words, channels) in enumerate(SETS.items()):
                    if half and (i + j + k + place) % 2:
                        continue
                    trial = with_channels(whole, channels)
                    for row in rows:
                        known = (name, seed + k, rate, words, row.name) in done
                        if known or not _possible(row, trial, model):
                            continue
                        begin = time.perf_counter()
                        word, names, restored = judge(trial, row, model, seed + k)
                        took = time.perf_counter() - begin
                        clear = row.kind == "effect" or _seen(row, trial, model)
                        found.append(
                            Outcome(name, seed + k, rate, words, row.name, word, names, restored, took, clear)
                        )
                    print(f"{name}, seed {seed + k}, {rate:g} Hz, {words}: {_counts(found)}", flush=True)
                    _keep(found, out)
        for k in range(CLEAN if not quick else 0):
            if (name, k, RATES[k % 2], "all channels", FRESH) in done:
                continue
            clean = campaign(name, 1000 + seed + k, RATES[k % 2])
            names = tuple(f.name for f in check_trial(clean, model).findings)
            word = "false alarm" if names else "silent"
            found.append(Outcome(name, k, RATES[k % 2], "all channels", FRESH, word, names, None, 0.0))
        _keep(found, out)
    return found


def _seen(row: Planted, trial: Trial, model: Model) -> bool:
    return differ(model, model_of(row.of, model.dof)) if row.of else can_be_seen(row.name, trial, model)


def rows_of(name: str, model: Model) -> tuple[Planted, ...]:
    """Everything that is planted into a log of a vehicle."""
    travel, rate = model.scales["L"] / model.scales["U"], model.vehicle.rates["delta_r"]
    return (
        *controls(travel, rate), *harmless(rate), *planted(travel), *unlisted_effects(name)
    )  # fmt: skip


def _keep(found: list[Outcome], out: Path) -> None:
    writer.write(report(found), out, {"outcomes": [vars(o) for o in found]})


def _possible(row: Planted, trial: Trial, model: Model) -> bool:
    have = set(trial.identify[0].data)
    plane = "delta_s" in row.name and "delta_s_cmd" not in trial.identify[0].commands
    return set(row.needs) - {"delta_r", "delta_s", "n"} <= have and not plane


def _counts(found: list[Outcome]) -> dict[str, int]:
    return dict(Counter(o.word for o in found))


def report(found: list[Outcome]) -> Report:
    """The table of mistakes, and what was missed."""
    every = [o for o in found if o.word not in ("silent", "false alarm")]
    real = [o for o in every if o.seen]
    unseen = [o for o in every if not o.seen]
    good = [o for o in real if o.word in ("named", "in the set")]
    first = [o for o in real if o.word == "named"]
    quiet = [o for o in found if o.word in ("silent", "false alarm")]
    alarms = [o for o in quiet if o.word == "false alarm"]
    back = [o for o in good if o.restored is not None]
    share = len(good) / max(1, len(real))
    wrong = sum(o.word == "wrong name" for o in real)
    told = sum(o.word in ("named", "in the set") for o in unseen)
    strange = sum(o.word == "wrong name" for o in unseen)
    whole = sum(bool(o.restored) for o in back)
    clean = [o for o in quiet if o.row in ("nothing", FRESH)]
    there = list(dict.fromkeys(o.vehicle for o in found))
    absent = [name for name in VEHICLES if name not in there]
    lead = (
        f"Of {len(real)} logs with a planted mistake that can be seen {len(good)} are named right or in a "
        f"set, {share:.1%} ({len(first)} named, {len(good) - len(first)} in a set): the bar of {BAR:.0%} is "
        f"{'met' if share >= BAR else 'missed'} ({_interval(len(good), len(real))}). The logs are of "
        f"{', '.join(there)}"
        f"{', none of ' + ', '.join(absent) if absent else ''}{_design(found)}. "
        f"{len(real) - len(good) - wrong} are missed, {wrong} get another name. {len(unseen)} more "
        f"cannot be seen, by a rule that reads no log: of these {told} are named right, {strange} get "
        f"another name. Of {len(quiet)} logs without a mistake, or with an effect of the catalogue alone, "
        f"{len(alarms)} are called mistaken ({_interval(len(alarms), len(quiet))}), of the "
        f"{len(clean)} clean ones {sum(o.word == 'false alarm' for o in clean)}. "
        f"In {whole} of {len(back)} the mended log is the clean one reading for "
        "reading, so that its gap is the clean one's; in the others the mend has a size that is estimated."
    )
    rows = []
    for name in dict.fromkeys(o.row for o in found):
        of = [o for o in found if o.row == name]
        cells: list[Any] = [name]
        for rate in RATES:
            for words in SETS:
                some = [o for o in of if o.seen and o.rate == rate and o.channels == words]
                ok = sum(o.word in ("named", "in the set", "silent") for o in some)
                cells.append(f"{ok} of {len(some)}" if some else "")
        others = Counter(
            o.names[0] for o in of
            if o.word in ("wrong name", "false alarm", "in the set") and o.names[0] != o.row
        )  # fmt: skip
        hidden = [o for o in of if not o.seen]
        ok = sum(o.word in ("named", "in the set") for o in hidden)
        cells.append(f"{ok} of {len(hidden)}" if hidden else "")
        cells.append(", ".join(f"{k} ({n})" for k, n in others.most_common(3)))
        rows.append(cells)
    heads = [
        "mistake",
        *(f"{rate:g} Hz, {words}" for rate in RATES for words in SETS),
        "cannot be seen",
        "named instead",
    ]
    missed = [o for o in real if o.word in ("missed", "wrong name")]
    return Report(
        "Mistakes planted into clean logs",
        lead,
        [
            Section(
                "Right, by mistake",
                [
                    Text(
                        "Vehicles and seeds together; effects must stay silent. Empty "
                        "where the channel is not logged, or the mistake does not touch what is: with pose "
                        "alone a fast clock is told by nothing but speed at the revolutions, known to 20 %."
                    ),
                    Table(heads, rows),
                ],
            ),
            Section("What can be seen", [Text(RULE)]),
            Section(
                "Missed",
                [
                    Table(
                        ["vehicle", "seed", "Hz", "channels", "mistake", "said"],
                        [[o.vehicle, o.seed, o.rate, o.channels, o.row, ", ".join(o.names)] for o in missed],
                    )
                    if missed
                    else Text("None.")
                ],
            ),
            Section(
                "Time", [Text(f"A check takes {np.median([o.seconds for o in found]):.2g} s in the middle.")]
            ),
        ],
    )


def _design(found: list[Outcome]) -> str:
    """How many of the pairs of rate and channels the campaigns of a vehicle have, where it is not all."""
    pairs = {(o.vehicle, o.seed, o.rate, o.channels) for o in found if o.row == "nothing"}
    few = []
    for vehicle in dict.fromkeys(o.vehicle for o in found):
        own = {pair[1:] for pair in pairs if pair[0] == vehicle}
        every = len({pair[0] for pair in own}) * len(RATES) * len(SETS)
        if len(own) < every:
            few.append(f"of {vehicle} {len(own)} of {every} triples of seed, rate and channels")
    return f"; {', '.join(few)}" if few else ""


def _interval(count: int, total: int) -> str:
    """95 % interval of a share (Wilson)."""
    if not total:
        return "none"
    low, high = binomtest(count, total).proportion_ci(method="wilson")
    return f"95 %: {low:.1%} to {high:.1%}"


def kept(folder: Path) -> list[Outcome]:
    """Outcomes of an earlier study."""
    rows = json.loads((folder / "results.json").read_text())["outcomes"]
    return [Outcome(**{**row, "names": tuple(row["names"])}) for row in rows]


def main(
    out: Path,
    quick: bool = False,
    seed: int = 0,
    vehicles: Sequence[str] = tuple(VEHICLES),
    seeds: Sequence[int] = SEEDS,
    half: bool = False,
) -> None:
    """Run the study and write its report."""
    study(out, quick, seed, vehicles, seeds, half)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="bayesid study log_mistakes", description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("out/log_mistakes"))
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--vehicles", type=lambda text: text.split(","), default=tuple(VEHICLES))
    parser.add_argument("--seeds", type=lambda text: [int(k) for k in text.split(",")], default=SEEDS)
    parser.add_argument("--half", action="store_true")
    parser.add_argument("--render", type=Path, metavar="FOLDER")
    given = parser.parse_args()
    lock_or_exit(given.out, "study log_mistakes")
    if given.render is None:
        main(given.out, given.quick, given.seed, given.vehicles, given.seeds, given.half)
    else:
        outcomes = kept(given.render)
        writer.write(report(outcomes), given.out, {"outcomes": [vars(o) for o in outcomes]})
