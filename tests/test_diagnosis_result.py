"""One result: JSON, schema, terminal and report are views of the same final values."""

import json
from dataclasses import FrozenInstanceError, fields, replace

import jsonschema
import pytest

from bayesid.diagnosis.data.event import Event
from bayesid.diagnosis.evidence.holdout import HorizonError
from bayesid.diagnosis.next_manoeuvre import Proposal
from bayesid.diagnosis.result import (
    Coefficient,
    Detectability,
    Diagnosed,
    Effect,
    Gap,
    Horizon,
    Location,
    Noise,
    Region,
    Result,
    Value,
    _gap,
)
from bayesid.diagnosis.run import schema
from bayesid.diagnosis.summary import summary


def horizon_row(name="6 L/U", before=12.0, after=0.5, worth=True, shrink=0.96):
    excess = {"nominal": 30.0, "recalibrated": before, "with effect": after}
    rows = {m: {"psi": 0.1, "z": float("nan")} for m in excess}
    return HorizonError(name, 9.0, excess, shrink, (0.9, 0.98), worth, 1.1, rows, rows, 4, 16)


RESULT = Result(
    format=1, bayesid="0", trial=Diagnosed("pond", "ab", 3, ("x", "psi")), model="cd", seed=0,
    verdict="effect", effects=(Effect("wind", 0.97, {"V_wind": Value(5.0, 0.5, "m/s")}),),
    probabilities={"none": 0.0, "wind": 0.97, "outside": 0.03}, acting={"wind": 0.97}, set95=("wind",),
    unseen=(), hidden_by_coefficients=(), reasons=("it gains -0.0 nats",), rule="effect",
    ambiguity_groups=(("wind", "ocean_current"),), detectability={"wind": Detectability(300.0, 0.2)},
    where=Location("Y", {"Y": 40.0}, None, (Region("r1", 3.0),), (), {"Y": 0.1}), gap=_gap((horizon_row(),)),
    measures=({"run": "r2", "name": "advance", "unit": "m", "logged": 9.0},),
    events=(Event("r1", 1.0, 2.0, "psi", "sensor", 12.0),), posterior=None, description=None,
    environment=Noise("measured", (1.0, 1.0, 1.0), 2.0, 0.1, 30.0, None, (0.0,)),
    coefficients={"N_r": Coefficient(-0.1, 0.01)}, next_manoeuvre=(Proposal("zigzag", 60.0, 1.0, 9.0),),
    warnings=("no straight run",),
)  # fmt: skip


def test_the_record_is_plain_json_and_follows_the_schema():
    record = RESULT.record()
    assert json.loads(json.dumps(record, allow_nan=False)) == record
    jsonschema.validate(record, schema())
    assert list(record) == [f.name for f in fields(Result)]


def names(cls):
    return {f.name for f in fields(cls)}


def test_schema_and_result_have_the_same_keys():
    """A field without a description, or a description of nothing, fails here."""
    described = schema()["properties"]
    assert set(described) == names(Result)
    assert set(described["where"]["properties"]) == names(Location)
    assert set(described["gap"]["properties"]) == names(Gap)
    assert set(described["effects"]["items"]["properties"]) == names(Effect)
    assert set(described["events"]["items"]["properties"]) == names(Event)


def test_a_result_is_final():
    with pytest.raises(FrozenInstanceError):
        RESULT.verdict = "none"


def test_the_gap_is_that_of_the_longest_horizon_that_shows_one():
    short, long = horizon_row(), horizon_row("full replay", before=40.0, after=8.0, shrink=0.8)
    assert (_gap((short, long)).before, _gap((short, long)).shrink) == (40.0, 0.8)
    idle = horizon_row("full replay", before=0.1, worth=False, shrink=float("nan"))
    assert _gap((short, idle)).before == 12.0
    only = _gap((idle,))
    assert (only.before, only.shrink) == (0.1, None)
    assert only.horizons[0].rms["nominal"] == {"psi": 0.1, "z": None}
    assert isinstance(only.horizons[0], Horizon) and _gap(()).before is None


def test_the_summary_tells_what_the_result_holds():
    lines = summary(RESULT).splitlines()
    assert lines[0] == "verdict: effect"
    assert lines[1] == "  wind (probability 0.970) V_wind = 5 +- 0.5 m/s"
    assert lines[2:4] == ["95 % set: wind", "  it gains 0.0 nats"]
    assert lines[4] == "held-out gap (noise units): 12 before, 0.5 after: shrinks by 96.0%"
    assert lines[5] == "note: no straight run" and len(lines) == 6
    closed = replace(RESULT, gap=_gap((horizon_row(after=-0.1, shrink=1.0),)))
    assert "at the floor after: shrinks by 100.0%" in summary(closed)
    nothing = replace(RESULT, gap=_gap((horizon_row(worth=False, shrink=float("nan")),)))
    assert "nothing to shrink" in summary(nothing)
    assert "gap" not in summary(replace(RESULT, gap=_gap(())))
