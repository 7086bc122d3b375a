"""What may be wrong with each named actuator of a vehicle, by the name of the column it is ordered by.

Takes: the actuators of a vehicle file. Gives declarations as in the catalogue: a shaft `n_bow` has the
effects `thruster_bow_...`, an angle or bucket those of its column (`azimuth_bow_...`, `delta_1_...`). Twin
rudders have one steering gear, or two of one type: what both have alike is one effect, `twin_fins_1_2_...`.
More than two fins of one type, as of an X, have one supply beside: `fins_1_2_3_4_...`; so have thrusters of
one type wherever they are, `thrusters_1_2_...`. What turns azimuth thrusters or nozzles alike is one effect,
`azimuths_port_stbd_...`, `nozzles_1_2_...`. Does not: say what may be wrong with one (`named_single`).
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import astuple, replace

from bayesid.model.actuators import Actuator, Fin, Pusher, kind_of
from bayesid.model.actuators.declare import servo_names
from bayesid.model.channels import ACTUATOR_NAMES, TURNED
from bayesid.model.effects.declare import Effect
from bayesid.model.effects.named_single import ALONE, of_fin, of_servo, of_shaft, share_of_force
from bayesid.words import and_list

_OF_NAMED = re.compile(rf"(thrusters?|(twin_)?fins|({'|'.join(TURNED)})s?)_({'|'.join(ACTUATOR_NAMES)})_")
# what a common supply, or a common type, makes of all the fins of an X, or of all thrusters, at once
_COMMON = ("lag", "dead_time", "rate_limit", "effectiveness", "gain")
_RPM = 1000.0  # usual revolutions where none are stated
# words of one actuator -> of several
_PLURAL = {
    "The fin {} turns": "The fins {} turn",
    "The fin {} gives": "The fins {} give",
    "The fin {} is": "The fins {} are",
    "The thruster {} turns": "The thrusters {} turn",
    "The nozzle {} turns": "The nozzles {} turn",
    "Thruster {} follows its": "Thrusters {} follow their",
    "Thruster {} gives": "Thrusters {} give",
    "Thruster {} takes": "Thrusters {} take",
    "Thruster {} acts": "Thrusters {} act",
}


def of_named_actuator(effect: str) -> bool:
    """Whether an effect is of actuators that a vehicle file names, by its name."""
    return bool(_OF_NAMED.match(effect))


def named_effects(actuators: Iterable[Actuator], rpm_ref: float | None = None) -> tuple[Effect, ...]:
    """Effects of every named actuator: force beyond the stated, offset, lag, dead time, rate limit, play, and
    astern or to one side.

    Parameters
    ----------
    rpm_ref : usual revolutions, which size the offset of a shaft
    """
    out: list[Effect] = []
    actuators = tuple(actuators)
    for actuator in actuators:
        shape = actuator.shape
        angles = kind_of(shape).turned_by(shape)
        for signal in actuator.signals:
            if signal in angles:
                out += of_servo(signal, shape.name)
            else:
                out += of_shaft(shape, signal, rpm_ref or _RPM)
        if actuator.signals == angles:
            out += of_fin(shape, angles[0])
    for twins in _twins(actuators):
        out += _of_fins(twins)
    for fins in _sets(actuators):
        out += [effect for effect in _of_fins(fins) if effect.name.endswith(_COMMON)]
    for pushers in _one_type(actuators):
        out += [effect for effect in _of_shafts(pushers, rpm_ref or _RPM) if effect.name.endswith(_COMMON)]
    beside = _steered(actuators, beside=True)
    for pushers in beside:
        out += _of_steering(pushers)
    for pushers in _steered(actuators, beside=False):
        if pushers not in beside:
            out += [effect for effect in _of_steering(pushers) if effect.name.endswith(_COMMON)]
    return tuple(out)


def whole_forces(actuators: Sequence[Actuator]) -> dict[str, tuple[str, ...]]:
    """Effects that scale all the force of an actuator, that of twin fins for both: name -> its columns."""
    twins = _twins(actuators)
    paired = {fin.name for pair in twins for fin in pair}
    alone = [actuator for actuator in actuators if actuator.name not in paired]
    declared: list[tuple[Sequence[Actuator], Sequence[Effect]]] = [(pair, _of_fins(pair)) for pair in twins]
    declared += [((one,), named_effects([one])) for one in alone]
    return {
        effect.name: tuple(signal for actuator in group for signal in actuator.signals)
        for group, each in declared
        for effect in each
        if effect.force == _whole(group)
    }


def _whole(group: Iterable[Actuator]) -> dict[str, str]:
    """The force of an effect that scales all forces of some actuators by one share."""
    each = [share_of_force(actuator.shape, "share") for actuator in group]
    return {axis: " + ".join(force[axis] for force in each) for axis in each[0]}


def _twins(actuators: Sequence[Actuator]) -> list[tuple[Fin, Fin]]:
    """Pairs of fins that mirror each other, one on each side; canted ones may push along the mirrored
    direction or against it."""
    pairs = ((fins[0], fins[1]) for fins in _alike(actuators) if len(fins) == 2)
    return [
        (one, other)
        for one, other in pairs
        if one.at[1] * other.at[1] < 0.0 and other.direction in _mirrored(one.direction)
    ]


def _sets(actuators: Sequence[Actuator]) -> list[list[Fin]]:
    """More than two fins alike but for the side, above or below, that they are on and push to."""
    return [fins for fins in _alike(actuators, level=False) if len(fins) > 2]


def _alike(actuators: Sequence[Actuator], level: bool = True) -> list[list[Fin]]:
    """Fins that are alike but for the side they are on and push to; `level` ones are at one height too."""
    alike: dict[tuple[object, ...], list[Fin]] = {}
    for fin in actuators:
        if isinstance(fin, Fin):
            x, y, z = fin.at
            ahead, aside, down = (abs(part) for part in fin.direction)
            at = (x, abs(y), z if level else abs(z))
            rest = replace(fin, name="", at=at, direction=(ahead, aside, down), behind=None)
            alike.setdefault(astuple(rest), []).append(fin)
    return list(alike.values())


def _mirrored(along: tuple[float, float, float]) -> tuple[tuple[float, float, float], ...]:
    """A direction as the vertical plane through the hull mirrors it, and its opposite."""
    ahead, aside, down = along
    return (ahead, -aside, down), (-ahead, aside, -down)


def _one_type(actuators: Sequence[Actuator]) -> list[list[Pusher]]:
    """Thrusters of one kind with the same curve, two or more, wherever they are and point to."""
    alike: dict[tuple[object, ...], list[Pusher]] = {}
    for one in actuators:
        if isinstance(one, Pusher):
            nowhere = replace(one, name="", at=(0.0, 0.0, 0.0), direction=(1.0, 0.0, 0.0))
            alike.setdefault((one.kind, *astuple(nowhere)), []).append(one)
    return [group for group in alike.values() if len(group) > 1]


def _steered(actuators: Sequence[Actuator], beside: bool) -> list[list[Pusher]]:
    """Thrusters turned, or jets steered, with the same limit, rate and lag, two or more, whatever they push.

    Parameters
    ----------
    beside : only such as stand beside each other, which one gear may turn
    """
    alike: dict[tuple[object, ...], list[Pusher]] = {}
    for one in actuators:
        if isinstance(one, Pusher) and (signal := _steering(one)):
            x, _, z = one.at
            where = (x, z, *map(abs, one.direction)) if beside else ()
            turned = [one.constants[name] for name in servo_names(signal)]
            alike.setdefault((one.kind, *turned, *where), []).append(one)
    return [group for group in alike.values() if len(group) > 1]


def _steering(pusher: Pusher) -> str:
    """The column of the angle of an azimuth thruster or nozzle, "" for what does not turn."""
    return next(iter(pusher.turned_by(pusher.shape)), "")


def _of_steering(pushers: Sequence[Pusher]) -> list[Effect]:
    """The effects of what turns an azimuth thruster or nozzle, on several by the same size."""
    each = [of_servo(_steering(one), one.name) for one in pushers]
    names, first = [one.name for one in pushers], _steering(pushers[0])
    kind = first.partition("_")[0]
    return _together(each, names, f"{kind}s_{'_'.join(names)}", f"{first}_")


def _of_fins(fins: Sequence[Fin]) -> list[Effect]:
    """The effects of one fin, on twins, or all of several, by the same size."""
    each = []
    for fin in fins:
        (signal,) = fin.signals
        each.append([*of_servo(signal, fin.name), *of_fin(fin.shape, signal)])
    names = [fin.name for fin in fins]
    prefix = f"{'twin_' if len(fins) == 2 else ''}fins_{'_'.join(names)}"
    return _together(each, names, prefix, f"{fins[0].signals[0]}_")


def _of_shafts(pushers: Sequence[Pusher], rpm_ref: float) -> list[Effect]:
    """The effects of one shaft, on several by the same size."""
    each = [of_shaft(one.shape, f"n_{one.name}", rpm_ref) for one in pushers]
    names = [one.name for one in pushers]
    return _together(each, names, f"thrusters_{'_'.join(names)}", f"thruster_{names[0]}_")


def _together(
    each: Sequence[Sequence[Effect]], names: Sequence[str], prefix: str, single: str
) -> list[Effect]:
    """Effects that several actuators have by the same size, in the order of those of each.

    Parameters
    ----------
    each : the effects of every actuator
    names : of the actuators
    prefix : what the names of the effects begin with, in place of `single`
    """
    said_of, who = _numbered(names), "Both" if len(names) == 2 else "All"
    out = []
    for effects in zip(*each, strict=True):
        first = effects[0]
        says = first.says
        for one, many in _PLURAL.items():
            said = one.format(names[0])
            if says.startswith(said):
                says = many.format(said_of) + says.removeprefix(said)
        alone = first.form == ALONE
        axes = {axis: " + ".join(e.force[axis] for e in effects) for axis in first.force}
        family = (first.family + "_").removeprefix(single).removesuffix("_")
        out.append(
            replace(
                first,
                name=f"{prefix}_{first.name.removeprefix(single)}",
                says=says.replace("than its order is", "than their orders are"),
                family=f"{prefix}_{family}" if family else prefix,
                stages=tuple(stage for e in effects for stage in e.stages),
                adjust={k: v for e in effects for k, v in e.adjust.items()},
                force=axes,
                form=f"{who} by the same size."
                if alone
                else f"{first.form.removesuffix('.')}; the same on {who.lower()}.",
            )
        )
    return out


def _numbered(names: Sequence[str]) -> str:
    """Names in words: "1 to 4" where they are numbers in a row."""
    first = int(names[0]) if names[0].isdecimal() else None
    if first is None or len(names) < 3 or list(names) != [str(first + k) for k in range(len(names))]:
        return and_list(list(names))
    return f"{names[0]} to {names[-1]}"
