"""Faulty vehicle files: all problems at once, in words, and never anything but a VehicleError."""

import copy
import os
import tomllib
import warnings
import zipfile

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from bayesid import simulate
from bayesid.errors import VehicleError
from bayesid.model.vehicles import builtin_names, check_vehicle, coef_si, load_vehicle
from bayesid.model.vehicles.reading import BUILTIN_FOLDER, LARGEST_FILE
from bayesid.model.vehicles.writing import vehicle_toml, write_vehicle

TEXT = {name: (BUILTIN_FOLDER / f"{name}.toml").read_text("utf-8") for name in builtin_names()}
REMUS = TEXT["remus100"]


def load(tmp_path, text, name="boat.toml"):
    path = tmp_path / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return load_vehicle(path)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("Y_dr = 9.64", "Y_rd = 9.64\nY_v|v = 3", "not valid TOML"),
        ("Y_dr = 9.64", '"Y_vv|" = 9.64', r"no coefficient 'Y_vv\|' .* did you mean .*Y_v\|v\|"),
        ("Y_dr = 9.64", "Xuu = 9.64", r"'Xuu' may mean X_uu or X_u\|u\|"),
        ("Y_dr = 9.64", "Ydelta = 1.0\nY_dr = 9.64", "Y_dr is given twice, the second time as 'Y_dr'"),
        ("Y_dr = 9.64", "Y_dr = nan", "Y_dr must be a finite number, not nan"),
        ("Y_dr = 9.64", "Y_dr = -inf", "Y_dr must be a finite number"),
        ("Y_dr = 9.64", "Y_dr = '9'", "Y_dr must be a finite number, not '9'"),
        ("Y_dr = 9.64", "Y_dr = true", "Y_dr must be a finite number, not True"),
        ("Y_dr = 9.64", "Y_dr = 1" + "0" * 400, "Y_dr must be a finite number"),
        ("Y_dr = 9.64", "Y_dr = 1" + "0" * 5000, "not valid TOML"),
        ("Y_dr = 9.64", "X_prop_un = 1.0", r"belongs into \[propulsion\]"),
        ("mass = 30.48", "", "mass is missing"),
        ("rho = 1030.0", "", "rho is missing"),
        ("L = 1.33", "", "L is missing"),
        ("L = 1.33", "L = 0.0", "L = 0 must lie between"),
        ("Ixx = 0.177", "Ixx = -1.0", "Ixx = -1 must lie between"),
        ("Ixx = 0.177", "Ixx = 0.001", "not positive definite"),
        ("nondimensional = false", "", "nondimensional is missing"),
        ("nondimensional = false", "nondimensional = 0", "must be true or false, not 0"),
        ("W_equals_B = true", "W_equal_B = true", "unknown key 'W_equal_B'; did you mean W_equals_B"),
        ("B = 308.0", "", None),
        ("r_G = [0.0, 0.0, 0.0196]", "r_G = [0.0, 0.0]", "r_G must be three finite numbers"),
        ("r_G = [0.0, 0.0, 0.0196]", "r_G = 3", "r_G must be three finite numbers"),
        ("N_rdot = -4.88", "N_rdot = 10.0", "the N entry is not positive|its N entry is not positive"),
        ("Y_rdot = 1.93", "Y_rdot = 100.0", "mass matrix with added mass is not positive definite"),
        ('model = "thrust"', 'model = "trust"', "'trust' must be one of .*did you mean thrust"),
        ('model = "thrust"', "", "model is missing"),
        ("T_ref = 3.86", "", r"T_ref \[N\] is missing"),
        ("T_ref = 3.86", "T_ref = -3.86", "T_ref = -3.86 must lie between"),
        ("T_ref = 3.86", "T_ref = 'a'", "T_ref must be a finite number"),
        ("T_ref = 3.86", "T_ref = 3.86\nD = 0.1", "unknown key 'D'"),
        ("dr_max_deg = 13.6", "dr_max = 13.6", "unknown key 'dr_max'; did you mean dr_max_deg"),
        ("dr_max_deg = 13.6", "dr_max_deg = -1", "must lie between 0 and 180"),
        ("[coef]", "[coeff]", "unknown section 'coeff'; did you mean coef"),
        ("[coef]", "[coeff]", r"section \[coef\] is missing"),
        ("format = 1", "format = 2", "format = 2 is not known"),
        ("[coef]", "[crossflow]\nCdy = 1\n[coef]", "Cdz is missing"),
        ("[coef]", "[prior]\nrelative_sd = -1\n[coef]", "relative_sd = -1 must lie between"),
        ("[coef]", "[prior.relative_sd]\nN_dx = 1\n[coef]", "no coefficient 'N_dx'"),
        ("[coef]", "[prior.relative_sd]\nX_uu = 1\n[coef]", "X_uu has a prior but no value"),
        ("[coef]", "[sources]\nX_uu = 'here'\n[coef]", "X_uu has a source but no value"),
        ("[coef]", "[confidence]\ngood = 1\n[coef]", "must be a list of coefficient names"),
        ('name = "REMUS', 'convention = "fosen"\nname = "REMUS', "did you mean fossen"),
    ],
)
def test_each_fault_has_its_words(tmp_path, old, new, words):
    assert old in REMUS
    text = REMUS.replace(old, new, 1)
    if words is None:
        assert load(tmp_path, text).coef
        return
    with pytest.raises(VehicleError, match=words) as caught:
        load(tmp_path, text)
    assert str(caught.value).startswith("boat.toml: ")
    assert str(tmp_path) not in str(caught.value)


