"""What every printer of kernel functions needs: the equations, their symbols as source text, and repeated
fragments.

Takes the `Dynamics` of one set of functions (bare or full).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping

from bayesid.equations.derivatives import Node
from bayesid.equations.layout import Dynamics
from bayesid.equations.printing import statements
from bayesid.model.effects import Effect

LANES = 16
STAGE_PART = "part = -0.5 if stage == 0 else (0.5 if stage == 3 else 0.0)"
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
        self._gradients: dict[Node, dict[Node, Node]] = {}

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

    def local_symbols(self) -> dict[str, str]:
        """As `symbols`, with state and inputs in local variables (see `step_head`)."""
        d = self.dyn
        return {
            **self.symbols(),
            **{n: f"z{i}" for i, n in enumerate(d.states)},
            **{n: f"u{i}" for i, n in enumerate(d.actuators)},
            **{n: f"e{i}" for i, n in enumerate(d.exogenous)},
        }

    def emit(
        self,
        outputs: list[tuple[str, Node]],
        indent: int,
        symbols: Mapping[str, str] | None = None,
        prefix: str = "t",
        lanes: bool = False,
        known: dict[Node, str] | None = None,
    ) -> list[str]:
        lines = statements(self.g, outputs, symbols or self.symbols(), prefix, lanes, known)
        return [" " * indent + line for line in lines]

    def slopes(self, node: Node, names: Iterable[str]) -> Iterator[tuple[int, Node]]:
        """(position, derivative) of a node by each of some symbols, where it is not identically zero."""
        if node not in self._gradients:  # all slopes in one reverse sweep: a third fewer operations
            self._gradients[node] = self.g.gradient(node)
        found = self._gradients[node]
        for i, name in enumerate(names):
            slope = found.get(self.g.sym(name), self.g.zero)
            if self.g.value(slope) != 0.0:
                yield i, slope

    def rate_outputs(self) -> list[tuple[str, Node]]:
        """f0.. the wrench without acceleration, k<i> the rates of pose and own states."""
        out = [(f"f{i}", node) for i, node in enumerate(self.force)]
        return out + [(f"k{self.dyn.states.index(s)}", self.dyn.rates[s]) for s in self.slow]

    def accelerations(self, indent: int, minv: Callable[[int], str] = "minv[{}]".format) -> list[str]:
        """a0.. = inverse mass matrix times f0.."""
        n = self.nv
        return [
            " " * indent + f"a{i} = " + " + ".join(f"{minv(i * n + j)} * f{j}" for j in range(n))
            for i in range(n)
        ]

    def rate_name(self, i: int) -> str:
        """Local variable that holds the rate of state i."""
        row = self.place.index(i)
        return f"a{row}" if row < self.nv else f"k{i}"

    def lane_symbols(self, rows: LaneRows) -> dict[str, str]:
        """As `symbols` for one lane `l` of the array `work`."""
        d = self.dyn
        return {
            **self.symbols(),
            **{n: rows.at("par", i) for n, i in self.index.items()},
            **{n: rows.at("stage", i) for i, n in enumerate(d.states)},
            **{a: rows.at("acceleration", i) for i, a in enumerate(self.accel)},
            **{
                n: f"({rows.at('act', i)} + part * {rows.at('act', len(d.actuators) + i)})"
                for i, n in enumerate(d.actuators)
            },
            **{n: f"e{i}" for i, n in enumerate(d.exogenous)},
        }


class LaneRows:
    """Rows of sixteen lanes in one array `work`, by name.

    All a lane loop touches lies in one array: between several, the vectoriser wants run-time overlap checks,
    and more of them than it grants.
    """

    def __init__(self, **sizes: int) -> None:
        self.sizes, self.count = sizes, 0
        self.first: dict[str, int] = {}
        for name, size in sizes.items():
            self.first[name] = self.count
            self.count += size

    def at(self, name: str, i: int) -> str:
        """One lane of row i of a group."""
        return f"work[{(self.first[name] + i) * LANES} + l]"

    def fill(self, indent: int, name: str, source: str) -> list[str]:
        """Loop that sets a group from a flat array or a number; `source` reads with index i."""
        return self._loop(indent, name, f"work[{self.first[name] * LANES} + i] = {source}")

    def copy(self, indent: int, name: str, source: str) -> list[str]:
        """Loop that sets a group from another one of the same size."""
        return self.fill(indent, name, f"work[{self.first[source] * LANES} + i]")

    def store(self, indent: int, name: str, target: str) -> list[str]:
        """Loop that writes a group to a flat array; `target` has index i."""
        return self._loop(indent, name, f"{target} = work[{self.first[name] * LANES} + i]")

    def _loop(self, indent: int, name: str, line: str) -> list[str]:
        pad = " " * indent
        return [f"{pad}for i in range({self.sizes[name] * LANES}):", f"{pad}    {line}"]


def step_head(c: Context, step: str) -> list[str]:
    """Length and inputs of one step as local variables; m<i>, d<i>: mean and change of an actuator."""
    na = len(c.dyn.actuators)
    return [
        f"        h = steps[{step}]",
        *[f"        m{i} = act[{step}, {i}]" for i in range(na)],
        *[f"        d{i} = act[{step}, {na + i}]" for i in range(na)],
        *[f"        e{i} = exo[{step}, {i}]" for i in range(len(c.dyn.exogenous))],
    ]


def stage_head(start: str, plain: bool = False) -> list[str]:
    """Weight of an RK4 stage, the way to the next one, the stage's time and its part of the step from the
    middle on."""
    begin = start if plain else f"times[{start}]"
    return [
        "            weight = 2.0 if (stage == 1 or stage == 2) else 1.0",
        "            half = h if stage == 2 else 0.5 * h",
        f"            t = {begin} + (0.0 if stage == 0 else (h if stage == 3 else 0.5 * h))",
        "            " + STAGE_PART,
    ]


def stage_positions(c: Context, indent: int) -> list[str]:
    """Actuator positions of a stage as local variables u<i>: on a straight line over the step."""
    return [" " * indent + f"u{i} = m{i} + part * d{i}" for i in range(len(c.dyn.actuators))]
