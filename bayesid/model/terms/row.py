"""What one row of the force table is: a coefficient times a known product of motions and inputs.

Takes: axis, name and regressor as written in the table.
Does not: hold values; unit, power of length, label and symmetry are read off the regressor here.
"""

from __future__ import annotations

import ast
import re
from dataclasses import dataclass
from functools import cached_property

from bayesid.model.notation import AXES, FORCE_AXES

#: (metre, second, rpm) exponents, power of the prime length and degree in velocity of every symbol
SYMBOLS = {
    **dict.fromkeys(("u", "v", "w", "Rv", "Rw"), ((1, -1, 0), 0, 1)),
    **dict.fromkeys(("p", "q", "r"), ((0, -1, 0), 1, 1)),
    **dict.fromkeys(("udot", "vdot", "wdot"), ((1, -2, 0), 1, 2)),
    **dict.fromkeys(("pdot", "qdot", "rdot"), ((0, -2, 0), 2, 2)),
    **dict.fromkeys(("delta_r", "delta_s", "delta_b", "eta1"), ((0, 0, 0), 0, 0)),
    "n": ((0, 0, 1), 0, 1),
    "U": ((1, -1, 0), 0, 1),
    "S": ((0, 0, 0), 0, 0),
}
FUNCTIONS = ("abs", "sgn")
_GREEK = ("epsilon", "kappa", "gamma", "tau")
RATES = ("udot", "vdot", "wdot", "pdot", "qdot", "rdot")
OUT_OF_PLANE = frozenset(("w", "p", "q", "wdot", "pdot", "qdot", "delta_s", "delta_b"))


@dataclass(frozen=True)
class Factor:
    """One symbol of a regressor, bare (`wrap` is ""), inside abs() or sgn(), or divided by ("/")."""

    symbol: str
    wrap: str = ""

    @property
    def degree(self) -> int:
        return {"sgn": 0, "/": -1}.get(self.wrap, 1)

    @property
    def is_even(self) -> bool:
        return self.wrap == "abs"


def factors(regressor: str) -> tuple[Factor, ...]:
    """Split a product such as "sgn(v)*Rv*abs(r)" into its factors, left to right.

    Raises
    ------
    ValueError
        if the text is anything but a product of known symbols, bare or inside abs() and sgn(),
        over powers of the speed U
    """

    def walk(node: ast.expr, wrap: str) -> tuple[Factor, ...]:
        if isinstance(node, ast.Name) and node.id in SYMBOLS:
            return (Factor(node.id, wrap),)
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mult):
            return walk(node.left, wrap) + walk(node.right, wrap)
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Div) and ast.unparse(node.right) == "U":
            return walk(node.left, wrap) + walk(node.right, "/")
        if (
            isinstance(node, ast.Call)
            and isinstance(node.func, ast.Name)
            and node.func.id in FUNCTIONS
            and len(node.args) == 1
            and not node.keywords
            and not wrap
        ):
            return walk(node.args[0], node.func.id)
        raise ValueError(f"regressor {regressor!r}: {ast.unparse(node)!r} is not a product of known symbols")

    return walk(ast.parse(regressor, mode="eval").body, "")


