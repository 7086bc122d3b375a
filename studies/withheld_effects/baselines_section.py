"""The section that lays simpler methods and an oracle beside the diagnosis on the same bundles.

Takes judged cases, the choices of the baselines and shrinks, all plain. Does not compute choices.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from bayesid.report.writer import Section, Table, Text

METHODS = {
    "recalibrated": "coefficients only",
    "bic": "white noise, chi-square and BIC",
    "correlation": "correlation of what is left",
}

ABOUT = (
    "The baselines see the same readings, prior and catalogue. Coefficients only: never names an effect. "
    "White noise: one replay per run, least chi-square with the coefficients under their prior and each "
    "effect free, plus BIC. Correlation: after the refit, the effect whose signature is most like what is "
    "left, where chi-square says that something is (p < 0.001). Neither of these can answer outside, "
    "coefficients or cannot tell. The oracle is told the effects and refits."
)


def baselines_section(
    cases: Sequence[Any], chosen: Mapping[str, Mapping[str, Any]], oracle: Mapping[str, float],
    family_of: Callable[[str], str],
) -> Section:  # fmt: skip
    """Section of the comparison.

    Parameters
    ----------
    chosen : bundle -> method -> choice, `top` a name
    oracle : bundle -> shrink with the true effects
    """
    here = [c for c in cases if c.name in chosen]
    rows = [_row("diagnosis", here, lambda c: c.top, lambda c: bool(c.named), lambda c: c.word != "none")]
    for key, words in METHODS.items():

        def top(c: Any, key: str = key) -> str:
            return family_of(chosen[c.name][key]["top"])

        def named(c: Any, key: str = key) -> bool:
            return chosen[c.name][key]["top"] != "none"

        rows.append(_row(words, here, top, named, named))
    rows.append(["oracle", *["given"] * 6])
    return Section("Beside simpler methods on the same bundles", [
        Text(ABOUT),
        Table(["method", "first answer, D >= 25, margin >= 10", "first answer, D >= 25", "alarms on none",
               "in a rough sea", "wrong names of all named", "names on outside"], rows,
              "Right over cases; families as in the bars."),
        _gaps(here, oracle),
    ])  # fmt: skip


def _row(method: str, cases: Sequence[Any], top: Any, named: Any, alarm: Any) -> list[Any]:
    effect = [c for c in cases if c.kind == "effect" and c.noncentrality >= 25]
    clear = [c for c in effect if c.margin >= 10]
    none = [c for c in cases if c.kind == "none"]
    rough = [c for c in none if c.factors.get("sea") == "rough"]
    outside = [c for c in cases if c.kind == "outside"]
    names = [c for c in cases if named(c)]

    def wrong(c: Any) -> bool:
        return bool(c.named - c.right) if method == "diagnosis" else top(c) not in c.right

    def over(some: Sequence[Any], test: Any) -> str:
        k = sum(bool(test(c)) for c in some)
        return f"{k}/{len(some)}" + (f" = {k / len(some):.2f}" if some else "")

    return [
        method,
        over(clear, lambda c: top(c) in c.right),
        over(effect, lambda c: top(c) in c.right),
        over(none, alarm),
        over(rough, alarm),
        over(names, wrong),
        over(outside, named),
    ]


def _gaps(cases: Sequence[Any], oracle: Mapping[str, float]) -> Table:
    planted = [c for c in cases if c.kind in ("effect", "two", "variant") and c.noncentrality >= 25]
    gaps = [c for c in planted if c.before > 0.1 and math.isfinite(c.shrink) and c.name in oracle]
    rows = []
    values = {
        "recalibrated (by definition)": [0.0] * len(gaps),
        "diagnosis": [c.shrink for c in gaps],
        "oracle": [oracle[c.name] for c in gaps],
    }
    for name, x in values.items():
        rows.append([name, len(x), *(float(np.quantile(x, q)) if x else None for q in (0.1, 0.25, 0.5, 0.9))])
    return Table(["model", "bundles", "10th percentile", "25th", "median", "90th"], rows,
                 "Share of the held-out gap of the recalibrated model that closes, where there is one.",
                 digits=3)  # fmt: skip
