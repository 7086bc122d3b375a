"""JSON Schemas of trial.toml and vehicle.toml: what the reader takes they take, what it refuses they
refuse."""

from __future__ import annotations

import copy
import json
import tomllib
from pathlib import Path

import pytest

from bayesid.cli.main import run as bayesid
from bayesid.errors import TrialError, VehicleError
from bayesid.model.vehicles import builtin_names
from bayesid.model.vehicles.reading import BUILTIN_FOLDER, read_vehicle
from bayesid.model.vehicles.schema import vehicle_schema
from bayesid.model.vehicles.tables import HEAD
from bayesid.trials import load_trial
from bayesid.trials.bundle import BUILTIN
from bayesid.trials.correction import Correction
from bayesid.trials.schema import FILE, trial_schema, write_schema
from bayesid.trials.stated import Stated

jsonschema = pytest.importorskip("jsonschema")

#: practice bundles are taken along where they lie beside the project
MORE = sorted((Path(__file__).resolve().parents[2] / "shared").glob("practice*/*/trial.toml"))


def valid(schema, tree):
    return not list(jsonschema.Draft202012Validator(schema).iter_errors(tree))


def tree_of(path):
    return tomllib.loads(Path(path).read_text(encoding="utf-8"))


def test_the_schemas_are_schemas():
    for schema in (trial_schema(), vehicle_schema()):
        jsonschema.Draft202012Validator.check_schema(schema)


@pytest.mark.parametrize("name", builtin_names())
def test_every_built_in_vehicle_fits_the_schema(name):
    assert valid(vehicle_schema(), tree_of(BUILTIN_FOLDER / f"{name}.toml"))


@pytest.mark.parametrize("path", [*sorted(BUILTIN.glob("*/trial.toml")), *MORE], ids=lambda p: p.parent.name)
def test_every_bundle_fits_the_schemas(path):
    assert valid(trial_schema(), tree_of(path))
    if (path.parent / "vehicle.toml").exists():
        assert valid(vehicle_schema(), tree_of(path.parent / "vehicle.toml"))


BAD_VEHICLE = {
    "unknown section": lambda t: t.update(hull={}),
    "unknown key": lambda t: t["vehicle"].update(masss=1.0),
    "mass missing": lambda t: t["vehicle"].pop("mass"),
    "mass as text": lambda t: t["vehicle"].update(mass="18 kg"),
    "negative mass": lambda t: t["vehicle"].update(mass=-18.0),
    "r_G of two numbers": lambda t: t["vehicle"].update(r_G=[0.0, 0.1]),
    "side of the rudder": lambda t: t["vehicle"].update(rudder_positive="left"),
    "a coefficient as text": lambda t: t["coef"].update(Y_v="-20"),
    "no coefficient at all": lambda t: t["coef"].update(speed=1.0),
    "propulsion of no model": lambda t: t["propulsion"].update(model="magic"),
    "propulsion lacks a number": lambda t: t["propulsion"].pop("T_max"),
    "propulsion with a foreign number": lambda t: t["propulsion"].update(Kt0=0.4),
    "angle beyond half a turn": lambda t: t["control"].update(dr_max_deg=200.0),
    "prior below zero": lambda t: t.update(prior={"relative_sd": -0.1}),
    "format 2": lambda t: t.update(format=2),
}


@pytest.mark.parametrize("change", BAD_VEHICLE.values(), ids=BAD_VEHICLE)
def test_what_is_wrong_with_a_vehicle_the_schema_and_the_reader_both_refuse(change):
    tree = tree_of(BUILTIN_FOLDER / "lauv.toml")
    assert valid(vehicle_schema(), tree)
    change(tree)
    assert not valid(vehicle_schema(), tree)
    with pytest.raises(VehicleError):
        read_vehicle(tree, "lauv.toml", None)


@pytest.mark.parametrize(
    "key", [k for k, row in HEAD.items() if row.kind == "number" and row.high is not None]
)
def test_reader_and_schema_agree_on_the_range_of_every_number(key):
    tree = tree_of(BUILTIN_FOLDER / "lauv.toml")
    tree["vehicle"][key] = HEAD[key].high * 1.01
    assert not valid(vehicle_schema(), tree)
    with pytest.raises(VehicleError, match=rf"{key} = .* must lie between"):
        read_vehicle(tree, "lauv.toml", None)


BAD_TRIAL = {
    "unknown role": lambda t: t["runs"][0].update(role="training"),
    "run without a file": lambda t: t["runs"][0].pop("file"),
    "window of one number": lambda t: t["runs"][0].update(window=[3.0]),
    "noise of no channel": lambda t: t["noise"].update(xx=1.0),
    "noise of zero": lambda t: t["noise"].update(x=0.0),
    "noise of a command": lambda t: t["noise"].update(delta_r_cmd=0.1),
    "four degrees of freedom": lambda t: t.update(dof=4),
    "side of the rudder": lambda t: t.update(rudder_positive="left"),
    "format 2": lambda t: t.update(format=2),
    "no runs": lambda t: t.update(runs=[]),
    "a number for a name": lambda t: t.update(name=3),
    "environment below zero": lambda t: t.update(environment={"force_rms": -1.0}),
    "column of no channel": lambda t: t.update(columns={"speed": "v"}),
    "correction as text": lambda t: t.update(corrections={"scale": {"u": "knots"}}),
}


