"""Units, signs and axes that a log does not state, decided by kinematics where they decide, asked where they
do not.

Works on a `Draft` (a map in the making with its questions and remarks).
Does not: read names; `proposing` has done that.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from bayesid.model.units import scale
from bayesid.trials.importing.agreement import (
    drift,
    rudder_t,
    speed_fit,
    speed_fit_of_all,
    track_misfit,
    yaw_fit,
)
from bayesid.trials.importing.angle_units import decide_angle_units
from bayesid.trials.importing.apparent_wind import ask_apparent_wind
from bayesid.trials.importing.clock_agreement import check_clocks, check_rudder_clock
from bayesid.trials.importing.draft import Draft
from bayesid.trials.importing.log_map import LogMap
from bayesid.trials.importing.named_sides import name_body, turn_named
from bayesid.trials.importing.other_axes import axes_that_fit
from bayesid.trials.importing.planes import calm_as_degrees
from bayesid.trials.importing.resting import rests
from bayesid.trials.importing.roles import WORLD_WORDS
from bayesid.trials.importing.speed_axes import (
    MOST,
    ask_speed_axes,
    axes_by_speeds,
    blames_the_heading,
    why_not_the_track,
)
from bayesid.trials.importing.unit_words import positive_side

_DEG = math.pi / 180.0
CLEAR = 0.35  # a hypothesis must leave less than this share of the next one's misfit
STRAIGHT = 0.6  # rad between track and heading up to which they point the same way
AGREES = 0.3  # misfit of a direction that agrees; sideslip in turns leaves up to 0.1
SPEED_UNITS = ("m/s", "kn", "km/h", "ft/s", "cm/s", "mm/s")
SURE_T, LIKELY_T = 5.0, 2.0  # t of the turn by the rudder from which its side is taken, and proposed
NEAR = 0.1  # a unit is told by a scale within this share


def decide(draft: Draft) -> None:
    """All decisions, in an order in which each rests on those before."""
    decide_angle_units(draft)
    _axes(draft)
    name_body(draft)
    _rates(draft)
    turn_named(draft)
    _speeds(draft)
    _current(draft)
    _depth(draft)
    check_rudder_clock(draft)
    _rudder(draft)
    _revolutions(draft)
    ask_apparent_wind(draft)
    check_clocks(draft)
    if draft.mirror:
        body = "flu" if draft.map.body != "flu" else "frd"
        side = "port" if draft.map.rudder_positive == "starboard" else "starboard"
        rest = f', body = "{body}"' if draft.has("r") or draft.has("v") else ""
        draft.ask(
            0,
            f"which axes? ned ({WORLD_WORDS['ned']}) is set; enu ({WORLD_WORDS['enu']}) fits as well, as "
            f"its mirror "
            f'image: then set world = "enu"{rest}, rudder_positive = "{side}"',
        )


def _axes(draft: Draft) -> None:
    """World axes by agreement of track and heading, and whether they can be told from their mirror image."""
    attitude = (
        "heading"
        if draft.has("heading")
        else "psi"
        if draft.has("psi")
        else "qw"
        if draft.has("qw")
        else None
    )
    absolute = draft.has("latitude", "longitude") or draft.has("north", "east")
    local = draft.has("x", "y")
    if attitude is None or not (absolute or local):
        if attitude in ("psi", "qw") and not draft.axes_stated:
            draft.ask(
                1,
                f"world: {draft.column(attitude)} turns clockwise (ned) or counter-clockwise (enu, nwu)? "
                f"no position tells",
            )
        return
    options: list[tuple[str, LogMap]] = []
    if attitude == "heading" and absolute:
        options = [("ned", draft.map)]
    elif attitude == "psi" and not draft.axes_stated:
        options = [(w, replace(draft.map, world=w)) for w in ("ned", "enu", "nwu")]
        if local:
            flipped = draft.rename("psi", "heading")
            options += [(f"heading {w}", replace(flipped, world=w)) for w in ("enu", "nwu")]
    elif draft.axes_stated:
        options = [(draft.map.world or "ned", draft.map)]
    else:
        options = [(w, replace(draft.map, world=w)) for w in ("ned", "enu", "nwu")]
    fits = {key: track_misfit(m, draft.liveliest) for key, m in options}
    straight = {k: (m if abs(rot) < STRAIGHT else m + 1.0) for k, (m, rot) in fits.items()}
    best = min(straight, key=lambda k: (round(straight[k], 3), list(straight).index(k)))
    misfit, rotation = fits[best]
    draft.map = dict(options)[best]
    mirrored = absolute is False and attitude != "heading" and not draft.axes_stated
    by_speeds = axes_by_speeds(draft, options) if misfit > AGREES or abs(rotation) > STRAIGHT else None
    if by_speeds is not None:
        straight = {k: share for k, (share, _) in by_speeds.items()}
        best = min(straight, key=lambda k: straight[k])
        misfit, rotation = by_speeds[best]
        draft.map = dict(options)[best]
    elif misfit > AGREES:
        why = axes_that_fit(draft) or "are these position and heading of one vehicle, on one clock?"
        draft.ask(
            0,
            f"track and heading {draft.column(_attitude_role(draft))} do not agree in any axes tried "
            f"({100 * misfit:.0f} % of the track unexplained); {_or_sideways(draft, why)}",
        )
        return
    rivals = [
        k for k in straight if k != best and straight[k] < misfit / CLEAR and not _same(k, best, absolute)
    ]
    draft.handed = not mirrored
    if mirrored:
        shown = draft.map.world or "ned"
        if best.startswith("heading"):
            draft.ask(
                0,
                f"x, y fit {shown} with a yaw that runs clockwise (set), or ned with one that runs "
                f"counter-clockwise: which?",
            )
        else:
            draft.mirror = True
            draft.map = replace(draft.map, world="ned")
    elif rivals:
        draft.ask(0, f"track and heading fit {best} hardly better than {rivals[0]}; check `world`")
    least = 15.0 * _DEG  # sideslip in turns to one side alone turns the direction by as much
    if by_speeds is not None:
        least = 4.0 * _DEG
    elif draft.has("u", "v"):
        with_speed = speed_fit(draft.map, draft.liveliest)
        agrees = with_speed is not None and with_speed[1] < AGREES
        if with_speed is not None and agrees and not blames_the_heading(draft, with_speed[2]):
            rotation, least = with_speed[2], 4.0 * _DEG
    else:
        rotation = float(np.median([track_misfit(draft.map, r)[1] for r in draft.recordings[:8]]))
    guess = axes_that_fit(draft) if draft.handed and by_speeds is None else ""
    if abs(rotation) > 0.6:
        mend = _or_sideways(draft, guess or "give the heading an `offset`, or another `world`")
        draft.ask(
            0,
            f"the track runs {rotation / _DEG:+.0f} deg off the heading "
            f"{draft.column(_attitude_role(draft))}: position and heading "
            f"count from different norths; {mend}",
        )
    elif abs(rotation) > least:
        draft.ask(
            0 if guess else 3,
            f"the track runs {rotation / _DEG:+.1f} deg off the heading "
            f"{draft.column(_attitude_role(draft))}: magnetic north, a "
            "misaligned compass or a current? give the heading an `offset` (in its unit), or leave it"
            + (f"; {guess}" if guess else ""),
        )
    elif guess:
        draft.ask(
            0,
            f"the track does not run along the heading {draft.column(_attitude_role(draft))} in all runs; "
            f"{guess}",
        )


def _attitude_role(draft: Draft) -> str:
    return next(r for r in ("heading", "psi", "qw") if draft.has(r))


def _same(a: str, b: str, absolute: bool) -> bool:
    """Hypotheses that are mirror images or rotations of one another when positions are local."""
    return not absolute and a.startswith("heading") == b.startswith("heading")


def _rates(draft: Draft) -> None:
    if not draft.has("r"):
        return
    units = (
        ["rad/s", "deg/s", "deg/min"] if not draft.stated["r"] else [draft.map.channels["r"].unit or "rad/s"]
    )
    base = draft.change("r", unit=units[0])
    base = base if draft.body_stated else replace(base, body="frd")
    fit = yaw_fit(base, draft.liveliest)
    if fit is None or fit[1] < 0.7:
        if fit is not None and draft.headed:
            draft.ask(
                3,
                f"yaw rate {draft.column('r')} follows the heading poorly ({100 * max(fit[1], 0):.0f} % of "
                f"it); right column, right "
                "clock? else delete `r`",
            )
        elif not draft.stated["r"]:
            top = float(np.max(np.abs(draft.raw("r"))))
            draft.map = draft.change("r", unit="deg/s" if top > 3.0 else "rad/s")
            draft.ask(
                4,
                f"yaw rate {draft.column('r')} states no unit and nothing tells it; read as "
                f"{'deg/s' if top > 3.0 else 'rad/s'}",
            )
        if not (draft.body_stated or draft.body_named):
            why = "is read without a heading" if not draft.headed else "does not follow the heading"
            why = "cannot be held against the heading" if draft.headed and fit is None else why
            draft.ask(
                2,
                f"body: yaw rate {draft.column('r')} {why}, so that nothing tells whether it counts to "
                "starboard (frd) or to port (flu)",
            )
        return
    size = {u: abs(fit[0]) * scale(units[0], "rad/s", "r") / scale(u, "rad/s", "r") for u in units}
    unit = min(size, key=lambda u: abs(math.log(size[u])))
    if abs(math.log(size[unit])) > 0.2:
        draft.ask(
            1,
            f"heading changes {size[unit]:.3g} times as much as the integral of {draft.column('r')} "
            f"[{unit}]; check both units",
        )
    draft.map = draft.change("r", unit=unit)
    if fit[0] < 0:
        if draft.body_stated:
            draft.ask(
                1,
                f"yaw rate {draft.column('r')} runs against the heading although body axes are stated; "
                f"check `body` and `world`",
            )
        else:
            draft.map = replace(draft.map, body="flu")
    elif not draft.body_stated:
        draft.map = replace(draft.map, body="frd")


def _speeds(draft: Draft) -> None:
    if not draft.has("u"):
        return
    for role in ("u", "v", "w"):
        if draft.has(role) and not draft.stated[role]:
            draft.map = draft.change(role, unit="m/s")
    if ask_speed_axes(draft):
        draft.wrong_speeds = True
        return
    if draft.has("v"):
        for_v = speed_fit(draft.map, draft.liveliest)
        turned = draft.change("v", scale=-draft.map.channels["v"].scale)
        against = speed_fit(turned, draft.liveliest)
        if for_v and against and against[1] < CLEAR * for_v[1]:
            if draft.has("r") or draft.body_stated or draft.body_named:
                draft.map = turned
                draft.ask(
                    2,
                    f"sway {draft.column('v')} counts against the body axes of the other series; its sign "
                    f"is turned (scale = {turned.channels['v'].scale:g}), check it",
                )
            else:
                draft.map = replace(draft.map, body="flu")
        elif not (draft.has("r") or draft.body_stated or draft.body_named) and not (
            for_v and for_v[1] < CLEAR * (against or for_v)[1]
        ):
            draft.ask(
                2,
                f"body: nothing tells whether sway {draft.column('v')} counts to starboard (frd) or to "
                f"port (flu)",
            )
    fit = speed_fit(draft.map, draft.liveliest)
    if fit is None or fit[1] > AGREES:
        every = speed_fit_of_all(draft.map, draft.recordings[:MOST])
        fit = every if every is not None and every[1] < AGREES else fit
    if fit is None or fit[1] > AGREES:
        if draft.has("x", "y") or draft.has("latitude") or draft.has("north"):
            draft.ask(2, why_not_the_track(draft))
        elif not draft.stated["u"]:
            draft.ask(2, f"speed {draft.column('u')} states no unit and no position tells it; read as m/s")
        return
    size = fit[0]
    metric = draft.has("latitude") or any(draft.stated.get(r) for r in ("x", "north"))
    if draft.stated["u"] or not metric:
        if abs(math.log(size)) > NEAR:
            unit = "position" if not metric else "speed"
            near = min(SPEED_UNITS, key=lambda u: abs(math.log(size / scale(u, "m/s", "u"))))
            draft.ask(
                1,
                f"the track is {size:.3g} times as long as {draft.column('u')} says: the unit of {unit} or "
                f"time is another "
                f"({near}?), or the speed is through the water (`u_water`)",
            )
        elif not metric and not draft.stated["u"]:
            draft.ask(
                2,
                f"neither position {_position(draft)} nor speed {draft.column('u')} states a unit; m and "
                f"m/s are set",
            )
        elif abs(math.log(size)) > 0.03:
            draft.remark(f"the track is {size:.3f} times as long as {draft.column('u')} says")
        return
    unit = min(SPEED_UNITS, key=lambda u: abs(math.log(size / scale(u, "m/s", "u"))))
    off = abs(math.log(size / scale(unit, "m/s", "u")))
    for role in ("u", "v", "w"):
        if draft.has(role) and not draft.stated[role]:
            draft.map = draft.change(role, unit=unit)
    if off > NEAR:
        draft.ask(
            1,
            f"speed {draft.column('u')} states no unit; the track is {size:.3g} times as long as it says "
            f"(read as {unit})",
        )
    elif unit != "m/s":
        draft.remark(f"speed {draft.column('u')} is read as {unit}: the track is {size:.3f} times as long")


def _current(draft: Draft) -> None:
    """Asks where the track drifts steadily away from what u and v integrate to."""
    told = draft.has("u", "v") and not draft.wrong_speeds
    found = drift(draft.map, draft.liveliest) if told else None
    if found is not None and found[0] > max(0.05 * found[2], 4.0 * found[1]):
        draft.ask(
            2,
            f"the track drifts {found[0]:.2g} m/s off what {draft.column('u')} and {draft.column('v')} say: "
            "if they are through the water, call them `u_water` and `v_water`; if over ground, position or "
            "heading errs",
        )


def _position(draft: Draft) -> str:
    return draft.column("x" if draft.has("x") else "north")


def _depth(draft: Draft) -> None:
    if draft.has("depth"):
        raw = draft.raw("depth")
        if raw.size and float(np.median(raw)) < -0.3:
            draft.map = draft.change("depth", scale=-draft.map.channels["depth"].scale)
            draft.ask(
                4, f"depth {draft.column('depth')} is negative; its sign is turned (scale = -1), check it"
            )
    elif draft.has("z") and draft.handed is False and not draft.axes_stated:
        raw = draft.raw("z")
        side = (
            "up (enu)"
            if raw.size and float(np.median(raw)) < -0.3
            else "down (ned)"
            if float(np.median(raw)) > 0.3
            else ""
        )
        if side:
            draft.remark(
                f"{draft.column('z')} is {'below' if 'up' in side else 'above'} zero in the middle, which "
                f"below the surface means z {side}"
            )


def _rudder(draft: Draft) -> None:
    for role in [name for name in draft.map.channels if name.startswith("delta_")]:
        raw = draft.raw(role)
        top = float(np.max(np.abs(raw))) if raw.size else 0.0
        unit = draft.map.channels[role].unit
        name = draft.column(role)
        if unit in ("us_pwm", "%") or (not draft.stated[role] and 800 < float(np.median(raw)) < 2200):
            draft.map = draft.change(role, unit="deg")
            draft.ask(
                1,
                f"{role} {name} is a pulse width or a share, not an angle; give it `scale` and `offset` to "
                f"degrees",
            )
        elif not draft.stated[role]:
            draft.map = draft.change(role, unit="rad" if top <= 0.8 else "deg")
            if 0.8 < top <= 2.0:
                draft.ask(
                    1,
                    f"{role} {name} states no unit and reaches {top:.3g}: deg, rad, or a share of full "
                    f"rudder? (read as deg)",
                )
        elif unit == "rad" and top > 1.6:
            draft.ask(1, f"{role} {name} is labelled rad and reaches {top:.3g}; degrees?")
        elif (
            unit == "deg"
            and 0.0 < top < 0.8
            and not (rests(draft, role) or calm_as_degrees(draft, role, top))
        ):
            draft.ask(1, f"{role} {name} is labelled deg and stays within {top:.2g}; radians?")
    both = [r for r in ("delta_r_cmd", "delta_r") if draft.has(r)]
    if draft.late and both:  # the side is told with the clock
        draft.map = replace(draft.map, rudder_positive=draft.late[0].turns_to)
    if not both or draft.late:
        return
    values = [t for t in (rudder_t(draft.told, r) for r in draft.recordings[:12]) if t is not None]
    pooled = sum(values) / math.sqrt(len(values)) if values else 0.0
    said = {positive_side(draft.column(role)) for role in both} - {None}
    side = said.pop() if len(said) == 1 else None
    turned = "starboard" if pooled > 0 else "port"
    if abs(pooled) < SURE_T and side is not None:
        draft.map = replace(draft.map, rudder_positive=side)
        draft.remark(f"positive rudder turns to {side}, as the name {draft.column(both[0])} says")
    elif abs(pooled) < SURE_T:
        leaning = turned if abs(pooled) > LIKELY_T else "port"
        draft.map = replace(draft.map, rudder_positive=leaning)
        why = f"{turned} is more likely and set" if abs(pooled) > LIKELY_T else "port is set, a convention"
        draft.ask(
            1,
            f"rudder_positive: the turns do not tell surely ({abs(pooled):.1f} standard errors; {SURE_T:g} "
            f"are enough) whether positive {draft.column(both[0])} turns to port or to starboard; {why}",
        )
    else:
        draft.map = replace(draft.map, rudder_positive=turned)
        if side not in (None, turned):
            draft.ask(
                0,
                f"rudder_positive: {draft.column(both[0])} says that positive is {side}, and the vehicle "
                f"turns to {turned} by positive values (by {abs(pooled):.0f} standard errors); {turned} is "
                "set",
            )
        elif draft.handed:
            draft.remark(
                f"positive rudder turns to {draft.map.rudder_positive}, as the turns tell by "
                f"{abs(pooled):.0f} standard errors"
            )


def _or_sideways(draft: Draft, text: str) -> str:
    """A mend, and the question whether the vehicle goes sideways where no log says so."""
    if draft.has("v"):
        return text
    return f"{text}{'' if text.endswith('?') else '.'} Or does the vehicle go sideways? Then add `u` and `v`"


def _revolutions(draft: Draft) -> None:
    for role in ("n_cmd", "n"):
        if not draft.has(role):
            continue
        raw = draft.raw(role)
        top = float(np.max(np.abs(raw))) if raw.size else 0.0
        if draft.map.channels[role].unit in ("us_pwm", "%"):
            draft.map = draft.change(role, unit="rpm")
            draft.ask(
                2,
                f"{role} {draft.column(role)} is a pulse width or a share; give it `scale` and `offset` to "
                f"rpm, or delete it",
            )
        elif not draft.stated[role] and "rpm" in draft.column(role).lower() and top > 30.0:
            draft.map = draft.change(role, unit="rpm")
        elif not draft.stated[role]:
            draft.map = draft.change(role, unit="rpm")
            if top <= 150.0 or (800 < float(np.median(raw)) < 2200 and np.all(raw > 700)):
                draft.ask(
                    2,
                    f"{role} {draft.column(role)} states no unit and reaches {top:.3g}: rpm, rps, or a "
                    f"share? (read as rpm)",
                )
            else:
                draft.remark(f"{role} {draft.column(role)} states no unit and is read as rpm")
