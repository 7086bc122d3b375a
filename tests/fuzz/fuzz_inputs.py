"""Every kind of input, mutated: only a result or the package's own error may come out, within a minute.

    python tests/fuzz/fuzz_inputs.py --seconds 600 [--seed 1] [--only map,set] [--out counts.json]

Trial, run, vehicle, its covariance (.npz), raw log, log map, manoeuvre table, texts of --set, --noise,
quantities and manoeuvres, and results read back: fit.json, model.json, iterates.jsonl, refits of a stopped
diagnosis. A Python warning counts as a failure, since a user would see it.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import random
import signal
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import typer

sys.path.insert(0, str(Path(__file__).parent))
import fuzz_files
from fuzz_files import ODD, SEEDS, VEHICLE, mutate

from bayesid.api.inputs import parameter_values, scale_of
from bayesid.cli.quantity import changes_of, noise_of, number_of
from bayesid.diagnosis.diagnosed_file import read_diagnosed, write_diagnosed
from bayesid.diagnosis.diagnosed_model import DiagnosedModel, WeightedHypothesis
from bayesid.equations.model import build_model
from bayesid.errors import BayesidError
from bayesid.estimation.filter_error.noise_identification import no_process_noise
from bayesid.estimation.output_error.fit_result import load_fit
from bayesid.files import read_lines, write_json
from bayesid.manoeuvres.registry import parse
from bayesid.manoeuvres.table import read_table
from bayesid.model.vehicles import load_vehicle
from bayesid.trials.importing.log_map import read_map
from bayesid.trials.importing.readers import read_log

HANG = 60  # s
MARKED = ("trial", "run", "vehicle")
TEXTS_A_ROUND = 20
MAP = b"""format = 1
name = "day"
vehicle = "remus100"
rudder_positive = "port"
dof = 3
world = "ned"
step = 0.5
origin = [50.9, -1.4, 0.0]
measured_point = [0.1, 0.0, 0.0]
[sources.nav]
files = ["nav.csv"]
time = "Time"
[channels.x]
from = "nav:X"
unit = "m"
[channels.psi]
from = "nav:Heading"
unit = "deg"
[noise]
x = 0.1
[environment]
force_rms = 0.0
[[runs]]
name = "r1"
files = ["nav.csv"]
window = [0.0, 60.0]
role = "identify"
manoeuvre = "zigzag 10/10"
"""
LOG = b"Time;X;Y;Heading;Rudder\n" + b"".join(
    b"2024-05-01 12:%02d:%02d;%.1f;0,5;%d;-5\n" % (k // 60, k % 60, 0.7 * k, 90 + k) for k in range(40)
)
TABLE = b"t[s],delta_r_cmd[deg],n_cmd[rpm]\n" + b"".join(
    b"%d,%d,600\n" % (k, 5 * (-1) ** k) for k in range(20)
)
TEXTS = {
    "set": (b"N_dr=-0.0045", b"rudder_offset.delta=2deg", b"ocean_current.V_north=0.2kn", b"N_r=-1e0"),
    "noise": (b"psi=0.3deg", b"x=1", b"u=0.02m/s", b"r=0.1deg/s"),
    "quantity": (b"0.3deg", b"500ms", b"5kn", b"2e3", b"20 degrees"),
    "manoeuvre": (b"zigzag:20/20", b"turn:25,side=starboard", b"prbs:seed=3", b"spiral"),
}  # fmt: skip


@dataclass
class Counted:
    """What came of the inputs of one kind; `escaped` holds what should not have, and the input."""

    tried: int = 0
    refused: int = 0
    hung: int = 0
    escaped: list[str] = field(default_factory=list)


class Hang(BaseException):
    """No answer in time; no handler of errors may swallow it."""


@contextlib.contextmanager
def within(seconds: int) -> Iterator[None]:
    def late(*_: Any) -> None:
        raise Hang

    before = signal.signal(signal.SIGALRM, late)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def kinds(folder: Path) -> dict[str, tuple[tuple[bytes, ...], Callable[[bytes], Any]]]:
    """Seeds and reader of every kind; the reader raises the package's own errors or none."""
    model = build_model(load_vehicle("remus100"), 3)
    scale = scale_of(model)

    def in_file(name: str, read: Callable[[Path], Any], data: bytes) -> None:
        path = folder / name
        path.write_bytes(data)
        read(path)

    def in_text(read: Callable[[str], Any], data: bytes) -> None:
        read(data.decode("utf-8", errors="replace"))

    found = {
        kind: (tuple(s for s in SEEDS if s[:1] in letters), fuzz_files.try_one)
        for kind, letters in (("trial", b"t"), ("run", b"c"), ("vehicle", b"v"))
    }
    found |= {
        "set": (TEXTS["set"], partial(in_text, lambda t: parameter_values(model, changes_of([t])))),
        "noise": (TEXTS["noise"], partial(in_text, lambda t: noise_of([t]))),
        "quantity": (TEXTS["quantity"], partial(in_text, lambda t: number_of(t, "rad"))),
        "manoeuvre": (TEXTS["manoeuvre"], partial(in_text, lambda t: parse(t, scale))),
        "map": (
            (MAP, *(MAP.replace(b"50.9", b"9" * n) for n in (400, 5000))),
            partial(in_file, "map.toml", read_map),
        ),
        "raw log": (
            (LOG, LOG.replace(b",", b".").replace(b";", b",")), partial(in_file, "raw.csv", read_log)
        ),
        "table": ((TABLE,), partial(in_file, "commands.csv", read_table)),
    }  # fmt: skip
    found |= _covariance(folder, in_file)
    found |= _results(folder, model, in_file)
    return found


