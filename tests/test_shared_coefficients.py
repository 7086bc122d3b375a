"""Coefficients over the bundles of a vehicle: what each log says alone, what is told, the vehicle file."""

import json
from dataclasses import replace

import numpy as np
import pytest

from bayesid.api import fleet
from bayesid.api.fleet import diagnose_fleet
from bayesid.api.shared_vehicles import write_shared_vehicles
from bayesid.cli.main import run
from bayesid.diagnosis.coefficient_estimate import CoefficientEstimate
from bayesid.diagnosis.diagnosed_file import read_diagnosed, write_diagnosed
from bayesid.diagnosis.diagnosed_model import DiagnosedModel, WeightedHypothesis
from bayesid.diagnosis.shared_coefficients import CoefficientSharing, share_coefficients
from bayesid.equations.model import build_model
from bayesid.errors import ModelError
from bayesid.estimation.filter_error.noise_identification import no_process_noise
from bayesid.estimation.parameters import coefficient_prior
from bayesid.model.vehicles import load_vehicle
from bayesid.report.fleet_coefficients import _notes, coefficient_rows, sharing_blocks, sharing_words
from bayesid.report.writer.blocks import Table

NAMES = ("Y_v", "N_v", "N_r", "N_dr")
PRIOR = 0.1


@pytest.fixture(scope="module")
def model():
    return build_model(load_vehicle("remus100"), 3)


def diagnosed(model, moved, seed=0, known=0.02, prior=None):
    """A diagnosed model whose log says these relative moves with an error, and an effect's parameter besides.

    `prior` are the prior standard deviations it was found under, over the nominal values.
    """
    rng = np.random.default_rng(seed)
    nominal = model.nominal[model.positions(NAMES)]
    prior = np.full(len(NAMES), PRIOR) if prior is None else np.asarray(prior)
    x = rng.standard_normal((20, 5)) / known / np.sqrt(20.0)
    truth = np.append(moved, 0.3)  # the last is the effect's
    y = x @ truth + rng.standard_normal(20)
    precision = x.T @ x + np.diag(np.append(prior, 1.0) ** -2)
    covariance = np.linalg.inv(precision)[:4, :4] * np.outer(nominal, nominal)
    mean = nominal * (1.0 + np.linalg.solve(precision, x.T @ y)[:4])
    size = np.full(4, np.inf)
    h = WeightedHypothesis((), 1.0, NAMES, mean, covariance, -size, size, no_process_noise(model))
    e = CoefficientEstimate(
        ("rudder_offset",), 1.0, NAMES, mean, covariance, nominal, prior * np.abs(nominal), True
    )
    return DiagnosedModel(model, (h,), {"psi": 0.01}, "effect", "digest", estimates=(e,))


def record(model, verdict="effect", gain=None, vehicle=None):
    moved = {}
    for name in NAMES:
        given = model.nominal[model.index[name]] / model.file_scale(name)
        moved[name] = {"given": given, "prior_sd": PRIOR * abs(given), "retuned": given, "explained": given}
    return {
        "verdict": verdict, "effects": [], "acting": {}, "gap": {"shrink": None}, "moved": moved,
        "retuning": {"kept": gain is None, "gain": gain, "error": 0.01, "sizes": {}},
        "trial": {"vehicle": vehicle or model.vehicle.name, "vehicle_digest": model.vehicle.digest},
    }  # fmt: skip


def shared(model, models, records=None):
    days = [f"day{i + 1}" for i in range(len(models))]
    records = records or [record(model)] * len(models)
    return share_coefficients(dict(zip(days, records, strict=True)), dict(zip(days, models, strict=True)))


def test_a_change_is_told_with_its_day_and_size(model):
    base = np.array([0.05, -0.05, 0.0, 0.1])
    days = [diagnosed(model, base + (i == 2) * np.array([0, 0, 0.2, 0]), seed=i) for i in range(4)]
    (s,) = shared(model, days).vehicles
    (c,) = s.changed
    assert c.name == "N_r" and c.furthest.bundle == "day3" and s.same < 0.01
    assert abs(c.furthest.apart / c.given - 0.2) < 1.96 * c.furthest.apart_sd / abs(c.given)
    words = sharing_words(s)
    assert "N_r of" in words and "is not the same in all 4 bundles" in words and "in day3 +" in words
    (t,) = [b for b in sharing_blocks(shared(model, days), ()) if isinstance(b, Table)]
    assert t.rows[0][0] == "N_r" and t.rows[0][6] == "day3"


