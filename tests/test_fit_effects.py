"""Effects freed beside coefficients: planted ones are found, absent ones are not; vehicle files keep them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bayesid.api.fit import FitResult
from bayesid.api.inputs import declared_effects
from bayesid.equations.model import build_model
from bayesid.errors import FitError, ModelError, VehicleError
from bayesid.estimation.likelihood import NoiseParts
from bayesid.estimation.onsets import begun_in_time, onsets_tried
from bayesid.estimation.output_error.trial_setup import trial_problem
from bayesid.estimation.parameters import coefficient_set, with_effects
from bayesid.estimation.segments import in_pieces
from bayesid.estimation.trial_fit import fit_trial
from bayesid.manoeuvres import turn, zigzag
from bayesid.model.vehicles import load_vehicle, write_vehicle
from bayesid.report.fit_effects import effect_words, parameter_words
from bayesid.simulation import simulate
from bayesid.simulation.virtual_trial import virtual_trial
from bayesid.trials import window

NOISE = {"x": 1.0, "y": 1.0, "psi": 0.01, "u": 0.05, "v": 0.05, "r": 1e-3}
FREE = ("N_v", "N_r", "N_dr")
EFFECTS = ("ocean_current", "actuator_lag")
PLANTED = {"ocean_current.V_north": 0.2, "ocean_current.V_east": -0.1, "actuator_lag.tau": 4.0}
ORDERS = {"zz": zigzag(0.35, 0.35, 90.0, 10.0, 300.0, 1.0), "circle": turn(0.3, 90.0, 20.0, 300.0, 1.0)}


def _trial(planted, seed=5, vehicle="generic_sub"):
    model = build_model(load_vehicle(vehicle), 3)
    return virtual_trial(
        model, model.with_values(planted), ORDERS, title="twin", vehicle_ref=vehicle, noise=NOISE,
        rng=np.random.default_rng(seed),
    )  # fmt: skip


@pytest.fixture(scope="module")
def found():
    return fit_trial(_trial(PLANTED), free=FREE, effects=EFFECTS, parts=NoiseParts())


@pytest.fixture(scope="module")
def absent():
    return fit_trial(_trial({}), free=FREE, effects=EFFECTS, parts=NoiseParts())


def test_planted_effects_are_found_within_three_standard_deviations(found):
    assert found.fit.success
    prior = build_model(found.vehicle, 3)
    for name, truth in PLANTED.items():
        i = found.fit.names.index(name)
        assert abs(found.fit.z[i] - truth) < 3 * found.fit.sd[i]  # fails one seed in 120 for three numbers
        assert found.fit.sd[i] < 0.1 * prior.prior_sd(name)  # it is the runs that tell


def test_without_effects_the_same_fit_misses_the_runs(found):
    """The control of the test above: the sizes matter to these readings."""
    bare = fit_trial(_trial(PLANTED), free=FREE, parts=NoiseParts())
    assert bare.fit.cost > 3 * found.fit.cost
    assert min(found.gains.values()) > 50.0


@pytest.mark.thorough
def test_effects_that_are_not_there_have_intervals_that_hold_their_off_value(absent):
    for name in PLANTED:
        i = absent.fit.names.index(name)
        assert abs(absent.fit.z[i]) < 3 * absent.fit.sd[i]
    assert all(gain < 0.5 * 3.0**2 + 2 for gain in absent.gains.values())
    assert all("does not show" in words for words in effect_words(absent))
    assert not any("as well" in words for words in effect_words(absent))


def _as_sure(found, sd_of):
    """The same fit with other standard deviations of its effects' sizes."""
    sd = np.array(found.fit.sd)
    for name in PLANTED:
        i = found.fit.names.index(name)
        sd[i] = sd_of(name, abs(found.fit.z[i]))
    return replace(found, fit=replace(found.fit, sd=sd))


def test_a_size_that_may_be_none_is_not_told_as_found(found):
    # "1 % more force than stated (share 0.008 ± 0.067; 7.1 nats)" was told of fins that give 18 % more
    unsure = _as_sure(found, lambda name, size: size)
    assert all("is open: its size is within two" in words for words in effect_words(unsure))
    assert not any("is open" in words for words in effect_words(found))


