"""Reading trial bundles: what is accepted, what is refused in words, what is noticed."""

from __future__ import annotations

import dataclasses
import hashlib
import importlib.util
import json
import math
import os
import pickle
import random
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bayesid.errors import TrialError
from bayesid.trials import (
    Environment,
    Run,
    Trial,
    load_trial,
    resample,
    thin,
    trial_summary,
    window,
    write_trial,
)
from bayesid.trials.noise import rough_noise, spikes

HEADER = "t[s],x[m],y[m],psi[deg],r[deg/s],u[m/s],v[m/s],delta_r_cmd[deg],n_cmd[rpm]"
TOML = """format = 1
name = "bundle"
vehicle = "remus100"
{top}
[[runs]]
file = "r1.csv"
manoeuvre = "weave"
role = "identify"
"""
DEG = math.pi / 180


def weave(n=600, dt=0.5, noise=1.0, seed=1, rudder_sign=-1.0):
    """A kinematically exact log: r follows the rudder with a lag (port-positive: r against delta_r)."""
    rng = np.random.default_rng(seed)
    t = dt * np.arange(n)
    delta = 15 * DEG * np.where(np.sin(2 * math.pi * t / 60) > 0, 1.0, -1.0)
    r, a = np.zeros(n), math.exp(-dt / 5)
    for k in range(1, n):
        r[k] = a * r[k - 1] + (1 - a) * rudder_sign * 0.15 * delta[k - 1]
    psi = 350 * DEG + np.concatenate(([0], np.cumsum(0.5 * (r[1:] + r[:-1]) * dt)))
    u, v = np.full(n, 1.5), -0.3 * r
    vel = (u + 1j * v) * np.exp(1j * psi)
    track = np.concatenate(([0], np.cumsum(0.5 * (vel[1:] + vel[:-1]) * dt)))
    sigma = {"x": 0.05, "y": 0.05, "psi": 0.002, "r": 0.0005, "u": 0.01, "v": 0.01}
    true = {"x": track.real, "y": track.imag, "psi": psi, "r": r, "u": u, "v": v}
    data = {name: true[name] + noise * sigma[name] * rng.standard_normal(n) for name in true}
    return t, data, delta, np.full(n, 600.0)


def csv_of(t, data, delta, rpm, header=HEADER, wrap=True):
    psi = np.degrees(data["psi"])
    psi = psi % 360 if wrap else psi
    columns = [
        t,
        data["x"],
        data["y"],
        psi,
        np.degrees(data["r"]),
        data["u"],
        data["v"],
        np.degrees(delta),
        rpm,
    ]
    rows = [",".join(f"{value:.6f}" for value in row) for row in zip(*columns, strict=True)]
    return "\n".join([header, *rows]) + "\n"


@pytest.fixture
def bundle(tmp_path):
    def make(csv=None, top="", toml=TOML):
        (tmp_path / "trial.toml").write_text(toml.replace("{top}", top))
        if csv is None:
            csv = csv_of(*weave())
        (tmp_path / "r1.csv").write_bytes(csv if isinstance(csv, bytes) else csv.encode())
        return tmp_path

    return make


def test_clean_log_is_read_in_si_without_a_warning(bundle):
    t, data, delta, rpm = weave()
    trial = load_trial(bundle())
    run = trial.runs[0]
    assert trial.warnings == ()
    assert trial_summary(trial)["warnings"] == []
    assert (trial.dof, trial.vehicle_ref, run.name, run.role) == (3, "remus100", "r1", "identify")
    np.testing.assert_allclose(run.t, t)
    for name, values in data.items():  # heading is compared up to whole turns: the log was wrapped
        turns = 2 * math.pi * round((run.data[name][0] - values[0]) / (2 * math.pi)) if name == "psi" else 0.0
        np.testing.assert_allclose(run.data[name] - turns, values, atol=1e-6)
    np.testing.assert_allclose(run.commands["delta_r_cmd"], delta, atol=1e-7)
    np.testing.assert_allclose(run.input("n"), rpm)


def test_arrays_and_groups_are_read_only_and_survive_pickling(bundle):
    run = load_trial(bundle()).runs[0]
    with pytest.raises(ValueError, match="read-only"):
        run.data["x"][0] = 1.0
    with pytest.raises(TypeError, match="read-only"):
        run.data["x"] = run.t
    again = pickle.loads(pickle.dumps(run))
    assert again.digest == run.digest


