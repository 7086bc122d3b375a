"""The result of the blind check: files as committed, labels converted by hand, misses counted."""

import json
import math
from collections import Counter
from pathlib import Path

import pytest

from bayesid.benchmark.protocol.answers import load_answers
from bayesid.benchmark.protocol.commitment import VERDICT_COMMITMENT_FILE, BlindError, digest_of_file
from bayesid.benchmark.protocol.verdicts import check_commitments, load_verdicts
from bayesid.errors import BayesidError

ROOT = Path(__file__).resolve().parents[1]
from studies.withheld_score.effects import FIRST, RIGHT, exactly, fate  # noqa: E402
from studies.withheld_score.misses import MISSES  # noqa: E402
from studies.withheld_score.run import explained  # noqa: E402
from studies.withheld_score.wind import measured, scored, summed  # noqa: E402

COMMITTED = ROOT / "reports" / "withheld"


def label(name, effect, params, vehicle="generic_sub", **more):
    effects = [{"name": effect, "variant": effect, "params": params | {"size": 1.0}}]
    told = {"name": name, "vehicle": vehicle, "six_dof": False, "channels": "full", "label": effect,
            "effects": effects, "detect": {"delta_cost": 100.0}}  # fmt: skip
    return told | more


def answers_of(tmp_path, *labels):
    file = tmp_path / "labels.json"
    file.write_text(json.dumps(list(labels)))
    return load_answers(file)


def test_the_committed_verdicts_and_predictions_are_those_of_the_commitment():
    commitment = json.loads((COMMITTED / VERDICT_COMMITMENT_FILE).read_text())
    bundles = dict.fromkeys(commitment["pack"]["bundles"])
    assert commitment["seal"].startswith("a24e94cfa3b24e8a")
    assert (
        check_commitments(COMMITTED, bundles)["seal"] == commitment["seal"]
    )  # every diagnosis.json by its digest
    # written on 2026-11-21 and 22, before the anemometer and the other facility were opened
    assert digest_of_file(COMMITTED / "esso_osaka_wind" / "verdicts.json").startswith("6598907cabdfd9d9")
    assert digest_of_file(COMMITTED / "kvlcc2_other_facility" / "predictions.json").startswith(
        "a31a9ff87c8bc0a4"
    )


def test_the_committed_result_is_of_these_verdicts_and_explains_every_miss():
    told = json.loads((COMMITTED / "results.json").read_text())
    found = load_verdicts(COMMITTED)
    rows = {r["bundle"]: r for r in told["bundles"]}
    assert rows.keys() == found.keys()
    assert {n: (r["verdict"], r["set"]) for n, r in rows.items()} == {
        n: (v["verdict"], v["set95"]) for n, v in found.items()
    }
    assert {n for n, r in rows.items() if r["fate"] != RIGHT} == set(MISSES)
    first = (COMMITTED / "report.md").read_text().split("\n##")[0]
    count = Counter(r["fate"] for r in rows.values())
    assert f"Of 36 bundles {count[RIGHT]} verdicts are right" in first and f"{count[FIRST]} {FIRST}" in first
    assert "October made the speeds worse" in first


@pytest.mark.parametrize("effect, params, name, parameters", [
    ("rudder_offset", {"r_off_deg": -90.0}, "rudder_offset", {"offset": -math.pi / 2}),
    # a generic_sub turns its rudder 4 deg/s: 1/(1 deg) - 1/(4 deg) = 0.75 / deg
    ("actuator_rate_limit", {"a_rate_deg_s": 1.0}, "actuator_rate_limit",
     {"inverse_rate_excess": 0.75 * 180 / math.pi}),
    ("actuator_backlash", {"a_play_deg": 2.0}, "actuator_backlash", {"half_width": math.pi / 180}),
    ("time_offset", {"s_off": 0.04}, "actuator_dead_time", {"delay": 0.04}),  # an alias of the contract
    ("added_mass_error", {"am_y": 0.2}, "added_mass_error", {"e_Y": 0.2}),  # what is not stated is left out
    ("tether_drag", {"teth": 0.4}, "tether_drag", {}),  # a unit of the maker's own
])  # fmt: skip
def test_parameters_of_a_label_are_converted_where_both_mean_the_same(
    tmp_path, effect, params, name, parameters
):
    cause = answers_of(tmp_path, label("b1", effect, params))["b1"].causes[0]
    assert cause.name == name
    assert (cause.parameters or {}) == pytest.approx(parameters, rel=1e-9)
    assert cause.shown.noncentrality == 100.0


def test_two_labels_of_one_bundle_are_refused(tmp_path):
    with pytest.raises(BlindError, match="two labels for b1"):
        answers_of(tmp_path, label("b1", "gyro_scale", {"s_gyro": 0.1}), label("b1", "none", {}))


