"""Sparse regression as a check: exact where it must be, and silent where runs cannot tell."""

from __future__ import annotations

import json
import subprocess
import sys
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bayesid.analysis.excitation import LibraryColumn, exact_motion, excite, library
from bayesid.analysis.excitation.columns import evaluate, rows, theta
from bayesid.analysis.excitation.pysindy_regression import pysindy_terms
from bayesid.analysis.excitation.regression import excite_motions
from bayesid.analysis.excitation.row_selection import select_axis
from bayesid.analysis.excitation.track_smoother import smooth_tracks, stated_or_rough
from bayesid.cli.main import run as cli
from bayesid.equations.model import build_model
from bayesid.errors import ModelError, TrialError
from bayesid.manoeuvres import library as manoeuvre_library
from bayesid.model.vehicles import load_vehicle
from bayesid.report.excite import excitation_report
from bayesid.report.writer.markup import to_html
from bayesid.report.writer.write import versions
from bayesid.simulation import plan_run, steady_start
from bayesid.simulation.virtual_trial import virtual_run
from bayesid.trials import Trial
from studies.manoeuvre_richness.summaries import maps_of

# Sensor noise over L, L, 1, U/L, U, U at 19 readings per L/U: a navigation-grade set on a submarine.
SIGMA = {"x": 0.0127, "y": 0.0127, "psi": 0.0075, "r": 0.0139, "u": 0.0018, "v": 0.0018}


@pytest.fixture(scope="module")
def remus():
    return build_model(load_vehicle("remus100"), 3)


@pytest.fixture(scope="module")
def submarine():
    return build_model(load_vehicle("generic_sub"), 3)


def manoeuvres(model, dt=0.053):
    s = model.scales
    limit = min(0.35, model.vehicle.limits["delta_r"])
    return manoeuvre_library(s["L"], s["U"], model.vehicle.rpm_ref, limit, dt=dt * s["L"] / s["U"])


def executed(model, names, values=None, share=1.0, seed=1):
    """Noisy runs and the noise on them."""
    s = model.scales
    unit = {"x": s["L"], "y": s["L"], "psi": 1.0, "r": s["U"] / s["L"], "u": s["U"], "v": s["U"]}
    noise = {c: share * SIGMA[c] * unit[c] for c in SIGMA}
    rng = np.random.default_rng(seed)
    orders, par = manoeuvres(model), model.with_values(values or {})
    return [virtual_run(model, par, orders[n], name=n, noise=noise, rng=rng) for n in names], noise


def only(runs, channels):
    return [replace(run, data={c: run.data[c] for c in channels}) for run in runs]


def exact(model, names, values=None, dt=0.2):
    par, orders = model.with_values(values or {}), manoeuvres(model, dt)
    out = []
    for name in names:
        run = virtual_run(model, par, orders[name], name=name)
        out.append(exact_motion(model, par, plan_run(model, run.t, run.commands), steady_start(model), name))
    return out


def selection(found, name, beyond=False):
    fits = found.beyond if beyond else found.axes
    return next(w for f in fits for w in f.selections if w.name == name)


def cubic(model):
    """A planted v^3: one and a half prior sd of the catalogue's cubic damping."""
    s = model.scales
    return {"Y_vvv": -4.5 * s["rho"] * s["L"] ** 2 / (2 * s["U"])}


@pytest.mark.thorough
@pytest.mark.parametrize("name", ["remus100", "generic_sub", "nps_auv2"])
def test_columns_of_the_kernel_are_the_regressors_of_the_table(name):
    """Expected: the regressor strings evaluated by numpy, not by the generated kernel."""
    model = build_model(load_vehicle(name), 3)
    rng = np.random.default_rng(0)
    states = rng.standard_normal((20, 6)) * [1, 1, 1, 1, 0.3, 0.2] + [0, 0, 0, 2, 0, 0]
    act = rng.standard_normal((20, 2)) * [0.2, 5] + [0, model.vehicle.rpm_ref]
    columns = library(model)
    values, _, _ = theta(model, columns, states, act)
    for k, column in enumerate(columns):
        expected = evaluate(column.expression, model, states, act)
        np.testing.assert_allclose(values[:, k], expected, rtol=0, atol=1e-12 * np.abs(expected).max())


@pytest.mark.parametrize("name", ["remus100", "generic_sub"])
def test_without_noise_every_coefficient_comes_back(name):
    """Known truth. 5 400 to 17 600 rows, 58 columns of which 13 to 20 are true."""
    model = build_model(load_vehicle(name), 3)
    motions = exact(model, ["multisine", "zigzag_10_port", "chirp"])
    found = excite_motions(model, motions, form="strong", draws=10)
    told = [w for w in found.terms if w.in_model and w.status == "found"]
    assert len(told) >= 11
    for w in told:
        # of the axis' force: one part of a force of 1e-3 of the whole is known to 2e-12 / 1e-3
        nominal = model.nominal[model.index[w.name]]
        assert abs(w.value / nominal - 1.0) < 2e-12 / max(w.share, 2e-3), w.name
    assert not [w.name for w in found.terms if w.status == "found" and not w.in_model]
    assert not found.candidates and not found.candidate_groups


