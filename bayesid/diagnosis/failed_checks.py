"""Checks a diagnosis fails, one sentence each: held-out runs, runs that disagree or diverge, coefficients.

Takes a `Result`. Does not compute or draw.
"""

from __future__ import annotations

import math
import shlex
from collections.abc import Collection, Mapping

from bayesid.diagnosis.hypotheses.rules import BESIDE_FORM, NAMING, OTHER_DEPENDENCE, nobody_needs
from bayesid.diagnosis.plain_words import in_words
from bayesid.diagnosis.result import Result
from bayesid.diagnosis.result_parts import SURELY_MOVED, RunError
from bayesid.diagnosis.run_errors import error_rows, missed, missed_too, worse
from bayesid.diagnosis.threshold_table import DISAGREEMENT_P_VALUE, LEAST_RUNS
from bayesid.model.terms import ADDED_MASSES
from bayesid.places import NOWHERE, Places
from bayesid.trials.held_out_log import held_out_notes
from bayesid.words import and_list, digits, first_few

# Stated uncertainties, and times its own size, from which a coefficient is not to be believed.
# A change of many times its size counts from `UNLIKELY` uncertainties on: of some only the order is stated.
FAR_OFF, MOST_CHANGED, UNLIKELY = 10.0, 10.0, 3.0
MOST_FAR, MOST_RUNS = 2, 3  # named one by one
NO_MASS = 1e-6  # share of an added mass that is none
# Begins the note of a diagnosis that wrote no model.
NO_MODEL = "the diagnosed model for `bayesid predict` could not be made"


def needs_none(word: str, rule: str, set95: tuple[str, ...]) -> bool:
    """Whether a verdict stands on no effect, be it that a force with the place or a period explains more."""
    other = rule == BESIDE_FORM or (rule == OTHER_DEPENDENCE and set95 == ("outside",))
    return nobody_needs(word, rule) or other


def explanation(result: Result) -> tuple[str, ...]:
    """Effects of the third model that is shown: none where the verdict needs none."""
    return () if needs_none(result.verdict, result.rule, result.set95) else result.explanation


def failures(result: Result) -> tuple[str, ...]:
    """Checks that failed; each one sentence or two."""
    out = []
    used = explanation(result)
    out += held_out_notes(result.warnings)
    if failed := predicts_worse(result):
        rows = error_rows(failed[0])
        held = sum(run.role == "holdout" for run in result.runs)
        what, so, k = ("The explanation", "with it", 2) if used else ("The re-tuned model", "re-tuned", 1)
        out.append(
            f"{what} predicts {len(failed)} of {held} held-out runs worse than the simulator as "
            f"given ({so}, {failed[0].run} {missed(rows, k)}; as given, {missed_too(rows, 0, k)}): do "
            "not rely on it."
        )
    if lost := diverging(result):
        what = "With the explanation" if used else "Re-tuned"
        runs = first_few(lost, MOST_RUNS)
        out.append(f"{what}, the simulation of {runs} diverges: nothing can be predicted with it.")
    varying = [n for n in used if n not in result.run_sizes or result.run_sizes[n].may_be_absent]
    if runs_disagree(result) and varying:
        size = f"the size of {and_list(in_words(n) for n in varying)}" if result.run_sizes else "its size"
        out.append(
            f"The runs disagree about {size}: that one and the same cause acts in all of them has "
            f"p = {result.runs_agree:.1g}"
            + ("; a run without it would be no surprise." if result.run_sizes else ".")
        )
    if far := far_off(result):
        out.append(far)
    out += negative_added_mass(result)
    refits = [r for r in result.refits if set(r.effects) == set(used)] if used else result.refits
    if refits and not refits[0].converged:
        out.append(
            "The fit of the explanation stopped before it converged; its sizes are rough."
            if used
            else "The re-tuning stopped before it converged; its errors are rough."
        )
    return tuple(out)


def runs_disagree(result: Result) -> bool:
    """Whether the runs ask for different sizes of what is explained, by more than their readings allow."""
    return (
        bool(explanation(result))
        and result.runs_agree is not None
        and result.runs_agree < DISAGREEMENT_P_VALUE
    )


def run_to_run(result: Result) -> str:
    """A sentence where runs that agree about what acts ask for different sizes of it; else empty."""
    told = {n: result.run_sizes[n] for n in explanation(result) if n in result.run_sizes}
    if not (runs_disagree(result) and told) or len(told) < len(explanation(result)):
        return ""
    if any(sizes.may_be_absent for sizes in told.values()):
        return ""
    differ = and_list(f"{_share(sizes.share)} ({in_words(n)})" for n, sizes in told.items())
    runs = max(len(runs) for sizes in told.values() for runs in sizes.sizes.values())
    counted = "; the interval counts that" if runs >= LEAST_RUNS else ""
    return f"From run to run the size differs by more than readings allow, by {differ}, one sd{counted}."


def _share(share: float) -> str:
    return f"{100.0 * share:.0f} %" if share >= 0.005 else "less than 1 %"


def predicts_worse(result: Result) -> list[RunError]:
    """Held-out runs that the explanation predicts worse than the simulator as given, or the re-tuned model
    where no effect is in it and predictions draw it.
    """
    k = 2 if explanation(result) else 1
    as_given = result.verdict == "none" or (result.retuning is not None and not result.retuning.kept)
    if k == 1 and as_given:
        return []
    return [run for run in result.runs if run.role == "holdout" and worse(error_rows(run), k)]


def diverging(result: Result) -> list[str]:
    """Runs whose simulation diverges: with the explanation, or re-tuned where no effect is in it."""
    k = 2 if explanation(result) else 1
    lost = [run for run in result.runs if (rows := error_rows(run)) and not math.isfinite(rows[0].values[k])]
    return [run.run for run in lost]


