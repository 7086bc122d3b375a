"""Mistakes of the simulator in plain words, for the answer of a diagnosis.

Takes a `Result`. Gives sentences; none where no mistake closes the gap.
"""

from __future__ import annotations

from bayesid.diagnosis.result import Result
from bayesid.diagnosis.result_parts import SimulatorMistakeFound
from bayesid.words import first_few

MOST_NUMBERS = 4


def mistake_sentence(result: Result) -> str:
    """The headline: what is wrong, what else it may be; empty without a mistake."""
    if not result.simulator:
        return ""
    first, *others = result.simulator
    alike = f" Or {' or '.join(m.says for m in others)}." if others else ""
    share = f" (probability {first.probability:.2f} among these)" if others else ""
    beside = f", beside {_effects(first)}," if first.beside else ""
    what = f"A mistake of the simulator{beside} closes the gap"
    if first.or_coefficients:
        what = f"{what}, or coefficients further off than stated do, which these runs cannot tell apart"
    return f"{what}: {first.says}{share}.{alike} As given: "


def mistake_certainty(result: Result) -> tuple[str, ...]:
    """How much better the mended simulator is than what explains the gap otherwise."""
    return tuple(
        f"With the simulator mended ({m.name}) {_left(m)}; log evidence {m.gain:+.0f} over "
        f"the simulator as given, {m.lead:+.0f} over the best explanation without a mistake. Or what made "
        "the log has the opposite mistake."
        for m in result.simulator[:1]
    )


def _left(m: SimulatorMistakeFound) -> str:
    if not m.beside:
        return "no cause is left to look for"
    return f"what is left has a cause that is named, {_effects(m)}"


def _effects(m: SimulatorMistakeFound) -> str:
    return " and ".join(name.replace("_", " ") for name in m.beside)


def mistake_steps(result: Result) -> tuple[str, ...]:
    """The lines of the vehicle file to look at."""
    return tuple(f"Look at the vehicle file: {mend_words(m)}." for m in result.simulator)


def mend_words(m: SimulatorMistakeFound) -> str:
    """Numbers that would be right, the largest changes first."""
    ranked = sorted(m.numbers, key=lambda n: -_change(m, n))
    told = [f"{n} = {m.numbers[n]:.4g} instead of {m.given[n]:.4g}" for n in ranked]
    return f"{m.name}: {first_few(told, MOST_NUMBERS)}" if told else m.name


def _change(m: SimulatorMistakeFound, name: str) -> float:
    return abs(m.numbers[name] - m.given[name]) / max(abs(m.numbers[name]), abs(m.given[name]), 1e-30)
