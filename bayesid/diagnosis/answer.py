"""The answer of a diagnosis in plain words: what is different, what it does, how sure, what else, what next.

Takes a `Result`. Gives a frozen `Answer`, of which terminal and report are views. Does not compute or draw.
"""

from __future__ import annotations

import shlex
from dataclasses import dataclass

from bayesid.diagnosis.cannot_tell import (
    MOST_RIVALS,
    SIZELESS,
    WORTH_A_WORD,
    cannot_tell,
    leading_cause,
    to_tell_apart,
    withdrawn,
)
from bayesid.diagnosis.event_words import unexplained, where_to_look
from bayesid.diagnosis.failed_checks import (
    MOST_RUNS,
    NO_MODEL,
    diverging,
    example_of,
    explanation,
    failures,
    prediction_step,
    predicts_worse,
    run_to_run,
)
from bayesid.diagnosis.hypotheses.rules import (
    BESIDE_FORM,
    LEFT_OUT_WORSE,
    MOTION_EVENT,
    NAMING,
    NONE_SURE,
    OUTSIDE_SAID,
    REFUTED,
    UNLISTED_AMONG,
)
from bayesid.diagnosis.moved_words import freeing, moved_words, retuned
from bayesid.diagnosis.plain_words import (
    in_words,
    intervals,
    lowered,
    power_of_drag,
    probability,
    sentence,
)
from bayesid.diagnosis.result import Result
from bayesid.diagnosis.result_parts import Effect, InPlaceOf, RunError
from bayesid.diagnosis.run_errors import (
    ErrorRow,
    closes,
    error_rows,
    kind_of_run,
    mended_reading,
    miss,
    missed,
    missed_too,
    no_nearer,
    run_words,
    worse_in,
)
from bayesid.diagnosis.simulator_words import mistake_certainty, mistake_sentence, mistake_steps
from bayesid.diagnosis.size_names import declared_sizes
from bayesid.diagnosis.third_model import as_given, coefficients_alone, explained_words, in_its_place
from bayesid.diagnosis.threshold_table import SURE_PROBABILITY
from bayesid.diagnosis.unlisted_words import unlisted
from bayesid.diagnosis.unnamed_words import beside_a_form, unnamed_words
from bayesid.model.effects import CATALOGUE
from bayesid.model.effects.named import of_named_actuator
from bayesid.places import NOWHERE, Places
from bayesid.words import first_few

RMS = " (rms)"
TOLD_APART = 1e-3  # probability below which the runs tell an effect from what is named
LARGE_HEADING = 10.0  # degrees rms; a simulator that misses by more is not said to agree


@dataclass(frozen=True)
class Answer:
    """What a reader needs on one screen.

    Attributes
    ----------
    headline : one sentence in engineering units
    outcome : what it means for the run of the picture; empty where no run could be replayed
    failures : checks that failed, to stand beside the headline
    where : the run of the picture, in words; empty without one
    errors : of that run
    labels : of the three models
    explained : what the third of them is
    moved : coefficients that move most, by re-tuning and with the explanation
    certainty, steps : sentences on how sure it is and what else it could be, and on what to do
    """

    headline: str
    outcome: str
    failures: tuple[str, ...]
    where: str
    errors: tuple[ErrorRow, ...]
    labels: tuple[str, str, str]
    explained: str
    moved: tuple[str, ...]
    certainty: tuple[str, ...]
    steps: tuple[str, ...]


def answer(result: Result, places: Places = NOWHERE) -> Answer:
    """The answer of a result, with commands for where it lies."""
    shown = result.runs[0] if result.runs else None
    return Answer(
        mistake_sentence(result) + _headline(result),
        _outcome(result, shown) if shown is not None else "",
        failures(result),
        run_words(shown) if shown is not None else "",
        error_rows(shown) if shown is not None else (),
        ("as given", "re-tuned", in_its_place(result) or "explained"),
        explained_words(result),
        moved_words(result, [s.coefficient for s in result.in_place_of]),
        (*mistake_certainty(result), *_certainty(result)),
        (*mistake_steps(result), *_steps(result, places)),
    )


def counted_after(result: Result) -> str:
    """From when on the errors count."""
    return f"after the first {result.runs[0].lead:.3g} s"


