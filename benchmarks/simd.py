"""Build and call the C reference kernel.

Takes a `Setting`. Compiles `simd_reference.c` with gcc into a temporary folder: vectors of 4 or 8 doubles,
the equations either all rows of the table (printed as C here) or, planar only, the non-zero rows by hand.
"""

from __future__ import annotations

import ctypes
import subprocess
import tempfile
from pathlib import Path

import numpy as np
from setting import Setting

from bayesid.equations.derivatives import Graph, Node
from bayesid.equations.dynamics import build
from bayesid.equations.print_context import Context
from bayesid.model.effects import CATALOGUE

HERE = Path(__file__).parent
HAND = (
    *("m", "X_rr", "X_vr", "X_vv", "X_drdr", "X_prop_u|u|", "X_prop_un", "X_prop_n|n|"),
    *("Y_r", "Y_|r|dr", "Y_v|r|", "Y_v", "Y_v|v|", "Y_dr"),
    *("N_r|r|", "N_r", "N_|r|dr", "N_|v|r", "N_v", "N_v|v|", "N_dr"),
)
FLAGS = ("-O3", "-march=native", "-ffp-contract=fast", "-fno-math-errno", "-fopenmp", "-shared", "-fPIC")


def body(setting: Setting) -> str:
    """Equations with every row of the table as C statements."""
    spec = setting.model.kernel.spec
    c = Context("bare", build(spec, CATALOGUE, active=False), ())
    d = c.dyn
    symbols = {
        "t": "t",
        **{n: f"P({i})" for n, i in c.index.items()},
        **{n: f"x[{i}]" for i, n in enumerate(d.states)},
        **{n: f"u[{i}]" for i, n in enumerate(d.actuators)},
        **{n: f"e[{i}]" for i, n in enumerate(d.exogenous)},
    }
    lines = _statements(c.g, c.rate_outputs(), symbols)
    n = c.nv
    for i, place in enumerate(c.place[:n]):
        lines.append(f"k[{place}] = " + " + ".join(f"minv[{i * n + j}] * f{j}" for j in range(n)) + ";")
    lines += [f"k[{place}] = k{place};" for place in c.place[n:]]
    return "\n".join(lines)


def _statements(g: Graph, outputs: list[tuple[str, Node]], symbols: dict[str, str]) -> list[str]:
    lines, text = [], {}
    forms = {"add": "{} + {}", "sub": "{} - {}", "mul": "{} * {}", "div": "{} / {}", "neg": "-{}"}
    forms |= {name: f"v{name}(SPLAT(0.0) + {{}}, SPLAT(0.0) + {{}})" for name in ("min", "max")}
    angles = set()
    for node in sorted(g.closure(n for _, n in outputs)):
        name, *args = g.key(node)
        if name == "const":
            text[node] = f"({args[0]!r})"
        elif name == "sym":
            text[node] = symbols[args[0]]
        elif name in ("sin", "cos"):
            if args[0] not in angles:
                angles.add(args[0])
                lines.append(
                    f"vd s{args[0]}, c{args[0]}; vsincos({text[args[0]]}, &s{args[0]}, &c{args[0]});"
                )
            text[node] = f"{name[0]}{args[0]}"
        else:
            values = [text[a] for a in args]
            form = forms.get(name, f"v{name}({{}})")
            if name in ("abs", "sgn", "sqrt", "rsqrt", "step"):
                values = [f"SPLAT(0.0) + {values[0]}"]  # some are plain numbers, such as |n|
            lines.append(f"const vd t{node} = SPLAT(0.0) + ({form.format(*values)});")
            text[node] = f"t{node}"
    return lines + [f"const vd {name} = SPLAT(0.0) + {text[node]};" for name, node in outputs]


class Reference:
    """Compiled reference: `run(threads)` fills `out` (groups, samples, states, width)."""

    def __init__(self, setting: Setting, pars: np.ndarray, width: int, hand: bool = False) -> None:
        model, plan = setting.model, setting.plan
        nx, nv, count = len(model.states), len(model.kernel.velocities), pars.shape[0]
        names = HAND if hand else model.kernel.parameters
        self.folder = tempfile.TemporaryDirectory()
        library = Path(self.folder.name) / "reference.so"
        defines = dict(
            W=width, NX=nx, NA=setting.act.shape[1], NE=plan.exogenous.shape[1], NP=len(names), NM=nv * nv
        )
        command = ["gcc", *FLAGS, *[f"-D{k}={v}" for k, v in defines.items()]]
        if not hand:
            path = Path(self.folder.name) / "body.h"
            path.write_text(body(setting))
            command.append(f'-DBODY_FILE="{path}"')
        subprocess.run([*command, str(HERE / "simd_reference.c"), "-o", str(library)], check=True)
        call = ctypes.CDLL(str(library)).run
        groups = count // width

        def lanes(values: np.ndarray) -> np.ndarray:
            """(count, k) to (groups, k, width), aligned for vector loads."""
            values = values.reshape(groups, width, -1).transpose(0, 2, 1)
            return _aligned(values)

        start = np.repeat(setting.begin()[None], count, axis=0)
        self.out = _aligned(np.zeros((groups, plan.steps.size + 1, nx, width)))
        hold = [
            *(lanes(pars[:, model.positions(names)]), lanes(setting.minv(pars)), lanes(start)),
            *map(np.ascontiguousarray, (plan.times, plan.steps, setting.act, plan.exogenous)),
        ]
        pointers = [a.ctypes.data_as(ctypes.c_void_p) for a in (*hold, self.out)]

        def run(threads: int = 1) -> None:
            call(groups, *pointers[:3], plan.steps.size, *pointers[3:], threads)

        self._hold, self.run = hold, run

    def states(self) -> np.ndarray:
        """(count, samples, states)."""
        groups, samples, nx, width = self.out.shape
        return self.out.transpose(0, 3, 1, 2).reshape(groups * width, samples, nx)


def _aligned(values: np.ndarray) -> np.ndarray:
    raw = np.empty(values.size + 8)
    offset = (-raw.ctypes.data // 8) % 8
    out = raw[offset : offset + values.size].reshape(values.shape)
    out[...] = values
    return out
