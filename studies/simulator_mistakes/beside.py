"""A mistake of the simulator beside an effect: is the mistake told, and is the effect named or nothing wrong?

Usage: python -m studies.simulator_mistakes.beside [--out FILE]. Logs are made with the right numbers and one
effect of the catalogue at its usual size; the vehicle file gets a mistake. They are judged as `bayesid
diagnose` does, held-out runs left out, and once more with the right vehicle file. One line per log is written
as it is judged; a second call goes on.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from typing import Any

from bayesid.diagnosis.events_counted import verdict_of
from bayesid.diagnosis.exclusions import compare_without
from bayesid.diagnosis.hypotheses.verdict import NAMING
from bayesid.diagnosis.input import WRONG_VEHICLE, check_trial, mended
from bayesid.diagnosis.simulator import find_mistakes
from bayesid.equations.model import Model, build_model
from bayesid.model.effects import CATALOGUE
from bayesid.model.vehicles import load_vehicle, with_relative_prior
from bayesid.trials import Trial
from studies.log_mistakes.campaigns import PRIOR_SD, VEHICLES, campaign
from studies.simulator_mistakes.plant import Planted, planted

STEP, SEED = 0.2, 60
NOTHING = Planted("nothing", lambda vehicle: vehicle, ())
# chosen before any was judged: what acts in the log, what the simulator has wrong, the vehicle
CASES = (
    ("ocean_current", "sign of the fins", "remus100"),
    ("rudder_offset", "sign of the fins", "generic_sub"),
    ("ocean_current", "Munk moment missing", "remus100"),
    ("thrust_loss", "Munk moment twice", "generic_sub"),
    ("actuator_lag", "added mass twice", "remus100"),
    ("rudder_offset", "added-mass Coriolis missing", "remus100"),
    ("gyro_scale", "another length (0.9)", "remus100"),
    ("ocean_current", "all coefficients halved", "generic_sub"),
    ("rudder_offset", "no cross terms", "remus100"),
    ("thrust_loss", "added-mass Coriolis of the wrong sign", "generic_sub"),
)


def judge(trial: Trial, model: Model, row: Planted, effect: str) -> dict[str, Any]:
    """What is said of one log.

    Effects count as named by the verdict or, with the mistake mended, beside it.
    """
    check = check_trial(trial, model)
    inputs = [f.name for f in check.of_log.findings]
    alike = {name for f in check.of_log.findings for name in (f.name, *f.also)}
    said: dict[str, Any] = {"input": inputs, "verdict": "input", "effects": [], "mistakes": [], "beside": []}
    right = mended(trial, check.of_log)
    if WRONG_VEHICLE not in inputs:
        compared = compare_without(model, right)
        verdict = verdict_of(compared)
        found = find_mistakes(right, compared, verdict)
        said["verdict"] = verdict.word
        said["effects"] = list(verdict.effects) if verdict.word in NAMING else []
        said["mistakes"] = [f.name for f in found]
        said["beside"] = list(found[0].beside) if found else []
        if verdict.word == "ambiguous":
            said["set"] = list(verdict.effects)
    of_log = bool(alike & set(row.inputs))
    told = of_log or bool(set(said["mistakes"][:1]) & set(row.right))
    named = {*said["effects"], *said["beside"]}
    wrong = sorted(named - {effect, *row.effects})
    wrong += [n for n in said["mistakes"][:1] if n not in row.right]
    wrong += [n for n in inputs if n != WRONG_VEHICLE and not of_log]
    if not said["mistakes"]:
        wrong += [f.name for f in check.findings if f.instead]
    return {**said, "told": told, "effect_named": effect in named, "wrong_names": wrong}


def study(out: Path) -> list[dict[str, Any]]:
    """Judge every case that `out` does not hold yet."""
    found = kept(out)
    known = {(row["vehicle"], row["effect"], row["mistake"]) for row in found}
    rows = {row.name: row for row in planted()}
    effects = {effect.name: effect for effect in CATALOGUE}
    for k, (effect, mistake, vehicle) in enumerate(CASES):
        if (vehicle, effect, mistake) in known:
            continue
        begin = time.process_time()
        trial = campaign(vehicle, SEED + k, step=STEP, acts=effects[effect])
        right = with_relative_prior(load_vehicle(vehicle), PRIOR_SD)
        wrong = rows[mistake].change(right)
        assert wrong is not None
        model = build_model(with_relative_prior(wrong, PRIOR_SD), VEHICLES[vehicle])
        said: dict[str, Any] = {"vehicle": vehicle, "seed": SEED + k, "effect": effect, "mistake": mistake}
        said |= judge(trial, model, rows[mistake], effect)
        bare = judge(trial, build_model(right, VEHICLES[vehicle]), NOTHING, effect)
        said["right_simulator"] = {k: bare[k] for k in ("verdict", "effects", "mistakes", "wrong_names")}
        said["seconds"] = round(time.process_time() - begin, 1)
        found.append(said)
        with out.open("a", encoding="utf-8") as file:
            file.write(json.dumps(said) + "\n")
        print(said, flush=True)
    return found


def kept(out: Path) -> list[dict[str, Any]]:
    """Rows of an earlier call."""
    return [json.loads(line) for line in out.read_text().splitlines()] if out.exists() else []


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("out/simulator_mistakes/beside.jsonl"))
    given = parser.parse_args()
    given.out.parent.mkdir(parents=True, exist_ok=True)
    study(given.out)
