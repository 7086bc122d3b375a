"""A force the equations lack: found where it is planted and only there, and what it leaves to name."""

from dataclasses import replace
from types import SimpleNamespace as Plain

import numpy as np
import pytest
from gap_trials import model_of, other_vehicle, planted_trial
from scipy.integrate import quad
from scipy.stats import norm

from bayesid.api.simulate import simulate_model
from bayesid.diagnosis import form_stage
from bayesid.diagnosis.data.model_form import ModelForm, absent_fins, form_effects, with_form
from bayesid.diagnosis.data.problem import build_problem, fit_with
from bayesid.diagnosis.exclusions import compare_without
from bayesid.diagnosis.hypotheses import candidate as candidates
from bayesid.diagnosis.hypotheses.candidate import corrected_evidence, jackknife, weighted_hypothesis
from bayesid.diagnosis.hypotheses.facts import like_a_form
from bayesid.diagnosis.hypotheses.form_columns import FormColumns
from bayesid.diagnosis.hypotheses.form_part import beyond, form_gain
from bayesid.diagnosis.hypotheses.form_search import SoughtForm
from bayesid.diagnosis.hypotheses.verdict import decide
from bayesid.equations.model import build_model
from bayesid.estimation.filter_error.evidence import NormalEquations
from bayesid.estimation.likelihood.model_form import form_rows, typical
from bayesid.estimation.parameters import coefficient_prior
from bayesid.manoeuvres import OpenLoop
from bayesid.model.terms import term
from bayesid.model.vehicles import load_vehicle
from bayesid.simulation import plan_run, simulate, steady_start

SIZES = {"X": 0.0, "Y": 3e-4, "N": 1e-3}


def test_a_form_widens_the_rows_it_has_and_adds_those_the_vehicle_lacks():
    model = model_of("generic_sub")
    stated = coefficient_prior(model)
    free = with_form(model, stated, ModelForm(SIZES))
    assert free.names[: len(stated.names)] == stated.names
    sd = dict(zip(free.names, free.sd, strict=True))
    before = dict(zip(stated.names, stated.sd, strict=True))
    for name in stated.names:
        axis = name[0]
        moves = name in ("Y_v", "Y_r", "Y_dr", "N_v", "N_r", "N_dr")
        if moves:  # rows of motion: by as much as the form; a drift of 0.2 makes a force of its size
            assert sd[name] == pytest.approx(np.hypot(before[name], SIZES[axis] * abs(typical(model, name))))
        if axis == "X" or name.endswith("dot"):
            assert sd[name] == before[name]
    added = set(free.names[len(stated.names) :])
    assert {n for n in added if "." not in n} == {
        n for n in form_rows(model, cubes_of_fins=True) if n[0] in "YN"
    }
    assert {n.split(".")[0] for n in added if "." in n} == {
        "asymmetry_in_turns", "asymmetry_under_rudder", "crossflow_drag", "cubic_damping", "heel_in_yaw_rate",
        "hull_asymmetry",
    }  # fmt: skip


def test_another_power_of_drag_is_part_of_a_form_only_where_it_is_asked_for_by_itself():
    model = model_of("generic_sub")
    stated = coefficient_prior(model)
    power = "power_of_drag.power"
    none = dict.fromkeys("XYN", 0.0)
    assert power not in with_form(model, stated, ModelForm(dict.fromkeys("XYN", 1e-3))).names
    ahead = ModelForm(none, ahead=True)
    assert ahead.acts and not ModelForm(none).acts
    free = with_form(model, stated, ahead)
    assert free.names == (*stated.names, power)
    assert free.sd[: len(stated.names)] == pytest.approx(stated.sd)  # no row of the file is widened


def test_a_form_has_no_row_of_a_fin_that_the_vehicle_does_not_have():
    """An AUV without bow planes was written with X_dbdb = +0.72: drawn from its prior, as no run tells it."""
    model = build_model(load_vehicle("lauv"), 6)
    still = np.zeros((3, len(model.kernel.actuators)))
    bow, form = list(model.kernel.actuators).index("delta_b"), ModelForm(dict.fromkeys("XYZKMN", 1e-3))

    def free(vehicle_model, levels):
        absent = absent_fins(vehicle_model, [Plain(plan=Plain(levels=levels))])
        names = with_form(vehicle_model, coefficient_prior(vehicle_model), form, absent).names
        return {n for n in names if "." not in n and any(f.symbol == "delta_b" for f in term(n).factors)}

    assert not free(model, still)
    moving = still.copy()
    moving[1, bow] = 0.1
    assert "X_dbdb" in free(model, moving)  # control: a run moves it, so the file lacks it
    lauv = load_vehicle("lauv")
    has = build_model(replace(lauv, coef=lauv.coef | {"Z_db": -1.0}), 6)
    assert "X_dbdb" in free(has, still)  # control: the file has one, though no run moves it