def _or_its_like(e: Effect) -> str:
    """What a probability is of where others of its kind share it."""
    return f" that it or {' or '.join(map(in_words, e.in_its_place))} acts" if e.in_its_place else ""


def _told(e: Effect) -> str:
    """What is named, without a full stop; how often such names were wrong decides about "probably"."""
    said = sentence(e).rstrip(".")
    return said if e.probability >= SURE_PROBABILITY else f"Probably {lowered(said)}"


def _headline(result: Result) -> str:
    word, effects = result.verdict, result.effects
    if word in NAMING and effects:
        said = " ".join(
            f"{_told(e)} (probability {probability(e.probability)}{_or_its_like(e)})." for e in effects
        )
        rest = {
            "effect_with_remainder": " It does not explain the whole gap.",
            "several": " Each of them is needed.",
        }
        return said + rest.get(word, "") + unexplained(result)
    if word == "none":
        return _none(result)
    if word == "coefficients":
        far = moved_words(result, [s.coefficient for s in _certain(result)])[:2]
        left = unexplained(result)
        acts = result.dependence is not None or _certain(result)
        begins = "Coefficients" if acts else "No effect is needed, but coefficients"
        said = f"{begins} lie further off than stated" + (f": {'; '.join(far)}." if far else ".")
        return " ".join([said, *_in_place_of(result)]) + left
    if word == "model_form":
        lacked = "The equations lack a force that depends on the motion" + _like(result)
        return f"{lacked}; {beside_a_form(result)}."
    if word == "outside" or result.rule in OUTSIDE_SAID:
        return unlisted(result)
    return cannot_tell(result) + unexplained(result)


def _none(result: Result) -> str:
    errors = error_rows(result.runs[0]) if result.runs else ()
    if not errors:
        return "No effect is needed: simulator and log agree within the stated uncertainty."
    if closes(errors, 0, 1):
        return (
            f"No effect is needed, but other coefficients: as given, the {kind_of_run(result.runs[0])} "
            f"{missed(errors, 0)}; re-tuned, {missed_too(errors, 1, 0)}."
        )
    heading = next((r.values[0] for r in errors if r.what == "heading"), 0.0)
    if not heading <= LARGE_HEADING:
        return (
            f"No effect shows in these runs, yet as given the {kind_of_run(result.runs[0])} "
            f"{missed(errors, 0)}; re-tuned, {missed_too(errors, 1, 0)}. The course is unstable, or there "
            "is too little to tell by."
        )
    return (
        f"No effect is needed: simulator and log agree to {miss(errors, 0)} on the "
        f"{kind_of_run(result.runs[0])}, the worst of the runs."
    )


def _like(result: Result) -> str:
    form = result.model_form
    if form is None:
        return ""
    names = [in_words(n) for n in form.looks_like]
    if form.period is not None:
        names.append(f"roll with a period of {form.period:.3g} s")
    like = f"; it looks like {' and '.join(names)}" if names else ""
    power = form.drag_power
    return like if power is None else f"; {power_of_drag(power)}{like}"


