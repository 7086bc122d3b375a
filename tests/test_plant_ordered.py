"""Any manoeuvre executed by the plant: the same track as the plant's own words for it, and what it cannot
do."""

import math
from dataclasses import replace

import numpy as np
import pytest

from bayesid.benchmark.plant import draw_campaign, execute_campaign, ordered_run, still
from bayesid.errors import ManoeuvreError
from bayesid.manoeuvres import ClosedLoop, OpenLoop, coast_down, vertical_zigzag
from bayesid.manoeuvres.laws import ZigzagLaw
from bayesid.trials import load_trial


@pytest.fixture(scope="module")
def campaign():
    """A lauv with a compass that is wrong, so that a law that sees the truth would steer otherwise."""
    return draw_campaign(31, vehicle="lauv", effects=("compass_deviation",), sea="calm", sizes=(1.0, 1.0))


def executed(campaign, *runs):
    return execute_campaign(
        replace(campaign, runs=tuple(replace(r, name=f"r{k}") for k, r in enumerate(runs)))
    )


def test_a_table_gives_the_track_of_the_plants_own_run_of_the_same_orders(campaign):
    calm = still(campaign)
    turn = next(r for r in calm.runs if r.kind == "turn")
    own = executed(calm, turn).runs[0]
    orders = {"delta_r_cmd": own.commands["delta_r_cmd"], "n_cmd": own.commands["n_cmd"]}
    again = executed(calm, ordered_run(OpenLoop("turn", own.t + 5.0, orders), turn, "r1")).runs[0]
    assert again.t == pytest.approx(own.t)
    assert np.array_equal(again.track.states, own.track.states)


def test_a_law_sees_the_compass_and_steers_like_the_plants_own_zigzag(campaign):
    zigzag = next(r for r in campaign.runs if r.kind == "zigzag")
    law = ZigzagLaw(zigzag.first * zigzag.rudder, zigzag.switch, zigzag.approach)
    start = {"delta_r_cmd": 0.0, "n_cmd": zigzag.rpm}
    ordered = ordered_run(ClosedLoop("mine", zigzag.duration, 0.01, start, law), zigzag, "r1")
    own, mine = (executed(campaign, r).runs[0] for r in (zigzag, ordered))
    assert np.array_equal(mine.commands["delta_r_cmd"], own.commands["delta_r_cmd"])
    assert np.array_equal(mine.track.states, own.track.states)
    assert {k: v.tobytes() for k, v in mine.data.items()} == {k: v.tobytes() for k, v in own.data.items()}


def test_a_run_added_at_the_end_leaves_the_others_as_they_were_and_has_noise_of_its_own(campaign):
    zigzag = next(r for r in campaign.runs if r.kind == "zigzag")
    one, two = executed(campaign, zigzag), executed(campaign, zigzag, zigzag)
    assert np.array_equal(one.runs[0].data["psi"], two.runs[0].data["psi"], equal_nan=True)
    assert np.nanstd(two.runs[1].data["psi"] - two.runs[0].data["psi"]) > 0


def test_orders_between_two_samples_are_given_at_the_next_one_and_rpm_stops(campaign):
    zigzag = next(r for r in campaign.runs if r.kind == "zigzag")
    dt, rpm = zigzag.dt, 900.0
    run = ordered_run(coast_down(approach=10.1 * dt, duration=50.2 * dt, rpm=rpm, dt=0.1 * dt), zigzag, "r1")
    found = executed(still(campaign), run).runs[0]
    assert found.plan.rpm == rpm and found.t[-1] == pytest.approx(60 * dt)
    assert np.array_equal(found.commands["n_cmd"][:-1], np.where(np.arange(60) < 11, rpm, 0.0))
    speed = found.track.states[:, 6]
    assert speed[-1] < 0.7 * speed[0]


def test_planes_are_the_planesmans_unless_the_manoeuvre_orders_them():
    campaign = still(draw_campaign(5, vehicle="nps_auv2", dof=6, effects=(), sea="still"))
    like = campaign.runs[0]
    plane = math.radians(4.0)
    up_and_down = vertical_zigzag(
        plane=plane, switch=math.radians(2.0), approach=5.0, duration=40.0, executes=3, rpm=like.rpm, dt=0.1
    )
    rudder_only = OpenLoop("straight on", [0.0, 40.0], {"delta_r_cmd": [0.0, 0.0]})
    runs = executed(campaign, ordered_run(up_and_down, like, "r1"), ordered_run(rudder_only, like, "r2")).runs
    assert set(np.round(np.degrees(runs[0].commands["delta_s_cmd"]), 3)) == {-4.0, 0.0, 4.0}
    depth = runs[1].track.states[:, 2]
    assert np.ptp(depth) < 0.1 * campaign.vehicle.L
    assert runs[1].commands["n_cmd"] == pytest.approx(like.rpm)


@pytest.mark.parametrize("manoeuvre, words", [
    (OpenLoop("dive", [0.0, 50.0], {"delta_b_cmd": [0.1, 0.1]}), "bow planes"),
    (OpenLoop("blink", [0.0, 0.01], {"delta_r_cmd": [0.1, 0.1]}), "first sample"),
])  # fmt: skip
def test_what_the_plant_cannot_execute_is_refused(campaign, manoeuvre, words):
    with pytest.raises(ManoeuvreError, match=words):
        ordered_run(manoeuvre, campaign.runs[0], "r1")


def test_a_bundle_with_an_ordered_run_loads(campaign, tmp_path):
    from bayesid.benchmark.plant import write_bundle

    zigzag = next(r for r in campaign.runs if r.kind == "zigzag")
    table = OpenLoop("by hand", [0.0, 10.0, 30.0], {"delta_r_cmd": [0.0, 0.1, -0.1]})
    runs = (replace(zigzag, name="r1"), ordered_run(table, zigzag, "r2"))
    write_bundle(replace(campaign, runs=runs), tmp_path / "pond")
    trial = load_trial(tmp_path / "pond")
    assert [r.manoeuvre for r in trial.runs] == [zigzag.manoeuvre, "by hand"]
    cmd = trial.runs[1].commands["delta_r_cmd"]
    assert cmd[0] == 0.0 and cmd[-2] == pytest.approx(0.1, abs=2e-5)
