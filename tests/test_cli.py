"""A shell user sees an answer or one message, never a traceback; exit codes tell which."""

from __future__ import annotations

import importlib
import json
import subprocess
import sys
import warnings

import pytest

import bayesid.cli.main
from bayesid import __version__
from bayesid.api.result import Result
from bayesid.cli.main import run
from bayesid.cli.output import print_json, print_table, rounded
from bayesid.errors import FitError, TrialError, raise_all
from bayesid.progress import printable


@pytest.fixture
def failing(monkeypatch):
    """Run `bayesid study` with a body that raises."""

    def run_with(error: BaseException, *args: str) -> int:
        def body(**_):
            raise error

        monkeypatch.setattr("bayesid.cli.study._studies", body)
        return run(["study", *args])

    return run_with


class Answered(Result):
    """A result with what failed."""

    success = True

    def __init__(self, failures):
        self.failures = failures

    def summary(self, verbose=False):
        return "\n".join(f"CHECK FAILED: {text}" for text in self.failures)

    def record(self):
        return {"failed_checks": self.failures}


@pytest.mark.parametrize("failures", [[], ["It predicts worse."]])
@pytest.mark.parametrize("printed", [[], ["--json"]])
@pytest.mark.parametrize(
    "line",
    [["fit", "pond"], ["predict", "pond", "turn:20", "--model", "m"], ["export", "m", "--out", "ensemble"]],
    ids=lambda line: line[0],
)
def test_whatever_fails_a_check_ends_with_exit_code_3(line, printed, failures, monkeypatch, capsys):
    module = importlib.import_module(f"bayesid.api.{line[0]}")
    monkeypatch.setattr(module, line[0], lambda *_, **__: Answered(failures))
    assert run([*line, *printed]) == (3 if failures else 0)
    assert ("It predicts worse." in capsys.readouterr().out) == bool(failures)