def test_a_planar_vehicle_moves_alike_with_and_without_the_strips_of_heave(tmp_path):
    """The strips' force up and down has no part in the plane; sideways it has."""
    planar = REMUS.replace("[vehicle]", "[vehicle]\nplanar_only = true", 1)
    sideways = "Cdy = 1.1\nheight = 0.2"
    runs = []
    for strips in (sideways, f"{sideways}\nCdz = 0.9\nwidth = 0.3", "Cdy = 0\nheight = 0.2"):
        ship = load(tmp_path, planar.replace("[coef]", f"[crossflow]\n{strips}\n[coef]", 1))
        runs.append(simulate(ship, "turn:10,duration=20").runs[0].data["v"])
    assert np.array_equal(runs[0], runs[1])
    assert not np.allclose(runs[0], runs[2])
    for key in ("Cdy = 1.1", "height = 0.2"):
        text = planar.replace("[coef]", f"[crossflow]\n{sideways.replace(key, '')}\n[coef]", 1)
        with pytest.raises(VehicleError, match=f"{key.split()[0]} is missing"):
            load(tmp_path, text)


def test_all_problems_of_a_file_come_at_once(tmp_path):
    text = REMUS
    for old, new in (
        ("mass = 30.48", ""),
        ("Ixx = 0.177", "Ixx = -1"),
        ("Y_dr = 9.64", "Y_dx = 9.64\nN_q = 1"),
    ):
        text = text.replace(old, new, 1)
    with pytest.raises(VehicleError) as caught:
        load(tmp_path, text)
    assert "4 problems" in str(caught.value)
    assert all(word in str(caught.value) for word in ("mass", "Ixx", "Y_dx", "N_q"))


def test_what_is_no_file_is_said_so(tmp_path):
    (tmp_path / "folder").mkdir()
    (tmp_path / "big.toml").write_bytes(b"#" * (LARGEST_FILE + 1))
    (tmp_path / "binary.toml").write_bytes(b"name = \xff\xfe")
    (tmp_path / "deep.toml").write_bytes(b"a = " + b"[" * 100_000)
    (tmp_path / "empty.toml").write_bytes(b"")
    os.symlink(tmp_path / "loop.toml", tmp_path / "loop.toml")
    for name, words in {
        "folder": "is a folder",
        "big.toml": "larger than",
        "binary.toml": "byte 7 is not UTF-8",
        "deep.toml": "not valid TOML",
        "empty.toml": r"section \[vehicle\] is missing",
        "loop.toml": "no such vehicle file|cannot be read",
        "none.toml": "no such vehicle file",
        "nul\0.toml": "not a file name",
    }.items():
        with pytest.raises(VehicleError, match=words):
            load_vehicle(str(tmp_path / name))


