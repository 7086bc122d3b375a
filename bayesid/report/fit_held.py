"""Coefficients that a fit holds although its runs move them, in words.

Takes a `TrialFit`. Gives sentences. Does not fit.
"""

from __future__ import annotations

from bayesid.estimation.trial_fit import TrialFit
from bayesid.report.fit_first_screen import percent
from bayesid.words import digits, first_few

MOST_NAMED = 4


def held_words(found: TrialFit) -> list[str]:
    """A sentence where the runs ask for coefficients that the fit holds as given."""
    told = found.fit.uncertainty.get("held")
    if not told:
        return []
    moves = [_move(found, name, *one) for name, one in told["moves"].items()]
    named = first_few(moves, MOST_NAMED) if moves else "none of them for sure by itself"
    return [
        "These runs ask for coefficients that this fit holds as given (log evidence "
        f"+{digits(told['evidence'], 2)}): {named}. Those that are free stand in for them: their values and "
        "intervals hold only as far as those held are right."
    ]


def freeing_words(found: TrialFit) -> list[str]:
    """What to type where `held_words` says something."""
    told = found.fit.uncertainty.get("held")
    if not told:
        return []
    if not told["moves"]:
        return ["Free more coefficients: without `--free` the fit frees all."]
    free = [n for n in found.problem.params.names if n in found.model.coefficients]
    return [
        "Free also what these runs move, or all (without `--free`, `--fix`): `--free "
        f"'{','.join([*free, *told['moves']])}'`."
    ]


def _move(found: TrialFit, name: str, change: float, sd: float) -> str:
    value = float(found.model.nominal[found.model.index[name]])
    if not value:
        return f"{name} from 0 to {digits(change, 3)} ± {digits(sd, 2)}"
    return f"{name} {percent(change / value, sd / abs(value))}"
