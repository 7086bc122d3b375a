"""Contributions to coefficients, each from one published formula with its own error.

Takes: parts. Gives a coefficient's value, its prior width and where it is from.
Does not: know what a hull or a fin is.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

WIDEST = 3.0  # relative sd beyond which a value is told to be of unknown sign


@dataclass(frozen=True)
class Part:
    """`value` [SI] by `source`, with its sd in the same unit."""

    value: float
    sd: float
    source: str


@dataclass
class Parts:
    """Coefficient -> its parts; their errors are taken as independent."""

    of: dict[str, list[Part]] = field(default_factory=dict)

    def add(self, name: str, value: float, sd: float, source: str) -> None:
        """A part whose sd is a share of it."""
        if value != 0.0:
            self.of.setdefault(name, []).append(Part(value, sd * abs(value), source))

    def widen(self, name: str, sd: float, why: str) -> None:
        """An error [SI] that is no share of any part."""
        self.of.setdefault(name, []).append(Part(0.0, sd, why))

    def sd(self, name: str) -> float:
        return math.sqrt(math.fsum(part.sd**2 for part in self.of.get(name, ())))

    def value(self, name: str) -> float:
        return math.fsum(part.value for part in self.of.get(name, ()))

    def relative_sd(self, name: str) -> float:
        """sd over |value|; parts that cancel leave a wide one."""
        value = abs(self.value(name))
        return min(self.sd(name) / value, 100.0) if value > 0.0 else 100.0

    def comment(self, name: str) -> str:
        """Sources in the order of their size, with what each gives where there are several."""
        merged: dict[str, float] = {}
        for part in self.of[name]:
            if not part.value:
                continue
            merged[part.source] = merged.get(part.source, 0.0) + part.value
        ordered = sorted(merged.items(), key=lambda item: -abs(item[1]))
        if len(ordered) == 1:
            text = ordered[0][0]
        else:
            text = ", ".join(f"{source} {value:+.3g}" for source, value in ordered)
        wide = self.relative_sd(name) > WIDEST
        return text + ("; parts cancel: even the sign is open" if wide else "")
