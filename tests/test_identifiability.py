"""What data leave open is named alike by three lenses, and what they fix is never called open."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from bayesid.analysis.identifiability import as_if_read, identify, information, scalings, with_assumed_priors
from bayesid.analysis.identifiability import profile as profile_module
from bayesid.analysis.identifiability.equal_accelerations import equal_accelerations
from bayesid.analysis.identifiability.open_directions import family_of
from bayesid.equations.model import build_model
from bayesid.estimation.output_error import coefficient_set, trial_problem
from bayesid.manoeuvres import spiral, straight, zigzag
from bayesid.model.vehicles import load_vehicle
from bayesid.simulation.accelerations import rates_on
from bayesid.simulation.virtual_trial import virtual_trial

DEG = math.pi / 180
NOISE = {"x": 1.0, "y": 1.0, "psi": 0.5 * DEG, "u": 0.05, "v": 0.05, "r": 0.05 * DEG}
# surge drag twice: ahead u|u| and u*u are one and the same regressor
CONFOUNDED = ("X_uu", "X_u|u|", "N_r", "Y_v", "N_dr", "N_v")


@pytest.fixture(scope="module")
def model():
    return build_model(load_vehicle("generic_sub"), 3)


def problem_of(model, manoeuvre, free):
    trial = virtual_trial(
        model, model.nominal, {"run": manoeuvre}, title="t", vehicle_ref="generic_sub", noise=NOISE,
        rng=np.random.default_rng(1),
    )  # fmt: skip
    return trial_problem(model, trial, coefficient_set(model, free), threads=1)


@pytest.fixture(scope="module")
def confounded(model):
    return problem_of(model, zigzag(20 * DEG, 20 * DEG, 90.0, 10.0, 300.0, 1.0), CONFOUNDED)


@pytest.fixture(scope="module")
def spiral_problem(model):
    return problem_of(model, spiral(90.0, dt=1.0), model.coefficients)


@pytest.fixture(scope="module")
def on_spiral(spiral_problem):
    return identify(spiral_problem, level=0.1, offsets=(-2.0, 2.0))


def draws_of(info, count, seed):
    """Normal draws with the Laplace covariance [SI]."""
    root = np.linalg.cholesky(info.covariance)
    unit = np.random.default_rng(seed).standard_normal((count, len(info.names))) @ root.T
    return info.z + unit * info.unit


@pytest.mark.parametrize("source", ["Laplace", "draws"])
def test_a_planted_confounder_is_reported_by_all_three_lenses(confounded, source):
    draws = None
    if source == "draws":
        draws = draws_of(identify(confounded, profile=False).information, 4000, 3)
    found = identify(confounded, draws=draws)
    (direction,) = found.directions
    # a unit of either is the same number: half of its own size, which the file leaves at one value for both
    planted = np.array([1.0, -1.0, 0, 0, 0, 0])
    assert abs(direction.relative @ planted) / math.sqrt(2) > 0.99
    assert set(direction.agreement) == {"svd", "covariance", "profile"}
    assert min(direction.agreement.values()) > 0.99
    assert direction.exact
    assert {found.entry(n).words for n in CONFOUNDED[:2]} == {
        "traded off with X_u|u|",
        "traded off with X_uu",
    }
    assert set(direction.fixed.split(" ")) >= {"X_uu", "X_u|u|", "+"}  # the data do fix the sum


def test_an_identifiable_coefficient_is_open_in_no_lens(confounded):
    found = identify(confounded)
    for name in CONFOUNDED[2:]:
        i = found.names.index(name)
        assert found.entry(name).verdict == "fixed by data"
        assert all(abs(d.vector[i]) < 0.01 for d in found.directions)
        assert found.profiles[i].data_share > 0.95
        axis = np.eye(len(found.names))[i]
        assert found.information.share_along(axis) > 0.99


@pytest.mark.thorough
def test_three_structural_directions_and_the_ridge_are_named_on_the_spiral(on_spiral):
    # Furlong et al. (2003), all 22 free: two scaled equations and, in one-sided turns, their mixture
    words = [d.words for d in on_spiral.structural]
    assert len(words) == 3
    assert all(any(k in w for w in words) for k in ("of the sway", "of the yaw", "added to the yaw"))
    ridges = [d for d in on_spiral.directions if d.words.startswith("vv/vr/rr ridge")]
    assert {axis for d in ridges for axis in "XYN" if f" {axis}" in d.words} == {"X", "Y", "N"}
    assert on_spiral.agreement > 0.99


def test_a_zigzag_breaks_the_mixture_of_equations_only(model):
    found = identify(
        problem_of(model, zigzag(20 * DEG, 20 * DEG, 90.0, 10.0, 600.0, 1.0), None), profile=False
    )
    assert [d.words.split()[2:4] for d in found.structural] == [["the", "sway"], ["the", "yaw"]]


def test_fixing_one_coefficient_per_equation_leaves_one_mixture(model):
    free = [n for n in model.coefficients if n not in ("Y_v", "N_v")]
    found = identify(problem_of(model, spiral(90.0, dt=1.0), free), profile=False)
    assert [d.words[:7] for d in found.structural] == ["mixture"]
    fewer = [n for n in free if n != "N_dr"]
    assert identify(problem_of(model, spiral(90.0, dt=1.0), fewer), profile=False).structural == ()


def test_no_equation_can_be_scaled_with_its_inertia_known(model, confounded):
    assert scalings(confounded, confounded.start) == ()


def test_index_and_profile_name_the_same_share_of_the_data(on_spiral):
    # the profile's share is the index where the posterior is normal; 2 sd of 10 % priors bend it little
    for entry, profile in zip(on_spiral.entries, on_spiral.profiles, strict=True):
        assert profile.data_share == pytest.approx(entry.index, abs=0.03)
        assert entry.index <= entry.contraction + 1e-9


def test_the_index_is_the_slope_of_the_variance_by_the_power_of_the_likelihood(confounded):
    full = with_assumed_priors(confounded)
    full = as_if_read(full, full.start)
    info = information(full)
    one, two = (
        information(full.with_sigma({c: s * f for c, s in NOISE.items()})).covariance
        for f in (1.0 - 5e-5, 1.0 + 5e-5)
    )
    # sigma (1 + e) is the likelihood to the power 1 - 2 e, but initial states keep their prior: hence 1e-2
    slope = np.log(np.diag(two) / np.diag(one)) / 2e-4
    assert slope == pytest.approx(info.data_share, abs=1e-2)


def test_a_killed_profile_goes_on_where_it_was(confounded, tmp_path, monkeypatch):
    log = tmp_path / "profile.jsonl"
    whole = identify(confounded, profile=("N_r", "X_uu"))
    calls = []
    real = profile_module._refit

    def dying(*args):
        if len(calls) == 9:  # of twelve
            raise KeyboardInterrupt
        calls.append(args)
        return real(*args)

    monkeypatch.setattr(profile_module, "_refit", dying)
    with pytest.raises(KeyboardInterrupt):
        identify(confounded, profile=("N_r", "X_uu"), log=log)
    with log.open("a") as handle:
        handle.write('{"name": "X_uu", "offs')  # torn by the kill
    calls.clear()
    again = identify(confounded, profile=("N_r", "X_uu"), log=log)
    assert len(calls) == 3
    for a, b in zip(whole.profiles, again.profiles, strict=True):
        assert a.rise.tolist() == b.rise.tolist()


def test_a_stored_refit_that_is_not_true_is_done_again(confounded, tmp_path):
    log = tmp_path / "profile.jsonl"
    whole = identify(confounded, profile=("N_r",), log=log)
    lines = [json.loads(line) for line in log.read_text().splitlines()]
    lines[0]["refit"]["rise"] += 0.1  # a tenth of a nat: twenty times what the profile settles to
    lines[1]["refit"]["z"] = lines[2]["refit"]["z"]
    lines[3]["digest"], lines[3]["refit"]["rise"] = "of another fit", -5.0
    log.write_text("".join(json.dumps(line) + "\n" for line in lines))
    again = identify(confounded, profile=("N_r",), log=log)
    assert again.profiles[0].rise.tolist() == whole.profiles[0].rise.tolist()
    assert '"of another fit"' in log.read_text()


def test_a_coefficient_below_the_noise_is_too_small_to_matter(on_spiral):
    entry = on_spiral.entry("Y_rdot")
    assert (entry.verdict, entry.reach < 1.0) == ("too small to matter", True)


def test_an_unexcited_coefficient_rests_on_the_prior_only(model):
    problem = problem_of(model, straight(90.0, 100.0, 1.0), ("X_drdr", "X_udot"))
    found = identify(problem, profile=False)
    assert found.entry("X_drdr").verdict == "prior only"
    assert found.entry("X_drdr").index == pytest.approx(0.0, abs=1e-12)


def test_families_follow_the_regressors():
    assert {family_of(n) for n in ("X_vv", "Y_v|r|", "N_r|r|", "X_vr")} == {"vv/vr/rr"}
    assert {family_of(n) for n in ("Y_v", "N_r", "Y_v0")} == {"v/r"}
    assert family_of("N_vdot") == "accelerations"
    assert family_of("N_|r|dr") == "rudder"
    assert {family_of(n) for n in ("X_udot", "X_uu", "Z_w", "ocean_current.V_north")} == {""}


def test_the_profile_likelihood_is_flat_where_only_the_prior_resists(confounded):
    found = identify(confounded, profile=("X_uu", "N_dr"))
    flat, known = found.profiles
    assert flat.data_interval() == (-math.inf, math.inf)
    assert flat.interval() == pytest.approx((-1.645, 1.645), abs=0.1)  # the prior ends the ridge
    # N_dr is read off a zig-zag: without priors its interval is hardly wider
    low, high = known.data_interval()
    assert found.entry("N_dr").index > 0.9 and -2.2 < low < -1.5 and 1.5 < high < 2.2


@pytest.mark.parametrize(
    "vehicle, said",
    [
        ("remus100", {"yaw equation added to the sway equation", "scale of the yaw equation"}),
        (
            "generic_sub",
            set(),
        ),  # weight, buoyancy and thrust are in every equation that has rows for the rest
    ],
)
def test_in_six_degrees_of_freedom_structural_directions_leave_every_acceleration_as_it_is(vehicle, said):
    six = build_model(load_vehicle(vehicle), 6)
    rpm, unit = six.vehicle.rpm_ref, six.scales["L"] / six.scales["U"]
    noise = dict.fromkeys(six.states, 0.01)
    run = straight(rpm, 2 * unit, 0.25 * unit)
    trial = virtual_trial(
        six, six.nominal, {"run": run}, title="t", vehicle_ref=vehicle, noise=noise,
        rng=np.random.default_rng(1),
    )  # fmt: skip
    problem = trial_problem(six, trial, coefficient_set(six, six.coefficients), threads=1)
    found = equal_accelerations(problem, problem.start)
    assert {words for words, _ in found} == said
    rng = np.random.default_rng(3)
    states = rng.uniform(-0.3, 0.3, (50, len(six.states)))
    fins = rng.uniform(-0.3, 0.3, (50, len(six.kernel.actuators)))
    nobody = np.zeros(0, dtype=np.int64)
    before = rates_on(six, six.nominal, states, fins, nobody)[0]
    where = six.positions(problem.params.names)
    for _, tangent in found:
        for step in (0.02, 0.5):  # finite, too: the largest relative change of any coefficient
            far = step / np.max(np.abs(tangent / six.nominal[where]))
            moved, wrong = np.array(six.nominal), np.array(six.nominal)
            moved[where] += far * tangent
            assert rates_on(six, moved, states, fins, nobody)[0] == pytest.approx(before, rel=1e-7, abs=1e-9)
            largest = int(np.argmax(np.abs(tangent / six.nominal[where])))
            wrong[where[largest]] += far * tangent[largest]  # the control: one of them alone
            assert np.abs(rates_on(six, wrong, states, fins, nobody)[0] - before).max() > 1e-6