def test_no_form_is_the_prior_of_the_vehicle():
    model = model_of("generic_sub")
    stated = coefficient_prior(model)
    nothing = ModelForm(dict.fromkeys("XYN", 0.0))
    free = with_form(model, stated, nothing)
    assert free.names == stated.names and (free.sd == stated.sd).all()
    assert not nothing.acts and form_effects(model, nothing) == ()


def test_a_resonance_starts_at_the_period_that_was_seen():
    model = model_of("generic_sub")
    time = model.scales["L"] / model.scales["U"]
    free = with_form(model, coefficient_prior(model), ModelForm(SIZES, period=1.5 * time))
    i = free.names.index("roll_motion.frequency")
    assert free.mean[i] == pytest.approx(2 * np.pi / 1.5) and free.sd[i] == pytest.approx(0.1 * free.mean[i])


def test_roll_left_out_is_a_resonance_and_in_a_steady_turn_a_force_by_the_yaw_rate():
    model = model_of("generic_sub")
    s, rpm = model.scales, model.vehicle.rpm_ref
    t = 0.02 * s["L"] / s["U"] * np.arange(1500)
    plan = plan_run(model, t, OpenLoop("turn", t, {
        "delta_r_cmd": np.where(t > 0, 0.1, 0.0), "n_cmd": np.full(t.size, rpm)}).commands)  # fmt: skip
    par = model.with_values({"roll_motion.frequency": 4.0})
    track = simulate(model, par, plan, steady_start(model), full=True).states
    names = model.kernel.full.states
    r, heel = track[:, names.index("r")], track[:, names.index("heel")]
    steady = r[-1] * s["L"] / model.nominal[model.index["U_ref"]]
    assert heel[-1] == pytest.approx(steady, rel=0.02)
    # an independent integration of heel'' = w^2 (r' - heel) - 0.2 w heel', driven by the same yaw rate
    w, dt = 4.0 * model.nominal[model.index["U_ref"]] / s["L"], t[1] - t[0]
    drive = r * s["L"] / model.nominal[model.index["U_ref"]]
    x, p = drive[0], 0.0
    fine, own = 50, [x]
    for a, b in zip(drive[:-1], drive[1:], strict=True):
        for k in range(fine):
            f = a + (b - a) * (k + 0.5) / fine
            p += dt / fine * (w * w * (f - x) - 0.2 * w * p)
            x += dt / fine * p
        own.append(x)
    assert np.abs(np.array(own) - heel).max() < 0.01 * np.abs(heel).max()


@pytest.mark.parametrize("low, high", [(0.0, 1.0), (0.0, np.inf), (-np.inf, 0.3), (-1.0, 3.0)])
@pytest.mark.parametrize("mean, sd", [(0.4, 0.1), (-0.5, 0.2), (2.0, 0.3)])
def test_the_evidence_is_that_of_a_prior_cut_at_the_range_of_the_effect(low, high, mean, sd):
    unit = 0.7  # prior sd; the prior mean is 0.2
    fitted = Plain(
        log_evidence=0.0,
        free=Plain(where=np.array([5]), mean=np.array([0.2]), sd=np.array([unit])),
        posterior=Plain(mean=np.array([(mean - 0.2) / unit]), covariance=np.array([[(sd / unit) ** 2]])),
    )
    model = Plain(limits={5: (low, high)})
    inside = quad(lambda x: norm.pdf(x, mean, sd), max(low, mean - 40 * sd), min(high, mean + 40 * sd))[0]
    prior = norm.cdf(high, 0.2, unit) - norm.cdf(low, 0.2, unit)
    if inside > 1e-12:
        assert corrected_evidence(model, fitted) == pytest.approx(np.log(inside / prior), abs=1e-6)
    assert corrected_evidence(Plain(limits={}), fitted) == 0.0


