"""Section of a diagnosis on the force its equations lack: how much it carries, its size, what it looks like.

Takes a `Result`. Does not compute.
"""

from __future__ import annotations

from bayesid.diagnosis.plain_words import in_words, power_of_drag
from bayesid.diagnosis.result import Result
from bayesid.diagnosis.result_parts import ModelFormPart
from bayesid.report.writer import Block, Section, Table, Text, literal

MOTION = "a drift of 0.2 U, a yaw rate of 0.3 U/L and, where there is one, a rudder of 0.25 rad"


def form_sections(result: Result) -> list[Section]:
    """One section where the runs need a model form, else none."""
    form = result.model_form
    return [] if form is None else [Section("What the equations lack", _blocks(form))]


def _blocks(form: ModelFormPart) -> list[Block]:
    axes = ", ".join(f"{a} {1e3 * s:.2g}" for a, s in form.sizes.items())
    if form.looks_like and not form.sizes and form.period is None and form.drag_power is None:
        return [
            Text(
                f"The best explanation holds {' and '.join(in_words(n) for n in form.looks_like)} "
                "beside others: shapes of a force that depends on the motion "
                "alone, as any simulator lacks one. They are not named as causes. All effects of "
                f"that explanation together gain {form.gain:.3g} nats of log evidence."
            )
        ]
    text = (
        "Every hypothesis has a force of unknown size beside it that depends on the motion alone and that "
        "the symmetry of a hull allows: rows of the force table the vehicle file leaves at zero, its own "
        f"such rows with a wider prior, and the effects declared so. Without it {form.gain:.3g} nats of log "
        "evidence would be lost. Size of each row, in 1e-3 of 1/2 rho L^2 U^2 (moments L^3) at "
        f"{MOTION}: {axes or 'none'}."
    )
    if form.period is not None:
        text += (
            f" It has a resonance with a period of {form.period:.3g} s, as the roll that a planar model "
            "leaves out has: a model with six degrees of freedom can tell."
        )
    if form.drag_power is not None:
        text += (
            f" In it {power_of_drag(form.drag_power)}; at the reference speed the drag is the simulator's."
        )
    if form.rows:
        return [
            Text(text),
            Table(
                ["row", "axis", "force [1e-3]", "sd [1e-3]"],
                [[literal(r.name), r.axis, 1e3 * r.force, 1e3 * r.sd] for r in form.rows],
                f"Rows that differ from zero by two standard deviations, as forces at {MOTION}. Single rows "
                "share what the manoeuvres cannot tell apart.",
            ),
        ]
    if form.sizes:
        text += " No single row differs from zero by two standard deviations: only their sum does."
    return [Text(text)]
