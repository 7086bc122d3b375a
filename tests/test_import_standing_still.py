"""A position or heading that froze is asked about; a vehicle at rest, a track along an axis, a slow sensor
are not."""

from __future__ import annotations

import numpy as np
import pytest

from bayesid.trials.importing import propose
from tests.raw_logs import motion

DEG = np.pi / 180.0


def asked(tmp_path, change, speeds=True, seed=7, truth=None):
    truth = truth or motion(np.random.default_rng(seed))
    rng = np.random.default_rng(seed)
    count = truth["t"].size
    columns = {
        "t [s]": truth["t"], "lat [deg]": 59.43 + (truth["x"] + 0.05 * rng.normal(size=count)) / 111_300.0,
        "lon [deg]": 10.47 + (truth["y"] + 0.05 * rng.normal(size=count)) / 56_700.0,
        "heading [deg]": np.mod(truth["psi"] + 0.004 * rng.normal(size=count), 2 * np.pi) / DEG,
        "r [deg/s]": truth["r"] / DEG, "rudder_cmd [deg]": truth["delta_r_cmd"] / DEG,
        "rpm_cmd": truth["n_cmd"],
    }  # fmt: skip
    if speeds:
        columns |= {"u [m/s]": truth["u"] + 0.01 * rng.normal(size=count), "v [m/s]": truth["v"]}
    change(columns)
    lines = [",".join(columns)] + [
        ",".join(f"{v:.9g}" for v in row) for row in zip(*columns.values(), strict=True)
    ]
    (tmp_path / "log.csv").write_text("\n".join(lines) + "\n")
    return [q for q in propose([tmp_path / "log.csv"]).map.questions if "stands still" in q]


def frozen(first, last, *names):
    def change(columns):
        for name in names:
            values = columns[name].copy()
            at = slice(int(first * values.size), int(last * values.size))
            values[at] = values[at][0]
            columns[name] = values

    return change


@pytest.mark.parametrize("speeds", [True, False])
@pytest.mark.parametrize(
    ("first", "last", "names"),
    [
        (0.4, 0.7, ("lat [deg]", "lon [deg]")),
        (0.6, 1.0, ("lat [deg]", "lon [deg]")),  # to the end: whole runs hold nothing to contradict it
        (0.5, 0.53, ("lat [deg]", "lon [deg]")),
        (0.4, 0.6, ("lat [deg]",)),
        (0.5, 0.55, ("heading [deg]",)),
    ],
)
def test_a_column_that_stands_still_while_the_vehicle_moves_is_asked_about(
    tmp_path, speeds, first, last, names
):
    truth = motion(np.random.default_rng(7))
    start = truth["t"][int(first * truth["t"].size)]
    said = asked(tmp_path, frozen(first, last, *names), speeds)
    assert said
    assert all(f"from {start:.1f} to" in text for text in said)


def test_every_file_is_looked_at_and_the_question_names_it(tmp_path):
    """A freeze in the last of 14 files of a minute each."""
    asked(tmp_path, lambda columns: None)
    head, *rows = (tmp_path / "log.csv").read_text().splitlines()
    lat = head.split(",").index("lat [deg]")
    files = []
    for k in range(14):
        cut = [row.split(",") for row in rows[1000:1800]]
        if k == 13:
            for row in cut[200:600]:
                row[lat] = cut[200][lat]
        files.append(tmp_path / f"run{k + 1}.csv")
        files[-1].write_text("\n".join([head, *(",".join(row) for row in cut)]) + "\n")
    said = [q for q in propose(files).map.questions if "stands still" in q]
    assert len(said) == 1
    assert "in run14.csv from " in said[0]


def slow(columns):
    for name in ("lat [deg]", "lon [deg]", "heading [deg]"):
        columns[name] = columns[name][np.arange(columns[name].size) // 20 * 20]  # a fix every 2 s, held


def at_rest(columns):
    """A minute at the pier before and after: propeller off, receiver without noise."""
    for name, values in columns.items():
        if name != "t [s]":
            still = (
                0.0 if name in ("u [m/s]", "v [m/s]", "r [deg/s]", "rpm_cmd", "rudder_cmd [deg]") else None
            )
            ends = [np.full(600, values[k] if still is None else still) for k in (0, -1)]
            columns[name] = np.concatenate((ends[0], values, ends[1]))
    columns["t [s]"] = 0.1 * np.arange(columns["lat [deg]"].size)


@pytest.mark.parametrize("speeds", [True, False])
@pytest.mark.parametrize("change", [lambda columns: None, slow, at_rest])
def test_logs_in_order_are_not_asked_about(tmp_path, speeds, change):
    assert not asked(tmp_path, change, speeds)


def test_a_straight_run_along_an_axis_without_noise_is_no_frozen_column(tmp_path):
    """The turn's centre line runs north for 200 s, so that the longitude is one number all the while."""
    t = np.arange(0.0, 400.0, 0.2)
    order = np.where(t < 200.0, 0.0, 15.0 * DEG)
    r = np.where(t < 200.0, 0.0, -0.05 * (1.0 - np.exp(-(t - 200.0) / 5.0)))
    psi = np.cumsum(r) * 0.2
    x, y = np.cumsum(1.5 * np.cos(psi)) * 0.2, np.cumsum(1.5 * np.sin(psi)) * 0.2
    truth = {"t": t, "x": x, "y": y, "psi": psi, "r": r, "u": np.full(t.size, 1.5), "v": 0.0 * t,
             "delta_r_cmd": order, "n_cmd": np.full(t.size, 900.0)}  # fmt: skip

    def exact(columns):
        columns["lat [deg]"], columns["lon [deg]"] = 59.43 + x / 111_300.0, 10.47 + y / 56_700.0
        columns["heading [deg]"] = np.mod(psi, 2 * np.pi) / DEG

    assert not asked(tmp_path, exact, truth=truth)
