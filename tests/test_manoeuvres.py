"""Manoeuvres: shapes stated in words, signal theory, command tables and the text a user types."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import max_len_seq

from bayesid import manoeuvres as man
from bayesid.errors import ManoeuvreError
from bayesid.manoeuvres import signals
from bayesid.manoeuvres.catalogue import REGISTRY
from bayesid.manoeuvres.registry import degrees_of_freedom

DEG = math.pi / 180
BOAT = man.Scale(L=102.0, U=5.4, rpm=60.0, max_rudder=35 * DEG, dof=6)


def test_paper_spiral_starts_at_five_degrees_and_ends_at_thirty_to_starboard():
    m = man.spiral()
    assert m.t.size == 6001 and m.t[-1] == 600.0 and m.t[1] == 0.1
    rudder = m.commands["delta_r_cmd"] / DEG
    assert (rudder[:100] == 0).all() and rudder[100] == pytest.approx(-5) and rudder[-1] == pytest.approx(-30)
    assert np.diff(rudder[100:]) == pytest.approx(-25 / 5900, rel=1e-6)
    assert (m.commands["n_cmd"] == 90).all()


def test_dieudonne_spiral_passes_every_angle_both_ways_and_the_end_once():
    m = man.dieudonne(60, hold=10.0, approach=5.0, dt=0.1)
    rudder = m.commands["delta_r_cmd"]
    steps = rudder[np.r_[0, np.flatnonzero(np.diff(rudder)) + 1]] / DEG
    expected = [
        0,
        15,
        10,
        5,
        3,
        2,
        1,
        0,
        -1,
        -2,
        -3,
        -5,
        -10,
        -15,
        -10,
        -5,
        -3,
        -2,
        -1,
        0,
        1,
        2,
        3,
        5,
        10,
        15,
    ]
    assert steps == pytest.approx(expected)


def test_turn_orders_the_rudder_exactly_after_the_approach():
    m = man.turn(-20 * DEG, 60, approach=10.0, duration=30.0, dt=0.1)
    first = np.flatnonzero(m.commands["delta_r_cmd"])[0]
    assert m.t[first] == pytest.approx(10.0) and m.duration == pytest.approx(40.0)


def state(psi=0.0, theta=0.0, z=0.0, q=0.0):
    out = np.zeros(12)
    out[2], out[4], out[5], out[10] = z, theta, psi, q
    return out


def test_zigzag_to_port_waits_for_the_heading_to_fall_before_it_reverses():
    control = man.zigzag(10 * DEG, 5 * DEG, 60, approach=1.0, duration=9.0, dt=0.1, executes=2).controller()
    headings = [
        (0.0, 0, 0),
        (1.0, 0, 10),
        (2.0, 6, 10),
        (3.0, -4.9, 10),
        (4.0, -5.1, -10),
        (5.0, 4, -10),
        (6.0, 5.1, 0),
    ]
    for t, psi, expected in headings:
        assert control(t, state(psi=(psi + 300) * DEG))["delta_r_cmd"] / DEG == pytest.approx(expected), t


def test_every_run_of_a_closed_loop_starts_without_memory():
    m = man.zigzag(10 * DEG, 5 * DEG, 60, 0.0, 9.0, 0.1)
    first = [m.controller()(0.0, state(psi=2.0))["delta_r_cmd"] for _ in range(2)]
    assert first == [10 * DEG, 10 * DEG]


def test_planesman_puts_the_planes_to_dive_when_too_shallow_and_to_rise_when_too_deep():
    m = man.depth_change(30.0, 60, 5.0, 60.0, 0.1, 300.0, 15 * DEG, 20 * DEG)
    control = m.controller()
    assert control(0.0, state(z=50.0))["delta_s_cmd"] == 0.0
    assert control(5.0, state(z=50.0))["delta_s_cmd"] > 0  # positive plane: bow down
    assert control(6.0, state(z=95.0))["delta_s_cmd"] < 0
    assert control(7.0, state(z=80.0, theta=-0.2))["delta_s_cmd"] < 0  # at depth, bow down: level out
    assert control(8.0, state(z=-1e6))["delta_s_cmd"] <= 20 * DEG


def test_mirror_flips_rudder_only_and_twice_is_the_identity():
    for m in man.library(102.0, 5.4, 60.0, 35 * DEG, dof=6).values():
        other = man.mirrored(m)
        for s in (state(), state(psi=1.0, theta=0.1, z=3.0)):
            if isinstance(m, man.OpenLoop):
                a, b = m.commands, other.commands
            else:
                a, b = (
                    m.controller()(200.0, s),
                    other.controller()(200.0, s * np.where(np.arange(12) == 5, -1, 1)),
                )
            for channel in a:
                sign = -1 if channel == "delta_r_cmd" else 1
                np.testing.assert_array_equal(sign * np.asarray(b[channel]), a[channel])
        assert man.describe(man.mirrored(other))["name"] == man.describe(m)["name"]


@pytest.mark.parametrize("order", sorted(signals.TAPS))
def test_shift_register_visits_every_state_once(order):
    bits = signals.maximum_length_sequence(order, seed=1)
    assert bits.size == 2**order - 1 and set(bits) == {-1.0, 1.0}
    # one more +1 than -1, and the autocorrelation is -1 at every lag but zero (Golomb)
    assert bits.sum() == 1
    correlation = np.fft.irfft(np.abs(np.fft.rfft(bits)) ** 2, bits.size)
    assert correlation[0] == pytest.approx(bits.size) and correlation[1:] == pytest.approx(-1, abs=1e-6)


def test_shift_register_has_the_statistics_of_the_scipy_sequence():
    ours = np.abs(np.fft.rfft(signals.maximum_length_sequence(8)))
    theirs = np.abs(np.fft.rfft(2.0 * max_len_seq(8)[0] - 1))
    np.testing.assert_allclose(ours, theirs, atol=1e-9)


def test_prbs_has_two_levels_changes_on_its_clock_only_and_repeats_for_a_seed():
    m = man.prbs(10 * DEG, clock=3.0, rpm=60, duration=180.0, dt=0.1, seed=4)
    rudder = m.commands["delta_r_cmd"]
    assert set(np.round(rudder / DEG, 9)) == {-10.0, 10.0}
    changes = m.t[1:][np.diff(rudder) != 0] / 3.0
    assert changes == pytest.approx(np.round(changes), abs=1e-9)
    np.testing.assert_array_equal(rudder, man.prbs(10 * DEG, 3.0, 60, 180.0, 0.1, 4).commands["delta_r_cmd"])
    assert (rudder != man.prbs(10 * DEG, 3.0, 60, 180.0, 0.1, 5).commands["delta_r_cmd"]).any()


def test_multisine_has_power_on_its_harmonics_only_and_a_low_crest():
    m = man.multisine(20 * DEG, 0.01, 0.2, 60, duration=500.0, dt=0.1, seed=2, count=30)
    rudder = m.commands["delta_r_cmd"]
    power = np.abs(np.fft.rfft(rudder[:-1])) ** 2
    on = np.array(m.parameters["harmonics"])
    assert power[on].sum() == pytest.approx(power.sum(), rel=1e-12)
    assert power[on] == pytest.approx(power[on].mean(), rel=1e-9)
    assert np.abs(rudder).max() == pytest.approx(20 * DEG)
    # random phases of 30 sines give 2.5 to 3.5, Schroeder's about 1.7
    assert m.parameters["crest"] < 2.0
    k, t = on, m.t
    assert m.parameters["crest"] < 0.85 * signals.crest_factor(
        signals.multisine(t, k, 500.0, seed=2, rounds=0)
    )


def test_combined_inputs_are_uncorrelated_over_the_run():
    m = man.combined(15 * DEG, 8 * DEG, 0.001, 0.02, 60, 1500.0, 0.5, seed=1, rpm_swing=0.1)
    columns = np.array([m.commands[c][:-1] for c in ("delta_r_cmd", "delta_s_cmd", "n_cmd")])
    assert np.abs(np.corrcoef(columns) - np.eye(3)).max() < 1e-9


def test_chirp_crosses_zero_as_often_as_its_mean_frequency_says():
    t = np.arange(0, 1000, 0.01)
    for log, mean in ((True, (0.1 - 0.01) / math.log(10)), (False, 0.055)):
        wave = signals.chirp(t, 0.01, 0.1, log)
        assert abs(np.sum(np.diff(np.sign(wave)) != 0) - 2 * mean * 1000) <= 2


def test_random_rudder_stays_within_its_holds_and_amplitude():
    m = man.random_rudder(20 * DEG, 5.0, 30.0, 60, 1000.0, 0.1, seed=3)
    rudder = m.commands["delta_r_cmd"]
    assert np.abs(rudder).max() <= 20 * DEG
    holds = np.diff(m.t[1:][np.diff(rudder) != 0])
    assert holds.min() >= 4.9 and holds.max() <= 30.1


def test_commands_are_held_not_interpolated():
    m = man.OpenLoop("x", [0.0, 1.0, 2.5], {"n_cmd": [1.0, 2.0, 3.0]})
    assert list(man.held(m, [-1.0, 0.0, 0.99, 1.0, 2.4, 2.5, 9.0])["n_cmd"]) == [1, 1, 1, 2, 2, 3, 3]
    grid = man.on_grid(m, 0.1)
    assert grid.t.size == 26 and (grid.commands["n_cmd"][:10] == 1).all() and grid.commands["n_cmd"][10] == 2


def test_manoeuvre_cannot_be_changed_after_it_is_made():
    m = man.straight(60, 10, 1)
    with pytest.raises(ValueError):
        m.commands["n_cmd"][0] = 5
    with pytest.raises(TypeError):
        m.commands["n_cmd"] = 5


def test_open_loop_reports_all_its_problems_at_once():
    with pytest.raises(ManoeuvreError) as err:
        man.OpenLoop("x", [0, 1, 1], {"rudder": [1, 2, 3], "n_cmd": [1, 2], "delta_r_cmd": [0, np.nan, 0]})
    for part in ("row 2", "rudder is not a command", "n_cmd has shape", "not finite at row 1"):
        assert part in str(err.value)


# Text


@pytest.mark.parametrize("name", sorted(set(REGISTRY) - {"table"}))
def test_every_named_manoeuvre_is_made_for_a_submarine_and_a_small_auv(name):
    for scale in (BOAT, man.Scale(1.33, 1.54, 1500, 13.6 * DEG, dof=6)):
        m = man.parse(name, scale)
        assert m.duration >= 20 * scale.LU
        about = man.describe(m)
        assert about["channels"] and about["parameters"]
        if isinstance(m, man.OpenLoop):
            assert np.abs(m.commands["delta_r_cmd"]).max() <= scale.max_rudder * (1 + 1e-12)


def test_positional_values_options_units_and_sides_are_read():
    m = man.parse("zigzag:20/10,side=starboard,duration=30LU,dt=0.5", BOAT)
    assert m.controller.deflection == pytest.approx(-20 * DEG) and m.controller.switch == pytest.approx(
        10 * DEG
    )
    assert m.duration == pytest.approx((30 + 4) * BOAT.LU) and m.dt == 0.5
    assert man.parse("turn:35", BOAT).commands["delta_r_cmd"].max() == pytest.approx(35 * DEG)
    assert man.parse("turn:0.1rad", BOAT).commands["delta_r_cmd"].max() == pytest.approx(0.1)
    assert man.parse("prbs:seed=3", BOAT).parameters["seed"] == 3
    assert man.parse("depth:2L", BOAT).parameters["change"] == pytest.approx(204)


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("zigzg:10/10", "did you mean zigzag"),
        ("turn:side=left", "expected port or starboard"),
        ("zigzag:10/10/5", "3 values where 2 fit"),
        ("prbs:sead=3", "did you mean seed"),
        ("prbs:seed=1,seed=2", "given twice"),
        ("turn:50", "beyond the limit of 35 deg"),
        ("turn:thirty", "expected a number"),
        ("zigzag:10/-10", "switch angle must be positive"),
        ("turn:duration=inf", "expected a number"),
        ("table", "path is missing"),
        ("turn:dt=0", "positive step"),
    ],
)
def test_wrong_text_says_what_is_wrong(text, part):
    with pytest.raises(ManoeuvreError, match=part):
        man.parse(text, BOAT)


def test_depth_change_needs_six_degrees_of_freedom():
    with pytest.raises(ManoeuvreError, match="6-DOF"):
        man.parse("depth", man.Scale(1, 1, 1000, 0.3))


@settings(max_examples=300, deadline=None)
@given(
    st.one_of(
        st.text(max_size=60),
        st.builds(
            lambda name, parts: name + ":" + ",".join(parts),
            st.sampled_from(sorted(REGISTRY)),
            st.lists(
                st.builds(
                    lambda key, value: f"{key}={value}",
                    st.sampled_from(
                        [
                            "rudder",
                            "side",
                            "duration",
                            "dt",
                            "seed",
                            "clock",
                            "f0",
                            "f1",
                            "count",
                            "rpm",
                            "hold",
                            "switch",
                            "rpms",
                            "path",
                            "lookahead",
                            "executes",
                        ]
                    ),
                    st.one_of(
                        st.text(max_size=8), st.floats(width=16).map(str), st.integers(-3, 40).map(str)
                    ),
                ),
                max_size=4,
            ),
        ),
    )
)
def test_any_text_gives_a_manoeuvre_or_one_clear_message(text):
    try:
        assert man.parse(text, man.Scale(1.0, 1.0, 100.0, 0.5, dof=6, dt=0.5)).duration > 0
    except ManoeuvreError as err:
        assert str(err)


# Tables


def test_table_written_and_read_again_is_the_same_history(tmp_path):
    m = man.combined(15 * DEG, 8 * DEG, 0.01, 0.2, 60, 100.0, 0.5, seed=1)
    again = man.read_table(man.write_table(m, tmp_path / "rich.csv"))
    np.testing.assert_array_equal(again.t, m.t)
    for channel, values in m.commands.items():
        np.testing.assert_allclose(again.commands[channel], values, rtol=4e-16)


def test_table_keeps_only_rows_that_change_and_the_end(tmp_path):
    m = man.turn(20 * DEG, 60, 10.0, 30.0, 0.1)
    path = man.write_table(m, tmp_path / "turn.csv")
    assert len(path.read_text().splitlines()) == 4
    again = man.on_grid(man.read_table(path), 0.1)
    np.testing.assert_allclose(again.commands["delta_r_cmd"], m.commands["delta_r_cmd"], rtol=4e-16)


def test_table_units_signs_and_missing_values(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("t[min],delta_r[deg],n_cmd[1/s],Depth (m)\n0,10,2,5\n1,,2,5\n\n2,-10,,5\n")
    m = man.read_table(path, rudder_positive="starboard")
    assert list(m.t) == [0, 60, 120]
    assert m.commands["delta_r_cmd"] == pytest.approx(np.array([-10, -10, 10]) * DEG)
    assert list(m.commands["n_cmd"]) == [120, 120, 120]
    assert m.parameters["ignored"] == ("Depth (m)",)
    assert man.parse(f"table:{path}", BOAT).name == "log"


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("", "at least two"),
        ("t[s],n_cmd[rpm]\n0,1\n", "1 rows below the header"),
        ("time[s],n_cmd[rpm]\n0,1\n1,1\n", r"no column t\[s\]"),
        ("t[s],n[rpm],n[rpm]\n0,1,1\n1,1,1\n", "appears twice"),
        ("t[s],delta_r_cmd\n0,1\n1,1\n", "has no unit"),
        ("t[s],delta_r_cmd[rpm]\n0,1\n1,1\n", "unit 'rpm'"),
        ("t[s],x[m]\n0,1\n1,1\n", "no command column"),
        ("t[s],n_cmd[rpm]\n0,1\n1,fast\n", "line 3: n_cmd is 'fast'"),
        ("t[s],n_cmd[rpm]\n0,1\n0,2\n", "does not increase at row 1"),
        ("t[s],n_cmd[rpm]\n0,\n1,2\n", "line 2: n_cmd is missing"),
        ("t[s],n_cmd[rpm]\n0,1\n,2\n", "line 3: t is missing"),
        ("t[s],n_cmd[rpm]\n0,1\n1,inf\n", "infinite"),
    ],
)
def test_wrong_table_says_what_is_wrong(tmp_path, text, part):
    path = tmp_path / "commands.csv"
    path.write_text(text)
    with pytest.raises(ManoeuvreError, match=part):
        man.read_table(path)


def test_missing_table_is_one_clear_message(tmp_path):
    with pytest.raises(ManoeuvreError, match="cannot be read"):
        man.read_table(tmp_path / "nowhere.csv")
    with pytest.raises(ManoeuvreError, match="not a regular file"):
        man.read_table(tmp_path)


@settings(max_examples=200, deadline=None)
@given(
    st.one_of(
        st.binary(max_size=200),
        st.lists(
            st.lists(
                st.sampled_from(
                    [
                        "t[s]",
                        "n_cmd[rpm]",
                        "delta_r_cmd[deg]",
                        "delta_r[rad]",
                        "0",
                        "1",
                        "2",
                        "-1e308",
                        "nan",
                        "",
                        "x",
                        "1e999",
                        '"',
                        "\x00",
                    ]
                ),
                max_size=4,
            ).map(",".join),
            max_size=6,
        )
        .map("\n".join)
        .map(str.encode),
    )
)
def test_any_bytes_give_a_table_or_one_clear_message(tmp_path_factory, content):
    path = tmp_path_factory.getbasetemp() / "any.csv"
    path.write_bytes(content)
    try:
        assert man.read_table(path).duration > 0
    except ManoeuvreError as err:
        assert "any.csv" in str(err)


def test_a_spiral_whose_steps_are_not_held_is_refused_in_one_sentence():
    with pytest.raises(ManoeuvreError, match="held for 0 s; give a positive hold"):
        man.parse("dieudonne:hold=0", man.Scale(1.0, 1.0, 100.0, 0.5, dof=6, dt=0.5))


def test_what_is_ordered_is_said_in_degrees_hertz_and_revolutions():
    """0.02 to 0.4 Hz swept with 0.1745 rad: periods of 50 to 2.5 s and 10 degrees."""
    chirp = man.parse(
        "chirp:10,f0=0.02,f1=0.4,rpm=1200,rpm_factors=1/0.5", man.Scale(2.0, 1.5, 1500.0, 0.3, 0.3)
    )
    assert man.order_words(chirp) == (
        "rudder up to 10 degrees to either side, 0.02 to 0.4 Hz (periods of 50 to 2.5 s), shaft at 1200 rpm "
        "times 1, 0.5 in turn"
    )
    turn = man.parse("turn:15,side=starboard", man.Scale(2.0, 1.5, 1500.0, 0.3, 0.3))
    assert man.order_words(turn) == "rudder 15 degrees to starboard, shaft at 1500 rpm"
    coast = man.parse("coast", man.Scale(2.0, 1.5, 1500.0, 0.3, 0.3))
    assert man.order_words(coast) == "shaft at 1500 rpm, then stopped"


@pytest.mark.parametrize("name", man.LIBRARY)
def test_every_manoeuvre_that_may_be_proposed_says_what_is_ordered_and_how_it_is_typed(name):
    sized = man.library(2.0, 1.5, 1500.0, 0.4, dof=6)
    said = man.order_words(sized[name])
    assert "rpm" in said and not set(said) & set("{}[]")
    # a fin that moves is told, but by the laws that hold depth, whose name says what they do
    rudders = "delta_r_cmd" in getattr(sized[name], "commands", {})
    moves = rudders and np.ptp(sized[name].commands["delta_r_cmd"]) > 0.0
    assert ("rudder" in said) == moves or "first" in said or name == "combinedheld"
    assert type(man.parse(man.LIBRARY[name], man.Scale(2.0, 1.5, 1500.0, 0.4, 0.4, 6))) is type(sized[name])


def test_manoeuvres_that_leave_the_horizontal_plane_need_six_degrees_of_freedom():
    assert degrees_of_freedom(["turn:20", "zigzag:10/10,side=port"]) == 3
    assert degrees_of_freedom(["turn:20", " VZIGZAG:8 "]) == 6
    assert degrees_of_freedom(["vzigzag,plane=5"]) == 6
    assert degrees_of_freedom([]) == degrees_of_freedom(["no such thing"]) == 3
