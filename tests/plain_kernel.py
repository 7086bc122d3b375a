"""The equations and the kernels without a compiler.

`equations(spec, prefix)` evaluates the graph of the equations at a point; `uncompiled(model)` is the model
with the text of its kernel run as plain Python, numba's decorator taken off. `EVERY` is the kernel of every
built-in vehicle, in the plane and in space, and those with propeller-loading rows.
"""

import types
from dataclasses import replace
from functools import lru_cache

import numpy as np

from bayesid.equations.dynamics import build
from bayesid.equations.generate import module_source
from bayesid.equations.layout import KernelSpec
from bayesid.equations.model import kernel_spec
from bayesid.equations.printing import statements
from bayesid.equations.runtime import _functions
from bayesid.model.effects import CATALOGUE, catalogue_of
from bayesid.model.vehicles import builtin_names, load_vehicle

ETA = (KernelSpec(3, eta=True), KernelSpec(6, eta=True))  # propeller-loading rows: in no built-in vehicle
_BUILT_IN = [load_vehicle(name) for name in builtin_names()]
_SPECS = {kernel_spec(v, dof) for v in _BUILT_IN for dof in ((3,) if v.planar_only else (3, 6))}
EVERY = (*sorted(_SPECS, key=lambda s: s.name), *ETA)


class Equations:
    """Wrench without acceleration, mass matrix, rates and readings at one point."""

    def __init__(self, spec, prefix, effects=None):
        effects = catalogue_of(spec.propulsion == "mmg") if effects is None else effects
        dyn = build(spec, effects, active=prefix == "full")
        g = dyn.graph
        self.states, self.parameters = tuple(dyn.states), tuple(dyn.parameters)
        self.velocities, self.actuators = tuple(dyn.velocities), tuple(dyn.actuators)
        self.exogenous, self.channels = tuple(dyn.exogenous), tuple(dyn.channels)
        groups = (("x", dyn.states), ("act", dyn.actuators), ("exo", dyn.exogenous), ("par", dyn.parameters))
        symbols = {name: f"{array}[{i}]" for array, names in groups for i, name in enumerate(names)}
        accel = [g.sym(f"{v}dot") for v in dyn.velocities]
        balance = [dyn.wrench[axis] for axis in dyn.axes]
        outputs = [
            (f"force[{i}]", g.substitute(n, dict.fromkeys(accel, g.zero))) for i, n in enumerate(balance)
        ]
        outputs += [
            (f"mass[{i}, {j}]", g.neg(g.diff(n, a)))
            for i, n in enumerate(balance)
            for j, a in enumerate(accel)
        ]
        outputs += [(f"k[{i}]", dyn.rates[s]) for i, s in enumerate(dyn.states) if s in dyn.rates]
        self.places = [dyn.states.index(v) for v in dyn.velocities]
        lines = statements(g, outputs, {**symbols, "t": "t"})
        text = "def run(x, act, exo, t, par, force, mass, k):\n" + "\n".join(f"    {line}" for line in lines)
        scope = {"math": __import__("math")}
        exec(compile(text, spec.name, "exec"), scope)
        self._run = scope["run"]

    def _all(self, x, act, exo, t, par):
        nv = len(self.velocities)
        force, mass, k = np.zeros(nv), np.zeros((nv, nv)), np.zeros(len(self.states))
        self._run(x, act, exo, t, par, force, mass, k)
        return force, mass, k

    def forces(self, *point):
        return self._all(*point)[0]

    def mass(self, par):
        zeros = (np.zeros(len(names)) for names in (self.states, self.actuators, self.exogenous))
        x, act, exo = zeros
        return self._all(x + 0.1, act, exo, 0.0, par)[1]

    def rate(self, *point):
        force, mass, k = self._all(*point)
        k[self.places] = np.linalg.solve(mass, force)
        return k


@lru_cache
def equations(spec, prefix):
    return Equations(spec, prefix)


@lru_cache
def equations_with(spec, names):
    """With these effects alone, of the catalogue or of its alternatives."""
    from bayesid.model.effects.alternatives import ALTERNATIVES

    return Equations(spec, "full", tuple(e for e in (*CATALOGUE, *ALTERNATIVES) if e.name in names))


def run_plain(name, text):
    """Module from the text of a kernel, its functions plain Python."""
    undecorated = "def njit(*given, **options):\n    return given[0] if given else (lambda f: f)"
    module = types.ModuleType(name)
    exec(compile(text.replace("from numba import njit", undecorated), name, "exec"), module.__dict__)
    return module


@lru_cache
def _module(spec):
    return run_plain(spec.name, module_source(spec))


def uncompiled(model, text=None):
    """The model, its kernel as plain Python; `text` instead of what is printed for the catalogue."""
    module = run_plain("given", text) if text else _module(model.kernel.spec)
    bare, full = (_functions(module, prefix) for prefix in ("bare", "full"))
    return replace(model, kernel=replace(model.kernel, bare=bare, full=full))
