"""Stamps that are rounded, set back, out of order, with gaps or jitter: told by import and bundle."""

from __future__ import annotations

import numpy as np
import pytest

from bayesid.cli.main import run as bayesid
from bayesid.errors import TrialError
from bayesid.trials import load_trial
from bayesid.trials.equal_times import spread_equal_times
from bayesid.trials.importing import propose
from bayesid.trials.importing.stamps import _unsteadiness
from tests.raw_logs import motion

# the picture of an import is rendered in test_trial_import

DEG = np.pi / 180.0


def log(folder, change, bundle=False, noise=0.0):
    """A log of which `change` makes the stamps and the rows in order of writing; its truth.

    noise : of the rudder in degrees
    """
    truth = motion(np.random.default_rng(7))
    rng = np.random.default_rng(1)
    t, rows = change(truth["t"].copy(), rng)
    columns = {
        "t[s]": t, "x[m]" if bundle else "north [m]": truth["x"][rows],
        "y[m]" if bundle else "east [m]": truth["y"][rows],
        "psi[deg]" if bundle else "heading [deg]": truth["psi"][rows] / DEG,
        "r[deg/s]": truth["r"][rows] / DEG, "u[m/s]": truth["u"][rows], "v[m/s]": truth["v"][rows],
        "delta_r_cmd[deg]": truth["delta_r_cmd"][rows] / DEG + noise * rng.standard_normal(rows.size),
        "n_cmd[rpm]": truth["n_cmd"][rows],
    }  # fmt: skip
    folder.mkdir(exist_ok=True)
    lines = [",".join(columns)] + [
        ",".join(f"{v:.9g}" for v in row) for row in zip(*columns.values(), strict=True)
    ]
    (folder / "log.csv").write_text("\n".join(lines) + "\n")
    return truth


def rounded(t, rng):
    return np.floor(t + 1e-6), np.arange(t.size)


def set_back(t, rng):
    return np.where(t > 200.0, t - 7.3, t), np.arange(t.size)


def swapped(t, rng):
    rows = np.arange(t.size)
    rows[[1000, 1001]] = rows[[1001, 1000]]
    return t[rows], rows


def gap(t, rng):
    """Thirty seconds lost in which a zig-zag went on: the rudder is another after it."""
    rows = np.flatnonzero((t < 75.0) | (t > 105.0))
    return t[rows], rows


def jitter(t, rng):
    return t + 0.04 * rng.uniform(-1.0, 1.0, t.size), np.arange(t.size)


def dropped(t, rng):
    rows = np.flatnonzero(rng.random(t.size) > 0.15)
    return t[rows], rows


WORDS = {
    rounded: ("stamps of log.csv are rounded: about 10.0 rows", "the stamps are rounded"),
    set_back: ("set back by 7.2", "set back by 7.2"),
    swapped: ("1 row is out of order", "time goes back"),
    gap: ("gap of 30.", "gap of 30."),
    jitter: ("the time between rows varies", "the time between samples varies"),
}


@pytest.mark.parametrize("change", WORDS, ids=lambda c: c.__name__)
def test_the_import_tells_it(tmp_path, change):
    log(tmp_path / "raw", change)
    proposal = propose([tmp_path / "raw" / "log.csv"])
    said = [*proposal.map.questions, *proposal.remarks]
    assert any(WORDS[change][0] in text for text in said), said
    if change in (rounded, set_back, gap):
        assert any(WORDS[change][0] in text for text in proposal.map.questions)


