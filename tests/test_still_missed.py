"""A table of runs says why some stay missed, a table of measures which the explanation misses by more."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from bayesid.diagnosis.evidence import replay
from bayesid.diagnosis.result_parts import RunError
from bayesid.diagnosis.run_errors import still_missed
from bayesid.errors import ModelError
from bayesid.report.diagnosis.holdout import measures_table

LABELS = ("as given", "re-tuned", "explained")


def a_turn(name, given, explained, expected):
    sizes = {"nominal": given, "recalibrated": given, "with effect": explained}
    rms = {m: {"psi": math.radians(s)} for m, s in sizes.items()}
    return RunError(name, "turn", "identify", 100.0, 5.0, {}, rms, {"psi": math.radians(expected)})


def a_run(name, given, explained, expected):
    sizes = {"nominal": given, "recalibrated": given, "with effect": explained}
    rms = {m: {"x": s, "y": 0.0} for m, s in sizes.items()}
    hoped = {} if expected is None else {"x": None if math.isinf(expected) else expected, "y": 0.0}
    return RunError(name, "straight run", "identify", 100.0, 5.0, sizes, rms, hoped)


@pytest.mark.parametrize(
    "expected, words",
    [
        (math.inf, "amplifies the smallest error"),
        (60.0, "no more than the explanation expects of itself"),
        (10.0, "more than the explanation expects of itself (rms): straight run (r5), by 116 m where 10 are"),
    ],
)
def test_a_run_that_stays_missed_is_told_by_what_the_explanation_expects(expected, words):
    good = a_run("r7", 11.8, 1.6, 1.2)
    told = still_missed([good, a_run("r5", 114.0, 116.0, expected)], LABELS)
    assert words in told and "r5" in told and "r7" not in told
    assert "hardly nearer" in told and "no nearer" not in told


def test_runs_that_are_brought_nearer_or_near_or_of_an_older_file_are_not_told_of():
    good = a_run("r7", 11.8, 1.6, 1.2)
    assert not still_missed([good, a_run("r5", 114.0, 60.0, 1.0)], LABELS)
    assert not still_missed([good, a_run("r5", 4.0, 4.0, 1.0)], LABELS)
    assert not still_missed([good, a_run("r5", 114.0, 116.0, None)], LABELS)
    assert not still_missed([], LABELS)


def test_an_error_is_far_only_against_errors_of_its_own_unit():
    good = a_run("r7", 11.8, 1.0, 1.2)
    assert not still_missed([good, a_turn("r5", 7.0, 6.0, 1.0)], LABELS)
    told = still_missed([good, a_turn("r5", 7.0, 6.0, 1.0), a_turn("r6", 7.0, 1.0, 1.0)], LABELS)
    assert "turn (r5), by 6 degrees where 1 are expected" in told


def test_nothing_is_said_of_a_run_of_which_a_channel_has_no_expected_error():
    good, lost = a_run("r7", 11.8, 1.6, 1.2), a_run("r5", 114.0, 116.0, 10.0)
    assert not still_missed([good, replace(lost, expected={"x": 10.0})], LABELS)
    assert "amplifies" in still_missed([good, replace(lost, expected={"x": 10.0, "y": None})], LABELS)


@pytest.mark.parametrize("fail, diverges", [(0, False), (7, False), (8, True), (16, True)])
def test_an_explanation_whose_draws_diverge_expects_no_bound(monkeypatch, fail, diverges):
    """Half of the simulations lost or more; the band keeps what noise and start give."""
    left = iter([False] * fail + [True] * (replay.BAND_DRAWS - fail))

    def simulated(*_):
        if not next(left):
            raise ModelError("diverges")
        return np.full((3, 1), 2.0)

    flat = np.zeros((3, 1, 1))
    monkeypatch.setattr(replay, "linearise", lambda *_: SimpleNamespace(slope=flat))
    monkeypatch.setattr(replay, "smoothed", lambda *_: SimpleNamespace(variance=np.zeros((3, 1))))
    monkeypatch.setattr(replay, "_draws", lambda *_: range(replay.BAND_DRAWS))
    monkeypatch.setattr(replay, "_simulated", simulated)
    problem = SimpleNamespace(
        model=None, environment=SimpleNamespace(noise_model=SimpleNamespace(slow=lambda c: 0.0))
    )
    known = SimpleNamespace(channels=("x",), sigma=np.array([1.0]))
    shown = SimpleNamespace(
        models={replay.EXPLAINED: np.zeros((3, 1))}, channels=("x",), readings=np.zeros((3, 1)),
        t=np.arange(3.0), lead=0.5,
    )  # fmt: skip
    point, fitted = SimpleNamespace(states=np.zeros((3, 1))), SimpleNamespace()
    found = replay._deviation(problem, known, shown, fitted, np.zeros(1), point, 0)
    np.testing.assert_allclose(found.sd, 1.0 if diverges else math.sqrt(5.0))
    assert replay._expected(shown, *found)["x"] == pytest.approx(math.inf if diverges else math.sqrt(5.0))


def test_what_is_expected_counts_readings_after_the_lead_in():
    readings = np.ones((4, 2))
    readings[3, 0] = np.nan
    shown = SimpleNamespace(channels=("x", "psi"), readings=readings, t=np.arange(4.0), lead=0.5)
    sd = np.array([[9.0, 9.0], [3.0, 1.0], [4.0, 1.0], [100.0, 1.0]])
    assert replay._expected(shown, sd, False) == pytest.approx({"x": math.sqrt(12.5), "psi": 1.0})
    assert replay._expected(shown, None, True) == {"x": math.inf, "psi": math.inf}
    assert not replay._expected(shown, None, False)


def measured(explained):
    row = {"run": "r7", "name": "tactical diameter", "unit": "m", "logged": 14.0, "nominal": 14.4}
    return SimpleNamespace(measures=(row | {"recalibrated": 15.2, "with effect": explained},))


def test_a_measure_that_gets_worse_is_told_of():
    worse = measures_table(measured(15.6), LABELS).caption
    assert "tactical diameter of r7 by 1.6 m instead of 0.4" in worse
    assert "does not reach" in measures_table(measured(None), LABELS).caption
    assert "more" not in measures_table(measured(14.1), LABELS).caption