@dataclass(frozen=True)
class Term:
    """One coefficient of the table.

    Parameters
    ----------
    name : canonical name, axis first, e.g. "N_|v|r"
    axis : X Y Z [N] or K M N [N m], body axes
    regressor : product in Python syntax, SI and radians (rpm for n), see `SYMBOLS`
    source : key of `references.REFERENCES`, or "assumed: <why>"
    group : "base", "eta" (propeller-loading rows), "propulsion" (always SI), "mmg" (rows over the speed U) or
        "number" (acts within the formulas of `mmg`, without a unit; its regressor is the formula)
    about : what a number is
    """

    name: str
    axis: str
    regressor: str
    source: str
    group: str = "base"
    about: str = ""

    def __post_init__(self) -> None:
        if self.is_number:
            return
        if self.axis not in AXES or not self.name.startswith(f"{self.axis}_"):
            raise ValueError(f"term {self.name!r}: axis {self.axis!r} must be its first letter")
        factors(self.regressor)

    @property
    def is_number(self) -> bool:
        """True for a number of the propeller or rudder formulas: the force is not proportional to it."""
        return self.group == "number"

    @property
    def is_added_mass(self) -> bool:
        """Whether it is minus the added mass or inertia along its own axis, which no hull has below zero: it
        is the energy of the water around it (Lamb 1932, ch. VI)."""
        return self.regressor == RATES[AXES.index(self.axis)]

    @cached_property
    def factors(self) -> tuple[Factor, ...]:
        return () if self.is_number else factors(self.regressor)

    @property
    def arguments(self) -> str:
        """The name without its axis: "|v|r" of "N_|v|r"."""
        return self.name[2:]

    @cached_property
    def length_power(self) -> int:
        """k of 1/2 rho L^k: 2 for a force, 3 for a moment, plus what the regressor brings."""
        if self.is_number:
            return 0
        base = 2 if self.axis in FORCE_AXES else 3
        return base + sum(SYMBOLS[f.symbol][1] * f.degree for f in self.factors)

    @cached_property
    def velocity_power(self) -> int:
        """Degree in velocity: 2 in Gertler-Hagen rows, 1 in rows without u, 3 and 4 in ship rows."""
        if self.is_number:
            return 2
        return sum(SYMBOLS[f.symbol][2] * f.degree for f in self.factors)

    @cached_property
    def unit_powers(self) -> tuple[int, int, int, int]:
        """Exponents of (kg, m, s, rpm) in the SI coefficient: axis unit over regressor unit."""
        if self.is_number:
            return 0, 0, 0, 0
        metre, second, rpm = (1 if self.axis in FORCE_AXES else 2), -2, 0
        for factor in self.factors:
            dm, ds, dn = SYMBOLS[factor.symbol][0]
            metre, second, rpm = (
                metre - dm * factor.degree,
                second - ds * factor.degree,
                rpm - dn * factor.degree,
            )
        return 1, metre, second, rpm

    @cached_property
    def unit(self) -> str:
        """SI unit of the coefficient, radians dropped, e.g. "kg/m"; readable by pint."""
        up: list[str] = []
        down: list[str] = []
        for symbol, power in zip(("kg", "m", "s", "rpm"), self.unit_powers, strict=True):
            if power:
                text = symbol if abs(power) == 1 else f"{symbol}^{abs(power)}"
                (up if power > 0 else down).append(text)
        return "/".join([" ".join(up), *down]) if up else ""

    @cached_property
    def label(self) -> str:
        """Mathtext of the coefficient, e.g. r"$N_{|v|r}$"."""
        if self.is_number:
            letter, _, index = self.name.partition("_")
            letter = (
                rf"\{letter}" if letter in _GREEK else letter if len(letter) == 1 else rf"\mathrm{{{letter}}}"
            )
            return (
                f"${letter}_{{{index.replace('plus', '+').replace('minus', '-')}}}$"
                if index
                else f"${letter}$"
            )
        text = re.sub(r"([uvwpqr])dot", r"\\dot{\1}", self.arguments)
        text = re.sub(r"d([rsb])", r"\\delta_{\1}", text)
        text = text.replace(",eta", r",\eta").replace("prop_", r"\mathrm{prop},")
        return f"${self.axis}_{{{text}}}$"

    @cached_property
    def is_inertia(self) -> bool:
        """True where the regressor is an acceleration: the row belongs into the mass matrix."""
        return any(f.symbol in RATES for f in self.factors)

    @cached_property
    def odd_in_rudder(self) -> bool:
        """True where the sign of the row's force flips with the sign of delta_r alone."""
        return sum(f.symbol == "delta_r" and not f.is_even for f in self.factors) % 2 == 1

    @cached_property
    def planar(self) -> bool:
        """True where the regressor is alive in the horizontal plane: w = p = q = 0, planes at zero."""
        return not any(f.symbol in OUT_OF_PLANE for f in self.factors)