def held(t, rng):
    """Seconds lost while the rudder was held."""
    order = motion(np.random.default_rng(7))["delta_r_cmd"]
    ends = np.flatnonzero(np.diff(order)) + 1
    k = int(np.argmax(np.diff(ends)))
    middle = t[(ends[k] + ends[k + 1]) // 2]
    rows = np.flatnonzero(np.abs(t - middle) > 2.0)
    return t[rows], rows


@pytest.mark.parametrize(("change", "asked"), [(held, False), (gap, True)])
def test_noise_of_a_measured_rudder_is_no_other_rudder_after_a_gap(tmp_path, change, asked):
    log(tmp_path / "raw", change, noise=0.05)
    proposal = propose([tmp_path / "raw" / "log.csv"])
    assert any("the rudder is another after it" in q for q in proposal.map.questions) == asked
    assert asked or any("has a gap" in remark for remark in proposal.remarks)


@pytest.mark.parametrize(("before", "after", "other"), [(-0.09, 0.024, True), (0.05, 0.052, False)])
def test_what_swings_is_no_noise(before, after, other):
    t = np.arange(0.0, 200.0)
    order = np.radians(10.0) * np.sin(2 * np.pi * t / 23.0)
    assert (abs(after - before) > _unsteadiness(order)) is other


def test_one_step_of_a_rounded_rudder_is_no_other_rudder():
    values = np.radians(np.round(5.0 + 0.02 * np.random.default_rng(1).standard_normal(400) + 0.04, 1))
    assert np.radians(0.1) < _unsteadiness(values) < np.radians(0.2)
    assert _unsteadiness(np.full(50, 0.1)) == 1e-9


def pauses(t, rng):
    """Two stretches of one file with ten minutes between them."""
    return np.where(t < 100.0, t, t + 600.0), np.arange(t.size)


def test_a_pause_between_runs_cuts_them_and_is_no_question(tmp_path):
    """Control: the log without the pause has a run across that place."""
    windows = {}
    for change in (pauses, lambda t, rng: (t, np.arange(t.size))):
        log(tmp_path / "raw", change)
        proposal = propose([tmp_path / "raw" / "log.csv"])
        windows[change is pauses] = [run.window for run in proposal.map.runs]
        assert not any("gap" in text for text in proposal.map.questions)
        assert any("pauses after 100 s for 600 s" in r for r in proposal.remarks) is (change is pauses)
    assert all(b <= 100.0 or a >= 700.0 for a, b in windows[True]) and len(windows[True]) > 1
    assert any(w is None or w[0] < 100.0 < w[1] for w in windows[False])


@pytest.mark.parametrize("change", WORDS, ids=lambda c: c.__name__)
def test_a_bundle_tells_it(tmp_path, change):
    log(tmp_path, change, bundle=True)
    (tmp_path / "trial.toml").write_text('format = 1\n[[runs]]\nfile = "log.csv"\n')
    try:
        said = load_trial(tmp_path).warnings
    except TrialError as error:
        said = [str(error)]
    assert any(WORDS[change][1] in text for text in said), said


@pytest.mark.parametrize("change", [lambda t, rng: (t, np.arange(t.size)), dropped])
def test_stamps_in_order_and_rows_left_out_are_no_jitter(tmp_path, change):
    log(tmp_path / "raw", change)
    proposal = propose([tmp_path / "raw" / "log.csv"])
    words = [words for pair in WORDS.values() for words in pair]
    assert not [
        text for text in (*proposal.map.questions, *proposal.remarks) if any(w in text for w in words)
    ]


@pytest.mark.thorough
def test_rounded_stamps_are_spread_by_the_map_and_by_the_bundle(tmp_path):
    """Rounded down to seconds at 10 Hz: spread they are the true ones to a millisecond; read as they stand
    nine of ten readings would be lost."""
    truth = log(tmp_path / "raw", rounded)
    path, out = tmp_path / "raw" / "log.csv", tmp_path / "bundle"
    assert bayesid(["trial", "import", str(path), "--out", str(out)]) == 3
    text = (out / "map.toml").read_text()
    assert "spread = true" in text
    asked = text[text.index("questions = [") : text.index("]\n", text.index("questions = [")) + 2]
    text = text.replace(asked, "")
    (out / "map.toml").write_text(text[: text.index("[[runs]]")])
    assert bayesid(["trial", "import", str(path), "--map", str(out / "map.toml"), "--out", str(out)]) == 0
    run = load_trial(out).runs[0]
    assert run.n_samples == truth["t"].size
    np.testing.assert_allclose(run.t, truth["t"], atol=1e-3)
    log(tmp_path, rounded, bundle=True)
    (tmp_path / "trial.toml").write_text('format = 1\ntime_repair = "spread"\n[[runs]]\nfile = "log.csv"\n')
    np.testing.assert_allclose(load_trial(tmp_path).runs[0].t, truth["t"], atol=1e-3)


def test_rows_are_not_spread_into_a_gap():
    t = np.repeat([0.0, 1.0, 2.0, 30.0, 31.0], 5)
    found = spread_equal_times(t)
    np.testing.assert_allclose(found[10:15], 2.0 + 0.2 * np.arange(5))
    np.testing.assert_allclose(found[20:], 31.0 + 0.2 * np.arange(5))
    assert (np.diff(found) > 0).all()


@pytest.mark.parametrize(
    ("date", "asks"), [("%d.%m.%Y", False), ("%d/%m/%Y", True), ("%m/%d/%Y", False), ("%Y-%m-%d", False)]
)
def test_day_and_month_exchanged_between_two_files_are_asked_about(tmp_path, date, asks):
    """10 June 2024 written in four ways, beside Unix time; with points the day is first everywhere."""
    from datetime import UTC, datetime

    truth = motion(np.random.default_rng(7))
    at = [datetime.fromtimestamp(1718000000.0 + t, UTC) for t in truth["t"][::5]]
    rows = zip(at, truth["x"][::5], truth["y"][::5], strict=True)
    lines = [f"{t.strftime(f'{date} %H:%M:%S.%f')},{x:.4f},{y:.4f}" for t, x, y in rows]
    (tmp_path / "gps.csv").write_text("UTC,north [m],east [m]\n" + "\n".join(lines) + "\n")
    rows = zip(truth["t"], truth["psi"] / DEG, truth["r"] / DEG, truth["delta_r_cmd"] / DEG, strict=True)
    lines = [f"{1718000000.0 + t:.2f},{p:.4f},{r:.4f},{d:.3f},900" for t, p, r, d in rows]
    head = "unix [s],heading [deg],yaw_rate [deg/s],rudder_cmd [deg],rpm_cmd\n"
    (tmp_path / "ins.csv").write_text(head + "\n".join(lines) + "\n")
    asked = propose([tmp_path / "gps.csv", tmp_path / "ins.csv"]).map.questions
    assert any("do not overlap in time" in text for text in asked) == asks
    assert asks or not asked


@pytest.mark.parametrize("start", [100.0, 100.1, 100.6, 100.9])
def test_a_log_that_begins_between_two_stamps_is_spread_from_where_it_begins(start):
    """10 Hz, rounded down to seconds, ended between two stamps too."""
    true = start + 0.1 * np.arange(87)
    np.testing.assert_allclose(spread_equal_times(np.floor(true + 1e-6)), true, atol=1e-6)


def test_first_rows_before_a_gap_are_not_counted_back_from_behind_it():
    true = np.concatenate((100.0 + 0.1 * np.arange(10), 140.0 + 0.1 * np.arange(40)))
    np.testing.assert_allclose(spread_equal_times(np.floor(true + 1e-6)), true, atol=1e-6)


OWN_MAP = """format = 1
[sources.log]
files = ["log.csv"]
[channels]
north = { from = "north [m]", unit = "m" }
east = { from = "east [m]", unit = "m" }
heading = { from = "heading [deg]", unit = "deg" }
r = { from = "r[deg/s]", unit = "deg/s" }
delta_r_cmd = { from = "delta_r_cmd[deg]", unit = "deg" }
"""


def doubled(t, rng):
    """Every twentieth row is written twice."""
    rows = np.sort(np.concatenate([np.arange(t.size), np.arange(0, t.size, 20)]))
    return t[rows], rows


def untouched(t, rng):
    return t, np.arange(t.size)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (doubled, "log.csv: 4.8% of the rows repeat a stamp; the last of each is read"),
        (rounded, "about 10.0 rows have one stamp, 1 s apart, of which the last is read; spread = true in"),
        (set_back, "set back by 7.2"),
        (swapped, "1 row is out of order"),
        (untouched, None),
    ],
)
def test_an_import_by_a_map_that_is_there_tells_it_too(tmp_path, capsys, change, words):
    log(tmp_path / "raw", change)
    (tmp_path / "map.toml").write_text(OWN_MAP)
    order = ["trial", "import", str(tmp_path / "raw" / "log.csv"), "--map", str(tmp_path / "map.toml")]
    assert bayesid([*order, "--out", str(tmp_path / "bundle")]) == 0
    said = capsys.readouterr().out
    odd = [
        line for line in said.splitlines() if "stamp" in line or "out of order" in line or "set back" in line
    ]
    assert not odd if words is None else [words in line for line in odd] == [True]
    assert words is None or words in (tmp_path / "bundle" / "provenance.json").read_text()
    if change is rounded:  # and no more so once the map spreads them
        text = OWN_MAP.replace('files = ["log.csv"]', 'files = ["log.csv"]\nspread = true')
        (tmp_path / "map.toml").write_text(text)
        assert bayesid([*order, "--out", str(tmp_path / "spread")]) == 0
        assert "stamp" not in capsys.readouterr().out


@pytest.mark.thorough
def test_sensors_that_share_a_stamp_in_rows_of_their_own_lose_nothing(tmp_path, capsys):
    """Position and orders have a row, heading and rate the next, of one stamp; control: rows that lose."""
    log(tmp_path / "raw", untouched)
    head, *rows = (tmp_path / "raw" / "log.csv").read_text().splitlines()
    path = tmp_path / "raw" / "log.csv"
    for shared in (True, False):
        lines = []
        for row in rows:
            t, north, east, psi, r, *rest = row.split(",")
            more = [] if shared else [north, east]
            lines.append(",".join([t, north, east, "", "", *rest]))
            lines.append(",".join([t, *(more or ["", ""]), psi, r, *["" for _ in rest]]))
        path.write_text("\n".join([head, *lines]) + "\n")
        (tmp_path / "map.toml").write_text(OWN_MAP)
        out = str(tmp_path / f"bundle{shared}")
        assert bayesid(["trial", "import", str(path), "--map", str(tmp_path / "map.toml"), "--out", out]) == 0
        assert ("have one stamp" in capsys.readouterr().out) is not shared
        found = propose([path])
        assert any("stamps of log.csv are rounded" in text for text in found.map.questions) is not shared
