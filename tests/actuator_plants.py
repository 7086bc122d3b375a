"""Plants with turning thrusters, waterjets and rudders of their own names, told anew.

Matrices and integrator as of `thruster_plants`; nothing of bayesid's equations is used. The vehicle files are
written as the documentation says.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from bayesid.trials import Run, Trial

FINE = 0.02  # s, step of the integrator
STATES = ("x", "y", "psi", "u", "v", "r")
NOISE = {"x": 0.03, "y": 0.03, "psi": 0.01, "u": 0.01, "v": 0.01, "r": 0.005}

_HULL = """
format = 1
[vehicle]
name = "{name}"
nondimensional = false
plain_abs = true
planar_only = true
convention = "fossen"
rho = 1000.0
L = 2.0
mass = 55.0
Izz = 16.0
U_ref = 1.0

[propulsion]
model = "quadratic"
rpm_ref = 1000.0

{actuators}
[coef]
X_udot = -5.0
Y_vdot = -60.0
N_rdot = -12.0
X_u0 = -15.0
"X_u|u|" = -12.0
Y_v0 = -40.0
"Y_v|v|" = -120.0
Y_r0 = 3.0
N_v0 = 4.0
N_r0 = -18.0
"N_r|r|" = -12.0

[prior]
relative_sd = 0.2
"""
AZIMUTH = _HULL.format(
    name="a boat with a pod",
    actuators="""
[actuators.stern]
kind = "azimuth"
at = [-0.8, 0.0, 0.0]
direction = [1.0, 0.0, 0.0]
T_nn = 4e-5
T_un = -4e-3
reverse = 0.7
dead_band = 60.0
turn_rate_deg_s = 20.0
turn_lag = 0.3

[actuators.bow]
at = [0.7, 0.0, 0.0]
direction = [0.0, 1.0, 0.0]
T_nn = 1e-5
""",
)
WATERJET = _HULL.format(
    name="a boat with two jets",
    actuators="".join(
        f"""
[actuators.{name}]
kind = "waterjet"
at = [-0.9, {y}, 0.0]
direction = [1.0, 0.0, 0.0]
T_nn = 1.2e-5
T_un = -5e-3
dead_band = 100.0
nozzle_max_deg = 25.0
nozzle_rate_deg_s = 30.0
bucket_astern = 0.5
bucket_rate = 1.0
"""
        for name, y in (("port", -0.3), ("stbd", 0.3))
    ),
)
RUDDERS = _HULL.format(
    name="a boat with two screws and two rudders",
    actuators="".join(
        f"""
[actuators.{name}]
at = [-0.8, {y}, 0.0]
direction = [1.0, 0.0, 0.0]
T_nn = 2e-5
T_un = -2e-3

