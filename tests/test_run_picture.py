"""The picture of a run: panels are scaled by simulations that exist, and one that diverges is said to."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
import pytest

from bayesid.report import run_picture
from bayesid.report.run_picture import BEST, BETWEEN, GIVEN, RunPicture, Series

T = np.linspace(0.0, 100.0, 201)
LOG = np.stack([T, np.zeros(T.size), 0.1 * np.sin(T / 20)], axis=1)


def picture(last: np.ndarray, half: np.ndarray | None = None) -> RunPicture:
    given, tuned = LOG + [30.0, 0.0, np.radians(20.0)], LOG + [8.0, 0.0, np.radians(5.0)]
    series = (Series("as given", GIVEN, given), Series("re-tuned", BETWEEN, tuned))
    return RunPicture(T, ("x", "y", "psi"), LOG, (*series, Series("explained", BEST, last)), half=half)


@pytest.mark.parametrize("until", [0, 120])
def test_panels_hold_the_simulations_that_are_there_where_the_last_one_diverges(until):
    lost = LOG + 1e4 * (T / 100.0)[:, None]
    lost[until:] = np.nan
    shown = picture(lost, half=np.full(LOG.shape, 1e6))
    assert shown.last.label == "re-tuned" and shown.band is None
    figure = run_picture.over_time(shown)
    _, heading, distance = figure.axes
    assert 5.0 < heading.get_ylim()[1] < 30.0 and 8.0 < distance.get_ylim()[1] < 50.0
    labels = [text.get_text() for text in run_picture.track(shown).axes[0].get_legend().get_texts()]
    assert labels == ["log", "as given", "re-tuned", "explained: diverges"]
    plt.close("all")


def test_the_last_simulation_gives_the_scale_where_it_is_there():
    shown = picture(LOG + [1.0, 0.0, np.radians(0.5)], half=np.full(LOG.shape, 0.01))
    assert shown.last.label == "explained" and shown.band is not None
    _, heading, distance = run_picture.over_time(shown).axes
    assert heading.get_ylim()[1] < 2.0 and distance.get_ylim()[1] < 2.0
    labels = [text.get_text() for text in run_picture.track(shown).axes[0].get_legend().get_texts()]
    assert labels[-1] == "explained"
    plt.close("all")


def test_a_run_in_which_everything_diverges_is_drawn():
    nothing = np.full(LOG.shape, np.nan)
    series = tuple(Series(s, BEST, nothing) for s in ("as given", "explained"))
    shown = RunPicture(T, ("x", "y", "psi"), LOG, series)
    for draw in (run_picture.over_time, run_picture.track):
        assert np.isfinite(draw(shown).axes[-1].get_ylim()).all()
    plt.close("all")


def test_the_caption_names_the_panels_that_are_drawn():
    t = np.linspace(0.0, 50.0, 101)
    channels = ("x", "y", "psi", "u", "r")
    values = np.column_stack([t, 0.1 * t, 0.01 * t, np.ones(t.size), np.full(t.size, 0.01)])
    lines = (Series("predicted", BEST, values),)
    logged = RunPicture(t, channels, values + 0.01, lines, half=np.full(values.shape, 0.1))
    said = run_picture.caption(logged, "Blue: where 95 % lie.")
    assert "black dots: the log" in said and said.endswith("Blue: where 95 % lie.")
    assert (
        "Right: heading over time, and below it by how much each simulation misses the logged heading" in said
    )
    assert "logged heading and logged position (lines: running means; small dots" in said
    nothing = RunPicture(t, channels, np.full(values.shape, np.nan), lines)
    assert run_picture.caption(nothing, "Blue") == (
        "Left: track, begun at the ring. Right: heading, speed ahead and yaw rate over time."
    )
    assert len(run_picture.over_time(nothing).axes) == 3 == len(run_picture.over_time(logged).axes)


@pytest.mark.parametrize(("known", "samples"), [(40.0, 81), (np.inf, 201)])
def test_no_track_is_drawn_beyond_where_the_heading_is_known(known, samples):
    shown = RunPicture(
        T, ("x", "y", "psi"), np.full(LOG.shape, np.nan), (Series("predicted", BEST, LOG, known),)
    )
    lines = {line.get_label(): line for line in run_picture.track(shown).axes[0].lines}
    assert lines["predicted"].get_xdata().size == samples
    plt.close("all")
