"""Predictions of a diagnosed model: the band holds what it says; only orders and lead-in are read."""

import csv
import io
import json
from dataclasses import replace
from functools import lru_cache
from types import SimpleNamespace

import numpy as np
import pytest
from gap_trials import model_of, noise_of, orders, other_vehicle, planted_trial
from scipy.stats import binom

from bayesid.api.predict import predict
from bayesid.cli.main import run as bayesid
from bayesid.diagnosis.diagnosed_file import read_diagnosed, write_diagnosed
from bayesid.diagnosis.diagnosed_model import DiagnosedModel, WeightedHypothesis, diagnosed_model_of
from bayesid.diagnosis.plain_words import number
from bayesid.diagnosis.run import diagnose
from bayesid.equations.model import build_model
from bayesid.errors import ManoeuvreError, ModelError
from bayesid.estimation.filter_error.fit import fit
from bayesid.estimation.filter_error.linearise import linearise, with_forces
from bayesid.estimation.filter_error.noise_model import NoiseModel, force_unit, smoothed
from bayesid.estimation.filter_error.read_run import filter_error_run
from bayesid.estimation.parameters import NO_PARAMETERS
from bayesid.manoeuvres import Scale, parse
from bayesid.measures import named_measures as measure
from bayesid.model.notation import ORDER_TIMES
from bayesid.model.vehicles import load_vehicle, self_propulsion_speed
from bayesid.prediction import run_prediction
from bayesid.prediction.fitted_model import Calibration, diverging_draws
from bayesid.prediction.initial_state import coloured_noise, initial_states
from bayesid.prediction.intervals import (
    as_given,
    band_checks,
    beside_readings,
    measure_bands,
    prediction_csv,
    shares_of_draws,
    stated_spread,
)
from bayesid.prediction.manoeuvre_prediction import predict_manoeuvre
from bayesid.prediction.prediction import Prediction
from bayesid.prediction.run_prediction import predict_run
from bayesid.progress import Progress
from bayesid.report.fit import diverging_words
from bayesid.report.predict_first_screen import band_text, beside, estimate_words, headline, mean_until
from bayesid.simulation import observe, plan_run, run_manoeuvre, simulate, steady_start
from bayesid.simulation.balanced_speed import balanced_speed
from bayesid.trials import Run, window, write_trial

MODEL = model_of("remus100")
S = MODEL.scales
TIME = S["L"] / S["U"]
SEA = NoiseModel(tuple(1e-5 * f for f in force_unit(MODEL)), 3.0 * TIME, 0.1 * S["L"], 30.0 * TIME)


def found_with(share=1.0, noise_model=SEA):
    """What an engineer knows before any trial: the prior, its standard deviations times a share."""
    names = MODEL.coefficients
    sd = np.array([share * MODEL.prior_sd(n) for n in names])
    mean = MODEL.nominal[MODEL.positions(names)]
    free = np.full(len(names), np.inf)
    hypothesis = WeightedHypothesis((), 1.0, names, mean, np.diag(sd**2), -free, free, noise_model)
    return DiagnosedModel(MODEL, (hypothesis,), noise_of(MODEL), "none", "")


def spoilt(record, how):
    """A record of model.json in which one thing is not what a Gaussian or a mixture has."""
    h = record["hypotheses"][0]
    if how == "nan":
        h["mean"][0] = float("nan")
    elif how == "infinite":
        h["covariance"][1][1] = float("inf")
    elif how == "one-sided":
        h["covariance"][0][1] += 0.5 * (h["covariance"][0][0] * h["covariance"][1][1]) ** 0.5
    elif how == "variance":
        h["covariance"][2][2] *= -1.0
    elif how == "correlation":
        c = h["covariance"]
        c[0][1] = c[1][0] = 1.01 * (c[0][0] * c[1][1]) ** 0.5
    elif how == "weight":
        h["weight"] = 0.5
    else:
        h["force"][0] = -1.0
    return record


@pytest.mark.parametrize(
    ("how", "words"),
    [
        ("nan", "not finite"),
        ("infinite", "not finite"),
        ("one-sided", "not symmetric"),
        ("variance", "the variance of"),
        ("correlation", "eigenvalue -0.01"),
        ("weight", "add up to 0.5"),
        ("force", "force holds a size"),
    ],
)
def test_a_model_file_that_holds_no_gaussian_is_refused_in_words(how, words, tmp_path):
    path = write_diagnosed(found_with(), tmp_path)
    path.write_text(json.dumps(spoilt(json.loads(path.read_text()), how)))
    with pytest.raises(ModelError, match=f"model.json.*{words}"):
        read_diagnosed(tmp_path)


@pytest.mark.thorough
def test_a_misspelt_run_is_told_with_the_runs_there_are_and_before_anything_is_diagnosed(monkeypatch):
    def no(*_):
        raise AssertionError("a model is asked for")

    monkeypatch.setattr("bayesid.api.predict._model", no)
    trial = planted_trial(MODEL)
    names = [run.name for run in trial.runs]
    runs = replace(trial, runs=tuple(replace(r, name=f"harbour_{r.name}") for r in trial.runs))
    with pytest.raises(ManoeuvreError, match=rf"did you mean harbour_{names[0]}\?; runs: harbour_") as said:
        predict(runs, f"harbor_{names[0]}")
    assert all(f"harbour_{name}" in str(said.value) for name in names) and "zigzag" in str(said.value)
    with pytest.raises(ManoeuvreError, match=r"did you mean zigzag\?"):
        predict(runs, "zigzak:10/10")
    for good in (f"harbour_{names[0]}", "Turn:10", "spiral", "turn,side=starboard"):
        with pytest.raises(AssertionError, match="a model is asked for"):
            predict(runs, good)


@lru_cache
def logged(seed):
    """A run of another vehicle of the prior in the sea, with its readings free of white noise."""
    rng = np.random.default_rng(seed)
    par = MODEL.with_values(other_vehicle(MODEL, seed))
    manoeuvre = orders(MODEL, 60)["turn"]
    plan = plan_run(MODEL, manoeuvre.t, manoeuvre.commands)
    gaps = np.diff(manoeuvre.t)[:, None]
    force = coloured_noise(np.exp(-gaps[1:] / SEA.force_tau) * np.ones(3), np.array(SEA.force), rng)
    drift = coloured_noise(np.exp(-gaps / SEA.drift_tau) * np.ones(2), np.full(2, SEA.drift), rng)
    states = simulate(MODEL, par, with_forces(MODEL, plan, force), steady_start(MODEL), full=True).states
    readings = observe(MODEL, par, plan, states)
    readings[:, [MODEL.kernel.channels.index(c) for c in ("x", "y")]] += drift
    truth = {c: readings[:, MODEL.kernel.channels.index(c)] for c in noise_of(MODEL)}
    data = {c: v + noise_of(MODEL)[c] * rng.standard_normal(v.size) for c, v in truth.items()}
    return Run(f"run{seed}", "turn", "identify", manoeuvre.t, data, manoeuvre.commands), truth