def _outcome(result: Result, run: RunError) -> str:
    """What it comes to on the run of the picture: always the error as given, re-tuned and explained."""
    errors = error_rows(run)
    if not errors:
        return ""
    verb = "predicted" if run.role == "holdout" else "simulated"
    given, tuned, now = (miss(errors, k) for k in range(3))
    if result.verdict == "none":
        return f"Both are rms errors of the {verb} {run_words(run)}."
    if not explanation(result):
        return (
            f"As given, the {verb} {run_words(run)} {missed(errors, 0, RMS)}; re-tuned, "
            f"{missed_too(errors, 1, 0)}."
        )
    what = (
        "With it" if len(explanation(result)) == 1 and result.verdict in NAMING
        else "With them" if result.verdict in NAMING and len(explanation(result)) == len(result.effects)
        else f"With {' + '.join(in_words(n) for n in explanation(result))}"
    )  # fmt: skip
    if coefficients_alone(result):
        return (
            f"{what}, runs left out are predicted no better than with re-tuned coefficients alone: as given, "
            f"the {verb} {run_words(run)} {missed(errors, 0, RMS)}; re-tuned, {missed_too(errors, 1, 0)}."
        )
    if as_given(result):
        return (
            f"{what}, runs left out are predicted no better, so nothing is gained: as given, the {verb} "
            f"{run_words(run)} {missed(errors, 0, RMS)}; re-tuned, {missed_too(errors, 1, 0)}."
        )
    if not closes(errors, 0, 2) and (mended := mended_reading(run)):
        return (
            f"{what}, {mended} on the {verb} {run_words(run)}. Track and heading stay: it "
            f"{missed(errors, 2, RMS)}; as given, {missed_too(errors, 0, 2)}; re-tuned, "
            f"{missed_too(errors, 1, 0)}."
        )
    if not closes(errors, 0, 2):
        return (
            f"{what}, the {verb} {run_words(run)} {missed(errors, 2, RMS)}, which is no gain: as given, "
            f"{missed_too(errors, 0, 2)}; re-tuned, {missed_too(errors, 1, 0)}."
        )
    before = f" instead of {given}" if given else "; as given, it diverges"
    said = f"{what}, the {verb} {run_words(run)} is within {now} of the log{RMS}{before}"
    if same := no_nearer(errors, 0, 2):
        said += f" ({same})"
    if not tuned:
        return f"{said}; with coefficients re-tuned alone, it diverges."
    if closes(errors, 1, 2) or closes(errors, 2, 1):
        return f"{said}; re-tuning coefficients alone gives {tuned}."
    far = moved_words(result)[:1]
    return f"{said}; re-tuning coefficients alone does as well" + (
        f", but moves {far[0].split(', explained')[0].rstrip(')')})." if far else "."
    )


def rivals(result: Result) -> list[tuple[str, float]]:
    """What else it could be, most probable first, from one per cent on."""
    named = {e.name for e in result.effects} if result.verdict in NAMING else set()
    own = {"none": "none", "model_form": "model_form", "coefficients": "coefficient_error"}.get(
        result.verdict
    )
    left = [(n, p) for n, p in result.probabilities.items() if n not in named and n != own]
    if result.rule == BESIDE_FORM:  # which is there in any case
        left = [(n, p) for n, p in left if n != "model_form"]
    left.sort(key=lambda item: -item[1])
    return [(n, p) for n, p in left if p >= WORTH_A_WORD][:MOST_RIVALS]


def _certain(result: Result) -> list[InPlaceOf]:
    """What stands for coefficients certainly further off than stated."""
    return [s for s in result.in_place_of if s.certain]


def _in_place_of(result: Result) -> list[str]:
    """What would do the same as coefficients that are further off than stated, a sentence for each."""
    first = {s.coefficient: s for s in reversed(_certain(result))}
    return [
        f"Or it is no wrong {name} but {in_words(s.effect.name)}, which no run tells from it: "
        f"{lowered(sentence(s.effect))}"
        for name, s in first.items()
    ]


