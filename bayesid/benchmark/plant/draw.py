"""Draw campaigns: what is planted, how large, on which vehicle, in which sea; all from a seed.

Takes: a seed and whatever factors are to be fixed. Gives a `Campaign` whose vehicle stays in hand.
Does not: write files (`bundles`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from bayesid.benchmark.plant.body import cruising_speed
from bayesid.benchmark.plant.campaign import Campaign, Disturbance, Planted, stream_of
from bayesid.benchmark.plant.execute_campaign import execute_campaign
from bayesid.benchmark.plant.listed_causes import PlantedCause, Scales, sign
from bayesid.benchmark.plant.orders import DESIGNS, plan_runs
from bayesid.benchmark.plant.sensing import SUITES
from bayesid.benchmark.plant.unlisted_causes import CASES
from bayesid.errors import ModelError
from bayesid.model.vehicles import Vehicle, load_vehicle

KINDS = {"none": 0.25, "effect": 0.45, "two": 0.1, "variant": 0.1, "outside": 0.1}
SEAS = {"still": 0.0, "calm": 0.006, "mid": 0.015, "rough": 0.033}
VEHICLES = tuple(DESIGNS)
SPATIAL = ("generic_sub", "nps_auv2")  # vehicles executed in 6-DOF
ERRORS = ("Y_v", "N_v", "Y_r", "N_r", "Y_dr", "N_dr", "N_r|r|", "Y_v|v|")
ATTEMPTS = 25


def draw_campaign(
    seed: int,
    *,
    kind: str | None = None,
    effects: Sequence[str] | None = None,
    variant: str | None = None,
    vehicle: str | None = None,
    dof: int | None = None,
    sensors: str | None = None,
    sea: str | None = None,
    prior_sd: float | None = None,
    rich: bool | None = None,
    sizes: tuple[float, float] = (0.1, 1.5),
) -> Campaign:
    """Draw what is not given; what is given stays.

    Parameters
    ----------
    seed : the same seed and factors give the same campaign, byte for byte
    kind : one of KINDS
    effects : names of the effect contract or of `unlisted_causes.OUTSIDE`; "coefficient_error" is one of them
    variant : a form from `unlisted_causes.VARIANTS`
    sensors : one of SUITES; sea : one of SEAS; prior_sd : relative, 0.05 or 0.10 if not given
    sizes : range of the log-uniform size, 1 being the reference magnitude

    Raises
    ------
    ModelError                 factors that do not exist or exclude each other, or no vehicle stayed in hand
    """
    _check(kind, effects, vehicle, dof, sensors, sea, sizes)
    trouble = ""
    for attempt in range(ATTEMPTS):
        made = _draw(seed, attempt, kind, effects, variant, vehicle, dof, sensors, sea, prior_sd, rich, sizes)
        try:
            execute_campaign(made)
        except ModelError as error:
            trouble = str(error)
            continue
        return made
    raise ModelError(f"plant: no campaign of seed {seed} stayed in hand in {ATTEMPTS} draws; last: {trouble}")


def _check(kind, effects, vehicle, dof, sensors, sea, sizes) -> None:
    for value, known, what in ((kind, KINDS, "kind"), (vehicle, VEHICLES, "vehicle"), (dof, (3, 6), "dof"),
                               (sensors, SUITES, "sensors"), (sea, SEAS, "sea")):  # fmt: skip
        if value is not None and value not in known:
            raise ModelError(f"plant: {what} is {value!r}; one of {', '.join(map(str, known))}")
    names = {case.name for case in CASES} | {"coefficient_error"}
    for name in effects or ():
        if name not in names:
            raise ModelError(f"plant: no effect {name!r}; one of {', '.join(sorted(names))}")
    if not 0.0 < sizes[0] <= sizes[1]:
        raise ModelError(f"plant: sizes are {sizes}; give a positive range")
    if dof == 6 and vehicle is not None and vehicle not in SPATIAL:
        raise ModelError(
            f"plant: {vehicle} is executed in the plane only; 6-DOF vehicles: {', '.join(SPATIAL)}"
        )


def _draw(
    seed, attempt, kind, effects, variant, vehicle, dof, sensors, sea, prior_sd, rich, sizes
) -> Campaign:
    design = stream_of(seed, attempt, "design")
    # every draw is made whether used or not, so that fixing one factor does not shift the next
    drawn: dict[str, Any] = {
        "kind": str(design.choice(list(KINDS), p=list(KINDS.values()))),
        "dof": 6 if design.random() < 0.15 else 3,
        "vehicle": str(design.choice(VEHICLES)),
        "spatial": str(design.choice(SPATIAL)),
        "sensors": str(design.choice(list(SUITES), p=[0.6, 0.15, 0.25])),
        "sea": str(design.choice(list(SEAS), p=[0.4, 0.2, 0.25, 0.15])),
        "prior": float(design.choice([0.05, 0.10])),
        "rich": bool(design.random() < 0.8),
    }
    chosen = [case for case in CASES if case.name in (effects or ())]
    if dof is None:
        dof = 6 if any(case.dof == 6 for case in chosen) else drawn["dof"]
        dof = 3 if vehicle is not None and vehicle not in SPATIAL else dof
    name = vehicle or (drawn["spatial"] if dof == 6 else drawn["vehicle"])
    sensors = sensors or drawn["sensors"]
    logged = SUITES[sensors][dof]
    boat = load_vehicle(name)
    speed = cruising_speed(boat, float(boat.rpm_ref or 1.0))
    scales = Scales(
        boat.L, speed, boat.rho, boat.mass, boat.r_G[2] - boat.r_B[2], DESIGNS[name][1]["zigzag"], dof
    )
    kind = kind or ("none" if effects == () else _kind_of(effects, variant) or drawn["kind"])
    rng = stream_of(seed, attempt, "effects")
    cases = _choose(rng, kind, effects, variant, dof, logged)
    planted, wrong = [], {}
    for case in cases:
        size = math.exp(rng.uniform(*np.log(sizes)))
        if case is None:
            wrong = _coefficient_error(rng, boat, size)
            fields: dict[str, float] = {}
            parameters = {f"z {key}": value for key, value in wrong.items()}
            planted.append(Planted("coefficient_error", "", "effect", size, parameters, fields))
            continue
        parameters, fields = case.draw(rng, size, scales)
        outside = case.kind == "outside"
        planted.append(
            Planted(case.name, case.variant, "outside" if outside else case.kind, size, parameters, fields)
        )
    sd = prior_sd if prior_sd is not None else drawn["prior"]
    normal = stream_of(seed, attempt, "coefficients").standard_normal(len(boat.coef))
    coef = {key: value * (1.0 + sd * z) for (key, value), z in zip(boat.coef.items(), normal, strict=True)}
    coef |= {key: boat.coef[key] * (1.0 + sd * z) for key, z in wrong.items()}
    disturbance = _disturbance(stream_of(seed, attempt, "sea"), sea or drawn["sea"], scales)
    depth = 0.0 if dof == 3 else (0.3 if any("suck_z" in p.fields for p in planted) else 2.5) * boat.L
    rich = drawn["rich"] if rich is None else rich
    runs = plan_runs(
        stream_of(seed, attempt, "runs"), name, float(boat.rpm_ref or 1.0), scales.LU, boat.L, depth,
        rich, disturbance.sea != "still",
    )  # fmt: skip
    sigma = _sigma(stream_of(seed, attempt, "sensors"), logged, scales)
    return Campaign(
        seed, attempt, kind, boat, name, dof, sensors, sd, rich, tuple(planted), coef, wrong, disturbance,
        sigma, runs,
    )  # fmt: skip


def _kind_of(effects: Sequence[str] | None, variant: str | None) -> str | None:
    if variant:
        return "variant"
    if not effects:
        return None
    if len(effects) > 1:
        return "two"
    return "outside" if any(c.name == effects[0] and c.kind == "outside" for c in CASES) else "effect"


def _choose(rng, kind, effects, variant, dof, logged) -> list[PlantedCause | None]:
    """Cases to plant; None stands for an error of one coefficient."""
    fits = [
        c for c in CASES if c.dof <= dof and (dof < 6 or not c.surface) and (not c.needs or c.needs in logged)
    ]
    wanted = {"none": (), "effect": ("effect",), "two": ("effect",)}.get(kind, (kind,))
    if effects:
        form = "variant" if variant else ("effect", "outside")
        found: list[PlantedCause | None] = []
        for name in effects:
            if name == "coefficient_error":
                found.append(None)
                continue
            options = [c for c in fits if c.name == name and c.kind in form and variant in (None, c.variant)]
            if not options:
                raise ModelError(f"plant: {name} does not show with these sensors, dof or variant")
            found.append(options[0])
        return found
    pool = [c for c in fits if c.kind in wanted and variant in (None, c.variant)]
    count = {"none": 0, "two": 2}.get(kind, 1)
    if count and not pool:
        raise ModelError(f"plant: no {kind} {variant or ''} fits these sensors and dof")
    if kind == "effect" and rng.random() < 1.0 / (len(pool) + 1):
        return [None]
    return [pool[k] for k in rng.permutation(len(pool))[:count]]


def _coefficient_error(rng: np.random.Generator, boat: Vehicle, size: float) -> dict[str, float]:
    """One coefficient four to ten prior sd off; in those units."""
    name = str(rng.choice([key for key in ERRORS if key in boat.coef]))
    return {name: sign(rng) * min(max(6.0 * size, 4.0), 10.0)}


def _disturbance(rng: np.random.Generator, sea: str, s: Scales) -> Disturbance:
    relative = SEAS[sea] * rng.uniform(0.7, 1.3, 5)
    tau = s.LU * math.exp(rng.uniform(math.log(0.2), math.log(4.0)))
    drift = float(rng.uniform(0.25, 0.8))
    drift_tau, outliers, gaps = float(rng.uniform(40.0, 90.0)), rng.random() < 0.2, bool(rng.random() < 0.3)
    if sea == "still":
        return Disturbance(sea)
    share = 0.01 if outliers else 0.0
    return Disturbance(sea, tuple(float(a) for a in relative), tau, drift, drift_tau, share, gaps)


def _sigma(rng: np.random.Generator, logged: tuple[str, ...], s: Scales) -> dict[str, float]:
    """Standard deviations of white noise as a survey-grade small suite has them, SI."""
    place = float(rng.uniform(0.008, 0.016)) * s.L if s.L > 20 else float(rng.uniform(0.1, 0.5))
    heading, log = float(rng.uniform(0.002, 0.009)), float(rng.uniform(0.005, 0.01))
    turn = float(rng.uniform(3.5e-4, 7.5e-4)) if s.L > 20 else 8.73e-4
    sizes = {"x": place, "y": place, "psi": heading, "r": turn, "u": log, "v": log, "z": 0.1}
    sizes |= {"phi": 2.62e-3, "theta": 2.62e-3, "p": 8.73e-4, "q": 8.73e-4, "w": log}
    return {name: float(f"{sizes[name]:.3g}") for name in logged}
