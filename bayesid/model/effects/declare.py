"""What an unmodelled effect is: one frozen declaration with port, equation, parameters, size and source.

Takes nothing; the catalogue modules beside it hold the declarations.
Does not compile or simulate anything: the kernel generator reads these fields.

Symbols an equation may use
---------------------------
flow      t [s from the first sample]; wind_north wind_east -> north, east, down: velocity of the water over
          ground [m/s]
force     u v w p q r through the water; ug vg wg over ground; udot..rdot over ground (linear only);
          x y z phi theta psi; delta_r delta_s delta_b n; t; wind_north wind_east (measured, blowing towards);
          L rho rpm_ref U_ref height and the mass properties; the effect's own states and parameters;
          coef('Y_dr') a coefficient in SI, rows('Y', 'delta_r') the part of an axis that reads a symbol,
          thrust() of the propulsion rows, drag() of the straight-ahead rows, quadratic_drag() of those of
          them that go with the square of the speed -> body wrench added [N, N m]
states    the same symbols -> rate of an extra state that starts at its `initial` expression
adjust    `value` is the constant to change (mass property or coefficient in SI); all formulas of one
          effect read the constants as they were before it
input     x the signal so far (mean over the step), y the stage's output at the end of the last step, h the
          step: `end` is the output at the end of the step, `mean` its mean over the step; `delay` names the
          parameter of a pure delay
sensor    the channels an effect changes as read so far, every other channel of the true state -> the reading

Functions: abs sgn sqrt sin cos exp tanh min max step. A power that is no whole number takes a negative base
as 0. At a tie min() and max() have the slope of their first argument.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from bayesid.errors import ModelError

PORTS = ("input", "flow", "force", "sensor")
_OVER_GROUND = re.compile(r"\b(psi|wind_north|wind_east)\b")
_SERVO = re.compile(r"(servo_lag|inverse_rate)_(\w+)")
_FINS = {"r": "delta_r", "s": "delta_s", "b": "delta_b"}


@dataclass(frozen=True)
class EffectParameter:
    """One unknown of an effect.

    `sd` is the prior standard deviation in units of `scale`, a product of vehicle scales such as "U", "L/U"
    or "rho*L**2*U**2/2" that turns it into `unit`. `off` is the value at which the effect is absent and
    `mean` the centre of the prior (they differ only for shape parameters whose amplitude partner is zero when
    off). Outside `low` to `high`, in units of `scale` as well, it is not this effect: no probability goes
    there. A planar model cannot tell values from `roll_from` to `off` from a list or heel it leaves out, and
    without a reading of v none tells values up to `leeway` to either side from that of a constant side force.
    `assumed` is the relative standard deviation that constants assumed in the form (areas nobody declared)
    add to the size that is told; the force itself is known better. `dated` is a time of every run from which
    the effect acts: nothing tells it while the effect is off, so a screen tries several, and the effect has
    `smooth=False`. `shape` is for a parameter that changes nothing alone though it is nought when off: the
    place of a mass is not small because the mass is.
    """

    name: str
    unit: str
    sd: float
    scale: str = "1"
    off: float = 0.0
    mean: float = 0.0
    one_sided: bool = False
    low: float = -math.inf
    high: float = math.inf
    roll_from: float = 0.0
    leeway: float = 0.0
    assumed: float = 0.0
    dated: bool = False
    shape: bool = False
    about: str = ""


# Orders of links from which on, and before which, a position is slower than its order (lag, rate limit).
SERVO_STAGES = (30, 50)


@dataclass(frozen=True)
class InputStage:
    """One link of an actuator chain; links run in rising `order` (dead time 10, backlash 25, lag 30,
    the vehicle's own rate limit 40 and clip 50, offset 60)."""

    signal: str
    order: int
    end: str = "x"
    mean: str = "x"
    delay: str | None = None


@dataclass(frozen=True)
class State:
    """Extra state of a force effect: rate and initial value as expressions, and how far it may be off at the
    start of a run: `sd` in units of `scale`, as of a parameter."""

    name: str
    rate: str
    initial: str = "0"
    sd: float = 0.1
    scale: str = "U"


@dataclass(frozen=True)
class Effect:
    """An effect the nominal model leaves out. See the module docstring for the equation symbols.

    `form` says what was chosen where the source leaves a choice (which terms, where they act, what is left
    out) and names the alternative of `alternatives` that chooses otherwise, if there is one.

    `says` is the effect in one sentence for whoever runs the vehicle, with places for its sizes: see
    `bayesid.diagnosis.plain_words`. `says_over` is that sentence where the simulator already has a part of
    it, such as a wind that is measured.

    `as_form` is for a force that depends on the motion alone, as any force does that the equations lack:
    "also" where it is a cause of its own as well, "only" where it is not, "alone" where it pushes to one side
    on a straight course: no part of a form, and beside one no more than a rival of what it explains better.
    `planar` effects are what a model in the horizontal plane leaves out; one with roll and pitch has them.
    `at_surface` effects reach only a vehicle at the surface.
    """

    name: str
    family: str
    port: str
    where: tuple[str, ...]
    parameters: tuple[EffectParameter, ...]
    source: str
    magnitude: str
    aliases: tuple[str, ...] = ()
    dof: int = 3
    flow: Mapping[str, str] = field(default_factory=dict)
    force: Mapping[str, str] = field(default_factory=dict)
    states: tuple[State, ...] = ()
    adjust: Mapping[str, str] = field(default_factory=dict)
    stages: tuple[InputStage, ...] = ()
    sensor: Mapping[str, str] = field(default_factory=dict)
    sensor_delay: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    smooth: bool = True
    form: str = ""
    says: str = ""
    says_over: str = ""
    as_form: Literal["", "also", "only", "alone"] = ""
    planar: bool = False
    at_surface: bool = False

    def __post_init__(self) -> None:
        times = [i for i, p in enumerate(self.parameters) if p.dated]
        if times and (self.smooth or times == [0] or len(times) > 1):
            raise ModelError(
                f"effect {self.name!r}: one dated parameter, behind the size, and smooth=False are wanted: "
                "nothing tells its time while it is off"
            )

    def acts_in(self, dof: int) -> bool:
        """Whether a model of 3 or 6 degrees of freedom can have it."""
        return self.dof <= dof and not (self.planar and dof > 3)

    @property
    def needs(self) -> str:
        """Actuator without which nothing comes of it: "delta_r", "delta_s", "n" or a named one; else ""."""
        moved = {stage.signal for stage in self.stages} | {
            _FINS.get(found[2], found[2]) for name in self.adjust if (found := _SERVO.fullmatch(name))
        }
        if len(moved) == 1 and not self.force:
            return moved.pop()
        for name, pattern in (
            ("delta_r", r"\bdelta_r\b"), ("delta_s", r"\bdelta_s\b"), ("n", r"\bn\b|\bthrust\(\)"),
        ):  # fmt: skip
            if self.force and all(re.search(pattern, text) for text in self.force.values()):
                return name
        return ""

    @property
    def fixed_to_earth(self) -> bool:
        """Whether it acts around the vehicle, so that what it does depends on the heading: water that moves,
        or a force with a direction over ground."""
        return bool(self.flow) or any(_OVER_GROUND.search(text) for text in self.force.values())

    @property
    def dated(self) -> int | None:
        """Position of the parameter that is a time of every run, None without one."""
        return next((i for i, p in enumerate(self.parameters) if p.dated), None)

    def key(self, parameter: str) -> str:
        """Name of one parameter in a model's parameter layout."""
        return f"{self.name}.{parameter}"


RUDDER_WHERE = ("rudder", "N", "Y+N")
