"""What is in every edition of the benchmark set: an edition is never changed, a new one is added.

An edition is drawn from its phrase, which is public: anybody can make the same set, its answers too. An
edition whose answers nobody is to know before has no phrase; whoever makes it keeps the secret (`--secret`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

# Campaigns of the project's own plant: kinds in turn, causes brought to a noncentrality drawn log-uniformly.
MIXTURE = ("none", "effect", "effect", "none", "effect", "outside", "effect", "two", "variant", "effect")


@dataclass(frozen=True)
class LogPart:
    """A real log with something taken away.

    Attributes
    ----------
    source : folder of studies/real_logs, and of the logs below DATA
    what : as in `bayesid blind remove`
    """

    source: str
    what: str


@dataclass(frozen=True)
class Edition:
    """One edition.

    Attributes
    ----------
    phrase : from which it is drawn; "" where a secret is asked for
    made : when it was drawn first
    own, other : campaigns of the plant with the project's form of equations, and of those with others
    kinds : of own campaigns, in turn
    aim : noncentrality of their causes
    factors : fixed in every own campaign
    logs : name of the reduced bundle -> log and what is taken from it
    """

    phrase: str
    made: str
    own: int
    other: int
    kinds: tuple[str, ...] = MIXTURE
    aim: tuple[float, float] = (10.0, 1000.0)
    factors: Mapping[str, Any] = field(default_factory=lambda: {"dof": 3})
    logs: Mapping[str, LogPart] = field(default_factory=dict)


EDITIONS: Mapping[str, Edition] = {
    "1": Edition(
        "bayesid benchmark set, edition 1", "2026-11-23T00:00:00+00:00", 20, 12,
        logs={"l001": LogPart("esso_osaka", "wind"), "l002": LogPart("esso_osaka", "rate_limit")},
    ),
}  # fmt: skip
