"""What besides the parameters is uncertain in a trial, and how a posterior treats it.

Plain choices, checked against each other. Does not compute.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from bayesid.errors import SampleError


@dataclass(frozen=True)
class SamplingSettings:
    """What besides the parameters is uncertain, and how it is treated.

    noise : level of every channel, one for all runs: "sampled", "marginal" (integrated in closed form; needs
        initial states that are not marginalised) or "fixed" at the problem's
    noise_prior, noise_weight, noise_reach : see `NoisePrior`
    initial : initial states the problem leaves free: "marginal" (integrated with their effect linear about
        the estimate), "sampled", or "fixed" there
    memory : residuals that persist: "inflate" (each channel counts for as many readings as its residuals at
        the estimate are worth, as in a fit that estimates noise; no change where they are white), "ar1"
        (first-order autoregression, its correlation sampled) or "ignore"
    student : degrees of freedom of Student-t noise, for outliers; None is Gaussian
    """

    noise: Literal["sampled", "marginal", "fixed"] = "sampled"
    noise_prior: Literal["inverse_gamma", "half_normal"] = "inverse_gamma"
    noise_weight: float = 4.0
    noise_reach: float = 3.0
    initial: Literal["marginal", "sampled", "fixed"] = "marginal"
    memory: Literal["inflate", "ar1", "ignore"] = "inflate"
    student: float | None = None

    def __post_init__(self) -> None:
        if self.noise == "marginal" and (self.initial == "marginal" or self.noise_prior != "inverse_gamma"):
            raise SampleError(
                "noise can be marginalised only under an inverse-gamma prior and with initial states sampled "
                "or fixed"
            )
        if self.student is not None:
            if not self.student > 0:
                raise SampleError(f"student = {self.student:g}: degrees of freedom are positive")
            if self.initial == "marginal" or self.noise == "marginal" or self.memory == "ar1":
                raise SampleError(
                    "Student-t noise has no closed form: sample or fix the initial states, sample or fix the "
                    'noise, and take memory "inflate" or "ignore"'
                )
