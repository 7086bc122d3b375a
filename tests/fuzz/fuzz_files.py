"""Coverage-guided fuzz of trial and vehicle files: only a result or the package's own error may come out.

    pip install atheris
    python tests/fuzz/fuzz_files.py CORPUS_FOLDER -max_total_time=1800 -rss_limit_mb=2048 -timeout=20

An input is one byte choosing the target (t, c or v) and a file: trial.toml, CSV or vehicle.toml; a trial may
carry its CSV after a line of %%%%. Python warnings count as failures, since a user would see them. Without
atheris (or with `--plain SECONDS`) random mutations of the seeds are tried.
"""

from __future__ import annotations

import random
import sys
import tempfile
import time
import warnings
from collections.abc import Callable
from pathlib import Path

try:
    import atheris
except ImportError:
    atheris = None

if atheris is not None and __name__ == "__main__":
    with atheris.instrument_imports(include=["bayesid"]):
        from bayesid.errors import TrialError, VehicleError
        from bayesid.model.vehicles import coef_si, load_vehicle
        from bayesid.trials import load_trial, trial_summary
else:
    from bayesid.errors import TrialError, VehicleError
    from bayesid.model.vehicles import coef_si, load_vehicle
    from bayesid.trials import load_trial, trial_summary

SPLIT = b"\n%%%%\n"
CSV = b"""t[s],x[m],y[m],psi[deg],r[deg/s],u[m/s],v[m/s],delta_r_cmd[deg],n_cmd[rpm]
0.0,0.0,0.0,358.9,0.1,1.50,0.01,0.0,600
0.5,0.75,0.01,359.5,0.2,1.49,-0.01,5.0,600
1.0,1.5,,0.2,nan,1.5,0.0,5.0,
1.5,2.25,0.03,1.0,0.3,1.51,0.01,-5.0,600
"""
TOML = b"""format = 1
name = "seed"
vehicle = "remus100"
dof = 3
measured_point = [0.1, 0.0, 0.0]
rudder_positive = "starboard"
time_repair = "sort"
[noise]
x = 0.1
"psi[deg]" = 0.5
[environment]
force_rms = 0.0
nav_drift = 0.1
[columns]
"u[kn]" = "Speed (kn)"
[[runs]]
file = "r1.csv"
manoeuvre = "zigzag 10/10"
role = "identify"
window = [0.0, 2.0]
"""
VEHICLE = b"""[vehicle]
name = "seed"
nondimensional = true
plain_abs = true
rho = 1000.0
L = 2.0
mass = 30.0
Ixx = 0.2
Iyy = 3.5
Izz = 3.5
r_G = [0.0, 0.0, 0.01]
U_ref = 1.0
[control]
dr_max_deg = 20.0
rate_deg_s = 10.0
[propulsion]
model = "thrust"
T_ref = 3.9
rpm_ref = 1500.0
[coef]
X_udot = -0.001
"X_u|u|" = -0.002
Y_v = -0.03
Y_vvv = -0.1
N_r = -0.01
Y_dr = 0.01
N_dr = -0.005
[prior]
relative_sd = 0.1
"""


def _long_row(k: int) -> bytes:
    row = (0.5 * k, 0.7 * k, 0.01 * k * k, 0, 0.1, 0.1 * (k % 3), 0.02 * k, 1.5, 0.01 * (k % 5), 0, 0)
    row += (0.1 * (k % 4), 2.3 + 0.1 * (k % 7), 5 if k % 20 < 10 else -5, 1, 10, 4.0, 3, 90 + k, 7)
    return b",".join(b"%.6g" % value for value in row)


