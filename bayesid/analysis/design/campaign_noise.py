"""Noise of the runs executed, for the information of runs to come: memory, excess, spread between runs.

Takes what a fit of the executed runs left as residuals. Gives the information a run has under that noise,
where readings that err together count once and one run tells no more than one run can. Without it, noise is
white as stated.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from bayesid.errors import FitError
from bayesid.estimation.likelihood import NoiseParts
from bayesid.estimation.likelihood.composite import RunScore
from bayesid.estimation.likelihood.mixed_rates import MixedRateNoise
from bayesid.estimation.likelihood.posterior import groups
from bayesid.estimation.run_data import RunData

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class CampaignNoise:
    """What the errors of a campaign are made of, and how single runs differ.

    Attributes
    ----------
    parts : of the noise
    noise : of the residuals, in units of the stated noise
    channels : (c,) the noise is of
    every : channel -> samples between two of its readings
    dt : time between samples [s]
    deviation : (k, k) root of the covariance, between runs, of the coefficients in units of what was known
    """

    parts: NoiseParts
    noise: MixedRateNoise
    channels: tuple[str, ...]
    every: Mapping[str, int]
    dt: float
    deviation: Array

    def as_logged(self, run: RunData, dt: float) -> RunData:
        """A planned run with samples every `dt` [s], read as the campaign was: slow channels stay slow."""
        steps = np.arange(len(run.readings))
        gaps = [max(1, round(self.every.get(c, 1) * self.dt / dt)) for c in run.channels]
        read = np.stack([steps % gap == 0 for gap in gaps], axis=1)
        return replace(run, readings=np.where(read, run.readings, np.nan))

    @property
    def scatter(self) -> Array:
        """(k, k) covariance, between runs, of the coefficients in units of what was known."""
        return self.parts.run_spread**2 * self.deviation @ self.deviation.T

    def errors(self, run: RunData, dt: float, rng: np.random.Generator) -> Array:
        """(n, c) errors of the readings of a run with samples every `dt` [s], in units of the stated noise.

        Raises
        ------
        FitError
            a channel the campaign did not read, whose noise is not known
        """
        where = self._places(run.channels)
        seen = np.zeros((len(run.valid), len(self.channels)), dtype=bool)
        seen[:, where] = run.valid
        return np.sqrt(self.parts.excess) * self.noise.draw(seen, rng, dt / self.dt)[:, where]

    def _places(self, channels: tuple[str, ...]) -> list[int]:
        """Positions of channels among those of the campaign."""
        if unknown := [c for c in channels if c not in self.channels]:
            raise FitError(
                f"the runs executed did not log {', '.join(unknown)}, so its noise is not known; they logged "
                f"{', '.join(self.channels)}"
            )
        return [self.channels.index(c) for c in channels]

    def score(
        self,
        name: str,
        columns: Array,
        start: Array,
        valid: Array,
        channels: tuple[str, ...],
        dt: float,
    ) -> RunScore:
        """Information of one run or piece, and covariance of its score.

        Parameters
        ----------
        columns : (n, c, k) whitened slopes of the readings, what the start can imitate taken out
        start : (i, k) the same of what was known of the start
        valid : (n, c) which readings there are
        dt : time between samples [s]

        Raises
        ------
        FitError
            a channel the campaign did not read, whose noise is not known
        """
        where, k = self._places(channels), columns.shape[2]
        placed = np.zeros((len(columns), len(self.channels), k))
        seen = np.zeros(placed.shape[:2], dtype=bool)
        placed[:, where], seen[:, where] = columns, valid
        flat = columns.reshape(-1, k)
        pull = start.T @ start
        h = flat.T @ flat + pull
        b = h if self.noise.order == 0 else self.noise.of_score(placed, seen, dt / self.dt) + pull
        return RunScore(name, h, b, np.zeros(k))

    def information(self, scores: Iterable[RunScore]) -> Array:
        """(k, k) information of runs about the coefficients they have in common; pieces of a run belong
        together."""
        found = list(scores)
        whole: dict[str, RunScore] = {}
        for group, s in zip(groups([s.name for s in found]), found, strict=True):
            before = whole.get(group)
            whole[group] = s if before is None else before.joined(s)
        spread = self.parts.run_spread * self.deviation
        return np.sum([run.weighed(self.parts.excess, spread)[0] for run in whole.values()], axis=0)
