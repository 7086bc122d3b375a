"""A trial is fitted, held-out runs are predicted and not read, and the vehicle found can be used again."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from test_smoothed_start import trial_of

from bayesid.api.fit import FitResult, fit
from bayesid.api.inputs import prepared
from bayesid.api.predict import predict
from bayesid.equations.model import build_model
from bayesid.errors import FitError
from bayesid.estimation.output_error.problem import FitProblem
from bayesid.estimation.output_error.read_run import output_error_run
from bayesid.estimation.output_error.trial_setup import measured_base
from bayesid.estimation.trial_fit import _head_state, fit_trial, memory, outcomes, within_widths
from bayesid.manoeuvres import turn, zigzag
from bayesid.model.params import ParameterSet
from bayesid.model.vehicles import coef_si, load_vehicle
from bayesid.prediction.draws import DivergingDraws
from bayesid.report.fit import failed_checks, fit_report, next_steps, write_fit_report
from bayesid.report.fit_first_screen import unphysical
from bayesid.simulation.virtual_trial import virtual_trial

NOISE = {"x": 1.0, "y": 1.0, "psi": 0.01, "u": 0.05, "v": 0.05, "r": 1e-3}
FREE = ("Y_v", "N_v", "Y_r", "N_r", "Y_dr", "N_dr")


@pytest.fixture(scope="module")
def trial():
    model = build_model(load_vehicle("generic_sub"), 3)
    truth = model.with_values({n: 1.15 * model.nominal[model.index[n]] for n in FREE})
    manoeuvres = {
        "zz": zigzag(0.35, 0.35, 90.0, 10.0, 300.0, 1.0),
        "back": zigzag(-0.2, 0.2, 90.0, 10.0, 300.0, 1.0),
        "circle": turn(0.3, 90.0, 20.0, 300.0, 1.0),
    }
    rng = np.random.default_rng(2)
    return virtual_trial(
        model,
        truth,
        manoeuvres,
        title="twin <b>&",
        vehicle_ref="generic_sub",
        noise=NOISE,
        rng=rng,
        holdout=("circle",),
    )


@pytest.fixture(scope="module")
def found(trial, tmp_path_factory):
    return fit_trial(trial, out=tmp_path_factory.mktemp("fit"), free=FREE, use_prior=False)


def test_held_out_runs_are_predicted_at_the_noise(found):
    (circle,) = [r for r in found.runs if r.role == "holdout"]
    before, after = circle.rms_nominal / circle.sigma, circle.rms_fitted / circle.sigma
    assert before.max() > 10
    # the initial state is read from the first 40 s of a noisy run, hence not quite 1
    assert after.max() < 2.5


def test_held_out_readings_do_not_reach_the_fit(trial, found):
    spoiled = tuple(
        replace(r, data={k: v + 100.0 for k, v in r.data.items()}) if r.role == "holdout" else r
        for r in trial.runs
    )
    again = fit_trial(replace(trial, runs=spoiled), free=FREE, use_prior=False)
    assert np.array_equal(again.fit.z, found.fit.z)


def test_the_identified_vehicle_is_a_vehicle_file_with_its_covariance(trial, tmp_path):
    found = fit_trial(trial, out=tmp_path, free=FREE, use_prior=False)
    vehicle = load_vehicle(tmp_path / "vehicle.toml")
    values = coef_si(vehicle)
    for name, value in found.fit.values.items():
        assert values[name] == pytest.approx(value, rel=1e-12)
    assert set(FREE) == set(vehicle.prior.names)
    model = build_model(vehicle, 3)
    for name, sd in zip(found.fit.names, found.fit.sd[:6], strict=False):
        assert model.prior_sd(name) == pytest.approx(sd, rel=0.02)  # the bounds add a little


def test_a_second_fit_starts_from_the_first_and_keeps_what_it_knew(trial, found):
    again = fit_trial(trial, found.identified, free=FREE)
    moved = (again.fit.z[:6] - found.fit.z[:6]) / found.fit.sd[:6]
    assert np.abs(moved).max() < 0.3
    assert (again.fit.sd[:6] < found.fit.sd[:6]).all()


@pytest.mark.thorough
def test_the_report_shows_verdict_coefficients_residuals_and_runs(found, tmp_path):
    page = write_fit_report(found, tmp_path).read_text()
    text = (tmp_path / "report.md").read_text()
    for name in FREE:
        assert name in text
    assert "twin <b>&" not in page and "held out: predicted" in page
    stored = json.loads((tmp_path / "results.json").read_text())
    assert (
        stored["verdict"] == found.fit.verdict and stored["fit"]["values"]
        if "values" in stored["fit"]
        else True
    )
    for png in (tmp_path / "figures").glob("*.png"):
        assert png.stat().st_size < 200_000


@pytest.mark.thorough
def test_an_open_combination_is_in_the_report_by_name(trial):
    names = (*FREE, "Y_vdot", "Y_rdot", "Y_v|v|", "Y_v|r|", "Y_|r|dr")
    loose = fit_trial(trial, free=names, use_prior=False)
    assert not loose.fit.success and loose.fit.converged
    sections = {s.title: s for s in fit_report(loose).sections}
    rows = sections["What the data leave open"].blocks[1].rows
    assert any("Y_rdot" in row[0] and row[1] == "none at all" for row in rows)
    assert any("do not determine" in text for text in fit_report(loose).failures)


def test_a_vehicle_that_cannot_follow_a_run_is_shown_as_missing(found, trial):
    wild = replace(found.vehicle, coef={**found.vehicle.coef, "N_r": 50 * abs(found.vehicle.coef["N_r"])})
    problem = replace(found.problem, model=build_model(wild, 3))
    runs = outcomes(problem, trial, found.fit)
    assert all(np.isnan(r.nominal).all() and np.isnan(r.rms_nominal).all() for r in runs)
    fit_report(replace(found, runs=runs))
    turned = replace(found, runs=tuple(replace(r, fitted=r.nominal, rms_fitted=r.rms_nominal) for r in runs))
    for shown, lost in ((found, False), (turned, True)):
        assert any("diverges: nothing can be predicted" in text for text in failed_checks(shown)) == lost
        steps = " ".join(next_steps(shown))
        assert ("Do not predict" in steps) == lost and ("`bayesid predict" in steps) != lost


def test_of_a_search_that_did_not_converge_no_prediction_is_recommended(found):
    unfinished = replace(found, fit=replace(found.fit, status="stalled"))
    assert "Do not predict with THIS_FOLDER: its search did not converge." in next_steps(unfinished)
    assert "`--free`" in next_steps(unfinished)[0] and "`--pieces SECONDS`" in next_steps(unfinished)[0]


def test_what_the_data_leave_open_has_the_spread_of_its_bounds_and_the_rest_its_own():
    rng = np.random.default_rng(5)
    q = np.linalg.qr(rng.standard_normal((4, 4)))[0]
    sizes = np.array([1e-4, 1e-2, 1e3, 1e7])  # the last two are open
    covariance, width = (q * sizes) @ q.T, np.array([1.0, 2.0, 0.5, 1.0])
    found = within_widths(covariance, width)
    exact = np.linalg.inv((q / sizes) @ q.T + np.diag(width**-2.0))
    assert found == pytest.approx(exact, rel=1e-3, abs=1e-7)
    sd = np.sqrt(np.diag(found))
    assert np.all(sd <= width) and np.linalg.eigvalsh(found / np.outer(sd, sd))[0] > -1e-12
    small = np.diag([1e-6, 1e-4])
    assert within_widths(small, np.array([1.0, np.inf])) == pytest.approx(small, rel=1e-4)
    assert within_widths(small, np.full(2, np.inf)) is small


@pytest.mark.thorough
def test_a_fit_that_leaves_much_open_writes_a_vehicle_that_can_be_read(trial, tmp_path):
    names = (*FREE, "Y_vdot", "Y_rdot", "Y_v|v|", "Y_v|r|", "Y_|r|dr", "N_vdot", "N_v|v|", "X_rr", "X_vv")
    loose = fit_trial(trial, out=tmp_path, free=names, use_prior=False)
    assert not loose.fit.success
    assert set(load_vehicle(tmp_path / "vehicle.toml").prior.names) == set(names)


def test_added_mass_of_the_wrong_sign_is_a_failed_check_unless_it_was_given_so(found):
    known = found.identified.coef
    turned = replace(found.identified, coef={**known, "Y_vdot": -known["Y_vdot"]})
    wrong = replace(found, identified=turned)
    assert any("No real vehicle has these coefficients: Y_vdot" in text for text in failed_checks(wrong))
    assert "Do not predict with THIS_FOLDER: no real vehicle has its coefficients." in next_steps(wrong)
    given = replace(wrong, problem=replace(found.problem, model=build_model(turned, 3)))
    for fine in (found, given):
        assert not any("No real vehicle" in text for text in failed_checks(fine))


def test_a_row_of_a_model_form_and_a_sign_that_is_not_told_are_no_failed_check(found):
    """Damping of the form is beside the vehicle's own; a sign within its deviation is none."""
    i = found.fit.names.index("N_dr")
    turned = replace(found.identified, coef={**found.identified.coef, "N_dr": -found.identified.coef["N_dr"]})
    wrong = replace(found, identified=turned)
    assert any("No real vehicle has these coefficients: N_dr" in text for text in failed_checks(wrong))
    sd = np.array(found.fit.sd)
    sd[i] = abs(found.fit.z[i])
    unsure = replace(wrong, fit=replace(found.fit, sd=sd))
    form = {**found.fit.uncertainty, "form": {"size": 1e-3, "rows": {"N_dr": 1e-3}}}
    formed = replace(wrong, fit=replace(found.fit, uncertainty=form))
    for fine in (unsure, formed):
        assert unphysical(fine) == []


