"""One log at several rates: when two verdicts contradict one another, and what is said of coarse readings."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from gap_trials import model_of, planted_trial

from bayesid.diagnosis.data.problem import build_problem
from bayesid.diagnosis.data.sampling import too_coarse
from bayesid.report.writer import write
from studies.sampling_rate.report import sampling_rate_report
from studies.sampling_rate.run import main
from studies.sampling_rate.thinned import disjoint, thinned_tasks, wrong


def rate(interval, *named, word="effect", coarse=()):
    return {
        "interval": interval, "word": word, "named": list(named), "acting": dict.fromkeys(named, 0.97),
        "set95": list(named), "coarse": list(coarse), "failure": "", "cpu_seconds": 12.0,
    }  # fmt: skip


def test_only_names_of_different_families_contradict():
    assert disjoint([rate(0.1, "actuator_lag"), rate(1.0, "ocean_current")])
    assert not disjoint([rate(0.1, "ocean_current"), rate(1.0, "ocean_current_varying")])  # one family
    assert not disjoint([rate(0.1, "actuator_lag"), rate(1.0, word="ambiguous")])
    assert not disjoint([rate(0.1, "a", "b"), rate(1.0, "b")])
    record = {"causes": ["ocean_current"], "rates": [rate(0.1, "ocean_current"), rate(1.0, "wind")]}
    assert wrong(record) == [(1.0, "wind")]


def test_the_report_counts_what_its_table_shows(tmp_path):
    records = [
        {"causes": ["wind"], "vehicle": "lauv", "length_time": 1.0,
         "rates": [rate(0.1, "wind"), rate(1.0, "wind")]},
        {"causes": [], "vehicle": "lauv", "length_time": 1.0,
         "rates": [rate(0.1, "wind"), rate(1.0, "gyro_scale", coarse=["x"])]},
    ]  # fmt: skip
    write(sampling_rate_report(records), tmp_path, {})
    text = (tmp_path / "report.md").read_text(encoding="utf-8")
    assert "Of 2 campaigns 1 got two names that contradict" in text
    assert (
        "Of 4 verdicts 2 named a cause that was not planted" in text
        and "gyro scale (0.97) (readings coarse)" in text
    )


def test_causes_and_vehicles_come_round_and_seeds_differ():
    tasks = thinned_tasks(12, 5)
    assert len({t.name for t in tasks}) == 12 and sum(not t.causes for t in tasks) == 3


@pytest.mark.parametrize("rate_limit, says", [(0.1, True), (0.004, False), (5.0, False), (np.inf, False)])
def test_readings_further_apart_than_a_move_of_the_rudder_are_called_coarse(rate_limit, says):
    model = model_of("generic_sub")
    vehicle = replace(model.vehicle, rates={**model.vehicle.rates, "delta_r": rate_limit})
    limited = SimpleNamespace(vehicle=vehicle, kernel=model.kernel, scales=model.scales)
    logs = build_problem(model, planted_trial(model, seed=1)).logs
    steps = np.concatenate([np.abs(np.diff(log.plan.levels[:, 0])) for log in logs])
    move = np.median(steps[steps > 0.02]) / rate_limit
    interval = logs[0].plan.t[1] - logs[0].plan.t[0]
    assert (interval > move > 0.1 * model.scales["L"] / model.scales["U"]) == says
    found = too_coarse(limited, logs)
    assert (found is not None) == says
    if says:
        assert f"{interval:.3g} s apart" in found and f"{move:.2g} s to where" in found


@pytest.mark.slow
def test_a_log_says_the_same_at_two_and_at_one_hertz(tmp_path):
    found = main(tmp_path, tmp_path / "work", quick=True)
    assert not found["disjoint"] and not found["wrong"]
    assert all(len(r["rates"]) == 2 and not any(x["failure"] for x in r["rates"]) for r in found["campaigns"])
