"""The report of the ridges: what every set of runs knows, the picture, whether all ways of asking agree.

Takes the cases. Does not fit or sample.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from bayesid.report.writer import Figure, Report, Section, Table, Text
from studies.excited_terms.counting import share
from studies.ridges import figures
from studies.ridges.case import OTHERS_SD, TRIPLE

Case = Mapping[str, Any]
SHOWN_PRIOR = 0.5
NORMAL_90 = 1.6449
AGREE = 1.15  # ratio of two statements of what is left within which they agree
FIXED = 0.1  # of the prior sd: what `bayesid sample` calls fixed
SAMPLERS = ("emcee", "NUTS")


def counted(cases: Sequence[Case]) -> dict[str, Any]:
    """Agreement of the ways of asking, and how often the truth lies where they say."""
    ratios: dict[str, list[float]] = {}
    for case in cases:
        said = case["said"]
        if "emcee" not in said:
            continue
        first = said["emcee"]
        for who, what in said.items():
            if what is not first:
                pairs = list(zip(what["left"], first["left"], strict=True))
                pairs += zip(what.get("along", []), first["along"] if "along" in what else [], strict=True)
                ratios.setdefault(who, []).extend(float(a / b) for a, b in pairs)
    agreement = {
        who: {
            "least": min(r),
            "largest": max(r),
            "within": sum(1 / AGREE < x < AGREE for x in r),
            "of": len(r),
        }
        for who, r in ratios.items()
    }
    dealt = []  # every posterior beside the truth of another case of the same set and prior
    for case in cases:
        others = [
            c for c in cases if (c["set"], c["prior"]) == (case["set"], case["prior"]) and c is not case
        ]
        if others:
            other = min(others, key=lambda c: (c["seed"] <= case["seed"], c["seed"]))
            move = np.array(other["truth"]) - np.array(case["truth"])
            along = case["said"].get("emcee", case["said"]["Laplace"])["along"]
            way = np.array([c["vector"] for c in case["combinations"]]) @ move
            dealt.append({**case, "z": (np.array(case["z"]) + way / np.array(along)).tolist()})
    return {
        "cases": len(cases),
        "sampled": sum("emcee" in c["said"] for c in cases),
        "converged": {s: sum(c["said"][s]["converged"] for c in cases if s in c["said"]) for s in SAMPLERS},
        "agreement": agreement,
        "held": _held(cases),
        "control": _held(dealt),
    }


def _held(cases: Sequence[Case]) -> dict[str, Any]:
    """Share of 90 % intervals that hold the truth, along combinations fixed and others."""
    terms = [
        {"terms": [{"fixed": c["left"] <= FIXED, "in": abs(z) <= NORMAL_90}
                   for c, z in zip(case["combinations"], case["z"], strict=True)]}
        for case in cases
    ]  # fmt: skip
    return {
        "fixed": share(terms, lambda r: r["fixed"], lambda r: r["in"]),
        "not fixed": share(terms, lambda r: not r["fixed"], lambda r: r["in"]),
    }


def told(s: Mapping[str, float]) -> str:
    if not s["of"]:
        return "none"
    low, high = (f"{100 * s[k]:.0f}" for k in ("low", "high"))
    return f"{s['hits']} of {s['of']} ({100 * s['hits'] / s['of']:.0f} %; {low} to {high})"


def ridges_report(cases: Sequence[Case], numbers: Mapping[str, Any], quick: bool = False) -> Report:
    """The report as plain data."""
    sampled = [c for c in cases if "emcee" in c["said"]]
    chosen = [c for c in sampled if c["prior"] == SHOWN_PRIOR] or sampled[:1]
    lines = [f"- **{c['set']}**: {c['said']['emcee']['sentence']}" for c in chosen]
    held = numbers["held"]
    lead = (
        f"Which of {', '.join(TRIPLE)} do runs know, with a prior of {100 * SHOWN_PRIOR:g} % that is not "
        "centred on the truth?\n\n" + "\n".join(lines) + f"\n\n{agreed(numbers)} Of the 90 % intervals along "
        f"fixed combinations {told(held['fixed'])} hold the truth, of the others {told(held['not fixed'])}."
    )
    if quick:
        lead += " A quick run: it decides nothing."
    first = []
    if chosen:
        panels = {}
        for c in chosen:
            loose = max(c["combinations"], key=lambda d: d["left"])
            reach = NORMAL_90 * loose["left"] * np.array(loose["vector"])
            panels[c["set"]] = (np.array(c["draws"]), np.array(c["truth"]), reach)
        first.append(
            Figure(
                "ridges",
                figures.ridge_panels(panels, TRIPLE),
                "The three coefficients in prior sd from the prior's centre. Where the dots fill the dashed "
                "circle the runs say nothing; where they lie on a line they fix one combination and leave "
                "the "
                "other, along orange, to the prior. The cross is the truth, which nobody centred the prior "
                "on.",
            )
        )
    return Report(
        "Which of vv, vr and rr do runs know?", lead,
        [_agreement_section(sampled, numbers), _priors_section(cases), _truths_section(numbers, cases)],
        failures=failures(cases, numbers), first=first,
    )  # fmt: skip


def agreed(numbers: Mapping[str, Any]) -> str:
    parts = [
        f"{who} {a['within']} of {a['of']} ({a['least']:.2f} to {a['largest']:.2f} times)"
        for who, a in numbers["agreement"].items()
    ]
    return (
        f"Beside emcee what is left agrees within {100 * (AGREE - 1):.0f} %: {', '.join(parts)}."
        if parts
        else ""
    )


def failures(cases: Sequence[Case], numbers: Mapping[str, Any]) -> list[str]:
    """Chains that did not converge, ways that disagree, a control that holds."""
    out = []
    for sampler, good in numbers["converged"].items():
        asked = sum(sampler in c["said"] for c in cases)
        if good < asked:
            out.append(
                f"{sampler}: {asked - good} of {asked} chains did not converge; their draws count all the "
                "same."
            )
    for who, a in numbers["agreement"].items():
        if a["within"] < a["of"]:
            out.append(
                f"{who} says more than {100 * (AGREE - 1):.0f} % more or less than emcee in "
                f"{a['of'] - a['within']} of {a['of']} numbers ({a['least']:.2f} to {a['largest']:.2f} "
                "times)."
            )
    for kind, s in numbers["held"].items():
        if s["of"] and s["high"] < 0.9:
            out.append(f"90 % intervals along combinations {kind} hold the truth in {told(s)}: too narrow.")
    control = numbers["control"]["fixed"]
    if control["of"] and control["high"] > 0.5:
        out.append(f"The control did not fail: beside the truth of another vehicle {told(control)} hold it.")
    anew = sum(c["vehicles_drawn"] - 1 for c in cases)
    if anew:
        out.append(f"{anew} truths were drawn anew because the vehicle diverged: the prior is cut there.")
    return out


def _agreement_section(sampled: Sequence[Case], numbers: Mapping[str, Any]) -> Section:
    rows = []
    for c in sampled:
        for who, what in c["said"].items():
            rows.append(
                [
                    c["set"], f"{100 * c['prior']:g}", who, *(100 * x for x in what["left"]),
                    *(100 * x for x in what.get("along", [])), *[None] * (3 - len(what.get("along", []))),
                    what.get("ess"), what.get("ess_per_second"),
                ]
            )  # fmt: skip
    head = [
        "runs", "prior [%]", "asked", *(f"{n} [%]" for n in TRIPLE), "best [%]", "middle [%]", "worst [%]",
        "ESS", "ESS / s",
    ]  # fmt: skip
    text = (
        "What is left of the prior sd, of each coefficient and along the three combinations that emcee's "
        "draws give, "
        "best known first. Laplace is the Gaussian about the fit; the profile holds one coefficient and fits "
        "all others anew, prior included, so it speaks of single coefficients only."
    )
    lines = [f"- {c['set']}, {who}: {what['sentence']}" for c in sampled if c["prior"] == SHOWN_PRIOR
             for who, what in c["said"].items() if "sentence" in what]  # fmt: skip
    return Section(
        "Four ways of asking", [Text(text), Table(head, rows, digits=3), Text("\n".join(lines) or "None.")]
    )


def _priors_section(cases: Sequence[Case]) -> Section:
    rows = []
    for key in dict.fromkeys((c["set"], c["prior"]) for c in cases):
        some = [c for c in cases if (c["set"], c["prior"]) == key]
        left = np.median([c["said"]["Laplace"]["left"] for c in some], axis=0)
        along = np.median([[d["left"] for d in c["said"]["Laplace"]["combinations"]] for c in some], axis=0)
        share_of_data = np.median([c["said"]["profile"]["data_share"] for c in some], axis=0)
        rows.append(
            [key[0], f"{100 * key[1]:g}", len(some), *(100 * left), *(100 * along),
             ", ".join(f"{100 * x:.0f}" for x in share_of_data)]
        )  # fmt: skip
    head = [
        "runs", "prior [%]", "truths", *(f"{n} [%]" for n in TRIPLE), "best [%]", "middle [%]", "worst [%]",
        "data in the profile [%]",
    ]  # fmt: skip
    text = (
        "Medians over truths, by the Laplace approximation: what is left of the prior sd. A ridge is a "
        "combination "
        "that is left whatever the prior is: the wider the prior, the less a narrow one hides it. Last "
        "column: how much "
        "of what resists when a coefficient is held off is misfit of the data; the rest is the prior."
    )
    return Section("Priors of 10, 50 and 100 %", [Text(text), Table(head, rows, digits=3)])


def _truths_section(numbers: Mapping[str, Any], cases: Sequence[Case]) -> Section:
    rows = [
        [kind, told(numbers["held"][kind]), told(numbers["control"][kind])] for kind in ("fixed", "not fixed")
    ]
    seconds = sum(c["cpu_seconds"] for c in cases)
    text = (
        f"{numbers['cases']} truths drawn from the priors, {numbers['sampled']} of them sampled by emcee "
        "and NUTS, the others "
        "by Laplace and profile. The control reads every posterior beside the truth of another vehicle: "
        "along a "
        "combination the runs fix, hardly any interval may hold it; along one they leave open, the prior "
        "does. "
        "generic_sub, noise of 1 m, 0.5 degrees and 0.02 m/s in u; six coefficients of sway and yaw are "
        "unknown to "
        f"{100 * OTHERS_SD:g} % beside the three. Processor time: {seconds:.0f} s."
    )
    head = ["combinations", "90 % intervals that hold the truth", "control: another truth"]
    return Section("Truths drawn from the prior", [Text(text), Table(head, rows)])
