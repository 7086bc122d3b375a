"""A trial.toml for plain tables that are read where they lie, from the same map an import is carried out by.

Takes a `LogMap` and the files. Gives text only if reading the tables by it gives the runs of the import,
number for number. Does not: copy or convert logs; what trial.toml cannot say is for `joining`.
"""

from __future__ import annotations

import tempfile
import tomllib
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from bayesid.errors import TrialError, raise_all
from bayesid.model.channels import channel
from bayesid.model.units import scale
from bayesid.trials.bundle import load_trial, make_trial
from bayesid.trials.correction import Correction, join
from bayesid.trials.importing.axes import body_of
from bayesid.trials.importing.bundle_out import trial_toml
from bayesid.trials.importing.converting import resolve
from bayesid.trials.importing.joining import Joined, apply_map, open_recording
from bayesid.trials.importing.log_map import LogMap
from bayesid.trials.importing.raw import ImportLogError, RawLog
from bayesid.trials.importing.roles import ROLES
from bayesid.trials.stated import RunEntry, Stated
from bayesid.trials.table import CsvTable
from bayesid.trials.trial import Floats, Run, Trial

_DIRECT = {"heading": "psi", "north": "x", "east": "y", "depth": "z", "speed_through_water": "u_water"}
_TURNED = {  # what a role of these axes is in north-east-down, and its sign
    "ned": {},
    "enu": {"x": ("y", 1.0), "y": ("x", 1.0), "z": ("z", -1.0)},
    "nwu": {"y": ("y", -1.0), "z": ("z", -1.0), "psi": ("psi", -1.0)},
}
_NEEDS_IMPORT = {
    "latitude": "latitude and longitude become local metres",
    "qw": "a quaternion becomes angles",
    "v_north": "velocities north and east are turned by the heading",
    "speed_over_ground": "speed and course are turned by the heading",
}
SAME = 1e-9  # of the size of a channel, by which the two ways of reading may differ


def text_in_place(found: LogMap, sources: Sequence[Path]) -> str:
    """trial.toml by which the files are read as the map says.

    Raises
    ------
    ImportLogError             with everything trial.toml cannot say
    """
    problems = needs_import(found, sources)
    if problems:
        raise_all(ImportLogError, "cannot be read in place", problems)
    runs, _ = apply_map(found, sources)
    paths = {path.name: path for path in sources}
    log = next(iter(open_recording(found, runs[0].run.files, paths).logs.values()))
    columns, correction = _stated(found, log)
    more = found.corrections or Correction()
    together = more if correction == Correction() else join([correction, more])
    if together is None:
        both = "scales, offsets or axes of the channels and the [corrections] of the map"
        raise_all(ImportLogError, "cannot be read in place", [f"{both} do not go into one table"])
    zeros = [_zero(found, joined, paths) for joined in runs]
    shifted = [_in_log_time(joined, zero) for joined, zero in zip(runs, zeros, strict=True)]
    files = [joined.run.files[0] for joined in runs]
    vehicle = "vehicle.toml" if found.vehicle.endswith(".toml") else found.vehicle
    _prove(trial_toml(found, shifted, files, "", columns, together), found, runs, sources[0].parent)
    return trial_toml(found, shifted, files, vehicle, columns, together)


def needs_import(found: LogMap, sources: Sequence[Path]) -> list[str]:
    """What a trial.toml cannot say, so that it takes an import, one sentence each."""
    out = [words for role, words in _NEEDS_IMPORT.items() if role in found.channels]
    if len({path.resolve().parent for path in sources}) > 1:
        out.append("the files lie in several folders")
    if len(found.sources) > 1:
        out.append(f"{len(found.sources)} files are joined on time ({', '.join(found.sources)})")
    if found.step:
        out.append(f"the log is thinned to a step of {found.step:g} s")
    if found.corrections is not None and (found.corrections.leave_out or found.corrections.from_time):
        out.append("[corrections] name times, which an import counts from the begin of a log")
    for label, source in found.sources.items():
        options = source.options
        if options.clock not in ("relative", "unix") or len(options.time) != 1:
            out.append(f"the clock of {label} is {options.clock or 'not a column of seconds'}")
        elif options.spread:
            out.append(f"rows of one stamp in {label} are spread")
        elif options.offset or options.columns:
            out.append(f"{label} has no header" if options.columns else f"{label} has a clock_offset")
    out += [
        f"cells of {entry.source} hold a code for no reading"
        for entry in found.channels.values()
        if entry.missing
    ]
    files = [run.files[0] for run in found.runs]
    if len(set(files)) < len(files):
        out.append("several runs are cut out of one file")
    return out


