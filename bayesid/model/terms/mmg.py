"""Hull, propeller and rudder by the MMG standard method as data: rows over U, numbers, formulas.

Takes: nothing. Rows of the hull are rows of the force table whose products are divided by powers of the
speed U, so that v' = v/U and r' = r L/U as in the paper; the numbers of propeller and rudder are entries of
the same table that act within `DEFINITIONS`. Kernels parse these formulas; `propulsion` evaluates them.
Does not: hold a ship's values (vehicle files).

Yasukawa and Yoshimura (2015), with two changes: they hold in four quadrants, and delta_r is positive to PORT.
Drift is taken from the direction of the flow along the axis of the ship, whether ahead or astern.
"""

from __future__ import annotations

import ast

from bayesid.model.terms.row import Term

_SOURCE = "yasukawa2015"

HULL = {
    "X": {"0,U": "S*U*U", "vvvv,U": "S*v*v*v*v/U/U"},
    "Y": {
        "v,U": "U*v", "r,U": "S*U*r", "vvv,U": "v*v*v/U", "vvr,U": "S*v*v*r/U", "vrr,U": "v*r*r/U",
        "rrr,U": "S*r*r*r/U",
    },
    "N": {
        "v,U": "S*U*v", "r,U": "U*r", "vvv,U": "S*v*v*v/U", "vvr,U": "v*v*r/U", "vrr,U": "S*v*r*r/U",
        "rrr,U": "r*r*r/U",
    },
}  # fmt: skip
#: as published for slow ships: forces by |u| keep their sign astern
SLOW = {"Y": {"|u|v": "abs(u)*v"}, "N": {"|u|r": "abs(u)*r"}}

#: formulas in order; each may read those above, the motion through the water, delta_r [rad], n [rpm], the
#: numbers below and D_P, H_R, A_R, x_R of [propulsion]
DEFINITIONS = {
    "beta": "2*atan(-v/(U + abs(u)))",
    "beta_P": "beta - x_P*r*L/U",
    "C_2": "C_2minus + (C_2plus - C_2minus)*step(beta_P)",
    "kept": "(1 - w_P0)*(1 + (1 - exp(-C_1*abs(beta_P)))*(C_2 - 1)) + tau_P*abs(beta_P) + c_P*beta_P**2",
    "u_P": "u*(1 - (1 - max(min(kept, 1.2), 0.05))*step(u))",
    "rps": "n/60",
    "T": "rho*D_P**2*(k_0*(1 - k_back*step(-rps))*rps*abs(rps)*D_P**2 + k_1*u_P*abs(rps)*D_P"
    " + k_2*u_P*abs(u_P))",
    "jet": "sqrt(max(u_P*abs(u_P) + 2.5464790894703255*T/(rho*D_P**2), 1e-6*U_ref**2))",
    "race": "u_P + kappa*(jet - u_P)",
    "q_R": "D_P/H_R*race*abs(race) + (1 - D_P/H_R)*u_P*abs(u_P)",
    "u_R": "epsilon*q_R/sqrt(max(abs(q_R), 1e-6*U_ref**2))",
    "across": "U*beta - l_R*r*L",
    "v_R": "(gamma_minus + (gamma_plus - gamma_minus)*step(across))*across",
    "U_R": "sqrt(max(u_R*u_R + v_R*v_R, 1e-6*U_ref**2))",
    "sin_alpha": "-(u_R*sin(delta_r) + v_R*cos(delta_r))/U_R",
    "F_N": "0.5*rho*A_R*f_alpha*U_R*U_R*sin_alpha/(1 + (inverse_stall*sin_alpha)**2/3)",
    "back": "rho*rps*rps*D_P**4*step(-rps)",
}
#: force on the ship: part, axis -> formula, and what the part reads
FORCES = {
    ("propeller", "X"): ("(1 - t_P)*T", "u*n"),
    ("propeller", "Y"): ("Y_back*back", "u*n"),
    ("propeller", "N"): ("N_back*back*L", "u*n"),
    ("rudder", "X"): ("(1 - t_R)*F_N*sin(delta_r)", "u*delta_r"),
    ("rudder", "Y"): ("-(1 + a_H)*F_N*cos(delta_r)", "u*delta_r"),
    ("rudder", "N"): ("-(x_R + a_H*x_H)*L*F_N*cos(delta_r)", "u*delta_r"),
}
#: cross-flow drag over the length of the hull (Yoshimura and others 2009): how hard, and the speed across at
#: x in force and in moment
CROSS_FLOW = {
    "pressure": "0.5*rho*height*C_D",
    "Y": "v + x*r*(C_rY + 1 - abs(sgn(C_rY)))",
    "N": "v + x*r*(C_rN + 1 - abs(sgn(C_rN)))",
}
#: speed [m/s] in v/U and r L/U: never below 2 % of the usual one, where the angles of the flow mean nothing
SPEED = "sqrt(max(u*u + v*v, 4e-4*U_ref**2))"
#: S: 1 ahead and -1 astern, where the hull is taken as its own mirror image fore and aft, and between the two
#: only for drift beyond 84 degrees
SENSE = "min(max(10*u/U, -1), 1)"

