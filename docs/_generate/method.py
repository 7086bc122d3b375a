"""Tables of the method: force terms, references, rules, thresholds, priors. Computes nothing."""

from __future__ import annotations

from _generate.markdown import code, plain, table
from bayesid.diagnosis import threshold_table
from bayesid.diagnosis.hypotheses.rules import LEFT_OUT_WORSE, MOTION_EVENT, RULES
from bayesid.diagnosis.hypotheses.verdict import REFUTED
from bayesid.model.terms import TERMS
from bayesid.model.terms.references import REFERENCES

AXES = {
    "X": "X, force ahead", "Y": "Y, force to starboard", "Z": "Z, force down",
    "K": "K, rolling moment", "M": "M, pitching moment", "N": "N, yawing moment",
}  # fmt: skip


def _source(key: str) -> str:
    return f"[{key}](#ref-{key})" if key in REFERENCES else plain(key)


def terms() -> str:
    """One table of rows per axis."""
    out = []
    for axis, title in AXES.items():
        rows = [
            [
                code(t.name), code(t.regressor), plain(t.unit),
                f"$L^{{{t.length_power}}}$"
                + ("" if t.velocity_power == 2 else f", $U^{{{t.velocity_power}}}$"),
                _source(t.source) + ("" if t.group == "base" else f" ({t.group})"),
            ]
            for t in TERMS
            if t.axis == axis and not t.is_number
        ]  # fmt: skip
        if rows:
            out += [f"### {title}", table(("coefficient", "multiplies", "SI unit", "prime", "source"), rows)]
    numbers = [
        [code(t.name), plain(t.about), code(t.regressor), _source(t.source)] for t in TERMS if t.is_number
    ]
    out += ["### Numbers of a ship (MMG)", table(("number", "what it is", "acts in", "source"), numbers)]
    return "\n\n".join(out)


def references() -> str:
    """Sources of the force rows, with anchors."""
    return "\n\n".join(f"(ref-{key})=\n{code(key)}: {plain(text)}" for key, text in REFERENCES.items())


def rules() -> str:
    """The rules in the order in which they are asked; the first that holds decides."""
    rows = [[str(k), plain(r.name), code(r.word), plain(r.sentence)] for k, r in enumerate(RULES, 1)]
    rows.append([
        "after", plain(MOTION_EVENT), code("outside"),
        "for a short time, left out of the rest, the vehicle moves as no effect explains; that is worth more "
        "than what effects explain of the rest",
    ])  # fmt: skip
    rows.append([
        "after", plain(LEFT_OUT_WORSE), code("outside"),
        "an effect is named, the runs disagree about it, and runs left out are replayed worse with it than "
        "by the simulator as given",
    ])  # fmt: skip
    rows.append([
        "after", plain(REFUTED), code("ambiguous"),
        "an effect is named, and the held-out runs are predicted worse with it than by re-tuned coefficients",
    ])  # fmt: skip
    return table(("order", "rule", "verdict", "holds when"), rows)


def thresholds() -> str:
    """Every number a verdict compares with."""
    rows = [
        [
            code(x.symbol),
            f"{float(x):g}" + ("" if x.unit == "1" else f" {x.unit}"),
            plain(x.meaning),
            plain(x.evidence),
        ]
        for x in threshold_table.TABLE
    ]
    return table(("symbol", "value", "meaning", "what fixed it"), rows)


def priors() -> str:
    """What is assumed of causes before any data."""
    found = (
        ("no effect", threshold_table.PRIOR_NONE),
        ("the catalogue, shared by its effects", threshold_table.PRIOR_CATALOGUE),
        ("a cause that is not listed", threshold_table.PRIOR_OUTSIDE),
    )
    return table(("hypothesis", "prior probability"), [[what, f"{float(p):g}"] for what, p in found])