T3 = np.arange(3.0)


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        ({"manoeuvre": None}, "run 'a': manoeuvre is NoneType"),
        ({"name": 3}, "run 3: name is int"),
        ({"provenance": (1,)}, "run 'a': provenance holds int"),
        ({"provenance": "cut"}, "run 'a': provenance is str"),
        ({"warnings": None}, "run 'a': warnings is NoneType"),
        ({"notes": b"x"}, "run 'a': notes is bytes"),
        ({"commands": None}, "run 'a': commands is NoneType"),
        ({"commands": {"n_cmd": T3, 3: T3}}, "run 'a': commands holds int"),
        ({"began": "noon"}, "run 'a': began is 'noon'"),
        ({"began": math.nan}, "run 'a': began is nan"),
    ],
)
def test_a_run_of_wrong_types_is_refused_at_once(wrong, told):
    with pytest.raises(TypeError, match=told):
        Run(**({"name": "a", "manoeuvre": "", "role": "identify", "t": T3, "data": {"x": T3}} | wrong))


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        ({"noise": None}, "trial 'pond': noise is NoneType"),
        ({"noise": {"x": "small"}}, "trial 'pond': noise has 'x': str"),
        ({"noise": {1: 0.5}}, "trial 'pond': noise has 1: float"),
        ({"measured_point": None}, "trial 'pond': measured_point is None; three numbers"),
        ({"measured_point": (0.0, 1.0)}, "three numbers"),
        ({"measured_point": ("0", "1", "2")}, "three numbers"),
        ({"runs": ("a",)}, "trial 'pond': runs holds str"),
        ({"environment": 0.1}, "trial 'pond': environment is float"),
        ({"name": None}, "trial None: name is NoneType"),
    ],
)
def test_a_trial_of_wrong_types_is_refused_at_once(wrong, told):
    with pytest.raises(TypeError, match=told):
        Trial(**({"name": "pond", "folder": Path("."), "vehicle_ref": "", "dof": 3, "runs": ()} | wrong))


def test_a_masked_reading_is_none():
    seen = np.ma.array([1.0, 1e20, 3.0], mask=[False, True, False])
    run = Run("a", "", "identify", T3, {"x": seen})
    np.testing.assert_array_equal(run.data["x"], [1.0, np.nan, 3.0])
    plain = Run("a", "", "identify", T3, {"x": np.ma.array(T3)})
    assert plain.digest == Run("a", "", "identify", T3, {"x": T3}).digest


def test_what_a_trial_was_made_of_may_change_and_its_digest_does_not():
    noise, point, notes = {"x": 0.5}, [0.1, 0.0, -0.2], ["cut"]
    run = Run("a", "", "identify", T3, {"x": T3}, provenance=notes)
    made = [Trial("pond", Path("."), "", 3, (run,), noise, None, point) for _ in range(2)]
    before = made[0].digest
    # as of the text that is hashed, written out: digests of trials that were kept stay good
    stated = "(3, [('x', 0.5)], None, (0.1, 0.0, -0.2))"
    assert before == hashlib.sha256((stated + run.digest).encode()).hexdigest()
    noise["x"], point[0] = 0.7, 9.0
    notes.append("later")
    assert made[1].digest == before and run.provenance == ("cut",)
    assert made[1].noise == {"x": 0.5} and made[1].noise | {"y": 1.0} == {"x": 0.5, "y": 1.0}
    with pytest.raises(TypeError, match="read-only"):
        made[1].noise["x"] = 0.7
    again = pickle.loads(pickle.dumps(made[1]))
    assert again.digest == before and again.noise == made[1].noise
    other = dataclasses.replace(again, noise={"x": 0.7})
    assert other.digest != before and dataclasses.replace(other, noise=made[0].noise).digest == before


def test_same_content_has_the_same_digest_whatever_the_line_ends_quotes_or_delimiter(bundle):
    text = csv_of(*weave(n=50))
    digests = set()
    for variant in (
        text.encode(),
        text.replace("\n", "\r\n").encode(),
        b"\xef\xbb\xbf" + text.encode(),
        text.replace(",", ";").encode(),
        text.replace(",", "\t").encode(),
        text.replace(",", ";").replace(".", ",").encode(),
        ('"' + text.split("\n", 1)[0].replace(",", '","') + '"\n' + text.split("\n", 1)[1]).encode(),
        text.replace("\n", ",\n").encode(),
        text.replace("[", " (").replace("]", ")").encode(),
        ("# logger 7\n\n" + text).encode(),
        text.replace("\n0.", "\n\n0.").encode(),
    ):
        digests.add(load_trial(bundle(variant)).digest)
    assert len(digests) == 1


ROW = "{t},0,0,10,0,1.5,0,0,600"


def rows(*lines):
    return "\n".join([HEADER, *lines]) + "\n"


def good(*times):
    return [ROW.format(t=t) for t in times]


