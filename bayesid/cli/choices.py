"""The options that several commands share, each declared once: one name, one meaning, one default.

`options` holds those that every command has; this module those about trials, vehicles and manoeuvres.
Quantities are read with or without a unit.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from bayesid.cli.quantity import quantity

Bundle = Annotated[
    Path, typer.Argument(help="Folder of the bundle, its trial.toml, or example.", show_default=False)
]
Data = Annotated[Path | None, typer.Option("--data", help="Folder of the logs if they lie elsewhere.")]
Source = Annotated[
    str, typer.Argument(metavar="VEHICLE|BUNDLE", help="Vehicle, or trial whose runs count as executed.")
]
Vehicle = Annotated[
    str | None, typer.Option("--vehicle", help="Built-in name or vehicle file instead of the trial's.")
]
Free = Annotated[
    str | None,
    typer.Option(
        "--free", metavar="NAMES", help="Free these only, e.g. N_v,N_r,N_dr. Default: all of the file."
    ),
]
Fix = Annotated[
    str | None,
    typer.Option(
        "--fix", metavar="NAMES", help="Keep these as the vehicle has them, e.g. X_udot,Y_vdot,X_vv,U."
    ),
]
Runs = Annotated[
    str | None,
    typer.Option(
        "--runs", metavar="NAMES", help="Read these runs and hold the others out, whatever trial.toml says."
    ),
]
Resample = Annotated[
    float | None,
    typer.Option(
        "--resample", metavar="DT", parser=quantity("s", low=1e-4), help="Read every so many seconds only."
    ),
]
Pieces = Annotated[
    float | None,
    typer.Option(
        "--pieces",
        metavar="TIME",
        parser=quantity("s", low=1e-3),
        help="Cut runs into pieces of this length [s], for unstable vehicles.",
    ),
]
Fitted = Annotated[
    Path | None,
    typer.Option(
        "--model",
        help="Folder that `bayesid fit --out` wrote of this trial: its estimate, noise and model form are "
        "taken.",
    ),
]
Prior = Annotated[
    float | None,
    typer.Option(
        "--prior",
        metavar="SD",
        min=1e-6,
        help="Relative prior sd of every coefficient, e.g. 0.02 after an earlier clean trial. Default: the "
        "vehicle file's, and 0.1 where it states none.",
    ),
]
Noise = Annotated[
    list[str] | None,
    typer.Option(
        "--noise", metavar="CHANNEL=SIGMA", help="White noise on a channel, e.g. psi=0.3deg (bare: SI)."
    ),
]
Step = Annotated[
    float | None,
    typer.Option("--dt", metavar="TIME", parser=quantity("s", low=1e-4), help="Time between samples [s]."),
]
Shaft = Annotated[
    float | None,
    typer.Option(
        "--rpm", metavar="SPEED", parser=quantity("rpm"), help="Shaft speed instead of the usual one."
    ),
]
ShaftRange = Annotated[
    str | None, typer.Option("--rpm", metavar="LOW:HIGH", help="Shaft speeds allowed [rpm].")
]
Duration = Annotated[
    float | None,
    typer.Option(
        "--duration", metavar="TIME", parser=quantity("s"), help="Length of a run [s]; default 45 L/U."
    ),
]
Rudder = Annotated[
    float | None,
    typer.Option("--rudder", metavar="ANGLE", parser=quantity("rad", "deg"), help="Largest rudder [deg]."),
]
Rate = Annotated[
    float | None,
    typer.Option("--rate", metavar="RATE", parser=quantity("rad/s", "deg/s"), help="Rudder rate [deg/s]."),
]
Plane = Annotated[
    float | None,
    typer.Option(
        "--plane",
        metavar="ANGLE",
        parser=quantity("rad", "deg"),
        help="Largest stern plane [deg], 0: none; 6-DOF.",
    ),
]
Box = Annotated[
    float | None,
    typer.Option("--box", metavar="LENGTH", parser=quantity("m"), help="Longest side of the area swept [m]."),
]
Depth = Annotated[
    float | None,
    typer.Option(
        "--depth", metavar="LENGTH", parser=quantity("m"), help="Largest change of depth [m]; 6-DOF."
    ),
]
Dof = Annotated[
    int | None,
    typer.Option(
        "--dof",
        help="3 (horizontal plane) or 6 degrees of freedom. Default: a trial's own, else 3; 6 to simulate "
        "what leaves the plane.",
    ),
]
Executed = Annotated[
    list[str] | None,
    typer.Option("--executed", metavar="MANOEUVRE", help="Counts as executed already; of a vehicle."),
]
Effects = Annotated[
    Path | None,
    typer.Option("--effects", help="Python file whose EFFECTS are added to the catalogue; it is run."),
]
With = Annotated[
    str | None,
    typer.Option(
        "--with",
        metavar="EFFECTS",
        help="Free these effects, or parameters of theirs, beside the coefficients, e.g. ocean_current,"
        "actuator_lag.tau. `bayesid effect list` names them.",
    ),
]
Exclude = Annotated[
    str | None,
    typer.Option(
        "--exclude",
        metavar="NAMES",
        help="Effects that cannot be here, e.g. wind,ocean_current in a towing tank.",
    ),
]
VehicleName = Annotated[str, typer.Argument(help="Built-in name or vehicle file.", show_default=False)]
TrustInput = Annotated[
    bool,
    typer.Option("--trust-input", help="Take the log as it is, whatever its channels say of one another."),
]
