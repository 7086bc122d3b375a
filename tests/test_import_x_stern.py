"""Logs of a vehicle with fins of an X: read by number or place, named by what the fins make together."""

from __future__ import annotations

import numpy as np
import pytest

import bayesid
from bayesid.trials.importing import propose
from bayesid.trials.importing.cutting import classify
from bayesid.trials.importing.named_actuators import Steering, fin_places, named_guess, steering_of
from bayesid.trials.importing.raw import RawChannel
from tests.test_trial_import import DEG, _table
from tests.test_x_stern import X, fin, with_fins

STERN_X = steering_of(with_fins(X))
BOW_TOO = steering_of(
    with_fins((*X, fin("5", -1, 0, (0.0, 1.0), at=0.6), fin("6", 1, 0, (0.0, 1.0), at=0.6)))
)
PLACES = ("upper port", "upper stbd", "lower port", "lower stbd")


@pytest.mark.parametrize(
    ("name", "unit", "role"),
    [
        ("Fin 1 [deg]", "deg", "delta_1"), ("Fin 4 cmd [deg]", "deg", "delta_4"), ("fin2", None, "delta_2"),
        ("X3", "deg", "delta_3"), ("X-rudder 3 angle", "deg", "delta_3"), ("delta_1", "rad", "delta_1"),
        ("Fin upper port order [deg]", "deg", "delta_1"), ("finLowerStbd", "deg", "delta_4"),
        ("Stern plane lower PS", "deg", "delta_3"), ("Fin 2 upper starboard", "deg", "delta_2"),
        ("Fin port", "deg", None), ("Fin upper", "deg", None), ("Fin 2 upper port", "deg", None),
        ("Fin 5", "deg", None), ("Fin", "deg", None), ("Bow plane order [deg]", "deg", None),
        ("X1", "m", None), ("Fin 1 rate", "deg/s", None), ("Fin 1 [A]", "A", None),
        ("Heading 1", "deg", None), ("Roll upper port", "deg", None),
    ],
)  # fmt: skip
def test_a_fin_is_the_one_whose_number_or_place_its_name_has(name, unit, role):
    found = named_guess(RawChannel(name, np.zeros(3), np.zeros(3), unit), STERN_X)
    assert (found.role if found else None) == role


def test_a_place_that_two_fins_have_is_told_by_the_end_of_the_vehicle():
    for name, role in (("Bow plane port", "delta_5"), ("Fin upper port", "delta_1"), ("Fin port", None)):
        found = named_guess(RawChannel(name, np.zeros(3), np.zeros(3), "deg"), BOW_TOO)
        assert (found.role if found else None) == role


def test_a_fin_in_the_middle_has_no_side():
    inverted_y = {"a": (-2.0, 0.0, -0.3), "b": (-2.0, -0.26, 0.15), "c": (-2.0, 0.26, 0.15)}
    assert {name: sorted(words) for name, words in fin_places(inverted_y).items()} == {
        "a": ["stern", "upper"], "b": ["lower", "port", "stern"], "c": ["lower", "stbd", "stern"],
    }  # fmt: skip
    cross = {"a": (-2.0, 0.0, -0.3), "b": (-2.0, 0.3, 0.0)}
    assert fin_places({**cross, "c": (-2.0, 0.0, 0.3)})["b"] == {"stern", "stbd"}


def test_a_bare_x_without_a_unit_is_asked_about():
    found = named_guess(RawChannel("X1", np.zeros(3), np.zeros(3), None), STERN_X)
    assert found is not None and found.score < 1.0


def log_of(tmp_path, order, heads, name="log.csv", noise=0.05, **more):
    """A log of simulated orders, its fins under four heads."""
    run = bayesid.simulate(with_fins(X), order, noise={}, seed=1).runs[0]
    rng = np.random.default_rng(5)
    data = {k: np.degrees(v) if k in ("psi", "theta") else v for k, v in run.data.items()}
    heads_of = {"x": "north [m]", "y": "east [m]", "z": "depth [m]", "psi": "heading [deg]"}
    columns = {"t [s]": run.t} | {head: data[k] for k, head in heads_of.items() if k in data}
    columns |= {"pitch [deg]": data.get("theta", 0.0 * run.t), "shaft order [rpm]": run.commands["n_cmd"]}
    for k, head in enumerate(heads, 1):
        ordered = np.degrees(run.commands[f"delta_{k}_cmd"])
        columns[f"{head} order [deg]"] = ordered
        columns[f"{head} [deg]"] = ordered + noise * rng.standard_normal(run.t.size)
    columns |= {head: make(run.t, rng) for head, make in more.items()}
    return _table(tmp_path, {"t": run.t}, columns, name)


