"""Do added mass and reference speed show that the rows of a set are in the units that the file states?

Takes: a `Vehicle`. Gives a sentence with numbers and the likely reason, and the rows. Does not: judge signs.

Potential flow: a spheroid has added mass of 0.5 (sphere) to 1 (long) times the water it displaces in sway and
heave, 0.02 (ten times as long as wide) to 0.5 in surge (Lamb 1932, art. 114-115; Fossen 2011, sec. 6.3); a
flat body more, a disc in heave ten times as wide as thick 8.5 times. The limits here lie beyond all of them.
"""

from __future__ import annotations

from dataclasses import replace

from bayesid.model.vehicles.vehicle import Vehicle, coef_si
from bayesid.words import and_list, digits, first_few

MOST_ACROSS, MOST_AHEAD = 10.0, 3.0
#: row, most times the mass or moment of inertia of the vehicle, and which
MOST = (
    ("Y_vdot", MOST_ACROSS, "mass"),
    ("Z_wdot", MOST_ACROSS, "mass"),
    ("X_udot", MOST_AHEAD, "mass"),
    ("M_qdot", MOST_ACROSS, "Iyy"),
    ("N_rdot", MOST_ACROSS, "Izz"),
)
LEAST = 0.01  # of the mass in sway and heave; a barge twenty times as wide as deep has 0.08 in sway
ACROSS = ("Y_vdot", "Z_wdot")
SPEEDS_APART = 3.0  # speed at rpm_ref over U_ref, or the reverse; the built-in sets have up to 1.7
SHOWN = 3


def added_mass_out_of_proportion(vehicle: Vehicle) -> tuple[str, tuple[str, ...]] | None:
    """A sentence on rows of added mass that hardly any body has, and the rows; None where there are none."""
    now, other = _ratios(vehicle), _ratios(replace(vehicle, nondimensional=not vehicle.nondimensional))
    large = [row for row, most, _ in MOST if now.get(row, 0.0) > most]
    small = [row for row in ACROSS if 0.0 < now.get(row, 1.0) < LEAST]
    fits = [row for row in large or small if _possible(row, other[row])]
    odd = large or (fits if len(fits) == len(small) else [])
    if not odd:
        return None
    of = {row: what for row, _, what in MOST}
    si = coef_si(vehicle)
    told = []
    for row in odd:
        unit = "kg" if of[row] == "mass" else "kg m^2"
        told.append(
            f"{row} = {digits(si[row], 4)} {unit}, {digits(now[row], 3)} times {of[row]} = "
            f"{digits(getattr(vehicle, of[row]), 4)}"
        )
    text = f"added mass out of all proportion: {first_few(told, SHOWN, '; ')}"
    bounds = "about 1 in sway and heave and below 0.2 in surge are usual of a slender body"
    beyond = f"; more than {MOST_ACROSS:g} times, ahead {MOST_AHEAD:g} times, hardly any has" if large else ""
    text += f" ({bounds}{beyond})"
    if len(fits) == len(odd):
        stated, meant = ("prime", "SI") if vehicle.nondimensional else ("SI", "prime")
        one = next((row for row in fits if row in ACROSS), fits[0])
        text += (
            f". The file states `nondimensional = {str(vehicle.nondimensional).lower()}`, so its rows are "
            f"read as {stated} numbers; read as {meant} ones they make {one} {other[one]:.2g} times "
            f"{of[one]}: is `nondimensional = {str(not vehicle.nondimensional).lower()}` meant?"
        )
    else:
        text += "; kg and m are wanted, or prime numbers with `nondimensional = true`"
    return text, tuple(odd)


def speed_far_from_stated(vehicle: Vehicle, speed: float) -> str:
    """A sentence where the speed at rpm_ref is far from U_ref; else empty.

    Parameters
    ----------
    speed : steady speed of the straight run at rpm_ref [m/s]
    """
    stated = vehicle.U_ref
    if stated is None or 1.0 / SPEEDS_APART < speed / stated < SPEEDS_APART:
        return ""
    slow = speed < stated
    times = stated / speed if slow else speed / stated
    rows = [name for name in ("X_u|u|", "X_uu", "X_u0", "X_0,U") if vehicle.coef.get(name)]
    drag = f"drag ({and_list(rows)})" if rows else "drag"
    return (
        f"runs at {speed:.3g} m/s at rpm_ref = {vehicle.rpm_ref:g} rpm while U_ref = {stated:g} m/s, "
        f"{times:.3g} times {'as large' if slow else 'smaller'}: the {drag} is too "
        f"{'large' if slow else 'small'} for the thrust, or rpm_ref or U_ref is wrong; are the units of all "
        "of them those of the file?"
    )


def _ratios(vehicle: Vehicle) -> dict[str, float]:
    """Added mass over the mass or inertia of the vehicle, by row; only rows of the file that are negative."""
    si = coef_si(replace(vehicle, coef={r: vehicle.coef[r] for r, _, _ in MOST if r in vehicle.coef}))
    body = {row: getattr(vehicle, what) for row, _, what in MOST}
    return {row: -si[row] / body[row] for row in body if si.get(row, 0.0) < 0.0 and body[row]}


def _possible(row: str, ratio: float) -> bool:
    most = next(m for r, m, _ in MOST if r == row)
    return (LEAST if row in ACROSS else 0.0) < ratio < most