@pytest.mark.parametrize(
    ("csv", "words"),
    [
        (b"", "is empty"),
        (b"\n\n  \n", "is empty"),
        (HEADER.encode() + b"\n", "no samples"),
        (b"# only\n# comments", "comments only"),
        (rows(*good(0, 1, 2, 2, 3)), "row 5: time repeats (2 s after 2 s)"),
        (rows(*good(0, 1, 2, 1.5, 3)), "row 5: time goes back (1.5 s after 2 s)"),
        (rows(*good(0, 1), "x,0,0,10,0,1.5,0,0,600"), "row 4: 't[s]' is 'x', not a number"),
        (rows(*good(0, 1), ",0,0,10,0,1.5,0,0,600"), "row 4: t is missing"),
        (rows(*good(0, 1), "2,0,0"), "row 4: 3 fields instead of 9; the log seems cut off here"),
        (rows(*good(0)), "one sample only"),
        (rows("0,0,0,1_0,0,1.5,0,0,600", *good(1)), "'1_0', not a number"),
        (rows(*good(0, 1)).replace("t[s],", "Time (s),"), "[columns] \"t[s]\" = 'Time (s)'"),
        (rows(*good(0, 1)).replace("psi[deg]", "psi[m]"), "unit of length, but angle"),
        (rows(*good(0, 1)).replace("psi[deg]", "psi[dge]"), "did you mean [deg]"),
        (rows(*good(0, 1)).replace("delta_r_cmd[deg]", "rudder[deg]"), "delta_r_cmd or delta_r, is missing"),
        (rows(*good(0, 1)).replace("v[m/s]", "x[m]"), "x is given by two columns"),
        (rows(*good(0, 1)).replace("psi", "hdg").replace("r[deg/s]", "w2"), "heading psi"),
        (rows(*good(0, 1)).replace("x[m]", "e").replace("u[m/s]", "f"), "position x"),
        (rows(*good(0, 1)).encode().replace(b"10", b"1\x000", 1), "row 2: holds NUL bytes"),
        ("t[s],x[m]\n0,0\n".encode("utf-16"), "UTF-16"),
        ("\n".join(good(0, 1, 2)), "numbers where the header should be"),
    ],
)
def test_unusable_log_is_refused_with_place_and_reason(bundle, csv, words):
    with pytest.raises(TrialError) as caught:
        load_trial(bundle(csv))
    assert "r1.csv: " in str(caught.value)
    assert words in str(caught.value)


def test_all_problems_of_a_bundle_come_in_one_message(bundle):
    csv = rows(*good(0, 1), "a,0,0,10,0,1.5,0,0,600", "3,0", "4,0,0,b,0,1.5,0,0,600")
    with pytest.raises(TrialError) as caught:
        load_trial(bundle(csv, top="dof = 4\nmeasured_point = [0, 1]\n[noise]\nx = -1\nheading = 1"))
    text = str(caught.value)
    for words in (
        "dof is 4",
        "measured_point",
        "[noise] x is -1",
        "'heading' is not",
        "row 4:",
        "row 5:",
        "row 6:",
    ):
        assert words in text


@pytest.mark.parametrize(
    ("toml", "words"),
    [
        ("format = 2\n[[runs]]\nfile='r1.csv'", "format is 2; this program reads format = 1"),
        ("[[runs]]\nfile='r1.csv'", "states no format; this program reads format = 1"),
        ("format = 1\nname = 3\n[[runs]]\nfile='r1.csv'", "name must be text"),
        ("format = 1\nruns = 3", "[[runs]] tables"),
        ("format = 1", "names no runs"),
        ("format = 1\n[[runs]]\nrole='identify'", "the name of a CSV file is needed"),
        ("format = 1\n[[runs]]\nfile='r1.csv'\nrole='test'", "one of identify, holdout"),
        ("format = 1\n[[runs]]\nfile='../r1.csv'", "outside the bundle"),
        ("format = 1\n[[runs]]\nfile='/etc/passwd'", "outside the bundle"),
        ("format = 1\n[[runs]]\nfile='C:/r1.csv'", "outside the bundle"),
        ("format = 1\n[[runs]]\nfile='r9.csv'", "does not exist"),
        ("format = 1\n[[runs]]\nfile='.'", "not a regular file"),
        ("format = 1\n[[runs]]\nfile='r1.csv'\n[[runs]]\nfile='r1.csv'", "same file as r1.csv"),
        ("format = 1\n[[runs]]\nfile='r1.csv'\nwindow=[5, 1]", "window must be"),
        ("format = 1\n[[runs]]\nfile='r1.csv'\nwindow=[5e5, 6e5]", "holds 0 samples"),
        ("format = 1\nvehicle='../v.toml'\n[[runs]]\nfile='r1.csv'", "outside the bundle"),
        ("format = 1\nvehicle='v.toml'\n[[runs]]\nfile='r1.csv'", "vehicle 'v.toml' does not exist"),
        ("format = 1\nrudder_positive='left'\n[[runs]]\nfile='r1.csv'", "one of port, starboard"),
        ("format = 1\nrudder_postive='port'\n[[runs]]\nfile='r1.csv'", "did you mean 'rudder_positive'"),
        (
            "format = 1\n[[runs]]\nfile='r1.csv'\nrol='holdout'",
            "run 1: 'rol' is not known; did you mean 'role'",
        ),
        ("format = 1\n[columns]\npsii='a'\n[[runs]]\nfile='r1.csv'", "did you mean 'psi'"),
        ("format = 1\n[environment]\nforce_rms=-1\n[[runs]]\nfile='r1.csv'", "zero or more"),
        ("format = [", "not valid TOML"),
        ("a = " + "[" * 5000, "TOML"),
        ("a = " + "9" * 5000, "TOML"),
    ],
)
def test_unusable_trial_toml_is_refused_with_reason(bundle, toml, words):
    with pytest.raises(TrialError) as caught:
        load_trial(bundle(toml=toml))
    assert words in str(caught.value)


