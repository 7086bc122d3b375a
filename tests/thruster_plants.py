"""Plants with thrusters, told anew: mass, Coriolis and damping matrices and an integrator of their own.

Nothing of bayesid's equations is used; only `Run` and `Trial` hold the logs.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from bayesid.model.vehicles.reading import BUILTIN_FOLDER
from bayesid.trials import Run, Trial

BOAT = BUILTIN_FOLDER / "differential_boat.toml"
FINE = 0.02  # s, step of the integrator


def _curve(n, a):
    m = np.sign(n) * min(max(abs(n) - 60.0, 0.0), 1400.0)
    force = 2e-5 * m * abs(m) - 2e-3 * a * m
    return 0.7 * force if n < 0 else force


def boat_rate(x, n, current, gain):
    """Rate of (x, y, psi, u, v, r) over ground at shaft speeds n (2,) [rpm]."""
    psi = x[2]
    c, s = np.cos(psi), np.sin(psi)
    drift = np.array([c * current[0] + s * current[1], -s * current[0] + c * current[1], 0.0])
    nu = x[3:] - drift
    u, v, r = nu
    drift_rate = np.array([r * drift[1], -r * drift[0], 0.0])  # the current is constant over ground
    mass = np.diag([60.0, 115.0, 28.0])
    coriolis = np.array([-115.0 * v * r, 60.0 * u * r, (115.0 - 60.0) * u * v])
    damping = np.array([
        15.0 * u + 12.0 * u * abs(u),
        40.0 * v + 120.0 * v * abs(v) - 3.0 * r,
        18.0 * r + 12.0 * r * abs(r) - 4.0 * v,
    ])  # fmt: skip
    port = gain[0] * _curve(n[0], u + 0.4 * r)
    stbd = gain[1] * _curve(n[1], u - 0.4 * r)
    tau = np.array([port + stbd, 0.0, 0.4 * port - 0.4 * stbd])
    nudot = np.linalg.solve(mass, tau - coriolis - damping) + drift_rate
    return np.concatenate([[c * x[3] - s * x[4], s * x[3] + c * x[4], x[5]], nudot])


def boat_run(name, t, orders, rng, current=(0.0, 0.0), gain=(1.0, 1.0), lag=0.0, role="identify"):
    """A run from rest; orders (n, 2) [rpm] held from sample to sample."""
    x, shaft, out = np.zeros(6), np.array(orders[0], dtype=float), []
    x[3:5] = current
    for k, at in enumerate(t):
        out.append(x.copy())
        if k + 1 == t.size:
            break
        count = max(1, round((t[k + 1] - at) / FINE))
        h = (t[k + 1] - at) / count
        for _ in range(count):
            # shafts lag; their mean over the step acts
            end = orders[k] + (shaft - orders[k]) * np.exp(-h / lag) if lag else orders[k]
            n, shaft = 0.5 * (shaft + end) if lag else orders[k], end
            k1 = boat_rate(x, n, current, gain)
            k2 = boat_rate(x + h / 2 * k1, n, current, gain)
            k3 = boat_rate(x + h / 2 * k2, n, current, gain)
            k4 = boat_rate(x + h * k3, n, current, gain)
            x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    noise = {"x": 0.03, "y": 0.03, "psi": 0.01, "u": 0.01, "v": 0.01, "r": 0.005}
    data = {
        c: v + s * rng.standard_normal(t.size)
        for (c, s), v in zip(noise.items(), np.array(out).T, strict=True)
    }
    commands = {"n_port_cmd": orders[:, 0].copy(), "n_stbd_cmd": orders[:, 1].copy()}
    return Run(name, name, role, t, data, commands), np.array(out), noise


def boat_trial(seed=0, **planted):
    """Three runs: zig-zag by thrust, spins on the spot and astern, held-out steps."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, 120.0, 0.5)
    swing = np.where((t // 15) % 2 == 0, 1.0, -1.0)
    late = np.clip(t - 5.0, 0.0, 1.0)
    zig = np.stack([900 + 250 * swing, 900 - 250 * swing], axis=1) * late[:, None]
    spin = np.stack([700 * swing, -700 * swing], axis=1)
    spin[t > 70] = (-800.0, -600.0)
    steps = np.stack([600 + 5 * t, 1100 - 3 * t], axis=1)
    runs, noise = [], {}
    for name, orders, role in (
        ("zig", zig, "identify"),
        ("spin", spin, "identify"),
        ("steps", steps, "holdout"),
    ):
        run, _, noise = boat_run(name, t, orders, rng, role=role, **planted)
        runs.append(run)
    return Trial("boat", Path("."), str(BOAT), 3, tuple(runs), noise=noise)


ROV = BUILTIN_FOLDER / "six_thruster_rov.toml"
_S = np.sqrt(0.5)
_AT = np.array(
    [[0.15, 0.1, 0], [0.15, -0.1, 0], [-0.15, 0.1, 0], [-0.15, -0.1, 0], [0, 0.11, -0.05], [0, -0.11, -0.05]]
)
_ALONG = np.array([[_S, -_S, 0], [_S, _S, 0], [_S, _S, 0], [_S, -_S, 0], [0, 0, 1], [0, 0, 1]])


def _skew(a):
    return np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])


