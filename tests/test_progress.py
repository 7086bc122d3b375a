"""Progress is one line per stage in a log file and a live bar on a terminal."""

from __future__ import annotations

import io

import pytest

from bayesid.api.diagnose import diagnosis_route
from bayesid.progress import Progress, RouteStep, set_quiet


class _Terminal(io.StringIO):
    def isatty(self):
        return True


def test_a_log_file_gets_one_plain_line_per_short_stage():
    log = io.StringIO()
    progress = Progress(stream=log)
    assert list(progress.track("abc", "runs")) == ["a", "b", "c"]
    assert log.getvalue().startswith("runs: done 3/3 in ")
    assert log.getvalue().count("\n") == 1 and "\x1b" not in log.getvalue()


def test_a_long_stage_reports_on_its_way_and_its_end_once():
    log = io.StringIO()
    with Progress(stream=log, every=0.0).stage("fit", 2) as stage:
        stage.step(info="V 1.0")
        stage.step()
    first, last = log.getvalue().splitlines()
    assert first.split(",")[0] == "fit: 1/2" and last.startswith("fit: done 2/2 in ")
    assert "(V 1.0)" in log.getvalue()


def test_a_stage_that_fails_says_stopped():
    log = io.StringIO()
    with pytest.raises(KeyError), Progress(stream=log).stage("fit"):
        raise KeyError
    assert log.getvalue().startswith("fit: stopped in ")


def test_quiet_says_nothing_but_still_counts():
    log = io.StringIO()
    progress = Progress(quiet=True, stream=log)
    with progress.stage("fit", 5) as stage:
        stage.step(2)
    progress.note("x")
    assert stage.done == 2 and log.getvalue() == ""


def test_nested_and_successive_bars_keep_the_finished_ones_on_screen():
    terminal = _Terminal()
    progress = Progress(stream=terminal)
    with progress.stage("outer", 1) as outer:
        list(progress.track(range(2), "inner"))
        outer.step()
    before = len(terminal.getvalue())
    list(progress.track(range(2), "next"))
    assert "inner" in terminal.getvalue()[:before] and "2/2" in terminal.getvalue()
    assert "inner" not in terminal.getvalue()[before:]


def test_a_name_cannot_steer_the_terminal_through_a_note_or_a_stage():
    stream = io.StringIO()
    progress = Progress(stream=stream)
    progress.note("the same without \x1b[2Jrun")
    with progress.stage("fit") as stage:
        stage.step(info="run\x07\x9b31m")
    assert "run" in stream.getvalue() and not set(stream.getvalue()) & set("\x1b\x07\x9b")


def test_stages_that_are_expected_are_numbered_and_tell_the_time_left():
    log = io.StringIO()
    progress = Progress(stream=log, every=0.0)
    progress.expect(2)
    with progress.stage("fit", 4) as stage:
        stage.step()
        list(progress.track(range(1), "inner"))  # part of its stage, no step of its own
    list(progress.track(range(2), "predict"))
    said = log.getvalue().splitlines()
    assert said[0].startswith("step 1 of 2: fit: 1/4,") and " left" in said[0]
    assert any(line.startswith("inner: ") for line in said)
    assert said[-1].startswith("step 2 of 2: predict: done 2/2")


def test_a_route_goes_on_only_and_says_where_it_is():
    log = io.StringIO()
    route = Progress(stream=log).route(
        [RouteStep(("read",), 0.2), RouteStep(("refit",), 0.6), RouteStep(("end",), 0.2)]
    )
    for sentence in ("read it", "refit with wind", "read once more", "refit with lag", "end"):
        route(sentence)
    steps = [line.split(":")[0] for line in log.getvalue().splitlines()]
    assert steps == [f"step {k} of 3" for k in (1, 2, 2, 2, 3)]
    assert "left" in log.getvalue().splitlines()[1] and "left" not in log.getvalue().splitlines()[0]


def test_quiet_for_the_whole_process_silences_every_progress():
    log = io.StringIO()
    set_quiet(True)
    try:
        Progress(stream=log).note("x")
    finally:
        set_quiet(False)
    assert log.getvalue() == ""


def test_a_diagnosis_in_six_degrees_of_freedom_goes_the_same_steps_with_shares_of_its_own():
    for asked in ((True, True, True), (False, False, True)):
        plane, space = diagnosis_route(*asked), diagnosis_route(*asked, True)
        assert [s.begins for s in plane] == [s.begins for s in space]
        assert plane[0].share > 2.0 * space[0].share and plane[3].share < 0.5 * space[3].share
    for route in (diagnosis_route(True, True, True), diagnosis_route(True, True, True, True)):
        assert sum(step.share for step in route) == pytest.approx(1.0)