@pytest.mark.parametrize("line", ["note='calm'", "manoeuver='turn'", "role_by_hand='x'"])
def test_keys_that_change_no_number_are_reported_and_ignored(bundle, line):
    found = load_trial(bundle(toml=f"format = 1\n[[runs]]\nfile='r1.csv'\n{line}"))
    assert any("is not known and ignored" in text for text in found.warnings)


def test_links_out_of_the_bundle_and_loops_are_refused(bundle, tmp_path_factory):
    folder = bundle()
    outside = tmp_path_factory.mktemp("outside") / "r1.csv"
    outside.write_text(csv_of(*weave(n=30)))
    (folder / "r1.csv").unlink()
    (folder / "r1.csv").symlink_to(outside)
    with pytest.raises(TrialError, match="link to a place outside"):
        load_trial(folder)
    (folder / "r1.csv").unlink()
    (folder / "r1.csv").symlink_to(folder / "r2.csv")
    (folder / "r2.csv").symlink_to(folder / "r1.csv")
    with pytest.raises(TrialError, match=r"r1\.csv: "):
        load_trial(folder)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
def test_a_pipe_is_refused_instead_of_waited_for(bundle):
    folder = bundle()
    (folder / "r1.csv").unlink()
    os.mkfifo(folder / "r1.csv")
    with pytest.raises(TrialError, match="not a regular file"):
        load_trial(folder)


def test_a_huge_file_is_refused_before_it_is_read(bundle):
    folder = bundle()
    with open(folder / "r1.csv", "wb") as file:
        file.truncate(3 * 2**30)  # sparse
    with pytest.raises(TrialError, match="the limit is 256 MB"):
        load_trial(folder)


def test_logs_may_be_kept_in_another_folder(bundle, tmp_path_factory):
    folder = bundle()
    data = tmp_path_factory.mktemp("data")
    (folder / "r1.csv").rename(data / "r1.csv")
    with pytest.raises(TrialError, match="does not exist"):
        load_trial(folder)
    assert load_trial(folder, data=data).runs[0].n_samples == 600


def test_time_can_be_sorted_on_request(bundle):
    trial = load_trial(bundle(rows(*good(0, 2, 1, 2, 3)), top='time_repair = "sort"'))
    np.testing.assert_array_equal(trial.runs[0].t, [0, 1, 2, 3])
    told = "it went back 1 times; 1 rows of equal time merged with the first, no reading lost"
    assert any(told in text for text in trial.warnings)


def joined(*extra):
    """Three loggers of their own columns, joined on time row by row: position, heading, orders."""
    lines = []
    for t in range(20):
        lines += [f"{t},{1.5 * t},0,,,,,,", f"{t},,,10,0.1,,,,", f"{t},,,,,1.5,0,5,600"]
    return rows(*lines, *extra)


def test_rows_of_equal_time_that_complement_each_other_are_merged(bundle):
    """Nothing is lost: what is read is what the same log says with one row per time."""
    whole = rows(*[f"{t},{1.5 * t},0,10,0.1,1.5,0,5,600" for t in range(20)])
    plain = load_trial(bundle(whole)).runs[0]
    merged = load_trial(bundle(joined(), top='time_repair = "sort"'))
    assert merged.runs[0].digest == plain.digest
    assert any("40 rows of equal time merged" in text for text in merged.warnings)


def test_a_row_that_contradicts_another_of_equal_time_is_dropped_whole_and_counted(bundle):
    """A second position fix must not be mixed with the first: its x goes, and so does the rate beside it."""
    text = joined("3,99,0,,7,,,,", "4,6,0,,,,,,")
    trial = load_trial(bundle(text, top='time_repair = "sort"'))
    plain = load_trial(bundle(joined(), top='time_repair = "sort"')).runs[0]
    assert trial.runs[0].digest == plain.digest
    told = "1 rows that contradict another of equal time dropped, with 3 readings (1 of x, 1 of y, 1 of r)"
    assert any(told in text and "41 rows" in text for text in trial.warnings)


def test_a_mapped_column_without_values_is_not_called_unused(bundle):
    text = csv_of(*weave()).replace("psi[deg]", "yaw").replace("r[deg/s]", "rate")
    lines = text.strip().split("\n")
    at = lines[0].split(",").index("yaw")
    empty = [",".join("" if k == at else c for k, c in enumerate(line.split(","))) for line in lines[1:]]
    with pytest.raises(TrialError) as caught:
        load_trial(bundle("\n".join([lines[0], *empty]), top='[columns]\n"psi[deg]" = "yaw"'))
    assert "column 'yaw', read as psi, holds no value" in str(caught.value)
    assert "unused" not in str(caught.value)


