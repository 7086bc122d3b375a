"""What a logged trial is: runs of measured channels, commands and inputs in SI, read-only and hashed.

Takes arrays that are already converted and checked (`bayesid.trials.bundle` reads files).
Does not: know vehicles or models; a trial only names its vehicle.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from numbers import Real
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn, TypeVar

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import pandas

T = TypeVar("T")
Floats = NDArray[np.float64]
ROLES = ("identify", "holdout")


class _ReadOnly(dict[str, T]):
    """A dict that refuses changes and survives pickling."""

    refusal = ""

    def _refuse(self, *_: Any, **__: Any) -> NoReturn:
        raise TypeError(self.refusal)

    __setitem__ = __delitem__ = __ior__ = _refuse  # type: ignore[assignment]
    clear = pop = popitem = setdefault = update = _refuse  # type: ignore[assignment]

    def __reduce__(self) -> tuple[Any, ...]:
        return (type(self), (dict(self),))


class Channels(_ReadOnly[Floats]):
    """Name -> read-only (n,) array."""

    refusal = "a run is read-only; window(), resample() and dataclasses.replace() make new ones"


class StatedNoise(_ReadOnly[float]):
    """Channel -> one sigma of white sensor noise, SI."""

    refusal = "a trial is read-only; dataclasses.replace() makes new ones"


def _kind(value: Any) -> str:
    return type(value).__name__


def _check_texts(where: str, **texts: Any) -> None:
    for name, value in texts.items():
        if not isinstance(value, str):
            raise TypeError(f"{where}: {name} is {_kind(value)}; text is wanted")


def _all_texts(where: str, name: str, values: Any) -> tuple[str, ...]:
    """The texts as a tuple."""
    if isinstance(values, str) or not isinstance(values, Iterable):
        raise TypeError(f"{where}: {name} is {_kind(values)}; a tuple of texts is wanted")
    out = tuple(values)
    for value in out:
        if not isinstance(value, str):
            raise TypeError(f"{where}: {name} holds {_kind(value)}; a tuple of texts is wanted")
    return out


def _read_only(values: Any) -> Floats:
    if isinstance(values, np.ma.MaskedArray):  # a masked reading is none
        values = np.ma.filled(values.astype(float), np.nan)
    array = np.asarray(values, dtype=float)
    if array.flags.writeable:
        array = array.copy()
        array.flags.writeable = False
    return array


@dataclass(frozen=True, eq=False)
class Run:
    """One record of a trial.

    Attributes
    ----------
    name : file stem
    manoeuvre : free text
    role : "identify", or "holdout" (never read by a fit or a choice)
    t : (n,) s, strictly increasing, not necessarily regular
    data : measured pose and velocity, SI, NaN where a sample is missing; angles unwrapped
    commands : commanded inputs, finite; row k holds on [t_k, t_k+1); rudder port-positive, propeller rpm
    measured_inputs : inputs as measured, finite (gaps interpolated), same signs and units
    exogenous : measured wind, finite
    propulsion : measured thrust and torque, NaN where missing
    extra : columns without a canonical name, numbers as in the file
    warnings : what the reader noticed, without the file name
    provenance : how the run came from its file (windows, resampling)
    began : when the run began [s], of a part of one: from there effects that change with time count; None: at
        its first sample
    known_from : input -> time of its first value [s], of those without one at the beginning; before it that
        value stands
    acts_before : order -> time [s], up to a usual step, by which it acts before the row that holds it, as
        one does that changed since the row before; row k then holds from t_k less that
    digest : SHA-256 of everything above but warnings, notes and `known_from`, made when it is first asked for
    """

    name: str
    manoeuvre: str
    role: str
    t: Floats
    data: Mapping[str, Floats]
    commands: Mapping[str, Floats] = field(default_factory=dict)
    measured_inputs: Mapping[str, Floats] = field(default_factory=dict)
    exogenous: Mapping[str, Floats] = field(default_factory=dict)
    propulsion: Mapping[str, Floats] = field(default_factory=dict)
    extra: Mapping[str, Floats] = field(default_factory=dict)
    notes: str = ""
    warnings: tuple[str, ...] = ()
    provenance: tuple[str, ...] = ()
    began: float | None = None
    known_from: Mapping[str, float] = field(default_factory=dict)
    acts_before: Mapping[str, float] = field(default_factory=dict)

    GROUPS = ("data", "commands", "measured_inputs", "exogenous", "propulsion", "extra")

    def __post_init__(self) -> None:
        where = f"run {self.name!r}"
        _check_texts(where, name=self.name, manoeuvre=self.manoeuvre, notes=self.notes)
        if self.role not in ROLES:
            raise ValueError(f"role is {self.role!r}; one of {ROLES}")
        object.__setattr__(self, "t", _read_only(self.t))
        if self.began is not None:
            if not isinstance(self.began, Real) or not math.isfinite(self.began):
                raise TypeError(f"{where}: began is {self.began!r}; a time in s or None is wanted")
            object.__setattr__(self, "began", float(self.began))
        for name in ("warnings", "provenance"):
            object.__setattr__(self, name, _all_texts(where, name, getattr(self, name)))
        for group in self.GROUPS:
            if not isinstance(getattr(self, group), Mapping):
                kind = _kind(getattr(self, group))
                raise TypeError(f"{where}: {group} is {kind}; a mapping of names to arrays is wanted")
            _all_texts(where, group, getattr(self, group))
            frozen = Channels({name: _read_only(values) for name, values in getattr(self, group).items()})
            for name in sorted(frozen):
                if frozen[name].shape != self.t.shape:
                    raise ValueError(f"{self.name}: {name} has shape {frozen[name].shape}, t {self.t.shape}")
            object.__setattr__(self, group, frozen)

    @cached_property
    def digest(self) -> str:
        """SHA-256 of the run but for warnings and notes."""
        hashed = hashlib.sha256()
        for text in (self.name, self.manoeuvre, self.role, *self.provenance):
            hashed.update(text.encode("utf-8", "surrogatepass") + b"\0")
        hashed.update(self.t.tobytes())
        if self.began is not None:
            hashed.update(repr(self.began).encode())
        for name in sorted(self.acts_before):
            hashed.update(f"{name} {self.acts_before[name]!r}".encode("utf-8", "surrogatepass") + b"\0")
        for group in self.GROUPS:
            channels = getattr(self, group)
            for name in sorted(channels):
                hashed.update(f"{group}/{name}".encode("utf-8", "surrogatepass") + b"\0")
                hashed.update(channels[name].tobytes())
        return hashed.hexdigest()

    @property
    def n_samples(self) -> int:
        return int(self.t.size)

    @property
    def duration(self) -> float:
        """Time from first to last sample, s."""
        return float(self.t[-1] - self.t[0])

    def input(self, name: str) -> Floats | None:
        """Input `delta_r`, `delta_s`, `delta_b` or `n`: measured where logged, else commanded, else None."""
        return self.measured_inputs.get(name, self.commands.get(f"{name}_cmd"))


@dataclass(frozen=True)
class Environment:
    """Process noise known from elsewhere; None where it is not stated.

    force_rms : disturbance force relative to 1/2 rho L^2 U^2 (moments L^3)
    nav_drift : slow position drift, m
    """

    force_rms: float | None = None
    nav_drift: float | None = None


@dataclass(frozen=True, eq=False)
class Trial:
    """A set of runs of one vehicle on one occasion.

    Attributes
    ----------
    name : free text
    folder : where trial.toml was found
    vehicle_ref : path of a vehicle file in the bundle, or the name of a built-in vehicle; "" if not stated
    dof : 3 or 6
    runs : in the order of trial.toml
    noise : channel -> one sigma of white sensor noise, SI, read-only; may be empty
    environment : None if not stated
    measured_point : point whose position is logged, body axes, m
    rudder_positive : convention of the log; inside the program the rudder is always port-positive
    warnings : what the reader noticed, with file names
    velocity_from_track : whether u and v are the logged track differentiated, where that is known from
        readings that were thinned since; None: ask the readings
    single_over_average : channel -> noise of a single reading over that of the averages which the runs hold;
        empty where they hold none
    digest : SHA-256 of runs, noise, environment, dof and measured point (not of the vehicle), made when it is
        first asked for
    """

    name: str
    folder: Path
    vehicle_ref: str
    dof: int
    runs: tuple[Run, ...]
    noise: Mapping[str, float] = field(default_factory=dict)
    environment: Environment | None = None
    measured_point: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rudder_positive: str = "port"
    attribution: str = ""
    warnings: tuple[str, ...] = ()
    velocity_from_track: bool | None = None
    single_over_average: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        where = f"trial {self.name!r}"
        _check_texts(where, name=self.name)
        object.__setattr__(self, "runs", tuple(self.runs))
        for run in self.runs:
            if not isinstance(run, Run):
                raise TypeError(f"{where}: runs holds {_kind(run)}; Run is wanted")
        if not isinstance(self.noise, Mapping):
            raise TypeError(
                f"{where}: noise is {_kind(self.noise)}; a mapping of channels to sigmas is wanted"
            )
        for channel, sigma in self.noise.items():
            if not (isinstance(channel, str) and isinstance(sigma, Real)):
                raise TypeError(
                    f"{where}: noise has {channel!r}: {_kind(sigma)}; text and a number are wanted"
                )
        object.__setattr__(self, "noise", StatedNoise(self.noise))
        if not (self.environment is None or isinstance(self.environment, Environment)):
            raise TypeError(
                f"{where}: environment is {_kind(self.environment)}; Environment or None is wanted"
            )
        point = tuple(self.measured_point) if isinstance(self.measured_point, Iterable) else ()
        if len(point) != 3 or not all(isinstance(x, Real) for x in point):
            raise TypeError(f"{where}: measured_point is {self.measured_point!r}; three numbers are wanted")
        object.__setattr__(self, "measured_point", point)

    @cached_property
    def digest(self) -> str:
        """SHA-256 of what is read and stated."""
        stated = (self.dof, sorted(self.noise.items()), self.environment, self.measured_point)
        text = repr(stated) + "".join(run.digest for run in self.runs)
        return hashlib.sha256(text.encode()).hexdigest()

    def of_single_readings(self, noise: Mapping[str, float]) -> dict[str, float]:
        """Noise of averaged readings as that of the single ones they are made of; as it is where none are."""
        return {c: s * self.single_over_average.get(c, 1.0) for c, s in noise.items()}

    @classmethod
    def from_frames(cls, frames: Mapping[str, Any], vehicle: Any = "", **stated: Any) -> Trial:
        """A trial from pandas DataFrames or dicts of arrays; see `bayesid.trials.trial_from_frames`."""
        from bayesid.trials.frames import trial_from_frames

        return trial_from_frames(frames, vehicle, **stated)

    def to_dataframe(self) -> pandas.DataFrame:
        """All runs one below the other, SI: column `run`, `t`, and every channel and input."""
        import pandas

        frames = []
        for run in self.runs:
            groups = {
                k: v for group in run.GROUPS if group != "extra" for k, v in getattr(run, group).items()
            }
            frames.append(pandas.DataFrame({"run": run.name, "t": run.t, **groups}))
        return pandas.concat(frames, ignore_index=True)

    @property
    def identify(self) -> tuple[Run, ...]:
        """Runs a fit may read."""
        return tuple(run for run in self.runs if run.role == "identify")

    @property
    def holdout(self) -> tuple[Run, ...]:
        """Runs kept for judging."""
        return tuple(run for run in self.runs if run.role == "holdout")

    def run(self, name: str) -> Run:
        """The run of that name; KeyError lists the names there are."""
        for run in self.runs:
            if run.name == name:
                return run
        raise KeyError(f"no run {name!r} in {self.name!r}; there are {', '.join(r.name for r in self.runs)}")


def channels_of(runs: Iterable[Run], group: str = "data") -> tuple[str, ...]:
    """Names logged in any of the runs, in order of first appearance."""
    return tuple(dict.fromkeys(name for run in runs for name in getattr(run, group)))
