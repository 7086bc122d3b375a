"""The first screen of a posterior: what the runs fix and leave open, failed checks, the ridge, what next.

Takes a `TrialFit`, its `Posterior` and `PosteriorView`. Gives text and blocks for report and terminal. Does
not sample or simulate.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from bayesid.analysis.identifiability.posterior_ridges import FIXED, OPEN, Combination, Group
from bayesid.analysis.identifiability.posterior_view import PosteriorView
from bayesid.diagnosis.plain_words import number
from bayesid.diagnosis.run_errors import name_of_run
from bayesid.estimation.likelihood.posterior import CONFLICT
from bayesid.estimation.sampling import Posterior
from bayesid.estimation.trial_fit import TrialFit
from bayesid.model.vehicles import Vehicle
from bayesid.report import coefficient_cells, ridge_figures
from bayesid.report.writer import Block, Figure, Row, Section, Table, Text, literal
from bayesid.simulation import shaft_speed_note
from bayesid.trials.held_out_log import held_out_notes
from bayesid.trials.noise_stated import noise_warning
from bayesid.words import and_list

COEFFICIENTS = (
    "coefficient", "prior", "prior sd [%]", "fit", "posterior", "sd [%]", "SI", "SI unit", "left [%]",
    "conflict", "prior twice [sd]", "prior's share",
)  # fmt: skip
SHOWN = (0, 1, 2, 3, 4, 5, 8, 9, 11)  # columns that fit the width of a page
TOGETHER = ("coefficients", "what the runs know best", "left [%]", "and least", "left [%] ")
MOST_DRAWN, MOST_TOLD = 4, 2
TRIPLE = "vv/vr/rr"
UNIT = "each coefficient in units of its prior standard deviation"
# Laplace and draws are said to differ where one sd is this many times the other.
BENT = 1.5


def chains(posterior: Posterior) -> str:
    """How many chains of which sampler, in words."""
    count, _, walkers, _ = posterior.draws.shape
    if walkers == 1:
        return f"{count} chains along slopes (nutpie's No-U-Turn sampler)"
    return f"{count} ensembles of {walkers} walkers (emcee)"


def shown_group(view: PosteriorView) -> Group | None:
    """The group that is drawn: a triple of v v, v r and r r with an open end, else the strongest ridge."""
    groups = view.ridges.groups
    triples = [g for g in groups if g.family.startswith(TRIPLE) and g.worst.status != "fixed"]
    return next(iter([*triples, view.ridges.ridge, *groups]), None)


def told_groups(view: PosteriorView) -> list[Group]:
    """Groups of the first sentence: the strongest ridge, and the one drawn."""
    found = [g for g in (view.ridges.ridge, shown_group(view)) if g is not None]
    return list(dict.fromkeys(found))[:MOST_TOLD]


def headline(found: TrialFit, posterior: Posterior, view: PosteriorView) -> str:
    """What the runs tell of the vehicle, then which combinations they fix and leave open."""
    parts = []
    if view.runs:
        run = view.runs[0]
        before, after = (run.bands[n].end_spread for n in ("prior", "posterior"))
        who = next((r for r in found.runs if r.name == run.name), None)
        name = run.name if who is None else name_of_run(who.name, who.manoeuvre, who.role)
        parts.append(
            f"The coefficients the runs allow predict the {name} within {number(after)} m (90 % of draws), "
            "those "
            f"allowed before it within {number(before)} m."
        )
    single = dict(zip(view.ridges.names, map(float, view.ridges.left), strict=True))
    parts += [group_words(g, single) for g in told_groups(view)]
    if not told_groups(view):
        loose = [c.name for c in view.ridges.combinations if c.status == "open"]
        parts.append(
            f"The runs leave open {', '.join(loose)}." if loose else "The runs leave no combination open."
        )
        triples = [g for g in view.ridges.groups if g.family.startswith(TRIPLE)]
        parts += [_singly(g, single).strip() for g in triples[:MOST_TOLD]]
    return " ".join(parts)


def group_words(g: Group, single: Mapping[str, float] | None = None) -> str:
    """ "Of X_vv, X_vr and X_rr the runs fix 0.71 X_vr - 0.70 X_vv to 0.1 % of the prior; ...".

    Parameters
    ----------
    single : coefficient -> posterior over prior sd by itself; told too where given
    """
    best = g.best
    verb = {"fixed": "fix", "narrowed": "know", "open": "hardly know"}[best.status]
    others = [c for c in g.combinations[1:] if c.status == "open"] or [g.worst]
    rest = " and ".join(f"{_percent(c.left)} along {_plain(c)}" for c in others)
    return (
        f"Of {and_list(g.names)} the runs {verb} {_plain(best)} to {_percent(best.left)} of the prior; "
        "across it "
        f"{rest} is left.{_singly(g, single) if single else ''}"
    )


def _singly(g: Group, single: Mapping[str, float]) -> str:
    """ " Singly, X_vr is narrowed (12 % of its prior left), X_vv and X_rr are not known (97 %, 99 %)."."""
    kinds: dict[str, list[str]] = {"known": [], "narrowed": [], "not known": []}
    for name in g.names:
        left = single[name]
        kinds["known" if left <= FIXED else "not known" if left >= OPEN else "narrowed"].append(name)
    parts: list[str] = []
    for kind, names in kinds.items():
        if names:
            shares = ", ".join(_percent(single[n]) for n in names)
            unit = " of the prior left" if not parts else ""
            parts.append(f"{and_list(names)} {'is' if len(names) == 1 else 'are'} {kind} ({shares}{unit})")
    return f" Singly, {', '.join(parts)}."


def failures(
    found: TrialFit, posterior: Posterior, view: PosteriorView, verdict: str, noisy: str
) -> list[str]:
    """Checks that failed: chain, fit before it, conflicts with the prior, doubts of the fit, noise."""
    out = [] if posterior.converged else [verdict]
    if not found.fit.converged:
        out.append(f"The fit it starts from had not converged ({found.fit.message}).")
    far = [
        f"{n} ({z:.1f})" for n, z in zip(posterior.names, np.abs(view.conflict), strict=False) if z > CONFLICT
    ]
    doubts = [] if found.posterior is None else found.posterior.doubts()
    if far and not any("prior and data disagree" in d for d in doubts):
        out.append(
            f"Prior and runs disagree on {', '.join(far)} (distance in sd): the prior is too narrow, or a "
            "force "
            "is missing in the equations."
        )
    out += doubts
    bent = [
        c.name for c in view.ridges.combinations
        if math.isfinite(c.laplace) and not 1 / BENT < c.left / max(c.laplace, 1e-300) < BENT
    ]  # fmt: skip
    if bent and posterior.converged:
        out.append(
            "The posterior is not Gaussian: draws and the Laplace approximation differ by more than "
            f"{BENT:g} "
            f"times along {literal('; '.join(bent[:3]))}. The draws are to be used, not the sd of the fit."
        )
    out += held_out_notes(found.trial.warnings)
    for wrong in filter(None, (shaft_speed_note(found.trial), noise_warning(found.trial))):
        out.append(f"{wrong[0].upper()}{wrong[1:]}.")
    return [*out, noisy] if noisy else out


def steps(posterior: Posterior, view: PosteriorView) -> list[str]:
    """What to do next."""
    out = []
    if not posterior.converged:
        out.append("Go on with `--resume` and a larger `--max-steps`, or free fewer coefficients (`--free`).")
    loose = [n for n, left in zip(view.ridges.names, view.ridges.left, strict=True) if left > 0.5]
    if loose:
        out.append(
            f"{', '.join(loose)} still lean on the prior. `bayesid design` proposes a manoeuvre that tells "
            "them "
            "apart; until then state where their prior comes from."
        )
    out.append("`bayesid predict` says what the open combinations do to manoeuvres not yet run.")
    return out


def first_blocks(found: TrialFit, posterior: Posterior, view: PosteriorView) -> list[Block]:
    """The ridge, the groups, the coefficients, what next."""
    blocks: list[Block] = []
    group = shown_group(view)
    if group is not None:
        blocks.append(_corners(posterior, group))
    if view.ridges.groups:
        rows = [
            [", ".join(g.names), g.best.name, 100 * g.best.left, g.worst.name, 100 * g.worst.left]
            for g in view.ridges.groups
        ]
        caption = f"Coefficients that stand in for each other; {UNIT}. Left: posterior sd over prior sd."
        blocks.append(Table(TOGETHER, rows, caption, digits=2))
    words = (
        "Prime values (SI below, under Unknowns). Left: posterior sd over prior sd. Conflict: distance from "
        "the prior, without a sign, in the sd chance gives it; beyond 3 they disagree. Prior's share of the "
        "variance: 0 the runs decide, 1 the prior."
    )
    rows = [[row[i] for i in SHOWN] for row in coefficient_rows(posterior, view, found.vehicle)]
    blocks.append(Table([COEFFICIENTS[i] for i in SHOWN], rows, words, digits=3))
    blocks.append(Section("What to do next", [Text("\n".join(f"- {s}" for s in steps(posterior, view)))]))
    return blocks


def coefficient_rows(posterior: Posterior, view: PosteriorView, vehicle: Vehicle) -> list[list[Any]]:
    """Rows of `COEFFICIENTS`: prior, fit, posterior, distance from the prior, and the change of the mean
    where the prior counts twice, + away from zero."""
    rows: list[list[Any]] = []
    for i in range(posterior.n_params):
        name, mean, sd = posterior.names[i], float(posterior.mean[i]), float(posterior.sd[i])
        centre, width = float(posterior.prior_mean[i]), float(posterior.prior_sd[i])
        prime, value, unit = coefficient_cells.cells(vehicle, name, mean)

        def shown(x: float, name: str = name, known: bool = prime is not None) -> float | None:
            return coefficient_cells.prime(vehicle, name, x) if known else x

        finite = math.isfinite(width)
        rows.append(
            [
                name, shown(centre), 100 * width / abs(centre) if finite and centre else None,
                shown(float(view.estimate[i])), shown(mean), 100 * sd / abs(mean) if mean else None, value,
                unit, 100 * sd / width if finite else None, _known(abs(view.conflict[i])),
                _known(math.copysign(1.0, mean) * view.shift[i]), _known(view.share[i]),
            ]
        )  # fmt: skip
    return rows


def _corners(posterior: Posterior, group: Group) -> Row:
    where = [posterior.names.index(n) for n in group.names]
    unit = posterior.prior_sd[where]
    draws = (posterior.flat[:, where] - posterior.prior_mean[where]) / unit
    ends = (group.best, group.worst)
    kept = sorted(
        np.argsort([-max(abs(c.vector[i]) for c in ends) for i in range(len(where))])[:MOST_DRAWN].tolist()
    )
    names = [group.names[i] for i in kept]
    chosen = group.combinations
    if len(chosen) > MOST_DRAWN:
        chosen = (*chosen[: MOST_DRAWN // 2], *chosen[-(MOST_DRAWN // 2) :])
    turned = np.column_stack([draws @ c.vector for c in chosen])
    turned -= turned.mean(axis=0)
    loose = [c.vector[kept] for c in group.combinations if c.status == "open"] or [group.worst.vector[kept]]
    plain = ridge_figures.plain_corner(names, draws[:, kept], np.array(loose), group.best.vector[kept])
    rotated = ridge_figures.rotated_corner(
        [c.name for c in chosen], [c.left for c in chosen], turned, [c.laplace for c in chosen]
    )
    caption = (
        f"Left: {and_list(names)}, in prior sd from the prior mean; dots are draws, grey dashes 90 % of the "
        "prior, the orange line the ridge (90 % along what is known least), the short black dashes what is "
        "known "
        "best. Right: the same draws along the combinations themselves, every axis at its own scale (prior "
        "sd), "
        "so that the sliver opens: an ellipse that stands straight is fully described by the two numbers "
        "above "
        "it. Black: 90 % of the Laplace approximation; where the dots leave it, the posterior is not "
        "Gaussian."
    )
    return Row(
        (
            Figure("ridge_plain", plain, alt=f"Corner plot of {', '.join(names)}"),
            Figure("ridge_rotated", rotated, alt="The same draws along fixed and open combinations"),
        ),
        caption,
    )


def _plain(c: Combination) -> str:
    return c.names[int(np.argmax(np.abs(c.vector)))] if not c.shared else c.name


def _percent(share: float) -> str:
    return f"{number(100 * share)} %"


def _known(x: float) -> float | None:
    return float(x) if math.isfinite(x) else None