[actuators.{number}]
kind = "fin"
at = [-0.95, {y}, 0.0]
direction = [0.0, 1.0, 0.0]
F_uu = 15.0
F_nn = 1e-5
behind = "{name}"
D_uu = 8.0
max_deg = 35.0
rate_deg_s = 10.0
"""
        for number, name, y in ((1, "port", -0.4), (2, "stbd", 0.4))
    ),
)


def propeller(n, a, nn, un, band=0.0, astern=1.0):
    m = np.sign(n) * max(abs(n) - band, 0.0)
    force = nn * m * abs(m) + un * a * m
    return astern * force if n < 0 else force


def azimuth_forces(nu, c, beyond):
    """Surge, sway and yaw of a pod (n, angle) and a tunnel thruster (n)."""
    u, v, r = nu
    angle = c["azimuth_stern"]
    a = np.cos(angle) * u + np.sin(angle) * (v - 0.8 * r)
    push = beyond * propeller(c["n_stern"], a, 4e-5, -4e-3, 60.0, 0.7)
    bow = propeller(c["n_bow"], 0.0, 1e-5, 0.0)
    X, Y = push * np.cos(angle), push * np.sin(angle)
    return np.array([X, Y + bow, -0.8 * Y + 0.7 * bow])


def waterjet_forces(nu, c, beyond):
    """Two jets: momentum of what leaves, turned; of what comes in, lost."""
    u, v, r = nu
    out = np.zeros(3)
    for name, y in (("port", -0.3), ("stbd", 0.3)):
        m = max(c[f"n_{name}"] - 100.0, 0.0)
        jet = 1.2e-5 * m * m * (beyond if name == "port" else 1.0)
        taken = 5e-3 * m * (beyond if name == "port" else 1.0)
        ahead = 0.25 + 0.75 * c[f"bucket_{name}"]
        X = jet * ahead * np.cos(c[f"nozzle_{name}"]) - taken * (u - r * y)
        Y = jet * np.sin(c[f"nozzle_{name}"]) - taken * (v - 0.9 * r)
        out += (X, Y, -0.9 * Y - y * X)
    return out


def rudder_forces(nu, c, beyond):
    """Two fixed screws, a rudder in the race of each."""
    u, _, r = nu
    out = np.zeros(3)
    for number, name, y in ((1, "port", -0.4), (2, "stbd", 0.4)):
        a = u - r * y
        push, d = propeller(c[f"n_{name}"], a, 2e-5, -2e-3), c[f"delta_{number}"]
        scale = beyond if number == 2 else 1.0
        Y = scale * (15.0 * a * abs(a) + 1e-5 * max(c[f"n_{name}"], 0.0) ** 2) * d
        X = push - scale * 8.0 * a * abs(a) * d * d
        out += (X, Y, -0.95 * Y - y * X)
    return out


PLANTS = {
    "azimuth": (AZIMUTH, azimuth_forces, {"azimuth_stern": (np.radians(20.0), 0.3, 1e9)}),
    "waterjet": (
        WATERJET,
        waterjet_forces,
        {
            **{f"nozzle_{n}": (np.radians(30.0), 0.0, np.radians(25.0)) for n in ("port", "stbd")},
            **{f"bucket_{n}": (1.0, 0.0, 1.0) for n in ("port", "stbd")},
        },
    ),
    "rudders": (
        RUDDERS,
        rudder_forces,
        {f"delta_{i}": (np.radians(10.0), 0.0, np.radians(35.0)) for i in (1, 2)},
    ),
}  # fmt: skip


def follow(at, order, rate, lag, limit, h):
    """Position of a servo after a step."""
    order = np.clip(order, -limit, limit)
    wanted = (order - at) / lag if lag else (order - at) / h
    return at + np.clip(wanted, -rate, rate) * h


def rate(x, c, forces, beyond):
    """Rate of (x, y, psi, u, v, r)."""
    psi, (u, v, r) = x[2], x[3:]
    coriolis = np.array([-115.0 * v * r, 60.0 * u * r, (115.0 - 60.0) * u * v])
    damping = np.array([
        15.0 * u + 12.0 * u * abs(u),
        40.0 * v + 120.0 * v * abs(v) - 3.0 * r,
        18.0 * r + 12.0 * r * abs(r) - 4.0 * v,
    ])  # fmt: skip
    nudot = (forces(x[3:], c, beyond) - coriolis - damping) / np.array([60.0, 115.0, 28.0])
    cos, sin = np.cos(psi), np.sin(psi)
    return np.concatenate([[cos * u - sin * v, sin * u + cos * v, r], nudot])


def plant_run(which, name, t, orders, rng, beyond=1.0, slower=1.0, role="identify"):
    """A run from rest; orders by column, held from sample to sample; `slower` times the servo rates."""
    _, forces, servos = PLANTS[which]
    x, out = np.zeros(6), []
    # a pod without stops goes the shorter way round
    turned = {s: np.unwrap(v) if s.startswith("azimuth") else v for s, v in orders.items()}
    at = {s: float(v[0]) for s, v in orders.items()}
    for k in range(t.size):
        out.append(x.copy())
        if k + 1 == t.size:
            break
        count = max(1, round((t[k + 1] - t[k]) / FINE))
        h = (t[k + 1] - t[k]) / count
        for _ in range(count):
            held = {}
            for s, values in turned.items():
                end = values[k]
                if s in servos:
                    speed, lag, limit = servos[s]
                    end = follow(at[s], values[k], slower * speed, lag, limit, h)
                held[s], at[s] = 0.5 * (at[s] + end) if s in servos else end, end
            k1 = rate(x, held, forces, beyond)
            k2 = rate(x + h / 2 * k1, held, forces, beyond)
            k3 = rate(x + h / 2 * k2, held, forces, beyond)
            k4 = rate(x + h * k3, held, forces, beyond)
            x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    states = np.array(out)
    data = {c: v + NOISE[c] * rng.standard_normal(t.size) for c, v in zip(STATES, states.T, strict=True)}
    return Run(name, name, role, t, data, {f"{s}_cmd": v.copy() for s, v in orders.items()}), states


def _steps(rng, t, low, high, every):
    return rng.uniform(low, high, int(t[-1] // every) + 1)[(t // every).astype(int)]


def orders_of(which, rng, t):
    """Steps of every input, each by itself."""
    if which == "azimuth":
        return {
            "n_stern": _steps(rng, t, -300, 900, 25), "azimuth_stern": _steps(rng, t, -2.0, 2.0, 15),
            "n_bow": _steps(rng, t, -700, 700, 18),
        }  # fmt: skip
    if which == "waterjet":
        return {
            **{f"n_{n}": _steps(rng, t, 500, 2500, 20) for n in ("port", "stbd")},
            **{f"nozzle_{n}": _steps(rng, t, -0.4, 0.4, 12) for n in ("port", "stbd")},
            **{f"bucket_{n}": _steps(rng, t, -1, 1.0, 26) for n in ("port", "stbd")},
        }
    return {
        **{f"n_{n}": _steps(rng, t, 300, 1100, 25) for n in ("port", "stbd")},
        **{f"delta_{i}": _steps(rng, t, -0.6, 0.6, 15) for i in (1, 2)},
    }


def plant_trial(which, path, seed=0, **planted):
    """Two runs to fit and one held out, of the vehicle file at `path`."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, 120.0, 0.5)
    runs = tuple(
        plant_run(which, name, t, orders_of(which, rng, t), rng, role=role, **planted)[0]
        for name, role in (("a", "identify"), ("b", "identify"), ("c", "holdout"))
    )
    return Trial(which, Path("."), str(path), 3, runs, noise=NOISE)
