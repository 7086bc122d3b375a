"""The two tankers by MMG as they were tested, with what is known of their coefficients, and their logs.

Takes the data folder. Gives vehicles and trials. Does not fit.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from bayesid.estimation.likelihood import NoiseParts
from bayesid.model.terms import term
from bayesid.model.vehicles import CoefficientPrior, Vehicle, load_vehicle
from bayesid.trials import Trial, load_trial
from studies import blind_predictions
from studies.real_logs import start_values
from studies.real_logs.run import HERE as LOGS
from studies.real_logs.run import with_wind

# Relative sd of published numbers for another model of the hull, and of those whose value is near zero.
HULL, NUMBER, SMALL = 0.2, 0.15, 1.0
NEAR_ZERO = ("X_vv", "X_rr", "X_vr", "Y_r", "N_vvv,U", "N_rrr,U", "N_vrr,U")
WIDER = {"Y_rrr,U": 5.0}
# Measured in open water or on the model itself: not fitted. At one number of revolutions those of the second
# list stand in for one another.
KNOWN = ("k_0", "k_1", "k_2", "k_back", "x_P", "f_alpha")
AT_ONE_RPM = (
    *("t_P", "w_P0", "C_1", "C_2plus", "C_2minus", "epsilon", "kappa", "t_R", "a_H", "x_H"),
    *("X_0,U", "X_rr", "X_vvvv,U", "Y_r"),
)
# of the effect `wind` of a ship: measured wind as an input, and the shape of its coefficients
SHIP_WIND = tuple(f"wind.{n}" for n in ("gain", "vane_zero", "side", "centre", "centre_moves"))
# Noise of the fits by MMG: memory, spread from run to run, and a power of the readings that is about the
# share of information the memory leaves them. With the power that linear algebra calls best for left-out runs
# (1), numbers of KVLCC2 went up to 19 prior sd away (place of the rudder in its drift -2.7 L), with 31 rows
# beside them up to 23. What each gives on runs left out: the table of `choice` in the report.
SHARE = {
    "kvlcc2_hsva": NoiseParts(2, 1.0, 0.2, 0.01, 0.01),
    "esso_osaka": NoiseParts(3, 2.0, 0.2, 0.03, 0.02),
}
BACK = ("Y_back", "N_back")
INERTIA = ("X_udot", "Y_vdot", "N_rdot")


def known_to(ship: Vehicle) -> Vehicle:
    """The ship with priors by kind of coefficient."""
    sd = {n: NUMBER if term(n).is_number else HULL for n in ship.coef}
    sd |= {n: SMALL for n in NEAR_ZERO if n in sd} | {n: s for n, s in WIDER.items() if n in sd}
    return replace(ship, prior=CoefficientPrior(sd))


def free_of(ship: Vehicle) -> tuple[str, ...]:
    """Coefficients a fit may move."""
    kept = (*INERTIA, *KNOWN, *(AT_ONE_RPM if "C_1" in ship.coef else ()))
    return tuple(n for n in ship.coef if n not in kept)


def kvlcc2(data: Path) -> Vehicle:
    """The HSVA model with the published hull and rudder; propeller as measured in open water, wake and
    resistance from the thrust of the approach."""
    ship = load_vehicle("kvlcc2_mmg")
    measured = start_values.kvlcc2(data)
    logged = load_vehicle(LOGS / "kvlcc2_hsva" / "vehicle.toml")
    k_0, k_1, k_2 = (float(k) for k in measured.kt)
    own = {
        "k_0": k_0,
        "k_1": k_1,
        "k_2": k_2,
        "w_P0": float(measured.w),
        "X_0,U": -float(measured.resistance),
    }
    values = ship.propulsion.values | {"D_P": measured.D, "rpm_ref": 613.8}
    return known_to(
        replace(
            ship, name="KVLCC2, HSVA model, published MMG", mass=logged.mass, Izz=logged.Izz, r_G=logged.r_G,
            r_B=logged.r_B, W=logged.W, B=logged.B, coef=ship.coef | own,
            dimensions=ship.dimensions | {"prime_draught": measured.d},
            propulsion=replace(ship.propulsion, values=values),
        )
    )  # fmt: skip


def esso_osaka(data: Path) -> Vehicle:
    """The pond model as published; nothing of it was measured on the way."""
    return known_to(load_vehicle("esso_osaka_mmg"))


def of_all_quadrants(ship: Vehicle) -> tuple[Vehicle, tuple[str, ...]]:
    """The ship with what a propeller that turns astern pushes aside, and what a fit to all motions moves."""
    coef = ship.coef | {"Y_back": -0.02, "N_back": 0.01}  # signs of a right-handed screw; sizes assumed
    known = CoefficientPrior((ship.prior.relative_sd if ship.prior else {}) | dict.fromkeys(BACK, 3.0))
    wide = replace(ship, coef=coef, prior=replace(known, relative_sd=known.relative_sd | {"k_back": 10.0}))
    return wide, (*free_of(wide), "k_back")


def slow_logs(data: Path) -> Trial:
    """Random four-quadrant and berthing runs of the pond, every second one kept back."""
    return load_trial(Path(blind_predictions.__file__).parent / "esso_osaka_more", data)


def logs_of(name: str, data: Path) -> Trial:
    """The runs of `studies/real_logs`, wind given wherever it was measured."""
    trial = load_trial(LOGS / name, data)
    files = {run.name: data / "wind_opened" / f"{run.name}.csv" for run in trial.runs}
    runs = (with_wind(run, files[run.name]) if files[run.name].is_file() else run for run in trial.runs)
    return replace(trial, runs=tuple(runs))


SHIPS = {"kvlcc2_hsva": kvlcc2, "esso_osaka": esso_osaka}
