"""Errors of the study of ship models, on motions in closed form."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bayesid.errors import FitError
from bayesid.model.vehicles import load_vehicle
from bayesid.progress import Progress
from bayesid.trials import Run, Trial
from studies.ship_models import choice
from studies.ship_models.choice import Candidate, chosen, joined_errors
from studies.ship_models.errors import circle, circled, filled, lost, overshoots, whole_turn
from studies.ship_models.report import choice_words


def test_overshoots_are_what_the_heading_gains_after_each_reversal():
    """A triangle of heading that turns back 3 degrees after every reversal of the rudder, to either side."""
    t = np.arange(0.0, 81.0)
    psi = np.radians(10.0) * np.abs((t / 20.0) % 2 - 1)  # falls for 20 s, rises for 20 s
    rudder = np.where(((t + 6.0) / 20.0) % 2 < 1, 0.2, -0.2)  # orders 6 s before the heading turns: 3 degrees
    found = np.degrees(overshoots(t, psi, rudder))
    assert found == pytest.approx([3.0, 3.0, 3.0], abs=1e-9)


def test_a_circle_has_its_diameter_and_drift_and_its_last_turn_is_whole():
    t = np.arange(0.0, 400.0)
    rate, speed, beta = 0.03, 0.5, np.radians(12.0)
    run = {"psi": rate * t, "u": np.full(400, speed * np.cos(beta)), "v": np.full(400, -speed * np.sin(beta))}
    last = whole_turn(run["psi"])
    assert run["psi"][last[-1]] - run["psi"][last[0]] == pytest.approx(2 * np.pi, abs=rate)
    assert circle(t, run, last) == pytest.approx((2 * speed / rate, beta))
    assert whole_turn(run["psi"][:100]).size == 0  # less than a turn says nothing of a circle


def test_a_circle_in_which_the_wind_stops_the_ship_has_no_diameter():
    t = np.arange(0.0, 400.0)
    run = {"psi": 0.03 * t, "u": 0.1 - 0.05 * np.cos(0.03 * t), "v": np.zeros(400)}
    assert circled(run).size == whole_turn(run["psi"]).size > 0
    assert circled(run | {"u": 0.1 - 0.09 * np.cos(0.03 * t)}).size == 0


def test_folds_part_runs_of_one_manoeuvre_and_keep_the_order_of_others():
    runs = [replace(zigzag(f"{i}"), manoeuvre=m) for i, m in enumerate("abcadb")]
    assert [run.name for run in choice.by_manoeuvre(runs)] == ["0", "3", "1", "5", "2", "4"]


def test_missing_samples_are_interpolated():
    values = np.array([0.0, np.nan, 2.0])
    assert filled(np.arange(3.0), values) == pytest.approx([0.0, 1.0, 2.0])


def test_a_lost_run_loses_the_candidate_and_a_run_without_a_measure_does_not():
    row = {"psi": 3.0, "r": 0.1, "position": 2.0}
    zigzag, turn = row | {"overshoot": 1.5}, row | {"diameter": 5.0, "drift": -2.0}
    assert joined_errors([zigzag, turn])["score"] == pytest.approx(1.0)
    gone = dict.fromkeys(zigzag, np.nan)
    out = joined_errors([zigzag, zigzag, gone, turn])
    assert out["overshoot"] == np.inf and out["score"] == np.inf and out["lost"] == 1
    assert out["psi"] == 3.0 and out["drift"] == pytest.approx(2.0)  # a median over one lost of four


def zigzag(name: str) -> Run:
    t = np.arange(0.0, 81.0)
    psi = np.radians(10.0) * np.abs((t / 20.0) % 2 - 1)
    rudder = np.where(((t + 6.0) / 20.0) % 2 < 1, 0.2, -0.2)
    return Run(name, "zigzag 10/10", "identify", t, {"psi": psi}, measured_inputs={"delta_r": rudder})


def test_a_failed_fold_is_infinite_and_a_kept_row_serves_its_own_inputs_only(monkeypatch, tmp_path: Path):
    """Fits that raise: every run counts as lost, and another seed is computed anew."""
    calls = []

    def fails(*_, **given):
        calls.append(given["options"].seed)
        raise FitError("no")

    monkeypatch.setattr(choice, "fit_in_pieces", fails)
    monkeypatch.setattr(choice, "candidates", lambda *_: (Candidate("one", ("Y_v",), None),))
    trial = Trial("pond", tmp_path, "kvlcc2_mmg", 3, (zigzag("a"), zigzag("b"), zigzag("c")))
    ship = load_vehicle("kvlcc2_mmg")

    def errors_of(seed):
        return chosen("kvlcc2_hsva", trial, ship, tmp_path, seed, Progress(quiet=True))["tried"]["one"]

    found = errors_of(0)
    assert found["score"] == np.inf and found["runs"] == found["lost"] == 3
    assert set(lost(zigzag("a"))) == {"psi", "r", "position", "overshoot"}
    assert errors_of(0) == found and calls == [0, 0]  # two folds, then kept
    errors_of(1)
    assert calls == [0, 0, 1, 1]
    assert json.loads((tmp_path / "choice.json").read_text())["one"]["inputs"]["seed"] == 1
    errors_of(1)
    assert calls == [0, 0, 1, 1]
    monkeypatch.setattr(choice, "MEASURES_VERSION", choice.MEASURES_VERSION + 1)
    errors_of(1)  # errors of other measures are none of these
    assert calls == [0, 0, 1, 1, 1, 1]


def test_the_report_says_which_candidate_other_measures_would_choose():
    one, two = ({"psi": p, "position": 1.0, "overshoot": o} for p, o in ((7.2, 2.7), (4.3, 3.3)))
    words = choice_words({"tried": {"one": one, "two": two}, "best": "one"})
    assert "by overshoot alone" in words and "By heading another would win: two (4.3 instead of 7.2" in words
    assert "By position" not in words
