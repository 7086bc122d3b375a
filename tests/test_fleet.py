"""Many bundles: what they share is told from what changed, and a folder of bundles is not a bundle."""

import math

import pytest
from scipy.stats import chi2

from bayesid.api.fleet import bundles_of, diagnose_fleet
from bayesid.cli.main import run
from bayesid.diagnosis.fleet import shared_effects, shared_parameters
from bayesid.errors import TrialError


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