def test_far_outside_the_range_nothing_is_left_of_the_evidence():
    fitted = Plain(
        log_evidence=0.0,
        free=Plain(where=np.array([5]), mean=np.zeros(1), sd=np.ones(1)),
        posterior=Plain(mean=np.array([-7.0]), covariance=np.array([[0.01]])),
    )
    found = corrected_evidence(Plain(limits={5: (0.0, 1.0)}), fitted)
    assert -2460 < found < -2440  # (7/0.1)^2/2, and the prior's half


def test_the_jackknife_of_a_mean_is_its_standard_error(monkeypatch):
    values = np.array([1.0, 2.0, 4.0, 9.0])  # one run each, prior flat beside them
    equations = tuple(NormalEquations(np.array([[1e8]]), np.array([1e8 * v]), 0.0, 0.0, 1) for v in values)
    fitted = Plain(equations=equations, free=Plain(names=("a",), sd=np.array([3.0])))
    assert jackknife(fitted)[0] == pytest.approx(3.0 * values.std(ddof=1) / 2.0, rel=1e-6)
    two = Plain(equations=equations[:2], free=fitted.free)
    assert jackknife(two)[0] == 0.0


def test_only_what_exceeds_the_form_speaks_for_another_cause():
    assert beyond(100.0, 30.0) == 70.0 and beyond(20.0, 30.0) == 0.0 and beyond(-3.0, 30.0) == -3.0


@pytest.mark.thorough
def test_where_the_equations_are_right_no_form_is_asked_for():
    model = model_of("remus100")
    for seed, planted in ((3, {}), (4, {"rudder_offset.offset": 0.06})):
        trial = planted_trial(model, other_vehicle(model, seed) | planted, seed, samples=160)
        found = compare_without(model, trial)
        assert found.problem.form is None and found.candidates.form_seen == 0.0
        problem = found.problem
        assert form_gain(problem, weighted_hypothesis(problem, (), fit_with(problem, ()))) == 0.0


def planted_form(model, size):
    """Rows the vehicle lacks, each a force of this size over 1/2 rho L^2 U^2 at the typical motion."""
    return {n: -size * typical(model, n) for n in ("Y_vvr", "Y_|v|r", "N_vvr", "N_|v|r") if n in model.index}


@pytest.mark.thorough
def test_a_form_is_found_where_the_equations_lack_one_and_the_cause_beside_it_keeps_its_name():
    model = model_of("generic_sub")
    lacking = planted_form(model, 2e-3)
    trial = planted_trial(model, other_vehicle(model, 5) | lacking, 5, samples=160)
    found = compare_without(model, trial)
    assert found.problem.form is not None and found.problem.form.period is None
    verdict = decide(found.problem, found.candidates)
    assert verdict.word == "model_form" and "model_form" in verdict.set95 and "none" not in verdict.set95
    offset = planted_trial(
        model, other_vehicle(model, 5) | lacking | {"rudder_offset.offset": 0.06}, 5, samples=160
    )
    found = compare_without(model, offset)
    verdict = decide(found.problem, found.candidates)
    assert verdict.effects == ("rudder_offset",)
    assert form_gain(found.problem, found.candidates.best) > 20.0


@pytest.mark.thorough
@pytest.mark.parametrize("size", [2e-3, 0.0])
def test_a_hull_out_of_line_is_a_cause_where_no_form_is_needed_alone(size):
    """One screw turns a hull aside as a bent fin does: where equations lack a force it is not told."""
    model = model_of("generic_sub")
    moment = 3e-4 * 0.5 * model.scales["rho"] * model.scales["L"] ** 3 * model.scales["U"] ** 2
    askew = {"hull_misalignment.yaw_moment": moment} | (planted_form(model, size) if size else {})
    found = compare_without(model, planted_trial(model, other_vehicle(model, 5) | askew, 5, samples=160))
    verdict = decide(found.problem, found.candidates)
    if size:
        assert found.problem.form is not None and "hull_misalignment" not in verdict.effects
    else:
        assert verdict.effects == ("hull_misalignment",) and found.problem.form is None


