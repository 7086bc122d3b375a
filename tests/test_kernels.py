"""Printed kernels: what their digest depends on, where they are kept, and what is refused there."""

import os
import shutil
import stat
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

import pytest
from golden_kernel import PATH, PUSH, golden_text
from numba.core.errors import TypingError

from bayesid.equations import KernelSpec, compiled
from bayesid.equations.compiled import forgive
from bayesid.equations.dynamics import build
from bayesid.equations.kernel_cache import cache_folder, is_sound, refuse_others, stored
from bayesid.equations.kernel_digest import cache_key, equations_digest, printer_digest
from bayesid.equations.runtime import _imported
from bayesid.errors import CacheError
from bayesid.model.effects import CATALOGUE
from bayesid.model.terms import TERMS

HERE = Path(__file__).resolve().parents[1]
PLANAR = KernelSpec(3)
POSIX = pytest.mark.skipif(not hasattr(os, "geteuid"), reason="owners and modes are those of POSIX")


# ---- the printer ----------------------------------------------------------------------------------------
def test_the_golden_kernel_is_what_the_printer_prints():
    assert golden_text() == PATH.read_text("utf-8"), "python tests/golden_kernel.py; git diff"


def test_no_printed_kernel_is_part_of_the_package():
    assert not [p.name for p in (HERE / "bayesid").rglob("*.py") if "Printed by" in p.read_text("utf-8")[:99]]


# ---- what a digest depends on ---------------------------------------------------------------------------
def digest(effects=CATALOGUE, rows=TERMS):
    with patch("bayesid.equations.layout.TERMS", rows), patch("bayesid.equations.dynamics.TERMS", rows):
        return equations_digest(build(PLANAR, effects, active=True), effects)


def key(effects=CATALOGUE, rows=TERMS):
    with patch("bayesid.equations.layout.TERMS", rows):
        return cache_key(PLANAR, effects)


def with_row(name, **changes):
    return tuple(replace(row, **changes) if row.name == name else row for row in TERMS)


def with_push(**changes):
    return (*CATALOGUE, replace(PUSH, **changes))


def test_wording_changes_neither_digest_nor_key():
    """Sources, magnitudes and the words about a parameter."""
    rows = with_row("Y_v", source="assumed: another wording")
    reworded = tuple(replace(p, about="other words", sd=2 * p.sd, shape=True) for p in PUSH.parameters)
    worded = with_push(source="assumed: other", magnitude="none", aliases=("shove",), parameters=reworded)
    assert (digest(rows=rows), key(rows=rows)) == (digest(), key())
    assert (digest(worded), key(worded)) == (digest(with_push()), key(with_push()))


def test_how_a_parameter_is_sought_changes_neither_digest_nor_key():
    """A time of a run is one in the equations as they are written, marked as such or not."""
    kinked = replace(
        PUSH, smooth=False, parameters=(*PUSH.parameters, replace(PUSH.parameters[0], name="t0"))
    )
    size, time = kinked.parameters
    dated = replace(kinked, parameters=(size, replace(time, dated=True)))
    assert (digest((dated,)), key((dated,))) == (digest((kinked,)), key((kinked,)))


OTHER_EQUATIONS = {
    "as it is": (CATALOGUE, TERMS),
    "another regressor": (CATALOGUE, with_row("Y_v", regressor="v*abs(u)")),
    "a row less": (CATALOGUE, tuple(row for row in TERMS if row.name != "Y_v|v|")),
    "an effect more": (with_push(), TERMS),
    "another equation": (with_push(force={"Y": "2*F"}), TERMS),
    "another axis": (with_push(force={"N": "F"}), TERMS),
    "another off value": (with_push(parameters=(replace(PUSH.parameters[0], off=1.0),)), TERMS),
}


def test_every_change_of_an_equation_has_its_own_digest_and_key():
    for identity in (digest, key):
        found = {name: identity(*changed) for name, changed in OTHER_EQUATIONS.items()}
        assert len(set(found.values())) == len(found), found


def test_the_digest_is_that_of_the_equations_not_of_the_order_they_are_written_in():
    flipped = with_row("Y_v|v|", regressor="abs(v)*v")
    assert digest(rows=flipped) == digest()


