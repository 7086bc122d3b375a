"""What the errors of a fit are made of, beside white sensor noise.

Plain numbers with a sentence. Does not estimate.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class NoiseParts:
    """Parts of the composite likelihood; all off is output error with white noise.

    Attributes
    ----------
    order : of the vector autoregression of the residuals; 0 is white
    excess : factor on the covariance of the runs' scores beyond that, at least 1
    run_spread : sd of a coefficient from run to run over its prior sd (its size where there is no prior)
    weight : power of the readings' likelihood beside the prior in a fit, `share` to 1: what predicts left-out
        runs best, so no measure of how sure an estimate is
    share : of the information of white noise that the readings carry, 0 to 1
    efficient : the estimate weighs the score of every run by its own covariance instead, the prior as stated;
        the power is that of the search it begins from
    disturbance : memory [s] of the random force beside which the estimate was made, by a filter; 0: by output
        error. `order` is then that of its innovations
    """

    order: int = 0
    excess: float = 1.0
    run_spread: float = 0.0
    weight: float = 1.0
    share: float = 1.0
    efficient: bool = False
    disturbance: float = 0.0

    @property
    def white(self) -> bool:
        """Whether nothing but white noise is there."""
        plain = self.order == 0 and self.disturbance == 0.0
        return plain and self.excess == 1.0 and self.run_spread == 0.0

    def describe(self) -> str:
        """One line for a screen."""
        if self.white:
            return "white sensor noise"
        said = ["white sensor noise" if self.order == 0 else f"residuals with memory (order {self.order})"]
        if self.disturbance:
            said = [
                f"a random force that lasts {self.disturbance:.2g} s, slow errors of positions, white sensor "
                "noise"
            ]
        if self.excess > 1.0:
            said.append(f"{self.excess**0.5:.2g} times that between runs")
        if self.run_spread > 0.0:
            said.append(f"coefficients that differ from run to run by {self.run_spread:.2g} prior sd")
        return ", ".join(said)