def prediction_step(
    why_not: str = "", model_written: bool = True, places: Places = NOWHERE, example: str = "MANOEUVRE"
) -> str:
    """What to do next with what was written: predict, or not.

    Parameters
    ----------
    example : a run or manoeuvre, as it is typed
    """
    if not model_written and not why_not:
        out = places.folder or places.beside("fit")
        return (
            f"To predict, fit without --quick and with --out {out}: that writes what `bayesid predict` reads."
        )
    if why_not:
        return f"Do not predict with {places.folder or 'it'}: {why_not}."
    if not places.folder:
        return f"To predict, give --out {places.beside('gap')}: that writes what `bayesid predict` reads."
    command = f"bayesid predict {places.trial} {shlex.quote(example)} --model {places.folder}{places.effects}"
    return f"`{command}` says, with a band, what to expect; `bayesid manoeuvre list` has more to ask for."


def example_of(result: Result) -> str:
    """A manoeuvre or run to predict: the one that is proposed, else the run that is shown."""
    if result.next_manoeuvre:
        return result.next_manoeuvre[0].typed
    return result.runs[0].run if result.runs else "MANOEUVRE"


def far_off(result: Result) -> str:
    """Sentences where explanation or re-tuning takes coefficients out of all reason; else empty.

    A verdict of wrong coefficients says so itself, and of what the runs leave open nothing is told.
    """
    used = explanation(result)
    if not used and result.verdict == "coefficients":
        return ""
    shown = bool(used) and not (result.retuning is not None and result.retuning.alone)
    moved = {
        n: (m.given, m.explained if shown else m.retuned, m.prior_sd)
        for n, m in result.moved.items()
        if not (m.explained_open if shown else m.open)
    }
    what = "The explanation needs" if shown else "Re-tuning needs"
    sized = {
        n: (m.given, m.beside, m.prior_sd)
        for n, m in result.moved.items()
        if m.beside is not None and not m.beside_open
    }
    if used and sized and result.verdict in NAMING:
        moved, what = sized, "The fit that the size told is from needs"
    completed = {n for n in moved if result.moved[n].completed}
    why = (
        "They stand in for the force the equations lack and are no values of this vehicle."
        if result.model_form is not None
        else "As an account of this vehicle it is not to be believed."
    )
    told = out_of_reason(moved, completed)
    said = [f"{what} coefficients far from those stated ({told}). {why}"] if told else []
    if beside := completed_far(moved, completed):
        said.append(f"{'It also needs' if told else what} {beside}")
    return " ".join(said)


def negative_added_mass(result: Result) -> list[str]:
    """A sentence for each model shown in which an added mass is clearly negative, or has gone: potential flow
    has neither."""
    out = []
    for retuned, what in ((True, "Re-tuned"), (False, "With the explanation")):
        if not retuned and not explanation(result):
            continue
        told, none = [], []
        for name in ADDED_MASSES:
            if (m := result.moved.get(name)) is None or m.given >= 0.0:
                continue
            value, sd = (m.retuned, m.retuned_sd) if retuned else (m.explained, m.explained_sd)
            if sd is not None and value - SURELY_MOVED * sd > 0.0:
                told.append(f"{name} is {digits(value, 3)} instead of {digits(m.given, 3)}")
            elif abs(value) < NO_MASS * abs(m.given):
                none.append(name)
        if none:
            out.append(
                f"{what}, {and_list(none)} ended at zero: no hull is without added mass. What is said of "
                "that model is of no vehicle; orders or readings at other times than stated may be why."
            )
        if told:
            out.append(
                f"{what}, {and_list(told)}: a negative added mass, which no hull has. What is said of that "
                "model is of no vehicle; orders or readings at other times than stated may be why."
            )
    return out


def out_of_reason(
    moved: Mapping[str, tuple[float, float, float]], completed: Collection[str] = frozenset()
) -> str:
    """Coefficients far from where they were stated, the furthest first; empty where there are none.

    Parameters
    ----------
    moved : name -> value as given, value found, stated standard deviation
    completed : those that the file does not state, which are not told here
    """
    told = []
    for name, sds in _far(moved).items():
        given, found, _ = moved[name]
        share = f", {100 * (found - given) / given:+.0f} %" if given else ""
        if found * given < 0.0:
            share = f", {digits(given, 3)} to {digits(found, 3)}"
        if name not in completed:
            told.append(f"{name} by {sds:.0f} times its stated uncertainty{share}")
    return first_few(told, MOST_FAR)


def completed_far(moved: Mapping[str, tuple[float, float, float]], completed: Collection[str]) -> str:
    """The same of rows completed from the convention of a file: where they are found, and what it means.

    The uncertainty of such a row is that of the added mass it was made of, and no statement on the row.
    """
    told = [
        f"{name} {digits(moved[name][0], 3)} to {digits(moved[name][1], 3)}"
        for name in _far(moved)
        if name in completed
    ]
    if not told:
        return ""
    return (
        "rows far from what added mass gives, which were completed from the convention of the file, not "
        f"stated ({first_few(told, MOST_FAR)}). What they gain is no added mass; it stands for another "
        "force of the same motion, as drag in a turn, that the file does not state."
    )


def _far(moved: Mapping[str, tuple[float, float, float]]) -> dict[str, float]:
    """Coefficients out of reason and by how many stated standard deviations, the furthest first."""
    far = {}
    for name, (given, found, sd) in moved.items():
        change = abs(found - given)
        sds = change / sd if sd > 0 and math.isfinite(sd) else 0.0
        if sds > FAR_OFF or (sds > UNLIKELY and change > MOST_CHANGED * abs(given) > 0.0):
            far[name] = sds
    return dict(sorted(far.items(), key=lambda item: -item[1]))
