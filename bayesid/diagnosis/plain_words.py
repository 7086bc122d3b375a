"""An effect in one sentence for whoever runs the vehicle: its declaration's `says` with sizes filled in.

Takes an `Effect` of a result. Gives text in engineering units. Does not know any effect by name.

A place in `says` is `{what:unit}` or `{what:unit:positive:negative}`: `what` is a parameter, a sum `a+b` of a
parameter and a constant of the vehicle file that the effect changes, or the two parts `north,east` of a
vector. A unit that begins with `1/` takes the reciprocal; `%` is a share. With the two last parts the size is
printed without its sign, followed by the word of the sign.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import NamedTuple

from bayesid.diagnosis.hypotheses.sensitivity_bank import EVERY
from bayesid.diagnosis.result_parts import Effect, Estimate

_PLACE = re.compile(r"\{([^{}:]+):([^{}:]+)(?::([^{}:]*):([^{}:]*))?\}")
_DEGREE = 180 / math.pi
# unit of a place -> factor from SI and the words behind the number
_UNITS = {
    "deg": (_DEGREE, " degrees"),
    "bearing": (_DEGREE, " degrees"),
    "deg/s": (_DEGREE, " degrees a second"),
    "%": (100.0, " %"),
    "s": (1.0, " seconds"),
    "m": (1.0, " m"),
    "m/s": (1.0, " m/s"),
    "N": (1.0, " N"),
    "N m": (1.0, " N m"),
    "rpm": (1.0, " rpm"),
    "L/U": (1.0, " hull lengths of travel"),
    "-": (1.0, ""),
}
TIMES = {3.0: "three", 10.0: "ten"}
ANY_DIRECTION = "any direction"
UNLIMITED = 1e5  # degrees, or degrees a second, from which a limit is none
Z95 = 1.96


class Size(NamedTuple):
    """A value with the 95 % interval to use; both ends are the value where it is exact."""

    value: float
    low: float
    high: float

    def mapped(self, change: Callable[[float], float]) -> Size:
        ends = sorted((change(self.low), change(self.high)))
        return Size(change(self.value), *ends)


def sentence(effect: Effect) -> str:
    """The effect as a sentence; its name where it says nothing of itself or has no size."""
    try:
        said = _PLACE.sub(lambda m: _place(effect, m), effect.says)
    except KeyError:
        said = ""
    return said or f"{effect.name.replace('_', ' ').capitalize()} acts."


def size_words(effect: Effect) -> str:
    """The size in the sentence alone, "0.21 seconds"; empty where there is none, or more than one."""
    own = [m for m in _PLACE.finditer(effect.says) if set(re.split("[+,]", m[1])) & set(effect.parameters)]
    try:
        return _place(effect, own[0]) if len(own) == 1 else ""
    except KeyError:
        return ""


def intervals(effect: Effect) -> list[str]:
    """The sizes in the sentence with the 95 % interval to use, one text each."""
    out = []
    for m in _PLACE.finditer(effect.says):
        try:
            size = _length(effect, m[1]) if "," in m[1] else _size(effect, m[1], m[2])
        except KeyError:
            continue
        if m[2] == "bearing" and _all_round(size):
            out.append(ANY_DIRECTION)
        elif size.low < size.high and all(math.isfinite(x) for x in size):
            factor, words = _unit(m[2])
            if "," in m[1]:
                size = Size(*(factor * x for x in size))
            elif m[3] is not None:
                words += f" {m[3] if size.value >= 0 else m[4]}"
                size = size if size.value >= 0 else size.mapped(lambda x: -x)
            value, low, high = _aligned(size)
            out.append(f"{value}{words} (95 %: {low} to {high})")
    return out


def _aligned(size: Size) -> list[str]:
    """Value and ends with as many decimals as the interval asks for."""
    return [f"{x:.{min(max(_places(size), 0), 6)}f}" for x in size]


def _places(size: Size) -> int:
    """Decimals that an interval asks for: two digits of its half width."""
    return 1 - math.floor(math.log10(0.5 * (size.high - size.low)))


def _all_round(bearing: Size) -> bool:
    """Whether an interval of directions [degrees] holds all of them."""
    return bearing.high - bearing.low >= 360.0


def probability(p: float) -> str:
    """Two decimals, at either end that it lies beyond."""
    return "above 0.99" if p > 0.995 else "below 0.01" if p < 0.005 else f"{p:.2f}"


def power_of_drag(power: Estimate) -> str:
    """The power of the speed that drag goes with, and its 95 % interval."""
    reach = Z95 * power.sd
    value, low, high = _aligned(Size(power.value, power.value - reach, power.value + reach))
    return f"drag goes with the speed to the power {value}, not 2 (95 %: {low} to {high})"


def number(x: float) -> str:
    """A number as people say it: two or three digits, whole from 100 on."""
    if not math.isfinite(x):
        return "no number of"
    if abs(x) >= 100:
        return f"{x:.0f}"
    text = f"{x:.2g}" if abs(x) < 10 else f"{x:.3g}"
    return f"{float(text):.4f}".rstrip("0").rstrip(".") if "e" in text else text


def _told(size: Size, value: float) -> str:
    """A number as people say it, with no digit beyond those its interval asks for."""
    if size.low < size.high and all(math.isfinite(x) for x in size):
        value = round(value, _places(size))
    return number(value)


def _unit(unit: str) -> tuple[float, str]:
    return _UNITS[unit.removeprefix("1/").removeprefix("+").removeprefix("-") or "-"]


def _size(effect: Effect, what: str, unit: str) -> Size:
    value = low = high = 0.0
    for name in what.split("+"):
        if name in effect.parameters:
            p = effect.parameters[name]
            ends = (p.value - Z95 * p.sd, p.value + Z95 * p.sd)
            if p.low95 is not None and p.high95 is not None:
                ends = (p.low95, p.high95)
            middle = p.value if ends[0] <= p.value <= ends[1] else 0.5 * (ends[0] + ends[1])
            value, low, high = value + middle, low + ends[0], high + ends[1]
        else:
            constant = effect.instead[name]
            value, low, high = value + constant, low + constant, high + constant
    factor, _ = _unit(unit)
    if unit.startswith("1/"):
        # a reciprocal of what may be zero has no upper end
        return Size(value, max(low, 0.0), high).mapped(lambda x: factor / x if x > 1e-9 else math.inf)
    return Size(value, low, high).mapped(lambda x: factor * x)


def _length(effect: Effect, what: str) -> Size:
    """Length of a vector and its interval, by its deviation along itself; SI."""
    parts = [effect.parameters[name] for name in what.split(",")]
    length = math.hypot(*(p.value for p in parts))
    sd = math.hypot(*(p.value * p.sd for p in parts)) / length if length > 0 else 0.0
    return Size(length, max(length - Z95 * sd, 0.0), length + Z95 * sd)


def _place(effect: Effect, m: re.Match[str]) -> str:
    what, unit, positive, negative = m.groups()
    factor, words = _unit(unit)
    if "," in what:
        first, second = (effect.parameters[name].value for name in what.split(","))
        length = Size(*(factor * x for x in _length(effect, what)))
        text = f"{_told(length, length.value)}{words}"
        if positive is not None:  # a size alone
            return text
        return f"{text} towards {math.atan2(second, first) * _DEGREE % 360:03.0f} degrees"
    whole = _size(effect, what, unit)
    size = whole.value
    if unit.startswith("1/") and not size < UNLIMITED:
        return "any speed"
    if unit == "bearing":
        return ANY_DIRECTION if _all_round(whole) else f"{size % 360:03.0f}{words}"
    if positive is not None:
        return f"{_told(whole, abs(size))}{words} {positive if size >= 0 else negative}"
    if unit.startswith(("+", "-")) and len(unit) > 1:
        return f"{size if unit[0] == '+' else -size:+.2g}{words}"
    return f"{_told(whole, size)}{words}"


def in_words(name: str) -> str:
    """Name of an effect, or of a coefficient that may be wrong (`coefficient_error:N_r`), as prose has it."""
    kind, _, coefficient = name.partition(":")
    if coefficient in EVERY:
        return f"coefficients {TIMES[EVERY[coefficient]]} times further off than the vehicle file says"
    return kind.replace("_", " ") + (f" of {coefficient}" if coefficient else "")


def lowered(text: str) -> str:
    """The text with a small first letter."""
    return text[0].lower() + text[1:]
