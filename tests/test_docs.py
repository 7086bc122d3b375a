"""The documentation says what the package does: generated parts are complete, blocks of code run."""

import re
import shlex
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
sys.path.insert(0, str(DOCS))

from _generate.commands import tree  # noqa: E402
from _generate.pages import PAGES  # noqa: E402

import bayesid  # noqa: E402
from bayesid.cli.main import run as command_line  # noqa: E402
from bayesid.diagnosis.hypotheses.rules import RULES  # noqa: E402
from bayesid.diagnosis.hypotheses.verdict import WORDS  # noqa: E402
from bayesid.diagnosis.result import schema  # noqa: E402
from bayesid.diagnosis.threshold_table import TABLE  # noqa: E402
from bayesid.manoeuvres.catalogue import REGISTRY  # noqa: E402
from bayesid.model.channels import CHANNELS  # noqa: E402
from bayesid.model.effects import CATALOGUE  # noqa: E402
from bayesid.model.terms import TERMS  # noqa: E402
from bayesid.model.vehicles.reading import builtin_names, read_vehicle  # noqa: E402
from bayesid.trials.stated import Stated  # noqa: E402

WRITTEN = [ROOT / "README.md", *sorted(p for p in DOCS.rglob("*.md") if p.name != "importing.md")]
_BLOCK = re.compile(r"^```(\w+)\n(.*?)^```", re.MULTILINE | re.DOTALL)
_TABLE = re.compile(r"^`(\w+\.csv)`[^\n]*:\n\n```none\n(.*?)^```", re.MULTILINE | re.DOTALL)
_NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?![\w])")
_MARKER = re.compile(r"^<!-- generated: (\w+) -->$", re.MULTILINE)
# pages whose commands take seconds; those of the others take minutes
CHEAP = ("guide/own_log.md", "guide/new_vehicles.md", "guide/manoeuvres.md", "developer/blind_checks.md")
COSTLY = ("guide/ten_minutes.md", "guide/diagnosis.md", "guide/thruster_vehicles.md", "../README.md")


def blocks(page, language):
    """Blocks of one language, in order."""
    return [text for kind, text in _BLOCK.findall(page.read_text("utf-8")) if kind == language]


def commands_of(page, languages=("bash",)):
    """Commands of `bayesid` on a page, as lists of words."""
    found = []
    for kind, text in _BLOCK.findall(page.read_text("utf-8")):
        if kind in languages:
            lines = text.replace("\\\n", " ").splitlines()
            found += [shlex.split(line, comments=True) for line in lines if line.startswith("bayesid ")]
    return found


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("page", "names"),
    [
        ("effects", [e.name for e in CATALOGUE]),
        ("effects", [p.name for e in CATALOGUE for p in e.parameters]),
        ("terms", [t.name.replace("|", r"\|") for t in TERMS]),
        ("rules", [*WORDS, *(r.name for r in RULES)]),
        ("thresholds", [limit.symbol for limit in TABLE]),
        ("manoeuvres", list(REGISTRY)),
        ("channels", [c.name for c in CHANNELS]),
        ("vehicles", list(builtin_names())),
        ("commands", [" ".join(words) for words, _ in tree()]),
        ("public_names", [n for n in bayesid.__all__ if n != "__version__"]),
        ("diagnosis_fields", list(schema()["properties"])),
    ],
)
def test_a_generated_page_has_every_name_of_its_kind(page, names, monkeypatch):
    monkeypatch.setattr("_generate.effects._picture", lambda effect: None)  # `make docs` draws them
    text = PAGES[page]()
    assert names
    missing = [n for n in names if not re.search(rf"(?<![\w]){re.escape(n)}(?![\w])", text)]
    assert not missing


def test_every_verdict_word_is_explained_in_the_guide():
    text = (DOCS / "guide" / "diagnosis.md").read_text("utf-8")
    headings = re.findall(r"^### (\w+)$", text, re.MULTILINE)
    assert set(headings) == {*WORDS, "input", "not_enough"}