def test_a_warning_that_rests_on_no_sign_stands_however_unsure_its_row_is(found):
    """Hull drag that the propulsion holds already is counted twice whatever its deviation is."""
    doubled = found.identified.coef | {"X_uu": -0.001}
    polynomial = load_vehicle("generic_sub").propulsion
    vehicle = replace(found.identified, coef=doubled, propulsion=polynomial)
    fit = found.fit
    free = replace(fit, names=("X_uu", *fit.names[1:]), z=np.r_[-0.001, fit.z[1:]], sd=np.r_[1.0, fit.sd[1:]])
    wrong = replace(found, identified=vehicle, fit=free)
    assert any("adds it again" in text for text in unphysical(wrong))
    pushed = replace(wrong, identified=replace(vehicle, coef=doubled | {"X_uu": 0.001}))
    assert [text for text in unphysical(pushed) if "X_uu" in text] == unphysical(wrong)
    told = replace(pushed, fit=replace(free, z=np.r_[0.001, fit.z[1:]], sd=np.r_[1e-4, fit.sd[1:]]))
    assert any("X_uu = 0.001 is positive" in text for text in unphysical(told))


def test_where_no_model_was_written_the_fit_that_writes_one_is_named(found):
    assert any("fit without --quick" in text for text in next_steps(found, model_written=False))
    assert not any("--quick" in text for text in next_steps(found))
    why = next_steps(found, model_written=False, no_model="every draw diverges")
    assert "Do not predict with THIS_FOLDER: every draw diverges." in why and not any(
        "--quick" in text for text in why
    )


