"""Units as people write them: in brackets, after a comma or an underscore, in CF words.

`split_unit("Heading_deg")` gives ("Heading", "deg"). Does not: convert; that is `bayesid.model.units`.
"""

from __future__ import annotations

import re

_SAME = {
    "s": ("s", "sec", "secs", "second", "seconds"),
    "ms": ("ms", "msec", "millis", "millisecond", "milliseconds"),
    "us": ("us", "µs", "usec", "micros", "microsecond", "microseconds"),
    "ns": ("ns", "nsec", "nanos", "nanosecond", "nanoseconds"),
    "min": ("min", "minute", "minutes"),
    "h": ("h", "hour", "hours", "hr"),
    "d": ("d", "day", "days"),
    "m": ("m", "meter", "meters", "metre", "metres"),
    "cm": ("cm",),
    "mm": ("mm",),
    "km": ("km",),
    "ft": ("ft", "feet", "foot"),
    "nmi": ("nmi", "nm"),
    "deg": (
        "deg", "°", "degree", "degrees", "degs", "º", "degrees_north", "degree_north", "degrees_east",
        "degree_east",
        "degrees_true", "degt", "grad°", "grad", "grader", "gradi",
        "deg true", "degrees true", "deg t", "° true", "°t", "° t",
    ),
    "rad": ("rad", "radian", "radians", "rads"),
    "gon": ("gon", "gons", "gradian", "gradians"),  # not grad: a degree in German, Norwegian, Italian
    "m/s": ("m/s", "mps", "ms-1", "m s-1", "m.s-1", "m s^-1", "m*s-1", "m s**-1", "metre/second",
    "meter/second"),
    "cm/s": ("cm/s", "cm s-1", "cmps"),
    "mm/s": ("mm/s", "mm s-1"),
    "km/h": ("km/h", "kmh", "kph", "km h-1"),
    "kn": ("kn", "kt", "kts", "knot", "knots", "knoten", "knop"),
    "ft/s": ("ft/s", "fps", "ft s-1"),
    "deg/s": ("deg/s", "°/s", "degps", "deg s-1", "degree s-1", "degrees/s", "deg/sec", "dps", "degree/s",
    "degrees/second", "grad/s", "grader/s", "grad/sek"),
    "rad/s": ("rad/s", "rad s-1", "radps", "radian s-1", "radians/s", "rad/sec", "rads-1"),
    "deg/min": ("deg/min", "°/min", "grad/min"),
    "rpm": ("rpm", "1/min", "min-1", "rev/min", "u/min", "o/min"),
    "rps": ("rps", "1/s", "rev/s", "s-1", "hz"),
    "N": ("n", "newton", "newtons"),
    "kN": ("kn_force",),
    "N*m": ("n*m", "nm_torque", "n m", "newton metre"),
    "%": ("%", "percent", "pct"),
    "us_pwm": ("pwm",),
}  # fmt: skip
_UNIT = {word: unit for unit, words in _SAME.items() for word in words}
_BRACKET = re.compile(r"(.*?)\s*(?:\[([^\[\]]*)\]|\(([^()]*)\)|<([^<>]*)>|\{([^{}]*)\})\s*")
_WORD = r"stbd|stb|starboard|steuerbord|tribord|port|bb|backbord|babord"
_SIDE = re.compile(
    rf"\b(?P<side>{_WORD})\b\s*(?:is\s+|=\s*)?(?P<sign>[+−-]|pos\b|positive\b|neg\b|negative\b)(?!\s*/)"
    rf"|(?P<mark>[+−-]|\bpos|\bpositive|\bneg|\bnegative)\s*(?:=|to|is)?\s*(?P<other>{_WORD})\b",
    re.IGNORECASE,
)
_SUFFIX = {
    "deg", "rad", "mps", "kn", "kts", "knots", "rpm", "rps", "dps", "ms", "us", "ns", "sec", "degs", "m", "s",
    "ft", "cm", "mm", "rads", "radps", "degps", "kmh", "pwm", "pct", "percent",
    "gon",
}  # fmt: skip
_PAIRS = {("rad", "s"): "rad/s", ("deg", "s"): "deg/s", ("m", "s"): "m/s", ("cm", "s"): "cm/s", ("km",
    "h"): "km/h",
          ("ft", "s"): "ft/s", ("per", "s"): "1/s", ("deg", "min"): "deg/min"}  # fmt: skip
