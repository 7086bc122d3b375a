"""What brief events look like beside the explanation of the rest of the trial: where, when and how large.

Takes the problem with the readings of the events and the hypotheses without them. Gives the events told anew.
Whether there is one is decided before (`brief_events`): beside the explanation of the whole trial, which may
follow a part of the event itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from bayesid.diagnosis.brief_events import brief_events
from bayesid.diagnosis.cut_runs import sought_in
from bayesid.diagnosis.data.event import Event
from bayesid.diagnosis.form_stage import Compared
from bayesid.diagnosis.hypotheses.facts import simplest


def described(compared: Compared) -> tuple[Event, ...]:
    """Events of a compared problem, brief ones told beside the best explanation of the rest.

    One that is not found again is told as before. Times are those of what it looks like; what was left out
    may be longer. The rest counts in the prior and again beside the event: deviations are a little small.

    Raises
    ------
    ModelError, LinAlgError
        if a run cannot be linearised with that explanation
    """
    known, uncut = compared.problem.events, compared.uncut
    if uncut is None:
        return known
    fitted = simplest(compared.candidates).fit
    # what the rest tells of the explanation is all that is known of it here
    free = replace(fitted.free, mean=fitted.values, sd=fitted.sd)
    points = [replace(point, par=fitted.par) for point in uncut.path]
    with_rest = replace(uncut, environment=compared.problem.environment)
    again = brief_events(sought_in(with_rest, free, points), lambda: -np.inf, tight=True)
    return _anew(known, again)


def _anew(known: Sequence[Event], again: Sequence[Event]) -> tuple[Event, ...]:
    """Known events as they were found again: once where one stands for several of them, all that stand for
    one, with the evidence they were left out for; as before where none does."""
    out: list[Event] = [e for e in known if not e.brief or not _matches(e, again)]
    for event in again:
        if same := _matches(event, [e for e in known if e.brief]):
            whole = sum(e.evidence for e in again if _matches(e, same))
            share = event.evidence / whole  # one for one: 1 to the last bit
            out.append(replace(event, evidence=share * sum(e.evidence for e in same)))
    return tuple(sorted(out, key=lambda e: (e.run, e.start)))


def _matches(one: Event, others: Sequence[Event]) -> list[Event]:
    """Those of the same run that overlap."""
    return [e for e in others if e.run == one.run and one.start < e.end and e.start < one.end]