def test_help_needs_no_numerical_library():
    code = (
        "import sys; from bayesid.cli.main import run; code = run(['--help']);"
        "heavy = {'numpy', 'scipy', 'numba', 'matplotlib', 'rich', 'jinja2', 'pint'} & set(sys.modules);"
        "sys.exit(f'loaded {heavy}' if heavy else code)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    said = " ".join(done.stdout.split())
    assert "0 ok, 2 usage or bad input, 3 not converged, a check failed, or a question is left, 4 a" in said


def test_importing_the_package_loads_nothing_heavy_and_lists_its_names():
    code = "import sys, bayesid as b; print('numpy' in sys.modules, 'BayesidError' in dir(b), b.BayesidError)"
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert done.stdout == "False True <class 'bayesid.errors.BayesidError'>\n"


def test_every_public_name_can_be_loaded():
    import bayesid

    for name in bayesid.__all__:
        assert getattr(bayesid, name) is not None, name
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = bayesid.nothing


def test_version_is_that_of_the_package(capsys):
    assert run(["--version"]) == 0
    assert capsys.readouterr().out == f"bayesid {__version__}\n"


@pytest.mark.parametrize("line", ["nonsense", "study --nonsense", "study --seed x", "study --seed=-1"])
def test_wrong_usage_is_exit_code_2_with_one_message(line, capsys):
    assert run(line.split()) == 2
    captured = capsys.readouterr()
    assert "Error: " in captured.err and "Traceback" not in captured.err and captured.out == ""


def test_a_bad_input_is_exit_code_2_with_the_message_of_its_error(failing, capsys):
    assert failing(TrialError("run07.csv: time goes back at row 1843")) == 2
    assert capsys.readouterr().err == "bayesid: run07.csv: time goes back at row 1843\n"


def test_an_error_may_carry_its_own_exit_code(failing):
    class NotConverged(FitError):
        exit_code = 3

    assert failing(NotConverged("stopped after 200 iterations")) == 3


def test_a_missing_file_is_named(failing, capsys):
    assert failing(FileNotFoundError(2, "No such file or directory", "trial.toml")) == 2
    assert capsys.readouterr().err == "bayesid: trial.toml: No such file or directory\n"


@pytest.mark.parametrize(
    "error, code, words",
    [
        (ZeroDivisionError("division by zero"), 1, "unexpected ZeroDivisionError: division by zero"),
        (RecursionError("deep"), 1, "unexpected RecursionError"),
        (MemoryError(), 1, "out of memory"),
        (KeyboardInterrupt(), 130, "stopped"),
    ],
)
def test_a_surprise_is_a_message_without_traceback(error, code, words, failing, capsys):
    assert failing(error) == code
    err = capsys.readouterr().err
    assert words in err and "Traceback" not in err


@pytest.mark.parametrize("words", [[], ["--out", "there"], ["--out=there"]])
def test_a_stop_claims_nothing_of_files_that_may_not_exist(words, failing, capsys, monkeypatch):
    monkeypatch.setattr("sys.argv", ["bayesid", "fit", "pond", *words])
    assert failing(KeyboardInterrupt()) == 130
    err = capsys.readouterr().err
    assert "before it was done" in err and "complete" not in err
    assert ("if anything" in err) == ("--out" in err) == bool(words)


def test_verbose_shows_the_traceback_of_a_surprise(failing, capsys):
    assert failing(ZeroDivisionError("x"), "-v") == 1
    assert "Traceback" in capsys.readouterr().err
    assert failing(ZeroDivisionError("x")) == 1
    assert "again with -v" in capsys.readouterr().err, "verbosity must not leak into the next run"


def test_a_name_cannot_steer_the_terminal(failing, capsys):
    failing(TrialError("trial \x1b[2J\x07evil"))
    assert "\x1b" not in capsys.readouterr().err
    assert printable("δ_r °\n\tx") == "δ_r °\n\tx"


def test_a_warning_is_one_line(monkeypatch, capsys):
    def body():
        warnings.warn("3 rows dropped", stacklevel=1)
        return {}

    monkeypatch.setattr("bayesid.cli.study._studies", body)
    with warnings.catch_warnings():
        warnings.simplefilter("always")
        assert run(["study"]) == 0
    assert capsys.readouterr().err == "warning: 3 rows dropped\n"


def test_all_problems_of_a_file_come_in_one_error():
    with pytest.raises(TrialError, match=r"a.toml: 2 problems\n  - one\n  - two"):
        raise_all(TrialError, "a.toml", ["one", "two"])
    with pytest.raises(TrialError, match=r"^a.toml: one$"):
        raise_all(TrialError, "a.toml", ["one"])


def test_a_closed_pipe_ends_quietly():
    code = "from bayesid.cli.entry import main; main(['--help'])"
    reader = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    reader.stdout.close()
    assert reader.stderr.read() == b""
    reader.stderr.close()
    reader.wait()


CLOSED = """
import sys
from pathlib import Path
from bayesid.cli.entry import main

class Found:
    def summary(self, verbose):
        return "answer"
    def save(self, folder):
        Path(folder, "report.html").write_text("whole")
        return Path(folder, "report.html")

def body():
    from bayesid.cli.output import answer
    input()  # until the reader has gone
    answer(Found(), Path(sys.argv[1]), False, False)
    return {}

import bayesid.cli.study as study
study._studies = body
main(["study"])
"""


def test_a_closed_pipe_costs_no_file(tmp_path):
    """`bayesid fit ... | head -1`: the reader closes before the answer is printed."""
    streams = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.PIPE)
    child = subprocess.Popen([sys.executable, "-c", CLOSED, str(tmp_path)], **streams, text=True)
    child.stdout.close()
    child.stdout = None
    _, err = child.communicate("\n", timeout=60)
    assert not err
    assert (tmp_path / "report.html").read_text() == "whole"


def test_a_study_gets_its_folder_seed_and_quick_mode(tmp_path, monkeypatch, capsys):
    (tmp_path / "studies" / "demo").mkdir(parents=True)
    script = '"""Does it run?"""\nimport sys\nprint(sys.argv[1:])\nsys.exit(3)\n'
    (tmp_path / "studies" / "demo" / "run.py").write_text(script)
    monkeypatch.chdir(tmp_path)
    before = sys.argv
    assert run(["study", "demo", "--quick", "--seed", "5"]) == 3
    assert sys.argv is before
    assert capsys.readouterr().out == f"{['--out', 'out/demo', '--quick', '--seed', '5']}\n"
    assert run(["study"]) == 0
    assert "Does it run?" in capsys.readouterr().out
    assert run(["study", "other"]) == 2


