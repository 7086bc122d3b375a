"""An import corrected in its own folder: by its own map, whole or not at all, and nothing edited is lost."""

from __future__ import annotations

import errno
import json
import os

import numpy as np
import pytest

from bayesid.cli.main import run
from bayesid.trials import load_trial

MAP = """format = 1
name = "dive"  # mine
vehicle = "vehicle.toml"
rudder_positive = "port"
[sources.log]
files = ["dive.csv"]
[channels]
x = { from = "x [m]", unit = "m" }
y = { from = "y [m]", unit = "m" }
psi = { from = "yaw [deg]", unit = "deg" }
delta_r_cmd = { from = "rudder [deg]", unit = "deg" }
[[runs]]
name = "first"
files = ["dive.csv"]
[[runs]]
name = "second"
files = ["dive.csv"]
window = [20.0, 60.0]
"""


@pytest.fixture
def bundle(tmp_path, capsys):
    """An imported bundle, with files of the user in it, and its log beside it."""
    t = np.arange(0.0, 100.0, 0.5)
    psi = 0.5 * np.sin(0.1 * t)
    track = np.cumsum(np.stack([np.cos(psi), np.sin(psi)]), axis=1)
    rows = zip(t, *track, np.degrees(psi), np.where(np.cos(0.1 * t) > 0, -10.0, 10.0), strict=True)
    log, out = tmp_path / "dive.csv", tmp_path / "bundle"
    text = "\n".join(",".join(map(repr, map(float, row))) for row in rows)
    log.write_text(f"t [s],x [m],y [m],yaw [deg],rudder [deg]\n{text}\n")
    out.mkdir()
    (out / "map.toml").write_text(MAP)
    assert run(["vehicle", "new", str(out / "vehicle.toml"), "--like", "remus100"]) == 0
    (out / "notes.txt").write_text("mine")
    again = ["trial", "import", str(log), "--map", str(out / "map.toml"), "--out", str(out)]
    assert run(again) == 0
    assert "is replaced" not in capsys.readouterr().out
    return out, again


def contents(folder):
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def edit(out, *changes):
    text = (out / "map.toml").read_text()
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    (out / "map.toml").write_text(text)


def test_the_edited_map_of_a_bundle_is_imported_in_place(bundle, capsys):
    out, again = bundle
    before, trial = contents(out), load_trial(out)
    edit(
        out,
        ('rudder_positive = "port"', 'rudder_positive = "starboard"'),
        ('name = "second"', 'name = "late"'),
    )
    edited = (out / "map.toml").read_bytes()
    assert run(again) == 0
    said, after = capsys.readouterr().out, contents(out)
    assert "The import in" in said and "2 tables (first.csv, late.csv)" in said
    assert "removed, as no run is made of it any more: second.csv" in said
    assert "may have been edited" not in said
    assert set(after) == set(before) - {"second.csv"} | {"late.csv"}
    assert after["map.toml"] == edited
    assert {n: after[n] for n in ("vehicle.toml", "notes.txt")} == {
        n: before[n] for n in ("vehicle.toml", "notes.txt")
    }
    new = load_trial(out)
    assert [r.name for r in new.runs] == ["first", "late"]
    ordered = [r.commands["delta_r_cmd"] for r in (trial.runs[0], new.runs[0])]
    np.testing.assert_allclose(ordered[0], -ordered[1])


def test_what_was_edited_in_the_bundle_is_kept_under_another_name(bundle, capsys):
    out, again = bundle
    for name in ("trial.toml", "second.csv"):
        (out / name).write_text((out / name).read_text() + ("# mine\n" if name == "trial.toml" else ""))
    mine = (out / "trial.toml").read_bytes()
    table = (out / "first.csv").read_text().replace("0.5,", "0.25,", 1)
    (out / "first.csv").write_text(table)
    for number in (1, 2):
        edit(out, ('"  # mine', ' again"  # mine'))
        assert run(again) == 0
        if number == 1:
            said = capsys.readouterr().out
            assert (
                "trial.replaced1.toml" in said
                and "first.replaced1.csv" in said
                and "second.replaced" not in said
            )
            (out / "trial.toml").write_text("# once more\n" + (out / "trial.toml").read_text())
    assert (out / "trial.replaced1.toml").read_bytes() == mine
    assert (out / "first.replaced1.csv").read_text() == table
    assert (out / "trial.replaced2.toml").read_text().startswith("# once more\n")


