"""Time left as a diagnosis tells it: from the steps done, and no number where a step overruns."""

from io import StringIO

import pytest

from bayesid import progress
from bayesid.progress import LATE, Progress, Route, RouteStep

WHY = "more explanations come near"
STEPS = (RouteStep(("read",), 0.2), RouteStep(("refit",), 0.6, WHY), RouteStep(("draw",), 0.2))


@pytest.fixture
def clock(monkeypatch):
    now = [100.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    return now


def told(route, stream, sentence):
    route(sentence)
    return stream.getvalue().strip().splitlines()[-1]


def test_time_left_counts_down_while_a_step_keeps_to_its_share(clock):
    stream = StringIO()
    route = Route(Progress(stream=stream), STEPS)
    assert "left" not in told(route, stream, "read: the log")
    clock[0] += 20.0  # a fifth is done: a hundred seconds in all
    assert "about 80 s left" in told(route, stream, "refit with wind")
    clock[0] += 30.0
    assert "about 50 s left" in told(route, stream, "refit with current")


def test_a_step_that_takes_much_longer_than_usual_has_no_number(clock):
    # a diagnosis said "about 6 s left" from 26 s to 387 s
    stream = StringIO()
    route = Route(Progress(stream=stream), STEPS)
    route("read: the log")
    clock[0] += 20.0
    route("refit with wind")
    clock[0] = 100.0 + LATE * 80.0 + 1.0
    late = told(route, stream, "refit with current")
    assert "left" not in late and late.endswith(f"({LATE * 80.0 + 1.0:.0f} s, longer than usual: {WHY})")
    # the reason is said once
    assert told(route, stream, "refit with bias").endswith(f"refit with bias ({LATE * 80.0 + 1.0:.0f} s)")
    route("draw")  # the next step tells again, from the time that was taken
    assert "left" in stream.getvalue().strip().splitlines()[-1]
