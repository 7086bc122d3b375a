"""A hole in one channel beside others that are read on is a gap, told with its channel and times."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from bayesid.trials import Run, Trial, trial_summary
from bayesid.trials.gaps import channel_gaps, gap_words, gaps_of
from bayesid.trials.health import check_run

RNG = np.random.default_rng(0)


def log(*lost, n=1600, late=0.0):
    """Rates at 20 Hz, positions at 5 Hz, heading at 10 Hz; lost are (channels, first, last)."""
    t = 0.05 * np.arange(n)
    every = {"x": 4, "y": 4, "psi": 2, "r": 1}
    data = {name: RNG.standard_normal(n) for name in every}
    for name, stride in every.items():
        data[name][np.arange(n) % stride > 0] = np.nan
        data[name][t < late] = np.nan
        for names, first, last in lost:
            if name in names:
                data[name][(t > first) & (t < last)] = np.nan
    return Run("r1", "", "identify", t, data, {"delta_r_cmd": np.zeros(n)})


def test_channels_of_their_own_rates_have_no_gap_and_a_long_hole_is_told():
    assert gaps_of(log()) == []
    run = log((("x", "y", "psi"), 10.0, 65.0))
    told = [text for text in check_run(run) if " missing from " in text]
    assert told == ["x, y and psi missing from t = 10 to 65 s (55 s; usually every 0.2 s)"]
    (row,) = trial_summary(Trial("t", Path("."), "", 3, (run,)))["runs"]
    assert row["n_gaps"] == 1
    assert row["gaps"] == [{"after": 10.0, "length": 55.0, "channels": ["x", "y", "psi"]}]


def test_holes_of_one_channel_are_counted_and_the_longest_is_told():
    run = log((("psi",), 10.0, 14.0), (("psi",), 30.0, 50.0), (("x", "y"), 45.0, 60.0))
    assert gap_words(channel_gaps(run)) == [
        "psi missing from t = 30 to 50 s (20 s; usually every 0.1 s); 1 more gap of psi",
        "x and y missing from t = 45 to 60 s (15 s; usually every 0.2 s)",
    ]
    assert len(gaps_of(run)) == 2  # 30 to 60 s is one


def test_a_channel_that_begins_late_has_a_gap_and_readings_lost_here_and_there_are_none():
    (first, *_) = channel_gaps(log(late=30.0))
    assert (first.first, first.last) == (0.0, 30.0)
    run = log()
    some = {**run.data, "r": np.where(RNG.random(run.n_samples) < 0.5, np.nan, run.data["r"])}
    heading = {**some, "psi": some["r"]}
    assert channel_gaps(Run("r1", "", "identify", run.t, heading)) == []


def test_a_recorder_that_stops_is_one_gap_of_all_channels():
    run = log()
    keep = (run.t < 20.0) | (run.t > 50.0)
    run = Run("r1", "", "identify", run.t[keep], {k: v[keep] for k, v in run.data.items()})
    assert channel_gaps(run) == [] and [gap.channels for gap in gaps_of(run)] == [()]


def test_a_recorder_that_stops_while_a_channel_is_lost_is_listed_beside_it():
    run = log((("x",), 10.0, 60.0))
    keep = (run.t < 20.0) | (run.t > 50.0)
    run = Run("r1", "", "identify", run.t[keep], {k: v[keep] for k, v in run.data.items()})
    assert [gap.channels for gap in gaps_of(run)] == [("x",), ()]
