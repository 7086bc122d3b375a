"""A diagnosis in a few lines: what the terminal prints and `Diagnosis.summary()` gives."""

from __future__ import annotations

import re

from bayesid.diagnosis.result import Result

_SIGNED_ZERO = re.compile(r"(?<![\w.])[+-](0(?:\.0+)?)(?!\.?\d)")


def unsigned_zeros(text: str) -> str:
    """Text in which what was rounded to zero has lost its sign."""
    return _SIGNED_ZERO.sub(r"\1", text)


def summary(result: Result) -> str:
    """Verdict, effects, reasons, what is left, how far the gap shrinks, and notes; one a line."""
    out = [f"verdict: {result.verdict}"]
    for effect in result.effects:
        values = ", ".join(
            f"{n} = {p.value:.4g} +- {p.sd:.2g} {p.unit}" for n, p in effect.parameters.items()
        )
        out.append(f"  {effect.name} (probability {effect.probability:.3f}) {values}")
    out.append("95 % set: " + ", ".join(result.set95))
    if result.model_form is not None:
        like = (
            f"; looks like {', '.join(result.model_form.looks_like)}" if result.model_form.looks_like else ""
        )
        out.append(
            "  the equations lack a force that depends on the motion: without it "
            f"{result.model_form.gain:.1f} of log evidence would be lost{like}"
        )
    out += [f"  {unsigned_zeros(reason)}" for reason in result.reasons]
    out += [f"  {sentence}" for sentence in (result.description.sentences if result.description else ())]
    gap = result.gap
    if gap.shrink is not None and gap.before is not None and gap.after is not None:
        after = f"{gap.after:.3g}" if gap.after > 0 else "at the floor"
        out.append(
            f"held-out gap (noise units): {gap.before:.3g} before, {after} after: shrinks by {gap.shrink:.1%}"
        )
    elif gap.before is not None:
        out.append("held-out gap: nothing to shrink beyond what recalibration closes")
    return "\n".join([*out, *(f"note: {w}" for w in result.warnings)])