def test_a_trial_without_a_vehicle_or_a_run_to_fit_is_refused_in_words(trial):
    with pytest.raises(FitError, match="names no vehicle"):
        fit_trial(replace(trial, vehicle_ref=""))
    with pytest.raises(FitError, match='role "identify"'):
        fit_trial(replace(trial, runs=tuple(replace(r, role="holdout") for r in trial.runs)))
    with pytest.raises(FitError, match="no parameter Y_zzz"):
        fit_trial(trial, free=("Y_zzz",))
    with pytest.raises(FitError, match=r"no parameter N_dx; did you mean N_dr\?"):
        fit_trial(trial, free=("N_v", "N_dx"))


def test_memory_of_white_noise_is_one_and_of_an_autoregression_as_theory_says():
    rng = np.random.default_rng(3)
    white = rng.standard_normal(20000)
    assert memory(white) == pytest.approx(1.0, abs=0.1)
    series = np.zeros(20000)
    for i in range(1, series.size):
        series[i] = 0.9 * series[i - 1] + white[i]
    assert memory(series) == pytest.approx(19.0, rel=0.15)  # (1 + a) / (1 - a)


@pytest.mark.thorough
@pytest.mark.usefixtures("without_pictures")
def test_a_prediction_tells_the_failed_checks_of_its_fit_first(trial, tmp_path):
    names = (*FREE, "Y_v|v|", "Y_v|r|", "Y_|r|dr")
    for free, fails in ((names, True), (FREE, False)):
        out = tmp_path / str(fails)
        fitted = fit(trial, free=free, out=out)
        predicted = predict(trial, "turn:15", model=out, draws=20, out=out / "next")
        told = [text for text in predicted.record()["failed_checks"] if "The fit this is drawn from" in text]
        assert bool(told) == fails == bool(fitted.record()["failed_checks"])
        if fails:
            assert "do not determine" in predicted.summary().splitlines()[1]
            assert "do not determine" in predicted.report().failures[0]
            stored = json.loads((out / "next" / "predictions.json").read_text())
            assert stored["failed_checks"] == predicted.record()["failed_checks"]


