"""How well the named effects' parameters are known: draws beside Laplace, and the corner of what hides what.

Takes a `Result`. Gives report sections, none where nothing was drawn. Does not compute.
"""

from __future__ import annotations

from bayesid.diagnosis.evidence.effect_draws import EffectDraws
from bayesid.diagnosis.plain_words import Z95
from bayesid.diagnosis.result import Result
from bayesid.diagnosis.result_parts import Corner
from bayesid.diagnosis.summary import unsigned_zeros
from bayesid.errors import SampleError
from bayesid.report import posterior_figures as figures
from bayesid.report.diagnosis.effect_interval import SECTION, why
from bayesid.report.writer import Block, Figure, Section, Table, Text, literal

# Ratio of widths up to which two intervals of one size are the same to a reader.
ALIKE = 1.2


def sections(result: Result) -> list[Section]:
    """One section, or none."""
    if result.posterior is None:
        return []
    return [Section(SECTION, _blocks(result, result.posterior))]


def _blocks(result: Result, draws: EffectDraws) -> list[Block]:
    blocks: list[Block] = [
        Text(
            "The verdict rests on a Gaussian about each optimum (Laplace). emcee draws the effect's "
            "parameters jointly with the coefficients that could hide them and the noise scale of the "
            "environment, from a density that "
            f"is linearised anew at {draws.linearised_anew.nodes} points. Log "
            f"evidence by bridge sampling {draws.log_evidence:.2f} ± {draws.log_evidence_error:.2f}."
        ),
        Text(why(draws, result.environment.source)),
        *([Text(told)] if (told := to_use(result, draws)) else []),
        Table(
            ["unknown (SI)", "mean", "95 % interval", "sd over Laplace's", "shift [Laplace sd]"],
            [
                [
                    literal(n),
                    f"{p.mean:.4g}",
                    f"{p.low95:.4g} to {p.high95:.4g}",
                    f"{p.sd_over_laplace:.2f}",
                    unsigned_zeros(f"{p.shift_in_laplace_sd:+.2f}"),
                ]
                for n, p in draws.parameters.items()
            ],
            "Posterior draws beside the Laplace approximation. `log force` and `log drift` are the logarithm "
            "of the environment's noise scale over the level assumed.",
        ),
    ]
    corner = result.drawings.corner if result.drawings is not None else None
    if corner is not None:
        try:
            blocks.append(_corner(corner))
        except SampleError as exc:
            blocks.append(Text(literal(str(exc))))
    return blocks


def to_use(result: Result, draws: EffectDraws) -> str:
    """Which of the intervals of one size to use, and how the others differ; empty where there is one only."""
    told, every = [], []
    for effect in result.effects:
        for name, p in effect.parameters.items():
            drawn = draws.parameters.get(f"{effect.name}.{name}")
            if drawn is None or drawn.high95 <= drawn.low95:
                continue
            low, high = p.low95, p.high95
            if low is None or high is None:
                low, high = p.value - Z95 * p.sd, p.value + Z95 * p.sd
            wider = (high - low) / (drawn.high95 - drawn.low95)
            if not 1 / ALIKE < wider < ALIKE:
                every.append(wider)
                told.append(
                    f"{literal(f'{effect.name}.{name}')} from {low:.4g} to {high:.4g}, {wider:.2g} times as "
                    "wide as that of the draws"
                )
    if not told:
        return ""
    widened = (
        " Where it is wider, the interval of a size was widened before it was shown: it is no narrower than "
        "the deviation of the explanation's fit or than the runs differ from one another, of which the draws "
        "below know nothing."
        if max(every) > 1.0
        else ""
    )
    return (
        f"The 95 % interval to use is that of the first screen ({'; '.join(told)}).{widened} A ± behind a "
        "size among the refits is one standard deviation of that refit alone."
    )


def _corner(corner: Corner) -> Figure:
    drawn = figures.corner(list(corner.names), {"emcee": corner.draws, "Laplace": corner.laplace})
    return Figure(
        "effect_corner",
        drawn,
        "Effect parameters against the coefficients nearest to them in the posterior; a slanted ellipse is "
        "what these runs cannot separate. Lines hold 50 % and 90 %.",
    )