def _covariance(folder: Path, in_file: Any) -> dict[str, Any]:
    place = folder / "npz"
    place.mkdir()
    stated = VEHICLE.replace(b"relative_sd = 0.1", b'covariance = "c.npz"')
    (place / "vehicle.toml").write_bytes(stated)
    out = []
    for save in (np.savez, np.savez_compressed):
        stream = io.BytesIO()
        save(stream, names=np.array(["Y_v", "N_r"]), covariance=np.diag([1e-4, 1e-6]))
        out.append(stream.getvalue())
    return {
        "npz": (tuple(out), partial(in_file, "npz/c.npz", lambda _: load_vehicle(place / "vehicle.toml")))
    }


def _results(folder: Path, model: Any, in_file: Any) -> dict[str, Any]:
    """Results of a small fit, as they are read back."""
    from bayesid.api.fit import fit
    from bayesid.api.simulate import simulate_model

    place, noise = folder / "fit", {"x": 0.1, "y": 0.1, "psi": 0.01}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        trial = simulate_model(model, "remus100", ("zigzag:10/10",), 1.0, None, None, noise, 0)
        fit(trial, out=place, free="N_dr,N_r", residuals="white", quick=True)
    which, sd = [model.index["N_dr"], model.index["N_r"]], np.array([0.1, 0.02])
    one = WeightedHypothesis(
        ("rudder_offset",), 1.0, ("N_dr", "N_r"), model.nominal[which], np.diag(sd**2),
        np.full(2, -np.inf), np.full(2, np.inf), no_process_noise(model),
    )  # fmt: skip
    write_diagnosed(DiagnosedModel(model, (one,), noise, "effect", "0" * 16), place)
    readers = {"fit.json": load_fit, "iterates.jsonl": read_lines}
    readers |= {"model.json": lambda path: read_diagnosed(path.parent)}
    return {
        name: (((place / name).read_bytes(),), partial(in_file, f"fit/{name}", read))
        for name, read in readers.items()
    } | _refits(folder, model)


