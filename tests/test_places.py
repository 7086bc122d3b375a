"""Commands a text proposes: they name the trial and the folder as they were given, and can be typed."""

import re
import shlex
from dataclasses import replace

import pytest
from diagnosis_results import a_result

from bayesid.cli.main import run
from bayesid.diagnosis.answer import answer
from bayesid.diagnosis.failed_checks import prediction_step
from bayesid.diagnosis.next_manoeuvre import Proposal
from bayesid.model.vehicles.reading import BUILTIN_FOLDER
from bayesid.places import NOWHERE, Places, places_of
from bayesid.trials import load_trial


def commands(text):
    return [shlex.split(c) for c in re.findall(r"`(bayesid [^`]*)`", text)]


@pytest.fixture(scope="module")
def pond(tmp_path_factory):
    bundle = tmp_path_factory.mktemp("a lake") / "pond"
    options = ["--dt", "1", "--noise", "psi=0.3deg", "--noise", "r=0.1deg/s", "--holdout", "turn:12"]
    assert run(["simulate", "remus100", "zigzag:10/10", "turn:12", "--out", str(bundle), *options]) == 0
    return bundle


@pytest.mark.thorough
def test_the_commands_a_fit_proposes_can_be_typed(pond, capsys):
    """A folder with a space in its name; the rudder of this vehicle goes to 13.6 degrees."""
    out = pond / "fit"
    names = ["--free", "N_r|r|,N_dr"]
    assert run(["fit", str(pond), *names, "--out", str(out)]) == 0
    said = (out / "report.md").read_text("utf-8")
    (typed,) = [c for c in commands(said) if c[1] == "predict"]
    assert typed[2:] == [str(pond), "turn:13", "--model", str(out)]
    assert run([*typed[1:], "--draws", "20"]) == 0
    assert "turn:13" in capsys.readouterr().out
    assert not re.search("BUNDLE|THIS_FOLDER|MANOEUVRE", said)


@pytest.mark.thorough
def test_what_identify_proposes_names_the_trial(pond, capsys):
    assert run(["identify", str(pond), "--free", "N_r|r|,Y_v|v|,Y_v|r|,Y_r|r|"]) == 0
    out = capsys.readouterr().out
    assert f"bayesid design {shlex.quote(str(pond))} " in out and "BUNDLE" not in out


def test_a_diagnosis_proposes_the_manoeuvre_it_ranks_first_for_its_own_folder():
    places = places_of("my pond", "out/gap", data="logs", effects="mine.py")
    found = a_result()
    step = answer(found, places).steps[-1]
    first = found.next_manoeuvre[0].typed if found.next_manoeuvre else found.runs[0].run
    expected = [
        "bayesid",
        "predict",
        "my pond",
        "--data",
        "logs",
        first,
        "--model",
        "out/gap",
        "--effects",
        "mine.py",
    ]
    assert commands(step)[0] == expected
    other = replace(found, next_manoeuvre=(Proposal("zigzag 20/20", 300.0, 1.0, 2.0, typed="zigzag:20/20"),))
    typed = commands(answer(other, places).steps[-1])
    assert typed and typed[0][5] == "zigzag:20/20"


def test_a_folder_that_is_proposed_is_not_there_yet(tmp_path):
    places = places_of(tmp_path, None)
    assert places.beside("fit") == str(tmp_path / "fit")
    (tmp_path / "fit").mkdir()
    (tmp_path / "fit_2").mkdir()
    assert places.beside("fit") == str(tmp_path / "fit_3")
    assert NOWHERE.beside("fit") == "FOLDER"
    (tmp_path / "trial.toml").touch()
    assert places_of(tmp_path / "trial.toml", None).beside("gap") == str(tmp_path / "gap")


@pytest.mark.thorough
def test_a_vehicle_given_beside_the_trial_is_given_to_the_next_step_too(pond, capsys, tmp_path):
    own = tmp_path / "own ship.toml"
    own.write_text((BUILTIN_FOLDER / "remus100.toml").read_text("utf-8"), "utf-8")
    assert run(["identify", str(pond), "--vehicle", str(own), "--free", "N_r|r|,Y_v|v|,Y_v|r|,Y_r|r|"]) == 0
    out = capsys.readouterr().out
    assert f"bayesid design {shlex.quote(str(pond))} --vehicle {shlex.quote(str(own))} " in out


def test_where_nothing_was_written_the_step_says_what_writes_it(tmp_path):
    places = places_of(tmp_path / "pond", None)
    assert f"--out {tmp_path / 'pond' / 'gap'}: that writes" in prediction_step(places=places)
    assert f"--out {tmp_path / 'pond' / 'fit'}: that writes" in prediction_step("", False, places)
    assert prediction_step("it diverges", places=places) == "Do not predict with it: it diverges."
    kept = places.written(tmp_path / "gap")
    assert prediction_step("it diverges", places=kept).startswith(f"Do not predict with {tmp_path / 'gap'}: ")


def test_a_trial_that_is_no_bundle_lies_nowhere(pond):
    assert places_of(load_trial(pond), None) == Places("BUNDLE", "")
