"""A mistake of the log beside an effect: are both found, the effect once the mend is applied in memory?

Usage: python -m studies.log_mistakes.beside [--out FILE]. Logs of a vehicle with one effect of the catalogue
at its usual size get one mistake. They are judged as `bayesid diagnose` does, held-out runs left out, and so
are they without the mistake. One line per log is written as it is judged; a second call goes on.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

from bayesid.diagnosis.events_counted import verdict_of
from bayesid.diagnosis.exclusions import compare_without
from bayesid.diagnosis.input import check_trial, mended
from bayesid.equations.model import Model, build_model
from bayesid.model.effects import CATALOGUE
from bayesid.model.vehicles import load_vehicle, with_relative_prior
from bayesid.trials import Trial
from bayesid.trials.noise_stated import with_seen_noise
from studies.log_mistakes.campaigns import PRIOR_SD, VEHICLES, campaign
from studies.log_mistakes.plant import logged, planted

VEHICLE, SEED, STEP = "remus100", 40, 0.2
CASES = (
    ("ocean_current", "sign of delta_r"),
    ("rudder_offset", "x, y: feet read as metres"),
    ("thrust_loss", "sign of psi"),
    ("actuator_lag", "heading from east"),
    ("ocean_current", "u, v, w: knots read as m/s"),
    ("gyro_scale", "sign of r"),
    ("rudder_effectiveness", "east-north-up"),
    ("rudder_offset", "sign of delta_r"),
)


def judged(trial: Trial, model: Model) -> tuple[str, list[str]]:
    """Verdict on the gap, and the effects it names."""
    compared = compare_without(model, with_seen_noise(trial, (model.scales["L"], model.scales["U"])))
    verdict = verdict_of(compared)
    return verdict.word, list(verdict.effects) or list(verdict.set95)


def study(out: Path) -> None:
    """Judge every case that `out` does not hold yet."""
    done = [json.loads(line) for line in out.read_text().splitlines()] if out.exists() else []
    known = {(row["effect"], row["mistake"]) for row in done}
    model = build_model(with_relative_prior(load_vehicle(VEHICLE), PRIOR_SD), VEHICLES[VEHICLE])
    mistakes = {row.name: row for row in planted(model.scales["L"] / model.scales["U"])}
    effects = {effect.name: effect for effect in CATALOGUE}
    for k, (effect, mistake) in enumerate(CASES):
        if (effect, mistake) in known:
            continue
        clean = campaign(VEHICLE, SEED + k, step=STEP, acts=effects[effect])
        wrong = logged(clean, mistakes[mistake], SEED + k)
        check = check_trial(wrong, model)
        word, names = judged(mended(wrong, check), model)
        bare, those = judged(clean, model)
        said: dict[str, Any] = {
            "effect": effect, "mistake": mistake, "input": [f.name for f in check.findings],
            "mistake_right": [f.name for f in check.findings][:1] == [mistake],
            "verdict": word, "effects": names, "verdict_without_mistake": bare,
            "effects_without_mistake": those,
        }  # fmt: skip
        with out.open("a", encoding="utf-8") as file:
            file.write(json.dumps(said) + "\n")
        print(f"{effect}, {mistake}: {said['input']}, {word} {names}; without {bare} {those}", flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("out/log_mistakes_beside.jsonl"))
    given = parser.parse_args()
    given.out.parent.mkdir(parents=True, exist_ok=True)
    study(given.out)
