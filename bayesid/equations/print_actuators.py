"""Print the actuator chains: from commands held over pieces of steps to positions over the steps.

Takes a `Context`. Gives source lines. `delay_slope` and `stretch` are the derivatives of command and length
of a piece by the delay of each actuator. A link gives its mean over the piece, which the next link gets, and
its value at the end, which it remembers; slopes by the chain's parameters run along. The last mean is added
to mean and change of the step, `act[owner]`, by the weights of the piece (`simulation.actuation.Pieces`).
"""

from __future__ import annotations

from dataclasses import dataclass

from bayesid.equations.derivatives import Graph, Node
from bayesid.equations.print_context import PLAIN, Context
from bayesid.equations.printing import statements
from bayesid.model.effects import Effect, InputStage

# The vehicle's own servo closes every chain: it runs at its rate limit while the error exceeds limit times
# lag and decays exponentially from there. A lag followed by a limit would catch up too fast.
_RUN = "min(max(abs(x - y)*inverse_rate - servo_lag, 0), h)"
_LEFT = f"(abs(x - y) - {_RUN}/inverse_rate)"
_DECAY = f"exp(-(h - {_RUN})/max(servo_lag, 1e-12))"
_SERVO_END = f"x - sgn(x - y)*{_LEFT}*{_DECAY}"
_SERVO_MEAN = f"x - sgn(x - y)/h*(0.5*(abs(x - y) + {_LEFT})*{_RUN} + {_LEFT}*servo_lag*(1 - {_DECAY}))"
_CLIP = "min(max(x, -limit), limit)"
_PIECES = "command, delay_slope, stretch, lengths, owner, weight, tilt, weight_slope, tilt_slope"
_REST = "par, slopes, restart, memory, carried, act, dact"
_SETTLED = 1e9  # s: a link that has waited this long has come to rest


@dataclass(frozen=True)
class _Link:
    """One link: x<number> what comes in, y<number> what it remembers."""

    number: int
    mean: Node
    end: Node

    def left(self, g: Graph) -> Node:
        """What the output has before it from its mean over the piece to its end: its own way, and what the
        link lets through of the way that comes in, r<number>."""
        through = g.mul(g.diff(self.mean, g.sym(f"x{self.number}")), g.sym(f"r{self.number}"))
        return g.add(g.add(self.end, g.mul(g.const(-1.0), self.mean)), through)


def actuate_lines(c: Context) -> list[str]:
    g = Graph()
    chains: list[list[_Link]] = []
    for signal in c.dyn.actuators:
        chains.append(_chain(c, g, signal, sum(map(len, chains))))
    delays = {
        a: [c.index[e.key(s.delay)] for e in c.effects for s in e.stages if s.signal == signal and s.delay]
        for a, signal in enumerate(c.dyn.actuators)
    }
    columns = [c.dyn.parameters[i] for ids in delays.values() for i in ids]
    read = {s for chain in chains for link in chain for n in (link.mean, link.end) for s in g.reads(n)}
    columns += [name for name in c.index if g.sym(name) in read and name not in columns]
    table = {"h": "h", **{name: f"par[{k}]" for name, k in c.index.items()}}
    start, body = [], []
    for a, chain in enumerate(chains):
        delayed = [columns.index(c.dyn.parameters[i]) for i in delays[a]]
        if chain:
            start += _settle(g, a, chain, columns, table, delayed)
        body += _step(c, g, a, chain, columns, table, delayed)
    return [
        f"{c.upper}_ACT_COLUMNS = {tuple(c.index[n] for n in columns)!r}",
        f"{c.upper}_ACT_DELAYS = {delays!r}",
        f"{c.upper}_ACT_MEMORY = {sum(map(len, chains))}",
        "",
        "",
        PLAIN,
        f"def {c.prefix}_actuate({_PIECES},",
        f"        {_REST}):",
        '    """Add means and changes of the positions over the steps, from commands held over pieces."""',
        f"    tangent, ahead = np.zeros({len(columns)}), np.zeros({len(columns)})",
        "    if restart:",
        *start,
        "    for s in range(lengths.size):",
        "        h = lengths[s]",
        "        o = owner[s]",
        *body,
    ]


def _chain(c: Context, g: Graph, signal: str, number: int) -> list[_Link]:
    """Links of one actuator in rising order, numbered on from `number`."""
    stages: list[tuple[InputStage, dict[str, Node]]] = [
        (stage, {p.name: g.sym(effect.key(p.name)) for p in effect.parameters})
        for effect in c.effects
        for stage in effect.stages
        if stage.signal == signal and stage.delay is None
    ]
    if signal in c.dyn.spec.servos:
        which = c.dyn.spec.servos[signal]
        kinds = ("inverse_rate", "servo_lag", "limit")
        rate, lag, limit = (_constant(g, f"{kind}_{which}", c.effects) for kind in kinds)
        servo = {"inverse_rate": rate, "servo_lag": lag}
        stages.append((InputStage(signal, 40, _SERVO_END, _SERVO_MEAN), servo))
        stages.append((InputStage(signal, 50, _CLIP, _CLIP), {"limit": limit}))
    links = []
    for i, (stage, own) in enumerate(sorted(stages, key=lambda s: s[0].order), start=number):
        names = {**own, "x": g.sym(f"x{i}"), "y": g.sym(f"y{i}"), "h": g.sym("h")}
        links.append(_Link(i, g.parse(stage.mean, names), g.parse(stage.end, names)))
    return links