def _certainty(result: Result) -> tuple[str, ...]:
    out = []
    if (sure := _certain(result)) and result.verdict != "coefficients":
        surest = sure[0]
        off = f"{surest.coefficient} lies further off than stated as well ({surest.moved:.1f} deviations)."
        out.append(" ".join([off, *_in_place_of(result)]))
    if result.verdict in NAMING:
        for e in result.effects:
            out.append(_how_sure(e))
        if any(e.probability < SURE_PROBABILITY for e in result.effects):
            out.append(
                f"Of names with a probability below {SURE_PROBABILITY:.2f} one in twelve was wrong on "
                "withheld trials, of those above one in thirty."
            )
        named = {e.name for e in result.effects}
        if differ := run_to_run(result):
            out.append(differ)
        if unnamed := unnamed_words(result, [n for n in explanation(result) if n not in named]):
            out.append(unnamed)
    first = leading_cause(result) if result.verdict == "ambiguous" else None
    for cause in (*([first] if first is not None else []), *withdrawn(result)):
        if sizes := intervals(cause):
            out.append(f"If it is {in_words(cause.name)}: {', '.join(sizes)}.")
    if result.rule == NONE_SURE and len(explanation(result)) > 1:  # sizes are those of the explanation
        known = [n for n in explanation(result) if result.unnamed.get(n) not in SIZELESS]
        told = [e for e in result.effects if e.name in known and intervals(e)]
        out += [_how_sure(e, "as the explanation has it, ") for e in told]
    said = explanation(result) if result.verdict in NAMING else ()
    other = [(n, p) for n, p in rivals(result) if n not in said]
    if (result.verdict == "outside" and result.rule != LEFT_OUT_WORSE) or result.rule in OUTSIDE_SAID:
        other = [(n, p) for n, p in other if n != "outside"]  # said already
    if result.rule in UNLISTED_AMONG:
        others = [n for n in result.set95 if n in result.acting and n not in ("outside", "model_form")]
        other = [(n, result.acting[n]) for n in others]
    if other and result.verdict != "ambiguous":
        unlisted = "something not on the list that acts alike"
        listed = ", ".join(
            f"{unlisted if n == 'outside' else in_words(n)} ({probability(p)})" for n, p in other
        )
        besides = result.verdict == "model_form" or result.rule in (*OUTSIDE_SAID, *UNLISTED_AMONG)
        what = "What may act beside it" if besides else "What else it could be"
        if result.rule == LEFT_OUT_WORSE:
            what = "The probabilities before that"
        out.append(f"{what}: {listed}.")
    elif not other and result.rule not in OUTSIDE_SAID:
        out.append("Nothing else reaches a probability of 0.01.")
    named = {e.name for e in result.effects}
    groups = [g for g in result.ambiguity_groups if named & set(g)]
    # of others the runs tell more than a trace at usual size does
    alike = sorted({n for g in groups for n in g if result.probabilities.get(n, 1.0) > TOLD_APART} - named)
    if alike:
        out.append(f"On these runs {_list(alike)} would leave nearly the same trace.")
    if result.model_form is not None and result.verdict != "model_form":
        out.append(f"The equations also lack a force that depends on the motion{_like(result)}.")
    out.append(_proof(result))
    if result.verdict == "none" and result.unseen:
        out.append(
            f"These runs would hardly show {first_few(map(in_words, result.unseen), 6)} at their usual size."
        )
    return tuple(out)


def _how_sure(e: Effect, whose: str = "") -> str:
    """Probability and sizes with intervals; `whose` says of which estimate the sizes are."""
    sizes = intervals(e)
    return (
        f"{in_words(e.name).capitalize()}: probability {probability(e.probability)}"
        + (_or_its_like(e) or " that it acts")
        + (f"; {whose}{', '.join(sizes)}." if sizes else ".")
        + _usual(e)
    )


def _list(names: list[str]) -> str:
    return ", ".join(in_words(n) for n in names)


def _usual(e: Effect) -> str:
    return f" Usual size: {e.usual_size}." if e.usual_size else ""


def _proof(result: Result) -> str:
    held = [run for run in result.runs if run.role == "holdout"]
    if not result.runs:
        return "No run could be simulated from end to end, so no error is told; the notes say why."
    if not held:
        return "No run was held out, so the errors are of runs that were read; give one the role `holdout`."
    read = "read after the verdict stood"
    if result.rule == REFUTED:
        read = "read last, which took the name away"
    if not explanation(result):
        return f"Held-out runs: {len(held)}, {read}."
    if in_its_place(result):
        predicts = (
            "The simulator as given predicts" if as_given(result) else "Re-tuned coefficients alone predict"
        )
        return (
            f"Held-out runs: {len(held)}, {read}. {predicts} them, not the "
            "explanation: they are no proof of it."
        )
    off = {run.run: worse_in(error_rows(run)) for run in held}
    if len(held) == 1:
        said = f"worse than as given in {off[held[0].run]}" if off[held[0].run] else "no worse than as given"
        return f"The held-out run, {read}, is predicted {said}."
    lost = first_few([f"{run} in {what}" for run, what in off.items() if what], MOST_RUNS)
    better = sum(not what for what in off.values())
    beside = f" (worse: {lost})" if lost else ""
    of = f"Of {len(held)} held-out runs, {read},"
    return f"{of} {better} are predicted no worse{beside}."


