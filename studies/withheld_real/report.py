"""Reports of predictions and verdicts on real logs whose answer is kept elsewhere.

Takes what `studies/withheld_real/run.py` found. Does not compute or compare with the answers.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from bayesid.report.writer import Report, Section, Table, Text, literal
from bayesid.words import first_few

DEG = 180.0 / math.pi
MOST = 4  # names of a set that are spelt out
SKIPPED = ("rudder", "switch", "approach speed")


def facility_report(results: Mapping[str, Any]) -> Report:
    """Manoeuvres of another facility, predicted with bands, after a trial on held-out runs of this one."""
    inside, count = _overshoots_inside(results["checks"])
    n = results["inputs"]
    lead = (
        "The same ship was tested free-running in another facility, whose logs are not here. These are "
        f"predictions of its manoeuvres from a straight run at {n['speed']} m/s and {n['rpm']} rpm, made "
        "from "
        "the zig-zags of this facility alone; one CSV per manoeuvre holds mean and 95 % band. "
        f"**On zig-zags of this facility kept out of the fit, {inside} of {count} measured overshoots lie in "
        "their 95 % band.** The error of the rows repeats from draw to draw, and the draws do not know it. "
        "The "
        f"bands of the predicted zig-zags are therefore widened {results['widened']:.1f} times, after which "
        "half "
        "of the held-out overshoots lie where half should. Circles have no such check: theirs is the "
        "model's own "
        "band, and too narrow if anything.\n\n" + literal(results["attribution"])
    )
    sections = [
        Section("What the bands are worth here", _checks(results["checks"])),
        Section("Predictions", _predictions(results["predictions"])),
        Section(
            "How they were made",
            [
                Text(
                    "Rows: products of two velocities, cubic rows of drift and yaw, the rudder in the "
                    "propeller race, "
                    "a side force of the screw; each free within its prior. What these rows leave of the "
                    "zig-zags "
                    "is carried as a random force whose size their residuals set: "
                    + _force(results["disturbance"])
                    + ". Each of the draws is a ship of the posterior steered by the same orders in its own "
                    "random "
                    "force. Zig-zags steer by each draw's own heading. Circles at 35 degrees reach drift "
                    "angles and "
                    "yaw rates beyond those of the zig-zags: there the rows extrapolate, and the bands know "
                    "of it only "
                    "what the coefficients' covariance knows. Walls, depth and scale of the other tank are "
                    "not in the "
                    "model."
                )
            ],
        ),
    ]
    return Report("KVLCC2 in another facility: predicted, not compared", lead, sections)


def _force(noise_model: Any) -> str:
    values = noise_model if isinstance(noise_model, Mapping) else vars(noise_model)
    x, y, n = values["force"]
    return (
        f"{x:.2g} N along, {y:.2g} N across, {n:.2g} N m about, correlated over {values['force_tau']:.2g} s"
    )


def _overshoots_inside(checks: Sequence[Mapping[str, Any]]) -> tuple[int, int]:
    rows = [row for check in checks for row in _overshoot_rows(check)]
    return sum(row[-1] == "yes" for row in rows), len(rows)


def _overshoot_rows(check: Mapping[str, Any]) -> list[list[Any]]:
    out = []
    for band in check["bands"]:
        name = band["quantity"]
        if name in check["log"] and math.isfinite(check["log"][name]) and band["share"] > 0.5:
            value = check["log"][name]
            inside = "yes" if band["low"] <= value <= band["high"] else "no"
            out.append([check["run"], name, value, band["mean"], band["low"], band["high"], inside])
    return out


def _checks(checks: Sequence[Mapping[str, Any]]) -> list[Any]:
    replay = [
        [check["run"], DEG * check["replay"]["psi"]["rms"], f"{check['replay']['psi']['inside']:.0%}"]
        for check in checks
    ]
    return [
        Table(
            ["held-out run", "overshoot", "measured [deg]", "predicted", "from", "to", "inside"],
            [row for check in checks for row in _overshoot_rows(check)],
            "Zig-zags of this facility, steered anew by the predicted heading; the fit did not read them.",
            3,
        ),
        Table(
            ["held-out run", "heading rms [deg]", "readings inside"],
            replay,
            "The same runs replayed with their measured rudder from the first seconds on.",
            3,
        ),
    ]


def _predictions(rows: Mapping[str, Any]) -> list[Any]:
    blocks: list[Any] = []
    for name, row in rows.items():
        shown = [
            [m["quantity"], m["mean"], m["low"], m["high"], m["unit"], f"{m['share']:.0%}"]
            for m in row["measures"]
            if m["quantity"] not in SKIPPED and m["share"] >= 0.2
        ]
        note = f" {row['diverged']} draws diverged." if row["diverged"] else ""
        blocks.append(
            Table(
                ["measure", "mean", "95 % from", "to", "unit", "draws that have it"],
                shown,
                f"{name}.csv ({row['order']}).{note}",
            )
        )
    return blocks


def wind_report(results: Mapping[str, Any]) -> Report:
    """Which effect acts on each run without a wind log."""
    runs = results["withheld"]["runs"]
    blowing = [row for row in runs if _wind(row["found"]) is not None]
    lead = (
        f"Of {len(runs)} runs in an open pond whose anemometer is withheld, **{len(blowing)} are laid to "
        "wind**; "
        "direction and strength are said below, before anyone compares.\n\n" + literal(results["attribution"])
    )
    area = results["withheld"]["area"]
    sections = []
    if results["hidden"] is not None:
        sections.append(
            Section(
                "What such a statement is worth: runs whose wind is known but was hidden",
                [
                    Table(
                        COLUMNS,
                        [wind_row(row, area["area"]) for row in results["hidden"]["runs"]],
                        "October.",
                    ),
                    Text(_worth(results["hidden"]["runs"])),
                ],
            )
        )
    sections.append(
        Section(
            "Runs without a wind log",
            [Table(COLUMNS, [wind_row(row, area["area"]) for row in runs], "July and September.")],
        )
    )
    sections.append(
        Section(
            "How to read this",
            [
                Text(
                    "Each run was diagnosed alone, with the coefficients the October runs give when their "
                    "measured "
                    "wind is used, and no current in the pond. The catalogue's wind pushes on fixed shares "
                    "of the "
                    f"ship's length squared; in October {area['area']:.2g} ± {area['sd']:.1g} of these "
                    "areas fitted the "
                    "measured wind, and the last column scales by its root. A direction is where the wind "
                    "comes from, "
                    "from the pond's x axis towards y. "
                    "An interval is two standard deviations and knows nothing of gusts or of the model's "
                    "own error. "
                    "A steady force that does not turn with the ship is the wind's rival: the 95 % set says "
                    "when the "
                    "run cannot tell."
                )
            ],
        )
    )
    return Report("Esso Osaka: what acts on runs without a wind log", lead, sections)


COLUMNS = (
    "run", "verdict", "95 % set", "wind comes from [deg]", "speed [m/s]", "speed, areas as in October",
    "anemometer: from, mean vector",
)  # fmt: skip


def _worth(rows: Sequence[Mapping[str, Any]]) -> str:
    """How far said and measured wind are apart where both are known."""
    turned, ratio = [], []
    for row in rows:
        effect, known = _wind(row["found"]), row["measured"]
        if effect is not None and "V_wind" in effect["parameters"] and known:
            off = effect["parameters"]["from"]["value"] - known["from"]
            turned.append(DEG * ((off + math.pi) % (2 * math.pi) - math.pi))
            ratio.append(effect["parameters"]["V_wind"]["value"] / known["speed"])
    missed = [row["measured"]["speed"] for row in rows if _wind(row["found"]) is None and row["measured"]]
    words = f"Wind is said to act in {len(turned)} of {len(rows)} runs"
    if turned:
        words += (
            f"; there it comes from {min(turned):+.0f} to {max(turned):+.0f} degrees beside the anemometer, "
            "at "
            f"{min(ratio):.2f} to {max(ratio):.2f} of its speed"
        )
    if missed:
        words += f". In the others the anemometer had {min(missed):.1f} to {max(missed):.1f} m/s"
    return words + ". The statements below deserve no more trust than that."


def _wind(found: Mapping[str, Any]) -> Mapping[str, Any] | None:
    return next((e for e in found["effects"] if e["name"] == "wind"), None)


def wind_row(row: Mapping[str, Any], area: float) -> list[Any]:
    found, effect = row["found"], _wind(row["found"])
    known = row["measured"]
    measured_wind = f"{DEG * known['from']:.0f} deg, {known['speed']:.2f} m/s" if known else "withheld"
    stated_wind: list[Any] = ["", "", ""]
    if effect is not None and "V_wind" in effect["parameters"]:
        speed, come = effect["parameters"]["V_wind"], effect["parameters"]["from"]
        stated_wind = [
            f"{DEG * come['value']:.0f} ± {DEG * 2 * come['sd']:.0f}",
            f"{speed['value']:.2f} ± {2 * speed['sd']:.2f}",
            f"{speed['value'] / math.sqrt(area):.2f}" if area > 0.01 else "",
        ]
    force: Mapping[str, Any] = next(
        (e["parameters"] for e in found["effects"] if e["name"] == "steady_force"), {}
    )
    if effect is None and force:
        n, e = force["F_north"]["value"], force["F_east"]["value"]
        come = DEG * (math.atan2(-e, -n) % (2 * math.pi))
        stated_wind[0] = f"{come:.0f}: a steady force of {math.hypot(n, e):.2g} N"
    names = first_few((n.replace("_", " ") for n in found["set95"]), MOST)
    return [row["run"], found["verdict"].replace("_", " "), names, *stated_wind, measured_wind]
