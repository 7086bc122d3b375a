"""Load the compiled kernel of a vehicle; its module is printed at first use and kept in the cache.

Takes a `KernelSpec` and, for effects a user declared, their declarations. Gives a `Kernel` with the bare and
the full set of functions. Does not choose the folder or trust a file (`kernel_cache`), and compiles nothing:
numba does when a function is first called.
"""

from __future__ import annotations

import importlib.util
import sys
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from threading import Lock
from types import ModuleType
from typing import Any

import numpy as np

from bayesid.equations.compiled import forgive
from bayesid.equations.kernel_cache import stored
from bayesid.equations.kernel_digest import cache_key
from bayesid.equations.layout import KernelSpec
from bayesid.equations.print_context import LANES
from bayesid.model.effects import Effect, catalogue_of

__all__ = ["LANES", "Functions", "Kernel", "load_kernel"]

_LOADING = Lock()


@dataclass(frozen=True, eq=False)
class Functions:
    """One set of compiled functions and its layouts; names as printed by `generate`."""

    states: tuple[str, ...]
    entries: np.ndarray
    adjoint_parameters: np.ndarray
    sensor_entries: np.ndarray
    delays: dict[int, list[int]]
    act_columns: tuple[int, ...]
    act_delays: dict[int, list[int]]
    act_memory: int
    module: ModuleType
    prefix: str

    def __getattr__(self, name: str) -> Any:
        return getattr(self.module, f"{self.prefix}_{name}")

    @property
    def traced(self) -> int:
        """Numbers a forward run leaves per stage for the adjoint: states and accelerations."""
        return len(self.states) + len(self.module.VELOCITIES)


@dataclass(frozen=True, eq=False)
class Kernel:
    """Compiled equations of one `KernelSpec`; `bare` leaves the effects out, `full` has them all at par's
    values; `digest` is that of the equations."""

    spec: KernelSpec
    parameters: tuple[str, ...]
    actuators: tuple[str, ...]
    exogenous: tuple[str, ...]
    velocities: tuple[str, ...]
    channels: tuple[str, ...]
    effects: tuple[Effect, ...]
    bare: Functions
    full: Functions
    digest: str
    declared: tuple[Declared, ...] = ()

    @property
    def compiled(self) -> bool:
        """Whether the largest function, with all effects, is in the cache of this machine."""
        function = self.full.variational
        if not hasattr(function, "stats"):  # numba is told to compile nothing
            return True
        made = f"{Path(self.full.module.__file__ or '').stem}.{function.py_func.__name__}-*.nbi"
        return any(Path(function.stats.cache_path).glob(made))

    def __reduce__(self) -> tuple[Any, ...]:
        """Another process loads the kernel itself: the printed module is in the cache of its machine."""
        return _restored, (self.spec, self.declared, tuple(e.name for e in self.effects))


@lru_cache(maxsize=32)
def load_kernel(spec: KernelSpec, declared: tuple[Declared, ...] = ()) -> Kernel:
    """Kernel of a spec.

    Parameters
    ----------
    spec : KernelSpec
    declared : effects beyond the catalogue (`Declared` wrappers, hashable)

    Raises
    ------
    CacheError
        where another user may write to the folder of printed kernels
    ModelError
        if an effect's equation cannot be read; names the effect
    """
    catalogue = (*catalogue_of(spec.propulsion == "mmg", spec.air), *(d.effect for d in declared))
    module = _module(spec, catalogue)
    used = tuple(e for e in catalogue if e.acts_in(spec.dof))
    return Kernel(
        spec=spec,
        parameters=module.PARAMETERS,
        actuators=module.ACTUATORS,
        exogenous=module.EXOGENOUS,
        velocities=module.VELOCITIES,
        channels=module.CHANNELS,
        effects=used,
        bare=_functions(module, "bare"),
        full=_functions(module, "full"),
        digest=module.EQUATIONS,
        declared=declared,
    )


def _restored(spec: KernelSpec, declared: tuple[Declared, ...], kept: tuple[str, ...]) -> Kernel:
    kernel = load_kernel(spec, declared)
    if len(kept) == len(kernel.effects):
        return kernel
    return replace(kernel, effects=tuple(e for e in kernel.effects if e.name in kept))


@dataclass(frozen=True)
class Declared:
    """Hashable wrapper of a user-declared effect (hashed by name and equations)."""

    effect: Effect

    def __hash__(self) -> int:
        return hash(repr(self.effect))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Declared) and repr(self.effect) == repr(other.effect)


def _functions(module: ModuleType, prefix: str) -> Functions:
    upper = prefix.upper()
    return Functions(
        states=getattr(module, f"{upper}_STATES"),
        entries=getattr(module, f"{upper}_ENTRIES"),
        adjoint_parameters=getattr(module, f"{upper}_ADJOINT_PARAMETERS"),
        sensor_entries=getattr(module, f"{upper}_SENSOR_ENTRIES"),
        delays={module.CHANNELS.index(c): ids for c, ids in getattr(module, f"{upper}_DELAYS").items()},
        act_columns=getattr(module, f"{upper}_ACT_COLUMNS"),
        act_delays=getattr(module, f"{upper}_ACT_DELAYS"),
        act_memory=getattr(module, f"{upper}_ACT_MEMORY"),
        module=module,
        prefix=prefix,
    )


def _module(spec: KernelSpec, effects: tuple[Effect, ...]) -> ModuleType:
    def text() -> str:
        from bayesid.equations.generate import module_source  # not needed by a kernel that is kept

        return module_source(spec, effects)

    name = f"bayesid_kernel_{spec.name}_{cache_key(spec, effects)}"
    with _LOADING:  # a second thread must not meet half a module
        path = stored(name, text)
        known = sys.modules.get(name)
        if known is not None and known.__file__ == str(path):
            return known
        try:
            module = _imported(name, path)
        except (EOFError, ValueError, TypeError, ImportError):  # Python's own compiled part is damaged
            Path(importlib.util.cache_from_source(str(path))).unlink(missing_ok=True)
            module = _imported(name, path)
        forgive(module)
        return module


def _imported(name: str, path: Path) -> ModuleType:
    location = importlib.util.spec_from_file_location(name, path)
    assert location is not None and location.loader is not None
    module = importlib.util.module_from_spec(location)
    sys.modules[name] = module
    try:
        location.loader.exec_module(module)
    except BaseException:
        del sys.modules[name]
        raise
    return module
