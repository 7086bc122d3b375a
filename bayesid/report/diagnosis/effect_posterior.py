"""How well the named effects' parameters are known: draws beside Laplace, and the corner of what hides what.

Takes a `Diagnosis`. Gives report sections, none where nothing was drawn. Does not compute.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from bayesid.diagnosis.run import Diagnosis
from bayesid.diagnosis.summary import unsigned_zeros
from bayesid.errors import SampleError
from bayesid.report import posterior_figures as figures
from bayesid.report.diagnosis.effect_interval import SECTION, why
from bayesid.report.writer import Block, Figure, Section, Table, Text, literal

MOST = 7  # panels a reader can still make out


def sections(found: Diagnosis, record: Mapping[str, Any]) -> list[Section]:
    """One section, or none."""
    if found.posterior is None:
        return []
    return [Section(SECTION, _blocks(found, record))]


def _blocks(found: Diagnosis, record: Mapping[str, Any]) -> list[Block]:
    p = found.posterior
    assert p is not None
    names, mean = p.posterior.names, p.posterior.mean
    interval = p.posterior.interval(0.95)
    rows: list[list[Any]] = [
        [
            literal(n),
            f"{mean[i]:.4g}",
            f"{interval[i, 0]:.4g} to {interval[i, 1]:.4g}",
            f"{p.sd_ratio[i]:.2f}",
            unsigned_zeros(f"{p.shift[i]:+.2f}"),
        ]
        for i, n in enumerate(names)
    ]
    blocks: list[Block] = [
        Text(
            "The verdict rests on a Gaussian about each optimum (Laplace). emcee draws the effect's "
            "parameters jointly with the coefficients that could hide them and the noise scale of the "
            "environment, from a density that "
            f"is linearised anew at {p.density.surface.nodes.shape[0]} points. Log "
            f"evidence by bridge sampling {p.log_evidence:.2f} ± {p.error:.2f}."
        ),
        Text(why(record["posterior"], found.problem.environment.source)),
        Table(
            ["unknown (SI)", "mean", "95 % interval", "sd over Laplace's", "shift [Laplace sd]"],
            rows,
            "Posterior draws beside the Laplace approximation. `log force` and `log drift` are the logarithm "
            "of the environment's noise scale over the level assumed.",
        ),
    ]
    try:
        blocks.append(_corner(found))
    except SampleError as exc:
        blocks.append(Text(literal(str(exc))))
    return blocks


def _corner(found: Diagnosis) -> Figure:
    p = found.posterior
    assert p is not None
    d = p.density
    k = min(d.count, MOST)
    draws = p.posterior.flat[:, :k]
    rng = np.random.default_rng(found.seed)
    gauss = d.natural(p.laplace.draw(4000, 1.0, np.random.RandomState(rng.integers(2**31))))[:, :k]
    scale, names = np.ones(k), []
    for i, n in enumerate(p.posterior.names[:k]):
        nominal = found.model.nominal[found.model.index[n]]
        if "." not in n and nominal:
            scale[i] = nominal
            names.append(f"{n} / nominal")
        else:
            unit = _unit(found, n)
            scale[i] = math.pi / 180 if unit == "deg" else 1.0
            names.append(n.split(".")[-1].replace("_", " ") + (f" [{unit}]" if unit else ""))
    drawn = figures.corner(names, {"emcee": draws / scale, "Laplace": gauss / scale})
    return Figure(
        "effect_corner",
        drawn,
        "Effect parameters against the coefficients nearest to them in the posterior; a slanted ellipse is "
        "what these runs cannot separate. Lines hold 50 % and 90 %.",
    )


def _unit(found: Diagnosis, name: str) -> str:
    """Unit an effect's parameter is shown in; empty for a plain number."""
    effect, _, parameter = name.partition(".")
    declared = found.model.effects.get(effect)
    units = {q.name: q.unit for q in declared.parameters} if declared is not None else {}
    unit = units.get(parameter, "")
    return {"rad": "deg", "-": ""}.get(unit, unit)
