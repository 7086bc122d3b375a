"""What a force that is left depends on beside the motion. Data; found by `dependence_search`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

On = Literal["place", "period"]
Acts = Literal["hull", "ground"]


@dataclass(frozen=True)
class Dependence:
    """What a force that is left depends on.

    Attributes
    ----------
    on : place over ground, or a period
    acts : on the hull's forces, which it changes by a share, or by itself, whatever the heading
    evidence : log evidence it gains beside the explanation and any force of the motion and the controls
    scale : distance over which it changes [m], or the period [s]
    size : root mean square over the runs, as a share or [N]
    alone : log evidence it gains without any effect; 0 where it is not told there
    map : where the vehicle was and how much of it acts there: north and east [m], then the share by which the
        hull's forces change, or the force to the north and to the east [N]; empty of a period
    """

    on: On
    acts: Acts
    evidence: float
    scale: float
    size: float
    alone: float
    map: tuple[tuple[float, ...], ...] = ()
