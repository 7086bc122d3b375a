"""A log without shaft speed: the propeller is held at the vehicle file's, not stopped, and it is said."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import bayesid
from bayesid.api import diagnose as diagnose_verb
from bayesid.diagnosis.input import unmoved_inputs
from bayesid.model.vehicles import Propulsion, load_vehicle
from bayesid.model.vehicles.orders import has_propeller
from bayesid.simulation import shaft_speed_note, with_shaft_speed
from bayesid.trials import Trial

FREE = "N_v,N_r,N_dr,Y_v,Y_r,Y_dr"
NOISE = {"x": 1.0, "y": 1.0, "psi": 0.005, "u": 0.02, "v": 0.02, "r": 0.0005}
NOTE = "no run logs the shaft speed: held at 60 rpm, the vehicle file's"


@pytest.fixture(scope="module")
def pond() -> Trial:
    """The README's pond, one zig-zag and a turn."""
    return bayesid.simulate(
        "generic_sub", "zigzag:20/20", "turn:25", dt=2.0, change={"N_dr": -0.0045}, seed=1, noise=NOISE
    )


def bare(trial: Trial, runs: tuple[int, ...] = (0, 1)) -> Trial:
    """The trial as logged by someone who does not log the shaft."""

    def without(run):
        return replace(run, commands={k: v for k, v in run.commands.items() if k != "n_cmd"})

    return replace(trial, runs=tuple(without(r) if i in runs else r for i, r in enumerate(trial.runs)))


def test_the_fit_of_the_pond_does_not_need_its_column_of_the_shaft(pond: Trial) -> None:
    chosen = {"runs": pond.runs[0].name, "free": FREE, "quick": True}
    logged, found = bayesid.fit(pond, **chosen), bayesid.fit(bare(pond), **chosen)
    np.testing.assert_array_equal(found.found.fit.z, logged.found.fit.z)
    assert f"{NOTE[0].upper()}{NOTE[1:]}" in found.summary()
    assert any(NOTE[1:] in text for text in found.report().failures)
    assert NOTE[1:] not in logged.summary()


def test_every_verb_reads_the_trial_with_the_shaft_held(pond: Trial, monkeypatch) -> None:
    log = bare(pond)
    seen = []

    class Enough(Exception):
        pass

    def caught(trial, *_, **__):
        seen.append(trial)
        raise Enough

    monkeypatch.setattr(diagnose_verb, "run", caught)
    with pytest.raises(Enough):
        bayesid.diagnose(log, next_manoeuvre=False, keep_model=False)
    read, flown = seen[0].runs[0], pond.runs[0]  # readings are averages; the order is the one held then
    at = np.searchsorted(flown.t, read.t + 1e-9, side="right") - 1
    assert read.commands["n_cmd"].tolist() == flown.commands["n_cmd"][at].tolist()
    assert NOTE in seen[0].warnings
    identified = bayesid.identify(log, free="N_v,N_dr", profile=False, quick=True)
    assert NOTE in identified.record()["remarks"]


def test_a_vehicle_without_a_propeller_or_a_run_with_the_shaft_is_left_alone(pond: Trial) -> None:
    log, sub = bare(pond), load_vehicle("generic_sub")
    boat = load_vehicle("differential_boat")
    assert not has_propeller(boat) and with_shaft_speed(log, boat) is log
    assert with_shaft_speed(pond, sub) is pond
    half = bare(pond, (1,))
    assert with_shaft_speed(half, sub) is half
    held = with_shaft_speed(log, sub)
    assert with_shaft_speed(held, sub) is held
    assert held.digest == pond.digest != log.digest


def test_a_file_without_a_usual_shaft_speed_says_that_the_propeller_stands(pond: Trial) -> None:
    sub = load_vehicle("generic_sub")
    values = {k: v for k, v in sub.propulsion.values.items() if k != "rpm_ref"}
    vague = replace(sub, propulsion=Propulsion(sub.propulsion.model, values))
    held = with_shaft_speed(bare(pond), vague)
    assert "n_cmd" not in held.runs[0].commands
    assert "taken as 0" in str(shaft_speed_note(held))
    assert any(NOTE in text for text in unmoved_inputs(bare(pond), sub))