def _retune(result: Result, places: Places) -> str:
    command = f"bayesid fit {places.trial}{freeing(result)} --out {places.beside('fit')}"
    made = places.folder and not any(w.startswith(NO_MODEL) for w in result.warnings)
    if made and retuned(result):
        export = f"bayesid export {places.folder}{places.effects} --out {places.beside('retuned')}"
        how = "frees only what moved for sure" if freeing(result) else "finds them from the runs anew"
        return (
            f"Re-tune: `{export}` writes the vehicle of the errors above, all coefficients re-tuned within "
            f"what is known of them (vehicle_estimate.toml, and draws). `{command}` {how}."
        )
    return f"Re-tune: `{command}` writes the vehicle file."


def _steps(result: Result, places: Places) -> tuple[str, ...]:
    out = []
    if result.verdict in NAMING:
        for e in result.effects:
            if e.parameters:
                found = declared_sizes(e.name, {n: p.value for n, p in e.parameters.items()})
                sizes = {f"{e.name}.{n}": x for n, x in found.items()}
                if result.retuning is not None:
                    sizes = {k: result.retuning.sizes.get(k, v) for k, v in sizes.items()}
                values = " ".join(f"--set {k}={v:.3g}" for k, v in sizes.items())
                given = "" if retuned(result) else ", coefficients as given"
                if in_its_place(result):
                    out.append(f"Look for {in_words(e.name)} on the vehicle.")
                    continue
                out.append(
                    f"Look for {in_words(e.name)} on the vehicle, or simulate with it{given}: `{values}`."
                )
        if coefficients_alone(result):
            out.append(_retune(result, places))
        if not retuned(result) and not as_given(result) and result.effects:
            names = ",".join(e.name for e in result.effects)
            listed = {e.name for e in CATALOGUE}
            if any(e.name not in listed and not of_named_actuator(e.name) for e in result.effects):
                names += places.effects or " --effects FILE"
            out.append(
                f"Coefficients beside {'it' if len(result.effects) == 1 else 'them'}: `bayesid fit "
                f"{places.trial} --with {names} --out {places.beside('fit')}` finds both, and says how they "
                "predict a run that is held out."
            )
    elif (
        result.verdict in ("none", "coefficients")
        and result.runs
        and closes(error_rows(result.runs[0]), 0, 1)
    ):
        out.append(_retune(result, places))
    elif result.rule == MOTION_EVENT:
        held = all(e.kind == "stuck" for e in result.events if e.unexplained)
        apart = "with its order held then" if held else "without that time"
        out.append(
            "See in the notes of the trial, or in the servo's own angle if it is logged, what happened then; "
            f"causes and coefficients are told {apart}, the errors above are not."
        )
    elif result.dependence is not None and result.verdict == "outside":
        out.append(where_to_look(result.dependence))
    elif result.verdict == "outside":
        out.append(
            "Look where and when it acts ('Where the gap lies' in the report's appendix); a cause of your "
            "own is declared in a file and tried with `--effects FILE`."
        )
    if result.next_manoeuvre:
        best = result.next_manoeuvre[0]
        orders = f": {best.orders}" if best.orders else ""
        told = f"{in_words(best.name)}, {best.duration:.0f} s{orders}"
        table = f"`bayesid simulate VEHICLE {shlex.quote(best.typed)} --out FOLDER`"
        out.append(
            f"Run next: {told}; it tells best what is still open. {table} writes its orders (a positive "
            "rudder turns to port) and shows the room it takes."
        )
    elif apart := to_tell_apart(result, places):
        out.append(apart)
    return (*out, prediction_step(_why_not(result), places=places, example=example_of(result)))


def _why_not(result: Result) -> str:
    """Why nothing is to be predicted with what was found; empty where something is."""
    if lost := diverging(result):
        return f"its simulation of {first_few(lost, MOST_RUNS)} diverges"
    if unmade := [w for w in result.warnings if w.startswith(NO_MODEL)]:
        return f"no model could be written ({unmade[0].removeprefix(NO_MODEL).lstrip(': ')})"
    if predicts_worse(result):
        return "it predicts held-out runs worse"
    used = explanation(result)
    refits = [r for r in result.refits if set(r.effects) == set(used)] if used else result.refits
    if refits and not refits[0].converged:
        return "the fit stopped before it converged"
    return ""
