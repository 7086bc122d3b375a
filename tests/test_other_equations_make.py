"""Labelled campaigns of other vehicles: what is drawn, sizes aimed at, form gap, nominal simulators."""

import json

import numpy as np
import pytest

from bayesid.benchmark.other_equations import (
    LISTED,
    UNLISTED,
    VEHICLES,
    draw_campaign,
    executed,
    other_vehicle,
)
from bayesid.benchmark.other_equations.bundles import write_bundle
from bayesid.equations.model import build_model
from bayesid.model.vehicles import load_vehicle, stability
from bayesid.trials import load_trial
from studies.other_equations import make
from studies.other_equations.form_gap import form_gap
from studies.other_equations.scoring import regime_of
from studies.other_equations.tune import PRIOR, TUNED, start_text


def test_sixteen_campaigns_have_every_kind_and_no_listed_cause_comes_twice_before_others_came():
    rows = make.plan(3, 16)
    causes = [tuple(r["causes"]) for r in rows]
    assert sum(c == () for c in causes) == 3 and sum(len(c) == 2 for c in causes) == 2
    assert sum(set(c) <= set(UNLISTED) for c in causes if c) == 2
    listed = [n for c in causes for n in c if n in LISTED]
    assert len(listed) == 13 and len(set(listed)) >= 11
    assert {r["vehicle"] for r in rows} == set(VEHICLES)
    assert all(r["suite"] == "full" for r in rows if set(r["causes"]) & set(make.NEED_FULL))
    assert all("wind" not in r["causes"] for r in rows if r["vehicle"] == "strip_auv")
    assert make.plan(3, 16) == rows != make.plan(4, 16)


@pytest.mark.thorough
def test_a_size_is_aimed_at_the_effect_over_form_gap_that_was_drawn():
    row = {"seed": 11, "vehicle": "tanker_model", "causes": ["rudder_offset"], "suite": "full", "sea": "none",
           "aims": [10.0], "sizes": [1.0]}  # fmt: skip
    text = (TUNED / "tanker_model.toml").read_text("utf-8")
    campaign = make.drawn(row, make.sizes(row, text))
    told = make.label("o1", campaign, executed(campaign), text)
    assert told["effect_over_form_gap"] == pytest.approx(10.0, rel=0.5)  # one step; evidence is not quadratic
    assert regime_of(told) == "large" and told["label"] == "rudder_offset"
    json.dumps(told)
    assert make.sizes(row | {"causes": ["gyro_scale"], "sizes": [1.3]}, text) == [1.3]


@pytest.mark.thorough
@pytest.mark.parametrize("name", VEHICLES)
def test_a_nominal_simulator_is_tuned_misses_more_than_noise_and_less_than_its_start_values(name):
    campaign = draw_campaign(12, name)
    runs = executed(campaign)
    tuned = form_gap(campaign, runs, (TUNED / f"{name}.toml").read_text("utf-8"))
    start = form_gap(campaign, runs, start_text(other_vehicle(name)))
    assert tuned["chi2"] > 2.0 * tuned["count"]  # the equations differ
    assert tuned["chi2"] < 0.7 * start["chi2"]
    assert tuned["rms_psi"] < np.radians(4)


@pytest.mark.parametrize("name", VEHICLES)
def test_nominal_simulators_have_damping_of_the_right_sign_and_state_their_prior(name):
    vehicle = load_vehicle(TUNED / f"{name}.toml")
    assert vehicle.planar_only and set(vehicle.prior.relative_sd.values()) == {PRIOR}
    for coefficient in ("X_udot", "Y_vdot", "N_rdot", "X_u|u|", "Y_v", "N_r", "N_dr"):
        assert vehicle.coef[coefficient] < 0
    assert vehicle.coef["Y_dr"] > 0  # positive rudder pushes the stern to starboard
    build_model(vehicle, 3)
    assert stability(vehicle) is not None


def test_a_bundle_is_read_back_with_its_noise_roles_and_orders(tmp_path):
    campaign = draw_campaign(13, "strip_auv", ("heading_bias",))
    runs = executed(campaign)
    write_bundle(campaign, runs, (TUNED / "strip_auv.toml").read_text("utf-8"), tmp_path / "b")
    trial = load_trial(tmp_path / "b")
    assert trial.noise == pytest.approx(campaign.sigma) and trial.dof == 3
    assert [r.role for r in trial.runs] == [r.plan.role for r in runs]
    first = trial.runs[0]
    assert first.commands["delta_r_cmd"] == pytest.approx(runs[0].record.orders[:, 0], abs=1e-5)
    psi = np.unwrap(first.data["psi"])
    assert np.std(psi - psi[0] - (runs[0].clean[:, 2] - runs[0].clean[0, 2])) < 2 * campaign.sigma["psi"]