def test_foreign_columns_and_units_give_the_same_run(bundle):
    text = csv_of(*weave())
    plain = load_trial(bundle(text)).runs[0]
    head = "Zeit [ms],East,North (m),Heading (deg),r[deg/s],u[m/s],v[m/s],delta_r_cmd[deg],n_cmd[rpm]"
    lines = [line.split(",") for line in text.strip().split("\n")[1:]]
    foreign = [[f"{1000 * float(c[0]):.3f}", c[2], c[1], *c[3:]] for c in lines]
    top = '[columns]\nt = "Zeit [ms]"\n"x[m]" = "North (m)"\n"y[m]" = "East"\n"psi[deg]" = "Heading (deg)"'
    mapped = load_trial(bundle("\n".join([head, *map(",".join, foreign)]), top=top)).runs[0]
    for name in plain.data:
        np.testing.assert_allclose(mapped.data[name], plain.data[name], atol=1e-12)
    np.testing.assert_allclose(mapped.t, plain.t, atol=1e-12)


def test_text_in_a_column_nobody_asked_for_is_left_out(bundle):
    lines = csv_of(*weave()).strip().split("\n")
    lines = [lines[0] + ",mode", *(line + ',"auto, leg 1"' for line in lines[1:])]
    trial = load_trial(bundle("\n".join(lines)))
    assert trial.runs[0].extra == {}
    assert trial.warnings == ("r1.csv: column 'mode' holds text and is left out",)


def test_starboard_positive_rudder_is_turned_to_port_positive(bundle):
    port = load_trial(bundle(csv_of(*weave()))).runs[0]
    t, data, delta, rpm = weave()
    star = load_trial(bundle(csv_of(t, data, -delta, rpm), top='rudder_positive = "starboard"'))
    np.testing.assert_allclose(star.runs[0].commands["delta_r_cmd"], port.commands["delta_r_cmd"], atol=1e-12)
    assert star.warnings == ()


def test_vertical_channels_make_a_trial_six_dof_unless_it_says_otherwise(bundle):
    csv = csv_of(*weave(n=40)).replace("v[m/s]", "z[m]")
    assert load_trial(bundle(csv)).dof == 6
    assert load_trial(bundle(csv, top="dof = 3")).dof == 3


def test_missing_samples_stay_missing_in_data_and_are_filled_in_inputs(bundle):
    lines = csv_of(*weave(n=40)).strip().split("\n")
    cells = [line.split(",") for line in lines]
    for k in (5, 6, 7):
        cells[k][1] = ""
        cells[k][7] = "NaN"
    trial = load_trial(bundle("\n".join(map(",".join, cells))))
    run = trial.runs[0]
    assert np.flatnonzero(np.isnan(run.data["x"])).tolist() == [4, 5, 6]
    np.testing.assert_array_equal(run.commands["delta_r_cmd"][4:7], run.commands["delta_r_cmd"][3])
    assert any("missing samples: x 7.5 %" in text for text in trial.warnings)
    assert any("last command held" in text for text in trial.warnings)


def _drifted(change):
    t, data, delta, rpm = weave()
    data = dict(data)
    change(data)
    return csv_of(t, data, delta, rpm)


def _stick(data):
    data["r"] = data["r"].copy()
    data["r"][200:300] = data["r"][200]


def _clip(data):
    data["r"] = np.clip(data["r"], -0.02, 0.02)


def _flip_psi(data):
    data["psi"] = -data["psi"]


def _swap_xy(data):
    data["x"], data["y"] = data["y"], data["x"]


def _knots(data):
    data["u"], data["v"] = data["u"] / 0.514444, data["v"] / 0.514444


def _turn_north(data):
    turned = (data["x"] + 1j * data["y"]) * np.exp(0.2j)
    data["x"], data["y"] = turned.real, turned.imag


@pytest.mark.parametrize(
    ("csv", "words"),
    [
        (csv_of(*weave()).replace("psi[deg]", "psi[rad]"), "heading in degrees labelled rad"),
        (csv_of(*weave()).replace("psi[deg]", "psi[rad]"), "psi changes 57 times"),
        (csv_of(*weave()).replace("r[deg/s]", "r[rad/s]"), "psi changes 1/57 as much as r"),
        (csv_of(*weave()).replace("delta_r_cmd[deg]", "delta_r_cmd[rad]"), "degrees labelled as radians"),
        (csv_of(*weave()).replace("[m],y[m]", "[ft],y[ft]"), "the track is 0.305 times as long"),
        (_drifted(_knots), "kn labelled m/s"),
        (csv_of(1000 * weave()[0], *weave()[1:]), "time in ms labelled s"),
        (_drifted(_stick), "r is stuck at"),
        (_drifted(_clip), "r seems clipped"),
        (_drifted(_flip_psi), "psi turns against r"),
        (_drifted(_swap_xy), "x and y swapped"),
        (_drifted(_turn_north), "the track runs +11.5 deg (clockwise) off"),
        (csv_of(*weave(rudder_sign=1.0)), 'rudder_positive = "starboard"'),
        (csv_of(*weave(n=12)), "only 12 samples"),
        (csv_of(*weave()).replace(",600.000000", ","), "n_cmd: no values"),
        (csv_of(*weave()).replace("psi[deg]", "psi"), "no unit in the header, read psi as [rad]"),
        (
            "\n".join(k for j, k in enumerate(csv_of(*weave()).split("\n")) if not 100 < j < 140),
            "1 gap of 20 s",
        ),
    ],
)
def test_suspicious_log_is_noticed(bundle, csv, words):
    trial = load_trial(bundle(csv))
    assert any(words in text for text in trial.warnings), trial.warnings