@pytest.mark.thorough
def test_an_edited_printer_prints_anew_but_leaves_the_digest(tmp_path):
    """A comment more in the printer: another text may follow, the equations are the same."""
    shutil.copytree(HERE / "bayesid", tmp_path / "bayesid", ignore=shutil.ignore_patterns("__pycache__"))
    path = tmp_path / "bayesid" / "equations" / "generate.py"
    path.write_text(path.read_text("utf-8").replace("\n\n\n", "\n\n# a comment\n\n\n"), encoding="utf-8")
    edited = told(process(tmp_path, root=tmp_path))
    assert edited["digest"] == digest(with_push())
    assert key(with_push()) not in edited["file"] and printer_digest(path.parent) != printer_digest()


# ---- the cache ------------------------------------------------------------------------------------------
PROGRAM = """
import sys
from bayesid.model.effects import Effect, EffectParameter
from bayesid.equations import Declared, KernelSpec, load_kernel
push = Effect(name="push", family="push", port="force", where=("Y",), source="assumed: a test",
              magnitude="any", parameters=(EffectParameter("F", "N", 1.0, about="force to starboard"),),
              force={"Y": "F"})
kernel = load_kernel(KernelSpec(3), (Declared(push),))
assert "push.F" in kernel.parameters
print(kernel.digest, kernel.full.module.__file__, "bayesid.equations.generate" in sys.modules, sep="\\n")
"""


def process(folder, root=HERE):
    return subprocess.Popen(
        [sys.executable, "-c", PROGRAM],
        cwd=folder, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        env={**os.environ, "PYTHONPATH": str(root), "BAYESID_CACHE": str(folder)},
    )  # fmt: skip


def told(run):
    out, err = run.communicate(timeout=120)
    assert run.returncode == 0, err
    return {**dict(zip(("digest", "file", "printed"), out.splitlines(), strict=True)), "err": err}


@pytest.fixture
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("BAYESID_CACHE", str(tmp_path))
    return tmp_path / "bayesid" / "kernels"


@pytest.mark.thorough
def test_processes_that_start_at_once_print_one_file_and_a_later_one_prints_none(tmp_path):
    both = [process(tmp_path), process(tmp_path)]
    answers = [told(run) for run in both]
    files = [p for p in (tmp_path / "bayesid" / "kernels").iterdir() if p.is_file()]
    assert [p.suffix for p in files] == [".py"]
    before, later = files[0].stat(), told(process(tmp_path))
    assert {(a["digest"], a["file"]) for a in (*answers, later)} == {(later["digest"], str(files[0]))}
    assert "True" in {a["printed"] for a in answers} and later["printed"] == "False"
    assert (files[0].stat().st_ino, files[0].stat().st_mtime_ns) == (before.st_ino, before.st_mtime_ns)


