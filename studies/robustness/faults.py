"""Faults of the machine: a full disk, an output that is none or goes, no home, clocks, damaged files.

Takes a bundle. Gives one row per fault: the command, its exit code, whether that was right, its last words.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from studies.robustness.same_files import different

BLOCKS = 8  # of 512 or 1024 bytes: no file may become longer, as on a full disk
NUMBERS = ("fit.json",)
DISKS = (32, 128, 256, 448)  # kB
LOOK, LONGEST = 0.02, 900.0  # s
# The wall clock goes back by an hour with every tenth look, and once by a day.
CLOCK = """
import itertools, runpy, sys, time
true, looks = time.time, itertools.count()
time.time = lambda: true() - (3600.0 if next(looks) % 10 else 90000.0)
sys.argv = ["bayesid", *sys.argv[1:]]
runpy.run_module("bayesid", run_name="__main__", alter_sys=True)
"""
SPOIL: dict[str, Callable[[bytes], bytes]] = {
    "empty": lambda b: b"", "cut": lambda b: b[: len(b) // 2], "other bytes": lambda b: b"\0" * len(b),
}  # fmt: skip


def fault_rows(bundle: Path, work: Path) -> list[dict[str, Any]]:
    """Every fault once."""
    shutil.rmtree(work, ignore_errors=True)
    work.mkdir(parents=True)
    (work / "file").write_text("")
    simulate = ("simulate", "remus100", "turn:10", "--dt", "1")
    fit = ("fit", str(bundle), "--free", "N_dr,N_r,N_v", "--quick")
    diagnose = ("diagnose", str(bundle), "--quick")
    rows = []
    for name, line in {"simulate": simulate, "fit": fit, "diagnose": diagnose}.items():
        full = work / f"full-{name}"
        row = _row("disk full", name, {2}, _run((*line, "--out", str(full)), full=True))
        # a disk that is full is found by its path
        rows.append(row | {"ok": row["ok"] and str(full) in row["words"]})
        for fault, place in {
            "output below a file": work / "file" / "x",
            "read-only output": Path("/proc/x"),
        }.items():
            rows.append(_row(fault, name, {2}, _run((*line, "--out", str(place)))))
    bare = {k: v for k, v in os.environ.items() if k not in ("HOME", "XDG_CACHE_HOME", "BAYESID_CACHE")}
    for name, line in {"simulate": simulate, "fit": fit}.items():
        found = _run((*line, "--out", str(work / f"home-{name}")), bare)
        rows.append(_row("HOME not set", name, {0, 3}, found))
    rows += _caches(simulate, work)
    rows += _logs(fit, work)
    sample = ("sample", *fit[1:-1], "--max-steps", "100", "--memory", "ignore")
    rows += _full_disks(
        {"simulate": simulate, "fit": fit, "diagnose": diagnose, "sample, emcee": sample}, work
    )
    rows += _full_streams(work)
    kept = {
        "fit": (fit, NUMBERS, "iterates.jsonl", ()),
        "diagnose": (diagnose, ("diagnosis.json",), "refits/*.npz", ()),
        "sample, emcee": (sample, ("posterior.nc",), "chain/*.h5", ("--resume",)),
    }  # fmt: skip
    for name, (line, files, at_work, again) in kept.items():
        rows += _while_at_work(name, line, files, at_work, again, work)
    return [row | {"words": row["words"].replace(str(work), "WORK")} for row in rows]


def _full_disks(lines: dict[str, Sequence[str]], work: Path) -> list[dict[str, Any]]:
    """A disk of its own that is too small, or read-only, where this user may mount one for a command."""
    place = work / "disk"
    place.mkdir()
    rows: list[dict[str, Any]] = []
    for name, line in lines.items():
        for options, fault in [(f"size={kb}k", f"disk of {kb} kB full") for kb in DISKS] + [
            ("ro", "read-only disk")
        ]:
            mount = f'mount -t tmpfs -o {options} tmpfs "$0" && exec "$@"'
            whole = ["unshare", "-rm", "sh", "-c", mount, str(place)]
            if subprocess.run([*whole, "true"], capture_output=True).returncode:
                return rows
            found = _run((*line, "--out", str(place / "out")), before=whole)
            row = _row(fault, name, {2}, found)
            if found[0] == 0 and options != "ro":  # it had room enough
                continue
            rows.append(row | {"ok": row["ok"] and str(place) in row["words"]})
    return rows


def _full_streams(work: Path) -> list[dict[str, Any]]:
    """Standard output or error written to a full disk."""
    rows: list[dict[str, Any]] = []
    for stream, line, codes in (
        ("output", ("vehicle", "list"), {2}),
        ("error", ("vehicle", "list"), {0}),
        ("error", ("fit", str(work / "nothing")), {2}),
    ):
        with open("/dev/full", "w") as full:
            out, err = (full, subprocess.PIPE) if stream == "output" else (subprocess.DEVNULL, full)
            found = subprocess.run(
                [sys.executable, "-m", "bayesid", *line], stdout=out, stderr=err, text=True, timeout=LONGEST
            )
        code, words = found.returncode, found.stderr or ""
        ok = code in codes and (stream == "error" or "standard output" in words)
        fault = f"standard {stream} on a full disk"
        rows.append({"fault": fault, "command": line[0], "code": code, "ok": ok, "words": words.strip()})
    return rows


def _while_at_work(
    name: str,
    line: Sequence[str],
    files: Sequence[str],
    at_work: str,
    again: Sequence[str],
    work: Path,
) -> list[dict[str, Any]]:
    """A clock set back, the output gone, and what a killed command leaves damaged before it goes on.

    at_work : pattern of what it writes on its way
    """
    place = name.replace(", ", "-")
    good = work / f"good-{place}"
    _run((*line, "--out", str(good)))
    out = work / f"clock-{place}"
    found = subprocess.run(
        [sys.executable, "-c", CLOCK, *line, "--out", str(out)],
        capture_output=True,
        text=True,
        timeout=LONGEST,
    )
    row = _row("clock set back", name, {0, 3}, (found.returncode, found.stderr))
    rows = [row | _same(row, good, out, files)]
    out = work / f"gone-{place}"
    met, code, words = _struck(line, out, at_work, lambda child: shutil.rmtree(out))
    row = _met(met, _row("output removed on the way", name, {0, 2, 3}, (code, words)))
    rows.append(row | (_same(row, good, out, files) if code != 2 else {}))
    for way, spoil in SPOIL.items():
        out = work / f"spoilt-{place}-{way}".replace(" ", "-")
        met, _, _ = _struck(line, out, at_work, lambda child: child.kill())
        for path in out.glob(at_work):
            path.write_bytes(spoil(path.read_bytes()))
        row = _row(f"killed, {at_work} {way}", name, {0, 2, 3}, _run((*line, "--out", str(out), *again)))
        row = _met(met, row)
        rows.append(row | (_same(row, good, out, files) if row["code"] != 2 else {}))
    return rows


def _struck(
    line: Sequence[str], out: Path, at_work: str, strike: Callable[[subprocess.Popen[str]], None]
) -> tuple[bool, int, str]:
    """A command struck once it has written two files, or three lines of its one file; whether it was."""
    child = subprocess.Popen(
        [sys.executable, "-m", "bayesid", *line, "--out", str(out)],
        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    met = False
    while child.poll() is None:
        written = list(out.glob(at_work))
        if len(written) > 1 or (len(written) == 1 and written[0].read_bytes().count(b"\n") > 2):
            strike(child)
            met = True
            break
        time.sleep(LOOK)
    words = child.communicate(timeout=LONGEST)[1]
    return met, child.returncode, words


def _met(met: bool, row: dict[str, Any]) -> dict[str, Any]:
    """A fault that came too late was none."""
    return row if met else row | {"ok": False, "words": "the command ended before it was struck"}


def _caches(simulate: Sequence[str], work: Path) -> list[dict[str, Any]]:
    """Every file of the cache of kernels spoilt in one way, then the same command."""
    cache = work / "cache"
    env = {**os.environ, "BAYESID_CACHE": str(cache)}
    cache.mkdir(mode=0o700)
    good = work / "good"
    _run((*simulate, "--out", str(good)), env)
    rows = []
    for way, spoil in SPOIL.items():
        for suffix in (".nbi", ".nbc", ".pyc"):
            for path in cache.rglob("*" + suffix):
                path.write_bytes(spoil(path.read_bytes()))
            out = work / f"cache-{way}-{suffix}".replace(" ", "-")
            row = _row(
                f"cache damaged: {suffix} {way}", "simulate", {0}, _run((*simulate, "--out", str(out)), env)
            )
            rows.append(row | _same(row, good, out, ["*.csv"]))
    return rows


def _logs(fit: Sequence[str], work: Path) -> list[dict[str, Any]]:
    """The log of iterates of a fit spoilt, then the fit again."""
    good = work / "fit"
    _run((*fit, "--out", str(good)))
    rows = []
    for way, text in {"empty": b"", "no JSON": b"\xff{]\n", "other costs": None}.items():
        out = work / f"log-{way}".replace(" ", "-")
        out.mkdir()
        kept = (good / "iterates.jsonl").read_bytes()
        spoilt = kept.replace(b'"cost": ', b'"cost": 7') if text is None else text
        (out / "iterates.jsonl").write_bytes(spoilt)
        row = _row(f"iterates damaged: {way}", "fit", {0, 3}, _run((*fit, "--out", str(out))))
        rows.append(row | _same(row, good, out, NUMBERS))
    return rows


def _same(row: dict[str, Any], good: Path, out: Path, files: Sequence[str]) -> dict[str, Any]:
    apart = different(good, out, files)
    return {"ok": row["ok"] and not apart, "words": "; ".join(apart) or row["words"]}


def _run(
    arguments: Sequence[str],
    env: dict[str, str] | None = None,
    full: bool = False,
    before: Sequence[str] = (),
) -> tuple[int, str]:
    line = [*before, sys.executable, "-m", "bayesid", *arguments]
    if full:
        line = ["sh", "-c", f"trap '' XFSZ; ulimit -f {BLOCKS}; exec \"$@\"", "sh", *line]
    found = subprocess.run(line, capture_output=True, text=True, env=env, timeout=900)
    return found.returncode, found.stderr


def _row(fault: str, command: str, codes: set[int], found: tuple[int, str]) -> dict[str, Any]:
    code, err = found
    said = [x for x in err.strip().splitlines() if x.strip()]
    ok = code in codes and "Traceback" not in err and "unexpected" not in err
    if codes == {2}:
        ok = ok and bool(said)
    return {
        "fault": fault,
        "command": command,
        "code": code,
        "ok": ok,
        "words": said[-1][-300:] if said else "",
    }