@pytest.mark.parametrize("change", BAD_TRIAL.values(), ids=BAD_TRIAL)
def test_what_is_wrong_with_a_trial_the_schema_and_the_reader_both_refuse(change):
    tree = tree_of(BUILTIN / "example" / "trial.toml")
    assert valid(trial_schema(), tree)
    tree = copy.deepcopy(tree)
    change(tree)
    assert not valid(trial_schema(), tree)
    assert Stated(tree).problems


def test_corrections_as_written_fit_the_schema():
    made = Correction(
        drop=("r",), scale={"u": 0.5144}, exchange=(("x", "y"),), heading_from="east", late={"psi": 0.3},
        rename={"u": "u_water"}, runs=("r1",), geographic=True,
    )  # fmt: skip
    tree = tree_of(BUILTIN / "example" / "trial.toml")
    tree["corrections"] = tomllib.loads("\n".join(made.lines()))
    assert valid(trial_schema(), tree)
    assert not Stated(tree).problems


def test_files_written_name_their_schema_and_fit_it(tmp_path, capsys):
    size = ["--length", "3", "--diameter", "0.32", "--mass", "180", "--speed", "2"]
    assert bayesid(["vehicle", "new", str(tmp_path / "mine.toml"), *size]) == 0
    rows = "".join(f"{0.5 * k},{0.7 * k},0,{5 * (k % 40 > 20)},0\n" for k in range(200))
    (tmp_path / "log.csv").write_text("t[s],x[m],y[m],delta_r_cmd[deg],psi[deg]\n" + rows)
    (tmp_path / "map.toml").write_text(
        "format = 1\n[sources.log]\nfiles = ['log.csv']\ntime = 't[s]'\n[channels]\nx = 'x[m]'\ny = 'y[m]'\n"
        "psi = 'psi[deg]'\ndelta_r_cmd = 'delta_r_cmd[deg]'\n"
    )
    out = tmp_path / "bundle"
    args = [
        "trial",
        "import",
        str(tmp_path / "log.csv"),
        "--map",
        str(tmp_path / "map.toml"),
        "--out",
        str(out),
    ]
    assert bayesid(args) == 0
    load_trial(out)
    for path in (tmp_path / "mine.toml", out / "trial.toml"):
        first = path.read_text().splitlines()[0]
        assert first.startswith("#:schema ./")
        schema = json.loads((path.parent / first.removeprefix("#:schema ")).read_text())
        assert valid(schema, tree_of(path))
    capsys.readouterr()
    assert bayesid(["schema", "vehicle"]) == 0
    assert json.loads(capsys.readouterr().out) == vehicle_schema()
    assert bayesid(["schema", "map"]) == 2


@pytest.mark.parametrize(
    "path", [*sorted(BUILTIN_FOLDER.glob("*.toml")), *sorted(BUILTIN.glob("*/*.toml"))], ids=lambda p: p.stem
)
def test_files_of_the_package_name_the_schema_of_today(path):
    """If not: bayesid schema trial -o bayesid/trials/builtin/trial.schema.json, and vehicle likewise."""
    first = path.read_text(encoding="utf-8").splitlines()[0]
    named = json.loads((path.parent / first.removeprefix("#:schema ")).read_text(encoding="utf-8"))
    assert named == (trial_schema() if path.name == "trial.toml" else vehicle_schema())


@pytest.mark.thorough
@pytest.mark.usefixtures("without_pictures")
def test_commands_that_write_a_trial_or_a_vehicle_name_the_schema(tmp_path):
    pond, fit = tmp_path / "pond", tmp_path / "fit"
    assert bayesid(["simulate", "remus100", "zigzag:10/10", "--dt", "1", "--out", str(pond)]) == 0
    assert bayesid(["fit", str(pond), "--free", "N_dr", "--out", str(fit)]) == 0
    assert bayesid(["export", str(fit), "--draws", "2", "--out", str(tmp_path / "drawn")]) == 0
    for path in (pond / "trial.toml", fit / "vehicle.toml", tmp_path / "drawn" / "vehicle_1.toml"):
        first = path.read_text(encoding="utf-8").splitlines()[0]
        schema = json.loads((path.parent / first.removeprefix("#:schema ")).read_text(encoding="utf-8"))
        assert valid(schema, tree_of(path))


def test_a_bundle_that_is_refused_by_its_reader_is_refused_with_a_sentence(tmp_path):
    (tmp_path / "trial.toml").write_text('#:schema ./trial.schema.json\nformat = 1\nruns = "r1.csv"\n')
    assert not valid(trial_schema(), tree_of(tmp_path / "trial.toml"))
    with pytest.raises(TrialError, match="runs"):
        load_trial(tmp_path)


def test_a_schema_that_is_there_is_not_written_again_and_another_is(tmp_path):
    path = tmp_path / FILE
    assert write_schema(tmp_path) == f"#:schema ./{FILE}\n"
    first = path.stat().st_ino  # writing replaces the file
    write_schema(tmp_path)
    assert path.stat().st_ino == first
    right = path.read_text(encoding="utf-8")
    path.write_text("{}", encoding="utf-8")
    write_schema(tmp_path)
    assert path.read_text(encoding="utf-8") == right
