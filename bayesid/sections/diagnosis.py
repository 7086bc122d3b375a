"""The report of a diagnosis, told in the order a reader asks: verdict, where, which, proof, what next.

Takes a `Diagnosis` and its JSON record. Does not compute.
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from bayesid import report
from bayesid.diagnose.diagnosis import Diagnosis
from bayesid.diagnose.shrink import Rung
from bayesid.figures import diagnosis as figures
from bayesid.report import Block, Figure, Report, Section, Table, Text, literal
from bayesid.sections import effect_posterior

HEADLINES = {
    "none": "No gap beyond what noise, environment and the stated uncertainty of the coefficients explain.",
    "effect": "One unmodelled effect explains the gap.",
    "effect_with_remainder": "One unmodelled effect explains most of the gap; something of it remains.",
    "several": "Several unmodelled effects together explain the gap.",
    "outside": "There is a gap, and no effect of the catalogue explains it.",
    "coefficients": "The gap closes by moving coefficients beyond their stated uncertainty. An effect named "
    "below acts on these runs as such a change does, so the track alone cannot prove it.",
    "ambiguous": "There is a gap, but these runs cannot tell which of several causes makes it.",
}
_DEGREES = {"rad": ("deg", 180 / math.pi), "rad/s": ("deg/s", 180 / math.pi)}


def write_diagnosis_report(
    found: Diagnosis, folder: str | os.PathLike[str], record: Mapping[str, Any]
) -> Path:
    """Write report.html, report.md, results.json and figures; returns the path of the HTML file."""
    results = {
        "inputs": {
            "trial": found.trial.name,
            "trial_digest": found.trial.digest,
            "vehicle": found.model.vehicle.name,
            "vehicle_digest": found.model.vehicle.digest,
            "attribution": found.trial.attribution,
        },
        "seeds": [found.seed],
        "diagnosis": record,
    }
    return report.write(diagnosis_report(found, record), folder, results)


def diagnosis_report(found: Diagnosis, record: Mapping[str, Any]) -> Report:
    """The report as plain data."""
    lead = f"**{HEADLINES[found.verdict.word]}** {_names(record)} {_outcome(found)}".rstrip()
    if found.trial.attribution:
        lead += f"\n\n{literal(found.trial.attribution)}"
    sections = [
        Section("Verdict", _verdict(found, record)),
        Section("Where the gap lies", _where(found)),
        *_description(found),
        Section("Which effect", _which(found)),
        *effect_posterior.sections(found),
        Section("How far it shrinks", _shrink(found)),
        Section("What these runs can tell apart", _ambiguity(found)),
        Section("What to fly next", _next(found)),
        Section("Data, environment and notes", _notes(found)),
    ]
    return Report(f"Sim-to-real gap of {literal(found.trial.name)}", lead, sections)


def _names(record: Mapping[str, Any]) -> str:
    parts = []
    for effect in record["effects"]:
        values = ", ".join(_value(n, p) for n, p in effect["parameters"].items())
        parts.append(f"**{_words(effect['name'])}**" + (f" ({values})" if values else ""))
    return "; ".join(parts) + ("." if parts else "")


def _outcome(found: Diagnosis) -> str:
    """What it comes to on held-out runs, in degrees of heading."""
    worth = [r for r in found.shrink.rungs if r.worth and "psi" in r.rms["nominal"]]
    if not worth or not found.verdict.effects:
        return ""
    last = worth[-1]
    over = "a whole run" if not math.isfinite(last.seconds) else f"{last.seconds:.0f} s"
    as_was, tuned, now = (
        last.rms[k]["psi"] * 180 / math.pi for k in ("nominal", "recalibrated", "with effect")
    )
    return (
        f"Over {over} of the held-out runs the heading was off by {as_was:.2g} degrees rms as given, by "
        f"{tuned:.2g} with re-tuned coefficients, and by {now:.2g} with the effect."
    )


def _meaning(found: Diagnosis, record: Mapping[str, Any]) -> list[str]:
    """What the parameters of the named effects stand for, and how large they usually are."""
    lines = []
    for named in record["effects"]:
        effect = found.model.effects.get(named["name"])
        if effect is not None and named["parameters"]:
            about = "; ".join(f"{_words(p.name)} is {p.about}" for p in effect.parameters if p.about)
            usual = f" Usual size: {effect.magnitude}." if effect.magnitude else ""
            lines.append(f"- {_words(effect.name)}: {about}.{usual}")
    return lines


def _words(name: str) -> str:
    return name.replace("_", " ")


def _value(name: str, p: Mapping[str, Any]) -> str:
    unit, scale = _DEGREES.get(p["unit"], (p["unit"], 1.0))
    text = f"{_words(name)} {p['value'] * scale:.4g} ± {p['sd'] * scale:.2g}"
    return text if unit == "-" else f"{text} {unit}"


def _verdict(found: Diagnosis, record: Mapping[str, Any]) -> list[Block]:
    probability = record["probabilities"]
    top = sorted(probability, key=lambda n: -probability[n])[:6]
    blocks: list[Block] = [
        Text(
            "\n".join([*_meaning(found, record), *(f"- {reason}" for reason in found.verdict.reasons)])
            + "\n\nLog evidence is in nats: 3 are odds of 20 to 1, 7 of 1000 to 1."
        ),
        Table(
            ["hypothesis", "probability", "in the 95 % set"],
            [
                [_words(n), _probability(probability[n]), "yes" if n in found.verdict.set95 else ""]
                for n in top
            ],
            "Probabilities over no effect, every effect of the catalogue, one wrong coefficient, and "
            "something outside.",
        ),
    ]
    if found.verdict.hidden:
        blocks.append(
            Text(
                "The coefficients' own uncertainty can imitate these effects on these runs, so none of "
                "them is named "
                "alone: "
                + ", ".join(_words(n) for n in found.verdict.hidden)
                + ". Their probabilities above still "
                "count. An earlier clean identification (`--as-built`) or an outside measurement can tell."
            )
        )
    return blocks


def _probability(p: float) -> Any:
    return p if p >= 1e-6 else "below 1e-6"


def _where(found: Diagnosis) -> list[Block]:
    where = found.candidates.where
    blocks: list[Block] = [
        Text(
            "A free signal is let into one channel at a time; the gain in log evidence says how much of "
            "the gap that "
            "channel can carry. No cause is named here."
        ),
        Figure(
            "where",
            figures.bars(
                [p.channel for p in where.places],
                np.array([p.evidence for p in where.places]),
                "gain in log evidence [nats]",
                20.0,
            ),
            "Evidence of a free signal per channel, before any effect is added.",
        ),
    ]
    if where.masks:
        rows = [[m.kind, literal(m.name), m.evidence, f"{m.share:.0%}"] for m in where.masks[:10]]
        blocks.append(
            Table(
                ["kind", "where it may act", "gain [nats]", "share of samples"],
                rows,
                f"The signal in {where.places[0].channel} allowed only in one manoeuvre, window or "
                f"regime. One that keeps "
                "nearly all of the gain is where the gap lives.",
            )
        )
        axes = [n[-1] for n in found.model.kernel.exogenous if n.startswith("force_")]
        many = min(len(where.runs), 4)
        drawn = figures.force(
            [literal(r) for r in where.runs[:many]],
            where.times[:many],
            where.force[:many],
            where.band[:many],
            axes,
        )
        blocks.append(
            Figure("force", drawn, "Smoothed missing force in body axes, with two standard deviations.")
        )
    return blocks


def _description(found: Diagnosis) -> list[Section]:
    d = found.description
    if d is None:
        return []
    blocks: list[Block] = [Text("\n\n".join(literal(s) for s in d.sentences))]
    if d.terms:
        blocks.append(
            Table(
                ["term", "regressor", "value", "sd", "unit", "kept in draws", "gain [nats]", "or else"],
                [
                    [t.name, t.expression, t.value, t.sd, t.unit, t.inclusion, t.gain, ", ".join(t.rivals)]
                    for t in d.terms
                ],
                "Terms of the missing force. Each was proposed by a sparse regression of the smoothed force "
                "and then earned its evidence beside coefficients that were free within their prior. Between "
                "terms of one axis the readings chose, not the regression, whose draws may then be few.",
            )
        )
    return [Section("What the missing force is made of", blocks)]


def _which(found: Diagnosis) -> list[Block]:
    c = found.candidates
    scores = c.scores[:14]
    base = c.none.log_evidence
    rows = [["none", 0.0, c.none.fit.chi2, _arrived(c.none.fit.converged), ""]]
    for r in c.refits:
        k = len(found.problem.coefficients.names)
        values = "; ".join(
            f"{n.split('.')[1]} = {v:.4g} ± {s:.2g}"
            for n, v, s in zip(r.fit.free.names[k:], r.fit.values[k:], r.fit.sd[k:], strict=True)
        )
        rows.append(
            [
                " + ".join(_words(n) for n in r.effects),
                r.log_evidence - base,
                r.fit.chi2,
                _arrived(r.fit.converged),
                values,
            ]
        )
    return [
        Figure(
            "screen",
            figures.bars(
                [_words(s.name) for s in scores],
                np.array([s.gain for s in scores]),
                "gain in log evidence, screen [nats]",
                5.0,
            ),
            "Screen of the whole catalogue along one path, coefficients free.",
        ),
        Table(
            ["effects", "gain [nats]", "chi²", "refit", "parameters (SI)"],
            rows,
            "Refits of the shortlist to convergence. chi² near 1 means residuals of the size of the noise.",
        ),
    ]


def _arrived(converged: bool) -> str:
    return "converged" if converged else "stopped"


def _shrink(found: Diagnosis) -> list[Block]:
    rungs = found.shrink.rungs
    if not rungs:
        return [Text("No run was held out, so no prediction could be proven. Give a run the role `holdout`.")]
    blocks: list[Block] = [
        Text(
            "Held-out runs "
            + ", ".join(literal(r) for r in found.shrink.runs)
            + " were read only after the verdict stood."
        )
    ]
    rows = []
    for r in rungs:
        told = _closed(r) if not r.worth else f"{r.shrink:.1%}"
        if r.worth and math.isfinite(r.interval[0]):
            told += f" ({r.interval[0]:.0%} to {r.interval[1]:.0%})"
        name = r.horizon + (f" ({r.seconds:.0f} s)" if math.isfinite(r.seconds) else "")
        rows.append(
            [name, *(at_floor(r.excess[k]) for k in ("nominal", "recalibrated", "with effect")), told]
        )
    blocks.append(
        Table(
            ["horizon", "nominal", "recalibrated", "with the effect", "shrinks by"],
            rows,
            "Mean squared prediction error above the floor, in noise variances; the floor is what noise, "
            "environment and an unknown start leave to the best of models. The 90 % intervals resample the "
            "pieces predicted and draw the models' parameters from their posteriors.",
        )
    )
    drawn = figures.ladder(
        [r.horizon for r in rungs],
        *(np.array([r.excess[k] for r in rungs]) for k in ("nominal", "recalibrated", "with effect")),
    )
    blocks.append(Figure("ladder", drawn, "The ladder from the simulator as it was to the diagnosed one."))
    last = rungs[-1].rms
    physical = []
    for channel in found.problem.channels:
        unit, scale = (
            ("deg", 180 / math.pi) if channel in ("psi", "phi", "theta") else ("deg/s", 180 / math.pi)
        )
        if channel in ("x", "y", "z"):
            unit, scale = "m", 1.0
        elif channel in ("u", "v", "w"):
            unit, scale = "m/s", 1.0
        physical.append(
            [
                f"{channel} [{unit}]",
                *(last[k][channel] * scale for k in ("nominal", "recalibrated", "with effect")),
            ]
        )
    blocks.append(
        Table(
            ["channel", "nominal", "recalibrated", "with the effect"],
            physical,
            "Full replay, root mean square error.",
        )
    )
    if found.shrink.measures:
        blocks.append(_measures(found))
    return blocks


def _measures(found: Diagnosis) -> Table:
    rows: list[list[Any]] = []
    for m in found.shrink.measures:
        unit, scale = _DEGREES.get(m.unit, (m.unit, 1.0))
        models = (m.models.get(k, math.nan) * scale for k in ("nominal", "recalibrated", "with effect"))
        rows.append([literal(m.run), f"{m.name} [{unit}]", m.logged * scale, *models])
    return Table(
        ["run", "measure", "as logged", "nominal", "recalibrated", "with the effect"],
        rows,
        "Standard measures of the held-out runs, replayed with the logged orders.",
    )


def _closed(rung: Rung) -> str:
    """Words where the recalibrated model leaves no gap."""
    if rung.excess["nominal"] > 1.0 and rung.excess["recalibrated"] < 0.1 * rung.excess["nominal"]:
        return "closed by recalibration"
    return "nothing to shrink"


def at_floor(excess: float) -> Any:
    """An error above the floor; what scatters below it is at the floor."""
    return excess if excess > 0.05 else "at the floor"


def _ambiguity(found: Diagnosis) -> list[Block]:
    a = found.candidates.ambiguity
    order = np.argsort(-a.detect)
    seen = [i for i in order if a.size**2 * a.detect[i] >= 10.0]
    blocks: list[Block] = [
        Text(
            f"From information alone, before any data: of {len(a.names)} effects these runs would show "
            f"{len(seen)} at "
            f"{a.size:g} prior standard deviations."
            + (
                " Told apart poorly: "
                + "; ".join("{" + ", ".join(_words(n) for n in g) + "}" for g in a.groups)
                + "."
                if a.groups
                else ""
            )
        )
    ]
    if len(seen) > 1:
        index = np.array(sorted(seen))
        drawn = figures.isolability([_words(a.names[i]) for i in index], a.margin[np.ix_(index, index)])
        blocks.append(
            Figure(
                "isolability",
                drawn,
                "Expected log-evidence margin of a truth over an explanation; dark is blind.",
            )
        )
    rows = [
        [_words(a.names[i]), float(np.sqrt(10.0 / max(a.detect[i], 1e-12))), f"{a.absorbed[i]:.3f}"]
        for i in order
    ]
    blocks.append(
        Table(
            ["effect", "smallest visible size [prior sd]", "share the coefficients can hide"],
            rows,
            "What would have been seen. Above 0.98 hidden, an effect is never named alone.",
        )
    )
    return blocks


def _next(found: Diagnosis) -> list[Block]:
    if not found.proposals:
        return [Text("No manoeuvre was ranked.")]
    rows = [[_words(p.name), p.duration, p.margin_now, p.margin_with] for p in found.proposals]
    return [
        Text(
            "`bayesid predict BUNDLE MANOEUVRE --model THIS_FOLDER` says, with a band, what each would show."
        ),
        Table(
            ["manoeuvre", "duration [s]", "margin now [nats]", "margin with it [nats]"],
            rows,
            "Expected margin of the worst pair still in the 95 % set (or of a typical effect over none "
            "where the set has one "
            "member) at 0.3 prior standard deviations.",
        ),
    ]


EVENT_KINDS = {
    "sensor": "readings wrong for a while",
    "jump": "position shifts and stays",
    "motion": "the vehicle moves as nothing here explains",
}


def _events(found: Diagnosis) -> list[Block]:
    if not found.problem.events:
        return []
    rows = [
        [literal(e.run), f"{e.start:.1f}", f"{e.end:.1f}", e.channel, EVENT_KINDS[e.kind], e.misfit]
        for e in found.problem.events
    ]
    return [
        Table(
            ["run", "from [s]", "to [s]", "channel", "what", "misfit over the median"],
            rows,
            "Events: short pieces predicted far worse than all others whatever effect is added. They are "
            "left out; what follows starts from a state of its own.",
        )
    ]


def _notes(found: Diagnosis) -> list[Block]:
    e = found.problem.environment
    c = e.colours
    lines = [
        f"- environment {e.source}: force "
        + ", ".join(f"{f:.3g}" for f in c.force)
        + f" N or N m, correlated over {c.force_tau:.3g} s; slow position error {c.drift:.3g} m over "
        f"{c.drift_tau:.3g} s",
        f"- {len(found.problem.outliers)} readings were set aside as outliers",
        *[f"- {literal(w)}" for w in found.warnings],
    ]
    rows = [[run, f"{t:.2f}", channel] for run, t, channel in found.problem.outliers[:20]]
    blocks: list[Block] = [Text("\n".join(lines)), *_events(found)]
    if rows:
        blocks.append(Table(["run", "time [s]", "channel"], rows, "Readings set aside (first 20)."))
    return blocks