@pytest.mark.thorough
def test_a_hull_out_of_line_is_named_beside_another_cause_where_no_form_is_needed():
    model = model_of("generic_sub")
    moment = 3e-4 * 0.5 * model.scales["rho"] * model.scales["L"] ** 3 * model.scales["U"] ** 2
    planted = {"hull_misalignment.yaw_moment": moment, "heading_bias.bias": 0.05}
    found = compare_without(model, planted_trial(model, other_vehicle(model, 5) | planted, 5, samples=160))
    assert found.problem.form is None
    assert set(decide(found.problem, found.candidates).effects) == {"hull_misalignment", "heading_bias"}


@pytest.mark.slow
def test_a_shape_of_a_form_that_was_planted_beside_another_cause_is_named_with_it():
    model = model_of("generic_sub")
    planted = {"cubic_damping.Y_vvv": -2.2e6, "rudder_offset.offset": 0.06}
    trial = planted_trial(model, other_vehicle(model, 5) | planted, 5, samples=160)
    found = compare_without(model, trial)
    assert found.problem.form is None and found.candidates.form_instead < -3.0
    assert set(decide(found.problem, found.candidates).effects) == {"cubic_damping", "rudder_offset"}


def test_beside_another_cause_a_shape_counts_for_any_force_of_the_motion_unless_that_loses_against_it():
    effects = {"shape": Plain(as_form="also"), "cause": Plain(as_form=""), "askew": Plain(as_form="alone")}
    both, alone = Plain(effects=("shape", "cause")), Plain(effects=("shape",))
    model = Plain(effects=effects)
    for instead, like in ((np.inf, ("shape",)), (30.0, ("shape",)), (-1.0, ("shape",)), (-9.0, ())):
        assert like_a_form(Plain(form_instead=instead), both, model) == like
        assert like_a_form(Plain(form_instead=instead), alone, model) == ()
        assert like_a_form(Plain(form_instead=instead), Plain(effects=("askew", "cause")), model) == ()


@pytest.mark.parametrize(
    ("gain", "beyond", "predicts", "effects", "seen"),
    [
        (12.0, 12.0, True, ("cause",), 12.0),
        (12.0, 12.0, False, ("cause",), 0.0),  # left-out runs are told worse with it
        (40.0, 4.0, True, ("shape", "cause"), 40.0),  # the shape stands for it
        (40.0, -2.0, True, ("shape",), 0.0),  # the shape is the cause
    ],
)
def test_a_form_that_is_not_taken_is_seen_as_far_as_it_is_no_cause(gain, beyond, predicts, effects, seen):
    problem = Plain(model=Plain(effects={"shape": Plain(as_form="also"), "cause": Plain(as_form="")}))
    sought = SoughtForm(ModelForm(SIZES), gain, beyond, predicts)
    assert form_stage._seen(problem, Plain(form_instead=np.inf), Plain(effects=effects), sought) == seen
    assert form_stage._seen(problem, Plain(form_instead=np.inf), Plain(effects=effects), None) == 0.0
    assert sought.needed == (predicts and gain >= 20.0)


@pytest.mark.parametrize(
    ("before", "after", "taken"),
    [
        ((100.0, True), (130.0, True), True),
        ((100.0, True), (110.0, True), False),  # less than a form must gain
        ((100.0, False), (90.0, True), True),  # what does not arrive says little
        ((100.0, False), (90.0, False), False),  # neither does: the more probable stays
        ((100.0, False), (130.0, False), True),
    ],
)
def test_a_form_takes_the_place_of_what_is_less_probable_or_does_not_arrive(
    monkeypatch, before, after, taken
):
    def refit(evidence, arrives):
        return Plain(log_evidence=evidence, effects=(), widens=False, fit=Plain(converged=arrives, chi2=1.0))

    best = refit(*after)
    monkeypatch.setattr(form_stage, "compare", lambda *a, **k: Plain(best=best))
    monkeypatch.setattr(form_stage, "form_gain", lambda *a: 100.0)
    problem = Plain(model=Plain(effects={}), form=None, with_form=lambda form: problem)
    single = Plain(none=None, refits=())
    needed = SoughtForm(ModelForm(SIZES), 50.0, 50.0, True)
    found, _ = form_stage._with_form(problem, needed, refit(*before), single, lambda text: None, 0, None)
    assert (found is not None) == taken