def _constant(g: Graph, name: str, effects: tuple[Effect, ...]) -> Node:
    """A constant of the chain, with what effects make of it."""
    out = g.sym(name)
    for effect in effects:
        if name in effect.adjust:
            own = {p.name: g.sym(effect.key(p.name)) for p in effect.parameters}
            out = g.parse(effect.adjust[name], {**own, "value": out})
    return out


def _step(
    context: Context,
    g: Graph,
    a: int,
    chain: list[_Link],
    columns: list[str],
    table: dict[str, str],
    delayed: list[int],
) -> list[str]:
    out = [
        f"        value = command[s, {a}]",
        "        rest = 0.0",
        "        if slopes:",
        f"            for c in range({len(columns)}):",
        "                tangent[c] = ahead[c] = 0.0",
        *[f"            tangent[{c}] = delay_slope[s, {a}]" for c in delayed],
    ]
    for link in chain:
        i = link.number
        symbols = {**table, f"x{i}": "value", f"y{i}": f"memory[{i}]", f"r{i}": "rest"}
        outputs = (
            ("mean", "m", link.mean, "tangent[{}]"), ("end", "e", link.end, f"carried[{i}, {{}}]"),
            ("left", "r", link.left(g), "ahead[{}]"),
        )  # fmt: skip
        values = statements(g, [(name, node) for name, _, node, _ in outputs], symbols)
        slopes, added = [], []
        for _, tag, node, target in outputs:
            slopes += [(f"{tag}{z}", g.diff(node, g.sym(f"{z}{i}"))) for z in ("xyr" if tag == "r" else "xy")]
            by_length = g.diff(node, g.sym("h"))
            if delayed and g.value(by_length) != 0.0:
                slopes.append((f"{tag}h", by_length))
                added += [f"            {target.format(c)} += {tag}h * stretch[s, {a}]" for c in delayed]
            for c, name in enumerate(columns):
                slope = g.diff(node, g.sym(name))
                if g.value(slope) != 0.0:
                    slopes.append((f"{tag}p{c}", slope))
                    added.append(f"            {target.format(c)} += {tag}p{c}")
        out += [
            *_indent(8, values),
            "        if slopes:",
            *_indent(12, statements(g, slopes, symbols, "v")),
            f"            for c in range({len(columns)}):",
            "                old, kept = tangent[c], carried[{i}, c]".replace("{i}", str(i)),
            "                ahead[c] = rx * old + ry * kept + rr * ahead[c]",
            "                tangent[c] = mx * old + my * kept",
            f"                carried[{i}, c] = ex * old + ey * kept",
            *added,
            f"        memory[{i}] = end",
            "        value = mean",
            "        rest = left",
        ]
    tilted = len(context.dyn.actuators) + a
    both = ((a, "weight"), (tilted, "tilt"))
    out += [
        *[f"        act[o, {at}] += value * {by}[s]" for at, by in both],
        "        if slopes:",
        f"            for c in range({len(columns)}):",
        *[f"                dact[o, {at}, c] += tangent[c] * {by}[s]" for at, by in both],
        *[
            f"            dact[o, {at}, {k}] += value * {by}_slope[s, {a}]"
            for at, by in both
            for k in delayed
        ],
    ]
    if not chain:
        return out
    # a straight way from the mean to the end adds its change over the piece, twice their distance
    twice = "2.0 * weight[s] * weight[s]"
    return [
        *out,
        f"        act[o, {tilted}] += {twice} * rest",
        "        if slopes:",
        f"            for c in range({len(columns)}):",
        f"                dact[o, {tilted}, c] += {twice} * ahead[c]",
        *[
            f"            dact[o, {tilted}, {k}] += 4.0 * weight[s] * weight_slope[s, {a}] * rest"
            for k in delayed
        ],
    ]


def _settle(
    g: Graph, a: int, chain: list[_Link], columns: list[str], table: dict[str, str], delayed: list[int]
) -> list[str]:
    """Memory of links that have long rested at the first command."""
    out = [
        f"        value = command[0, {a}]",
        f"        for c in range({len(columns)}):",
        "            tangent[c] = 0.0",
    ]
    if delayed:
        out += ["        if slopes:", *[f"            tangent[{c}] = delay_slope[0, {a}]" for c in delayed]]
    for link in chain:
        i = link.number
        rest = g.substitute(link.end, {g.sym("h"): g.const(_SETTLED)})
        along = g.add(g.diff(rest, g.sym(f"x{i}")), g.diff(rest, g.sym(f"y{i}")))
        outputs, added = [("end", rest), ("ex", along)], []
        for c, name in enumerate(columns):
            slope = g.diff(rest, g.sym(name))
            if g.value(slope) != 0.0:
                outputs.append((f"ep{c}", slope))
                added.append(f"        tangent[{c}] += ep{c}")
        symbols = {**table, f"x{i}": "value", f"y{i}": "value"}
        out += [
            *_indent(8, statements(g, outputs, symbols, "u")),
            f"        memory[{i}] = end",
            f"        for c in range({len(columns)}):",
            "            tangent[c] = ex * tangent[c]",
            *added,
            f"        for c in range({len(columns)}):",
            f"            carried[{i}, c] = tangent[c]",
            "        value = end",
        ]
    return out


def _indent(depth: int, lines: list[str]) -> list[str]:
    return [" " * depth + line for line in lines]


def servo_formulas() -> tuple[str, ...]:
    """The vehicle's own servo as text: end and mean over a step, and the clip behind it."""
    return _SERVO_END, _SERVO_MEAN, _CLIP