def test_terms_out_of_the_plane_are_not_excited_by_a_manoeuvre_in_it():
    planar = exact(build_model(load_vehicle("remus100"), 3), ["zigzag_10_port", "multisine"])
    whole = build_model(load_vehicle("remus100"), 6)
    at = [whole.states.index(n) for n in ("x", "y", "psi", "u", "v", "r")]
    columns = [c for c in library(whole) if set(c.expression) & set("wpq") or "delta_s" in c.expression]
    assert len(columns) > 40
    for motion in planar:
        states = np.zeros((motion.t.size, 12))
        states[:, at] = motion.states
        act = np.zeros((motion.t.size, 4))
        act[:, [0, 3]] = motion.actuators
        values, _, _ = theta(whole, columns, states, act)
        assert not values.any()
    found = excite_motions(build_model(load_vehicle("remus100"), 3), planar, form="strong", draws=10)
    assert found.inclusion["N_wp"] == found.inclusion["M_q"] == found.inclusion["Z_ds"] == 0.0


def test_a_bang_bang_rudder_cannot_tell_delta_from_delta_abs_delta(remus):
    """Two rudder angles only: u^2 delta and u^2 delta |delta| are parallel, and whichever is listed first
    must not win. With a third angle they part."""
    t = np.arange(0.0, 60.0, 0.1)
    bang = 0.15 * np.sign(np.sin(0.9 * t) + np.sin(0.37 * t + 1.0))
    speed = np.full(t.size, remus.vehicle.rpm_ref)
    par = remus.with_values({"inverse_rate_r": 1e-9})  # the one sample a servo takes would tell them apart
    columns = list(library(remus, extra=False))
    planted = LibraryColumn("N_dr|dr|", "N", "u*u*delta_r*abs(delta_r)", is_row=False)
    for order in ([*columns, planted], [planted, *columns]):
        found = {}
        for name, rudder in (("bang", bang), ("steps", np.where(t > 30, 0.5, 1.0) * bang)):
            plan = plan_run(remus, t, {"delta_r_cmd": rudder, "n_cmd": speed})
            motion = exact_motion(remus, par, plan, steady_start(remus))
            data = rows(remus, [motion], order, "strong")
            fit = select_axis(data, "N", 20, np.random.default_rng(0))
            found[name] = {w.name: w for w in fit.selections}
        for name in ("N_dr", "N_dr|dr|"):
            assert found["bang"][name].status == "cannot tell"
            assert set(found["bang"][name].group) == {"N_dr", "N_dr|dr|", "N_drdrdr"}
        assert found["steps"]["N_dr"].status == "found"
        assert found["steps"]["N_dr|dr|"].status == "not needed"


@pytest.mark.thorough
def test_a_steady_turn_cannot_tell_vv_from_vr_from_rr(submarine):
    """In a spiral v/r hardly changes (correlations above 0.999): X_vv, X_vr and X_rr make one force."""
    runs, noise = executed(submarine, ["spiral"])
    found = excite(submarine, runs, noise, draws=50)
    groups = [set(g) for g in found.groups]
    assert any({"X_vr", "X_vv"} <= g or {"X_vr", "X_rr"} <= g or {"X_vv", "X_rr"} <= g for g in groups)
    for name in ("X_vv", "X_vr", "X_rr", "N_r|r|", "N_|v|r", "N_v|v|", "Y_v|v|", "Y_v|r|"):
        assert selection(found, name).status != "found", name