def test_an_import_of_an_earlier_version_kept_no_digests_and_loses_nothing(bundle, capsys):
    out, again = bundle
    told = json.loads((out / "provenance.json").read_text())
    del told["written"]
    (out / "provenance.json").write_text(json.dumps(told))
    before = contents(out)
    edit(out, ('name = "second"', 'name = "late"'))
    assert run(again) == 0
    said, after = capsys.readouterr().out, contents(out)
    assert "left, though no run is made of it any more: second.csv" in said
    assert after["second.csv"] == before["second.csv"]
    assert after["trial.replaced1.toml"] == before["trial.toml"]
    assert "first.replaced1.csv" not in after  # it is the same


def test_another_vehicle_file_of_the_edited_map_comes_with_it_and_the_one_before_is_kept(bundle, capsys):
    out, again = bundle
    other = out.parent / "other.toml"
    assert run(["vehicle", "new", str(other), "--like", "generic_sub"]) == 0
    before = (out / "vehicle.toml").read_bytes()
    edit(out, ('"vehicle.toml"', '"../other.toml"'))
    capsys.readouterr()
    for kept in (True, False):
        assert run(again) == 0
        assert ("it is vehicle.replaced1.toml now" in capsys.readouterr().out) == kept
        assert (out / "vehicle.toml").read_bytes() == other.read_bytes()
        assert (out / "vehicle.replaced1.toml").read_bytes() == before
        assert not (out / "vehicle.replaced2.toml").exists()
    (out / "vehicle.toml").unlink()
    assert run(again) == 0
    assert load_trial(out).vehicle_ref and (out / "vehicle.toml").read_bytes() == other.read_bytes()


def test_what_is_kept_takes_no_name_of_a_run(bundle):
    out, again = bundle
    mine = (out / "first.csv").read_text().replace("0.5,", "0.25,", 1)
    (out / "first.csv").write_text(mine)
    edit(out, ('name = "second"', 'name = "first.replaced1"'))
    assert run(again) == 0
    assert (out / "first.replaced2.csv").read_text() == mine
    assert [r.name for r in load_trial(out).runs] == ["first", "first.replaced1"]
    assert (out / "first.replaced1.csv").read_text() != mine


def test_a_table_of_the_import_that_is_now_a_log_is_not_written_over(bundle, capsys):
    out, again = bundle
    edit(
        out,
        ('files = ["dive.csv"]', 'files = ["first.csv"]'),
        ('"x [m]"', '"x[m]"'),
        ('"y [m]"', '"y[m]"'),
        ('"yaw [deg]", unit = "deg"', '"psi[rad]", unit = "rad"'),
        ('"rudder [deg]", unit = "deg"', '"delta_r_cmd[rad]", unit = "rad"'),
    )  # fmt: skip
    before = contents(out)
    assert run([*again[:2], str(out / "first.csv"), *again[3:]]) == 2
    assert "is one of the logs" in " ".join(capsys.readouterr().err.split())
    assert contents(out) == before


