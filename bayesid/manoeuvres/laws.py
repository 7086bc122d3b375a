"""Helmsman and planesman: laws that read the state and order rudder or planes.

Takes: frozen settings; calling a law returns a fresh controller for one run.
Does not: integrate anything or limit rates.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from bayesid.manoeuvres.core import ClosedLoop, Commands, Controller, OpenLoop, mirrored
from bayesid.model.notation import STATES

X, Y, Z, PHI, THETA, PSI, U, V, W, P, Q, R = range(len(STATES))


@dataclass(frozen=True)
class ZigzagLaw:
    """Rudder (or stern planes) thrown over whenever the angle has left its start by the switch angle.

    Positive rudder turns to port (psi falls), positive stern plane pitches the bow down (theta falls): one
    law serves both. `deflection` and `switch` [rad]; a positive deflection is ordered first; after `executes`
    orders (0: no end) the surface goes back to `neutral` at the next switch.
    """

    deflection: float
    switch: float
    approach: float
    channel: str = "delta_r_cmd"
    executes: int = 0
    neutral: float = 0.0
    held: tuple[tuple[str, float], ...] = ()

    def mirrored(self) -> ZigzagLaw:
        """Port and starboard exchanged; a vertical zig-zag is its own mirror image."""
        if self.channel != "delta_r_cmd":
            return self
        return replace(self, deflection=-self.deflection, neutral=-self.neutral)

    def __call__(self) -> Helmsman:
        return Helmsman(self)


class Helmsman:
    """One run of a `ZigzagLaw`: the orders so far, and how far the next one is away."""

    def __init__(self, law: ZigzagLaw) -> None:
        self._law = law
        self._angle = PSI if law.channel == "delta_r_cmd" else THETA
        self._others = dict(law.held)
        self._base, self._side, self._orders, self._done = 0.0, 0.0, 0, False

    def __call__(self, t: float, state: np.ndarray) -> Commands:
        law = self._law
        if self._side == 0.0:
            # the heading at the first order counts as the base course, whatever the approach did
            self._base = float(state[self._angle])
            if t >= law.approach - 1e-9:
                self._side, self._orders = math.copysign(1.0, law.deflection), 1
        elif self.past(t, state) >= 0.0:
            if law.executes and self._orders >= law.executes:
                self._done = True
            else:
                self._side, self._orders = -self._side, self._orders + 1
        ordered = 0.0 if self._done else self._side * abs(law.deflection)
        return {**self._others, law.channel: law.neutral + ordered}

    def past(self, t: float, state: np.ndarray) -> float:
        """Time [s] or angle [rad] past the next order: negative before it, -inf where none comes."""
        if self._side == 0.0:
            return t - self._law.approach
        if self._done:
            return -math.inf
        return -self._side * (float(state[self._angle]) - self._base) - self._law.switch


@dataclass(frozen=True)
class DepthLaw:
    """Depth kept by stern planes: a look-ahead gives the pitch to ask for, pitch and its rate the planes.

    theta_cmd = -atan((z_cmd - z)/lookahead), limited; delta_s = k_theta (theta - theta_cmd) + k_q q, limited
    (positive plane pitches the bow down). `steps` are (time [s], depth change from the start [m]); the rudder
    and rpm stay at `held`; the commands of `added` (time from the start of the run) come on top of
    everything. A heavy or light boat keeps a depth error: there is no integral term, so that the law has no
    memory.
    """

    steps: tuple[tuple[float, float], ...]
    lookahead: float
    max_pitch: float
    max_plane: float
    k_theta: float
    k_q: float
    held: tuple[tuple[str, float], ...] = ()
    added: OpenLoop | None = None

    def mirrored(self) -> DepthLaw:
        """Rudder exchanged, depth and planes as they were."""
        flip = tuple((c, -v if c == "delta_r_cmd" else v) for c, v in self.held)
        extra = mirrored(self.added) if self.added else None
        assert not isinstance(extra, ClosedLoop)
        return replace(self, held=flip, added=extra)

    def __call__(self) -> Controller:
        z0: float | None = None
        others = dict(self.held)
        extra = self.added

        def order(t: float, state: np.ndarray) -> Commands:
            nonlocal z0
            if z0 is None:
                z0 = float(state[Z])
            wanted = z0
            for when, change in self.steps:
                if t >= when - 1e-9:
                    wanted = z0 + change
            pitch = -math.atan((wanted - float(state[Z])) / self.lookahead)
            pitch = min(max(pitch, -self.max_pitch), self.max_pitch)
            out = dict(others)
            out["delta_s_cmd"] = self.k_theta * (float(state[THETA]) - pitch) + self.k_q * float(state[Q])
            if extra is not None:
                row = max(int(np.searchsorted(extra.t, t + 1e-9, side="right")) - 1, 0)
                for channel, values in extra.commands.items():
                    out[channel] = out.get(channel, 0.0) + float(values[row])
            out["delta_s_cmd"] = min(max(out["delta_s_cmd"], -self.max_plane), self.max_plane)
            return out

        return order