LONG = (
    b"t[s],x[m],y[m],z[m],phi[deg],theta[deg],psi[rad],u[m/s],v[m/s],w[m/s],p[rad/s],q[deg/s],r[deg/s],"
    b"delta_r[deg],delta_s_cmd[deg],n[1/s],thrust[N],wind_speed[m/s],wind_from[deg],note\n"
) + b"\n".join(_long_row(k) for k in range(80))
SEEDS = (
    b"c" + CSV,
    b"c" + LONG,
    b"t" + TOML + SPLIT + LONG,
    b"c" + CSV.replace(b",", b";").replace(b".", b","),
    b"c\xef\xbb\xbf" + CSV.replace(b"\n", b"\r\n"),
    b"c" + CSV.replace(b"psi[deg]", b"psi[furlong/fortnight]").replace(b"[m/s]", b"[fathom/s]"),
    b"t" + TOML + SPLIT + CSV,
    b"t" + TOML + SPLIT + CSV.replace(b"u[m/s]", b"Speed (kn)"),
    b"t" + TOML.replace(b"remus100", b"9" * 300) + SPLIT + CSV,
    b"v" + VEHICLE,
)
ODD = (
    *(b"nan", b"inf", b"-1e308", b"1e999", b"", b"\0", b"\xff", b"[", b"]", b'"', b",", b"\n", b"\r", b"1_0"),
    *(b"0x1", b"9" * 400, b"../x", b"[[runs]]\n", b"= ", b"true", b"{}", b"'''", b"\xe2\x88\x9e"),
)
_FOLDER = Path(tempfile.mkdtemp(prefix="bayesid-fuzz-"))


def try_one(data: bytes) -> str:
    """Feed one input; returns "ok" or "refused", lets anything else escape."""
    kind, body = data[:1], data[1:]
    try:
        if kind == b"v":
            (_FOLDER / "vehicle.toml").write_bytes(body)
            coef_si(load_vehicle(_FOLDER / "vehicle.toml"))
        else:
            toml, csv = TOML, body
            if kind == b"t":
                toml, _, csv = body.partition(SPLIT)
            (_FOLDER / "trial.toml").write_bytes(toml)
            (_FOLDER / "r1.csv").write_bytes(csv)
            trial_summary(load_trial(_FOLDER))
    except (TrialError, VehicleError) as error:
        assert str(error)
        return "refused"
    return "ok"


def mutate(data: bytes, rng: random.Random) -> bytes:
    """One to five edits of the kind files suffer: bytes, lines, numbers, cuts, repeats."""
    out = bytearray(data)
    for _ in range(rng.randint(1, 5)):
        k = rng.randrange(1, len(out)) if len(out) > 1 else 0
        way = rng.randrange(6)
        if way == 0 and out:
            out[k] = rng.randrange(256)
        elif way == 1:
            out[k:k] = rng.choice(ODD)
        elif way == 2:
            del out[k : k + rng.randint(1, 20)]
        elif way == 3:
            lines = bytes(out).split(b"\n")
            j = rng.randrange(len(lines))
            lines[j:j] = [lines[rng.randrange(len(lines))]] * rng.randint(1, 3)
            out = bytearray(b"\n".join(lines))
        elif way == 4:
            cells = bytes(out).split(b",")
            cells[rng.randrange(len(cells))] = rng.choice(ODD)
            out = bytearray(b",".join(cells))
        else:
            del out[k:]
    return bytes(out)


def plain(seconds: float, corpus: list[bytes], report: Callable[[str], None] = print) -> int:
    """Random mutations for a number of seconds; returns how many inputs were tried."""
    rng = random.Random(20030601)
    tried, end = 0, time.monotonic() + seconds
    pool = [*SEEDS, *corpus]
    while time.monotonic() < end:
        data = mutate(rng.choice(pool), rng)
        try:
            try_one(data)
        except Exception:
            report(f"input {tried}: {data!r}")
            raise
        tried += 1
    report(f"{tried} inputs tried, none escaped")
    return tried


def main() -> None:
    warnings.simplefilter("error")
    if atheris is None or "--plain" in sys.argv:
        at = sys.argv.index("--plain") + 1 if "--plain" in sys.argv else len(sys.argv)
        plain(float(sys.argv[at]) if at < len(sys.argv) else 60.0, [])
        return
    folders = [Path(text) for text in sys.argv[1:] if not text.startswith("-")]
    if folders:
        folders[0].mkdir(parents=True, exist_ok=True)
        for k, seed in enumerate(SEEDS):
            (folders[0] / f"seed{k}").write_bytes(seed)
    atheris.Setup(sys.argv, try_one_quietly)
    atheris.Fuzz()


def try_one_quietly(data: bytes) -> None:
    try_one(data)


if __name__ == "__main__":
    main()
