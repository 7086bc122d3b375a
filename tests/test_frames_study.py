"""The study of hidden causes and look-alikes: campaigns of a wanted plainness, scores, its report."""

from dataclasses import dataclass, replace
from types import SimpleNamespace as Plain

import numpy as np
import pytest

import studies.frames.run as frames
from bayesid.benchmark.plant import VEHICLES, draw_campaign, execute_campaign
from bayesid.benchmark.protocol.detectability import Detectability, detectability
from bayesid.equations.model import build_model
from bayesid.executor import HERE, Executor
from bayesid.manoeuvres import ClosedLoop
from bayesid.model.vehicles import load_vehicle
from bayesid.progress import Progress
from bayesid.report.writer import write
from studies.frames import as_built, diagnose_campaign, extra_run
from studies.frames.report import frames_report

QUIET = Progress(quiet=True)


def fouled(size, sd=as_built.AS_BUILT_SD):
    made = draw_campaign(
        71, effects=("hull_fouling",), vehicle="lauv", dof=3, sea="still", prior_sd=sd, sizes=(size, size)
    )
    return diagnose_campaign.identify_only(made)


@pytest.mark.thorough
def test_a_fouled_hull_is_hidden_by_free_coefficients_and_shows_as_built_by_the_square_of_its_size():
    # a log that is all but perfect leaves a change of one coefficient D = (change / its sd)^2
    built, free, half = (
        detectability(fouled(size, sd), rivals=False)[0]
        for size, sd in ((0.4, 0.01), (0.4, 0.10), (0.2, 0.01))
    )
    # a linear row of drag, as free, stands in for a part of the quadratic one: below 100, and near it
    assert 75.0 < built.noncentrality / free.noncentrality < 105.0
    assert built.noncentrality / half.noncentrality == pytest.approx(4.0, rel=0.05)
    assert free.absorbed > 0.98
    assert built.noncentrality > 25 > free.noncentrality


@pytest.mark.thorough
def test_a_campaign_is_brought_to_the_noncentrality_asked_for():
    made = diagnose_campaign.aimed(fouled, 60.0)
    assert detectability(made, rivals=False)[0].noncentrality == pytest.approx(60.0, rel=0.25)
    assert made.planted[0].size != diagnose_campaign.SIZE_TO_START


def test_a_poor_campaign_is_one_short_zigzag_and_a_look_alike_is_one_by_margin():
    made = extra_run.poor("rudder_offset", 72, "delphin2", 0.1)
    assert [r.kind for r in made.runs] == ["zigzag"]
    track = execute_campaign(made).runs[0].track.states
    sailed = np.hypot(*np.diff(track[:, :2], axis=0).T).sum()
    assert sailed / made.vehicle.L == pytest.approx(extra_run.LENGTHS, rel=0.25)  # slower in its turns
    shown = Detectability("rudder_offset", 30.0, 0.1, 1.0, "propeller_side_force")
    assert extra_run.alike(shown)
    for other in ({"noncentrality": 20.0}, {"absorbed": 0.99}, {"margin": 6.0}, {"margin": float("nan")}):
        assert not extra_run.alike(replace(shown, **other))


def test_every_hidden_effect_meets_every_vehicle_once_and_no_two_campaigns_share_a_seed():
    tasks = as_built.as_built_tasks(frames.COUNT, frames.SEED)
    assert {(t.effect, t.vehicle) for t in tasks} == {(e, v) for e in as_built.EFFECTS for v in VEHICLES}
    more = extra_run.extra_run_tasks(frames.REPLICATES, frames.SEED + frames.APART)
    seeds = [t.seed for t in tasks] + [t.seed + k for t in more for k in range(extra_run.CAMPAIGNS_DRAWN)]
    assert len(set(seeds)) == len(seeds)
    assert min(seeds) >= 7000


def test_the_first_proposal_the_vehicle_survives_is_executed_no_longer_than_the_zigzag():
    made = extra_run.poor("rudder_offset", 72, "delphin2", 0.1)
    model = build_model(load_vehicle("delphin2"), 3)
    known = extra_run.manoeuvres_of(model)

    offers = tuple(Plain(name=name) for name in ("prbs", "coast"))
    found = Plain(model=model, result=Plain(next_manoeuvre=offers))
    asked = diagnose_campaign.DiagnosedCampaign(None, None, found)
    run, refused = extra_run.proposed(asked, made, made.runs[-1])
    assert (run.manoeuvre, refused) == ("prbs", [])
    assert known["prbs"].duration > made.runs[-1].duration == run.duration
    assert run.heading == made.runs[-1].heading
    executed = execute_campaign(replace(made, runs=(made.runs[0], replace(run, name="r2")))).runs[1]
    assert len(np.unique(np.round(executed.commands["delta_r_cmd"], 6))) in (2, 3)
    assert extra_run.proposed(diagnose_campaign.DiagnosedCampaign(None, None, None), made, run) == (None, [])
    assert isinstance(known["zigzag_10_port"], ClosedLoop)