def _refits(folder: Path, model: Any) -> dict[str, Any]:
    """A refit as a stopped diagnosis leaves it; one that cannot be read is none."""
    from bayesid.api.simulate import simulate_model
    from bayesid.estimation.filter_error.fit import fit
    from bayesid.estimation.filter_error.fit_journal import SUFFIX, fits_kept
    from bayesid.estimation.filter_error.read_run import filter_error_run
    from bayesid.estimation.parameters import coefficient_prior

    noise = {"x": 0.1, "y": 0.1, "psi": 0.01}
    trial = simulate_model(model, "remus100", ("turn:10",), None, None, None, noise, 0)
    logs = [filter_error_run(model, run, noise, tuple(noise)) for run in trial.runs]
    prior, quiet, place = coefficient_prior(model), no_process_noise(model), folder / "refits"
    with fits_kept(place) as journal:
        fit(model, logs, prior, quiet, iterations=1)
    assert journal is not None
    (path,) = place.glob("*" + SUFFIX)
    whole, key = path.read_bytes(), path.name.removesuffix(SUFFIX)

    def read(data: bytes) -> str:
        path.write_bytes(data)
        return "refused" if journal.read(key, model, logs, prior, quiet) is None else "ok"

    assert read(whole) == "ok"
    return {"refit": ((whole,), read)}


def mutate_text(data: bytes, rng: random.Random) -> bytes:
    """One or two characters changed, left out, doubled or put in."""
    out = bytearray(data)
    for _ in range(rng.randint(1, 2)):
        k = rng.randrange(len(out)) if out else 0
        way = rng.randrange(4)
        if way == 0 and out:
            out[k] = rng.choice(b"0123456789.=:,-+eE /dgkmnsx_\xff\x00")
        elif way == 1:
            del out[k : k + 1]
        elif way == 2:
            out[k:k] = out[k : k + rng.randint(1, 6)]
        else:
            out[k:k] = rng.choice(ODD)
    return bytes(out)


def try_input(read: Callable[[bytes], Any], data: bytes, counted: Counted) -> None:
    """One input, counted."""
    counted.tried += 1
    try:
        with warnings.catch_warnings(), within(HANG):
            warnings.simplefilter("error")
            counted.refused += read(data) == "refused"
    except (BayesidError, typer.BadParameter) as error:
        counted.refused += 1
        if not str(error):
            counted.escaped.append(f"no words: {data!r}")
    except Hang:
        counted.hung += 1
        counted.escaped.append(f"no answer in {HANG} s: {data!r}")
    except Exception as error:
        counted.escaped.append(f"{type(error).__name__}: {error}: {data!r}")


def fuzz(
    seconds: float, seed: int = 1, only: tuple[str, ...] = (), rounds: float = float("inf")
) -> dict[str, Counted]:
    """All kinds in turn for a time or a number of rounds; the same seed tries the same inputs."""
    rng = random.Random(seed)
    with tempfile.TemporaryDirectory(prefix="bayesid-fuzz-") as place:
        every = {k: v for k, v in kinds(Path(place)).items() if not only or k in only}
        found = {kind: Counted() for kind in every}
        for kind, (seeds, read) in every.items():  # as they are: at least one of them is good
            for given in seeds:
                try_input(read, given, found[kind])
        end = time.monotonic() + seconds
        while time.monotonic() < end and rounds > 0:
            rounds -= 1
            for kind, (seeds, read) in every.items():
                for _ in range(TEXTS_A_ROUND if kind in TEXTS else 4):
                    given = rng.choice(seeds)
                    if kind in TEXTS:
                        data = mutate_text(given, rng)
                    elif kind in MARKED:  # the first byte says the kind and is left alone
                        data = mutate(given, rng)
                    else:
                        data = mutate(b"." + given, rng)[1:]
                    try_input(read, data, found[kind])
    return found


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="")
    parser.add_argument("--out", type=Path)
    given = parser.parse_args()
    found = fuzz(given.seconds, given.seed, tuple(k for k in given.only.split(",") if k))
    for kind, c in found.items():
        print(f"{kind}: {c.tried} tried, {c.refused} refused, {c.hung} hung, {len(c.escaped)} escaped")
        for text in c.escaped[:3]:
            print(f"    {text[:600]}")
    tried, escaped = (sum(n) for n in zip(*((c.tried, len(c.escaped)) for c in found.values()), strict=True))
    print(f"{tried} inputs tried, {escaped} escaped")
    if given.out:
        write_json(given.out, {k: vars(c) | {"escaped": c.escaped[:20]} for k, c in found.items()})
    return int(any(c.escaped for c in found.values()))


if __name__ == "__main__":
    sys.exit(main())