@pytest.mark.parametrize("changed", [0, 1, 2])
@pytest.mark.parametrize("seed", [0, 10, 20])
def test_of_three_days_the_one_that_changed_is_told_whichever_it_is(model, changed, seed):
    # all three lie as many standard deviations from the other two
    days = [
        diagnosed(model, (i == changed) * np.array([0, 0, 0.2, 0]), seed=seed + i, known=0.01)
        for i in range(3)
    ]
    (s,) = shared(model, days).vehicles
    (c,) = s.changed
    assert c.name == "N_r" and c.furthest.bundle == f"day{changed + 1}"
    assert abs(c.furthest.apart / c.given - 0.2) < 3.0 * c.furthest.apart_sd / abs(c.given)


def test_a_change_beyond_the_stated_prior_is_named_under_the_wider_one(model):
    wide = (0.1, 0.1, 1.0, 0.1)
    moves = [np.array([0, 0, 1.2 * (i == 1), 0]) for i in range(3)]
    days = [diagnosed(model, m, seed=i, known=0.1, prior=wide) for i, m in enumerate(moves)]
    (s,) = shared(model, days).vehicles
    assert [c.name for c in s.changed] == ["N_r"] and s.changed[0].furthest.bundle == "day2"


def test_a_bundle_with_a_mistake_of_the_simulator_does_not_count(model):
    days = [diagnosed(model, np.zeros(4), seed=i) for i in range(3)]
    told = record(model) | {"simulator": [{"name": "another length"}]}
    sharing = shared(model, days, [record(model), told, record(model)])
    assert sharing.vehicles[0].bundles == ("day1", "day3") and "mistake" in sharing.left_out["day2"]


def test_no_vehicle_file_is_written_of_coefficients_that_no_vehicle_has(model, tmp_path):
    days = [diagnosed(model, np.zeros(4), seed=i) for i in range(2)]
    sharing = shared(model, days)
    (s,) = sharing.vehicles
    assert not s.impossible and len(write_shared_vehicles(sharing, tmp_path)) == 1
    lighter = replace(s.coefficients[0], name="Y_vdot", value=1e6)
    without_mass = replace(s, coefficients=(lighter, *s.coefficients[1:]))
    assert "mass matrix" in without_mass.impossible and "No vehicle file" in _notes(without_mass)
    assert write_shared_vehicles(CoefficientSharing((without_mass,)), tmp_path) == []
    assert not list(tmp_path.glob("*/vehicle.*"))


def test_one_set_is_shared_better_than_a_day_knows_it(model):
    base = np.array([0.05, -0.05, 0.0, 0.1])
    sharing = shared(model, [diagnosed(model, base, seed=i) for i in range(4)])
    (s,) = sharing.vehicles
    assert s.same > 0.75 and not s.changed and "are one set in all 4 bundles" in sharing_words(s)
    for c, moved in zip(s.coefficients, base, strict=True):
        assert abs(c.value / c.given - 1.0 - moved) < 3.0 * c.sd / abs(c.given)
        assert c.sd < 0.75 * min(e.alone_sd for e in c.each) and c.new_sd >= c.sd
        assert all(e.sd <= e.alone_sd for e in c.each)
    assert len(coefficient_rows(sharing)) == 4 * len(NAMES)


def test_a_wide_prior_of_an_explanation_is_the_one_taken_out(model):
    """The same log under another prior says the same."""
    moved = np.array([0.0, 0.0, 0.5, 0.0])
    other = diagnosed(model, np.array([0.0, 0.0, 0.45, 0.0]), seed=1, prior=(0.1, 0.1, 1.0, 0.1))
    narrow = diagnosed(model, moved, seed=0)
    wide = diagnosed(model, moved, seed=0, prior=(0.1, 0.1, 1.0, 0.1))
    (a,) = shared(model, [narrow, other]).vehicles
    (b,) = shared(model, [wide, other]).vehicles
    assert a.widened == b.widened == ("N_r",)
    np.testing.assert_allclose(a.covariance, b.covariance, rtol=1e-6)
    values = [[c.value for c in s.coefficients] for s in (a, b)]
    np.testing.assert_allclose(*values, rtol=1e-6)
    (stated,) = shared(model, [narrow, diagnosed(model, moved, seed=1)]).vehicles
    n_r = next(c for c in stated.coefficients if c.name == "N_r")
    assert not stated.widened and n_r.value / n_r.given < 1.49 < b.coefficients[2].value / n_r.given


