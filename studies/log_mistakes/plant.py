"""Mistakes planted into clean logs: the inverse of a correction, and those that have a size.

Takes a `Trial`; gives the trial as somebody would have logged it. Imports no judgement, only the correction.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from bayesid.trials import Run, Trial
from bayesid.trials.correction import EARTH_RADIUS, Correction, apply
from bayesid.trials.mistakes import MISTAKES
from bayesid.trials.mistakes.table import EXCHANGED

FAST_FIN = math.radians(60.0)  # per second, of small vehicles
Change = Callable[[Run, np.random.Generator], Run]


@dataclass(frozen=True)
class Planted:
    """A mistake to plant.

    Attributes
    ----------
    name : of the row
    change : a run as it would have been logged
    right : names of findings that are right
    needs : channels without which it cannot be planted
    kind : "input" where the verdict should say so, "effect" where the check stays silent, "note" where it
        remarks
    vehicle : whether only a vehicle tells it
    says : words of the remark
    noise : factor on the noise that is stated
    of : vehicle whose file is given for this log; its own where empty
    """

    name: str
    change: Change
    right: tuple[str, ...]
    needs: tuple[str, ...] = ()
    kind: str = "input"
    vehicle: bool = False
    says: str = ""
    noise: float = 1.0
    of: str = ""


def inverse(c: Correction) -> Correction:
    """What undoes a correction."""
    return Correction(
        rename={v: k for k, v in c.rename.items()},
        exchange=c.exchange,
        scale={k: 1.0 / v for k, v in c.scale.items()},
        heading_from=c.heading_from,
        offset={k: -v for k, v in c.offset.items()},
        from_time=c.from_time,
        late={k: -v for k, v in c.late.items()},
        time_scale=1.0 / c.time_scale,
    )


def _fixed(name: str) -> Planted:
    row = next(m for m in MISTAKES if m.name == name)
    assert row.correction is not None
    back = inverse(row.correction)
    needs = tuple(
        sorted({k.removesuffix("_cmd") for k in row.correction.channels if "_water" not in k} - {"t"})
    )

    def change(run: Run, rng: np.random.Generator) -> Run:
        # exchange, then scale and heading: the inverse goes the other way round
        # a heading that is scaled is not unwrapped: it was no heading when it was logged
        scaled = {k: v * back.scale["psi"] for k, v in run.data.items() if k == "psi" and k in back.scale}
        rest = {k: v for k, v in back.scale.items() if k not in scaled}
        first = replace(back, exchange=(), scale=rest)
        done = apply(Correction(exchange=back.exchange), apply(first, run))
        return replace(done, data={**done.data, **scaled}) if scaled and not back.exchange else done

    fins = {f"delta_{k}" for k in "rsb"} | {"n"}
    needs = tuple(k for k in needs if k not in fins)
    return Planted(
        name, change, (name,), needs, vehicle=name.startswith(("delta", "sign of delta", "n:", "n,"))
    )


def _geographic(run: Run, rng: np.random.Generator) -> Run:
    degree = math.degrees(1.0 / EARTH_RADIUS)
    x = 50.7 + run.data["x"] * degree
    y = -1.3 + run.data["y"] * degree / math.cos(math.radians(50.7))
    return replace(run, data={**run.data, "x": x, "y": y})


def _earth(run: Run, rng: np.random.Generator) -> Run:
    w = (run.data["u"] + 1j * run.data["v"]) * np.exp(1j * run.data["psi"])
    return replace(run, data={**run.data, "u": w.real, "v": w.imag})


def with_correction(correction: Correction) -> Change:
    """The change of a run that a correction makes."""
    return lambda run, rng: apply(correction, run)


def _late(names: tuple[str, ...], seconds: float) -> Change:
    return with_correction(Correction(late=dict.fromkeys(names, -seconds)))


def _water(run: Run, rng: np.random.Generator) -> Run:
    """Speed through a current of a fifth of the speed, read as over ground."""
    speed = float(np.nanmedian(np.abs(run.data["u"])))
    c = 0.2 * speed * np.exp(0.7j) * np.exp(-1j * run.data["psi"])
    return replace(run, data={**run.data, "u": run.data["u"] - c.real, "v": run.data["v"] - c.imag})


def _frozen(name: str) -> Change:
    def change(run: Run, rng: np.random.Generator) -> Run:
        group = next(g for g in ("data", "commands") if name in getattr(run, g))
        series = dict(getattr(run, group))
        changed: dict[str, Any] = {group: series}
        series[name] = np.full(run.t.shape, 0.0 if group == "commands" else series[name][0])
        return replace(run, **changed)

    return change


def _froze(*names: str) -> Change:
    """Columns that repeat what they held a third into the run, until two thirds."""

    def change(run: Run, rng: np.random.Generator) -> Run:
        at = slice(run.n_samples // 3, 2 * run.n_samples // 3)
        data = {k: run.data[k].copy() for k in names}
        for values in data.values():
            values[at] = values[at.start]
        return replace(run, data={**run.data, **data})

    return change


def _jump(run: Run, rng: np.random.Generator) -> Run:
    middle = run.t >= run.t[0] + 0.55 * run.duration
    speed = float(np.hypot(np.ptp(run.data["x"]), np.ptp(run.data["y"])))
    return replace(run, data={**run.data, "x": run.data["x"] + np.where(middle, 0.7 * speed, 0.0)})


def _turn(run: Run, rng: np.random.Generator) -> Run:
    """A compass that slips by 60 degrees on the way."""
    slipped = run.t >= run.t[0] + 0.55 * run.duration
    return replace(run, data={**run.data, "psi": run.data["psi"] + np.where(slipped, math.pi / 3, 0.0)})


def _clock(percent: float) -> Change:
    return with_correction(Correction(time_scale=1.0 + percent / 100.0))


def _angle(degrees: float) -> Change:
    return with_correction(Correction(offset={"psi": math.radians(degrees)}))


def planted(travel: float = 0.9) -> tuple[Planted, ...]:
    """All mistakes of the table of the study.

    Parameters
    ----------
    travel : time to travel a length [s], by which delays are measured
    """
    names = [
        "sign of delta_r", "sign of psi", "sign of r", "sign of v", "sign of u", "sign of x", "sign of y",
        "sign of z", "sign of w", "sign of theta", "sign of q", "sign of delta_s",
        "x and y exchanged", "heading from east", "east-north-up", "east-north-up, rates too",
        "east-north-up, forward-left-up", "heading and yaw rate to port", "body axes forward-left-up",
        "psi: radians read as degrees", "psi: degrees read as radians",
        "r: degrees per second read as radians per second",
        "r: radians per second read as degrees per second",
        "u, v, w: knots read as m/s", "u, v, w: m/s read as knots", "u, v, w: feet per second read as m/s",
        "u: knots read as m/s",
        "x, y: feet read as metres", "x, y: metres read as feet", "z: feet read as metres",
        "delta_r: degrees read as radians", "delta_r: radians read as degrees",
        "delta_s: degrees read as radians", "delta_s: radians read as degrees",
        "theta: degrees read as radians", "theta: radians read as degrees",
        "q: degrees per second read as radians per second",
        "n: revolutions per second read as rpm", "n: rpm read as revolutions per second",
        "n: radians per second read as rpm", "time in ms", "time in minutes", "u and v exchanged",
        "u, v, w: m/s read as feet per second", "u, v, w: km/h read as m/s", "z: metres read as feet",
        "r: degrees per minute read as degrees per second", "n: rpm read as radians per second",
        "q: radians per second read as degrees per second",
        "p: degrees per second read as radians per second", "phi: degrees read as radians", "sign of p",
    ]  # fmt: skip
    rows = [_fixed(name) for name in names]
    rows += [
        Planted("latitude and longitude", _geographic, ("latitude and longitude",), ("x", "y")),
        Planted("earth-fixed velocities", _earth, ("earth-fixed velocities",), ("u", "v", "psi")),
        Planted(
            "order logged as measured",
            with_correction(Correction(rename={"delta_r_cmd": "delta_r"})),
            ("delta_r: order read as measured",),
        ),
        Planted(
            "through the water as over ground", _water, ("through the water as over ground",), ("x", "u", "v")
        ),
        *(
            Planted(f"clock {p:g} % fast", _clock(p), ("clock",), ("u", "r", "psi"))
            for p in (1.0, 2.0, 5.0, 10.0, 20.0)
        ),
        Planted("u, v late by 9 L/U", _late(("u", "v"), 9 * travel), ("u, v late",), ("u", "v", "x")),
        Planted("psi late by 9 L/U", _late(("psi",), 9 * travel), ("psi late",), ("psi", "r")),
        Planted("r late by 9 L/U", _late(("r",), 9 * travel), ("r late",), ("psi", "r")),
        Planted("x, y late by 9 L/U", _late(("x", "y"), 9 * travel), ("x, y late",), ("x", "u")),
        Planted("heading off by 90 deg", _angle(90.0), ("north of heading and position",), ("psi", "x")),
        Planted("heading off by 50 deg", _angle(50.0), ("north of heading and position",), ("psi", "x")),
        Planted("x jumps (files merged)", _jump, ("jump of x, y",), ("x", "u")),
        Planted("psi jumps by 60 deg", _turn, ("jump of psi",), ("psi", "r")),
        Planted("dead r", _frozen("r"), ("dead r",), ("r", "psi")),
        Planted("dead psi", _frozen("psi"), ("dead psi",), ("psi", "r")),
        Planted("dead u", _frozen("u"), ("dead u",), ("u", "x")),
        Planted("frozen x, y for a third", _froze("x", "y"), ("frozen x, y",), ("x", "y")),
        Planted("frozen psi for a third", _froze("psi"), ("frozen psi",), ("psi",)),
        Planted("frozen r for a third", _froze("r"), ("frozen r",), ("r",)),
        Planted("frozen u for a third", _froze("u"), ("frozen u",), ("u",)),
        Planted("dead rudder", _frozen("delta_r_cmd"), ("dead delta_r",)),
        *(_fixed(f"{a} and {b} exchanged") for a, b in EXCHANGED if (a, b) != ("u", "v")),
    ]
    # a log all mirrored is, without roll and depth, the one with the rudder's sign turned, and so is its mend
    mirrored = {"east-north-up, forward-left-up": ("u",), "east-north-up": ()}
    return tuple(
        replace(row, right=(*row.right, "sign of delta_r")) if row.name in mirrored else row for row in rows
    )


def measured(rate: float) -> Change:
    """The angle of the rudder as it follows its order at a rate [rad/s], in the place of the order."""

    def change(run: Run, rng: np.random.Generator) -> Run:
        commands = dict(run.commands)
        order = commands.pop("delta_r_cmd")
        angle = order.copy()
        for k, step in enumerate(np.diff(run.t)):
            angle[k + 1] = angle[k] + np.clip(order[k] - angle[k], -rate * step, rate * step)
        return replace(run, commands=commands, measured_inputs={**run.measured_inputs, "delta_r": angle})

    return change


def controls(travel: float = 0.9, fin_rate: float = math.inf) -> tuple[Planted, ...]:
    """What the catalogue of effects holds, at its usual size, and a right log of a measured rudder: none of
    these is a mistake of the log.

    Parameters
    ----------
    fin_rate : of the rudder [rad/s]; at most `FAST_FIN` is taken
    """

    def scaled(**factors: float) -> Change:
        return with_correction(Correction(scale=factors))

    def lever(run: Run, rng: np.random.Generator) -> Run:
        arm = 0.3 * travel * float(np.nanmedian(run.data["u"])) * np.exp(1j * run.data["psi"])
        return replace(run, data={**run.data, "x": run.data["x"] + arm.real, "y": run.data["y"] + arm.imag})

    def compass(run: Run, rng: np.random.Generator) -> Run:
        psi = run.data["psi"]
        return replace(run, data={**run.data, "psi": psi + 0.05 * np.sin(psi) + 0.03 * np.cos(psi)})

    def rate_bias(run: Run, rng: np.random.Generator) -> Run:
        return replace(run, data={**run.data, "r": run.data["r"] + 0.005 / travel})

    def turned(run: Run, rng: np.random.Generator) -> Run:
        w = (run.data["u"] + 1j * run.data["v"]) * np.exp(-0.05j)
        return replace(run, data={**run.data, "u": w.real, "v": w.imag})

    kind = {"right": (), "kind": "effect"}
    return (
        Planted("nothing", lambda run, rng: run, **kind),  # type: ignore[arg-type]
        Planted("rudder measured", measured(min(fin_rate, FAST_FIN)), **kind),  # type: ignore[arg-type]
        Planted("heading bias 5 deg", _angle(-5.0), needs=("psi",), **kind),  # type: ignore[arg-type]
        Planted("compass deviation 3 deg", compass, needs=("psi",), **kind),  # type: ignore[arg-type]
        Planted("gyro scale 5 %", scaled(r=1.05), needs=("r",), **kind),  # type: ignore[arg-type]
        Planted("gyro bias", rate_bias, needs=("r",), **kind),  # type: ignore[arg-type]
        Planted("velocity scale 5 %", scaled(u=1.05, v=1.05), needs=("u", "v"), **kind),  # type: ignore[arg-type]
        Planted("velocity log turned by 3 deg", turned, needs=("u", "v"), **kind),  # type: ignore[arg-type]
        Planted("velocity late by 0.5 L/U", _late(("u", "v"), 0.5 * travel), needs=("u", "v"), **kind),  # type: ignore[arg-type]
        Planted("position late by 1 L/U", _late(("x", "y"), travel), needs=("x", "y"), **kind),  # type: ignore[arg-type]
        Planted("lever arm 0.3 L", lever, needs=("x", "y", "u"), **kind),  # type: ignore[arg-type]
    )


def logged(trial: Trial, row: Planted, seed: int) -> Trial:
    """The trial with a mistake in every run."""
    rng = np.random.default_rng(seed)
    runs = tuple(replace(row.change(run, rng), provenance=()) for run in trial.runs)
    renamed = {k: f"{k}_water" for k in "uvw" if k not in runs[0].data and f"{k}_water" in runs[0].data}
    noise = {renamed.get(k, k): row.noise * v for k, v in trial.noise.items()}
    return replace(trial, runs=runs, noise=noise)
