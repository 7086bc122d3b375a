"""The report of a diagnosis, told in the order a reader asks: answer, picture, how sure, what next, evidence.

Takes a `Result`, nothing else: no fit, problem or trial. Does not compute; the sections themselves are in
the modules beside it.
"""

from __future__ import annotations

import os
from pathlib import Path

from bayesid.diagnosis.answer import answer
from bayesid.diagnosis.result import Result
from bayesid.places import NOWHERE, Places
from bayesid.report import writer
from bayesid.report.diagnosis import effect_posterior
from bayesid.report.diagnosis.cause import description_sections, force_blocks
from bayesid.report.diagnosis.evidence import appendix_blocks, cause_blocks, moved_blocks, runs_blocks
from bayesid.report.diagnosis.first_screen import first_blocks
from bayesid.report.diagnosis.limits import ambiguity_blocks, next_blocks, notes_blocks
from bayesid.report.diagnosis.model_form import form_sections
from bayesid.report.writer import Report, Section, literal


def write_diagnosis_report(result: Result, folder: str | os.PathLike[str], places: Places = NOWHERE) -> Path:
    """Write report.html, report.md, results.json and figures; returns the path of the HTML file."""
    results = {
        "inputs": {
            "trial": result.trial.name,
            "trial_digest": result.trial.digest,
            "vehicle": result.trial.vehicle,
            "vehicle_digest": result.trial.vehicle_digest,
            "attribution": result.trial.attribution,
        },
        "seeds": [result.seed],
        "diagnosis": result.record(),
    }
    return writer.write(diagnosis_report(result, places), folder, results)


def diagnosis_report(result: Result, places: Places = NOWHERE) -> Report:
    """The report as plain data."""
    a = answer(result, places)
    lead = f"**{literal(a.headline)}**" + (f"\n\n{literal(a.outcome)}" if a.outcome else "")
    force = force_blocks(result)
    sections = [
        Section("How far each run is missed", runs_blocks(result, a)),
        Section("Which coefficients move", moved_blocks(result, a)),
        Section("Which cause, and how probable", cause_blocks(result)),
        *effect_posterior.sections(result),
        *([Section("The missing force", force)] if force else []),
        *form_sections(result),
        *description_sections(result),
        Section("What these runs can tell apart", ambiguity_blocks(result)),
        Section("Manoeuvres to run next", next_blocks(result)),
        Section("Data, environment and notes", notes_blocks(result)),
        Section("Appendix: evidence, thresholds and method", appendix_blocks(result)),
    ]
    return Report(
        f"{result.trial.name}: simulator against log",
        lead,
        sections,
        [literal(text) for text in a.failures],
        first_blocks(result, a),
    )