def test_the_unit_of_the_file_does_not_matter(model):
    """The file in prime values, the model in SI: the same vehicle, other units."""
    prime = replace_units(model)
    base = np.array([0.05, -0.05, 0.0, 0.1])
    a, b = (
        shared(m, [diagnosed(m, base + 0.05 * i, seed=i) for i in range(3)]).vehicles[0]
        for m in (model, prime)
    )
    assert a.same == pytest.approx(b.same, rel=1e-6) and a.spread == pytest.approx(b.spread, rel=1e-6)
    for one, other in zip(a.coefficients, b.coefficients, strict=True):
        assert one.given != pytest.approx(other.given, rel=0.1)
        assert one.value / one.given == pytest.approx(other.value / other.given, rel=1e-7)
        assert one.sd / one.prior_sd == pytest.approx(other.sd / other.prior_sd, rel=1e-6)


def replace_units(model):
    v = model.vehicle
    coef = {n: x * _si(v, n) / _prime(v, n) for n, x in v.coef.items()}
    out = build_model(replace(v, nondimensional=True, coef=coef), 3)
    np.testing.assert_allclose(out.nominal, model.nominal, rtol=1e-9)
    return out


def _si(vehicle, name):
    from bayesid.model.vehicles import prime_scale

    return prime_scale(vehicle, name)


def _prime(vehicle, name):
    return _si(replace(vehicle, nondimensional=True), name)


def test_bundles_that_say_nothing_of_coefficients_are_left_out_with_a_reason(model):
    good = [diagnosed(model, np.zeros(4), seed=i) for i in range(2)]
    lost = diagnosed(model, np.zeros(4))
    lost = replace(lost, estimates=(replace(lost.estimates[0], converged=False),))
    old = replace(good[0], estimates=())
    r = record(model)
    other = r | {"trial": {"vehicle": "another", "vehicle_digest": "x"}}
    cases = {
        "a": (r, good[0]), "b": (record(model, gain=-0.09), good[1]),
        "outside": (record(model, "outside"), good[0]),
        "worse": (record(model, gain=-0.11), good[0]), "lost": (r, lost), "old": (r, old),
        "none": (r, "it keeps no model"), "single": (other, good[0]),
    }  # fmt: skip
    found = share_coefficients({n: c[0] for n, c in cases.items()}, {n: c[1] for n, c in cases.items()})
    (s,) = found.vehicles
    assert s.bundles == ("a", "b") and list(found.left_out) == list(cases)[2:]
    words = "".join(b.body for b in sharing_blocks(found, ("failed",)) if hasattr(b, "body"))
    for part in (
        "did not arrive",
        "no cause that is listed",
        "clearly worse",
        "no other bundle",
        "failed: no",
    ):
        assert part in words


def test_what_is_open_is_said_to_be_open(model):
    (s,) = shared(model, [diagnosed(model, np.zeros(4), seed=i) for i in range(2)]).vehicles
    assert "cannot be told" in sharing_words(replace(s, same=0.4))
    alike = replace(s, same=0.01, any_changed=0.2)
    assert "no single one stands out" in sharing_words(alike)
    chances = {"N_r": 0.6, "N_v": 0.37, "Y_v": 0.02, "N_dr": 0.0}
    each = tuple(replace(c, changed=chances[c.name]) for c in s.coefficients)
    split = replace(s, same=0.01, any_changed=0.97, coefficients=each)
    assert "open which differs: N_r (0.60), N_v (0.37)." in sharing_words(split)
    assert [c.name for c in split.suspects] == ["N_r", "N_v"] and not split.changed
    both = tuple(replace(c, changed=0.9 if c.name in ("N_r", "N_v") else 0.0) for c in s.coefficients)
    said = sharing_words(replace(s, same=0.01, any_changed=1.0, coefficients=both))
    assert "N_r and N_v of" in said or "N_v and N_r of" in said
    assert "are not the same in both bundles" in said and "(probability of each 0.90)" in said