_FOREIGN = {"V", "A", "W", "mV", "mA", "Ah", "kW", "°C", "degC", "C", "K", "Pa", "kPa", "bar", "mbar",
    "hPa", "dB", "dBm", "g",
            "m/s2", "m/s^2", "rad/s2", "kg", "UTC", "ISO", "bool", "string", "text", "km"}  # fmt: skip
# a suffix that is also a letter of the field counts only after a longer name: t_s, but not delta_s
_LETTERS = {"s", "m", "ms"}


def plain_unit(text: str | None) -> str | None:
    """The unit as the program writes it, the text itself if it is not known, None if there is none."""
    if text is None:
        return None
    word = " ".join(text.strip().split())
    if word in ("", "-", "1", "none", "None", "n/a", "[]"):
        return None
    if word in ("kN", "kNm", "kN*m", "Nm", "NM", "N"):  # case matters: kN is a force, kn a speed
        return word
    known = _UNIT.get(word.lower())
    if known is None:  # deg, stbd +
        bare = _SIDE.sub(" ", word).partition(",")[0].partition(";")[0]
        known = _UNIT.get(" ".join(bare.lower().split()))
    return known if known is not None else word


def positive_side(header: str) -> str | None:
    """The side a header says positive is, as in `Helm (deg, stbd +)`; None where it says none or both."""
    sides = set()
    for found in _SIDE.finditer(header):
        port = (found["side"] or found["other"])[0].lower() in "pb"
        turned = (found["sign"] or found["mark"]).lower()[0] in "-−n"
        sides.add("port" if port != turned else "starboard")
    return sides.pop() if len(sides) == 1 else None


def is_unit(text: str) -> bool:
    """True if the text is a unit and nothing else, as in a second header row."""
    word = text.strip().strip("[]()<>")
    return word.lower() in _UNIT or word in ("", "-", "kN", "Nm", "kNm") or word in _FOREIGN


def split_unit(header: str) -> tuple[str, str | None]:
    """Name and unit of a header; the unit is None where none is stated."""
    header = _without_side(header.strip())
    found = _BRACKET.fullmatch(header)
    if found is not None and found[1]:
        unit = next((g for g in found.groups()[1:] if g is not None), None)
        return found[1].strip(), plain_unit(unit)
    for mark in (",", ";", "/ ", " in "):
        head, _, tail = header.rpartition(mark)
        if head and is_unit(tail):
            return head.strip(), plain_unit(tail)
    parts = re.split(r"[_.\s]+", header)
    if len(parts) > 2 and (parts[-2].lower(), parts[-1].lower()) in _PAIRS:
        return header[: header.lower().rfind(parts[-2].lower())].rstrip("_. "), _PAIRS[
            parts[-2].lower(), parts[-1].lower()
        ]
    last = parts[-1]
    if len(parts) > 1 and last.lower() in _SUFFIX:
        head = header[: -len(last)].rstrip("_. ")
        if last.lower() not in _LETTERS or _long(head):
            return head, plain_unit(last)
    return header, None


def _without_side(header: str) -> str:
    """The header without a bracket that says nothing but which side is positive: `Helm [deg] (+ = stbd)`."""
    for found in re.finditer(r"\s*[\[(<{]([^\[\](){}<>]*)[\])>}]", header):
        if _SIDE.fullmatch(" ".join(found[1].split())) and header[: found.start()].strip():
            return " ".join((header[: found.start()] + header[found.end() :]).split())
    return header


def suffix_unit(header: str) -> str | None:
    """The unit of a header that has it as its last word, as in `Compass_deg`; None for one in brackets."""
    return None if _BRACKET.fullmatch(_without_side(header.strip())) else split_unit(header)[1]


def _long(head: str) -> bool:
    return head.lower() not in ("delta", "d", "k", "u", "v", "w", "cmd", "delta_cmd", "n", "rms")
