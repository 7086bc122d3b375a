"""Coefficients that a diagnosis moves, in words: how far, how sure, and the option of a fit that frees them.

Takes a `Result`. All are freed that the runs move for sure, told are the first few of those that leave their
stated uncertainty: a fit that keeps one of the others takes what it does for a force the equations lack.
"""

from __future__ import annotations

from collections.abc import Sequence

from bayesid.diagnosis.failed_checks import explanation
from bayesid.diagnosis.plain_words import in_words
from bayesid.diagnosis.result import Result
from bayesid.diagnosis.result_parts import LEAST_MOVED, Moved
from bayesid.words import digits

MOST_MOVED = 6
# Change of a coefficient from which its values say more than per cent [%].
MOST_PERCENT = 300
# Fall from which they do: it is nothing then, or has the other sign [%].
MOST_FALL = 99


def retuned(result: Result) -> bool:
    """Whether the third model has the coefficients re-tuned."""
    return result.retuning is None or result.retuning.kept


def _surely_moved(result: Result) -> list[str]:
    """Coefficients that the runs move for sure, the surest first.

    By their own deviations, not by the stated ones: what a model form leaves open may be anywhere.
    """
    sure = {
        name: m.deviations
        for name, m in result.moved.items()
        if m.prior_sd > 0 and m.given and not m.open and (m.retuned_sd is not None or _leaves(m))
    }
    return sorted(sure, key=lambda name: -sure[name])


def _leaves(m: Moved) -> bool:
    """Whether it leaves its stated uncertainty."""
    return _stated_deviations(m) >= LEAST_MOVED


def _stated_deviations(m: Moved) -> float:
    return abs(m.retuned - m.given) / m.prior_sd


def moved_words(result: Result, first: Sequence[str] = ()) -> tuple[str, ...]:
    """Coefficients that the runs move out of their stated uncertainty, and how far, by re-tuning and with the
    explanation where it does not keep them as given; those asked for first, then the surest."""
    out, both = [], bool(explanation(result)) and retuned(result)
    told = [name for name in _surely_moved(result) if _leaves(result.moved[name])]
    told = [*(n for n in first if n in told), *(n for n in told if n not in first)]
    for name in told[:MOST_MOVED]:
        m = result.moved[name]
        with_it = f", explained {_change(m.explained, m.given)}" if both else ""
        far = f"{_stated_deviations(m):.1f} times its stated uncertainty"
        alike = (in_words(s.effect.name) for s in result.in_place_of if s.coefficient == name)
        far += "".join(f", as {effect} would move it" for effect in alike)
        far += ", may be part of the force the equations lack" if m.form_sd > m.prior_sd else ""
        of = "completed from the convention of the file, not stated" if m.completed else far
        out.append(f"{name} {_change(m.retuned, m.given, m.retuned_sd)} ({of}{with_it})")
    return tuple(out)


def _change(value: float, given: float, sd: float | None = None) -> str:
    """A change in per cent, with its deviation where that is known; the values where it is many per cent, or
    where nothing is left or the sign turns."""
    share = 100 * (value - given) / given
    if share > MOST_PERCENT or share < -MOST_FALL:
        return f"{digits(given, 3)} to {digits(value, 3)}" + (f" ± {digits(sd, 2)}" if sd else "")
    if not sd:
        return f"{round(share):+d} %"
    spread = 100 * sd / abs(given)
    decimals = 0 if spread >= 1 else 1
    return f"{share:+.{decimals}f} ± {max(spread, 0.1):.{decimals}f} %"


def moved_title(result: Result) -> str:
    """What the list of `moved_words` is called: it says where the explanation moves none of them."""
    kept = bool(explanation(result)) and not retuned(result)
    return "coefficients that re-tuning moves, the surest first" + (
        " (the explanation keeps them as given)" if kept else ""
    )


def freeing(result: Result) -> str:
    """The option of a fit that frees the coefficients which surely moved; a log seldom determines all of a
    vehicle's."""
    names = _surely_moved(result)
    return f" --free {','.join(names)}" if names else ""
