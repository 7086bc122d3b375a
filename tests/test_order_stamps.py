"""Orders that change between two stamps of a log."""

from pathlib import Path
from types import SimpleNamespace as Plain

import numpy as np
import pytest

from bayesid.diagnosis.input.order_stamps import acts_before_its_stamp, better, read_between_stamps, step_of
from bayesid.model.effects import CATALOGUE
from bayesid.trials import Run, Trial
from bayesid.trials.correction import Correction, apply

EFFECTS = {e.name: e for e in CATALOGUE}
DELAY = "actuator_dead_time.delay"


def run_of(t, order):
    return Run("r1", "zigzag 10/10", "identify", t, {"psi": np.zeros(t.size)}, {"delta_r_cmd": order})


@pytest.mark.parametrize("delay", [0.0, 0.03, 0.1, 0.2, 0.33, -0.07])
def test_an_order_read_earlier_is_its_mean_while_a_row_holds(delay):
    """Against quadrature of the order as it is held, on stamps that are not even."""
    rng = np.random.default_rng(0)
    t = np.cumsum(rng.uniform(0.1, 0.3, 40))
    order = np.repeat(rng.normal(size=8), 5)
    found = apply(Correction(late={"delta_r_cmd": delay}), run_of(t, order)).commands["delta_r_cmd"]
    for k in range(3, 36):
        s = np.linspace(t[k], t[k + 1], 20_001)[:-1] + delay
        assert found[k] == pytest.approx(order[np.searchsorted(t, s, side="right") - 1].mean(), abs=1e-3)


def test_an_order_read_whole_steps_earlier_keeps_its_numbers():
    t, order = 0.2 * np.arange(30), np.repeat([0.1, -0.2, 0.3], 10)
    found = apply(Correction(late={"delta_r_cmd": 0.4}), run_of(t, order)).commands["delta_r_cmd"]
    assert np.array_equal(found, np.append(order[2:], [0.3, 0.3]))


def test_orders_between_stamps_switch_halfway_and_the_trial_says_how_to_keep_it():
    """A switch logged at 2 s acts from 1.9 s on: half of the row before."""
    t, order = 0.2 * np.arange(30), np.where(np.arange(30) < 10, 0.1, -0.1)
    trial = Trial("a", Path("."), "remus100", 3, (run_of(t, order),), {})
    assert step_of(trial) == pytest.approx(0.2)
    earlier, text = read_between_stamps(trial, step_of(trial))
    found = earlier.runs[0].commands["delta_r_cmd"]
    assert found[9] == pytest.approx(0.0, abs=1e-9)
    assert np.delete(found, 9) == pytest.approx(np.delete(order, 9))
    assert "late = { delta_r_cmd = 0.1 }" in text and text in earlier.warnings


def explained(*rows, none=0.0):
    """A comparison of refits of (effects, log evidence, delay, its sd)."""

    def refit(effects, evidence, delay, sd):
        free = Plain(names=(DELAY,) if "actuator_dead_time" in effects else ())
        size = len(free.names)
        return Plain(
            effects=effects, log_evidence=evidence,
            fit=Plain(free=free, values=np.full(size, delay), sd=np.full(size, sd)),
        )  # fmt: skip

    refits = tuple(refit(*row) for row in rows)
    candidates = Plain(none=Plain(log_evidence=none), refits=refits)
    return Plain(candidates=candidates, model=Plain(effects=EFFECTS))


@pytest.mark.parametrize(
    ("effects", "evidence", "delay", "sd", "told"),
    [
        (("actuator_dead_time",), 300.0, -0.12, 0.01, True),
        (("wind", "actuator_dead_time"), 300.0, -0.12, 0.01, True),
        (("actuator_dead_time",), 300.0, 0.12, 0.01, False),  # later, as a servo does
        (("actuator_dead_time",), 300.0, -0.12, 0.1, False),  # not clearly
        (("actuator_dead_time",), 10.0, -0.12, 0.01, False),  # no better than none
        (("wind",), 300.0, 0.0, 0.0, False),
    ],
)
def test_an_order_that_acts_before_it_is_logged_is_asked_about(effects, evidence, delay, sd, told):
    assert acts_before_its_stamp(explained((effects, evidence, delay, sd))) == told


def test_orders_are_read_earlier_only_where_that_explains_more():
    one = explained((("wind",), 300.0, 0.0, 0.0))
    assert better(one, explained(none=400.0))
    assert not better(one, explained((("wind",), 310.0, 0.0, 0.0), none=290.0))
