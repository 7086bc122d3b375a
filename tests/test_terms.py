"""The force table: every row is checked by rules written independently of `bayesid.model.terms.row`."""

import re

import pint
import pytest
from matplotlib.mathtext import MathTextParser

from bayesid.errors import VehicleError
from bayesid.model.terms import REFERENCES, TERMS, Term, alias, canonical_name, factors, term
from bayesid.model.terms.dialects import WRITTEN

ROWS = pytest.mark.parametrize("row", [t for t in TERMS if not t.is_number], ids=lambda row: row.name)
EVERY = pytest.mark.parametrize("row", TERMS, ids=lambda row: row.name)
UNITS = pint.UnitRegistry()
QUANTITY = {
    **{name: UNITS.Quantity(1.0, "m/s") for name in ("u", "v", "w", "Rv", "Rw", "U")},
    **{name: UNITS.Quantity(1.0, "1/s") for name in ("p", "q", "r")},
    **{name: UNITS.Quantity(1.0, "m/s^2") for name in ("udot", "vdot", "wdot")},
    **{name: UNITS.Quantity(1.0, "1/s^2") for name in ("pdot", "qdot", "rdot")},
    **{name: UNITS.Quantity(1.0, "") for name in ("delta_r", "delta_s", "delta_b", "eta1")},
    "n": UNITS.Quantity(1.0, "rpm"),
    "S": UNITS.Quantity(1.0, ""),
}


def test_every_name_is_used_once():
    assert len({row.name for row in TERMS}) == len(TERMS)


@ROWS
def test_coefficient_times_regressor_is_a_force_or_a_moment(row):
    regressor = eval(row.regressor, {"abs": abs, "sgn": lambda x: UNITS.Quantity(1.0, "")}, QUANTITY)
    wrench = UNITS.Quantity(1.0, UNITS.parse_units(row.unit.replace(" ", "*"))) * regressor
    assert wrench.check("[force]" if row.axis in "XYZ" else "[force]*[length]")


@ROWS
def test_length_power_follows_from_the_letters_of_the_name(row):
    """Second rule, from the name alone: +1 per p q r, +1 for a linear and +2 for an angular acceleration."""
    if row.group == "propulsion":
        assert row.length_power == 2
        return
    text = re.sub(r"d[rsb]\b|d[rsb](?=d)", "", row.arguments.replace(",eta", ""))
    expected = 2 if row.axis in "XYZ" else 3
    expected += 1 if re.search("[uvw]dot", text) else 0
    expected += 2 if re.search("[pqr]dot", text) else 0
    expected += sum(text.replace("dot", "").count(letter) for letter in "pqr") if "dot" not in text else 0
    assert row.length_power == expected


@ROWS
def test_unit_is_density_times_length_to_the_power_of_the_row_times_speed(row):
    """kg/m^3 m^k (m/s)^(2 - degree) is the SI coefficient of a prime coefficient (rpm counts as a speed)."""
    if row.group != "propulsion":
        degree = 2 - row.velocity_power
        assert row.unit_powers == (1, -3 + row.length_power + degree, -degree, 0)


@ROWS
def test_rows_without_a_zero_in_the_name_are_quadratic_in_velocity_or_spell_out_their_degree(row):
    """Y_v is u v and Y_vvv is v^3: up to two letters the rest is u."""
    if row.group == "propulsion":
        return
    if row.group == "mmg":  # over powers of the speed U, so that all are quadratic
        assert row.velocity_power == 2
        return
    letters = re.findall("[uvwpqr]", re.sub("dot|d[rsb]", "", row.arguments.replace(",eta", "")))
    assert row.velocity_power == (1 if row.name.endswith("0") else max(2, len(letters)))


@EVERY
def test_every_source_is_a_reference_or_a_stated_assumption(row):
    assert row.source in REFERENCES or row.source.startswith("assumed: ")


@EVERY
def test_label_is_mathtext(row):
    MathTextParser("path").parse(row.label)
    assert "|" not in row.name or "|" in row.label


@EVERY
@pytest.mark.parametrize("dialect", WRITTEN)
def test_written_spellings_are_read_back_to_the_same_row(row, dialect):
    assert canonical_name(alias(row.name, dialect)) == row.name


def test_ascii_keys_are_identifiers_and_all_different():
    keys = [alias(row.name) for row in TERMS if row.group in ("base", "eta")]
    assert len(set(keys)) == len(keys)
    assert all(key.isidentifier() for key in keys)


