"""One result: JSON, schema, terminal and report are views of the same final values."""

import json
from dataclasses import FrozenInstanceError, dataclass, fields
from typing import Annotated, Literal

import jsonschema
import pytest
from diagnosis_results import RESULT, a_gap, a_horizon

from bayesid.diagnosis.result import CONTRACT, Result, schema
from bayesid.diagnosis.result_parts import Effect, Gap, Horizon, Location
from bayesid.diagnosis.schema import About, described


def test_the_record_is_plain_json_and_follows_the_schema():
    record = RESULT.record()
    assert json.loads(json.dumps(record, allow_nan=False)) == record
    jsonschema.validate(record, schema())
    assert list(record) == [f.name for f in fields(Result) if f.name != "drawings"]


def test_the_schema_is_that_of_the_fields_and_describes_each():
    found = schema()
    keys = found["properties"]
    assert set(keys) == {f.name for f in fields(Result)} - {"drawings"}
    assert [n for n, k in keys.items() if "description" not in k] == ["format"]
    for part, kind in ((keys["where"], Location), (keys["gap"], Gap), (keys["effects"]["items"], Effect)):
        assert set(part["properties"]) == {f.name for f in fields(kind)}
    assert found["required"] == list(CONTRACT)


@pytest.mark.parametrize(
    "path, wrong",
    [
        (("verdict",), "surely"),
        (("probabilities", "wind"), 1.2),
        (("effects", 0, "parameters", "V_wind"), {"value": 5.0}),
        (("where", "channel"), 3),
        (("gap", "horizons", 0, "rms", "nominal", "psi"), "large"),
        (("events", 0, "kind"), "ghost"),
        (("posterior", "parameters", "N_v", "mean"), None),
        (("description", "terms", 0, "axis"), "Q"),
        (("measures", 0, "logged"), [1.0]),
        (("format",), 2),
    ],
)  # fmt: skip
def test_the_schema_refuses_what_is_no_such_result(path, wrong):
    record = RESULT.record()
    at = record
    for step in path[:-1]:
        at = at[step]
    at[path[-1]] = wrong
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(record, schema())


def test_a_schema_follows_from_types():
    @dataclass(frozen=True)
    class Sea:
        state: Annotated[int, About("Douglas", {"maximum": 9})]
        swell: tuple[float, ...] | None = None

    found = described(Sea)
    assert found["required"] == ["state"]
    assert found["properties"] == {
        "state": {"type": "integer", "maximum": 9, "description": "Douglas"},
        "swell": {"type": ["array", "null"], "items": {"type": "number"}},
    }
    assert described(Literal["low", "high"]) == {"enum": ["low", "high"]}


def test_a_result_is_final():
    with pytest.raises(FrozenInstanceError):
        RESULT.verdict = "none"


def test_the_gap_is_that_of_the_longest_horizon_that_shows_one():
    short, long = a_horizon(), a_horizon("full replay", before=40.0, after=8.0, shrink=0.8)
    assert (a_gap(short, long).before, a_gap(short, long).shrink) == (40.0, 0.8)
    idle = a_horizon("full replay", before=0.1, significant=False, shrink=float("nan"))
    assert a_gap(short, idle).before == 12.0
    only = a_gap(idle)
    assert (only.before, only.shrink) == (0.1, None)
    assert only.horizons[0].rms["nominal"] == {"psi": 0.1, "z": None}
    assert isinstance(only.horizons[0], Horizon) and a_gap().before is None
