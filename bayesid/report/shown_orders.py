"""Orders of a run as figures show them: label, unit and factor, from the table of channels.

Takes commands by name. Does not draw.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from bayesid.model.channels import COMMANDS, channel

_LABELS = {
    "delta_r_cmd": "rudder order (port +)",
    "delta_s_cmd": "stern-plane order",
    "delta_b_cmd": "bow-plane order",
    "n_cmd": "shaft speed",
}


@dataclass(frozen=True, eq=False)
class ShownOrder:
    """One order: label, unit shown, (n,) values in that unit."""

    label: str
    unit: str
    values: np.ndarray

    @property
    def moves(self) -> bool:
        """Whether it changes in the run."""
        return bool(np.nanmax(self.values) > np.nanmin(self.values))


def shown_orders(commands: Mapping[str, np.ndarray]) -> tuple[ShownOrder, ...]:
    """Orders in the order of the table, without those that are zero or missing throughout."""
    out = []
    for name in COMMANDS:
        values = np.asarray(commands.get(name, 0.0), dtype=float)
        if not np.any(np.nan_to_num(values)):
            continue
        factor, unit = channel(name).shown
        label = _LABELS.get(name) or channel(name).meaning.removeprefix("commanded ").split(",")[0]
        out.append(ShownOrder(label, unit, factor * values))
    return tuple(out)
