"""Does a ship identified from half of its logged zig-zags predict the other half? KVLCC2 (HSVA), Esso Osaka.

Usage: bayesid study real_logs --data FOLDER [--out FOLDER] [--quick] [--seed N]. FOLDER holds
`kvlcc2_hsva` and `esso_osaka`; the logs are not part of this project (studies/real_logs/*/trial.toml say
where they come from). An interrupted fit goes on where it was.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from bayesid.estimation.likelihood import NoiseParts
from bayesid.estimation.likelihood.checks import DETERMINED
from bayesid.estimation.output_error import FitOptions
from bayesid.estimation.segments import fit_in_pieces, in_pieces
from bayesid.estimation.trial_fit import TrialFit, outcomes
from bayesid.lock import lock_or_exit
from bayesid.model.terms import term
from bayesid.model.vehicles import Vehicle, load_vehicle
from bayesid.progress import Progress
from bayesid.report import writer
from bayesid.trials import Run, Trial, load_trial, thin, window
from studies.real_logs.bands import held_out_bands
from studies.real_logs.report import Variant, logs_report, logs_results

HERE = Path(__file__).parent
# With these free the rows of an axis can be scaled together and no trial shows it; published values are kept.
INERTIA = ("X_udot", "Y_vdot", "N_rdot")
WIND = "wind.area_coefficients"
SINGLE_SCREW = (
    "Y_*",
    "N_*",
)  # a propeller pushes sideways; an unstable ship turns it into a drift of heading
# rows that stand in for cubic ones in a plain Gertler-Hagen set: name -> (cubic row, typical v' or r')
QUADRATIC_ROWS = {
    "Y_v|v|": ("Y_vvv", 0.2), "Y_v|r|": ("Y_vrr", 0.3), "N_v|v|": ("N_vvv", 0.2), "N_|v|r": ("N_vvr", 0.2),
    "N_r|r|": ("N_rrr", 0.3),
}  # fmt: skip
GUESSED_RELATIVE_SD = 2.0  # relative sd of rows whose start is such a guess


@dataclass(frozen=True)
class LogSetting:
    """How the logs of one ship are used.

    dt : time between readings [s]
    piece : length of a fitted piece [s], about two legs of a zig-zag
    way : share of its speed at which a run begins, None for the whole record
    wind : fit the exposed area to the measured wind, as a last step
    """

    dt: float
    piece: float
    way: float | None
    wind: bool
    note: str


SETTINGS = {
    "kvlcc2_hsva": LogSetting(
        0.5, 80.0, None, False,
        "The logs are filtered and practically free of noise, so what remains is error of the model. The "
        "weights come from the residuals, and the standard deviations below say how far this model is from "
        "the ship, not how good the sensors were. Pieces of 40 s were tried before those of 80 s; they gave "
        "9.0 degrees for whole runs.",
    ),
    "esso_osaka": LogSetting(
        1.0, 60.0, 0.7, True,
        "Rudder and propeller are commands, not measurements. Wind (0.7 to 2.4 m/s at 0.1 to 0.5 m/s of ship "
        "speed) was given for the October runs only; in the others it is in the residuals, and so in the "
        "standard deviations, which are errors of model and disturbance more than of sensors.",
    ),
}  # fmt: skip


def main(data: Path, out: Path, quick: bool, seed: int) -> None:
    """One report per set of logs that is in the folder."""
    if not any((data / name).is_dir() for name in SETTINGS):
        raise SystemExit(f"{data}: holds none of the folders {', '.join(SETTINGS)}")
    progress = Progress()
    for name, setting in SETTINGS.items():
        if not (data / name).is_dir():
            progress.note(f"{name}: no such folder in {data.name}; left out")
            continue
        study(name, setting, data / name, out / name, quick, seed, progress)


def study(
    name: str, setting: LogSetting, data: Path, out: Path, quick: bool, seed: int, progress: Progress
) -> list[Variant]:
    """Fit three sets of rows to the same runs, predict the others, write the report."""
    logged = load_trial(HERE / name, data)
    step = (2 if quick else 1) * setting.dt
    trial = replace(logged, runs=tuple(thin(begun(run, setting.way), step) for run in logged.runs))
    inside = replace(trial, runs=tuple(r for r in trial.runs if not r.manoeuvre.startswith("random")))
    ship = load_vehicle(HERE / name / "vehicle.toml")
    options = FitOptions(seed=seed, profile=True, rounds=3 if quick else 12)
    sets: list[tuple[str, str, Vehicle, tuple[str, ...]]] = [
        ("plain", "plain Gertler-Hagen rows", plain(ship), SINGLE_SCREW),
        ("symmetric", "cubic and propeller-race rows, no side force of the screw", ship, ()),
        ("all", "cubic and propeller-race rows, side force of the screw", ship, SINGLE_SCREW),
    ]
    if setting.wind:
        sets.append(("wind", "the same and measured wind on the hull", ship, (*SINGLE_SCREW, WIND)))
    variants = []
    for key, words, vehicle, extra in sets:
        free = (*(n for n in vehicle.coef if n not in INERTIA), *extra)
        with progress.stage(f"{name}: {words}") as stage:
            found = fit_in_pieces(
                inside, setting.piece, vehicle, out / "fits" / key, free=free, options=options,
                watch=lambda done, cost, step, s=stage: s.step(info=f"cost {cost:.5g}"),
            )  # fmt: skip
            variants.append(Variant(key, words, found, short_runs(inside, found, setting.piece)))
    halves = {}
    for words, parts in (("composite likelihood", None), ("white noise", NoiseParts())):
        with progress.stage(f"{name}: odd and even runs apart, {words}"):
            free = (*(n for n in vehicle.coef if n not in INERTIA), *extra)
            halves[words] = halves_apart(inside, setting.piece, vehicle, free, options, parts)
    strange = tuple(r for r in trial.runs if r.manoeuvre.startswith("random"))
    best = variants[-1].found
    outside = outcomes(best.problem, replace(trial, runs=strange), best.fit) if strange else ()
    with progress.stage(f"{name}: bands of held-out runs"):
        bands = held_out_bands(best, inside.holdout, seed)
    facts = {
        "bands": bands,
        "dt": step,
        "piece": setting.piece,
        "way": setting.way,
        "note": setting.note + in_opened_wind(inside, best, data / "wind_opened"),
        "fixed": INERTIA,
        "quick": quick,
        "halves": halves,
    }
    writer.write(logs_report(variants, outside, facts), out, logs_results(variants, outside, facts, seed))
    return variants


def halves_apart(
    trial: Trial,
    piece: float,
    vehicle: Vehicle,
    free: tuple[str, ...],
    options: FitOptions,
    parts: NoiseParts | None,
) -> dict[str, Any]:
    """Odd and even runs fitted apart: differences of the coefficients that all runs determine, in combined
    sd.
    """
    names = [run.name for run in trial.identify]
    found = []
    for kept in (names, names[0::2], names[1::2]):
        runs = tuple(run for run in trial.identify if run.name in kept)
        fit = fit_in_pieces(
            replace(trial, runs=runs), piece, vehicle, None, free=free, options=options, parts=parts
        ).fit
        found.append((fit.z[: len(free)], fit.sd[: len(free)], fit))
    (_, sd, whole), (one, sd_one, _), (two, sd_two, _) = found
    counted = sd < DETERMINED * whole.prior_sd[: len(free)]
    z = (one - two) / np.hypot(sd_one, sd_two)
    return {
        "rms": float(np.sqrt(np.mean(z[counted] ** 2))) if counted.any() else None,
        "count": int(counted.sum()),
        "largest": dict(
            sorted(
                ((n, float(v)) for n, v, c in zip(whole.names, z, counted, strict=False) if c),
                key=lambda pair: -abs(pair[1]),
            )[:5]
        ),
        "converged": all(fit.converged for _, _, fit in found),
    }


def begun(run: Run, share: float | None) -> Run:
    """The run from where the ship has gathered way; the rows do not hold at the start from rest."""
    if share is None or run.manoeuvre.startswith("random"):
        return run
    under_way = np.flatnonzero(run.data["u"] > share * np.nanquantile(run.data["u"], 0.95))
    return window(run, float(run.t[under_way[0]]), float(run.t[-1]))


def in_opened_wind(trial: Trial, found: TrialFit, folder: Path) -> str:
    """How far off the held-out zig-zags are once their wind is given too; "" without such logs."""
    windy = {run.name: with_wind(run, folder / f"{run.name}.csv") for run in trial.holdout
             if run.manoeuvre.startswith("zigzag") and (folder / f"{run.name}.csv").is_file()}  # fmt: skip
    if not windy:
        return ""
    errors = []
    for some in (tuple(trial.run(name) for name in windy), tuple(windy.values())):
        judged_runs = outcomes(found.problem, replace(trial, runs=some), found.fit)
        errors.append([float(np.degrees(o.rms_fitted[o.channels.index("psi")])) for o in judged_runs])
    return (
        f" The held-out zig-zags were predicted without wind, to {np.median(errors[0]):.2g} degrees; with "
        "the wind that was measured in them and opened since, the same fit misses by "
        f"{np.median(errors[1]):.3g} degrees ({', '.join(f'{e:.3g}' for e in errors[1])})."
    )


def with_wind(run: Run, file: Path) -> Run:
    """The run with the wind of a log `t[s],wind_speed[m/s],wind_from[rad]`, its vector interpolated."""
    t, speed, come = np.loadtxt(file, delimiter=",", skiprows=1).T
    x, y = np.interp(run.t, t, speed * np.cos(come)), np.interp(run.t, t, speed * np.sin(come))
    return replace(run, exogenous={"wind_speed": np.hypot(x, y), "wind_from": np.arctan2(y, x) % (2 * np.pi)})


def plain(ship: Vehicle) -> Vehicle:
    """The ship with products of velocities only: cubic and propeller-race rows out, |v| and |r| rows in."""
    ours = {n: v for n, v in ship.coef.items() if term(n).group != "eta" and n.count("v") + n.count("r") < 3}
    coef = {n: v for n, v in ours.items() if n in ("X_drdr", "X_vv", "X_vr", "X_rr") or "vv" not in n}
    guesses = {n: size * ship.coef[row] for n, (row, size) in QUADRATIC_ROWS.items() if ship.coef.get(row)}
    prior = ship.prior
    if prior is not None:
        kept = {n: sd for n, sd in prior.relative_sd.items() if n in coef}
        prior = replace(prior, relative_sd=kept | dict.fromkeys(guesses, GUESSED_RELATIVE_SD))
    return replace(ship, name=f"{ship.name}, plain rows", coef=coef | guesses, prior=prior)


def short_runs(trial: Trial, found: TrialFit, seconds: float) -> tuple[Any, ...]:
    """Held-out runs predicted piece by piece, each from its own first readings."""
    held = tuple(replace(run, role="identify") for run in trial.holdout)
    pieces = in_pieces(replace(trial, runs=held), seconds)
    whole = replace(pieces, runs=tuple(replace(run, role="holdout") for run in pieces.runs))
    return outcomes(found.problem, whole, found.fit)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        prog="bayesid study real_logs",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--data", type=Path, required=True, help="folder with kvlcc2_hsva and esso_osaka")
    parser.add_argument("--out", type=Path, default=Path("out/real_logs"))
    parser.add_argument("--quick", action="store_true", help="half the samples, three rounds")
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    lock_or_exit(given.out, "studies/real_logs/run.py")
    main(given.data, given.out, given.quick, given.seed)
