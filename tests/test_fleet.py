"""Many bundles: what they share is told from what changed, and a folder of bundles is not a bundle."""

import json
import math
from dataclasses import replace

import pytest
from scipy.stats import chi2

from bayesid.api import fleet
from bayesid.api.fleet import bundles_of, diagnose_fleet
from bayesid.cli.main import run
from bayesid.diagnosis.fleet import shared_effects, shared_parameters, verdict_words
from bayesid.errors import TrialError
from bayesid.model.vehicles import load_vehicle
from bayesid.model.vehicles.writing import vehicle_toml
from bayesid.report.fleet import fleet_lead


def record(vehicle, value=None, sd=0.1, acting=0.9):
    effects = []
    if value is not None:
        effects = [{"name": "rudder_offset", "probability": acting,
                    "parameters": {"delta": {"value": value, "sd": sd, "unit": "deg"}}}]  # fmt: skip
    return {
        "verdict": "effect" if effects else "none", "effects": effects, "trial": {"vehicle": vehicle},
        "acting": {"none": 0.1, "rudder_offset": acting if effects else 0.01}, "gap": {"shrink": None},
    }  # fmt: skip


def test_one_value_in_all_bundles_is_pooled_and_a_change_is_called_one():
    same = {"d1": record("A", 1.0), "d2": record("A", 1.1, 0.2), "d3": record("A", 0.95)}
    (p,) = shared_parameters(same)
    weight = [100.0, 25.0, 100.0]
    mean = (100 + 27.5 + 95) / sum(weight)
    assert p.value == pytest.approx(mean) and p.sd == pytest.approx(1 / math.sqrt(sum(weight)))
    q = sum(w * (v - mean) ** 2 for w, v in zip(weight, (1.0, 1.1, 0.95), strict=True))
    assert p.p == pytest.approx(chi2.sf(q, 2)) and not p.changed
    (p,) = shared_parameters({**same, "d4": record("A", 3.0)})
    assert p.changed and [name for name, _, _ in p.each] == ["d1", "d2", "d3", "d4"]


def test_an_effect_of_ambiguous_verdicts_is_in_question_and_does_not_act():
    records = {n: record("A", 1.0, acting=0.6) | {"verdict": "ambiguous"} for n in ("d1", "d2")}
    lead = fleet_lead(records, {}, shared_effects(records), shared_parameters(records))
    assert "in question in 2 of 2" in lead and "acts" not in lead


@pytest.mark.parametrize(
    "retuned, verdict, n_r, said",
    [
        (1.0, "none", -1.6, "none, but coefficients are off (N_r by 2.0 stated sd)"),
        (1.0, "none", -1.999, "none, but coefficients are off"),
        (9.0, "none", -1.6, "none"),
        (1.0, "effect", -1.6, "effect"),
    ],
)
def test_a_vehicle_to_be_tuned_anew_is_not_called_none_alone(retuned, verdict, n_r, said):
    sizes = {"nominal": 10.0, "recalibrated": retuned, "with effect": retuned}
    run = {
        "run": "z", "manoeuvre": "zig-zag", "role": "holdout", "seconds": 60.0, "lead": 5.0,
        "position": sizes, "rms": {m: {"x": s, "y": 0.0} for m, s in sizes.items()}, "later": 1,
    }  # fmt: skip
    moved = {
        "N_r": {"given": -2.0, "retuned": n_r, "prior_sd": 0.2},
        "Y_v": {"given": 1.0, "retuned": 1.09, "prior_sd": 0.2},
    }
    records = {"d1": record("A", 1.0) | {"verdict": verdict, "runs": [run], "moved": moved}}
    assert verdict_words(records["d1"]) == said
    assert verdict_words({k: v for k, v in records["d1"].items() if k not in ("runs", "moved")}) == verdict
    lead = fleet_lead(records, {}, [], [])
    assert ("1 none, but coefficients are off." in lead) is ("off" in said)


def test_vehicles_are_not_mixed_and_one_bundle_shares_nothing():
    records = {"a": record("A", 1.0), "b": record("B", 9.0), "c": record("B")}
    assert shared_parameters(records) == []
    found = {(s.vehicle, s.acting, s.bundles) for s in shared_effects(records)}
    assert found == {("", 2, 3), ("A", 1, 1), ("B", 1, 2)}


def test_a_bundle_is_no_fleet_and_an_empty_folder_is_refused(tmp_path):
    (tmp_path / "day1").mkdir()
    (tmp_path / "day1" / "trial.toml").write_text("")
    assert bundles_of(tmp_path) == [tmp_path / "day1"] and bundles_of(tmp_path / "day1") == []
    with pytest.raises(TrialError, match=r"no folder in it holds a trial\.toml"):
        diagnose_fleet(tmp_path / "day1", tmp_path / "out")


def test_a_bundle_that_cannot_be_read_costs_no_other_one(tmp_path, capsys):
    for day in ("day1", "day2"):
        (tmp_path / "all" / day).mkdir(parents=True)
        (tmp_path / "all" / day / "trial.toml").write_text("format = 1\n")
    assert run(["diagnose", str(tmp_path / "all")]) == 2
    assert run(["diagnose", str(tmp_path / "all"), "--out", str(tmp_path / "out"), "--quick"]) == 3
    said = capsys.readouterr().out
    assert "0 of 2 bundles diagnosed" in said and "day2: no verdict" in said
    assert (tmp_path / "out" / "report.html").exists()


@pytest.mark.parametrize("changed", ["option", "bundle", "effects"])
def test_a_verdict_is_kept_only_for_the_same_vehicle_and_effects(tmp_path, monkeypatch, changed):
    """The paths stay, what the files hold changes."""
    day = tmp_path / "all" / "day1"
    assert run(["simulate", "remus100", "turn:10,duration=20", "--out", str(day)]) == 0
    ship, effects = tmp_path / "ship.toml", tmp_path / "effects.py"
    if changed == "bundle":
        ship = day / "vehicle.toml"
        header = (day / "trial.toml").read_text()
        (day / "trial.toml").write_text(header.replace('"remus100"', '"vehicle.toml"'))
    text = vehicle_toml(load_vehicle("remus100"), None)
    ship.write_text(text)
    effects.write_text("EFFECTS = ()")
    done = []

    class Found:
        verdict = "none"

        def save(self, folder):
            folder.mkdir(parents=True, exist_ok=True)
            (folder / "diagnosis.json").write_text(json.dumps(record("A")))

    monkeypatch.setattr(fleet, "diagnose", lambda trial, **rest: done.append(trial.name) or Found())
    options = {} if changed == "bundle" else {"vehicle": str(ship), "effects": str(effects)}

    def again():
        diagnose_fleet(tmp_path / "all", tmp_path / "out", **options)
        return len(done)

    assert [again(), again()] == [1, 1]
    if changed == "effects":
        effects.write_text("EFFECTS = (1,)")
    else:
        vehicle = load_vehicle("remus100")
        ship.write_text(vehicle_toml(replace(vehicle, rho=1.001 * vehicle.rho), None))
    assert [again(), again()] == [2, 2]