def test_runs_that_leave_a_size_open_do_not_say_that_it_does_not_show(absent):
    wide = effect_words(_as_sure(absent, lambda name, size: absent.model.prior_sd(name)))
    assert all(words.startswith("These runs do not tell ") for words in wide)
    assert not any("do not tell" in words for words in effect_words(absent))


def test_a_size_far_from_zero_that_gains_nothing_says_that_the_runs_do_without_it(found):
    nothing = effect_words(replace(found, gains=dict.fromkeys(found.gains, 0.1)))
    assert all("does not show in these runs: with all else fitted again" in words for words in nothing)


@pytest.mark.thorough
@pytest.mark.parametrize(("onset", "piece"), [(45.0, None), (240.0, None), (240.0, 100.0)])
def test_a_drag_that_steps_up_is_found_though_its_time_has_no_slope_while_it_is_off(onset, piece):
    """Begun at nothing, at the prior's mean beyond the end of the runs, a search stays there."""
    s = build_model(load_vehicle("generic_sub"), 3).scales
    planted = {
        "drag_step.extra_drag": 1e-3 * 0.5 * s["rho"] * (s["L"] * s["U"]) ** 2,
        "drag_step.onset": onset,
    }
    trial = _trial(planted)
    trial = trial if piece is None else in_pieces(trial, piece)
    found = fit_trial(trial, free=FREE, effects=("drag_step",), parts=NoiseParts())
    for name, truth in planted.items():
        i = found.fit.names.index(name)
        assert abs(found.fit.z[i] - truth) < 3 * found.fit.sd[i], name
    assert found.fit.sd[found.fit.names.index("drag_step.onset")] < 5.0
    assert "more drag" in " ".join(effect_words(found))


def test_times_tried_lie_in_the_parts_of_runs_that_are_read():
    trial = _trial({})
    late = replace(trial, runs=tuple(window(run, 150.0, 250.0) for run in trial.runs))
    tried = onsets_tried(trial_problem(build_model(load_vehicle("generic_sub"), 3), late, threads=1).runs)
    assert tried == pytest.approx((200.0, 180.0, 220.0, 165.0, 235.0))


def test_a_drag_that_steps_up_begins_as_a_vehicle_file_says():
    vehicle = replace(
        load_vehicle("generic_sub"), effects={"drag_step.extra_drag": 1.0, "drag_step.onset": 70.0}
    )
    model = build_model(vehicle, 3)
    params = with_effects(model, coefficient_set(model, FREE), ("drag_step",))
    problem = trial_problem(model, _trial({}), params, threads=1)
    assert np.array_equal(begun_in_time(problem).start, problem.start)


def test_slopes_by_effect_parameters_are_those_of_differences():
    model = build_model(load_vehicle("generic_sub"), 3)
    params = with_effects(model, coefficient_set(model, FREE), EFFECTS)
    problem = trial_problem(model, _trial(PLANTED), params, threads=1)
    z = np.array(problem.start)
    for name, value in PLANTED.items():
        z[problem.names.index(name)] = 1.1 * value
    _, jac = problem.jacobian(z)
    for name in PLANTED:
        i, step = problem.names.index(name), 1e-4
        up, down = (problem.residuals(z + sign * step * np.eye(z.size)[i]) for sign in (1, -1))
        slope = (up - down) / (2 * step)
        assert np.linalg.norm(jac[:, i] - slope) < 1e-3 * np.linalg.norm(slope)


def test_the_first_screen_tells_sizes_in_engineering_units(found):
    words = " ".join(effect_words(found))
    assert "lag of 4" in words and "tau 4" in words and "m/s" in words
    summary = FitResult(found).summary()
    assert all(line in summary for line in effect_words(found))
    offset = fit_trial(
        _trial({"rudder_offset.offset": np.radians(2.0)}), free=("N_dr",), effects=("rudder_offset",),
        parts=NoiseParts(),
    )  # fmt: skip
    told = parameter_words(offset, "rudder_offset.offset")
    assert told.endswith(" deg") and abs(float(told.split()[1]) - 2.0) < 0.1


