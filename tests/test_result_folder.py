"""A command writes into its own folder again, and never into that of another."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import pytest

from bayesid.cli.main import run
from bayesid.cli.result_folder import OtherResultError, refuse_diagnosis, refuse_other
from bayesid.lock import LOCK

VERSIONS = {"bayesid": "0.9.0"}
REPORT = {"title": "A", "created": "2026-01-01T00:00:00Z", "versions": VERSIONS}
ITERATES = '{"digest": "0", "problem": "1", "seed": 0}\n'
FIT = json.dumps({"names": [], "cost": 1.0})
# files as versions left them whose reports did not tell their command
EARLIER = {
    "fit": {"fit.json": FIT, "iterates.jsonl": ITERATES, "results.json": json.dumps({**REPORT, "fit": {}})},
    "sample": {
        "chain/setup.json": '{"density": "0"}', "fit.json": FIT, "posterior.nc": "",
        "results.json": json.dumps({**REPORT, "rhat_max": 1.0}),
    },
    "diagnose": {"diagnosis.json": '{"verdict": "explained"}', "model.json": '{"hypotheses": []}'},
    "predict": {"predictions.json": '{"predictions": []}'},
    "identify": {"results.json": json.dumps({**REPORT, "inputs": {}, "identifiability": {}})},
    "excite": {"excitation.json": '{"groups": []}'},
    "compare": {"comparison.json": '{"vehicle": "a"}'},
    "design": {"design.json": '{"vehicle": "a", "goal": "b"}'},
    "export": {"ensemble.json": '{"members": []}'},
    "blind solve": {"seal.json": '{"verdicts": {}}'},
    "blind make": {"commitments.json": '{"bundles": {}}'},
    "simulate": {"trial.toml": "format = 1\n"},
}  # fmt: skip
KILLED = {
    "fit": {"iterates.jsonl": ITERATES},
    "diagnose": {"refits/0a.fit.npz": ""},
    "identify": {"profile.jsonl": '{"digest": "0", "name": "N_r"}\n'},
    "sample": {"chain/setup.json": '{"density": "0"}'},
    "blind solve": {"a/solved.json": '{"bundle": "0"}'},
    "blind make": {"secret.key": f"{64 * 'a'}\n"},
}
COMMANDS = (*EARLIER, "trial import", "study ridges", "blind score")


def lay(folder, files):
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    return folder


def state(folder):
    paths = [folder, *sorted(folder.rglob("*"))]
    return [(p, p.stat().st_mtime_ns, p.read_bytes() if p.is_file() else b"") for p in paths]


@pytest.mark.parametrize("owner", EARLIER)
def test_a_result_of_an_earlier_version_is_kept_from_every_other_command(tmp_path, owner):
    folder = lay(tmp_path, EARLIER[owner])
    shares = {"simulate": {"simulate", "trial import"}}.get(owner, {owner})
    for command in COMMANDS:
        if command in shares or (owner.startswith("blind") and command.startswith("study")):
            refuse_other(folder, f"bayesid {command}")
            continue
        with pytest.raises(OtherResultError, match="Choose another folder") as told:
            refuse_other(folder, f"bayesid {command}")
        assert str(folder) in str(told.value) and f"`bayesid {command}`" in str(told.value)
        assert ("a trial" if owner == "simulate" else f"`bayesid {owner}`") in str(told.value)


@pytest.mark.parametrize("owner", KILLED)
def test_what_a_killed_command_left_is_known_by_its_files(tmp_path, owner):
    folder = lay(tmp_path, KILLED[owner])
    refuse_other(folder, f"bayesid {owner}")
    with pytest.raises(OtherResultError, match=rf"`bayesid {owner}`"):
        refuse_other(folder, "bayesid predict")


def test_what_a_killed_command_left_is_known_by_its_lock(tmp_path):
    import socket

    child = os.fork()
    if child == 0:
        os._exit(0)
    os.waitpid(child, 0)
    entry = {
        "pid": child,
        "host": socket.gethostname(),
        "command": "bayesid predict",
        "since": "",
        "born": "",
    }
    lay(tmp_path, {LOCK: json.dumps(entry)})
    refuse_other(tmp_path, "bayesid fit")  # it left nothing but the lock
    lay(tmp_path, {"turn_20.csv": "t[s]\n"})
    refuse_other(tmp_path, "bayesid predict")
    before = state(tmp_path)
    with pytest.raises(OtherResultError, match="`bayesid predict` began and did not end") as refused:
        refuse_other(tmp_path, "bayesid fit")
    # the files may be the user's own: nobody is told to delete more than the lock
    assert f"or delete {tmp_path / LOCK} if" in str(refused.value) and "delete this one" not in str(
        refused.value
    )
    assert state(tmp_path) == before


def test_the_command_in_a_report_tells_one_study_from_another(tmp_path):
    lay(tmp_path, {"results.json": json.dumps({**REPORT, "command": "bayesid study frames"})})
    refuse_other(tmp_path, "bayesid study frames")
    refuse_other(tmp_path, "python studies/frames/run.py")
    for other in ("study ridges", "fit", "blind score"):
        with pytest.raises(OtherResultError, match="`bayesid study frames`"):
            refuse_other(tmp_path, f"bayesid {other}")


def test_a_report_that_tells_no_command_is_that_of_a_study(tmp_path):
    lay(tmp_path, {"results.json": json.dumps({**REPORT, "inputs": {}, "cases": [], "predictions": {}})})
    refuse_other(tmp_path, "bayesid study coverage")
    with pytest.raises(OtherResultError, match=r"a report of another command of bayesid \(results\.json\)"):
        refuse_other(tmp_path, "bayesid predict")


def test_a_folder_of_ones_own_files_is_no_result(tmp_path):
    own = {
        "results.json": '{"title": "mine", "versions": 3}', "design.json": "[1]", "model.json": "broken",
        "fit.json": '{"names": ["me"]}', "iterates.jsonl": "", "report.html": "mine", "dive/done.json": "{}",
        "homework/solved.json": '["mine"]', "secret.key": "mine", "chain/setup.json": "[]",
    }  # fmt: skip
    folder = lay(tmp_path, own)
    for command in COMMANDS:
        refuse_other(folder, f"bayesid {command}")
        refuse_other(tmp_path / "absent", f"bayesid {command}")
    lay(tmp_path, {"fleet.json": '["boats"]', "diagnosis.json": '{"patient": "mine"}'})
    for other in ("fleet.json", "diagnosis.json"):
        refuse_diagnosis(tmp_path, other)


def test_a_pipe_is_not_waited_for(tmp_path):
    for name in ("steps.sh", "results.json", "fleet.json"):
        os.mkfifo(tmp_path / name)
    code = (
        "import sys; from pathlib import Path; from bayesid.cli.result_folder import *; "
        "refuse_other(Path(sys.argv[1]), 'bayesid fit'); refuse_diagnosis(Path(sys.argv[1]), 'fleet.json')"
    )
    subprocess.run([sys.executable, "-c", code, str(tmp_path)], check=True, timeout=60)


@pytest.mark.parametrize("command", ["trial check", "trial measure", "trial init", "vehicle check"])
def test_a_file_of_its_own_name_may_lie_beside_any_result(tmp_path, command):
    refuse_other(lay(tmp_path, {**EARLIER["fit"], **EARLIER["simulate"]}), f"bayesid {command}")


def test_diagnoses_of_one_bundle_and_of_several_do_not_mix(tmp_path, capsys):
    pond, days, fleet = (
        tmp_path / "pond",
        tmp_path / "days",
        lay(tmp_path / "all", {"fleet.json": '{"verdicts": {}}'}),
    )
    for folder in (pond, days / "one"):
        assert run(["simulate", "remus100", "turn:10,duration=20", "--dt", "1", "--out", str(folder)]) == 0
    one = lay(tmp_path / "one", {"diagnosis.json": '{"verdict": "explained"}'})
    capsys.readouterr()
    for bundle, out, kind in ((pond, fleet, "a folder of bundles"), (days, one, "one bundle")):
        before = state(out)[1:]
        assert run(["diagnose", str(bundle), "--quick", "--out", str(out)]) == 2
        assert f"holds the diagnosis of {kind}" in capsys.readouterr().err
        assert state(out)[1:] == before


@pytest.mark.thorough
def test_commands_refuse_and_change_nothing_and_their_own_folder_is_written_again(tmp_path, capsys):
    pond, fit = tmp_path / "pond", tmp_path / "fit"
    executed = [
        "simulate",
        "generic_sub",
        "zigzag:20/20",
        "--dt",
        "2",
        "--noise",
        "r=0.001",
        "--out",
        str(pond),
    ]
    assert run(executed) == 0
    line = ["fit", str(pond), "--free", "N_dr", "--quick", "--out", str(fit)]
    assert run(line) == 0
    assert json.loads((fit / "results.json").read_text())["command"] == "bayesid fit"
    before, bundle = state(fit), state(pond)
    capsys.readouterr()
    for words in (
        ["predict", str(pond), "turn:20", "--model", str(fit)],
        ["identify", str(pond), "--quick"],
        ["sample", str(pond), "--quick"],
        ["diagnose", str(pond), "--quick"],
        ["simulate", "generic_sub", "turn:20"],
        ["trial", "import", str(pond / "01_zigzag_20_20.csv")],
        ["blind", "make", "--count", "1", "--answers", str(tmp_path / "answers")],
    ):
        assert run([*words, "--out", str(fit)]) == 2
        told = capsys.readouterr()
        assert told.out == "" and told.err.count("\n") == 1 and "a result of `bayesid fit` (" in told.err
        assert state(fit) == before
    assert run(["predict", str(pond), "--model", str(fit), "--out", str(pond)]) == 2
    assert "holds a trial" in capsys.readouterr().err and state(pond) == bundle
    assert not (tmp_path / "answers").exists()
    assert run(line) == 0 and run([*line, "--fresh"]) == 0
    assert run(["trial", "measure", str(pond), "--out", str(fit)]) == 0


def test_a_trial_is_not_simulated_over_before_anything_is_computed(tmp_path, capsys, monkeypatch):
    lay(tmp_path, EARLIER["simulate"])
    monkeypatch.setattr("bayesid.api.simulate.simulate_model", None)
    assert run(["simulate", "generic_sub", "turn:20", "--out", str(tmp_path)]) == 2
    assert "holds a trial already" in capsys.readouterr().err


def test_start_refuses_before_it_imports(tmp_path, capsys):
    lay(tmp_path / "bayesid" / "gap", EARLIER["fit"])
    lay(tmp_path, {"dive.csv": "t,x\n0,0\n1,1\n"})
    before = state(tmp_path)
    assert run(["start", str(tmp_path), "--yes"]) == 2
    assert "`bayesid fit`" in capsys.readouterr().err and state(tmp_path) == before
