"""The next manoeuvre fits the water: none lasts much longer than what was run there."""

from __future__ import annotations

import pytest

from bayesid.diagnosis.next_manoeuvre import LONGEST, with_room
from bayesid.manoeuvres import library


def test_a_model_in_a_pond_is_not_sent_on_a_spiral_of_an_hour():
    """3 m at 0.4 m/s, runs of two to six minutes: the library's longest lasts an hour."""
    executed = library(3.0, 0.4, 700.0, 0.6, dof=3)
    longest = max(float(m.t[-1]) for m in executed.values())
    assert longest > 3000.0
    fits = with_room(executed, 360.0)
    assert 0 < len(fits) < len(executed)
    assert max(float(m.t[-1]) for m in fits.values()) <= LONGEST * 360.0
    assert all(fits[name] is executed[name] for name in fits)


@pytest.mark.parametrize("run", [1e-3, 1e6])
def test_something_is_always_left_to_run(run):
    executed = library(3.0, 0.4, 700.0, 0.6, dof=3)
    shortest = min(float(m.t[-1]) for m in executed.values())
    fits = with_room(executed, run)
    assert len(fits) == (1 if run < 1.0 else len(executed))
    assert min(float(m.t[-1]) for m in fits.values()) == shortest