@pytest.mark.slow
def test_a_plain_ensemble_names_terms_a_spiral_cannot_tell(submarine):
    """The control that must fail: pysindy's ensemble of single rows is sure of cubic terms that are not
    there."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # pysindy's dependencies warn on import
        from bayesid.analysis.excitation.sindy import ensemble
    runs, noise = executed(submarine, ["spiral"])
    motions, _ = smooth_tracks(submarine, runs, noise)
    kept = ensemble(submarine, motions, library(submarine, extra=False), "Y", threshold=0.05, draws=20)
    assert min(kept[n] for n in ("Y_vvv", "Y_vvr", "Y_vrr", "Y_rrr")) >= 0.8
    ours = excite_motions(submarine, motions, draws=20)
    assert not [n for n in ("Y_vvv", "Y_vvr", "Y_vrr", "Y_rrr") if selection(ours, n).status == "found"]


@pytest.mark.thorough
def test_a_planted_cubic_is_found_from_rich_runs_and_not_told_from_a_spiral(submarine):
    names = ["multisine", "zigzag_20_port", "prbs"]
    runs, noise = executed(submarine, names, cubic(submarine), share=0.3)
    rich = selection(excite(submarine, runs, noise, draws=50), "Y_vvv", beyond=True)
    assert rich.status == "found" and rich.inclusion >= 0.8
    (truth,) = cubic(submarine).values()
    assert abs(rich.value / truth - 1.0) < 0.15
    runs, noise = executed(submarine, ["spiral"], cubic(submarine), share=0.3)
    poor = excite(submarine, runs, noise, draws=50)
    assert selection(poor, "Y_vvv", beyond=True).status != "found"
    assert "Y_vvv" not in [w.name for w in poor.candidates]


@pytest.mark.thorough
def test_a_report_shows_commands_as_code(submarine):
    runs, noise = executed(submarine, ["multisine", "zigzag_20_port", "prbs"], cubic(submarine), share=0.3)
    found = excite(submarine, runs, noise, draws=20)
    assert found.candidates
    lead = excitation_report(found, Trial("pond", Path(), "generic_sub", 3, tuple(runs), noise)).lead
    assert "<code>bayesid diagnose</code>" in to_html(lead)


@pytest.mark.slow
def test_without_a_planted_term_rich_runs_ask_for_none(submarine):
    """The negative control of the planted cubic: same runs, same noise."""
    runs, noise = executed(submarine, ["multisine", "zigzag_20_port", "prbs"], share=0.3)
    assert not excite(submarine, runs, noise, draws=50).candidates


def test_smoothed_velocities_are_as_wrong_as_they_say(submarine):
    """Truth executed without noise. 95 % of z within 2.6: a Gaussian has 99 %, corners of rudder steps take
    the
    rest."""
    names = ["zigzag_20_port", "multisine"]
    runs, noise = executed(submarine, names)
    clean, _ = executed(submarine, names, share=0.0)
    motions, _ = smooth_tracks(submarine, runs, noise)
    for motion, run in zip(motions, clean, strict=True):
        for channel in ("u", "v", "r"):
            i = submarine.states.index(channel)
            truth = 0.5 * (run.data[channel][1:] + run.data[channel][:-1])
            z = (motion.states[:, i] - truth) / motion.sd[:, i]
            assert np.mean(np.abs(z) < 2.6) > 0.95, (channel, np.std(z))
            assert np.std(motion.states[:, i] - truth) < 0.5 * noise[channel]


def test_velocities_come_from_positions_and_heading_alone(submarine):
    runs, noise = executed(submarine, ["zigzag_20_port"], share=0.3)
    clean, _ = executed(submarine, ["zigzag_20_port"], share=0.0)
    motions, _ = smooth_tracks(submarine, only(runs, ("x", "y", "psi")), noise)
    truth = 0.5 * (clean[0].data["v"][1:] + clean[0].data["v"][:-1])
    wrong = motions[0].states[:, submarine.states.index("v")] - truth
    assert np.std(wrong) < 0.2 * np.std(truth)


@pytest.mark.thorough
def test_the_regression_is_by_pysindys_own_optimisers(submarine, monkeypatch):
    """With PySINDy's forward regression made to propose nothing, only what the vehicle file says is tried."""
    import pysindy

    motions = exact(submarine, ["zigzag_20_port"], dt=0.4)
    calls = []
    fit = pysindy.FROLS.fit
    monkeypatch.setattr(pysindy.FROLS, "fit", lambda self, x, y: (calls.append(1), fit(self, x, y))[1])
    pysindy_terms(submarine, motions, draws=2, form="strong")
    assert len(calls) > 9
    monkeypatch.setattr(pysindy.FROLS, "fit", lambda self, x, y: setattr(self, "history_", []))
    assert all(g.inclusion == 0.0 for g in pysindy_terms(submarine, motions, draws=2, form="strong"))
    assert "pysindy" in versions()


@pytest.mark.thorough
def test_pysindy_is_loaded_when_it_is_used_and_not_before():
    code = "import bayesid, bayesid.api.excite, bayesid.cli.excite, sys; sys.exit('pysindy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