@pytest.mark.thorough
@pytest.mark.usefixtures("without_pictures")
def test_a_prediction_whose_draws_diverge_tells_the_failed_checks_of_its_fit(trial, tmp_path):
    fitted = fit(trial, free=(*FREE, "Y_vdot", "Y_rdot", "Y_v|v|", "Y_v|r|", "Y_|r|dr"), out=tmp_path)
    with pytest.raises(DivergingDraws, match=r"predict this run\. The fit this is drawn") as error:
        predict(trial, "turn:15", model=tmp_path, draws=20, out=tmp_path / "next")
    assert fitted.record()["failed_checks"] and "do not determine 3 combinations" in str(error.value)


def test_coefficients_found_far_from_those_stated_are_a_failed_check(found):
    stated = np.abs(found.fit.start) / 20.0
    near = replace(found.fit, prior_sd=np.where(stated > 0, stated, np.inf))  # moved by less than 10 of these
    assert not any("far from those stated" in text for text in failed_checks(replace(found, fit=near)))
    far = replace(found.fit, prior_sd=near.prior_sd / 5.0)
    (said,) = [t for t in failed_checks(replace(found, fit=far)) if "far from those stated" in t]
    change = found.fit.z / np.where(found.fit.start == 0, 1.0, found.fit.start) - 1.0
    i = int(np.argmax(np.abs(change[: found.fit.n_params])))
    first = f"({found.fit.names[i]} by {100 * abs(change[i]):.0f} times its stated uncertainty, "
    assert first + f"{100 * change[i]:+.0f} %" in said
    assert not any("far from" in text for text in failed_checks(found))  # states none


def test_a_long_list_of_unsure_coefficients_is_cut_in_the_sentence_and_whole_in_the_table(found):
    wide = found.posterior.sd / 2.0
    unsure = replace(found, posterior=replace(found.posterior, prior_sd=wide))
    (said,) = unsure.posterior.less_sure()
    assert f"{FREE[3]} and 2 more." in said
    assert unsure.posterior.record()["wider_than_prior"] == list(FREE)
    remarks = {row[0]: row[-1] for row in FitResult(unsure).coefficients()}
    assert all("less sure than the prior" in remarks[name] for name in FREE)
    assert not any("less sure" in row[-1] for row in FitResult(found).coefficients())


def test_a_held_out_run_begins_where_its_readings_say_though_the_hull_is_unstable():
    """Five Gauss-Newton steps ended 4 degrees a second off where the hull grows within the stretch."""
    model, held, _ = trial_of(6, seconds=40.0, factors={})
    run = held.runs[0]
    data = output_error_run(model, run, held.noise, tuple(held.noise), True, held.measured_point)
    alone = FitProblem(model, ParameterSet(()), (data,), measured_base(model, held))
    far = replace(data, x0=data.x0 + 0.3 * np.where(np.isin(model.states, ("v", "r", "psi", "q")), 1.0, 0.0))
    z = _head_state(alone, model, run)
    again = _head_state(replace(alone, runs=(far,)), model, run)
    assert np.abs((z - again) / data.initial_sd).max() < 0.05
    at = data.initial.index("r")
    assert abs(z[at]) < 3 * held.noise["r"]  # it began from straight ahead


def test_quick_reads_whole_samples_and_no_reading_between_two():
    _, trial, _ = trial_of(6, seconds=40.0)
    for most, step in ((30, 1.5), (60, 1.0), (78, 1.0), (79, 0.5)):
        thinned = prepared(trial, most=most)
        for run, before in zip(thinned.runs, trial.runs, strict=True):
            read = np.isfinite(run.data["psi"])
            assert np.diff(run.t[read]) == pytest.approx(step)
            assert read.sum() <= most + 1
            assert set(run.data["psi"][read]) <= set(before.data["psi"])