def share_inside(found, seeds, level=0.95):
    """How often the last y and psi (free of white noise) lie in the band, and out of how many."""
    inside = []
    for seed in seeds:
        run, truth = logged(seed)
        p = predict_run(found, run, draws=80, seed=seed)
        low, high = p.band(level)
        for name in ("y", "psi"):
            j = p.channels.index(name)
            inside.append(low[-1, j] <= truth[name][-1] <= high[-1, j])
    return sum(inside), len(inside)


@pytest.mark.thorough
@pytest.mark.parametrize("level, holds", [(0.95, 0.94), (0.5, 0.5)])
def test_the_band_holds_the_truth_at_its_stated_rate(level, holds):
    # y and psi of 20 vehicles; those of one vehicle are no independent draws, so the 99 % limits of 20 draws
    # are asked of both together. With 80 draws the outer quantiles hold about 94 %.
    hits, count = share_inside(found_with(), range(20), level)
    low, high = binom.ppf((0.005, 0.995), 20, holds) / 20
    assert low <= hits / count <= high


def test_a_band_without_the_uncertainty_of_the_coefficients_does_not():
    # control: coefficients taken as known, no sea
    calm = NoiseModel((0.0,) * 3, SEA.force_tau, 0.0, SEA.drift_tau)
    hits, count = share_inside(found_with(0.01, calm), range(20))
    assert hits / count < binom.ppf(0.005, 20, 0.94) / 20


@pytest.mark.slow
def test_bands_of_a_diagnosed_model_hold_fresh_runs():
    # 12 vehicles of the prior with a current, diagnosed from two runs; then the same orders once more.
    current = {"ocean_current.V_north": 0.05 * S["U"], "ocean_current.V_east": -0.03 * S["U"]}
    inside = []
    for seed in range(12):
        truth = other_vehicle(MODEL, seed) | current
        found = diagnosed_model_of(diagnose(planted_trial(MODEL, truth, seed), MODEL, plan_next=False))
        for run in planted_trial(MODEL, truth, seed + 100).runs:
            p = predict_run(found, run, draws=150, seed=seed)
            inside += [v["inside"] for v in beside_readings(p, run, seed).values()]
    # readings of one run share their error; the mean over 144 series of a calibrated band is 0.95 +- 0.01
    assert 0.91 < np.mean(inside) < 0.98


def test_readings_after_the_lead_in_change_nothing():
    run, _ = logged(1)
    p = predict_run(found_with(), run, draws=20)
    late = run.t - run.t[0] > p.lead
    other = replace(run, data={c: np.where(late, v + 100.0, v) for c, v in run.data.items()})
    early = replace(run, data={c: np.where(late, v, v + 1.0) for c, v in run.data.items()})
    assert np.array_equal(predict_run(found_with(), other, draws=20).draws, p.draws)
    assert not np.array_equal(predict_run(found_with(), early, draws=20).draws, p.draws)


def test_first_states_have_the_spread_of_the_smoother():
    # expected mean and variance from the smoother's own formulas; 300 draws: variance to 25 %, mean to 0.2 sd
    run, _ = logged(2)
    noise, channels = noise_of(MODEL), tuple(noise_of(MODEL))
    log = filter_error_run(MODEL, window(run, float(run.t[0]), float(run.t[14])), noise, channels)
    nothing = np.zeros(0, dtype=np.int64)
    pars = np.repeat(MODEL.nominal[None], 300, axis=0)
    rng = np.random.default_rng(0)
    drawn = initial_states(MODEL, log, nothing, MODEL.nominal.copy(), pars, SEA, rng)
    x0 = np.array([b.x0 for b in drawn])
    begun = fit(MODEL, [log], NO_PARAMETERS, SEA, initial_noise_scale=0.0, iterations=8)
    path = linearise(MODEL, log, begun.points[0], nothing)
    sm = smoothed(MODEL, path, np.zeros(0), SEA)
    sd = np.sqrt(sm.variance[0, :6])
    centre = begun.points[0].states[0, :6] + sm.mean[0, :6]
    assert x0.std(axis=0) / sd == pytest.approx(np.ones(6), abs=0.13)
    assert (x0.mean(axis=0) - centre) / sd == pytest.approx(np.zeros(6), abs=0.25)
    last = np.array([b.force[-1] for b in drawn]).std(axis=0)
    assert (last <= 1.2 * np.array(SEA.force)).all()


@pytest.mark.thorough
@pytest.mark.parametrize("name", ["remus100", "generic_sub", "delphin2"])
@pytest.mark.parametrize("share", [0.7, 1.0])
def test_approach_speed_balances_thrust_and_drag(name, share):
    # expected: root of the vehicle's own balance of rows
    model = model_of(name)
    rpm = share * model.vehicle.rpm_ref
    found = balanced_speed(model, model.nominal, {"n_cmd": rpm})
    assert found[0] == pytest.approx(self_propulsion_speed(model.vehicle, rpm), rel=1e-5)


def test_a_model_that_is_refused_says_whether_its_vehicle_file_or_the_equations_changed(tmp_path):
    path = write_diagnosed(found_with(), tmp_path)
    record = json.loads(path.read_text())
    path.write_text(json.dumps({**record, "digest": "other", "equations": "other"}))
    with pytest.raises(ModelError, match=r"other equations than this version"):
        read_diagnosed(tmp_path)
    path.write_text(json.dumps(record))
    vehicle = tmp_path / record["vehicle"]
    vehicle.write_text(vehicle.read_text().replace("mass = ", "mass = 1"))
    with pytest.raises(ModelError, match=f"{record['vehicle']} beside it is not the one"):
        read_diagnosed(tmp_path)
    older = {key: value for key, value in record.items() if key != "equations"}
    path.write_text(json.dumps(older))
    with pytest.raises(ModelError, match="other equations or another vehicle file"):
        read_diagnosed(tmp_path)