def test_a_log_that_a_table_of_the_import_repeats_to_the_last_byte_is_imported_again(tmp_path, capsys):
    """As one that `bayesid simulate` writes: it was taken for the table that is written over."""
    sim, out = tmp_path / "sim", tmp_path / "out"
    assert run(["simulate", "remus100", "zigzag:10/10", "--dt", "0.5", "--out", str(sim)]) == 0
    (log,) = sim.glob("*.csv")
    line = ["trial", "import", str(log), "--vehicle", "remus100", "--out", str(out)]
    assert run(line) == 0 and (out / log.name).read_bytes() == log.read_bytes()
    assert run([*line[:3], "--map", str(out / "map.toml"), "--out", str(out)]) == 0
    assert (out / log.name).read_bytes() == log.read_bytes()
    # control: a link to the table is the table
    (tmp_path / log.name).hardlink_to(out / log.name)
    linked = ["trial", "import", str(tmp_path / log.name), "--map", str(out / "map.toml"), "--out", str(out)]
    assert run(linked) == 2 and "is one of the logs" in " ".join(capsys.readouterr().err.split())


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (('"x [m]"', '"east"'), "has no series 'east'"),
        (('"vehicle.toml"', '"other.toml"'), "does not exist beside it"),
        (('name = "second"', 'name = "own"'), "no import wrote it"),
    ],
)
def test_an_import_that_fails_leaves_the_earlier_one_whole(bundle, capsys, change, words):
    out, again = bundle
    (out / "own.csv").write_text("t[s]\n")
    edit(out, change)
    before = contents(out)
    assert run(again) == 2
    assert words in " ".join(capsys.readouterr().err.split())
    assert contents(out) == before and not list(out.glob(".*"))


@pytest.mark.thorough
@pytest.mark.parametrize("fails_at", range(1, 9))
def test_a_disk_that_fails_in_between_leaves_the_earlier_one_whole(bundle, capsys, monkeypatch, fails_at):
    out, again = bundle
    (out / "trial.toml").write_text((out / "trial.toml").read_text() + "# mine\n")
    edit(out, ('name = "second"', 'name = "late"'))
    before, whole, calls = contents(out), os.replace, []

    def broken(source, target):
        if ".import_" in f"{source}{target}" and not str(source).endswith(".part"):
            calls.append(target)
            if len(calls) == fails_at:
                raise OSError(errno.EIO, "Input/output error")
        whole(source, target)

    monkeypatch.setattr("bayesid.trials.importing.again.os.replace", broken)
    assert run(again) == 2
    assert "nothing was replaced" in capsys.readouterr().err
    assert contents(out) == before


def test_another_map_or_a_trial_no_import_wrote_is_refused_as_before(bundle, tmp_path, capsys):
    out, again = bundle
    other = tmp_path / "map.toml"
    other.write_text(MAP)
    before = contents(out)
    assert run([*again[:3], "--map", str(other), "--out", str(out)]) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert "holds a trial already" in said and f"To correct this import, edit {out / 'map.toml'}" in said
    assert contents(out) == before
    (out / "provenance.json").unlink()
    assert run(again) == 2
    assert "To correct" not in capsys.readouterr().err


@pytest.mark.usefixtures("bundle")
def test_no_run_is_written_over_the_log_it_is_made_of(tmp_path, capsys):
    log = (tmp_path / "dive.csv").read_bytes()
    (tmp_path / "map.toml").write_text(
        MAP.replace('"first"', '"dive"').replace('"vehicle.toml"', '"remus100"')
    )
    line = ["trial", "import", str(tmp_path / "dive.csv"), "--map", str(tmp_path / "map.toml")]
    assert run([*line, "--out", str(tmp_path)]) == 2
    assert "is one of the logs" in capsys.readouterr().err
    assert (tmp_path / "dive.csv").read_bytes() == log and not (tmp_path / "trial.toml").exists()


@pytest.mark.parametrize(("name", "told"), [("bundle", True), ("dive", False), ("second", False)])
def test_a_trial_imported_by_the_map_of_another_tells_whose_name_it_has(bundle, tmp_path, capsys, name, told):
    out, (*words, _) = bundle
    (out / "map.toml").write_text(MAP.replace('name = "dive"  # mine', f'name = "{name}"'))
    capsys.readouterr()
    assert run([*words, str(tmp_path / "second")]) == 0
    said = capsys.readouterr().out
    assert ("the trial is called 'bundle'" in said) is told
    assert load_trial(tmp_path / "second").name == name