def test_a_misspelt_built_in_name_is_answered_with_the_nearest():
    with pytest.raises(VehicleError, match="did you mean remus100"):
        load_vehicle("remus_100")
    with pytest.raises(VehicleError, match="generic_sub, kvlcc2_mmg"):
        load_vehicle("x")


COVARIANCE = '[prior]\ncovariance = "{}"\n[coef]'


@pytest.mark.parametrize(
    ("entry", "words"),
    [
        ("../c.npz", "without .. or a drive"),
        ("/c.npz", "without .. or a drive"),
        ("..", "without .. or a drive"),
        ("", "without .. or a drive"),
        ("C:c.npz", "without .. or a drive"),
        ("a\\\\c.npz", "without .. or a drive"),
        ("none.npz", "is not there"),
        (".", "without .. or a drive"),
        ("text.npz", "cannot be read as .npz"),
        ("other.npz", "must hold the arrays names and covariance"),
        ("pickle.npz", "cannot be read as .npz"),
        ("link.npz", "points outside the folder"),
        ("bomb.npz", "unpacks to"),
        ("shape.npz", r"matrix has shape \(2, 2\) for 1 names"),
        ("lopsided.npz", "not symmetric"),
        ("indefinite.npz", "not positive semi-definite"),
        ("nan.npz", "must be finite"),
        ("twice.npz", "named twice"),
        ("negative.npz", "variance of Y_v is negative"),
        ("tiny.npz", "not positive semi-definite|not symmetric"),
    ],
)
def test_a_covariance_file_is_read_only_when_it_is_safe_and_sound(tmp_path, entry, words):
    folder = tmp_path / "bundle"
    folder.mkdir()
    (folder / "text.npz").write_text("no archive")
    np.savez(folder / "other.npz", a=1)
    np.savez(tmp_path / "outside.npz", names=np.array(["Y_v"]), covariance=np.eye(1))
    np.savez(folder / "pickle.npz", names=np.array([{}], dtype=object), covariance=np.eye(1))
    os.symlink(tmp_path / "outside.npz", folder / "link.npz")
    with zipfile.ZipFile(folder / "bomb.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("names.npy", b"0" * 20_000_000)
    for name, names, matrix in (
        ("shape", ["Y_v"], np.eye(2)),
        ("lopsided", ["Y_v", "N_v"], [[1.0, 0.5], [0.4, 1.0]]),
        ("indefinite", ["Y_v", "N_v"], [[1.0, 2.0], [2.0, 1.0]]),
        ("nan", ["Y_v"], [[np.nan]]),
        ("twice", ["Y_v", "Y_v"], np.eye(2)),
        ("negative", ["Y_v"], [[-1.0]]),
        ("tiny", ["Y_v", "N_v"], [[1e-300, 1e59], [1e59, 1e-300]]),
    ):
        np.savez(folder / f"{name}.npz", names=np.array(names), covariance=np.array(matrix))
    with pytest.raises(VehicleError, match=words):
        load(folder, REMUS.replace("[coef]", COVARIANCE.format(entry)))


def test_an_inline_covariance_is_read_and_checked(tmp_path):
    table = "[prior.covariance]\nnames = ['Yv', 'N_v']\nmatrix = [[4.0, 1.0], [1.0, {}]]\n[coef]"
    prior = load(tmp_path, REMUS.replace("[coef]", table.format(9.0))).prior
    assert prior.names == ("Y_v", "N_v")
    np.testing.assert_array_equal(prior.covariance, [[4.0, 1.0], [1.0, 9.0]])
    for bad in ("'a'", "nan", "1.0, 2.0", "true", "0.1"):
        with pytest.raises(VehicleError, match="covariance"):
            load(tmp_path, REMUS.replace("[coef]", table.format(bad)))


JUNK = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(-(10**400), 10**400),
    st.floats(),
    st.sampled_from([1e-320, 1e30, -1e30, 1e308, 0.0, -0.0]),
    st.text(max_size=8),
    st.lists(st.floats(), max_size=4),
    st.dictionaries(st.text(max_size=3), st.floats(), max_size=2),
)
NAMES = (
    "N_vvv",
    "Yvav",
    "Xuu",
    "convention",
    "rudder_positive",
    "relative_sd",
    "covariance",
    "U_ref",
    "dialect",
)


