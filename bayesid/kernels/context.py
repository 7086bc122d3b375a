"""What every printer of kernel functions needs: the equations, their symbols as source text, and repeated
fragments.

Takes the `Dynamics` of one set of functions (bare or full).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from bayesid.effects import Effect
from bayesid.kernels.expr import Node
from bayesid.kernels.layout import Dynamics
from bayesid.kernels.printing import statements

LANES = 16
# Python's division tests its divisor; that kept lanes with effects from vectorising and cost a factor of 3
PLAIN = "@njit(cache=True, nogil=True, error_model='numpy')"
FUSED = "@njit(cache=True, nogil=True, error_model='numpy', fastmath={'contract'})"


def names_tuple(names: Iterable[str]) -> str:
    """Source of a tuple of names, wrapped."""
    rows, line = [], "    "
    for name in names:
        item = f"{name!r}, "
        if len(line) + len(item) > 110:
            rows.append(line.rstrip())
            line = "    "
        line += item
    return "(\n" + "\n".join([*rows, line.rstrip()]) + "\n)"


class Context:
    """One set of functions (bare or full) of one kernel module.

    Attributes
    ----------
    force : wrench without acceleration, by velocity
    balance : whole wrench balance, by velocity
    slow : states whose rate is not an acceleration: pose, then the effects' own
    rows : balance rows, then rates of `slow`: the order of the sparse slopes
    """

    def __init__(self, prefix: str, dyn: Dynamics, effects: tuple[Effect, ...]) -> None:
        self.prefix, self.dyn, self.g, self.effects = prefix, dyn, dyn.graph, effects
        self.nx, self.nv = len(dyn.states), len(dyn.velocities)
        self.accel = [f"{v}dot" for v in dyn.velocities]
        self.index = {name: i for i, name in enumerate(dyn.parameters)}
        still = {self.g.sym(a): self.g.zero for a in self.accel}
        self.balance = [dyn.wrench[axis] for axis in dyn.axes]
        self.force = [self.g.substitute(node, still) for node in self.balance]
        self.slow = [s for s in dyn.states if s not in dyn.velocities]
        self.rows = [*self.balance, *(dyn.rates[s] for s in self.slow)]
        self.place = [dyn.states.index(s) for s in (*dyn.velocities, *self.slow)]
        self.upper = prefix.upper()

    def symbols(self) -> dict[str, str]:
        """Source text of every symbol in a function of one parameter vector."""
        d = self.dyn
        return {
            "t": "t",
            "h": "h",
            **{n: f"par[{i}]" for n, i in self.index.items()},
            **{n: f"x[{i}]" for i, n in enumerate(d.states)},
            **{n: f"act[{i}]" for i, n in enumerate(d.actuators)},
            **{n: f"exo[{i}]" for i, n in enumerate(d.exogenous)},
            **{a: f"a{i}" for i, a in enumerate(self.accel)},
            **{f"g{i}": f"g{i}" for i in range(self.nx)},
        }

    def emit(
        self,
        outputs: list[tuple[str, Node]],
        indent: int,
        symbols: Mapping[str, str] | None = None,
        prefix: str = "t",
        lanes: bool = False,
    ) -> list[str]:
        lines = statements(self.g, outputs, symbols or self.symbols(), prefix, lanes)
        return [" " * indent + line for line in lines]

    def slopes(self, node: Node, names: Iterable[str]) -> Iterator[tuple[int, Node]]:
        """(position, derivative) of a node by each of some symbols, where it is not identically zero."""
        for i, name in enumerate(names):
            slope = self.g.diff(node, self.g.sym(name))
            if self.g.value(slope) != 0.0:
                yield i, slope

    def rate_outputs(self) -> list[tuple[str, Node]]:
        """f0.. the wrench without acceleration, k<i> the rates of pose and own states."""
        out = [(f"f{i}", node) for i, node in enumerate(self.force)]
        return out + [(f"k{self.dyn.states.index(s)}", self.dyn.rates[s]) for s in self.slow]

    def accelerations(self, indent: int, minv: str = "minv[{}]") -> list[str]:
        """a0.. = inverse mass matrix times f0.."""
        n = self.nv
        return [
            " " * indent + f"a{i} = " + " + ".join(minv.format(i * n + j) + f" * f{j}" for j in range(n))
            for i in range(n)
        ]

    def store_rates(self) -> list[str]:
        slow = [f"    k[{i}] = k{i}" for i in self.place[self.nv :]]
        return slow + [f"    k[{p}] = a{i}" for i, p in enumerate(self.place[: self.nv])]
