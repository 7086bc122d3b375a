"""An earlier fit as other commands read it: its values, the noise its readings carry, its model form.

Takes a folder of `bayesid.fit`. Gives its `Fit`, and a `FitProblem` at it. Does not fit.
"""

from __future__ import annotations

import os
from pathlib import Path

from bayesid.equations.model import Model
from bayesid.estimation.likelihood.model_form import with_form
from bayesid.estimation.likelihood.weighted_fit import weighed
from bayesid.estimation.output_error import Fit, FitProblem, coefficient_set, load_fit, trial_problem
from bayesid.trials import Trial


def fit_of(folder: str | os.PathLike[str]) -> Fit:
    """The fit that a folder, or its fit.json, holds.

    Raises
    ------
    FitError
        none there
    """
    file = Path(folder)
    return load_fit(file / "fit.json" if file.is_dir() else file)


def form_rows_of(earlier: Fit, model: Model) -> frozenset[str]:
    """Rows of the model form of a fit."""
    return frozenset(earlier.uncertainty.get("form", {}).get("rows", ())) - set(model.vehicle.coef)


def problem_at(
    model: Model, trial: Trial, names: tuple[str, ...], earlier: Fit
) -> tuple[FitProblem, list[str]]:
    """The runs of a trial at the values of a fit, weighed by what they carry there, and what to say of it.

    Parameters
    ----------
    names : free parameters, those of a model form left out: they come with the fit
    """
    params = coefficient_set(model, names)
    params = params.started_at([earlier.values.get(n, params[n].start) for n in params.names])
    problem = trial_problem(model, trial, params, sigma=dict(earlier.sigma))
    remarks = []
    if form_rows_of(earlier, model):  # with the prior and the values they had
        form = earlier.uncertainty["form"]
        params = with_form(problem, form["size"], form["rows"]).params
        problem = problem.with_params(
            params.started_at([earlier.values.get(n, params[n].start) for n in params.names])
        )
        remarks.append("the earlier fit has a model form; its rows are free here too, under its prior")
    return problem, remarks


def with_share(problem: FitProblem, earlier: Fit) -> tuple[FitProblem, list[str]]:
    """The problem with readings that carry the share of information they carry in a fit."""
    parts = earlier.uncertainty.get("parts", {})
    share = float(parts.get("share", parts.get("weight", 1.0)))
    if share >= 1.0:
        return problem, []
    said = (
        f"in the earlier fit readings carry {100 * share:.2g} % of the information of white noise ("
        f"{parts['words']}); so they do here"
    )
    return weighed(problem, share), [said]