def test_two_vehicles_of_one_name_keep_a_file_each_and_old_ones_go(model, tmp_path):
    good = [diagnosed(model, np.zeros(4), seed=i) for i in range(2)]
    (s,) = shared(model, good).vehicles
    other = replace(s, vehicle=replace(s.vehicle, rho=1.01 * s.vehicle.rho))
    folder = tmp_path / "shared_coefficients"
    both = write_shared_vehicles(CoefficientSharing((s, other)), folder)
    assert len({f.parent for f in both}) == 2 and all(load_vehicle(f).coef for f in both)
    (one,) = write_shared_vehicles(CoefficientSharing((s,)), folder)
    assert list(folder.glob("*/vehicle.toml")) == [one]


def test_estimates_come_back_from_their_file(model, tmp_path):
    found = diagnosed(model, np.zeros(4))
    write_diagnosed(found, tmp_path)
    (back,), (given,) = read_diagnosed(tmp_path).estimates, found.estimates
    assert back.record() == given.record() and back.converged and back.names == NAMES
    text = json.loads((tmp_path / "model.json").read_text())
    for key, value, words in (
        ("prior_sd", [0.0] * 4, "not positive"), ("mean", [1.0], "fit its names"),
        ("mean", [float("nan")] * 4, "not finite"),
    ):  # fmt: skip
        wrong = text | {"estimates": [text["estimates"][0] | {key: value}]}
        (tmp_path / "model.json").write_text(json.dumps(wrong))
        with pytest.raises(ModelError, match=words):
            read_diagnosed(tmp_path)


@pytest.mark.thorough
def test_the_shared_set_is_a_vehicle_that_other_commands_take_as_prior(model, tmp_path, monkeypatch, capsys):
    """From a folder of bundles to a fit with the shared prior, the diagnoses themselves made up."""
    moved = np.array([0.05, -0.05, 0.1, 0.1])
    for i in range(4):
        day = tmp_path / "all" / f"day{i}"
        assert run(["simulate", "remus100", "zigzag:10/10", "--noise", "psi=0.3deg", "--noise", "r=0.1deg/s",
                    "--out", str(day), "--seed", str(i)]) == 0  # fmt: skip

    class Found:
        verdict = "effect"

        def __init__(self, name):
            self.seed = int(name[-1])

        def save(self, folder):
            folder.mkdir(parents=True, exist_ok=True)
            (folder / "diagnosis.json").write_text(json.dumps(record(model)))
            write_diagnosed(diagnosed(model, moved, seed=self.seed), folder)

    monkeypatch.setattr(fleet, "diagnose", lambda trial, journal, **rest: Found(journal.name))
    out = tmp_path / "out"
    result = diagnose_fleet(tmp_path / "all", out)
    result.save(out)
    assert "are one set in all 4 bundles" in result.summary()
    assert "are one set in all 4 bundles" in (out / "report.html").read_text()
    assert json.loads((out / "fleet.json").read_text())["coefficients"]["vehicles"][0]["same"] > 0.75
    assert set(result.coefficients()["coefficient"]) == set(NAMES)
    assert "coefficients_1" in result.figures()
    (file,) = (out / "shared_coefficients").glob("*/vehicle.toml")
    again = load_vehicle(file)
    (s,) = result.sharing.vehicles
    prior = coefficient_prior(build_model(again, 3))  # what a diagnosis takes
    sd = dict(zip(prior.names, prior.sd, strict=True))
    for c in s.coefficients:
        assert again.coef[c.name] == pytest.approx(c.value, rel=1e-12)
        assert sd[c.name] == pytest.approx(c.new_sd * abs(model.file_scale(c.name)), rel=1e-9)
    capsys.readouterr()
    fitted = ["fit", str(tmp_path / "all" / "day0"), "--vehicle", str(file), "--free", "N_r,N_dr", "--quick"]
    assert run([*fitted, "--json"]) in (0, 3)
    start = json.loads(capsys.readouterr().out)["estimates_SI"]["N_r"]["start"]
    assert start == pytest.approx(again.coef["N_r"] * model.file_scale("N_r"), rel=1e-5)
