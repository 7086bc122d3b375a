"""`bayesid vehicle` and `bayesid trial` answer in words and in JSON; a bad file is refused in one message."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import bayesid.model.vehicles
from bayesid.cli.main import run
from bayesid.cli.output import rounded
from bayesid.cli.run_measures import print_measures
from bayesid.measures import named_measures as measure
from bayesid.model.terms import TERMS
from bayesid.model.vehicles import builtin_names, coef_si, load_vehicle
from bayesid.trials import load_trial, trial_summary


@pytest.fixture
def bundle(tmp_path):
    """A straight run of 60 s at 2 m/s, logged every second."""
    folder = tmp_path / "pond"
    folder.mkdir()
    t = np.arange(61.0)
    rng = np.random.default_rng(3)
    x = 2.0 * t + 0.05 * rng.standard_normal(t.size)
    rows = [f"{a:g},{b:.4f},0.0,0.0,{10 * (-1) ** int(a // 15)}" for a, b in zip(t, x, strict=True)]
    (folder / "r1.csv").write_text("t[s],x[m],y[m],psi[deg],delta_r_cmd[deg]\n" + "\n".join(rows) + "\n")
    (folder / "trial.toml").write_text(
        'format = 1\nname = "pond <b>July</b>"\nvehicle = "remus100"\ndof = 3\n'
        '[[runs]]\nfile = "r1.csv"\nmanoeuvre = "straight"\nrole = "identify"\n'
    )
    return folder


def test_vehicle_list_names_every_built_in_set(capsys):
    assert run(["vehicle", "list"]) == 0
    out = capsys.readouterr().out
    assert all(name in out for name in builtin_names())


def test_vehicle_show_gives_every_coefficient_with_its_si_value(capsys):
    assert run(["vehicle", "show", "generic_sub", "--json"]) == 0
    shown = json.loads(capsys.readouterr().out)
    vehicle = load_vehicle("generic_sub")
    values = {row["name"]: row["si"] for row in shown["coefficients"]}
    assert set(vehicle.coef) <= set(values)
    expected = {name: si for name, si in coef_si(vehicle).items() if name in values}
    assert values == pytest.approx(expected, rel=1e-5)  # six digits are printed
    assert shown["digest"] == vehicle.digest
    assert run(["vehicle", "show", "generic_sub", "-v"]) == 0
    assert "N_v" in capsys.readouterr().out


THRUSTER_BOAT = """
format = 1
[vehicle]
name = "boat"
nondimensional = false
planar_only = true
convention = "{convention}"
rho = 1000.0
L = 2.0
mass = 62.0
Izz = 20.0
[propulsion]
model = "quadratic"
rpm_ref = 1000.0
{crossflow}
[coef]
X_udot = -5.6
Y_vdot = -75.0
N_rdot = -12.2
N_v = 12.6
N_r = -10.0
Y_v = -20.0
[actuators.port]
at = [-0.8, -0.4, 0.0]
direction = [1.0, 0.0, 0.0]
T_nn = 2.0e-5
lag = 0.2
[actuators.stbd]
at = [-0.8, 0.4, 0.0]
direction = [1.0, 0.0, 0.0]
T_nn = 2.0e-5
"""


def test_vehicle_show_tells_lag_cross_flow_and_what_the_convention_of_the_file_adds(tmp_path, capsys):
    def shown(convention, crossflow="[crossflow]\nCdy = 1.35\nheight = 0.145"):
        path = tmp_path / "boat.toml"
        path.write_text(THRUSTER_BOAT.format(convention=convention, crossflow=crossflow))
        assert run(["vehicle", "show", str(path)]) == 0
        return capsys.readouterr().out

    fossen = shown("fossen")
    assert " Cdy 1.35, height [m] 0.145, sections 21\n" in fossen
    port, stbd = (next(x for x in fossen.splitlines() if x.startswith(f"{n} ")) for n in ("port", "stbd"))
    assert port.endswith("T_nn 2.000e-05, lag 0.2") and "lag" not in stbd
    words = " ".join(fossen.split())
    # Munk's moment: Y_vdot - X_udot = -69.4
    assert "N_v -56.8 (12.6 in the file); X_vr and Y_r are that part alone." in words
    assert "The file is in Fossen's convention; rows here hold the part of the added mass too" in words
    assert not any(line.startswith(("Z_", "K_", "M_")) for line in fossen.splitlines())
    assert "usual speed of the thrusters [rpm]  1000\n" in fossen and "shaft" not in fossen
    plain = shown("gertler-hagen", "")
    assert "Fossen" not in plain and "N_v" in plain and "-56.8" not in plain
    assert next(x for x in plain.splitlines() if "cross-flow drag" in x).endswith("  not stated")
    upright = THRUSTER_BOAT.replace("planar_only = true", "Ixx = 5.0\nIyy = 20.0").format(
        convention="fossen", crossflow=""
    )
    (tmp_path / "upright.toml").write_text(upright)
    assert run(["vehicle", "show", str(tmp_path / "upright.toml"), "--json"]) == 0
    names = {row["name"] for row in json.loads(capsys.readouterr().out)["coefficients"]}
    assert {"Z_vp", "K_vw", "M_w"} < names


def test_the_speed_of_a_run_is_that_of_its_track_where_no_velocity_is_logged(bundle):
    (run_,) = trial_summary(load_trial(bundle))["runs"]  # 2 m/s, positions to 0.05 m each second
    low, high = run_["speed"]
    assert 1.7 < low <= 2.0 <= high < 2.3


@pytest.mark.thorough
def test_a_trial_that_logs_roll_is_planar_where_its_vehicle_is(bundle, capsys):
    text = (bundle / "r1.csv").read_text().splitlines()
    rolled = [
        text[0] + ",phi[deg],p[deg/s],theta[deg],q[deg/s],z[m]",
        *(f"{line},0.1,0,0,0,0" for line in text[1:]),
    ]
    (bundle / "r1.csv").write_text("\n".join(rolled) + "\n")
    toml = (bundle / "trial.toml").read_text().replace("dof = 3\n", "")
    for vehicle, said in (
        ("remus100", "6 degrees of freedom, "),
        ("kvlcc2_mmg", "3 degrees of freedom (more"),
    ):
        (bundle / "trial.toml").write_text(toml.replace("remus100", vehicle))
        run(["trial", "check", str(bundle)])
        assert said in capsys.readouterr().out


def test_vehicle_terms_prints_every_row_of_the_axes_asked_for(capsys):
    def asked(*axes):
        assert run(["vehicle", "terms", *axes, "--json"]) == 0
        return json.loads(capsys.readouterr().out)

    rows = [row for row in asked() if row["row"]]
    assert {row["name"] for row in rows} == {t.name for t in TERMS if not t.is_number}
    some = {row["name"] for row in asked("YN") if row["row"]}
    assert some == {row["name"] for row in rows if row["axis"] in "YN"} and "N_|v|r" in some
    assert {row["axis"] for row in asked("x")} == {"X"}
    assert {row["name"] for row in asked() if not row["row"]} == {t.name for t in TERMS if t.is_number}
    assert run(["vehicle", "terms", "Y"]) == 0
    said = capsys.readouterr().out
    assert "Y_v|v|" in said and "N_r" not in said
    assert run(["vehicle", "terms", "YQ"]) == 2
    assert "no axis Q" in capsys.readouterr().err


def test_a_misspelt_vehicle_is_exit_code_2_with_a_suggestion(capsys):
    assert run(["vehicle", "show", "remus10"]) == 2
    assert "remus100" in capsys.readouterr().err


def test_trial_check_says_what_a_bundle_holds(bundle, tmp_path, capsys):
    assert run(["trial", "check", str(bundle), "--out", str(tmp_path / "out")]) == 0
    out = capsys.readouterr().out
    assert "1 run, 3 degrees of freedom, vehicle remus100" in out and "straight" in out
    stored = json.loads((tmp_path / "out" / "trial_check.json").read_text())
    assert stored["runs"][0]["samples"] == 61 and stored["vehicle_problem"] is None
    assert run(["trial", "check", str(bundle), "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == rounded(stored)


def test_trial_check_counts_the_runs_that_are_held_out(bundle, capsys):
    assert run(["trial", "check", str(bundle)]) == 0
    assert "No run is held out" in capsys.readouterr().out
    toml, other = bundle / "trial.toml", bundle / "other.csv"
    first = next(bundle.glob("*.csv"))
    other.write_text(first.read_text())
    toml.write_text(toml.read_text() + '\n[[runs]]\nfile = "other.csv"\nrole = "holdout"\n')
    assert run(["trial", "check", str(bundle)]) == 0
    out = capsys.readouterr().out
    assert "2 runs (1 of them held out), 3 degrees of freedom" in out and "No run is held out" not in out


def test_trial_check_finds_a_vehicle_that_cannot_be_read(bundle, capsys):
    text = (bundle / "trial.toml").read_text().replace('"remus100"', '"vehicle.toml"')
    (bundle / "trial.toml").write_text(text)
    (bundle / "vehicle.toml").write_text("[vehicle]\n")
    assert run(["trial", "check", str(bundle)]) == 2
    assert "vehicle" in capsys.readouterr().out


OUTSIDE = b"format = 1\n[[runs]]\nfile = '../../etc/passwd'"


@pytest.mark.parametrize("content", [b"", b"\xff\xfe", b"format = 2", OUTSIDE])
def test_a_broken_bundle_is_exit_code_2_without_traceback(content, tmp_path, capsys):
    (tmp_path / "trial.toml").write_bytes(content)
    assert run(["trial", "check", str(tmp_path)]) == 2
    err = capsys.readouterr().err
    assert err.startswith("bayesid: ") and "Traceback" not in err and "unexpected" not in err


@pytest.mark.thorough
@pytest.mark.parametrize("name", builtin_names())
def test_vehicle_check_judges_every_built_in_set(name, capsys):
    assert run(["vehicle", "check", name, "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["stability"]["speed [m/s]"] > 0
    assert all(finding["level"] in ("warning", "note") and finding["text"] for finding in answer["findings"])
    assert all(item["rows"] for item in answer["behaviour"]), "each manoeuvre can be executed and measured"


@pytest.mark.parametrize(
    ("name", "said", "unsaid"),
    [
        pytest.param(
            "remus100", ("G_H", "unstable with fixed rudder", "G_V", "unstable with fixed planes"), (),
            marks=pytest.mark.thorough,
        ),
        ("differential_boat", ("G_H", "unstable with equal thrusts"), ("fixed rudder",)),
        ("six_thruster_rov", ("slowest eigenvalue, horizontal",), ("G_H", "fixed rudder", "G_V =", "planes")),
    ],
)  # fmt: skip
def test_of_a_vehicle_that_thrusters_hold_no_stability_with_fixed_fins_is_said(name, said, unsaid, capsys):
    run(["vehicle", "check", name])
    shown = capsys.readouterr().out
    assert all(words in shown for words in said)
    assert not any(words in shown for words in unsaid)


@pytest.mark.parametrize(
    ("name", "orders", "there"),
    [
        ("six_thruster_rov", [f"n_{k}_cmd[rpm]" for k in range(1, 7)], False),
        ("lauv", ["delta_r_cmd[rad]"], True),
    ],
)
def test_a_vehicle_without_a_rudder_has_no_column_of_it(name, orders, there, tmp_path, capsys):
    t = np.arange(0.0, 30.0, 0.5)
    columns = {"t[s]": t, "x[m]": t, "y[m]": 0.0 * t, "psi[rad]": 0.0 * t, "u[m/s]": 1.0 + 0.0 * t}
    columns |= {order: np.sign(np.sin(t)) for order in orders}
    rows = np.column_stack(list(columns.values()))
    np.savetxt(tmp_path / "r.csv", rows, delimiter=",", header=",".join(columns), comments="")
    head = f'format = 1\nname = "n"\nvehicle = "{name}"\n[[runs]]\nfile = "r.csv"\nrole = "identify"\n'
    (tmp_path / "trial.toml").write_text(head)
    run(["trial", "check", str(tmp_path)])
    out = capsys.readouterr()
    assert out.err == "", out
    header = next(line for line in out.out.splitlines() if line.startswith("run "))
    assert ("rudder [deg]" in header) == there
    assert header.split()[-1] == "manoeuvre"


def test_vehicle_check_warns_of_a_positive_damping(tmp_path, capsys):
    path = Path(bayesid.model.vehicles.__file__).parent / "builtin" / "remus100.toml"
    (tmp_path / "odd.toml").write_text(path.read_text().replace('"N_r|r|" = -94.0', '"N_r|r|" = 94.0'))
    assert run(["vehicle", "check", str(tmp_path / "odd.toml"), "--json"]) == 3
    assert any(f["level"] == "warning" for f in json.loads(capsys.readouterr().out)["findings"])
    assert run(["vehicle", "check", str(tmp_path / "odd.toml")]) == 3
    out = capsys.readouterr().out
    assert "Unphysical or contradictory:" in out and "N_r|r|" in out and "G_H" in out


@pytest.mark.parametrize(("effect", "code"), [("rudder_lag", 2), ("actuator_lag", 0)])
def test_vehicle_check_refuses_an_effect_that_nobody_declares(effect, code, tmp_path, capsys):
    path = Path(bayesid.model.vehicles.__file__).parent / "builtin" / "remus100.toml"
    (tmp_path / "boat.toml").write_text(path.read_text() + f"\n[effects.{effect}]\ntau = 0.1\n")
    assert run(["vehicle", "check", str(tmp_path / "boat.toml")]) == code
    told = capsys.readouterr()
    assert ("Nothing missing for: simulate" in told.out) == (code == 0)
    if code:
        assert "nobody declares rudder_lag.tau (did you mean actuator_lag.tau" in told.err


def test_a_circle_is_measured_by_its_geometry(capsys):
    """Radius 50 m at 2 m/s after 20 s straight: advance = transfer = 50 m, tactical diameter 100 m."""
    t = np.arange(0.0, 400.0, 0.5)
    psi = np.clip((t - 20.0) * 2.0 / 50.0, 0.0, None)
    x = np.where(t < 20, 2.0 * t, 40.0 + 50.0 * np.sin(psi))
    y = np.where(t < 20, 0.0, 50.0 * (1.0 - np.cos(psi)))
    (turn,) = measure(
        "Turning circle starboard 20",
        t,
        {"x": x, "y": y, "psi": psi, "delta_r": np.where(t < 20, 0.0, -0.35)},
    )
    values = {name: value for name, value, _ in turn["rows"]}
    assert turn["kind"] == "turning circle"
    assert values["advance"] == pytest.approx(50.0, abs=0.1)
    assert values["transfer"] == pytest.approx(50.0, abs=0.1)
    assert values["tactical diameter"] == pytest.approx(100.0, abs=0.1)
    assert values["steady yaw rate"] == pytest.approx(np.degrees(2.0 / 50.0), rel=1e-3)
    print_measures([turn])
    assert "tactical diameter" in capsys.readouterr().out


def test_an_undescribed_run_is_not_measured_and_a_missing_channel_is_named():
    t = np.arange(10.0)
    assert measure("free running", t, {}) == []
    (result,) = measure("zig-zag 10/10", t, {"psi": t})
    assert result["rows"] == [] and result["reasons"] == {"all": "not logged: delta_r"}


def test_trial_measure_answers_for_every_run(bundle, capsys):
    assert run(["trial", "measure", str(bundle)]) == 0
    assert "no standard manoeuvre named" in capsys.readouterr().out
    toml = bundle / "trial.toml"
    toml.write_text(toml.read_text().replace('"straight"', '"zig-zag 10/10"'))
    assert run(["trial", "measure", str(bundle), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["r1"]["measures"][0]["kind"] == "zig-zag"