@pytest.mark.thorough
def test_a_diagnosed_model_comes_back_from_its_folder(tmp_path):
    d = diagnose(planted_trial(MODEL, other_vehicle(MODEL, 3), 3), MODEL, plan_next=False)
    found = diagnosed_model_of(d)
    assert sum(h.weight for h in found.hypotheses) == pytest.approx(1.0)
    assert found.hypotheses[0].effects == ()
    write_diagnosed(found, tmp_path)
    back = read_diagnosed(tmp_path)
    run = logged(3)[0]
    once, again = (predict_run(f, run, draws=20, seed=4).draws for f in (found, back))
    assert again == pytest.approx(once, rel=1e-9, abs=1e-9)
    vehicle = tmp_path / "vehicle_nominal.toml"
    vehicle.write_text(vehicle.read_text().replace("mass = ", "mass = 1"))
    with pytest.raises(ModelError, match="diagnose again"):
        read_diagnosed(tmp_path)
    record = json.loads((tmp_path / "model.json").read_text())
    record["hypotheses"][0]["mean"].pop()
    (tmp_path / "model.json").write_text(json.dumps(record))
    with pytest.raises(ModelError, match="not a diagnosed model"):
        read_diagnosed(tmp_path)


@pytest.mark.thorough
def test_what_no_hypothesis_explains_widens_the_band():
    # a moment the catalogue lacks; without it the same vehicle needs no disturbance beyond the stated one
    moment = 3e-4 * force_unit(MODEL)[2]

    def wall(run, t):
        return {"N": moment * np.sin(1.7 * t / TIME)}

    loud, quiet = (
        diagnosed_model_of(
            diagnose(planted_trial(MODEL, other_vehicle(MODEL, 5), 5, f), MODEL, plan_next=False)
        )
        for f in (wall, None)
    )
    assert all(h.noise_model.force[2] < 0.1 * moment for h in quiet.hypotheses)
    assert all(0.2 * moment < h.noise_model.force[2] < 3 * moment for h in loud.hypotheses)


@pytest.mark.thorough
def test_measures_of_a_manoeuvre_come_with_bands():
    scale = Scale(S["L"], S["U"], MODEL.vehicle.rpm_ref, 0.23, 0.23, 3, TIME / 15)
    p = predict_manoeuvre(found_with(), "zigzag:10/10", parse("zigzag:10/10", scale), draws=20)
    rows = {m["quantity"]: m for m in measure_bands(p, measure)}
    first = rows["overshoot 1"]
    assert first["low"] < first["mean"] < first["high"] and first["share"] == 1.0
    exact = predict_manoeuvre(found_with(1e-9, SEA.scaled(0.0)), "z", parse("zigzag:10/10", scale), draws=20)
    narrow = {m["quantity"]: m for m in measure_bands(exact, measure)}["overshoot 1"]
    assert narrow["high"] - narrow["low"] < 1e-3 * (first["high"] - first["low"])


@pytest.mark.thorough
def test_a_vertical_zigzag_is_measured_by_the_planes_of_every_vehicle():
    """By those of the first draw the vehicle as given overshot by 8.4 degrees in place of 4.8."""
    model = build_model(load_vehicle("remus100"), 6)
    names, scale = ("M_w", "M_ds"), np.array([0.1, 0.1])
    given = model.nominal[model.positions(names)]
    calm = NoiseModel((0.0,) * 6, 3.0, 0.0, 25.0)
    spread = np.diag((scale * given) ** 2)
    law = WeightedHypothesis(
        (), 1.0, names, 1.1 * given, spread, given - np.inf, given + np.inf, calm, np.zeros(2)
    )
    found = DiagnosedModel(model, (law,), {}, "fit", "")
    speed = self_propulsion_speed(model.vehicle, model.vehicle.rpm_ref)
    scales = Scale(model.vehicle.L, speed, model.vehicle.rpm_ref, 0.3, 0.3, 6, 0.1)
    manoeuvre = parse("vzigzag:8/8", scales)
    predicted = predict_manoeuvre(found, "vzigzag:8/8", manoeuvre, draws=6)
    assert predicted.orders["delta_s_cmd"].shape == (6, predicted.t.size)
    x0 = np.zeros(len(model.states))
    x0[model.states.index("u")] = balanced_speed(
        model, model.nominal[None], {"n_cmd": model.vehicle.rpm_ref}
    )[0]
    track, commands = run_manoeuvre(model, model.nominal, manoeuvre, x0, exact=True)
    theta = track.states[:, model.states.index("theta")]
    data = {"theta": theta, "delta_s": commands["delta_s_cmd"], ORDER_TIMES: commands[ORDER_TIMES]}
    own = {q: v for result in measure("vzigzag", track.t, data) for q, v, _ in result["rows"]}
    told = {m["quantity"]: m["mean"] for m in measure_bands(as_given(predicted), measure)}
    for quantity in ("switch", "overshoot 1", "overshoot 2", "period"):
        assert told[quantity] == pytest.approx(own[quantity], rel=1e-6)
    periods = [m for m in measure_bands(predicted, measure) if m["quantity"] == "period"]
    assert periods[0]["high"] > periods[0]["low"]


def test_a_draw_that_is_carried_to_the_other_side_has_no_diameter():
    """No circle is of less than nothing: such a draw lacks the measures instead of stretching their band."""
    scale = Scale(S["L"], S["U"], MODEL.vehicle.rpm_ref, 0.23, 0.23, 3, TIME / 15)
    p = predict_manoeuvre(found_with(), "turn:12", parse("turn:12", scale), draws=20)
    whole = {m["quantity"]: m for m in measure_bands(p, measure)}["tactical diameter"]
    carried = p.draws.copy()
    j = p.channels.index("y")
    carried[:5, :, j] -= (
        20.0
        * whole["mean"]
        * np.sign(carried[:5, -1:, p.channels.index("psi")])
        * ((p.t - p.t[0]) / (p.t[-1] - p.t[0]))
    )
    some = {m["quantity"]: m for m in measure_bands(replace(p, draws=carried), measure)}["tactical diameter"]
    assert whole["share"] == 1.0 and some["share"] < 1.0
    assert some["low"] > 0.0


def test_the_table_of_a_prediction_reads_as_numbers(tmp_path):
    run, _ = logged(1)
    p = predict_run(found_with(), run, draws=20)
    rows = list(csv.DictReader(prediction_csv(p).splitlines()))
    assert len(rows) == run.n_samples
    for row in rows:
        assert float(row["psi_low[deg]"]) <= float(row["psi[deg]"]) <= float(row["psi_high[deg]"])
    assert float(rows[-1]["y[m]"]) == pytest.approx(p.told[-1, p.channels.index("y")], rel=1e-4)
    low, high = p.band()
    noisy_low, noisy_high = p.band(rng=np.random.default_rng(0))
    assert (noisy_high - noisy_low).mean() > (high - low).mean()