def toml(data):
    """TOML of plain tables through the package's own writer of values."""
    from bayesid.model.vehicles.writing import _key, _value

    lines = []
    for section, table in data.items():
        if isinstance(table, dict):
            lines += [f"[{_key(section)}]"] + [f"{_key(k)} = {_value(v)}" for k, v in table.items()]
        else:
            lines.insert(0, f"{_key(section)} = {_value(table)}")
    return "\n".join(lines)


@pytest.mark.thorough
@settings(max_examples=300, deadline=None, suppress_health_check=list(HealthCheck))
@given(data=st.data(), name=st.sampled_from(sorted(TEXT)))
def test_a_mutated_file_gives_a_vehicle_or_a_vehicle_error(tmp_path_factory, data, name):
    tables = copy.deepcopy(tomllib.loads(TEXT[name]))
    tables["prior"] = {"relative_sd": 0.1}
    for _ in range(data.draw(st.integers(1, 4))):
        section = data.draw(st.sampled_from(sorted(tables)))
        table = tables[section]
        if not isinstance(table, dict) or not table or data.draw(st.integers(0, 9)) == 0:
            value = data.draw(JUNK)
            tables[section] = 0 if value is None else value
            continue
        key = data.draw(st.sampled_from(sorted(table) + list(NAMES)))
        value = data.draw(st.one_of(JUNK, st.sampled_from(["fossen", "starboard", "vrx", "x.npz"])))
        if value is None:
            table.pop(key, None)
        else:
            table[key] = value
    path = tmp_path_factory.getbasetemp() / "mutated.toml"
    path.write_bytes(toml(tables).encode("utf-8", "surrogatepass"))
    judge(path)


@settings(max_examples=200, deadline=None, suppress_health_check=list(HealthCheck))
@given(data=st.data(), name=st.sampled_from(sorted(TEXT)))
def test_a_file_with_damaged_bytes_gives_a_vehicle_or_a_vehicle_error(tmp_path_factory, data, name):
    content = bytearray(TEXT[name].encode())
    for _ in range(data.draw(st.integers(1, 5))):
        at = data.draw(st.integers(0, len(content) - 1))
        content[at : at + data.draw(st.integers(0, 20))] = data.draw(st.binary(max_size=6))
    path = tmp_path_factory.getbasetemp() / "damaged.toml"
    path.write_bytes(bytes(content))
    judge(path)


def judge(path):
    """A vehicle that can be used, or one VehicleError with words; a Python warning is a failure."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            vehicle = load_vehicle(path)
        except VehicleError as error:
            assert "Traceback" not in str(error)
            return
        assert all(np.isfinite(value) for value in coef_si(vehicle).values())
        assert len(vehicle.digest) == 64
        assert vehicle_toml(vehicle, "c.npz")
        check_vehicle(vehicle)


def test_a_vehicle_file_that_cannot_be_written_is_told_with_its_folder(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(VehicleError, match=r"file/new\.toml: cannot be written"):
        write_vehicle(load_vehicle("remus100"), tmp_path / "file" / "new.toml")