def test_what_the_command_does_not_know_is_an_option_of_the_study(tmp_path, monkeypatch, capsys):
    (tmp_path / "studies" / "demo").mkdir(parents=True)
    script = (
        "import argparse\nparser = argparse.ArgumentParser()\nparser.add_argument('--out')\n"
        "parser.add_argument('--every', nargs=2)\nprint(parser.parse_args())\n"
    )
    (tmp_path / "studies" / "demo" / "run.py").write_text(script)
    monkeypatch.chdir(tmp_path)
    assert run(["study", "demo", "--every", "a", "b", "--out", "here"]) == 0
    assert "Namespace(out='here', every=['a', 'b'])" in capsys.readouterr().out
    assert run(["study", "demo", "--help"]) == 0
    assert "--every EVERY EVERY" in capsys.readouterr().out
    assert run(["study", "--every", "demo"]) == 2
    assert "come after its name" in capsys.readouterr().err
    assert run(["study", "demo", "--evry"]) == 2 and "--evry" in capsys.readouterr().err
    assert run(["study", "--help"]) == 0
    said = capsys.readouterr().out
    assert "bayesid study NAME --help" in said
    assert said.splitlines()[-1].split() == ["demo", "--every"]  # and not --out, which is listed above


def test_help_on_studies_lists_the_options_each_of_them_adds(capsys):
    assert run(["study", "-h"]) == 0
    said = capsys.readouterr().out
    assert "Do 90 % intervals hold the truth nine times in ten" in said.partition("Further options of the")[0]
    rows = {words[0]: words[1:] for line in said.splitlines() if (words := line.split())}
    assert rows["ridges"] == ["--truths", "--workers", "--executor"]
    assert rows["ship_models"] == ["--only"]


def test_a_study_names_the_reports_it_wrote_and_no_other(tmp_path, monkeypatch, capsys):
    (tmp_path / "studies" / "demo").mkdir(parents=True)
    script = (
        '"""Does it write?"""\nimport pathlib, sys\nfolder = pathlib.Path(sys.argv[2]) / "ship"\n'
        'folder.mkdir(parents=True)\n(folder / "report.html").write_text("x")\n'
    )
    (tmp_path / "studies" / "demo" / "run.py").write_text(script)
    monkeypatch.chdir(tmp_path)
    assert run(["study", "demo", "--out", "here"]) == 0
    assert capsys.readouterr().out.splitlines() == ["report: here/ship/report.html"]


def test_every_command_has_help_and_a_verbose_option():
    tree = bayesid.cli.main.command()

    def walk(path, node):
        if hasattr(node, "commands"):
            for name, child in node.commands.items():
                yield from walk([*path, name], child)
        else:
            yield path, node

    for path, node in walk([], tree):
        assert node.help, f"{path} has no help"
        assert any("--verbose" in option.opts for option in node.params), f"{path} has no -v"
        paragraphs = node.help.split("\n\n")
        assert len(set(paragraphs)) == len(paragraphs), f"{path} says something twice"


@pytest.mark.parametrize(
    "number, printed",
    [
        ({"value": 1.23456789, "sd": 0.0123456}, {"value": 1.2346, "sd": 0.0123}),
        ({"mean": 123456.789, "sd": 4321.0, "n": 7}, {"mean": 123460.0, "sd": 4320.0, "n": 7}),
        ({"value": 1.23456789, "sd": 0.0}, {"value": 1.23457, "sd": 0.0}),
        ({"value": 1.23456789, "sd": None}, {"value": 1.23457, "sd": None}),
        ([0.123456789, 1e-9 / 3, 12, True, "0.123456789"], [0.123457, 3.33333e-10, 12, True, "0.123456789"]),
    ],
)  # fmt: skip
def test_printed_json_has_the_digits_that_mean_something(number, printed):
    assert rounded(number) == printed


def test_tables_align_numbers_right_and_show_a_dash_for_nothing(capsys):
    print_table(["name", "value"], [["a", 1.5], ["long name", None]])
    assert capsys.readouterr().out.splitlines() == [
        "name       value",
        "---------  -----",
        "a            1.5",
        "long name      –",
    ]


def test_json_answers_are_strict_json(capsys):
    print_json({"a": float("nan"), "b": [1.0, 2.0]})
    assert json.loads(capsys.readouterr().out) == {"a": None, "b": [1.0, 2.0]}