@pytest.mark.thorough
def test_predict_command_writes_one_table_per_run_and_manoeuvre(tmp_path, capsys):
    trial = planted_trial(MODEL, other_vehicle(MODEL, 3), 3)
    write_trial(trial, tmp_path / "pond")
    found = found_with()
    write_diagnosed(found, tmp_path / "gap")
    out = tmp_path / "out"
    words = ["predict", str(tmp_path / "pond"), "turn", "zigzag:10/10", "--model", str(tmp_path / "gap")]
    assert bayesid([*words, "--out", str(out), "--draws", "20", "--dt", "0.2", "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert [p["name"] for p in record["predictions"]] == ["turn", "zigzag:10/10"]
    assert 0.5 < record["predictions"][0]["against_readings"]["psi"]["inside"] <= 1.0
    assert bayesid([*words[:3], "--model", str(tmp_path / "gap"), "--draws", "20"]) == 0
    assert capsys.readouterr().err.startswith("predict turn: done 1/1 in ")
    assert {p.name for p in out.glob("*.csv")} == {"turn.csv", "zigzag_10_10.csv"}
    assert bayesid(["predict", str(tmp_path / "pond"), "--model", str(tmp_path / "none")]) == 2
    assert "bayesid diagnose" in capsys.readouterr().err


def test_a_diagnosis_on_the_way_says_which_of_its_steps_it_is_at(monkeypatch):
    def diagnosed(trial, model, *, notify, **others):
        notify("screen 36 effects from one bank of sensitivities")
        raise ModelError("far enough")

    monkeypatch.setattr("bayesid.api.predict.diagnose", diagnosed)
    log = io.StringIO()
    with pytest.raises(ModelError, match="far enough"):
        predict(planted_trial(MODEL), vehicle=MODEL.vehicle, progress=Progress(stream=log))
    assert log.getvalue().splitlines()[-1].startswith("step 3 of 6: screen 36 effects")


@pytest.mark.thorough
@pytest.mark.parametrize(("share", "narrow"), [(1.0, False), (0.01, True)])
def test_bands_that_do_not_hold_the_readings_are_called_too_narrow(share, narrow, tmp_path):
    """Coefficients said to be known a hundred times better than they are, and as well as they are."""
    trial = planted_trial(MODEL, other_vehicle(MODEL, 3), 3)
    write_diagnosed(found_with(share), tmp_path)
    found = predict(trial, model=tmp_path, draws=40)
    assert ("The bands are too narrow" in found.summary()) == narrow
    assert any("The bands are too narrow" in text for text in found.report().failures) == narrow
    # every coefficient of MODEL is stated to 5 %
    assert found.numbers["coefficients_as_given"] == pytest.approx((0.05 * share, 0.05 * share))
    assert f"stated standard deviation ({5 * share:.2g} %)" in found.summary()


def test_one_coefficient_moved_by_a_fit_is_not_called_as_given():
    found = found_with()
    assert stated_spread(found) is not None
    moved = replace(
        found.hypotheses[0], mean=found.hypotheses[0].mean * np.linspace(1.0, 1.01, len(MODEL.coefficients))
    )
    assert stated_spread(replace(found, hypotheses=(moved,))) is None
    assert stated_spread(replace(found, hypotheses=(*found.hypotheses, moved))) is None


@pytest.mark.thorough
def test_a_heading_left_open_takes_the_track_and_leaves_the_measures(tmp_path):
    """Coefficients known to 30 % of their size leave a turn open; known to 5 %, they do not."""
    for share, lost in ((6.0, True), (1.0, False)):
        write_diagnosed(found_with(share), tmp_path / str(share))
        trial = planted_trial(MODEL)
        found = predict(trial, ["turn:10"], model=tmp_path / str(share), draws=40, speed=1.5)
        (row,), (p,) = found.numbers["predictions"], found.predictions
        low, high = (edge[:, p.channels.index("psi")] for edge in p.band())
        if lost:
            since = row["heading_open_from"]
            assert since > 10.0 and (high - low)[p.t - p.t[0] < since].max() <= 2 * np.pi
            assert mean_until(replace(p, centres=())) == since
            said = f"not predicted for turn:10 from {since:.0f} s on"
            assert any(said in text and "they hold" in text for text in found.report().failures)
        else:
            assert row["heading_open_from"] is None and "not predicted for" not in found.summary()
            assert mean_until(replace(p, centres=())) == np.inf
        assert "Nothing is predicted" not in found.summary()
        assert "tactical diameter of" in found.summary().splitlines()[0]
        unmeasured = [row | {"measures": []}]
        assert ("is not known" in headline(found.trial, found.predictions, unmeasured)) == lost


@pytest.mark.thorough
def test_coefficients_as_given_predict_what_the_vehicle_that_has_them_does(tmp_path):
    """Known to 30 % of their size, the mean of their draws is another track; the band is theirs."""
    trial = planted_trial(MODEL, other_vehicle(MODEL, 3), 3)
    write_diagnosed(found_with(6.0), tmp_path)
    found = predict(trial, ["turn", "zigzag:10/10"], model=tmp_path, draws=40, speed=1.5)
    run, loop = found.predictions
    for p in (run, loop):
        assert p.told == pytest.approx(p.given, abs=1e-9)
        assert np.abs(p.told - p.mean).max() > 0.1
    for row in found.numbers["predictions"][0]["against_readings"].values():
        assert row["rms"] == pytest.approx(row["rms_given"], rel=1e-6)
    first = {m["quantity"]: m for m in found.numbers["predictions"][1]["measures"]}["overshoot 1"]
    assert first["told"] == first["given"] != first["mean"]
    assert "predicted is the vehicle that has them" in found.summary()
    again = predict(trial, ["turn"], model=tmp_path, draws=40, seed=5).predictions[0]
    assert again.given == pytest.approx(run.given, abs=1e-12)


def test_where_the_vehicle_as_given_diverges_the_mean_of_the_draws_is_told_and_said(monkeypatch, tmp_path):
    monkeypatch.setattr("bayesid.prediction.run_prediction._undisturbed", lambda *others: None)
    write_diagnosed(found_with(), tmp_path)
    found = predict(planted_trial(MODEL), ["turn", "turn:10"], model=tmp_path, draws=20, speed=1.5)
    run, turn = found.predictions
    assert np.array_equal(run.told, run.mean) and turn.centres
    assert "; it diverges in turn, where the mean of the draws stands." in found.summary()


@pytest.mark.parametrize(("verdict", "share"), [("fit", 0.0), ("none", 0.01)])
def test_coefficients_that_were_fitted_predict_the_mean_of_their_draws(verdict, share):
    found = found_with()
    (h,) = found.hypotheses
    steps = 1.0 + share * np.linspace(0.0, 1.0, h.mean.size)
    fitted = replace(found, verdict=verdict, hypotheses=(replace(h, mean=h.mean * steps),))
    p = predict_run(fitted, logged(1)[0], draws=20)
    assert not p.centres and np.array_equal(p.told, p.mean)


@pytest.mark.thorough
def test_beside_the_mean_of_a_fits_draws_stands_what_its_estimate_alone_predicts(tmp_path):
    """A fit that found the vehicle as it is, and hardly knows it: its estimate is the vehicle as given."""
    trial = planted_trial(MODEL)
    write_diagnosed(replace(found_with(6.0), verdict="fit"), tmp_path / "fit")
    write_diagnosed(found_with(6.0), tmp_path / "diagnosis")
    found = predict(trial, ["turn", "zigzag:10/10"], model=tmp_path / "fit", draws=40, speed=1.5)
    turn = found.predictions[0]
    assert turn.estimate.readings == pytest.approx(turn.given, abs=1e-9)
    assert np.array_equal(turn.told, turn.mean) and np.abs(turn.told - turn.estimate.readings).max() > 0.1
    first, second = found.numbers["predictions"]
    for row in first["against_readings"].values():
        assert row["rms_estimate"] == pytest.approx(row["rms_given"], rel=1e-6)
    for row in second["measures"]:
        assert row["estimate"] == row["given"]
    said, kept = found.summary(), 40 - first["diverged"]
    assert (
        f"misses the log by {number(np.hypot(*(first['against_readings'][c]['rms_given'] for c in 'xy')))} m"
        in said
    )
    assert f"; told is the mean of {kept} vehicles drawn about it." in said
    assert "The estimate alone, as `bayesid fit` simulates it: overshoot 1 " in said
    of_gap = predict(trial, ["turn"], model=tmp_path / "diagnosis", draws=40)
    assert of_gap.predictions[0].estimate is None and "The estimate alone" not in of_gap.summary()


def test_where_draws_of_a_fit_diverge_its_estimate_is_told_and_said(monkeypatch, tmp_path):
    """One simulation of a draw in ten is made to diverge; the mean of the others is told beside."""
    write_diagnosed(replace(found_with(6.0), verdict="fit"), tmp_path)
    calls, simulated, alone = iter(range(10_000)), run_prediction._track, run_prediction._undisturbed

    def some(*given):
        return None if next(calls) % 10 == 0 else simulated(*given)

    def whole(*given):
        with monkeypatch.context() as m:
            m.setattr(run_prediction, "_track", simulated)
            return alone(*given)

    monkeypatch.setattr(run_prediction, "_track", some)
    monkeypatch.setattr(run_prediction, "_undisturbed", whole)
    found = predict(planted_trial(MODEL), ["turn"], model=tmp_path, draws=40)
    (turn,), (row,) = found.predictions, found.numbers["predictions"]
    assert turn.lost == row["diverged"] == 4 and row["told"] == "estimate of the fit"
    assert np.array_equal(turn.told, turn.estimate.readings) and np.abs(turn.told - turn.mean).max() > 0.1
    for told in row["against_readings"].values():
        assert told["rms"] == told["rms_estimate"] != told["rms_mean"]
    x, y = (row["against_readings"][c]["rms_mean"] for c in "xy")
    assert (
        f"4 diverge. The mean of the others is another track ({number(np.hypot(x, y))} m" in found.summary()
    )
    assert "x_low" in prediction_csv(turn)
    assert read_back(turn)["x"] == pytest.approx(turn.told[:, turn.channels.index("x")], rel=1e-4, abs=1e-4)


def read_back(p):
    """Columns of the table of a prediction."""
    rows = list(csv.DictReader(io.StringIO(prediction_csv(p))))
    return {name.partition("[")[0]: np.array([float(row[name]) for row in rows]) for name in rows[0]}


def test_an_estimate_that_diverges_is_said():
    channels = {c: {"rms": 3.0, "inside": 0.9} for c in ("x", "y")}
    row = {"estimate": "diverges", "told": "mean of the draws", "diverged": 0, "against_readings": channels}
    assert (
        estimate_words(row, 300)
        == "The estimate alone diverges; told is the mean of 300 vehicles drawn about it."
    )
    assert "diverges, as do 44 more, left out; told is the mean of 256 " in estimate_words(
        row | {"diverged": 44}, 300
    )
    assert estimate_words(row | {"estimate": None}, 300) == ""


def test_a_fit_counts_the_vehicles_of_its_covariance_that_diverge(monkeypatch):
    """Every third simulation is made to diverge."""
    calls = iter(range(10_000))
    simulated = run_prediction._track

    def some(*given):
        return None if next(calls) % 3 == 0 else simulated(*given)

    model, runs = replace(found_with(), verdict="fit"), [logged(1)[0]]
    assert diverging_draws(model, runs, draws=20) == {}
    monkeypatch.setattr(run_prediction, "_track", some)
    (share,) = diverging_draws(model, runs, draws=20).values()
    assert share == pytest.approx(1 / 3, abs=0.04)
    with pytest.raises(ModelError, match="draws diverge"):
        predict_run(model, runs[0], draws=20)
    calibration = Calibration({}, 1.0, {}, {}, diverge={"stop": 0.05, "turn": 0.33})
    (said,) = diverging_words(calibration)
    assert "(33% in `turn`, 5% in `stop`)" in said and "refuses" in said
    assert "refuses" not in diverging_words(replace(calibration, diverge={"stop": 0.05}))[0]
    assert diverging_words(replace(calibration, diverge={})) == []


def test_explanations_with_coefficients_as_given_are_told_by_their_weight():
    """A rudder that stands to port and one that stands as far to starboard, 3 to 1."""
    found = found_with()
    (h,) = found.hypotheses
    sides = tuple(
        replace(
            h,
            effects=("rudder_offset",),
            weight=weight,
            names=(*h.names, "rudder_offset.offset"),
            mean=np.append(h.mean, offset),
            covariance=np.diag(np.append(np.diag(h.covariance), 1e-8)),
            low=np.append(h.low, -np.inf),
            high=np.append(h.high, np.inf),
            run_sd=None,
        )
        for weight, offset in ((0.75, 0.03), (0.25, -0.03))
    )
    p = predict_run(replace(found, verdict="ambiguous", hypotheses=sides), logged(1)[0], draws=20)
    port, starboard = p.centres
    assert p.told == pytest.approx(0.75 * port.readings + 0.25 * starboard.readings)
    assert abs(port.readings - starboard.readings)[-1, p.channels.index("psi")] > 0.1


def with_effect(sizes, share=1.0):
    """The prior with an effect of known sizes in a share of the vehicles."""
    found = found_with()
    (h,) = found.hypotheses
    count = len(sizes)
    planted = replace(
        h,
        weight=share,
        names=(*h.names, *sizes),
        mean=np.append(h.mean, list(sizes.values())),
        covariance=np.diag(np.append(np.diag(h.covariance), count * [1e-8])),
        low=np.append(h.low, count * [-np.inf]),
        high=np.append(h.high, count * [np.inf]),
        run_sd=None,
    )
    rest = () if share == 1.0 else (replace(h, weight=1.0 - share),)
    return replace(found, verdict="effect", hypotheses=(planted, *rest))


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("sizes", "share", "said"),
    [
        (
            {"ocean_current.V_north": 0.0, "ocean_current.V_east": 0.2},
            1.0,
            "a current of 0.2 m/s towards 090",
        ),
        (
            {"wind.blowing_north": -5.0, "wind.blowing_east": 0.0},
            0.7,
            "a wind of 5 m/s from 000 degrees acts",
        ),
        ({"steady_force.F_north": 0.0, "steady_force.F_east": 0.5}, 1.0, "a steady force of 0.5 N"),
        ({"rudder_offset.offset": 0.02}, 1.0, None),
    ],
)
def test_what_acts_around_the_vehicle_is_said_with_its_size_and_the_approach(sizes, share, said, tmp_path):
    write_diagnosed(with_effect(sizes, share), tmp_path)
    found = predict(planted_trial(MODEL), ["turn:10"], model=tmp_path, draws=40, speed=1.5)
    second = found.summary().splitlines()[1]
    if said is None:
        assert not found.numbers["surroundings"] and "In this prediction" not in found.report().lead
        return
    assert second.startswith(f"In this prediction {said}") and "begin on heading 000 degrees" in second
    assert ("(in 70% of the vehicles drawn)" in second) == (share < 1.0)
    assert f"In this prediction {said}" in found.report().lead
    turn = found.predictions[0]
    psi = turn.channels.index("psi")
    assert turn.draws[:, 0, psi] == pytest.approx(0.0) and turn.given[0, psi] == pytest.approx(0.0)
    run = predict(planted_trial(MODEL), ["turn"], model=tmp_path, draws=20).summary()
    assert said in run and "begin on heading" not in run


@pytest.mark.parametrize(("word", "said"), [("model_form", True), ("ambiguous", True), ("effect", False)])
def test_causes_a_diagnosis_does_not_name_are_said_to_be_none(word, said, tmp_path):
    found = found_with()
    causes = tuple(replace(h, effects=("rudder_offset",)) for h in found.hypotheses)
    write_diagnosed(replace(found, verdict=word, hypotheses=causes), tmp_path)
    prediction = predict(planted_trial(MODEL), ["turn:10"], model=tmp_path, draws=20, speed=1.5)
    assert ("names no cause" in prediction.summary()) == said
    assert any("names no cause" in text for text in prediction.report().failures) == said


def test_a_prediction_says_in_words_what_it_is_drawn_from_and_what_is_left_out(tmp_path):
    found = found_with()
    (one,) = found.hypotheses
    two = tuple(replace(one, effects=names, weight=w) for names, w in ((("current_front",), 0.7), ((), 0.3)))
    left = {("outside",): 0.12, ("rudder_offset", "wind"): 0.02, ("coefficient_error",): 0.001}
    write_diagnosed(replace(found, verdict="ambiguous", hypotheses=two, left_out=left), tmp_path)
    prediction = predict(planted_trial(MODEL), ["turn:10"], model=tmp_path, draws=20, speed=1.5)
    said = (
        "20 vehicles are drawn from 2 explanations: 70% with current front, 30% with no effect; explanations "
        "that hold 0.14 of the probability are left out: something not on the list (0.12), "
        "rudder offset + wind (0.02)"
    )
    assert said in prediction.summary() and "current_front" not in prediction.summary()
    assert said in prediction.report().lead
    assert prediction.record()["left_out"][0] == {"effects": ["outside"], "probability": 0.12}


def test_one_explanation_is_said_to_be_all_and_an_older_model_says_nothing_of_what_is_left_out(tmp_path):
    found = found_with()
    (one,) = found.hypotheses
    named = replace(found, verdict="effect", hypotheses=(replace(one, effects=("rudder_asymmetry",)),))
    for left, said in (
        (None, "20 vehicles are drawn, all with rudder asymmetry; the coefficients"),
        (
            {("wind",): 0.004},
            "rudder asymmetry; explanations left out have less than 0.01 of the probability;",
        ),
        (
            {("wind",): 0.98, ("thrust_loss",): 0.016},
            "rudder asymmetry; the explanations the diagnosis weighed are in none of them: wind (0.98), "
            "thrust loss (0.02)",
        ),
    ):
        write_diagnosed(replace(named, left_out=left), tmp_path)
        prediction = predict(planted_trial(MODEL), ["turn:10"], model=tmp_path, draws=20, speed=1.5)
        assert said in prediction.summary()


@pytest.mark.thorough
def test_a_share_of_the_band_is_told_from_chance_by_the_draws_of_the_model():
    """Errors of a run go together: a draw of the model itself is outside for most of a run now and then."""
    rng = np.random.default_rng(0)
    t, k = np.arange(200.0), 400
    walks = np.cumsum(rng.standard_normal((k + 200, t.size, 1)), axis=1)
    p = Prediction("r", "turn", t, ("x",), walks[:k], {}, None, 0.0, 0, np.array([0.0]))
    few, chances = 0, []
    log, _ = logged(1)

    def judged(x):
        run = replace(log, t=t, data={"x": x}, commands={}, measured_inputs={})
        return band_checks([beside_readings(p, run)], [shares_of_draws(p, run)])["x"]

    for walk in walks[k:]:
        found = judged(walk[:, 0])
        few += found["inside"] < 0.8
        chances.append(found["chance"])
    assert few > 10  # of 200 walks that the model itself made
    assert 0.01 < np.mean(np.array(chances) < 0.05) < 0.11
    assert judged(60.0 + walks[-1, :, 0])["chance"] < 0.01


def in_two_sizes_of_sea(run_sd=0.0, effects=((), ())):
    """The prior under a small and a large disturbance; `run_sd` in units of its standard deviations."""
    found = found_with()
    (h,) = found.hypotheses
    h = replace(h, run_sd=run_sd * np.sqrt(np.diag(h.covariance)))
    small = replace(h, weight=0.7, noise_model=SEA.scaled(0.5), effects=effects[0])
    return replace(
        found, hypotheses=(small, replace(h, weight=0.3, noise_model=SEA.scaled(2.0), effects=effects[1]))
    )


def test_a_vehicle_keeps_its_coefficients_from_run_to_run_and_meets_another_disturbance():
    # closed forms: coefficients of one vehicle in two runs correlate by V / (V + run_sd^2) = .8, and have the
    # sd of both together; of two draws with weights .7 and .3 a share of .58 are alike
    found, rng, n = in_two_sizes_of_sea(0.5), np.random.default_rng(0), 4000
    seen = found.in_a_run(rng, n)
    vehicles = found.vehicles(seen, rng)
    runs = [seen, found.in_another_run(vehicles, rng), found.in_another_run(vehicles, rng)]
    h, where = found.hypotheses[0], MODEL.positions(found.hypotheses[0].names)
    for i, j in ((0, 1), (0, 2), (1, 2)):
        both = np.concatenate([runs[i].pars[:, where].T, runs[j].pars[:, where].T])
        correlation = np.diag(np.corrcoef(both), len(where))
        assert correlation == pytest.approx(np.full(len(where), 0.8), abs=0.03)
        assert np.mean(runs[i].which == runs[j].which) == pytest.approx(0.58, abs=0.03)
    assert h.sd_in_a_run == pytest.approx(np.sqrt(1.25 * np.diag(h.covariance)), rel=1e-12)
    for run in runs:
        assert run.pars[:, where].std(axis=0) / h.sd_in_a_run == pytest.approx(np.ones(len(where)), abs=0.06)
        assert np.mean(run.which == 0) == pytest.approx(0.7, abs=0.03)
    sd = np.sqrt(np.diag(h.covariance))
    assert vehicles.pars[:, where].std(axis=0) / sd == pytest.approx(np.ones(len(where)), abs=0.06)
    # control: hypotheses of two causes are two vehicles, and without deviations a run has the vehicle's own
    other = in_two_sizes_of_sea(0.0, ((), ("wind",)))
    assert np.array_equal(other.vehicles(seen, rng).pars, seen.pars)
    again = other.in_another_run(seen, rng)
    assert np.array_equal(again.which, seen.which) and np.array_equal(again.pars, seen.pars)


def test_vehicles_of_correlated_coefficients_keep_their_covariance_and_bounds():
    # V and R of two coefficients, one of them without a deviation, a third one known; means on a bound
    found = found_with()
    (h,) = found.hypotheses
    unit = np.sqrt(np.diag(h.covariance))[:3]
    covariance = np.outer(unit, unit) * [[1.0, 0.9, 0.0], [0.9, 1.0, 0.0], [0.0, 0.0, 0.0]]
    few = replace(
        h, names=h.names[:3], mean=h.mean[:3], covariance=covariance, run_sd=unit * [1.0, 0.0, 0.0],
        low=h.low[:3], high=h.high[:3],
    )  # fmt: skip
    rng, where = np.random.default_rng(1), MODEL.positions(few.names)
    free = replace(found, hypotheses=(few,))
    seen = free.in_a_run(rng, 6000)
    vehicles = free.vehicles(seen, rng)
    assert np.cov(vehicles.pars[:, where].T / unit[:, None]) == pytest.approx(
        covariance / np.outer(unit, unit), abs=0.05
    )
    assert np.array_equal(vehicles.pars[:, where[1:]], seen.pars[:, where[1:]])
    less = vehicles.pars[:, where[0]] - seen.pars[:, where[0]]
    assert less.std() / unit[0] == pytest.approx(1.0, abs=0.05)
    assert abs(np.corrcoef(less, vehicles.pars[:, where[0]])[0, 1]) < 0.05  # the deviation is no part of it
    known = replace(found, hypotheses=(replace(few, covariance=0.0 * covariance, run_sd=unit / 3.0),))
    seen = known.in_a_run(rng, 50)
    assert (seen.pars[:, where].std(axis=0) > 0.2 * unit).all()
    assert known.vehicles(seen, rng).pars[:, where] == pytest.approx(np.tile(few.mean, (50, 1)), rel=1e-9)
    bounded = replace(found, hypotheses=(replace(few, low=few.mean - [0.0, np.inf, np.inf]),))
    seen = bounded.in_a_run(rng, 500)
    vehicles = bounded.vehicles(seen, rng)
    for drawn in (seen, vehicles, bounded.in_another_run(vehicles, rng)):
        assert np.all(drawn.pars[:, where[0]] >= few.mean[0]) and drawn.pars[:, where[0]].std() > 0


def test_errors_of_two_runs_go_together_by_the_vehicle_alone():
    run, _ = logged(1)
    calm = NoiseModel((0.0,) * 3, SEA.force_tau, 0.0, SEA.drift_tau)

    def together(found):
        one, two = (predict_run(found, run, 60, 5, occasion=i) for i in (1, 2))
        return min(np.corrcoef(one.draws[:, -1, j], two.draws[:, -1, j])[0, 1] for j in range(4)), one, two

    least, _, _ = together(found_with(1.0, calm))
    assert least > 0.9  # of one vehicle, its coefficients differ from those of others
    known, one, two = together(found_with(1e-4))
    assert known < 0.4  # of a known vehicle nothing is common to two runs: 99.9 % limit of 60 draws
    again = predict_run(found_with(1e-4), run, 60, 5, occasion=1)
    assert np.array_equal(again.draws, one.draws) and not np.array_equal(one.draws, two.draws)
    # sensor noise as well
    first = predict_run(found_with(), run, 20, 5)
    noise = [p.sensor_noise(5).standard_normal(200) for p in (first, one, two)]
    assert np.abs(np.corrcoef(noise) - np.eye(3)).max() < 0.25


def test_vehicles_that_diverge_in_a_run_are_left_out_of_the_mean_over_runs_by_their_number(monkeypatch):
    run, _ = logged(1)
    track, count = run_prediction._track, [0]

    def diverging(*args):
        count[0] += 1
        return None if count[0] in (4, 9) else track(*args)

    whole = predict_run(found_with(), run, 20)
    assert list(whole.vehicles) == list(range(20))
    monkeypatch.setattr(run_prediction, "_track", diverging)
    p = predict_run(found_with(), run, 20)
    left = [k for k in range(20) if k not in (3, 8)]
    assert list(p.vehicles) == left and p.lost == 2
    assert np.array_equal(p.draws, whole.draws[left])
    shares = shares_of_draws(p, run)
    assert np.flatnonzero(np.isnan(shares["psi"])).tolist() == [3, 8] and shares["psi"].shape == (20,)
    # vehicle by vehicle both shares have a mean of .9, and none fills .8995 or less; by position among those
    # that came through, the fifth to eighth would stand beside their neighbours, with a mean of .897
    first = np.linspace(0.95, 0.85, 20)
    second = 1.8 - first
    first[3] = second[8] = np.nan
    seen = [{"psi": {"inside": 0.89}}, {"psi": {"inside": 0.91 - 1e-3}}]
    (told,) = band_checks(seen, [{"psi": first}, {"psi": second}]).values()
    assert told == {"inside": pytest.approx(0.8995), "chance": 1 / 19, "least": 1 / 19, "lost": 2}
    nobody = [{"psi": np.full(3, np.nan)}, {"psi": np.ones(3)}]
    assert band_checks(seen, nobody) == {}  # no vehicle came through: nothing is told


def test_a_run_is_predicted_alike_alone_and_among_others(tmp_path):
    write_diagnosed(in_two_sizes_of_sea(0.3), tmp_path)
    trial = planted_trial(MODEL)
    names = [run.name for run in trial.runs]
    both = predict(trial, model=tmp_path, draws=20)
    alone = predict(trial, names[1], model=tmp_path, draws=20)
    assert len(names) > 1 and np.array_equal(both[names[1]].draws, alone[names[1]].draws)
    assert [p.occasion for p in both.predictions] == list(range(len(names)))
    assert all(found["lost"] == 0 for found in both.numbers["band_checks"].values())


def test_deviations_from_run_to_run_come_back_from_the_folder_and_older_folders_have_none(tmp_path):
    path = write_diagnosed(in_two_sizes_of_sea(0.5), tmp_path)
    h = in_two_sizes_of_sea(0.5).hypotheses[0]
    back = read_diagnosed(tmp_path)
    assert np.array_equal(back.hypotheses[1].run_sd, h.run_sd)
    # the share of a coefficient's spread that is stated has both parts
    coefficients = read_diagnosed(tmp_path), found_with()
    assert stated_spread(coefficients[0])[1] == pytest.approx(1.25**0.5 * stated_spread(coefficients[1])[1])
    record = json.loads(path.read_text())
    assert record["format"] == 2  # a reader that knows none would draw too narrow
    for wrong in ([0.1], [-1.0] * len(h.names), [float("nan")] * len(h.names), "none"):
        spoilt_one = {**record, "hypotheses": [{**record["hypotheses"][0], "weight": 1.0, "run_sd": wrong}]}
        path.write_text(json.dumps(spoilt_one))
        with pytest.raises(ModelError, match=r"model\.json"):
            read_diagnosed(tmp_path)
    write_diagnosed(found_with(), tmp_path)
    record = json.loads(path.read_text())
    assert record["format"] == 1 and "run_sd" not in record["hypotheses"][0]
    assert not read_diagnosed(tmp_path).hypotheses[0].run_sd.any()


def test_the_model_of_another_vehicle_is_refused(tmp_path):
    write_diagnosed(found_with(), tmp_path)
    other = planted_trial(model_of("generic_sub"))
    other = replace(other, vehicle_ref="generic_sub")
    with pytest.raises(ModelError, match=r"is of REMUS 100 .* m long, and the trial pond of .* 102.3 m"):
        predict(other, model=tmp_path, draws=20)


@pytest.mark.parametrize(("predicted", "said"), [(9.0, False), (10.5, False), (23.0, True)])
def test_a_run_predicted_worse_than_as_given_is_said_to_be_no_gain(predicted, said):
    psi = {"rms": np.radians(predicted), "rms_given": np.radians(10.0), "inside": 0.9}
    row = {"name": "r1", "against_readings": {"psi": psi}, "measures": []}
    told = headline(SimpleNamespace(runs=()), (), [row])
    assert ("which is no gain" in told) == said and "as given within 10 degrees" in told


def test_a_channel_that_leaves_its_band_is_told_beside_those_that_stay_inside():
    # "100 % of its readings lie in the 95 % band" was told beside a yaw rate of which 41 % do
    def row(name, **inside):
        told = {"rms": 0.1, "rms_given": 0.2}
        return {"name": name, "against_readings": {k: told | {"inside": v} for k, v in inside.items()}}

    def told(*rows):
        return headline(SimpleNamespace(runs=()), (), rows)

    worst = row("r1", x=1.0, y=1.0, psi=1.0, r=0.4)
    assert told(worst).endswith("; 85% of its readings lie in the 95 % band, of r only 40%.")
    assert told(row("r1", x=0.9, y=1.0, psi=0.8)).endswith("; 90% of its readings lie in the 95 % band.")
    fine = row("r0", x=1.0, y=1.0, psi=1.0)
    assert told(fine, worst).endswith("; 100% of its readings lie in the 95 % band, of r in the r1 only 40%.")


def test_what_is_compared_is_told_with_as_many_digits():
    measure = {"quantity": "overshoot 1", "unit": "deg", "share": 1.0, "mean": 0.8419, "told": 0.8419}
    measure |= {"low": 0.8407, "high": 0.8431, "given": 0.8024}
    row = {"name": "zigzag:10/10", "against_readings": {}, "measures": [measure], "heading_open_from": None}
    told = headline(SimpleNamespace(runs=()), (), [row])
    assert "overshoot 1 of 0.842 deg (95 %: 0.841 to 0.843; as given 0.802)" in told
    assert beside(0.8024, ("0.842", "0.841", "0.843")) == "0.802"
    assert beside(356.2, ("332.2", "332.0", "332.5")) == "356.2"
    assert beside(490.4, ("455", "440", "470")) == "490"
    assert beside(9.46, ("10", "8", "12")) == "9.5"


def test_a_band_is_told_with_digits_that_part_its_ends():
    assert band_text(332.2, 332.0, 332.5) == ("332.2", "332.0", "332.5")
    assert band_text(10.0, 8.0, 12.0) == ("10", "8", "12")
    assert band_text(1.0, 1.0, 1.0) == ("1", "1", "1")
    assert band_text(5.0, 5.0 - 1e-13, 6.0) == ("5", "5", "6")
    assert band_text(332.0, 332.0 - 1e-9, 332.2) == ("332.0", "332.0", "332.2")
    assert band_text(332.2, 331.6, 332.8) == ("332.2", "331.6", "332.8")
    assert band_text(332.2, 330.0, 332.4) == ("332.2", "330.0", "332.4")
    assert band_text(0.0, 0.0, 2e-4) == ("0", "0", "0.0002")
    assert band_text(5.0, 1.0, np.inf)[0] == "5"
    # a rudder that was ordered is the same in all draws, but for rounding
    assert band_text(13.002131245, 13.002131245, 13.0021312451) == ("13", "13", "13")