def test_a_saved_vehicle_has_its_effects_on_and_simulates_identically(found, tmp_path):
    path = write_vehicle(found.identified, tmp_path / "found.toml")
    vehicle = load_vehicle(path)
    assert vehicle.effects == found.identified.effects and set(vehicle.effects) == set(PLANTED)
    assert vehicle.digest == found.identified.digest
    model = build_model(vehicle, 3)
    plan = found.problem.runs[0].plan
    x0 = found.problem.split(found.fit.z)[1][0]
    expected = found.problem.tracks(found.fit.z)[0].states
    assert np.allclose(simulate(model, model.nominal, plan, x0).states[:, :6], expected[:, :6], rtol=1e-9)
    without = simulate(model, model.with_values(dict.fromkeys(PLANTED, 0.0)), plan, x0).states
    assert np.abs(without[:, :2] - expected[:, :2]).max() > 10.0  # m: the control


def test_a_fit_of_a_vehicle_with_effects_starts_from_them_and_their_deviations(found, tmp_path):
    model = build_model(load_vehicle(write_vehicle(found.identified, tmp_path / "found.toml")), 3)
    params = with_effects(model, coefficient_set(model, FREE), ("actuator_lag",))
    entry = params["actuator_lag.tau"]
    i = found.fit.names.index("actuator_lag.tau")
    assert entry.start == entry.prior.centre == found.fit.z[i] and entry.prior.spread == found.fit.sd[i]


def test_a_vehicle_without_effects_keeps_its_digest():
    vehicle = load_vehicle("generic_sub")
    assert vehicle.digest != replace(vehicle, effects={"actuator_lag.tau": 0.1}).digest
    assert vehicle.digest == replace(vehicle, effects={}).digest


def test_unknown_effects_are_one_error_with_the_nearest_names(tmp_path):
    with pytest.raises(FitError, match=r"no effect 'ocean_curent'.*ocean_current"):
        fit_trial(_trial({}), free=FREE, effects=("ocean_curent",))
    vehicle = load_vehicle("generic_sub")
    with pytest.raises(ModelError, match=r"nobody declares actuator_lag\.tua .*actuator_lag\.tau"):
        build_model(replace(vehicle, effects={"actuator_lag.tua": 0.1}), 3)
    path = write_vehicle(vehicle, tmp_path / "odd.toml")
    path.write_text(path.read_text() + '\n[effects.actuator_lag]\ntau = "slow"\n')
    with pytest.raises(VehicleError, match=r"effects\.actuator_lag\.tau.*number"):
        load_vehicle(path)


@pytest.mark.slow  # prints and compiles a kernel of its own
def test_an_effect_of_ones_own_is_freed_by_name(tmp_path):
    file = tmp_path / "own.py"
    file.write_text(
        "from bayesid.model.effects import Effect, EffectParameter\n"
        "EFFECTS = (Effect(name='towed_rope', family='rope', port='force', where=('X',),\n"
        "    parameters=(EffectParameter('pull', 'N', 1e-4, 'rho*L**2*U**2/2', about='pull aft'),),\n"
        "    force={'X': '-pull'}, source='test', magnitude='test', says='A rope pulls with {pull:N}.'),)\n"
    )
    own = declared_effects(file)
    model = build_model(load_vehicle("generic_sub"), 3, own)
    pull = 2.0 * model.prior_sd("towed_rope.pull")
    truth = model.with_values({"towed_rope.pull": pull})
    rng = np.random.default_rng(5)
    trial = virtual_trial(model, truth, ORDERS, title="twin", vehicle_ref="generic_sub", noise=NOISE, rng=rng)
    found = fit_trial(trial, free=("N_dr",), effects=("towed_rope",), declared=own, parts=NoiseParts())
    i = found.fit.names.index("towed_rope.pull")
    assert abs(found.fit.z[i] - pull) < 3 * found.fit.sd[i] < 0.5 * pull
    assert "A rope pulls with" in effect_words(found)[0]


@pytest.mark.slow
def test_an_effect_is_sampled_beside_coefficients(tmp_path):
    """The posterior of a planted lag holds it and is narrower than its prior."""
    from bayesid.api.sample import sample

    trial = _trial(PLANTED)
    chosen = replace(trial, runs=tuple(window(run, 0.0, 120.0) for run in trial.runs))
    found = sample(
        chosen, tmp_path, free=["N_dr"], with_effects=list(EFFECTS), quick=True, max_steps=40, memory="ignore"
    ).posterior
    assert found.names[:1] == ("N_dr",)
    i = found.names.index("actuator_lag.tau")
    assert abs(found.mean[i] - PLANTED["actuator_lag.tau"]) < 4 * found.sd[i]
    assert found.sd[i] < 0.3 * PLANTED["actuator_lag.tau"]