def test_estimated_noise_equals_the_noise_put_in(bundle):
    stated = "[noise]\nx = 0.05\ny = 0.05\npsi = 0.002\nr = 0.0005\nu = 0.01\nv = 0.05"
    summary = trial_summary(load_trial(bundle(top=stated)))
    for name, row in summary["noise"].items():
        expected = 0.2 if name == "v" else 1.0  # v is stated five times too large
        assert row["ratio"] == pytest.approx(expected, rel=0.25)  # 600 samples: one sigma is about 5 %
    assert [t for t in summary["warnings"] if t.startswith("noise stated") and "[noise] v = 0.0" in t]
    json.dumps(summary)


@pytest.mark.parametrize("regular", [True, False])
def test_noise_estimate_ignores_a_cubic_and_irregular_sampling(regular):
    rng = np.random.default_rng(5)
    t = np.arange(4000.0) if regular else np.cumsum(rng.uniform(0.5, 1.5, 4000))
    values = 1e-6 * (t - 500) ** 3 + 0.3 * rng.standard_normal(4000)
    assert rough_noise(t, values) == pytest.approx(0.3, rel=0.1)


def test_spikes_are_found_and_crests_are_not():
    t = 0.25 * np.arange(400)
    values = np.sin(t) + 0.001 * np.random.default_rng(3).standard_normal(400)
    assert spikes(t, values, 0.001).size == 0
    values[[100, 250]] += 0.5
    assert spikes(t, values, 0.001).tolist() == [100, 250]


def test_a_kink_is_no_spike():
    t = np.arange(100.0)
    values = np.abs(t - 50) + 0.001 * np.random.default_rng(3).standard_normal(100)
    assert spikes(t, values, 0.001).size == 0


def test_resampling_keeps_the_last_sample_whatever_the_rounding():
    for dt in (0.1, 0.3, 0.7):
        t = np.cumsum(np.full(1000, dt))
        run = Run("a", "", "identify", t, {"x": t.copy()}, {"delta_r_cmd": t.copy()})
        out = resample(run, dt)
        assert out.n_samples == 1000
        assert np.isfinite(out.data["x"]).all()
        np.testing.assert_array_equal(out.commands["delta_r_cmd"], t)


def test_window_and_resample_keep_their_origin(bundle):
    run = load_trial(bundle()).runs[0]
    part = window(run, 50.0, 100.0)
    assert (part.t[0], part.t[-1], part.n_samples) == (50.0, 100.0, 101)
    assert part.digest != run.digest
    assert run.digest[:12] in part.provenance[0]
    fine = resample(part, 0.1)
    np.testing.assert_allclose(fine.t, 50 + 0.1 * np.arange(501))
    np.testing.assert_allclose(fine.data["x"][::5], part.data["x"], atol=1e-9)
    np.testing.assert_array_equal(fine.commands["delta_r_cmd"][:-1:5], part.commands["delta_r_cmd"][:-1])
    assert set(np.unique(fine.commands["delta_r_cmd"])) <= set(np.unique(part.commands["delta_r_cmd"]))
    assert len(fine.provenance) == 2
    with pytest.raises(TrialError, match="holds 0 samples"):
        window(run, 1e4, 2e4)
    with pytest.raises(TrialError, match="must be positive"):
        resample(run, 0.0)


def test_thinning_keeps_every_switch_of_a_command_and_few_readings():
    t = 0.5 * np.arange(41)
    order = np.where((t >= 3.5) & (t < 11.0), 0.2, 0.0)
    wind = {"wind_speed": t.copy()}
    run = Run("a", "", "identify", t, {"x": 2 * t}, {"delta_r_cmd": order}, exogenous=wind)
    out = thin(run, 2.0)
    np.testing.assert_allclose(out.t, [0, 2, 3.5, 4, 6, 8, 10, 11, 12, 14, 16, 18, 20])
    np.testing.assert_array_equal(out.commands["delta_r_cmd"] > 0, (out.t >= 3.5) & (out.t < 11.0))
    read = np.isfinite(out.data["x"])
    np.testing.assert_allclose(out.t[read], 2.0 * np.arange(11))
    np.testing.assert_allclose(out.data["x"][read], 2 * out.t[read])
    np.testing.assert_allclose(out.exogenous["wind_speed"], out.t)


