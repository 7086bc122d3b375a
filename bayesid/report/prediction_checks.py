"""Checks a prediction fails, one sentence each: its model, what a log lacks, runs and channels it misses.

Takes the trial and the plain numbers of a prediction. Does not simulate.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from bayesid.diagnosis.hypotheses.rules import NAMING
from bayesid.simulation import shaft_speed_note
from bayesid.trials import Trial
from bayesid.words import first_few

LEVEL = 0.95
# Share of the readings inside the band, on average over runs, below which the band may be too narrow; and the
# probability, over all channels, that a vehicle drawn from the model fills no more of it, below which it is.
HELD_SHARE, CHANCE = 0.8, 0.05
MOST_UNNAMED = 0.5  # share of the draws with a cause that the diagnosis does not name
MEASURED = 0.5  # share of the draws that must have a measure for it to be told
MOST_LOST = 3  # predictions named in a sentence
MEASURES_HOLD = (
    " Measures are taken on each drawn vehicle by itself, whenever it gets there: they hold, with the bands "
    "printed."
)


def failed_checks(trial: Trial, numbers: Mapping[str, Any]) -> list[str]:
    """Checks that failed, of the model first.

    Parameters
    ----------
    numbers : record of a prediction: verdict, hypotheses, model_failed_checks, band_checks, predictions
    """
    out = _of_model(numbers)
    if (note := shaft_speed_note(trial)) is not None:
        out.append(f"{note[0].upper()}{note[1:]}.")
    rows = numbers["predictions"]
    lost = [row for row in rows if row["heading_open_from"] is not None]
    if lost:
        since = first_few(
            [f"{row['name']} from {row['heading_open_from']:.0f} s on" for row in lost], MOST_LOST
        )
        measured = any(m["share"] > MEASURED for row in lost for m in row["measures"])
        out.append(
            f"Where the vehicle goes is not predicted for {since}: the 95 % band of its heading is wider "
            "than a full turn there. What is known of the vehicle does not fix it."
            + (MEASURES_HOLD if measured else "")
        )
    told = numbers["band_checks"]
    few = [
        f"{channel} {found['inside']:.0%}"
        for channel, found in told.items()
        if found["inside"] < HELD_SHARE and found["chance"] <= max(CHANCE / len(told), found["least"])
    ]
    if few:
        out.append(
            f"The bands are too narrow: of the readings {LEVEL:.0%} should lie inside, and on average over "
            f"the runs it is {', '.join(few)}. The model lacks something these runs have; what it predicts "
            "of other manoeuvres is less sure than its bands say."
        )
    return out


def of_source(verdict: str, checks: Sequence[str]) -> list[str]:
    """Checks that the fit or the diagnosis a prediction is drawn from failed, told as such."""
    source = f"The {'fit' if verdict == 'fit' else 'diagnosis'} this is drawn from failed a check."
    return [f"{source} {text}" for text in checks]


def _of_model(numbers: Mapping[str, Any]) -> list[str]:
    """Checks the fit or the diagnosis failed, and that a diagnosis names no cause."""
    word = numbers["verdict"]
    out = of_source(word, numbers["model_failed_checks"])
    unnamed = sum(h["weight"] for h in numbers["hypotheses"] if h["effects"])
    if word not in (*NAMING, "fit") and unnamed > MOST_UNNAMED:
        out.append(
            f"The diagnosis this is drawn from names no cause (verdict {word.replace('_', ' ')}): what "
            "is drawn explains the runs it has read, and may not be what acts."
        )
    return out
