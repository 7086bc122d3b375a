"""Campaigns and bundles of the plant: reproducible, readable, and silent about the answer."""

import json
from collections import Counter

import numpy as np
import pytest

from bayesid.benchmark.plant import (
    draw_campaign,
    execute_campaign,
    still,
    true_response,
    write_bundle,
    write_pack,
)
from bayesid.benchmark.plant.__main__ import main
from bayesid.benchmark.plant.example import example_campaign
from bayesid.errors import TrialError
from bayesid.model.vehicles import load_vehicle
from bayesid.trials import load_trial

SETTINGS = dict(vehicle="lauv", sensors="full")


def files(folder):
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


def test_the_same_seed_writes_the_same_bytes(tmp_path):
    first, again, other = (
        write_bundle(draw_campaign(seed, **SETTINGS), tmp_path / place, "pond")
        for seed, place in ((7, "a"), (7, "b"), (8, "c"))
    )
    assert files(tmp_path / "a") == files(tmp_path / "b")
    assert first == again
    assert files(tmp_path / "a")["r1.csv"] != files(tmp_path / "c")["r1.csv"]
    assert first != other


def test_the_built_in_example_is_what_its_seed_gives(tmp_path, monkeypatch):
    # numbers, not bytes: another libm may turn a last digit
    monkeypatch.chdir(tmp_path)
    (tmp_path / "example" / "gap").mkdir(parents=True)  # results of an earlier diagnosis are no bundle
    truth = write_bundle(example_campaign(), tmp_path / "again", "example")
    kept, made = load_trial("example"), load_trial(tmp_path / "again")
    assert [(r.name, r.role, r.manoeuvre) for r in kept.runs] == [
        (r.name, r.role, r.manoeuvre) for r in made.runs
    ]
    for a, b in zip(kept.runs, made.runs, strict=True):
        for name, values in a.data.items():
            assert values == pytest.approx(b.data[name], abs=2e-3, nan_ok=True)
    assert kept.noise == made.noise
    assert load_vehicle(kept.vehicle_ref).coef == load_vehicle(made.vehicle_ref).coef
    assert truth["effects"][0]["name"] not in "".join(p.read_text() for p in kept.folder.iterdir())
    assert sum(p.stat().st_size for p in kept.folder.iterdir()) < 300_000


def test_fixing_one_factor_leaves_the_other_draws_alone():
    calm = draw_campaign(11, vehicle="lauv", effects=(), sea="still")
    offset = draw_campaign(11, vehicle="lauv", effects=("rudder_offset",), sea="still")
    assert calm.label == "none" and offset.label == "rudder_offset"
    assert calm.coef == offset.coef
    assert calm.runs == offset.runs
    assert calm.sigma == offset.sigma


@pytest.mark.parametrize("factors", [
    dict(vehicle="lauv", effects=("ocean_current", "actuator_lag"), sea="rough"),
    dict(vehicle="nps_auv2", dof=6, effects=("trim_weight",), sea="still", rich=False, sensors="pose only"),
])  # fmt: skip
def test_a_bundle_loads_and_does_not_hold_its_answer(tmp_path, factors):
    campaign = draw_campaign(21, **factors)
    answer = write_bundle(campaign, tmp_path / "pond")
    trial = load_trial(tmp_path / "pond")
    assert trial.dof == campaign.dof
    assert {run.role for run in trial.runs} == {"identify", "holdout"}
    assert dict(trial.noise) == campaign.sigma
    assert (trial.environment is not None) == (factors["sea"] == "still")
    nominal, built_in = load_vehicle(tmp_path / "pond" / "vehicle.toml"), load_vehicle(factors["vehicle"])
    assert nominal.coef == built_in.coef
    assert set(nominal.prior.relative_sd.values()) == {campaign.prior_sd}
    text = b"".join(files(tmp_path / "pond").values()).decode()
    for effect in answer["effects"]:
        assert effect["name"] not in text
    assert "seed" not in text and "attempt" not in text
    true = [repr(value) for name, value in campaign.coef.items() if value != built_in.coef[name]]
    assert true and not any(value in text for value in true)
    json.dumps(answer, allow_nan=False)


def test_the_log_is_the_true_response_plus_the_stated_noise():
    # closed-loop runs too: the recorded orders alone reproduce the run
    campaign = draw_campaign(5, vehicle="remus100", effects=("heading_bias",), sea="still", sensors="full")
    chi2 = []
    for run in execute_campaign(campaign).runs:
        clean = true_response(campaign, run.plan.name)
        for channel, sd in campaign.sigma.items():
            chi2.append(np.mean(((run.data[channel] - clean[channel]) / sd) ** 2))
    # each mean has a sigma of sqrt(2/380) = 0.07; five of them over 36 draws
    assert np.max(np.abs(np.array(chi2) - 1.0)) < 0.37
    executed = campaign.runs[0].name
    bias = campaign.planted[0].parameters["bias"]
    clean, true = true_response(campaign, executed), true_response(campaign, executed, sensors=False)
    assert np.abs(clean["psi"] - true["psi"] - bias).max() < 1e-12


def test_process_noise_brings_straight_runs_and_a_repeat_and_can_be_taken_away():
    campaign = draw_campaign(31, vehicle="lauv", effects=(), sea="rough")
    kinds = Counter(run.kind for run in campaign.runs)
    assert kinds["straight"] == 2
    assert any(run.manoeuvre.endswith("repeat") for run in campaign.runs)
    rough, calm = execute_campaign(campaign), execute_campaign(still(campaign))
    assert np.all(rough.typical > 0.0)
    assert np.abs(rough.runs[0].track.states[-1] - calm.runs[0].track.states[-1]).max() > 1e-3


def test_kinds_come_in_their_stated_shares():
    from bayesid.benchmark.plant.draw import KINDS, stream_of

    drawn = Counter(
        str(stream_of(seed, 0, "design").choice(list(KINDS), p=list(KINDS.values()))) for seed in range(2000)
    )
    for kind, share in KINDS.items():
        assert drawn[kind] / 2000 == pytest.approx(share, abs=4 * np.sqrt(share * (1 - share) / 2000))


def test_packs_keep_answers_apart(tmp_path, capsys):
    with pytest.raises(TrialError, match="folder of their own"):
        write_pack(1, 1, tmp_path / "packs", tmp_path / "packs" / "answers")
    arguments = ["--count", "1", "--seed", "40", "--vehicle", "lauv", "--kind", "none", "--sea", "still"]
    arguments += ["--out", str(tmp_path / "packs"), "--answers", str(tmp_path / "answers")]
    assert main(arguments) == 0
    assert [path.name for path in (tmp_path / "packs").iterdir()] == ["p0040"]
    assert json.loads((tmp_path / "answers" / "p0040.json").read_text())["label"] == "none"
    assert main(arguments) == 2
    assert "holds a trial already" in capsys.readouterr().err
