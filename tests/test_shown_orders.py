"""Figures show the orders a vehicle has, whatever its actuators are called."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure
from thruster_plants import boat_trial

from bayesid.report import import_figure, manoeuvre_figures
from bayesid.report.shown_orders import shown_orders

T = np.arange(4.0)


def test_orders_come_in_degrees_and_rpm_with_the_side_they_turn_to():
    found = shown_orders({
        "n_port_cmd": 300.0 + T, "delta_r_cmd": np.radians(10.0) * np.ones(4), "azimuth_bow_cmd": 0.1 * T,
        "n_cmd": np.zeros(4), "u": T,
    })  # fmt: skip
    assert [(o.label, o.unit, o.moves) for o in found] == [
        ("rudder order (port +)", "deg", False),
        ("speed of thruster port", "rpm", True),
        ("direction of thruster bow", "deg", True),
    ]
    np.testing.assert_allclose(found[0].values, 10.0)
    assert shown_orders({"n_stbd_cmd": np.full(4, np.nan)}) == ()


def test_a_design_for_a_boat_of_two_thrusters_shows_both():
    states = {"x": T, "y": T}
    figure = manoeuvre_figures.orders(T, {"n_port_cmd": 300 + T, "n_stbd_cmd": 300 - T}, states)
    assert [a.get_ylabel() for a in figure.axes[:2]] == [
        "speed of thruster port\n[rpm]", "speed of thruster stbd\n[rpm]",
    ]  # fmt: skip
    assert len(manoeuvre_figures.orders(T, {}, states).axes) > 0


@pytest.mark.parametrize("rudder", ["", "port", "starboard"])
def test_the_pictures_of_imported_runs_draw_thrusters_where_nothing_turns(rudder):
    run = boat_trial().runs[0]
    if rudder:
        run = replace(run, measured_inputs={"delta_r": np.sin(run.t)})
    axes = Figure().subplots()
    import_figure._draw_orders(axes, run, np.ones(run.t.size, bool), rudder or "port")
    there = {line.get_label() for ax in axes.figure.axes for line in ax.lines}
    if rudder:
        assert there == {f"rudder ({rudder} +) [deg]"}
    else:
        assert there == {"speed of thruster port [rpm]", "speed of thruster stbd [rpm]"}