@pytest.mark.thorough
@pytest.mark.parametrize("heads", [[f"Fin {k}" for k in (1, 2, 3, 4)], [f"Fin {p}" for p in PLACES]])
def test_the_fins_are_read_and_none_is_left_to_ask_for(tmp_path, heads):
    found = propose([log_of(tmp_path, "zigzag:20/20,duration=60", heads)], steering=STERN_X)
    channels = {role: entry.source for role, entry in found.map.channels.items()}
    for k, head in enumerate(heads, 1):
        assert channels[f"delta_{k}"] == f"{head} [deg]"
        assert channels[f"delta_{k}_cmd"] == f"{head} order [deg]"
    assert not [text for text in found.map.questions if "steers" in text]
    lost = propose([log_of(tmp_path, "zigzag:20/20,duration=60", ["Fin port", *heads[1:]])], steering=STERN_X)
    assert any("delta_1_cmd = " in text for text in lost.map.questions)


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("order", "named"),
    [
        ("zigzag:20/20,duration=60", "zigzag 20/20"), ("turn:15,duration=80", "turning circle 15"),
        ("vzigzag:10/5,duration=60", "vertical zigzag 10/5"), ("straight:duration=60", "straight"),
        ("depth:change=8,duration=200,back_after=90", "depth change 8 m"),
    ],
)  # fmt: skip
def test_a_run_is_named_by_what_the_fins_make_together(tmp_path, order, named):
    heads = [f"Fin {p}" for p in PLACES]
    (run,) = propose([log_of(tmp_path, order, heads)], steering=STERN_X).map.runs
    assert run.manoeuvre == named


def test_a_rudder_that_waves_as_a_sine_makes_no_zigzag():
    t = np.arange(0.0, 80.0, 0.1)
    angle = 12.0 * DEG * np.sin(2.0 * np.pi * t / 16.0)
    psi = 0.3 * np.cos(2.0 * np.pi * (t - 1.0) / 16.0)
    assert classify(t, angle, psi) == ("random", "random orders")
    over = 12.0 * DEG * np.sign(angle + 1e-9)
    assert classify(t, over, psi)[0] == "zigzag"


@pytest.mark.parametrize(("size", "rate", "dwell"), [(20, 2.3, 5), (35, 2.5, 8), (20, 3.0, 4), (10, 2.3, 3)])
def test_a_zigzag_of_a_slow_gear_stays_one(size, rate, dwell):
    """Its rudder is on the way most of the time."""
    across = 2.0 * size / rate
    t = np.arange(0.0, 8.0 * (across + dwell), 0.1)
    knots = np.cumsum([0.0, size / rate, *[dwell, across] * 8])
    sides = [0.0, *np.repeat([1.0, -1.0] * 5, 2)[: knots.size - 1]]
    angle = size * DEG * np.interp(t, knots, sides)
    turn = np.cumsum(angle) * 0.1
    psi = -0.1 * (turn - turn.mean())
    assert classify(t, angle, psi)[0] == "zigzag"


def asked_of_a_bow_plane(tmp_path, order, reading) -> list[str]:
    made = {"Bow plane [deg]": reading} | ({"Bow plane order [deg]": order} if order else {})
    log = log_of(tmp_path, "zigzag:20/20,duration=60", [f"Fin {p}" for p in PLACES], **made)
    found = propose([log], steering=STERN_X)
    return [text for text in found.map.questions if "radians?" in text]


def noise(t, rng):
    return 0.05 * rng.standard_normal(t.size)


def waved(t, rng):
    return 0.2 * np.sin(0.4 * t) + noise(t, rng) / 10.0


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("order", "reading", "asks"),
    [
        (lambda t, rng: 0.0 * t, noise, False),  # the order rests: only the noise of the sensor is seen
        (None, noise, False),
        (None, waved, True),
        (lambda t, rng: 0.2 * np.sign(np.sin(0.4 * t)), waved, True),
        (lambda t, rng: 0.0 * t, waved, True),  # the order was not recorded
        (None, lambda t, rng: 0.3 * np.sign(rng.standard_normal(t.size)), True),
        (lambda t, rng: 0.3 + 0.0 * t, lambda t, rng: 0.3 + noise(t, rng), True),  # a turn's order
    ],
)  # fmt: skip
def test_a_plane_at_rest_is_not_asked_whether_it_is_in_radians(tmp_path, order, reading, asks):
    assert bool(asked_of_a_bow_plane(tmp_path, order, reading)) is asks


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("reading", "said"),
    [
        (noise, "delta_b_cmd never changes and is left out"),
        (lambda t, rng: 0.0 * t, "delta_b and delta_b_cmd never change and are left out"),
    ],
)
def test_one_series_that_rests_changes_and_two_change(tmp_path, reading, said):
    made = {"Bow plane order [deg]": lambda t, rng: 0.0 * t, "Bow plane measured [deg]": reading}
    log = log_of(tmp_path, "vzigzag:10/5,duration=60", ["Fin 1", "Fin 2", "Fin 3", "Fin 4"], **made)
    assert [r for r in propose([log], steering=STERN_X).remarks if "left out" in r] == [said]


@pytest.mark.thorough
def test_named_fins_without_a_unit_are_read_by_their_size(tmp_path):
    log = log_of(tmp_path, "zigzag:20/20,duration=60", [f"fin{k}" for k in (1, 2, 3, 4)])
    bare = log.read_text().splitlines()
    bare[0] = bare[0].replace(" order [deg]", " order").replace("fin1 [deg]", "fin1")
    log.write_text("\n".join(bare) + "\n")
    channels = propose([log], steering=STERN_X).map.channels
    assert channels["delta_1_cmd"].unit == channels["delta_1"].unit == "deg"


def test_a_vehicle_with_a_rudder_has_none_of_its_own():
    assert steering_of(bayesid.load_vehicle("remus100")) == Steering()
