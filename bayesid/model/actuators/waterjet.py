"""A waterjet with a nozzle that steers and, if there is one, a bucket that reverses.

Takes: nothing. Gives the declaration and the formulas of its force. Does not: know pump, cavitation or head.

By momentum (Allison 1993, Trans. SNAME 101, 275-335): a flow Q leaves at Q/A and comes in with the speed of
the hull, so the jet pushes with rho Q^2/A and the water taken in holds back with rho Q a. With Q in
proportion to the revolutions m beyond the dead band these are T_nn m^2 and -T_un a m. The nozzle turns the
jet alone, not what comes in, which loses its whole velocity to the hull, across as well as along.

Bucket, 1 up and -1 down: the share of the jet that goes ahead falls linearly from 1 to -`bucket_astern`; what
the nozzle turns aside stays, as in a bucket that splits the jet behind the nozzle
(source: assumed; makers' curves are not linear, and other buckets steer the other way astern).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from bayesid.model.actuators.declare import (
    PLACE,
    UNLIMITED,
    Actuator,
    Part,
    Shape,
    arms,
    inflow,
    own,
    place,
    place_names,
    servo,
    servo_keys,
    servo_names,
    travel_keys,
)
from bayesid.model.actuators.thruster import CURVE, SHAFT
from bayesid.model.file_keys import FileKey

_CURVE: dict[str, FileKey] = {
    "T_nn": FileKey("number", "N/rpm^2, thrust of the jet at rest over n^2", required=True, low=0.0,
                    high=1e9),
    "T_un": FileKey("number", "N s/(m rpm), what the water taken in changes per speed; below 0",
                    default=0.0, low=-1e9, high=0.0),
    "dead_band": CURVE["dead_band"],
    "limit": CURVE["limit"],
}  # fmt: skip
_STEER: dict[str, FileKey] = {
    **servo_keys("nozzle_", "the nozzle"),
    "bucket_astern": FileKey("number", "thrust astern with the bucket down over thrust ahead; without it "
                             "there is no bucket", low=0.0, high=2.0),
    **travel_keys("bucket_rate", "bucket_lag", "the bucket", "1/s, of the bucket, whose way is 2"),
}  # fmt: skip


@dataclass(frozen=True)
class Waterjet(Actuator):
    """One waterjet; it reads `n_<name>` [rpm], `nozzle_<name>` [rad, turned as an azimuth] and, with
    `bucket_astern`, `bucket_<name>` [1 up, -1 down], measured or `_cmd`."""

    T_nn: float
    T_un: float = 0.0
    dead_band: float = 0.0
    limit: float = UNLIMITED
    nozzle_max_deg: float = UNLIMITED
    nozzle_rate_deg_s: float = UNLIMITED
    nozzle_lag: float = 0.0
    bucket_astern: float | None = None
    bucket_rate: float = UNLIMITED
    bucket_lag: float = 0.0

    kind = "waterjet"
    meaning = "A waterjet with a nozzle that steers and a bucket that reverses."
    keys: ClassVar[Mapping[str, FileKey]] = {**PLACE, **_CURVE, **SHAFT, **_STEER}

    @property
    def signal(self) -> str:
        return f"n_{self.name}"

    @property
    def shape(self) -> Shape:
        return Shape(self.kind, self.name, () if self.bucket_astern is None else ("bucket",))

    @property
    def constants(self) -> dict[str, float]:
        nozzle, *bucket = self.turned_by(self.shape)
        out = super().constants | servo(nozzle, self.nozzle_rate_deg_s, self.nozzle_lag, self.nozzle_max_deg)
        for one in bucket:
            out |= servo(one, self.bucket_rate, self.bucket_lag, 1.0, unit=1.0)
        return out

    @property
    def problems(self) -> tuple[str, ...]:
        if self.bucket_astern is None and (self.bucket_rate, self.bucket_lag) != (UNLIMITED, 0.0):
            return ("bucket_rate and bucket_lag are of a bucket: give bucket_astern too",)
        return ()

    @classmethod
    def signals_of(cls, shape: Shape) -> tuple[str, ...]:
        return (f"n_{shape.name}", *cls.turned_by(shape))

    @classmethod
    def turned_by(cls, shape: Shape) -> tuple[str, ...]:
        return (f"nozzle_{shape.name}", *(f"{word}_{shape.name}" for word in shape.details))

    @classmethod
    def constants_of(cls, shape: Shape) -> tuple[str, ...]:
        names = [own(shape, key) for key in _CURVE]
        names += [own(shape, "bucket_astern")] if shape.details else []
        servos = [name for signal in cls.turned_by(shape) for name in servo_names(signal)]
        return (*names, *place_names(shape), *servos)

    @classmethod
    def parts(cls, shape: Shape) -> tuple[Part, ...]:
        at, along = place(shape)
        dx, dy, _ = along
        across = (f"(-{dy})", dx, "0")
        n, angle = (f"{word}_{shape.name}" for word in ("n", "nozzle"))
        m = f"min(max({n} - {own(shape, 'dead_band')}, 0), {own(shape, 'limit')})"
        ahead = "1"
        if shape.details:
            astern = own(shape, "bucket_astern")
            ahead = f"((1 - {astern}) + (1 + {astern})*bucket_{shape.name})/2"
        jet, taken = f"{own(shape, 'T_nn')}*{m}*{m}", f"{own(shape, 'T_un')}*{m}"
        return (
            (f"{jet}*({ahead})*cos({angle})", arms(at, along)),
            (f"{jet}*sin({angle})", arms(at, across)),
            (f"{taken}*{inflow(at, along)}", arms(at, along)),
            (f"{taken}*{inflow(at, across)}", arms(at, across)),
        )
