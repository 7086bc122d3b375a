"""A reversed or exchanged fin of an X is told by the turn, pitch and roll it gives; a right log is none."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import bayesid
from bayesid.diagnosis.input import check_trial
from bayesid.diagnosis.input.single_fins import (
    fins_density,
    mistakes_of_fins,
    shown,
    single_fins,
)
from bayesid.equations.model import build_model
from bayesid.trials import Trial
from bayesid.trials.correction import Correction, apply
from tests.test_x_stern import AFT, CROSS, X, with_fins, without_fins

pytestmark = pytest.mark.thorough

ARM = 0.1  # m
NOISE = {
    "x": 0.3, "y": 0.3, "z": 0.05, "phi": 0.005, "theta": 0.003, "psi": 0.005,
    "u": 0.02, "p": 0.005, "q": 0.003, "r": 0.003,
}  # fmt: skip
MANOEUVRES = (
    "zigzag:20/20,duration=45", "turn:15,duration=40", "vzigzag:5/5,duration=45", "vzigzag:8/8,duration=45",
)  # fmt: skip
FINS = tuple(replace(f, at=(AFT, ARM * np.sign(f.at[1]), ARM * np.sign(f.at[2]))) for f in X)
# what the vehicle has beyond the simulator: every fin is another one, and so is the damping
FORCES, DAMPING = (1.15, 0.9, 1.05, 0.85), {"Y_v": 1.2, "N_r": 0.85, "M_q": 1.2, "Z_w": 0.85}


@pytest.fixture(scope="module")
def model():
    return build_model(with_fins(FINS), 6)


@pytest.fixture(scope="module")
def right(model) -> Trial:
    other = with_fins(replace(f, F_uu=k * f.F_uu) for f, k in zip(FINS, FORCES, strict=True))
    rows = {name: c * DAMPING.get(name, 1.0) for name, c in other.coef.items()}
    runs = bayesid.simulate(replace(other, coef=rows), *MANOEUVRES, noise=NOISE, seed=2).runs
    return Trial("x", Path("."), "x", 6, tuple(thinned(run) for run in runs), noise=NOISE)


def thinned(run, every=10):
    """A run of so many steps fewer, for a quick test."""
    groups = {g: {k: v[::every] for k, v in getattr(run, g).items()} for g in ("data", "commands")}
    return replace(run, t=run.t[::every], **groups)


def spoilt(trial: Trial, correction: Correction) -> Trial:
    return replace(trial, runs=tuple(apply(correction, run) for run in trial.runs))


def reversed_fins(*names: str) -> Correction:
    return Correction(scale={f"delta_{name}{end}": -1.0 for name in names for end in ("", "_cmd")})


def exchanged_fins(a: str, b: str) -> Correction:
    return Correction(exchange=tuple((f"delta_{a}{end}", f"delta_{b}{end}") for end in ("", "_cmd")))


def test_a_right_log_has_no_mistake_and_says_what_was_asked(right, model):
    check = check_trial(right, model)
    assert check.findings == ()
    assert "side to which fins 1, 2, 3 and 4 push" in check.in_order
    assert "which fin is which" not in check.in_order
    # these two obey rudder and planes alike: only an order to roll tells them apart
    assert any("fins 1 and 4 or fins 2 and 3 are exchanged" in text for text in check.unseen)


@pytest.mark.parametrize(
    ("correction", "name"),
    [
        (reversed_fins("2"), "sign of delta_2"),
        (exchanged_fins("1", "2"), "delta_1 and delta_2 exchanged"),
        (reversed_fins("1", "2", "3", "4"), "sign of delta_1, delta_2, delta_3, delta_4"),
    ],
)
def test_a_spoilt_log_is_told_with_the_mend_that_undoes_it(right, model, correction, name):
    check = check_trial(spoilt(right, correction), model)
    (found,) = check.findings
    assert found.name == name and found.probability > 0.95
    assert not any("push" in text for text in check.in_order)
    for run, mended in zip(right.runs, spoilt(spoilt(right, correction), found.correction).runs, strict=True):
        for channel, values in run.commands.items():
            np.testing.assert_array_equal(mended.commands[channel], values)


def test_where_no_fin_dives_each_exchange_and_the_planes_stay_open(right, model):
    turns = right.runs[:2]
    told, untold = shown(model, turns)
    assert "which fin is which" in untold and "which fin is which" not in told
    assert shown(model, ()) == ((), ())


def test_a_fin_that_rests_is_not_said_to_be_in_order(right, model):
    runs = [
        replace(run, commands={**run.commands, "delta_3_cmd": 0.0 * run.commands["delta_3_cmd"]})
        for run in right.runs
    ]
    told, untold = shown(model, runs)
    assert any("push" in text and "3" in text for text in untold)
    assert not any("push" in text and "3" in text for text in told)


def test_the_density_is_largest_as_expected_and_knows_no_turn_without_orders(right, model):
    fins = single_fins(model)
    turned = reversed_fins("1", "2", "3", "4")
    for run in right.runs:
        assert fins_density(model, run, fins) < 0.0
        if "zigzag" in run.manoeuvre:
            wrong = fins_density(model, apply(turned, run), fins)
            assert wrong < fins_density(model, run, fins) - 3.0
    still = {name: 0.0 * values if "delta" in name else values for name, values in run.commands.items()}
    assert fins_density(model, replace(run, commands=still), fins) is None


def test_which_fins_are_asked_and_of_what():
    assert single_fins(build_model(with_fins(FINS), 6)) == tuple(f"delta_{k}" for k in "1234")
    assert single_fins(build_model(without_fins(), 6)) == ()
    assert single_fins(build_model(with_fins(FINS), 3)) == ()
    upright = with_fins(CROSS[:2])  # they only steer: asked as rudders
    assert single_fins(build_model(upright, 6)) == ()
    names = [m.name for m in mistakes_of_fins(build_model(with_fins(CROSS), 6))]
    assert {"sign of delta_1", "sign of delta_3, delta_4", "delta_2 and delta_3 exchanged"} <= set(names)
    assert len(names) == len(set(names))