def test_a_converted_parameter_is_scored_against_the_verdict(tmp_path):
    from bayesid.benchmark.protocol.judgement import judge

    answer = answers_of(tmp_path, label("b1", "heading_bias", {"s_psi_deg": 1.0}))["b1"]
    bias = {"value": math.radians(1.5), "sd": math.radians(0.25), "unit": "rad"}
    verdict = {"verdict": "effect", "effects": [{"name": "heading_bias", "parameters": {"bias": bias}}],
               "set95": ["heading_bias"], "probabilities": {"heading_bias": 1.0}}  # fmt: skip
    ((effect, name, relative, sds),) = judge(answer, verdict).parameters
    assert (effect, name) == ("heading_bias", "bias")
    assert (relative, sds) == (pytest.approx(0.5), pytest.approx(2.0))


def test_word_for_word_knows_no_alias_and_no_set(tmp_path):
    told = answers_of(
        tmp_path, label("b1", "time_offset", {"s_off": 0.04}), label("b2", "none", {}),
        label("b3", "gyro_scale", {"s_gyro": 0.1}),
    )  # fmt: skip
    assert not exactly(told["b1"], {"verdict": "effect", "effects": [{"name": "actuator_dead_time"}]})
    assert exactly(told["b1"], {"verdict": "effect", "effects": [{"name": "time_offset"}]})
    assert exactly(told["b2"], {"verdict": "none", "effects": []})
    assert not exactly(told["b3"], {"verdict": "ambiguous", "effects": [{"name": "gyro_scale"}]})


def test_a_cause_that_came_first_without_a_name_is_not_counted_as_right(tmp_path):
    from bayesid.benchmark.protocol.judgement import judge

    answer = answers_of(tmp_path, label("b1", "thrust_loss", {"t_loss": 0.03}))["b1"]
    verdict = {"verdict": "coefficients", "effects": [{"name": "thrust_loss", "parameters": {}}],
               "set95": ["thrust_loss"], "probabilities": {"thrust_loss": 0.9, "outside": 0.1}}  # fmt: skip
    assert fate(judge(answer, verdict)) == FIRST
    assert fate(judge(answer, verdict | {"verdict": "effect"})) == RIGHT


def test_a_miss_without_a_reason_and_a_reason_without_a_miss_are_refused():
    with pytest.raises(BlindError, match="no reason for the miss of b099"):
        explained({*MISSES, "b099"}, set())
    with pytest.raises(BlindError, match="without one for b001"):
        explained(set(MISSES) - {"b001"}, set())


def wind_verdict(speed, sd, come, come_sd):
    parameters = {"V_wind": {"value": speed, "sd": sd}, "from": {"value": come, "sd": come_sd}}
    return {"verdict": "effect", "set95": ["wind"], "effects": [{"name": "wind", "parameters": parameters}]}


def test_a_statement_of_wind_is_scored_across_north():
    # said from 350 degrees at 1.0, measured from 10 degrees at 2.0: 20 degrees off, half the speed
    known = {"speed": 2.0, "mean_speed": 2.1, "from": math.radians(10.0)}
    row = scored(wind_verdict(1.0, 0.4, math.radians(350.0), math.radians(11.0)), known,
                 {"area": 0.25, "sd": 0.0})  # fmt: skip
    assert math.degrees(row["direction_error"]) == pytest.approx(-20.0)
    assert row["direction_inside"] and not row["speed_inside"]  # 1.8 and 2.5 deviations
    # areas a quarter of the catalogue's: twice the speed, which is the truth
    assert row["scaled"] == pytest.approx(2.0) and row["scaled_inside"]
    none = scored({"verdict": "none", "set95": ["none"], "effects": []}, known, {"area": 0.25, "sd": 0.0})
    total = summed([row, none])
    assert (total["said"], total["silent"], total["in_set"]) == (1, 1, 1)
    assert total["speed_error"] == pytest.approx(1.0) and total["scaled_error"] == pytest.approx(0.0)


def test_the_mean_wind_is_that_of_the_vector_within_the_seconds_diagnosed(tmp_path):
    file = tmp_path / "run.csv"
    # from 0 and from 90 degrees at 1 m/s: from 45 degrees at 0.707; the gale before is left out
    rows = ["t[s],wind_speed[m/s],wind_from[rad]", "0,9,3", "10,1,0", "11,1,1.5707963"]
    file.write_text("\n".join(rows))
    found = measured(file, 5.0, 20.0)
    assert found["speed"] == pytest.approx(math.sqrt(0.5), rel=1e-6)
    assert math.degrees(found["from"]) == pytest.approx(45.0, rel=1e-6)
    assert found["mean_speed"] == pytest.approx(1.0)
    with pytest.raises(BayesidError, match="no reading between 30 and 40 s"):
        measured(file, 30.0, 40.0)
    with pytest.raises(BayesidError, match="no wind log"):
        measured(tmp_path / "other.csv", 0.0, 1.0)
