"""The letters every other module shares: axes, pose, body velocity.

SNAME/Fossen order and signs: x forward, y starboard, z down; angles ZYX Euler in radians.
Holds names only, no mathematics.
"""

from __future__ import annotations

AXES = ("X", "Y", "Z", "K", "M", "N")
POSE = ("x", "y", "z", "phi", "theta", "psi")
VELOCITY = ("u", "v", "w", "p", "q", "r")
STATES = POSE + VELOCITY

FORCE_AXES = AXES[:3]
MOMENT_AXES = AXES[3:]
ORDER_TIMES = "orders_t"  # name among orders: since when those of a sample are given [s]
