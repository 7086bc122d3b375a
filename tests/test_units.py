"""Units: table against pint, refusals in words."""

from __future__ import annotations

import contextlib
import math
import subprocess
import sys

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bayesid.errors import BayesidError
from bayesid.model import units
from bayesid.model.channels import CHANNELS, channel
from bayesid.model.notation import STATES

PINT_SPELLING = {"°": "degree", "°/s": "degree/s", "NM": "nautical_mile", "kt": "knot", "kts": "knot",
                 "kn": "knot", "RPM": "rpm", "Nm": "N*m", "kNm": "kN*m", "sec": "s"}  # fmt: skip


@pytest.mark.parametrize(
    ("inside", "unit"),
    [(i, u) for i in ("s", "m", "rad", "m/s", "rad/s", "N", "N*m") for u in units._TABLE[i]],
)
def test_table_agrees_with_pint(inside, unit):
    registry = units._registry()
    expected = registry.Quantity(1.0, PINT_SPELLING.get(unit, unit)).to(inside).magnitude
    assert math.isclose(units.scale(unit, inside, "here"), expected, rel_tol=1e-9)


@pytest.mark.parametrize(
    ("unit", "rpm"),
    [("rpm", 1), ("rps", 60), ("1/s", 60), ("Hz", 60), ("rad/s", 60 / (2 * math.pi)), ("deg/s", 1 / 6)],
)
def test_propeller_speed_stays_in_rpm(unit, rpm):
    assert math.isclose(units.scale(unit, "rpm", "here"), rpm, rel_tol=1e-12)


def test_uncommon_unit_is_read_through_pint():
    assert math.isclose(units.scale("fathom", "m", "here"), 1.8288, rel_tol=1e-5)
    assert math.isclose(units.scale("mile/hour", "m/s", "here"), 0.44704, rel_tol=1e-9)


@pytest.mark.parametrize(
    ("unit", "inside", "words"),
    [
        ("m", "rad", "unit of length, but angle"),
        ("deg", "m", "unit of angle, but length"),
        ("furlong*furlong", "m", "another dimension"),
        ("degC", "m", "another dimension"),
        ("dge", "rad", "did you mean [deg]"),
        ("Grad", "rad", "written [deg]"),  # to pint a giga-radian
        ("Grad/s", "rad/s", "written [deg]"),
        ("9**9**9**9**9", "m", "not known"),
        ("__import__('os')", "m", "not known"),
        ("", "m", "not known"),
        ("m" * 1000, "m", "not known"),
    ],
)
def test_wrong_unit_is_refused_with_place_and_reason(unit, inside, words):
    with pytest.raises(BayesidError, match=r"^r1\.csv, psi: ") as caught:
        units.scale(unit, inside, "r1.csv, psi")
    assert words in str(caught.value)


@given(st.text(max_size=60), st.sampled_from(["s", "m", "rad", "m/s", "rad/s", "rpm", "N", "N*m"]))
def test_any_text_gives_a_factor_or_a_unit_error(text, inside):
    with contextlib.suppress(units.UnitError):
        assert math.isfinite(units.scale(text, inside, "here"))


def test_common_units_do_not_import_pint():
    code = "import sys; from bayesid.model import units; units.scale('deg','rad','x'); print('pint' in sys.modules)"  # noqa: E501
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"


@pytest.mark.parametrize("row", CHANNELS, ids=lambda row: row.name)
def test_every_channel_has_an_inside_unit_of_factor_one(row):
    assert units.scale(row.unit, row.unit, row.name) == 1.0
    assert channel(row.name) is row


def test_every_state_is_a_channel_and_misspelling_names_the_nearest():
    assert all(channel(name).name == name for name in STATES)
    with pytest.raises(KeyError, match="did you mean 'psi'"):
        channel("psii")
    assert channel("u_water").base == "u"