@pytest.mark.parametrize("dt", [0.2, 0.5, 0.7, 1.0, 2.5])
def test_positions_at_one_hertz_beside_rates_at_twenty_are_kept_as_they_are_and_never_become_more(dt):
    t = 0.05 * np.arange(20 * 60)
    fixes = np.arange(t.size) % 20 == 7  # 0.35 s after the full second
    position = np.where(fixes, 1.5 * t, np.nan)
    position[(t > 20.0) & (t < 32.0)] = np.nan
    run = Run("a", "", "identify", t, {"x": position, "r": 0.1 * t}, {"delta_r_cmd": np.zeros(t.size)})
    out = thin(run, dt)
    there = np.isfinite(out.data["x"])
    read = run.t[np.isfinite(position)]
    assert there.sum() <= read.size
    # of several in a longer step one is kept, and none where a step lies beside the gap
    least = read.size if dt <= 1.0 else 60.0 * (1.0 - 12.0 / 60.0) / dt
    assert there.sum() >= least - (0 if dt <= 1.0 else 3)
    np.testing.assert_allclose(out.data["x"][there], 1.5 * out.t[there])
    assert not there[(out.t > 20.5 + dt / 2) & (out.t < 31.5 - dt / 2)].any()
    even = resample(run, dt)
    assert np.isfinite(out.data["r"]).sum() == even.n_samples
    assert np.isnan(even.data["x"][(even.t > 20.5) & (even.t < 31.5)]).all()
    assert np.isfinite(even.data["x"][(even.t > 1.0) & (even.t < 19.0)]).all()


@pytest.mark.parametrize("phase", [0.0, 0.03, 0.5, 0.97])
def test_readings_half_a_step_from_the_samples_are_kept_as_they_were_read(phase):
    """Each once, though their stamps jitter: fixes every second beside rates, thinned to a second."""
    rng = np.random.default_rng(1)
    fixes = np.arange(1.0, 200.0) + phase + 0.002 * rng.standard_normal(199)
    t = np.unique(np.concatenate([0.05 * np.arange(20 * 201), fixes]))
    noise = rng.standard_normal(fixes.size)
    data = {"x": np.full(t.size, np.nan), "r": np.where(np.isin(t, fixes), np.nan, 0.1)}
    data["x"][np.searchsorted(t, fixes)] = noise
    out = thin(Run("a", "", "identify", t, data, {"delta_r_cmd": np.zeros(t.size)}), 1.0)
    there = np.isfinite(out.data["x"])
    assert fixes.size - 1 <= there.sum() <= fixes.size
    kept = noise[np.abs(fixes[:, None] - out.t[there]).argmin(axis=0)]
    assert np.max(np.abs(out.data["x"][there] - kept)) < 0.2  # a line over a twentieth of a second
    assert np.std(out.data["x"][there]) == pytest.approx(np.std(noise), rel=0.06)


def test_resampling_leaves_long_gaps_missing():
    t = np.concatenate((np.arange(10.0), np.arange(60.0, 70.0)))
    run = Run("a", "", "identify", t, {"x": t.copy()}, {"delta_r_cmd": np.zeros(20)})
    out = resample(run, 1.0)
    assert np.isnan(out.data["x"][10:60]).all()
    np.testing.assert_allclose(out.data["x"][[9, 60]], [9.0, 60.0])


def test_written_trial_reads_back_exactly(bundle, tmp_path_factory):
    top = "measured_point = [0.1, 0.0, -0.2]\n[noise]\nx = 0.05\n[environment]\nnav_drift = 0.5"
    csv = csv_of(*weave(n=60)).replace("v[m/s]", "wind_speed[kn]").replace("u[m/s]", '"gain, ""raw"""')
    trial = load_trial(bundle(csv, top=top))
    out = tmp_path_factory.mktemp("out") / "copy"
    write_trial(trial, out)
    again = load_trial(out)
    assert again.digest == trial.digest
    assert (again.dof, again.noise, again.environment) == (trial.dof, trial.noise, Environment(None, 0.5))
    with pytest.raises(TrialError, match="holds a trial already"):
        write_trial(trial, out)


def test_a_vehicle_file_and_its_covariance_travel_with_the_trial(bundle, tmp_path_factory):
    folder = bundle(toml=TOML.replace("remus100", "vehicle.toml"))
    (folder / "vehicle.toml").write_text('[prior]\ncovariance = "cov.npz"\n')
    (folder / "cov.npz").write_bytes(b"any")
    out = tmp_path_factory.mktemp("out")
    write_trial(load_trial(folder), out)
    assert load_trial(out).vehicle_ref == str(out / "vehicle.toml")
    assert (out / "cov.npz").read_bytes() == b"any"


NAMES = st.text(st.characters(exclude_categories=["Cs"]), max_size=20)
FLOATS = st.floats(-1e9, 1e9, allow_subnormal=False)


