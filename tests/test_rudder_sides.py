"""A rudder logged with the other sign in one run is told; a helmsman who answers the waves is not."""

from dataclasses import replace

import numpy as np
import pytest

from bayesid.trials import Run
from bayesid.trials.consistency import check_rudder
from bayesid.trials.correction import apply
from bayesid.trials.health import check_runs
from bayesid.trials.mistakes import check_input
from bayesid.trials.rudder_sides import LEAST_RUDDER, PLAIN, other_side
from tests.test_log_mistakes import weave

KEY = "delta_r_cmd"


def moved(run: Run, rudder: np.ndarray) -> Run:
    return replace(run, commands={**run.commands, KEY: rudder})


def mirrored(run: Run) -> Run:
    return moved(run, -run.commands[KEY])


def circle(name: str, rudder: float, seed: int = 0) -> Run:
    """A first-order turn after 20 s on a straight course, to the side of minus the rudder."""
    rng = np.random.default_rng(seed)
    t = 0.2 * np.arange(700)
    ordered = np.where(t > 20.0, rudder, 0.0)
    r = -0.8 * rudder * np.where(t > 20.0, 1.0 - np.exp(-(t - 20.0) / 4.0), 0.0)
    psi = np.concatenate(([0.0], np.cumsum(0.5 * (r[1:] + r[:-1]) * 0.2)))
    data = {"psi": psi + 0.003 * rng.standard_normal(t.size), "r": r + 0.002 * rng.standard_normal(t.size)}
    return Run(name, "", "identify", t, data, {KEY: ordered})


def in_waves(name: str, gain: float, seed: int = 0) -> Run:
    """A course held in waves: yaw by the waves alone, which a helmsman answers by `gain` times the rate."""
    rng = np.random.default_rng(seed)
    t = 0.2 * np.arange(900)
    phase = 2 * np.pi * rng.random(3)
    r = sum(0.02 * np.sin(w * t + f) for w, f in zip((0.5, 0.63, 0.71), phase, strict=True))
    psi = np.concatenate(([0.0], np.cumsum(0.5 * (r[1:] + r[:-1]) * 0.2)))
    data = {"psi": psi + 0.0005 * rng.standard_normal(t.size), "r": r + 0.0005 * rng.standard_normal(t.size)}
    return Run(name, "", "identify", t, data, {KEY: gain * data["r"]})


def others() -> list[Run]:
    return [replace(weave(k), name=f"weave{k}") for k in range(3)] + [circle("port", 0.4, 4)]


@pytest.mark.parametrize("spoilt", ["weave1", "port"])
def test_the_run_with_the_other_sign_is_told_with_its_mend(spoilt):
    right = others()
    assert other_side(right) == () and check_input(right).findings == ()
    wrong = [mirrored(run) if run.name == spoilt else run for run in right]
    (found,) = check_input(wrong).findings
    assert found.runs == (spoilt,) and not found.all_runs and found.probability > 0.99
    assert "sign of the rudder" in check_input(right).in_order
    assert "sign of the rudder" not in check_input(wrong).in_order
    assert check_input([apply(found.correction, run) for run in wrong]).findings == ()
    (warned,) = [text for text in check_runs(wrong) if text.startswith("rudder sign")]
    assert (
        f"in {spoilt} positive" in warned
        and f'runs = ["{spoilt}"]' in warned
        and "delta_r_cmd = -1" in warned
    )


def test_a_log_that_counts_starboard_positive_in_all_runs_has_none_on_the_other_side():
    every = [mirrored(run) for run in others()]
    assert other_side(every) == ()
    assert other_side([mirrored(every[0]), *every[1:]]) == (every[0].name,)


def test_a_helmsman_who_answers_the_waves_is_not_on_the_other_side():
    """His rudder goes against the turn, as if it made it on the other side; it is small."""
    held = in_waves("held", 0.5)
    assert check_rudder(held).t_value > PLAIN  # control: by its t value alone it would be told
    largest = np.median([np.abs(run.commands[KEY]).max() for run in others()])
    assert np.abs(held.commands[KEY]).max() < LEAST_RUDDER * largest
    assert other_side([*others(), held]) == ()


def test_two_runs_that_contradict_each_other_tell_no_side():
    pair = [replace(weave(1), name="one"), mirrored(replace(weave(2), name="other"))]
    assert other_side(pair) == ()


def test_a_run_astern_is_not_on_the_other_side():
    """The screw ahead of the rudder: its turn is to the other side, whether a speed says so or the track."""
    run = mirrored(circle("astern", 0.4, 4))
    rest = [replace(weave(k), name=f"weave{k}") for k in range(3)]
    assert other_side([*rest, run]) == ("astern",)  # control: ahead, for all that is known
    backwards = replace(run, data={**run.data, "u_water": np.full(run.t.size, -1.0)})
    assert other_side([*rest, backwards]) == ()
    dt, psi = np.diff(run.t, prepend=run.t[0]), run.data["psi"]
    track = {"x": np.cumsum(-np.cos(psi) * dt), "y": np.cumsum(-np.sin(psi) * dt)}
    assert other_side([*rest, replace(run, data={**run.data, **track})]) == ()
    ahead = {name: -values for name, values in track.items()}
    assert other_side([*rest, replace(run, data={**run.data, **ahead})]) == ("astern",)


def test_a_reading_that_is_the_mirror_image_of_its_order_is_no_run_of_the_other_sign():
    """One of the two is wrong, and the other would be spoilt by a mend of both."""
    read = [replace(run, measured_inputs={"delta_r": run.commands[KEY]}) for run in others()]
    wrong = [
        replace(run, measured_inputs={"delta_r": -run.commands[KEY]}) if run.name == "port" else run
        for run in read
    ]
    assert other_side(read) == () == other_side(wrong)
    whole = [
        replace(mirrored(run), measured_inputs={"delta_r": -run.commands[KEY]}) if run.name == "port" else run
        for run in read
    ]
    assert other_side(whole) == ("port",)
