"""Find, load or generate the compiled kernel of a vehicle.

Takes a `KernelSpec` and, for effects a user declared, their declarations. Gives a `Kernel` with the bare and
the full set of functions. Committed modules are imported; every other combination is printed once into a
cache folder.
"""

from __future__ import annotations

import hashlib
import importlib
import importlib.util
import os
import sys
import tempfile
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from bayesid.effects import CATALOGUE, Effect
from bayesid.kernels.context import LANES
from bayesid.kernels.layout import COMMITTED, KernelSpec

__all__ = ["LANES", "Functions", "Kernel", "load_kernel"]


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
    values."""

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


def cache_folder() -> Path:
    """Folder for kernels of user-declared effects: `BAYESID_CACHE`, else the user's cache folder."""
    root = os.environ.get("BAYESID_CACHE") or os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    return Path(root) / "bayesid" / "kernels"


@lru_cache(maxsize=32)
def load_kernel(spec: KernelSpec, declared: tuple[Declared, ...] = ()) -> Kernel:
    """Kernel of a spec.

    Parameters
    ----------
    spec : KernelSpec
    declared : effects beyond the catalogue (`Declared` wrappers, hashable)
    """
    extra = tuple(d.effect for d in declared)
    catalogue = (*CATALOGUE, *extra)
    if spec in COMMITTED and not extra:
        module = importlib.import_module(f"bayesid.kernels.generated.{spec.name}")
    else:
        module = _generated(spec, catalogue)
    used = tuple(e for e in catalogue if e.dof <= spec.dof)
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
        digest=hashlib.sha256(Path(str(module.__file__)).read_bytes()).hexdigest()[:16],
    )


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


def _generated(spec: KernelSpec, effects: tuple[Effect, ...]) -> ModuleType:
    from bayesid.kernels.generate import module_source  # not needed by any committed kernel

    source = module_source(spec, effects)
    name = f"bayesid_kernel_{spec.name}_{hashlib.sha256(source.encode()).hexdigest()[:16]}"
    if name in sys.modules:
        return sys.modules[name]
    folder = cache_folder()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        path = folder / f"{name}.py"
        if not path.exists():
            with tempfile.NamedTemporaryFile("w", dir=folder, suffix=".tmp", delete=False) as handle:
                handle.write(source)
            os.replace(handle.name, path)
    except OSError:
        folder = Path(tempfile.mkdtemp(prefix="bayesid-kernels-"))
        path = folder / f"{name}.py"
        path.write_text(source)
    location = importlib.util.spec_from_file_location(name, path)
    assert location is not None and location.loader is not None
    module = importlib.util.module_from_spec(location)
    sys.modules[name] = module
    location.loader.exec_module(module)
    return module