@pytest.mark.thorough
def test_pysindy_finds_terms_of_rich_runs_and_groups_of_a_spiral(submarine):
    """Known truth: the vehicle file. No term that is absent is found singly in either."""
    runs, noise = executed(submarine, ["multisine", "zigzag_20_port", "prbs"], share=0.3)
    motions, _ = smooth_tracks(submarine, runs, noise)
    rich = {g.names[0]: g for g in pysindy_terms(submarine, motions, draws=20) if len(g.names) == 1}
    singly = {n for n, g in rich.items() if g.status == "found"}
    assert {"X_drdr", "Y_dr", "Y_v"} <= singly
    assert all(submarine.nominal[submarine.index[n]] != 0 for n in singly)
    for name in ("X_drdr", "Y_dr", "Y_v"):  # others err by more: a spread knows nothing of a wrong selection
        truth = submarine.nominal[submarine.index[name]]
        assert abs(rich[name].value - truth) < 3.5 * max(rich[name].sd, 0.01 * abs(truth)), name
    runs, noise = executed(submarine, ["spiral"], share=0.3)
    motions, _ = smooth_tracks(submarine, runs, noise)
    poor = pysindy_terms(submarine, motions, draws=20)
    found = [g for g in poor if g.status == "found"]
    tied = ("X_vv", "X_vr", "X_rr", "Y_v", "Y_r", "Y_v|v|", "Y_v|r|", "N_v", "N_r", "N_r|r|", "N_|v|r")
    assert not [g.names for g in found if len(g.names) == 1 and g.names[0] in tied]
    assert all(len(g.names) > 1 or g.in_model for g in found)


def test_records_of_older_studies_are_read():
    row = {"name": "zigzag", "contraction": {"N_r": 0.5}, "contraction_refits": None}
    for key in ("sindy_inclusion", "sparse_inclusion"):
        record = {"manoeuvres": [{**row, key: {"N_r": 0.9}}], "coefficients": ["N_r"]}
        assert maps_of({"comparison": record})[4] == np.array([[0.9]])


def test_pysindy_finds_the_same_coefficients(remus):
    """Expected: pysindy's own STLSQ, without noise, threshold between true and false terms."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # pysindy's dependencies warn on import
        from bayesid.analysis.excitation.sindy import stlsq
    motions = exact(remus, ["multisine", "zigzag_10_port", "chirp"])
    columns = [c for c in library(remus, extra=False) if c.axis == "Y"]
    values = stlsq(remus, motions, columns, "Y", threshold=1e-6)
    assert {n for n, v in values.items() if v != 0.0} == {c.name for c in columns if c.in_model}
    for column in columns:
        if column.in_model:
            assert values[column.name] == pytest.approx(column.nominal, rel=1e-8), column.name


def test_noise_that_is_not_stated_is_taken_from_the_log(submarine):
    runs, noise = executed(submarine, ["zigzag_20_port", "multisine"])
    found = stated_or_rough(runs, {"x": noise["x"]})
    assert found["x"] == noise["x"]
    for channel in ("y", "psi", "r", "u", "v"):
        assert found[channel] == pytest.approx(noise[channel], rel=0.15)
    clean, _ = executed(submarine, ["multisine"], share=0.0)
    assert smooth_tracks(submarine, clean, {})[0][0].sd.max() < 1.0


def test_a_log_without_speed_or_position_is_refused(submarine):
    runs, noise = executed(submarine, ["zigzag_10_port"])
    with pytest.raises(TrialError, match="u, v cannot be had from psi, r"):
        smooth_tracks(submarine, only(runs, ("psi", "r")), noise)


def test_wrong_forms_and_empty_sets_are_refused(submarine):
    with pytest.raises(ModelError, match="at least one"):
        excite(submarine, [], {})
    motions = exact(submarine, ["zigzag_10_port"])
    with pytest.raises(ModelError, match="choose weak or strong"):
        rows(submarine, motions, library(submarine), "odd")
    with pytest.raises(ModelError, match="no weak form"):
        rows(submarine, motions, library(submarine), "weak")


@pytest.mark.thorough
def test_the_command_writes_report_and_json(tmp_path, capsys):
    bundle = tmp_path / "bundle"
    noise = ["--noise", "u=0.01", "--noise", "v=0.01", "--noise", "r=0.0007", "--noise", "psi=0.005"]
    orders = ["zigzag:20/20", "prbs:duration=600s"]
    assert cli(["simulate", "generic_sub", *orders, "--dt", "2", *noise, "--out", str(bundle)]) == 0
    capsys.readouterr()
    assert cli(["excite", str(bundle), "--quick", "--out", str(tmp_path / "out")]) == 0
    assert "Y_dr" in capsys.readouterr().out
    record = json.loads((tmp_path / "out" / "excitation.json").read_text())
    assert {"Y_dr", "N_dr"} <= {n for g in record["pysindy"] if g["status"] == "found" for n in g["names"]}
    assert 0 <= record["fisher"]["Y_dr"]["share_of_runs"] <= 1
    assert record["runs"] == ["r1", "r2"] or len(record["runs"]) == 2
    assert {"found", "cannot tell"} & {t["status"] for t in record["axes"]["Y"]["terms"]}
    assert (tmp_path / "out" / "report.html").exists()
    assert "<h1>Forces excited by" in (tmp_path / "out" / "report.html").read_text()
