"""Which runs tell the environment alone: nothing ordered, a course kept, long enough. In hull lengths."""

import numpy as np
import pytest

from bayesid.equations.model import build_model
from bayesid.estimation.filter_error.read_run import _bent
from bayesid.model.vehicles import load_vehicle
from bayesid.simulation import plan_run

MODEL = build_model(load_vehicle("generic_sub"), 6)
RPM = MODEL.vehicle.rpm_ref


def counts(heading, duration=60.0, rudder=0.0, planes=0.0, rpm=1.0, samples=241):
    """`heading`, `rudder`, `planes` [rad], `rpm` (of the usual): of the share of the run that has passed."""
    share = np.linspace(0.0, 1.0, samples)
    t = duration * MODEL.scales["L"] / MODEL.scales["U"] * share

    def of(value):
        return value(share) if callable(value) else np.full(samples, float(value))

    inputs = {"delta_r_cmd": of(rudder), "delta_s_cmd": of(planes), "n_cmd": RPM * of(rpm)}
    return not _bent(MODEL, plan_run(MODEL, t, inputs), of(heading))


def wave(size, cycles=5):
    return lambda share: size * np.sin(2 * np.pi * cycles * share)


def test_a_kept_course_counts_with_an_autopilot_that_answers_the_sea():
    assert counts(0.0)
    assert counts(wave(0.05), rudder=wave(0.03))


def test_a_course_bent_too_slowly_to_be_felt_counts_and_a_turn_does_not():
    # 23 degrees in 60 hull lengths: a circle of 150 of them
    assert counts(lambda share: 0.4 * share)
    # a vehicle with its rudder held amidships and a cause that turns it: 60 degrees in the same time
    assert not counts(lambda share: 1.05 * share)
    # the same course as a bend that comes and goes: the vehicle feels it
    assert not counts(lambda share: 0.4 * np.sin(2 * np.pi * share))


@pytest.mark.parametrize(
    "ordered",
    [
        dict(heading=wave(0.17), rudder=lambda share: 0.17 * np.sign(np.sin(10 * np.pi * share))),
        dict(heading=0.0, planes=lambda share: 0.2 * (share > 0.5)),
        dict(heading=0.0, rpm=lambda share: 1.0 - 0.1 * (share > 0.5)),
    ],
    ids=["zig-zag", "dive", "change of revolutions"],
)
def test_an_order_makes_a_manoeuvre(ordered):
    assert not counts(**ordered)


def test_a_run_shorter_than_the_slowest_disturbance_has_no_level_to_tell():
    assert counts(0.0, duration=6.3) and not counts(0.0, duration=5.7)