def rov_rate(eta, nu, n, gain):
    """Rates of pose (6,) and velocity (6,): Fossen's matrices, Coriolis from the mass matrix by blocks."""
    centre = np.array([0.0, 0.0, 0.02])
    body = np.block([
        [11.5 * np.eye(3), -11.5 * _skew(centre)],
        [11.5 * _skew(centre), np.diag([0.21, 0.24, 0.26])],
    ])  # fmt: skip
    mass = body + np.diag([5.5, 12.7, 14.6, 0.12, 0.12, 0.12])
    impulse = mass @ nu
    turning = np.concatenate([
        np.cross(nu[3:], impulse[:3]),
        np.cross(nu[3:], impulse[3:]) + np.cross(nu[:3], impulse[:3]),
    ])  # fmt: skip
    linear = np.array([4.0, 6.2, 5.2, 0.3, 0.0, 0.3])
    square = np.array([18.2, 21.7, 37.0, 1.5, 1.5, 1.5])
    phi, theta, psi = eta[3:]
    (cf, sf), (ct, st), (cp, sp) = ((np.cos(a), np.sin(a)) for a in (phi, theta, psi))
    down = np.array([-st, sf * ct, cf * ct])
    weight = np.concatenate([np.zeros(3), np.cross(centre, 11.5 * 9.81 * down)])
    force = (gain * 2.5e-6 * n * np.abs(n))[:, None] * _ALONG
    tau = np.concatenate([force.sum(axis=0), np.cross(_AT, force).sum(axis=0)])
    turn = np.array([
        [cp * ct, cp * st * sf - sp * cf, sp * sf + cp * cf * st],
        [sp * ct, cp * cf + sf * st * sp, st * sp * cf - cp * sf],
        [-st, ct * sf, ct * cf],
    ])  # fmt: skip
    euler = np.array([[1, sf * st / ct, cf * st / ct], [0, cf, -sf], [0, sf / ct, cf / ct]])
    nudot = np.linalg.solve(mass, tau + weight - turning - linear * nu - square * nu * np.abs(nu))
    return np.concatenate([turn @ nu[:3], euler @ nu[3:], nudot])


def rov_run(name, t, orders, rng, gain=(1, 1, 1, 1, 1, 1), role="identify"):
    """A run from hover; orders (n, 6) [rpm] held from sample to sample."""
    x, out, gain = np.zeros(12), [], np.array(gain, dtype=float)
    for k, at in enumerate(t):
        out.append(x.copy())
        count = 0 if k + 1 == t.size else max(1, round((t[k + 1] - at) / FINE))
        for _ in range(count):
            h = (t[k + 1] - at) / count

            def rate(x, n=orders[k]):
                return rov_rate(x[:6], x[6:], n, gain)

            k1 = rate(x)
            k2 = rate(x + h / 2 * k1)
            k3 = rate(x + h / 2 * k2)
            x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + rate(x + h * k3))
    names = ("x", "y", "z", "phi", "theta", "psi", "u", "v", "w", "p", "q", "r")
    sigma = np.array([0.02, 0.02, 0.01, 0.005, 0.005, 0.01, 0.01, 0.01, 0.01, 0.005, 0.005, 0.005])
    states = np.array(out)
    read = states + sigma * rng.standard_normal(states.shape)
    commands = {f"n_{i + 1}_cmd": orders[:, i].copy() for i in range(6)}
    noise = dict(zip(names, sigma.tolist(), strict=True))
    return Run(name, name, role, t, dict(zip(names, read.T, strict=True)), commands), states, noise


def rov_trial(seed=0, **planted):
    """Two runs of steps of every thruster from hover, and one held out."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, 40.0, 0.25)
    runs, noise = [], {}
    for name, role in (("a", "identify"), ("b", "identify"), ("c", "holdout")):
        levels = rng.uniform(-1200, 1200, (t.size // 20 + 1, 6))
        orders = levels[np.arange(t.size) // 20]
        run, _, noise = rov_run(name, t, orders, rng, role=role, **planted)
        runs.append(run)
    return Trial("rov", Path("."), str(ROV), 6, tuple(runs), noise=noise)
