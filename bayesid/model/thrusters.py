"""Named thrusters of a vehicle: column of the log, place, direction, curve of thrust, and what may be wrong.

Takes: nothing. Gives the declaration, the formulas of force and moment, and the effects of each thruster.
Does not: turn a thruster (azimuth), or know its shaft and torque.

Thrust along the direction, ahead positive, m being the revolutions beyond the dead band and within the limit:
    T = (T_nn m |m| + T_un a m) (reverse where m < 0),    a = inflow along the direction
"""

from __future__ import annotations

from dataclasses import dataclass

from bayesid.model.channels import THRUSTERS
from bayesid.model.file_keys import FileKey

NAMES = THRUSTERS
UNLIMITED = 1e9  # rpm
#: keys of [actuators.NAME]
KEYS: dict[str, FileKey] = {
    "at": FileKey("numbers", "m, where the thrust acts, body axes", length=3, required=True),
    "direction": FileKey("numbers", "of positive thrust, body axes; any length", length=3, required=True),
    "T_nn": FileKey("number", "N/rpm^2, thrust at rest over n |n|", required=True, low=-1e9, high=1e9),
    "T_un": FileKey("number", "N s/(m rpm), change with the inflow", default=0.0, low=-1e9, high=1e9),
    "reverse": FileKey("number", "thrust astern over thrust ahead", default=1.0, low=0.0, high=10.0),
    "dead_band": FileKey("number", "rpm, below which there is no thrust", default=0.0, low=0.0, high=1e6),
    "limit": FileKey("number", "rpm, largest revolutions", default=UNLIMITED, low=0.0, high=UNLIMITED),
}
_SCALARS = ("T_nn", "T_un", "reverse", "dead_band", "limit")
_VECTORS = {"at": ("x", "y", "z"), "direction": ("dx", "dy", "dz")}


@dataclass(frozen=True)
class Thruster:
    """One thruster; keys as in `KEYS`, `direction` of length 1. It reads `n_<name>_cmd`
    or `n_<name>` [rpm]."""

    name: str
    at: tuple[float, float, float]
    direction: tuple[float, float, float]
    T_nn: float
    T_un: float = 0.0
    reverse: float = 1.0
    dead_band: float = 0.0
    limit: float = UNLIMITED

    @property
    def signal(self) -> str:
        return f"n_{self.name}"

    @property
    def constants(self) -> dict[str, float]:
        """Numbers under their names in a model's parameter vector."""
        values = {key: float(getattr(self, key)) for key in _SCALARS}
        for key, parts in _VECTORS.items():
            values |= dict(zip(parts, map(float, getattr(self, key)), strict=True))
        return {_own(self.name, key): value for key, value in values.items()}


def _own(name: str, key: str) -> str:
    return f"thruster_{name}_{key}"


def constants(name: str) -> tuple[str, ...]:
    """Names of a thruster's numbers in the parameter vector."""
    return tuple(_own(name, key) for key in (*_SCALARS, *(p for parts in _VECTORS.values() for p in parts)))


def thrust(name: str) -> str:
    """Formula of the thrust [N]."""
    n, c = f"n_{name}", {key.rpartition("_")[2]: key for key in constants(name)}
    band, limit, back = (_own(name, k) for k in ("dead_band", "limit", "reverse"))
    m = f"(sgn({n})*min(max(abs({n}) - {band}, 0), {limit}))"
    inflow = (
        f"({c['dx']}*(u + q*{c['z']} - r*{c['y']}) + {c['dy']}*(v + r*{c['x']} - p*{c['z']})"
        f" + {c['dz']}*(w + p*{c['y']} - q*{c['x']}))"
    )
    curve = f"({_own(name, 'T_nn')}*{m}*abs({m}) + {_own(name, 'T_un')}*{inflow}*{m})"
    return f"{curve}*(1 + ({back} - 1)*step(-{n}))"


def wrench(name: str) -> dict[str, str]:
    """Formulas of force and moment about the origin by axis, over the thrust."""
    x, y, z, dx, dy, dz = (_own(name, key) for key in ("x", "y", "z", "dx", "dy", "dz"))
    return {
        "X": dx, "Y": dy, "Z": dz,
        "K": f"({y}*{dz} - {z}*{dy})", "M": f"({z}*{dx} - {x}*{dz})", "N": f"({x}*{dy} - {y}*{dx})",
    }  # fmt: skip
