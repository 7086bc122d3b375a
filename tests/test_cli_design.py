"""`bayesid compare` and `bayesid design` as a user meets them."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from bayesid.cli.main import run as bayesid
from bayesid.cli.output import rounded
from bayesid.manoeuvres import read_table

FIX = ["--fix", "X_udot,Y_vdot,N_rdot"]


def run(*args: str) -> int:
    return bayesid([str(a) for a in args])


@pytest.mark.thorough
def test_design_writes_orders_the_vehicle_can_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "next"
    args = ("--executed", "zigzag:10/10", "--duration", "400", "--rudder", "20", "--quick", "--json")
    assert run("design", "generic_sub", *FIX, *args, "--out", out) == 0
    record = json.loads(capsys.readouterr().out)
    assert record == rounded(json.loads((out / "design.json").read_text()))
    assert record["best"]["after"] < record["before"]
    orders = read_table(out / "next_manoeuvre.csv")
    assert abs(orders.commands["delta_r_cmd"]).max() <= 0.3491
    assert orders.t[-1] == pytest.approx(400, abs=1)
    text = (out / "report.md").read_text()
    assert "next_manoeuvre.csv" in text and "What the coefficients gain" in text
    assert run("simulate", "generic_sub", f"table:{out / 'next_manoeuvre.csv'}") == 0


@pytest.mark.thorough
def test_comparison_ranks_rich_runs_above_a_straight_one(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    args = ("--duration", "300", "--quick", "--json", "--also", "zigzag:5/5", "--out", tmp_path)
    assert run("compare", "generic_sub", *FIX, *args) == 0
    record = json.loads(capsys.readouterr().out)
    gains = {m["name"]: m["gain_nats"] for m in record["manoeuvres"]}
    assert list(gains.values()) == sorted(gains.values(), reverse=True)
    assert gains["multisine"] > gains["zigzag:5/5"] > 3 * gains["straight"]
    assert (tmp_path / "report.html").is_file() and (tmp_path / "comparison.json").is_file()


@pytest.mark.thorough
def test_a_trial_counts_as_executed_and_its_posterior_is_drawn_from(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    noise = [x for c in ("x=1", "y=1", "psi=0.009", "u=0.05", "v=0.05", "r=0.0005") for x in ("--noise", c)]
    executed = ("turn:20,duration=300s", "zigzag:10/10,duration=300s")
    assert (
        run("simulate", "generic_sub", *executed, "--dt", "2", "--seed", "1", *noise, "--out", tmp_path) == 0
    )
    capsys.readouterr()
    assert run("compare", tmp_path, *FIX, "--duration", "300", "--quick", "--json") == 0
    record = json.loads(capsys.readouterr().out)
    assert any("posterior of the runs executed" in n for n in record["notes"])
    added = {m["name"]: m["adds_nats"] for m in record["manoeuvres"]}
    gain = {m["name"]: m["gain_nats"] for m in record["manoeuvres"]}
    assert all(added[n] < gain[n] or gain[n] < 1e-6 for n in added)
    assert added["zigzag_10"] < 0.7 * gain["zigzag_10"]  # it was executed already


@pytest.mark.parametrize(
    ("args", "message"),
    [
        (("generic_sub", "--gain", "--predict", "turn:20"), "one goal at a time"),
        (("generic_sub", "--rudder", "60"), "beyond what it can do"),
        (("generic_sub", "--tell", "steady_force"), "name two effects or more"),
        (("generic_sub", "--rpm", "fast"), "LOW:HIGH"),
        (("generic_sub", "--fix", "N_nonsense"), "no coefficient N_nonsense"),
    ],
)
def test_what_cannot_be_designed_is_said_in_one_message(
    args: tuple[str, ...], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run("design", *args, "--quick") == 2
    assert message in " ".join(capsys.readouterr().err.replace("│", " ").split())
