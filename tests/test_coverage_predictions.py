"""The section on fresh runs: numbers from records that are known, and runs that are predicted."""

from __future__ import annotations

import numpy as np
import pytest

from studies.coverage.campaigns import setting
from studies.coverage.predictions import FOREIGN, GROUPS, OWN, PLANT, fresh_runs
from studies.coverage.predictions_report import (
    judged_predictions,
    prediction_targets,
    prediction_words,
    predictions_section,
)
from studies.coverage.run import CONDITIONS

CHANNELS = ("psi", "u")


def record(z):
    """A vehicle with two fresh runs of these errors (n, 2)."""
    run = {
        "kind": "turn",
        "square": {c: float(np.mean(v**2)) for c, v in zip(CHANNELS, z.T, strict=True)},
        "inside90": {c: float(np.mean(np.abs(v) < 1.645)) for c, v in zip(CHANNELS, z.T, strict=True)},
        "inside95": {c: float(np.mean(np.abs(v) < 1.96)) for c, v in zip(CHANNELS, z.T, strict=True)},
    }
    return {"failed": "", "what": "w", "runs": [run, run], "final": True, "cpu_seconds": 1.0}


def judged(size, count=40):
    rng = np.random.default_rng(1)
    return judged_predictions({"a": [record(size * rng.standard_normal((100, 2))) for _ in range(count)]})


def test_errors_as_large_as_their_sd_meet_both_targets():
    (group,) = judged(1.0).values()
    assert group["rms_z"] == pytest.approx(1.0, abs=0.05) and group["runs"] == 80
    assert group["inside90"]["share"] == pytest.approx(0.9, abs=0.02)
    assert group["inside95"]["share"] == pytest.approx(0.95, abs=0.02)
    assert [t["standing"] for t in prediction_targets({"a": group}).values()] == ["met", "met"]


@pytest.mark.parametrize(("size", "standings"), [(2.0, ["missed", "missed"]), (0.5, ["missed", "met"])])
def test_bands_too_narrow_miss_both_and_too_wide_ones_the_rms(size, standings):
    assert [t["standing"] for t in prediction_targets(judged(size)).values()] == standings


def test_vehicles_that_could_not_be_predicted_are_counted_with_their_reason():
    rows = [record(np.ones((10, 2)) * s) for s in (0.9, 1.1)] + [{"failed": "every draw diverges"}]
    found = judged_predictions({"a": rows, "b": [{"failed": "no fit"}]})
    assert found["a"]["predicted"] == 2 and found["a"]["vehicles"] == 3
    assert set(prediction_targets(found)) == {"rms z of fresh runs, a", "90 % bands of fresh runs, a"}
    assert "4 fresh runs" in prediction_words(found)
    text = predictions_section(found).blocks[0].body
    assert "every draw diverges" in text and "no fit" in text


@pytest.mark.slow
@pytest.mark.parametrize("group", [OWN, FOREIGN])
def test_fresh_runs_lie_inside_their_bands(group):
    s = setting()
    found = judged_predictions({group: [fresh_runs(s, CONDITIONS, group, 900 + i) for i in range(8)]})[group]
    assert found["predicted"] == 8
    assert found["inside90"]["share"] + 2.6 * found["inside90"]["standard_error"] >= 0.88
    assert 0.6 < found["median_rms_z"] < 1.4


@pytest.mark.slow
def test_the_held_out_runs_of_a_plant_are_predicted_and_not_fitted():
    found = fresh_runs(setting(), CONDITIONS, PLANT, 1)
    assert not found["failed"] and found["what"] == "none" and len(found["runs"]) >= 1
    assert PLANT in GROUPS