def rolling(frequency):
    """A trial of a ship that rolls, its readings planar, and what is left of it without any effect."""
    model = model_of("generic_sub")
    s = model.scales
    force = 0.5 * s["rho"] * s["L"] ** 2 * s["U"] ** 2
    heel = {
        "roll_motion.frequency": frequency,
        "roll_motion.Y_heel": 2e-3 * force,
        "roll_motion.N_heel": -6e-4 * force * s["L"],
    }
    problem = build_problem(model, planted_trial(model, other_vehicle(model, 5) | heel, 5, samples=160))
    return problem, weighted_hypothesis(problem, (), fit_with(problem, ()))


@pytest.mark.parametrize("frequency", [1.0, 2.5])
def test_roll_is_worth_as_much_in_the_search_as_in_the_refit_and_its_period_is_found(frequency):
    problem, none = rolling(frequency)
    period = 2 * np.pi * problem.model.scales["L"] / problem.model.scales["U"] / frequency
    columns = FormColumns.along(problem, none, period)
    forces = ModelForm({"X": 0.0, "Y": 1e-3, "N": 3e-4})
    gain = columns.evidence(ModelForm(forces.sizes, period)) - columns.evidence(forces)
    assert gain > 30.0  # 1.4 and 4.3 where the heel stayed as at another frequency
    wrong = FormColumns.along(problem, none, 2.0 * period)
    assert gain > wrong.evidence(ModelForm(forces.sizes, 2.0 * period)) - wrong.evidence(forces) + 20.0
    fitted = fit_with(problem.with_form(ModelForm(forces.sizes, 1.1 * period)), ())
    i = fitted.free.names.index("roll_motion.frequency")
    assert fitted.values[i] == pytest.approx(frequency, rel=0.02)
    assert abs(fitted.values[i] - frequency) < 3 * fitted.sd[i]


def test_the_form_of_a_problem_leaves_its_stated_coefficients():
    model = model_of("generic_sub")
    problem = build_problem(model, planted_trial(model, seed=1))
    wider = problem.with_form(ModelForm(SIZES))
    assert wider.stated is problem.coefficients and problem.stated is problem.coefficients
    fitted = fit_with(wider, ())
    assert candidates.pulls(fitted, wider).size == len(problem.coefficients.names)
    again = replace(wider, form=None)
    assert again.stated is problem.coefficients


@pytest.mark.thorough
def test_a_drag_that_goes_with_another_power_of_the_speed_is_told_as_what_the_equations_lack():
    """It was told as nothing, as a loss of thrust or as something outside the list."""
    model = build_model(load_vehicle("remus100"), 3)
    logged = replace(model, nominal=model.with_values({"power_of_drag.power": 0.6}))
    noise = {"x": 0.1, "y": 0.1, "psi": 0.005, "r": 0.002, "u": 0.004, "v": 0.004}
    runs = (
        "zigzag:10/10", "speedsteps:1500/900/1800/1200", "speedsteps:900/1800/1500/1000/1700",
        "turn:13,rpm=1000", "prbs:10", "zigzag:12/12,rpm=1800",
    )  # fmt: skip
    found = compare_without(model, simulate_model(logged, "remus100", runs, 0.5, None, None, noise, 1))
    assert decide(found.problem, found.candidates).word == "model_form"
    form = found.problem.form
    assert form.ahead and not any(form.sizes.values()) and form.period is None
    fitted = found.candidates.none.fit
    power = fitted.values[fitted.free.names.index("power_of_drag.power")]
    assert power == pytest.approx(0.6, abs=0.25)


def test_a_parameter_that_is_known_is_drawn_as_it_is():
    from bayesid.diagnosis.diagnosed_model import DiagnosedModel, WeightedHypothesis
    from bayesid.estimation.filter_error.noise_identification import no_process_noise

    model = model_of("generic_sub")
    names = ("N_r", "Y_v")
    mean = np.array([model.nominal[model.index[n]] for n in names])
    covariance = np.diag([0.0, (0.1 * mean[1]) ** 2])
    free = np.full(2, np.inf)
    one = WeightedHypothesis((), 1.0, names, mean, covariance, -free, free, no_process_noise(model))
    drawn = DiagnosedModel(model, (one,), {}, "none", "trial").draw(np.random.default_rng(0), 200)[0][1]
    values = drawn[:, model.positions(names)]
    assert (values[:, 0] == mean[0]).all()
    assert values[:, 1].std() == pytest.approx(0.1 * abs(mean[1]), rel=0.15)
