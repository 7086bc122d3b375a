"""Plants with thrusters, told anew: mass, Coriolis and damping matrices and an integrator of their own.

Nothing of bayesid's equations is used; only `Run` and `Trial` hold the logs.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from bayesid.trials import Run, Trial

BOAT = Path(__file__).parent / "data" / "differential_boat.toml"
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
