"""`bayesid trial import`: raw logs of any format to a trial bundle, by a map it proposes or is given."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from bayesid.cli.options import OutFolder, Verbose, claimed
from bayesid.words import counted, first_few

if TYPE_CHECKING:
    from collections.abc import Sequence

    from bayesid.trials.importing import LogMap, Proposal
    from bayesid.trials.importing.again import Replaced
    from bayesid.trials.mistakes import InputFinding

ASKED = 3  # exit code: a map was written and asks something
MOST_REMARKS = 6

Sources = Annotated[
    list[Path],
    typer.Argument(
        metavar="SOURCE...",
        help="Logs: text tables, Parquet, MAT, NetCDF, ROS bags, MCAP, ArduPilot .bin/.tlog, PX4 .ulg.",
        show_default=False,
    ),
]
MapFile = Annotated[
    Path | None,
    typer.Option(
        "--map",
        help="What the series are (TOML). Without it one is proposed as BUNDLE/map.toml.",
        dir_okay=False,
    ),
]
OwnMap = Annotated[
    Path | None,
    typer.Option(
        "--map",
        help="What the columns are (TOML). Without it one is proposed as map.toml beside the tables.",
        dir_okay=False,
    ),
]
Named = Annotated[
    str | None,
    typer.Option(
        "--vehicle", help="Built-in name or vehicle file, for a map that is proposed or names none there is."
    ),
]


def import_logs(
    sources: Sources,
    out: OutFolder,
    map_file: MapFile = None,
    vehicle: Named = None,
    verbose: Verbose = False,
) -> int:
    """Turn raw logs into a trial bundle: units, axes, clocks and names by a map, which it proposes itself.

    Without --map it guesses one from names, units and kinematics and writes it to BUNDLE/map.toml, with a
    picture of the runs it would cut. Nothing doubtful is taken silently: with an open question it stops with
    exit code 3; answer in the map, delete the question, and give the command again with --map
    BUNDLE/map.toml. Without a question the bundle is written at once. An import is corrected in the same
    way: edit BUNDLE/map.toml and give it as --map again.
    """
    code, found = imported(sources, out, map_file, vehicle)
    if found is not None:
        _what_it_is_like(found, out, verbose)
    return code


def imported(
    sources: list[Path], out: Path, map_file: Path | None, vehicle: str | None, guided: bool = False
) -> tuple[int, LogMap | None]:
    """(exit code, the map carried out or None while it asks).

    Parameters
    ----------
    guided : `start` calls it, which prints the questions and says how to go on
    """
    from bayesid.cli.output import print_text
    from bayesid.report.import_figure import draw_imported
    from bayesid.trials.importing import apply_map, check_bundle, write_bundle
    from bayesid.trials.importing.again import import_again

    again, proposed = (out / "trial.toml").exists(), map_file is None
    found, map_file = _map(sources, out, map_file, vehicle, "import", ("--out", out), guided)
    if found is None:
        return ASKED, None
    runs, origin = apply_map(found, sources)
    if again:
        _say_replaced(import_again(found, runs, origin, out, map_file), out, map_file)
    else:
        write_bundle(found, runs, origin, out, map_file)
    if not proposed:  # that of the proposal is of the map before it was edited
        draw_imported(check_bundle(out), out)
    print_text(
        f"\n{counted(len(runs), 'run')} written to {out} (provenance.json says where each channel is from)."
    )
    own, other = _name_of(out), _name_of(map_file.parent)
    if found.name == other != own:  # proposed for another trial; a name of the user's own is none of a folder
        print_text(
            f"  - the trial is called {other!r}, by the map {map_file} of another, not {own!r} as its "
            f"folder; edit `name` in {out / 'trial.toml'}"
        )
    told = (() if proposed else joined.stamps for joined in runs)  # a proposal has said them
    notices = [text for joined in runs for text in joined.notices] + [text for its in told for text in its]
    notices = list(dict.fromkeys(notices))
    for text in notices[:6]:
        print_text(f"  - {text}")
    if notices[6:]:
        print_text(f"  and {len(notices) - 6} more in provenance.json")
    return 0, found


def init(
    context: typer.Context,
    sources: Annotated[
        list[Path],
        typer.Argument(
            metavar="TABLE...", help="Text tables of one folder, or the folder.", show_default=False
        ),
    ],
    map_file: OwnMap = None,
    vehicle: Named = None,
    verbose: Verbose = False,
) -> int:
    """Write a trial.toml beside plain tables, a run each, so that they are read where they lie.

    The proposal is that of `trial import`, with the same questions and the same exit code 3; nothing is
    copied. The file is written only if reading the tables by it gives what an import would, number for
    number; where trial.toml cannot say it (latitude and longitude, dates, several files joined on time,
    several runs in a file), the import is named that can.
    """
    from bayesid.cli.output import command, print_text
    from bayesid.files import write_atomic
    from bayesid.trials.importing import ImportLogError
    from bayesid.trials.importing.finding import look_into
    from bayesid.trials.importing.in_place import text_in_place
    from bayesid.trials.schema import write_schema

    if len(sources) == 1 and sources[0].is_dir():
        folder = sources[0]
        sources = [p for p in look_into(folder).logs if p.parent == folder]
        if not sources:
            raise ImportLogError(f"{folder}: holds no table that can be read")
    folder = sources[0].parent
    claimed(context, folder)
    found, map_file = _map(sources, folder, map_file, vehicle, "init")
    if found is None:
        return ASKED
    try:
        text = text_in_place(found, sources)
    except ImportLogError as error:
        line = command("trial", "import", *sources, "--map", map_file, "--out", folder / "bundle")
        raise ImportLogError(f"{error}\nBy an import it can: {line}") from None
    write_atomic(folder / "trial.toml", write_schema(folder) + text)
    place = "it lies" if len(sources) == 1 else "they lie"
    print_text(f"\n{folder / 'trial.toml'} reads {counted(len(sources), 'table')} where {place}.")
    _what_it_is_like(found, folder, verbose)
    return 0


def _map(
    sources: list[Path],
    out: Path,
    map_file: Path | None,
    vehicle: str | None,
    verb: str,
    more: tuple[object, ...] = (),
    guided: bool = False,
) -> tuple[LogMap | None, Path]:
    """(the map given or proposed, None while it asks; its file).

    Parameters
    ----------
    verb, more : name and last words of the command to give once the questions are answered; where that is
        `init` and trial.toml cannot say it, the import is named instead, before the questions
    guided : neither the questions nor how to go on are printed
    """
    from bayesid.cli.output import command, print_text
    from bayesid.model.vehicles import load_vehicle
    from bayesid.trials.importing import ImportLogError, map_text, propose, read_map
    from bayesid.trials.importing.again import may_import_again
    from bayesid.trials.importing.in_place import needs_import
    from bayesid.trials.importing.named_actuators import Steering, steering_of
    from bayesid.trials.importing.planes import pitches

    absent = [str(p) for p in sources if not p.exists()]
    if absent:
        raise ImportLogError(f"{absent[0]}: does not exist")
    if (out / "trial.toml").exists() and not (verb == "import" and may_import_again(out, map_file)):
        own = out / "map.toml"
        imported = verb == "import" and may_import_again(out, own)
        mend = f". To correct this import, edit {own} and give --map {own}" if imported else ""
        raise ImportLogError(f"{out}: holds a trial already; choose another folder or delete it{mend}")
    if map_file is not None:
        found = read_map(map_file)
        return (found if vehicle is None else _with_vehicle(found, map_file, vehicle, out)), map_file
    map_file = out / "map.toml"
    if map_file.exists():
        raise ImportLogError(
            f"{map_file} is there already; carry it out with --map {map_file}, or delete it for a new one"
        )
    ship = None if vehicle is None else load_vehicle(vehicle)
    steering, side = (Steering(), None) if ship is None else (steering_of(ship), pitches(ship))
    proposal = propose(sources, _vehicle(vehicle, out), _name_of(out), steering=steering, pitches=side)
    out.mkdir(parents=True, exist_ok=True)
    map_file.write_text(map_text(proposal.map, proposal.remarks, proposal.unused), encoding="utf-8")
    reasons = needs_import(proposal.map, sources) if verb == "init" and proposal.map.questions else []
    if reasons:
        print_text(f"These tables cannot be read in place, they need an import: {'; '.join(reasons)}.\n")
        verb, more = "import", ("--out", out / "bundle")
    _say(proposal, out, with_questions=not guided)
    if not proposal.map.questions:
        return proposal.map, map_file
    if guided:
        return None, map_file
    print_text(f"\nEdit {map_file}, delete each question when it is answered, then:")
    print_text(command("trial", verb, *sources, "--map", map_file, *more))
    return None, map_file


def _name_of(out: Path) -> str:
    """Name of a trial that is imported to a folder; `bayesid start` makes one called bayesid in that of the
    logs."""
    whole = out.resolve()
    return whole.parent.name if out.name == "bayesid" else whole.name


def _say_replaced(done: Replaced, out: Path, map_file: Path) -> None:
    """What an import that was carried out again did to the files of the one before."""
    from bayesid.cli.output import print_text

    tables = f"{counted(len(done.tables), 'table')} ({first_few(done.tables, 4)})"
    print_text(f"The import in {out} is replaced: trial.toml, provenance.json and {tables}.")
    for name, kept in done.aside:
        why = (
            "is of another vehicle" if name in done.vehicle else "may have been edited since it was imported"
        )
        print_text(f"  - {name} {why}: as it was, it is {kept} now")
    if done.kept:
        print_text(
            f"  - trial.toml keeps the [corrections] it had, {'; '.join(done.kept)}: {map_file} has none. "
            "Write them there for every import to come; an empty table [corrections] there leaves them out"
        )
    if done.lost:
        print_text(
            f"  - trial.toml has the [corrections] of {map_file} and no more those it had, "
            f"{'; '.join(done.lost)}; write into the map what still holds"
        )
    if done.vehicle:
        print_text(f"  - taken from beside the map: {first_few(done.vehicle, 4)}")
    if done.removed:
        print_text(f"  - removed, as no run is made of it any more: {first_few(done.removed, 4)}")
    if done.left:
        print_text(f"  - left, though no run is made of it any more: {first_few(done.left, 4)}")
    if done.results:
        print_text(f"  - of the trial as it was before are the results in {first_few(done.results, 4)}")


def _what_it_is_like(found: LogMap, out: Path, verbose: bool) -> None:
    from bayesid.api.check import check, lacking_orders
    from bayesid.cli.output import command, print_text
    from bayesid.trials.importing import check_bundle
    from bayesid.trials.importing.again import corrected_channels

    trial = check_bundle(out)
    checked = check(trial, with_vehicle=False)
    _list(f"{counted(len(checked.mistakes), 'mistake')} in the log:", checked.mistakes)
    _list("Not enough to say anything:", checked.lacking)
    lost = lacking_orders(trial, corrected_channels(out, found.channels))
    _list("Orders that are not there:", lost)
    # what the reader noticed of a mistake is told with the mistake
    remarks = [w for w in trial.warnings if not {w, w.partition(".csv: ")[2]} & checked.same]
    shown = remarks if verbose else remarks[:MOST_REMARKS]
    _list(f"{counted(len(remarks), 'remark')}:", shown)
    if len(remarks) > len(shown):
        print_text(f"  and {len(remarks) - len(shown)} more: {command('trial', 'check', out)}")
    findings = checked.check.findings
    if findings:
        _mend_first(findings, out)
        return
    able = found.vehicle and not checked.lacking and not lost
    nexts = ("diagnose", out, "--out", out / "gap") if able else ("trial", "check", out)
    print_text(f"Next: {command(*nexts)}")


def _list(head: str, sentences: Sequence[str]) -> None:
    from bayesid.cli.output import print_text

    if sentences:
        print_text(head)
    for text in sentences:
        print_text(f"  - {text}")


def _mend_first(findings: Sequence[InputFinding], out: Path) -> None:
    """The lines that mend the surest mistake, and to check again; a diagnosis would only tell it again."""
    from bayesid.cli.output import command, print_text

    which = "the mistake" if len(findings) == 1 else "the first mistake"
    mend = findings[0].mend
    if mend:
        print_text(f"Next: mend {which} in {out / 'trial.toml'}:")
        for line in mend:
            print_text(f"  {line}")
        for other in findings[0].also:
            print_text(f"  # unless it is: {other}")
    else:
        print_text(f"Next: log anew what {which} is about; no line of trial.toml mends it.")
    print_text(f"Then: {command('trial', 'check', out)}")


def _vehicle(vehicle: str | None, out: Path) -> str:
    """The vehicle as the map names it; a file is copied beside the map.

    Raises
    ------
    VehicleError               there is none of that name, or the file cannot be read
    """
    if vehicle is None:
        return ""
    from bayesid.model.vehicles import builtin_names, load_vehicle
    from bayesid.trials.write import copy_vehicle

    load_vehicle(vehicle)
    if vehicle in builtin_names():
        return vehicle

    out.mkdir(parents=True, exist_ok=True)
    if not (out / "vehicle.toml").exists():
        copy_vehicle(Path(vehicle), out)
    return "vehicle.toml"


def _with_vehicle(found: LogMap, map_file: Path, vehicle: str, out: Path) -> LogMap:
    """The map with the vehicle given, where its own does not exist; what is read is said.

    Raises
    ------
    VehicleError               there is none of the name given, or its file cannot be read
    """
    from dataclasses import replace

    from bayesid.cli.output import print_text
    from bayesid.model.vehicles import builtin_names, load_vehicle

    load_vehicle(vehicle)
    beside = map_file.parent / found.vehicle
    there = bool(found.vehicle) and (found.vehicle in builtin_names() or beside.is_file())
    same = (
        found.vehicle == vehicle
        if vehicle in builtin_names()
        else beside.resolve() == Path(vehicle).resolve()
    )
    if there and same:
        return found
    if there:
        print_text(
            f"The map names the vehicle {found.vehicle!r}, which is read, and not {vehicle!r}; to take that, "
            f"edit `vehicle` in {map_file}."
        )
        return found
    why = f"is not beside it ({found.vehicle!r})" if found.vehicle else "is not named"
    print_text(f"The vehicle of the map {why}: {vehicle!r} is read, as given by --vehicle.")
    own = vehicle if vehicle in builtin_names() else _vehicle(vehicle, out)
    given = own if own == vehicle else str((out / own).resolve())
    return replace(found, vehicle=given)


def _say(proposal: Proposal, out: Path, with_questions: bool = True) -> None:
    from bayesid.cli.output import print_table, print_text
    from bayesid.report.import_figure import draw_runs
    from bayesid.trials.importing.roles import ROLES

    found = proposal.map
    rows = [
        [role, entry.source, entry.unit or ROLES[role].bare, entry.scale if entry.scale != 1 else None]
        for role, entry in found.channels.items()
    ]
    print_table(["channel", "read from", "unit", "scale"], rows)
    own = {"delta_r", "delta_r_cmd"} & set(found.channels)  # the side is about no other
    side = f"; positive rudder turns to {found.rudder_positive}" if own else ""
    print_text(f"\naxes {found.world or 'ned'}, {found.body or 'frd'}{side}")
    kinds: dict[str, int] = {}
    for run in found.runs:
        kinds[run.manoeuvre or "not named"] = kinds.get(run.manoeuvre or "not named", 0) + 1
    each = [k if n == 1 else f"{n} x {k}" for k, n in kinds.items()] if set(kinds) != {"not named"} else []
    what = f": {', '.join(each[:12])}{', ...' if len(each) > 12 else ''}" if each else ""
    print_text(f"{counted(len(found.runs), 'run')}{what}")
    pictures = draw_runs(proposal, out)
    if pictures:
        print_text(
            f"track and commands of each: {pictures[0]}"
            + (f" to {pictures[-1].name}" if pictures[1:] else "")
        )
    remarks = list(proposal.remarks)
    if proposal.unused:
        remarks.insert(0, f"not used: {first_few(map(repr, proposal.unused), 8)}")
    for head, texts in (
        ("Questions, most important first:", found.questions if with_questions else ()),
        ("Taken for granted:", remarks),
    ):
        if texts:
            print_text(f"\n{head}")
            for text in texts[:10]:
                print_text(f"  - {text}")
            if len(texts) > 10:
                print_text(f"  and {len(texts) - 10} more in the map")