def test_markers_and_generated_parts_are_the_same():
    used = [name for page in WRITTEN for name in _MARKER.findall(page.read_text("utf-8"))]
    assert sorted(used) == sorted(PAGES)


def test_help_of_a_command_lists_its_options():
    for words, leaf in tree():
        text = PAGES["commands"]().split(f"## `{' '.join(words)}`")[1].split("\n## ")[0]
        for parameter in leaf.params:
            assert all(o in text for o in parameter.opts if o.startswith("--"))


def options_of_study(name):
    """Those its script adds to its parser, and those of its executor where it has one."""
    text = (ROOT / "studies" / name / "run.py").read_text("utf-8")
    if "add_executor(" in text:
        text += (ROOT / "bayesid" / "executor" / "executor.py").read_text("utf-8")
    return set(re.findall(r'"(--[a-z-]+)"', text))


@pytest.mark.parametrize("page", WRITTEN, ids=lambda p: p.stem)
def test_commands_of_a_page_exist_with_their_options(page):
    leaves = dict(tree())
    for words in commands_of(page, ("bash", "text")):
        near = [leaf for names, leaf in leaves.items() if tuple(words[: len(names)]) == names]
        assert near, f"no command {' '.join(words)}"
        known = {o for p in near[0].params for o in (*p.opts, *p.secondary_opts)} | {"--help", "-h"}
        if words[1] == "study" and len(words) > 2:
            known |= options_of_study(words[2])
        unknown = [w for w in words if re.match(r"--?[a-z]", w) and w.split("=")[0] not in known]
        assert not unknown, " ".join(words)


@pytest.mark.parametrize("page", WRITTEN, ids=lambda p: p.stem)
def test_files_shown_on_a_page_are_read(page):
    for text in blocks(page, "toml"):
        if not text.startswith("format"):
            continue
        tree_ = tomllib.loads(text)
        if "coef" in tree_:
            read_vehicle(tree_, page.name, None)
        else:
            stated = Stated(tree_)
            assert not stated.problems and not stated.warnings


@pytest.mark.parametrize("name", ["README.md", "CONTRIBUTING.md"])
def test_links_of_the_front_pages_lead_somewhere(name):
    links = re.findall(r"\]\(([^)#]+)\)", (ROOT / name).read_text("utf-8"))
    assert links
    assert [link for link in links if "://" not in link and not (ROOT / link).exists()] == []


def runs_of(page):
    """Commands of a page as lists of words, then its Python, one text in each list; and the exit codes."""
    shell = "\n".join(blocks(page, "bash"))
    odd = [line for line in shell.splitlines() if line and not line.startswith(("bayesid ", "    "))]
    assert not odd, "only commands of bayesid are run"
    codes = [
        3 if "# exit code 3" in line else 0 for line in shell.splitlines() if line.startswith("bayesid ")
    ]
    runs = [(words, code) for words, code in zip(commands_of(page), codes, strict=True)]
    return runs + [([text], 0) for text in blocks(page, "python")]


def run_page(page, folder):
    """Run the commands of a page in a folder, then its Python; what they print."""
    printed = []
    for name, text in _TABLE.findall(page.read_text("utf-8")):
        (folder / name).write_text(text, encoding="utf-8")
    for run, code in runs_of(page):
        line = ["-m", *run] if run[0] == "bayesid" else ["-c", *run]
        done = subprocess.run(
            [sys.executable, *line], cwd=folder, capture_output=True, text=True, timeout=400, check=False
        )
        assert done.returncode == code, f"{' '.join(line)}\n{done.stdout[-2000:]}{done.stderr[-2000:]}"
        printed += done.stdout.splitlines()
    return printed


def run_page_here(page, capsys):
    """As `run_page`, in this process and folder: a start of Python costs more than most of these commands."""
    printed = []
    for run, code in runs_of(page):
        if run[0] == "bayesid":
            assert command_line(run[1:]) == code, " ".join(run) + "\n" + "".join(capsys.readouterr())[-2000:]
        else:
            exec(compile(run[0], page.name, "exec"), {"__name__": "__main__"})
        printed += capsys.readouterr().out.splitlines()
    return printed