DAMAGE = {
    "cut short": lambda text: text[: len(text) // 2],
    "empty": lambda text: b"",
    "one digit": lambda text: text.replace(b"ONE = 1", b"ONE = 7", 1),
}


@pytest.mark.parametrize("damage", DAMAGE.values(), ids=DAMAGE)
def test_a_damaged_text_is_printed_again_and_keeps_its_compiled_part(cache, damage):
    """The same text has the same time and size, by which numba and Python know a stale compiled part."""
    path = stored("kernel", lambda: "ONE = 1\n" * 9)
    before, whole = path.stat(), path.read_bytes()
    path.write_bytes(damage(whole))
    assert not is_sound(path)
    assert stored("kernel", lambda: "ONE = 1\n" * 9) == path
    assert path.read_bytes() == whole
    assert (path.stat().st_mtime, path.stat().st_size) == (before.st_mtime, before.st_size)


TWICE = "from numba import njit\n@njit(cache=True)\ndef twice(x):\n    return 2.0 * x\n"


def hits_and_misses():
    """Of numba's cache, by a module imported once more, as a new session does."""
    module = _imported("kernel", stored("kernel", lambda: TWICE))
    forgive(module)
    assert module.twice(3.0) == 6.0
    return sum(module.twice.stats.cache_hits.values()), sum(module.twice.stats.cache_misses.values())


def test_compiled_parts_outlive_the_session_and_the_text_but_not_their_own_damage(cache):
    assert hits_and_misses() == (0, 1)
    assert hits_and_misses() == (1, 0)
    (cache / "kernel.py").unlink()
    assert hits_and_misses() == (1, 0), "the same text printed again needs no compiler"
    for suffix in ("nbi", "nbc"):
        (part,) = (cache / "__pycache__").glob(f"kernel.*.{suffix}")
        for kept in (40, 0):
            part.write_bytes(part.read_bytes()[:kept])
            assert hits_and_misses() == (0, 1), f"{suffix} cut to {kept} bytes"
            assert hits_and_misses() == (1, 0), f"{suffix} cut to {kept} bytes"


COMPILES = """
import sys
from bayesid.equations import compiled
from bayesid.equations.compiled import forgive
from bayesid.equations.kernel_cache import stored
from bayesid.equations.runtime import _imported
module = _imported("kernel", stored("kernel", lambda: sys.argv[1]))
forgive(module)
print("begun", flush=True)
assert module.twice(3.0) == 6.0
print(sum(module.twice.stats.cache_hits.values()), sum(module.twice.stats.cache_misses.values()))
"""


def compiling(cache):
    return subprocess.Popen(
        [sys.executable, "-c", COMPILES, TWICE], text=True, stdout=subprocess.PIPE,
        env={**os.environ, "PYTHONPATH": str(HERE), "BAYESID_CACHE": str(cache.parent.parent)},
    )  # fmt: skip


@POSIX
def test_a_process_waits_for_another_that_compiles_the_same_function_and_takes_its_part(cache):
    module = _imported("kernel", stored("kernel", lambda: TWICE))
    forgive(module)
    assert module.twice._cache._turn.take()  # as a process does that compiles it
    waits = compiling(cache)
    assert waits.stdout.readline() == "begun\n"
    with pytest.raises(subprocess.TimeoutExpired):
        waits.wait(timeout=1.5)
    assert module.twice(3.0) == 6.0  # compiled, kept, and the turn is given
    assert waits.communicate(timeout=60)[0] == "1 0\n"
    # nor is it kept where compiling fails
    text = "from numba import njit\n@njit(cache=True)\ndef broken(x):\n    return x + 'no number'\n"
    broken = _imported("failing", stored("failing", lambda: text))
    forgive(broken)
    with pytest.raises(TypingError):
        broken.broken(1.0)
    assert broken.broken._cache._turn._handle < 0
    # a turn ends with its process
    forgive(module)
    module.twice._cache._turn.take()
    module.twice._cache.flush()
    waits = compiling(cache)
    os.close(module.twice._cache._turn._handle)
    assert waits.communicate(timeout=60)[0] == "begun\n0 1\n"


@POSIX
def test_who_compiles_for_too_long_is_not_waited_for(cache, monkeypatch):
    monkeypatch.setattr(compiled, "_LONGEST_WAIT", 0.3)
    module = _imported("kernel", stored("kernel", lambda: TWICE))
    forgive(module)
    module.twice._cache._turn.take()
    stopped = module.twice._cache
    forgive(module)  # nothing: it is forgiving already
    assert module.twice._cache is stopped
    again = compiled._Forgiving(module.twice.py_func)
    assert again.load_overload(None, None) is None and again._turn._handle < 0


# ---- who may write there --------------------------------------------------------------------------------
@POSIX
def test_the_cache_is_closed_to_others_whatever_the_umask(cache):
    before = os.umask(0)
    try:
        path = stored("kernel", lambda: "ONE = 1\n")
    finally:
        os.umask(before)
    for one in (path, path.parent, path.parent / "__pycache__", path.parent.parent):
        assert stat.S_IMODE(one.stat().st_mode) & 0o077 == 0, one


PLACES = ("../..", "..", ".", "__pycache__", "kernel.py", "__pycache__/kernel.f.nbi")


@POSIX
@pytest.mark.parametrize("mode", [0o020, 0o002])
@pytest.mark.parametrize("place", PLACES)
def test_what_others_may_write_to_is_refused_with_the_next_move(cache, place, mode):
    """Even if sound: a digest that lies beside a file protects from damage, not from people."""
    stored("kernel", lambda: "ONE = 1\n")
    (cache / "__pycache__" / "kernel.f.nbi").touch(mode=0o600)
    for folder in (cache, cache / "__pycache__"):
        folder.chmod(0o755)  # others may look in
    path = (cache / place).resolve()
    path.chmod(stat.S_IMODE(path.stat().st_mode) | mode)
    with pytest.raises(CacheError, match=r"others may write to it \(mode \d+\).*BAYESID_CACHE") as refused:
        stored("kernel", lambda: "ONE = 1\n")
    assert str(refused.value).startswith(f"{path}: ")
    path.chmod(stat.S_IMODE(path.stat().st_mode) & ~0o022)
    stored("kernel", lambda: pytest.fail("printed again"))


@POSIX
def test_a_file_of_another_user_is_refused_unless_the_superuser_owns_it(tmp_path):
    owner = tmp_path.stat().st_uid
    refuse_others(tmp_path, uid=owner)
    if owner == 0:
        refuse_others(tmp_path, uid=12345)
        os.chown(tmp_path, 12345, -1)
        owner = 12345
    with pytest.raises(CacheError, match=f"belongs to user {owner} and you are user 54321"):
        refuse_others(tmp_path, uid=54321)


@POSIX
def test_a_shared_folder_in_which_nobody_replaces_what_is_not_theirs_will_do(cache):
    """As /tmp."""
    cache.parent.parent.chmod(0o1777)
    assert is_sound(stored("kernel", lambda: "ONE = 1\n"))


@pytest.mark.thorough
@POSIX
def test_the_command_line_refuses_in_one_message(tmp_path):
    tmp_path.chmod(0o777)
    command = [sys.executable, "-m", "bayesid", "simulate", "generic_sub", "zigzag:10/10"]
    environment = {**os.environ, "PYTHONPATH": str(HERE), "BAYESID_CACHE": str(tmp_path)}
    done = subprocess.run(command, env=environment, capture_output=True, text=True)
    assert done.returncode == 2 and done.stdout == ""
    assert done.stderr.startswith("bayesid: ") and "Traceback" not in done.stderr
    assert "BAYESID_CACHE" in done.stderr


# ---- nowhere to write -----------------------------------------------------------------------------------
def test_a_cache_that_cannot_be_written_is_no_obstacle(tmp_path):
    """A file in place of the folder stops even the superuser; what served instead goes with the process."""
    (tmp_path / "bayesid").write_text("in the way")
    answer = told(process(tmp_path))
    assert "BAYESID_CACHE" in answer["err"]
    assert not Path(answer["file"]).exists() and not Path(answer["file"]).parent.exists()


FULL = """
import resource, signal, sys
from bayesid.cli.entry import main
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (2000, 2000))
main(["simulate", "remus100", "turn:10", "--out", sys.argv[1], "--quiet"])
"""


@pytest.mark.thorough
@POSIX
def test_a_full_disk_for_kernels_is_told_with_its_file(tmp_path):
    environ = {**os.environ, "BAYESID_CACHE": str(tmp_path / "cache"), "TMPDIR": str(tmp_path)}
    done = subprocess.run(
        [sys.executable, "-c", FULL, str(tmp_path / "out")], env=environ, capture_output=True, text=True,
        timeout=120,
    )  # fmt: skip
    assert done.returncode == 2
    assert done.stderr.splitlines()[-1].startswith(f"bayesid: {tmp_path}/bayesid-kernels-")
    assert done.stderr.endswith(".py: File too large\n")


@POSIX
def test_without_a_home_a_private_folder_serves(monkeypatch):
    for name in ("BAYESID_CACHE", "XDG_CACHE_HOME", "HOME"):
        monkeypatch.delenv(name, raising=False)
    assert cache_folder() is None
    with pytest.warns(UserWarning, match=r"there is no home folder; set BAYESID_CACHE"):
        path = stored("kernel", lambda: "ONE = 1\n")
    assert is_sound(path) and path.parent.stat().st_mode & 0o077 == 0


def test_the_folder_follows_the_environment(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "xdg"))
    monkeypatch.delenv("BAYESID_CACHE", raising=False)
    assert cache_folder() == tmp_path / "xdg" / "bayesid" / "kernels"
    monkeypatch.setenv("BAYESID_CACHE", str(tmp_path / "own"))
    assert cache_folder() == tmp_path / "own" / "bayesid" / "kernels"