@dataclass(frozen=True)
class Sum:
    name: str
    a: float


CALLS = []


def doubled(task):
    CALLS.append(task.name)
    return {"twice": 2 * task.a}


def test_what_is_kept_is_not_computed_again(tmp_path):
    tasks = [Sum("one", 1.0), Sum("two", 2.0)]
    CALLS.clear()
    first = diagnose_campaign.kept(doubled, tasks[:1], tmp_path, HERE, QUIET, "sums")
    both = diagnose_campaign.kept(doubled, tasks, tmp_path, HERE, QUIET, "sums")
    assert CALLS == ["one", "two"]
    assert [r["twice"] for r in both] == [2.0, 4.0] and first[0] == both[0]
    assert len(both[0]["code"]) == 16


def told(right, p, noncentrality=100.0, absorbed=0.5, margin=20.0, word="effect", alone=None):
    shown = {"name": "x", "noncentrality": noncentrality, "absorbed": absorbed, "margin": margin,
             "rival": "wind"}  # fmt: skip
    return {"shown": shown, "word": word, "named": ["thrust_or_drag"] if word == "effect" else [],
            "top": "thrust_or_drag" if right else "none", "right": right, "names_it": right, "p_right": p,
            "size": 1, "set": ["none"], "covered": right,
            "outcome": "right" if right else "no gap", "reason": "faint", "alone": alone,
             "cpu_seconds": 3.0, "failure": "" if right else "it * stopped"}  # fmt: skip


def test_hidden_causes_count_where_they_show_as_built_and_are_hidden_otherwise(tmp_path):
    cases = [  # right as built, D as built, absorbed when free, named alone when free
        (True, 100.0, 0.999, None), (False, 100.0, 0.999, 0.999), (True, 20.0, 0.999, None),
        (True, 100.0, 0.90, None),
    ]  # fmt: skip
    records = []
    for k, (right, d, absorbed, alone) in enumerate(cases):
        pair = {"as-built": told(right, 0.9, d), "structure": told(False, 0.0, 1.0, absorbed, alone=alone)}
        records.append({"name": f"{k}", "seed": k, "effect": "thrust_loss", "size": 0.1, "vehicle": "lauv",
                        "sea": "calm", "frames": pair})  # fmt: skip
    rows = as_built.as_built_scores(records)
    assert (rows[0].hits, rows[0].count, rows[0].bar[0]) == (1, 2, 0.9)
    assert (rows[2].hits, rows[2].count) == (2, 3)
    by = {q.name: q for q in rows}
    assert by["free: top-1 by family"].hits == 0
    assert by["free: hidden effect named alone"].hits == 1
    arms = {"first": told(False, 0.3), "repeat": told(False, 0.4), "proposed": told(True, 0.9)}
    for arm in ("repeat", "proposed"):
        arms[arm]["flown"] = {"manoeuvre": "zigzag_20_port", "seconds": 75.0}
    left = {"seed": 7, "vehicle": "lauv", "left out": "no look-alike", "margin": 9.0}
    extra = [{"name": "a", "effect": "gyro_scale", "campaign_seed": 8, "vehicle": "lauv", "size": 0.1,
              "sensors": "full", "tried": [left], "arms": arms},
             {"name": "b", "effect": "gyro_scale", "tried": [], "arms": {}}]  # fmt: skip
    more = extra_run.extra_run_scores(extra)
    assert [(q.hits, q.count) for q in more if "top-1" in q.name] == [(0, 1), (0, 1), (1, 1)]
    write(frames_report(records, extra, rows, more, ["c0de"]), tmp_path, {})
    text = (tmp_path / "report.md").read_text()
    assert "Of 2 causes that free coefficients hide, 1 come first" in text
    assert "Of 1 causes with a look-alike 0 come first after one zig-zag, 0 after" in text
    assert "zigzag 20 port, 75 s" in text and "it \\* stopped" in text and "no look-alike" in text


@pytest.mark.slow
def test_the_quick_study_asks_in_both_frames_and_after_both_runs(tmp_path):
    found = frames.main(tmp_path, tmp_path / "work", 2, 1, 6900, Executor(), True)
    assert {f for r in found["as_built"] for f in r["frames"]} == {"as-built", "structure"}
    assert set(found["extra_run"][0]["arms"]) == {"first", "repeat", "proposed"}
    assert not any(f["failure"] for r in found["as_built"] for f in r["frames"].values())
    assert (tmp_path / "report.html").exists()
