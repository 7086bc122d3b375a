"""Cells that hold no reading: codes of a sensor are said, gaps are not bridged in comparisons."""

from __future__ import annotations

import numpy as np
import pytest

from bayesid.trials.importing import propose
from bayesid.trials.importing.agreement import GAP, in_gaps
from bayesid.trials.importing.codes import codes_in
from tests.raw_logs import DEG, motion
from tests.test_trial_import import _table, imported

CODES = (-32.768, 32.767, -32768.0, -9999.0, 99.999, 999.0, 65.535)


def columns_of(truth):
    rng = np.random.default_rng(3)
    return {
        "t [s]": truth["t"],
        "north [m]": truth["x"] + 0.05 * rng.standard_normal(truth["t"].size),
        "east [m]": truth["y"] + 0.05 * rng.standard_normal(truth["t"].size),
        "heading [deg]": np.mod(truth["psi"] / DEG, 360.0), "r [deg/s]": truth["r"] / DEG,
        "u [m/s]": truth["u"], "v [m/s]": truth["v"], "rudder order [deg]": truth["delta_r_cmd"] / DEG,
        "rpm order": truth["n_cmd"],
    }  # fmt: skip


@pytest.mark.parametrize("code", CODES)
def test_a_known_code_is_found_where_it_is_no_reading(code):
    speed = np.random.default_rng(1).uniform(-0.2, 1.7, 500)
    speed[50:61] = code
    assert codes_in(speed) == [code]
    kept = codes_in(speed.astype(np.float32))  # as a logger keeps it in 32 bits
    assert kept == [pytest.approx(code, rel=1e-6)]
    assert codes_in(np.linspace(-1.5, 1.2, 500) * abs(code)) == []  # a number among others


@pytest.mark.parametrize("values", [[0.0, 360.0, 10.0, 99.9, 99.9, 99.9], [1.0, 1.1, 1.2, 1.3, 40.0]])
def test_what_is_no_code_is_left(values):
    assert codes_in(np.array(values)) == []


@pytest.mark.thorough
def test_codes_of_a_dvl_are_said_left_out_and_blame_nothing_else(tmp_path):
    truth = motion(np.random.default_rng(7))
    columns = columns_of(truth)
    clean = propose([_table(tmp_path, truth, columns)])
    columns["u [m/s]"] = columns["u [m/s]"].copy()
    columns["u [m/s]"][900:911] = -32.768
    log = _table(tmp_path, truth, columns)
    found = propose([log])
    assert found.map.questions == clean.map.questions == ()
    assert found.map.channels["u"].missing == (-32.768,) and found.map.channels["v"].missing == ()
    (said,) = [text for text in found.remarks if "missing" in text]
    assert "11 readings of 'u [m/s]' are -32.768, the code of a DVL without bottom lock" in said
    lines = 'world = "ned"\nbody = "frd"\n[sources.log]\nfiles = ["log.csv"]\n[channels]\n'
    lines += 'north = "north [m]"\neast = "east [m]"\nheading = "heading [deg]"\nv = "v [m/s]"\n'
    lines += 'delta_r_cmd = "rudder order [deg]"\nu = { from = "u [m/s]", missing = [-32.768] }\n'
    (run,) = imported(tmp_path, lines, log).runs
    assert np.isnan(run.data["u"]).sum() == 11 and np.nanmin(run.data["u"]) > 0.0


@pytest.mark.thorough
def test_a_number_that_is_no_known_code_is_asked_about(tmp_path):
    truth = motion(np.random.default_rng(7))
    columns = columns_of(truth)
    columns["v [m/s]"] = columns["v [m/s]"].copy()
    columns["v [m/s]"][900:911] = -40.0
    (asked,) = [q for q in propose([_table(tmp_path, truth, columns)]).map.questions if "code for" in q]
    assert "11 readings of 'v [m/s]' are exactly -40" in asked and "missing = [-40.0]" in asked


@pytest.mark.thorough
def test_a_gap_of_the_heading_in_turns_makes_no_question(tmp_path):
    truth = motion(np.random.default_rng(7))
    columns = columns_of(truth)
    turning = np.flatnonzero(np.abs(truth["psi"] - truth["psi"][0]) > 2.0)[0]
    clean = propose([_table(tmp_path, truth, columns)]).map
    columns["heading [deg]"][turning : turning + 300] = np.nan
    found = propose([_table(tmp_path, truth, columns)]).map
    assert found.questions == clean.questions == () and found.rudder_positive == clean.rudder_positive
    columns["heading [deg]"] *= -1.0  # beside the gap what is wrong is seen as before
    assert propose([_table(tmp_path, truth, columns)]).map.questions


def test_a_gap_is_longer_than_the_steps_of_its_own_series():
    slow = np.concatenate((np.arange(0.0, 50.0), np.arange(80.0, 120.0)))
    t = np.arange(0.0, 110.0, 0.1)
    inside = in_gaps((slow, np.ones(slow.size)), t)
    np.testing.assert_allclose((t[inside].min(), t[inside].max()), (49.1, 79.9))
    assert GAP > 1.0 and not in_gaps((slow[:50], np.ones(50)), t).any()
    bursts = np.concatenate([k * 5.0 + np.arange(5) * 0.1 for k in range(20)])
    assert not in_gaps((bursts, np.ones(bursts.size)), t).any()