@pytest.mark.parametrize(
    ("spelling", "name"),
    {
        "Yvv": "Y_v|v|",
        "Yvav": "Y_v|v|",
        "Y_vabsv": "Y_v|v|",
        "Yv|v|": "Y_v|v|",
        "N_abs(v)r": "N_|v|r",
        "Navr": "N_|v|r",
        "Yvdot": "Y_vdot",
        "Ydelta": "Y_dr",
        "N_delta_r": "N_dr",
        "Yuv": "Y_v",
        "Zuuds": "Z_ds",
        "Y0": "Y_*",
        "xDotU": "X_udot",
        "yVV": "Y_v|v|",
        "paramYvv": "Y_v|v|",
        "X_du": "X_udot",
        "X_rv": "X_vr",
        "Nr'": "N_r",
    }.items(),
)
def test_foreign_spellings_are_read(spelling, name):
    assert canonical_name(spelling) == name


@pytest.mark.parametrize(
    ("spelling", "dialect", "name"),
    [
        ("Xuu", "prestero", "X_u|u|"),
        ("Mww", "prestero", "M_w|w|"),
        ("yV", "vrx", "Y_v0"),
        ("N_dr", "diffuv", "N_rdot"),
        ("N_dr", None, "N_dr"),
        ("N_delta_r", "diffuv", "N_dr"),
    ],
)
def test_a_dialect_settles_what_spelling_leaves_open(spelling, dialect, name):
    assert canonical_name(spelling, dialect) == name


@pytest.mark.parametrize(
    ("spelling", "first", "second"),
    [("Xuu", "X_uu", "X_u|u|"), ("Zww", "Z_ww", "Z_w|w|"), ("Nvr", "N_|v|r", "N_v|r|")],
)
def test_an_ambiguous_spelling_is_refused_and_names_both_rows(spelling, first, second):
    with pytest.raises(VehicleError, match=rf"{re.escape(first)} or {re.escape(second)}"):
        canonical_name(spelling)


@pytest.mark.parametrize("spelling", ["", "Y", "Foo", "Y_v|w|", "Y_x", "0", "|||", "X_prop", "Y_vdotdot"])
def test_an_unknown_spelling_is_refused(spelling):
    with pytest.raises(VehicleError, match="no coefficient"):
        canonical_name(spelling)


def test_an_unknown_name_is_answered_with_the_nearest():
    with pytest.raises(VehicleError, match=r"did you mean .*Y_v\|v\|"):
        term("Y_v|v")


def test_twenty_two_hydrodynamic_rows_of_the_generic_submarine_live_in_the_plane():
    """Count of the paper's Case 1: 5 X, 8 Y, 9 N, from the non-zero rows of the generic boat."""
    names = [
        "X_udot",
        "X_rr",
        "X_vr",
        "X_vv",
        "X_drdr",
        "X_wq",
        "X_dsds",
        "Y_vdot",
        "Y_rdot",
        "Y_r",
        "Y_v",
        "Y_v|v|",
        "Y_v|r|",
        "Y_|r|dr",
        "Y_dr",
        "Y_pdot",
        "N_vdot",
        "N_rdot",
        "N_r",
        "N_v",
        "N_v|v|",
        "N_|v|r",
        "N_r|r|",
        "N_|r|dr",
        "N_dr",
    ]
    planar = [name for name in names if term(name).planar]
    assert [sum(name[0] == axis for name in planar) for axis in "XYN"] == [5, 8, 9]


def test_rudder_parity_is_read_from_the_regressor():
    odd = {row.name for row in TERMS if row.odd_in_rudder}
    base = {"Y_dr", "N_dr", "K_dr", "Y_|r|dr", "N_|r|dr", "X_rdr", "X_vdr"}
    cubes = {f"{axis}_{name}" for axis in "YN" for name in ("drdrdr", "vvdr", "vrdr", "rrdr")}
    assert odd == base | cubes | {"Y_dr,eta", "N_dr,eta"}


@pytest.mark.parametrize("text", ["u/v", "u+v", "u**2", "abs(abs(v))", "foo", "__import__('os')", "u*2"])
def test_a_regressor_must_be_a_product_of_known_symbols(text):
    with pytest.raises(ValueError, match="not a product"):
        factors(text)


def test_a_name_must_begin_with_its_axis():
    with pytest.raises(ValueError, match="axis"):
        Term("Y_v", "N", "u*v", "gertler1967")