@settings(max_examples=40, deadline=None)
@given(st.data())
def test_any_trial_survives_writing_and_reading(tmp_path_factory, data):
    runs = []
    for k in range(data.draw(st.integers(1, 3))):
        n = data.draw(st.integers(2, 12))
        steps = data.draw(st.lists(st.floats(1e-3, 1e3), min_size=n, max_size=n))
        t = np.cumsum(steps)
        x = np.array(data.draw(st.lists(FLOATS | st.just(math.nan), min_size=n, max_size=n)))
        x[0] = 1.0
        psi = np.cumsum(data.draw(st.lists(st.floats(-3, 3), min_size=n, max_size=n)))
        command = np.array(data.draw(st.lists(st.floats(-1, 1), min_size=n, max_size=n)))
        name = data.draw(NAMES)
        measured = {"x": x, "y": t.copy(), "psi": psi}
        commands = {"delta_r_cmd": command}
        runs.append(Run(name, data.draw(NAMES), "identify" if k else "holdout", t, measured, commands))
    trial = Trial(data.draw(NAMES), Path("."), "remus100", 3, tuple(runs), {"x": 0.5})
    out = tmp_path_factory.mktemp("trial")
    write_trial(trial, out)
    again = load_trial(out)
    for one, two in zip(trial.runs, again.runs, strict=True):
        assert (one.manoeuvre, one.role) == (two.manoeuvre, two.role)
        np.testing.assert_array_equal(one.t, two.t)
        for group in ("data", "commands"):
            for name, values in getattr(one, group).items():
                np.testing.assert_allclose(getattr(two, group)[name], values, rtol=0, atol=1e-12)


def _fuzz():
    path = Path(__file__).parent / "fuzz" / "fuzz_files.py"
    spec = importlib.util.spec_from_file_location("fuzz_files", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


FUZZ = _fuzz()


@pytest.mark.thorough
@settings(max_examples=250, deadline=None)
@given(st.integers(0, len(FUZZ.SEEDS) - 1), st.randoms(use_true_random=False))
def test_damaged_files_give_a_result_or_one_clear_error(seed, rng):
    FUZZ.try_one(FUZZ.mutate(FUZZ.SEEDS[seed], rng))


@settings(max_examples=200, deadline=None)
@given(st.sampled_from([b"c", b"t", b"v"]), st.binary(max_size=300))
def test_arbitrary_bytes_give_a_result_or_one_clear_error(kind, body):
    FUZZ.try_one(kind + body)


def test_a_second_of_random_damage_is_refused_cleanly():
    assert FUZZ.plain(1.0, [], report=lambda text: None) > 10
    assert FUZZ.mutate(b"cabc", random.Random(1)) != b"cabc"


SHARED = Path(__file__).resolve().parents[2] / "shared"


@pytest.mark.skipif(not (SHARED / "practice").is_dir(), reason="practice bundles are not part of the project")
@pytest.mark.parametrize("kind", ["practice", pytest.param("blind", marks=pytest.mark.slow)])
def test_every_bundle_at_hand_loads_and_its_noise_is_as_stated(kind):
    for folder in sorted(path for path in (SHARED / kind).iterdir() if (path / "trial.toml").exists()):
        summary = trial_summary(load_trial(folder))
        for name, row in summary["noise"].items():
            if name != "r":  # rates of small vehicles change faster than their logs are sampled
                assert 0.85 < row["ratio"] < 1.25, (folder.name, name)
        assert not [text for text in summary["warnings"] if "missing" not in text and "outlier" not in text]


@pytest.mark.skipif(not (SHARED / "data").is_dir(), reason="the logs are not part of the project")
@pytest.mark.parametrize(
    ("name", "identify", "holdout", "told"),
    # one run of the tanker has two stretches of 2.4 s in which old readings were written again
    [
        ("kvlcc2_hsva", 7, 6, ()),
        ("esso_osaka", 11, 9, ("turn_14-Oct_14_08_51.csv: psi repeats one reading",)),
    ],
)
def test_real_logs_load_and_agree_with_their_conventions(name, identify, holdout, told):
    folder = Path(__file__).resolve().parents[1] / "studies" / "real_logs" / name
    trial = load_trial(folder, data=SHARED / "data")
    assert (len(trial.identify), len(trial.holdout), trial.dof) == (identify, holdout, 3)
    assert len(trial.warnings) == len(told)
    assert all(words in warning for words, warning in zip(told, trial.warnings, strict=True))
    for row in trial_summary(trial)["runs"]:
        assert row["checks"]["track"]["scale"] == pytest.approx(1.0, abs=0.01)
        assert row["checks"]["yaw"]["scale"] == pytest.approx(1.0, abs=0.1)
        assert row["checks"]["rudder"]["slope"] < 0  # port-positive inside


def test_logs_that_are_all_elsewhere_are_one_sentence(tmp_path):
    runs = "".join(f"[[runs]]\nfile='r{i}.csv'\n" for i in range(9))
    (tmp_path / "trial.toml").write_text(f"format = 1\ndata_hint = 'Ask the tank.'\n{runs}")
    for data, words in (
        (None, "pass data=FOLDER (--data). Ask the tank."),
        (tmp_path / "other", "or in the bundle"),
    ):
        with pytest.raises(TrialError) as told:
            load_trial(tmp_path, data)
        said = str(told.value)
        assert (
            "\n" not in said and "each of its 9 logs, r0.csv first, does not exist" in said and words in said
        )
