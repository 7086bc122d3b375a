"""Orders that some of the logs of an import lack: said at once, with runs, orders and what to do."""

from __future__ import annotations

import numpy as np
import pytest

from bayesid.cli.main import run as bayesid
from bayesid.diagnosis.input import orders_by_run
from bayesid.model.vehicles import load_vehicle
from bayesid.trials import Run, Trial

T = np.arange(0.0, 60.0, 0.5)
SWING = np.where((T // 10) % 2 == 0, 0.1, -0.1)
PSI = 0.3 * np.sin(T / 10)
NORTH, EAST = 0.5 * np.cumsum([np.cos(PSI), np.sin(PSI)], axis=1)
SHAFT = 700.0 + 1000.0 * SWING
MAP = """format = 1
vehicle = "{vehicle}"
[sources.log]
files = ["a.csv", "b.csv", "c.csv", "d.csv"]
time = "t [s]"
clock = "relative"
[channels]
north = {{ from = "north [m]", unit = "m" }}
east = {{ from = "east [m]", unit = "m" }}
heading = {{ from = "heading [rad]", unit = "rad" }}
delta_r_cmd = {{ from = "rudder [rad]", unit = "rad" }}
n_cmd = {{ from = "{shaft}", unit = "rpm" }}
"""


def logs(folder, **shafts):
    """A table per run, each with the column of shaft orders it is given; None: without that column."""
    for name, shaft in shafts.items():
        columns = {
            "t [s]": T, "north [m]": NORTH, "east [m]": EAST, "heading [rad]": PSI,
            "rudder [rad]": SWING, **({} if shaft is None else {"shaft": shaft}),
        }  # fmt: skip
        rows = zip(*columns.values(), strict=True)
        cells = [",".join("" if np.isnan(x) else f"{x:.5f}" for x in row) for row in rows]
        (folder / f"{name}.csv").write_text("\n".join([",".join(columns), *cells]) + "\n")
    return [str(folder / f"{name}.csv") for name in shafts]


def said_of(folder, capsys, vehicle="remus100", shaft="shaft", **shafts):
    files = logs(folder, **shafts)
    (folder / "map.toml").write_text(MAP.format(vehicle=vehicle, shaft=shaft))
    assert (
        bayesid(["trial", "import", *files, "--map", str(folder / "map.toml"), "--out", f"{folder}/b"]) == 0
    )
    said = capsys.readouterr().out
    _, found, rest = said.partition("Orders that are not there:\n")
    return rest.splitlines()[0] if found else "", said


EMPTY = np.full(T.size, np.nan)


@pytest.mark.parametrize("vehicle", ["remus100", ""])
@pytest.mark.parametrize("lost", [None, EMPTY], ids=["no column", "no reading"])
def test_runs_without_an_order_that_others_have_are_named(tmp_path, capsys, vehicle, lost):
    words, said = said_of(tmp_path, capsys, vehicle, a=SHAFT, b=lost, c=SHAFT, d=lost)
    assert "runs b and d have no n_cmd, which a and c have: simulated, it would be 0" in words
    assert "delete their [[runs]] tables in trial.toml" in words
    assert "Next: bayesid trial check" in said


@pytest.mark.parametrize("vehicle", ["remus100", ""])
@pytest.mark.parametrize(
    "shafts",
    [{"a": SHAFT, "b": SHAFT}, {"a": 0.0 * T, "b": None}],
    ids=["all have it", "it rests at 0 elsewhere"],
)
def test_nothing_is_said_where_nothing_is_lost(tmp_path, capsys, vehicle, shafts):
    assert said_of(tmp_path, capsys, vehicle, **shafts)[0] == ""


def test_an_order_of_the_map_that_no_log_has_is_told(tmp_path, capsys):
    words, _ = said_of(tmp_path, capsys, shaft="propeller", a=SHAFT, b=SHAFT)
    assert "no run has n_cmd, which the map names: correct `from` of each" in words


def test_other_actuators_in_place_of_one_are_not_lost_without_a_vehicle():
    """Two named rudders in place of one; control: the run that has one of them and nothing instead."""

    def trial(*orders):
        data = {"x": NORTH, "y": EAST, "psi": PSI}
        runs = (Run(f"r{k}", "", "identify", T, data, its) for k, its in enumerate(orders))
        return Trial("t", "", "", 3, tuple(runs))

    one, two = {"delta_r_cmd": SWING}, {"delta_port_cmd": SWING, "delta_stbd_cmd": SWING}
    assert orders_by_run(trial(one, two)) == ()
    (told,) = orders_by_run(trial(two, {"delta_port_cmd": SWING}))
    assert "run r1 has no delta_stbd_cmd, which r0 has" in told


def test_an_order_that_begins_late_is_told_with_a_vehicle():
    data = {"x": NORTH, "y": EAST, "psi": PSI}
    late = np.where(T < 20.0, np.nan, SWING)
    runs = tuple(
        Run(f"r{k}", "", "identify", T, data, {"delta_r_cmd": rudder, "n_cmd": SHAFT})
        for k, rudder in enumerate((SWING, late))
    )
    (told,) = orders_by_run(Trial("t", "remus100", "", 3, runs), load_vehicle("remus100"))
    assert "run r1 has no delta_r_cmd before t = 20 s" in told


@pytest.mark.parametrize("line", ['drop = ["n_cmd"]', 'rename = { n_cmd = "n" }'])
def test_an_order_that_corrections_drop_or_rename_is_not_said_to_be_missing(tmp_path, capsys, line):
    """It said "no run has n_cmd, which the map names: correct `from` of each, or delete its line"."""
    files = logs(tmp_path, a=SHAFT, b=SHAFT, c=SHAFT, d=SHAFT)
    (tmp_path / "map.toml").write_text(MAP.format(vehicle="", shaft="shaft") + f"[corrections]\n{line}\n")
    ordered = ["trial", "import", *files, "--map", str(tmp_path / "map.toml"), "--out", f"{tmp_path}/b"]
    assert bayesid(ordered) == 0
    assert "no run has n_cmd" not in capsys.readouterr().out