#: numbers without a unit: name -> (axis it acts on most, what it is). One that a file leaves out is 0, which
#: means: not there.
NUMBERS = {
    "t_P": ("X", "thrust deduction"),
    "w_P0": ("X", "wake at the propeller, straight ahead"),
    "k_0": ("X", "K_T at J = 0"),
    "k_1": ("X", "K_T by J"),
    "k_2": ("X", "K_T by J^2"),
    "k_back": ("X", "share of k_0 that turning astern loses"),
    "C_1": ("X", "how fast the wake changes with drift at the propeller"),
    "C_2plus": ("X", "change of the wake, drift at the propeller positive"),
    "C_2minus": ("X", "change of the wake, drift at the propeller negative"),
    "x_P": ("X", "place of the propeller in its drift, over L"),
    "tau_P": ("X", "change of the wake by |drift|, where no C_1 is given"),
    "c_P": ("X", "change of the wake by drift squared, where no C_1 is given"),
    "Y_back": ("Y", "side force of a propeller that turns astern, over rho n^2 D^4"),
    "N_back": ("N", "yaw moment of a propeller that turns astern, over rho n^2 D^4 L"),
    "kappa": ("N", "share of the race's gain of speed at the rudder"),
    "epsilon": ("N", "wake at the rudder over that at the propeller"),
    "f_alpha": ("N", "slope of the rudder's normal force"),
    "inverse_stall": ("N", "1 over the sine of the rudder's stall angle"),
    "gamma_plus": ("N", "flow straightening, drift at the rudder positive"),
    "gamma_minus": ("N", "flow straightening, drift at the rudder negative"),
    "l_R": ("N", "place of the rudder in its drift, over L"),
    "t_R": ("X", "deduction of the rudder's drag"),
    "a_H": ("Y", "side force of the hull by the rudder"),
    "x_H": ("N", "where that side force acts, over L"),
    "C_D": ("Y", "cross-flow drag of a [crossflow] hull, beside its Cdy"),
    "C_rY": ("Y", "share of the cross-flow by turning in its force, 1 where left out"),
    "C_rN": ("N", "share of the cross-flow by turning in its moment, 1 where left out"),
}
#: numbers without which there is no ship
REQUIRED = ("k_0", "w_P0", "epsilon", "f_alpha", "gamma_plus", "gamma_minus")
GEOMETRY = ("D_P", "H_R", "A_R", "x_R")
#: above the water, from [vehicle]: exposed areas ahead and abeam over L^2, centroid of the latter before
#: midship over L; of a file that states none, the larger of the built-in tankers
AIR = {"air_front": 0.015, "air_side": 0.058, "air_centroid": 0.0}
AREAS = ("air_front", "air_side")


def _acts_in(name: str) -> str:
    """Formula a number acts in, as tables print it."""
    texts = [*DEFINITIONS.values(), *(text for text, _ in FORCES.values()), *CROSS_FLOW.values()]
    return next(t for t in texts if any(getattr(n, "id", "") == name for n in ast.walk(ast.parse(t))))


HULL_ROWS = tuple(
    Term(f"{axis}_{name}", axis, regressor, source, "mmg")
    for rows, source in ((HULL, _SOURCE), (SLOW, "yoshimura2009"))
    for axis, named in rows.items()
    for name, regressor in named.items()
)
_OTHER_SOURCE = {
    **dict.fromkeys(("tau_P", "c_P"), "miyauchi2022"),
    **dict.fromkeys(("k_back", "Y_back", "N_back"), "miyauchi2022"),
    **dict.fromkeys(("C_D", "C_rY", "C_rN"), "yoshimura2009"),
    "inverse_stall": "assumed: lift factor 1/(1 + s^2/3), s = sin(alpha)/sin(alpha_stall)",
}
NUMBER_ROWS = tuple(
    Term(name, axis, _acts_in(name), _OTHER_SOURCE.get(name, _SOURCE), "number", about)
    for name, (axis, about) in NUMBERS.items()
)
#: what the formulas add to the balance, as rows of coefficient 1 that effects can ask for
PARTS = {
    key: Term(f"{key[1]}_{key[0]}", key[1], reads, _SOURCE, "part") for key, (_, reads) in FORCES.items()
}