def parts_of(line):
    """Words of a line, and its numbers."""
    return " ".join(re.sub(_NUMBER, "#", line).split()), [float(x) for x in re.findall(_NUMBER, line)]


def is_printed(line, printed):
    """Whether a line is among those printed, numbers to 5 % and 0.02: other processors round otherwise."""
    words, numbers = parts_of(line)
    return any(
        theirs == words and numbers == pytest.approx(found, rel=0.05, abs=0.02)
        for theirs, found in map(parts_of, printed)
    )


def shown_by(page):
    """Lines a page says were printed; not those cut short by dots, nor commands."""
    lines = [line for text in blocks(page, "text") for line in text.splitlines()]
    lines += re.findall(r"^> (.+)$", page.read_text("utf-8"), re.MULTILINE)
    return [line for line in lines if line.strip() and "..." not in line and not line.startswith("bayesid ")]


@pytest.mark.thorough
@pytest.mark.parametrize("name", CHEAP)
def test_a_short_page_runs(name, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    page = DOCS / name
    printed = run_page_here(page, capsys)
    assert [line for line in shown_by(page) if not is_printed(line, printed)] == []


@pytest.mark.slow
@pytest.mark.parametrize("name", COSTLY)
def test_a_long_page_runs(name, tmp_path, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    page = DOCS / name
    printed = run_page(page, tmp_path)
    assert [line for line in shown_by(page) if not is_printed(line, printed)] == []


def test_a_line_that_was_not_printed_is_found_out():
    printed = ["N_dr  -0.003854  -0.004514", "a turn of 455 m (95 %: 454 to 457)"]
    assert is_printed("a turn of 455.5 m (95 %: 454 to 457)", printed)
    assert not is_printed("a turn of 490 m (95 %: 454 to 457)", printed)
    assert not is_printed("a circle of 455 m (95 %: 454 to 457)", printed)


def test_every_page_with_commands_is_run_by_a_test():
    with_code = {p.resolve() for p in WRITTEN if blocks(p, "bash") or blocks(p, "python")}
    assert with_code == {(DOCS / name).resolve() for name in (*CHEAP, *COSTLY)}


@pytest.mark.thorough
@pytest.mark.parametrize("name", [
    "ridge_of_a_turn",
    # `make docs` runs all of them, and ends where one fails
    pytest.param("next_manoeuvre", marks=pytest.mark.slow),
    pytest.param("rudder_too_slow", marks=pytest.mark.slow),
])  # fmt: skip
def test_a_script_of_the_gallery_draws_its_picture(name, tmp_path, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    picture = tmp_path / "picture.png"
    done = subprocess.run(
        [sys.executable, str(DOCS / "gallery" / f"{name}.py"), str(picture)], capture_output=True, text=True,
        timeout=400, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-2000:]
    assert picture.read_bytes().startswith(b"\x89PNG")
    said = {
        "next_manoeuvre": "most by one run: ", "ridge_of_a_turn": "one turn: N_v to ",
        "rudder_too_slow": "The rudder follows its orders with a lag of 0.6",
    }  # fmt: skip
    assert done.stdout.startswith(said[name])


def test_the_gallery_shows_every_script():
    text = (DOCS / "gallery" / "index.md").read_text("utf-8")
    scripts = sorted(p.stem for p in (DOCS / "gallery").glob("*.py"))
    assert scripts == sorted(re.findall(r"literalinclude\} (\w+)\.py", text))


@pytest.mark.parametrize("page", ["guide/ten_minutes.md", "../README.md"])
def test_first_pages_tell_how_long_one_waits_and_not_what_the_processor_does(page):
    text = (DOCS / page).read_text(encoding="utf-8").lower()
    assert "idle machine" in text and "processor second" not in text and "processor time" not in text
