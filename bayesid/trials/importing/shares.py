"""A column that holds a share of full throttle or a pulse width, mapped to revolutions or an angle.

Gives the line of the map that is to be written. Does not: know what full throttle is; only its user does.
"""

from __future__ import annotations

from bayesid.model.channels import channel, is_channel
from bayesid.trials.importing.log_map import ChannelMap
from bayesid.trials.importing.roles import ROLES
from bayesid.trials.importing.unit_words import plain_unit, split_unit
from bayesid.trials.write import toml_text

_OUTSIDE = {"rpm": "rpm", "rad": "deg"}  # inside unit -> the one to write
_FULL = {"rpm": "rpm at full throttle", "rad": "degrees at full deflection"}


def share_of(unit: str | None) -> str | None:
    """ "%" or "us" for a unit of shares or of pulse widths, else None."""
    plain = plain_unit(unit)
    return {"%": "%", "us_pwm": "us", "us": "us"}.get(plain or "")


def in_words(role: str, name: str, entry: ChannelMap, unit: str) -> str | None:
    """What to write where a channel of the map has a unit of shares; None where that is no such mistake."""
    share = share_of(unit)
    if share is None or not _actuates(role):
        return None
    what = "% is a share" if share == "%" else f"[{unit}] is a pulse width"
    return f"{name!r}: {what}, and {role} is in {_OUTSIDE[ROLES[role].unit]}; {_line(role, entry, share)}"


def taken_as_it_is(role: str, name: str, entry: ChannelMap, unit: str | None) -> str | None:
    """What is said of a share that the map reads as revolutions or an angle without a scale.

    Parameters
    ----------
    unit : of the series, as its file or its name says
    """
    share = share_of(unit if unit is not None else split_unit(name)[1])
    scaled = entry.scale != 1.0 or entry.offset != 0.0
    if share is None or entry.unit is None or scaled or not _actuates(role):
        return None
    says = "a share in %" if share == "%" else "a pulse width in us"
    line = _line(role, entry, share)
    return f"{name!r} is called {says} and read as {role} in {entry.unit} as it is; {line}"


def _actuates(role: str) -> bool:
    own = is_channel(role) and channel(role).kind in ("command", "actuator")
    return own and ROLES[role].unit in _OUTSIDE


def _line(role: str, entry: ChannelMap, share: str) -> str:
    inside = ROLES[role].unit
    given = entry.scale != 1.0
    scale = f"{entry.scale!r}" if given else "..."
    offset = f"{entry.offset!r}" if entry.offset else "..."
    shifted = f", offset = {offset}" if share == "us" or entry.offset else ""
    read = f"from = {toml_text(entry.source)}, scale = {scale}{shifted}"
    line = f'write {role} = {{ {read}, unit = "{_OUTSIDE[inside]}" }}'
    if given:
        return line
    if share == "%":
        return f"{line} (scale: {_FULL[inside]} over 100)"
    return f"{line} (scale: {_OUTSIDE[inside]} per us; offset: makes the pulse at rest 0)"
