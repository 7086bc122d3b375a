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
from bayesid.diagnosis.data.event import Event
from bayesid.diagnosis.form_stage import Compared
from bayesid.diagnosis.hypotheses.facts import simplest
from bayesid.estimation.parameters import GaussianPrior


def described(compared: Compared) -> tuple[Event, ...]:
    """Events of a compared problem, brief ones told beside the best explanation of the rest.

    One that is not found again is told as before.

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
    free = GaussianPrior(fitted.free.names, fitted.free.where, fitted.values, fitted.sd, fitted.free.low)
    points = [replace(point, par=fitted.par) for point in uncut.path]
    with_rest = replace(uncut, environment=compared.problem.environment)
    again = brief_events(with_rest, free, points, -np.inf, tight=True)
    out = []
    for event in known:
        found = [e for e in again if _overlap(e, event)] if event.brief else []
        out.append(_told_anew(event, found))
    return tuple(dict.fromkeys(out))


def _overlap(one: Event, other: Event) -> bool:
    return one.run == other.run and one.start < other.end and other.start < one.end


def _told_anew(event: Event, found: Sequence[Event]) -> Event:
    """The event as it was found again, with the evidence it was left out for."""
    if not found:
        return event
    best = max(found, key=lambda e: e.evidence)
    return replace(best, evidence=event.evidence)