def _stated(found: LogMap, log: RawLog) -> tuple[dict[str, str], Correction]:
    """([columns], [corrections]) that say what the map says."""
    source = next(iter(found.sources.values()))
    world = source.world or found.world or log.world or "ned"
    body = source.body or found.body or log.body or "frd"
    columns = {f"t[{source.options.time_unit or log.time_unit or 's'}]": source.options.time[0]}
    scales: dict[str, float] = {}
    offsets: dict[str, float] = {}
    for role, entry in found.channels.items():
        name = resolve(found, role)[1]
        target, sign = _TURNED[world].get(role, (_DIRECT.get(role, role), 1.0))
        sign *= float(body_of(role, np.ones(1), body)[0])
        unit = entry.unit or log.by_name[name].unit or ROLES[role].bare
        columns[f"{target}[{unit}]"] = name
        if sign * entry.scale != 1.0:
            scales[target] = sign * entry.scale
        if entry.offset:
            # corrections come after the rudder is turned to port
            side = -1.0 if channel(target).rudder and found.rudder_positive == "starboard" else 1.0
            offsets[target] = side * sign * entry.offset * scale(unit, ROLES[role].unit, name)
    east = world == "enu" and "psi" in found.channels
    if east and "psi" in offsets:
        offsets["psi"] *= -1.0
    return columns, Correction(scale=scales, offset=offsets, heading_from="east" if east else "north")


def _zero(found: LogMap, joined: Joined, paths: dict[str, Path]) -> float:
    """Time of the log at which a run of the import begins [s]."""
    recording = open_recording(found, joined.run.files, paths)
    log = next(iter(recording.logs.values()))
    return (log.start or 0.0) + min(float(c.t[0]) for c in log.channels if c.t.size)


def _in_log_time(joined: Joined, zero: float) -> Joined:
    window = joined.run.window
    if window is None:
        return joined
    return replace(joined, run=replace(joined.run, window=(window[0] + zero, window[1] + zero)))


def _prove(text: str, found: LogMap, wanted: Sequence[Joined], folder: Path) -> None:
    """Read the tables by the text and compare with the import.

    Raises
    ------
    ImportLogError             they differ, or the tables cannot be read so
    """
    with tempfile.TemporaryDirectory() as place:
        (Path(place) / "trial.toml").write_text(text, encoding="utf-8")
        try:
            trial, its = load_trial(place, folder), _imported(found, wanted, Path(place))
        except TrialError as error:
            problems = str(error).splitlines()[1:] or [str(error)]
            raise_all(ImportLogError, "cannot be read in place", [p.strip(" -") for p in problems[:6]])
    pairs = list(zip(trial.runs, its.runs, strict=True))
    more = dict.fromkeys(name for here, there in pairs for name in set(_read(here)) - set(_read(there)))
    off = dict.fromkeys(name for here, there in pairs for name in _differs(here, there))
    problems = []
    if more:
        problems.append(
            f"the header of {', '.join(sorted(more))} is one of a bundle: it would be read, though the map "
            "does not name it; name it in [channels], or rename the column"
        )
    if off:
        problems.append(f"{', '.join(off)} would not be what the import makes of it")
    if problems:
        raise_all(ImportLogError, "cannot be read in place", problems)


def _imported(found: LogMap, wanted: Sequence[Joined], place: Path) -> Trial:
    """The bundle an import would write, as its reader would read it."""
    files = [joined.run.files[0] for joined in wanted]  # runs of the same names, which [corrections] may name
    stated = Stated(tomllib.loads(trial_toml(found, wanted, files, "")))

    def table_of(entry: RunEntry) -> CsvTable:
        joined = wanted[files.index(entry.file)]
        heads = ("t[s]", *(f"{name}[{channel(name).unit}]" for name in joined.data))
        rows = np.arange(2, joined.t.size + 2)
        return CsvTable(heads, np.column_stack([joined.t, *joined.data.values()]), rows)

    return make_trial(stated, stated.runs, table_of, place, "", "import")


def _read(run: Run) -> dict[str, Floats]:
    return {k: v for group in run.GROUPS if group != "extra" for k, v in getattr(run, group).items()}


def _differs(here: Run, there: Run) -> list[str]:
    """Channels of the import that are not the same in place."""
    if here.t.size != there.t.size or not np.allclose(here.t - here.t[0], there.t - there.t[0], atol=2e-6):
        return ["the time"]
    have, out = _read(here), []
    for name, values in _read(there).items():
        good = np.isfinite(values)
        if name not in have or not np.array_equal(np.isfinite(have[name]), good):
            out.append(name)
            continue
        off = (have[name] - values)[good]
        off = np.sin(0.5 * off) if channel(name).circular else off
        if float(np.max(np.abs(off), initial=0.0)) > SAME * float(np.max(np.abs(values[good]), initial=1.0)):
            out.append(name)
    return out
