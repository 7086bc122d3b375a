"""`bayesid.sample`: the posterior of a trial's coefficients, with a verdict on the chain."""

from __future__ import annotations

import os
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from bayesid.analysis.identifiability.posterior_view import PosteriorView, view_posterior
from bayesid.api.inputs import (
    Names,
    TrialLike,
    VehicleLike,
    declared_effects,
    names_of,
    prepared,
    trial_of,
    vehicle_of,
    with_believed_noise,
)
from bayesid.api.mistaken_log import with_log_checked
from bayesid.api.result import Result, table
from bayesid.diagnosis.input import missing_orders
from bayesid.equations.model import build_model
from bayesid.errors import SampleError, TrialError
from bayesid.estimation.likelihood import NoiseParts
from bayesid.estimation.likelihood.weighted_fit import weighed
from bayesid.estimation.output_error import coefficient_set
from bayesid.estimation.sampling import Posterior, SamplerOptions, SamplingSettings, trial_density
from bayesid.estimation.sampling import sample as draw
from bayesid.estimation.sampling.arviz_groups import arviz_groups, variable_units
from bayesid.estimation.sampling.arviz_import import arviz
from bayesid.estimation.sampling.nuts import NutsOptions, sample_nuts_until
from bayesid.estimation.sampling.priors import with_prior
from bayesid.estimation.sampling.trial_gradient import GradientTrialDensity
from bayesid.estimation.segments import fit_in_pieces
from bayesid.estimation.trial_fit import TrialFit
from bayesid.model.vehicles import ASSUMED_RELATIVE_SD
from bayesid.progress import Progress
from bayesid.report import sample_first_screen as screen
from bayesid.report.sample import (
    COLUMNS,
    PRIORS,
    noise_words,
    prior_rows,
    rows,
    sample_report,
    verdict,
    write_sample_report,
)
from bayesid.report.writer import Report
from bayesid.report.writer.text import table_text
from bayesid.simulation import with_shaft_speed
from bayesid.threads import one_blas_thread
from bayesid.trials.measured_wind import wind_words
from bayesid.trials.noise import raised, raised_words

if TYPE_CHECKING:
    import pandas

QUICK_SAMPLES, QUICK_STEPS, QUICK_DRAWS = 200, 600, 300
# Share of the readings' information above which residuals count as white.
FULL_WEIGHT = 0.9


@one_blas_thread
def sample(
    trial: TrialLike,
    out: str | os.PathLike[str],
    vehicle: VehicleLike | None = None,
    *,
    data: str | os.PathLike[str] | None = None,
    free: Names = None,
    fix: Names = None,
    with_effects: Names = None,
    effects: str | os.PathLike[str] | None = None,
    runs: Names = None,
    resample: float | None = None,
    pieces: float | None = None,
    prior: float | None = None,
    noise: Literal["sampled", "marginal", "fixed"] = "sampled",
    initial: Literal["marginal", "sampled", "fixed"] = "marginal",
    memory: Literal["composite", "inflate", "ar1", "ignore"] = "composite",
    student: float | None = None,
    sampler: Literal["emcee", "nuts"] = "emcee",
    ensembles: int = 4,
    walkers: int | None = None,
    max_steps: int = 20_000,
    resume: bool = False,
    seed: int = 0,
    quick: bool = False,
    trust_input: bool = False,
    progress: Progress | None = None,
) -> SampleResult:
    """Fit, then sample the posterior until R-hat, length and effective size pass, or `max_steps` are done.

    Parameters
    ----------
    trial, vehicle, data, free, fix, with_effects, effects, runs, resample, pieces : as in `bayesid.fit`
    out : folder of the fit and of the chain, which is kept as it grows
    prior : relative prior sd of every coefficient; by default the vehicle file's, and 0.1 where it states
        none
    noise, initial : how noise of channels and initial states of runs are treated
    memory : residuals that persist, and runs that differ: the likelihood is adjusted to the covariance that
        `bayesid.fit` finds, with noise fixed ("composite"; "inflate" where readings know 90 % and more); or
        they count for fewer readings, are an autoregression, or are taken as white
    student : degrees of freedom of Student-t noise, for outliers; not with marginal states
    sampler : emcee's ensembles, or nutpie's No-U-Turn sampler along slopes (extra `nuts`), whose chain is
        kept in memory until it is done
    ensembles, walkers : independent ensembles, and walkers of each (default from the unknowns)
    resume : go on with the chain in `out`; it then is the very chain an unbroken run would have given
    trust_input : take the log as it is, whatever its channels say of one another

    Returns
    -------
    SampleResult               also where the chain is not converged

    Raises
    ------
    TrialError, VehicleError, FitError, SampleError
        what cannot be read or set up; a log that does not say what its header says (`MistakenLogError`)
    """
    composite = memory == "composite" and noise == "sampled" and student is None
    if sampler == "nuts" and (resume or walkers is not None):
        raise SampleError("the gradient sampler has no walkers and nothing to resume; leave both out")
    choice = SamplingSettings(
        noise=noise, initial=initial, memory="inflate" if memory == "composite" else memory, student=student
    )
    logged = trial_of(trial, data)
    ship = vehicle_of(vehicle, logged, prior)
    chosen = with_shaft_speed(prepared(logged, runs, resample, QUICK_SAMPLES if quick else None), ship)
    if lacking := missing_orders(chosen, ship):
        raise TrialError(f"{logged.name}: {'; '.join(lacking.values())}")
    if not trust_input:
        chosen = with_log_checked(chosen, prepared(logged, runs), ship)
    chosen = with_believed_noise(chosen, ship)
    declared = declared_effects(effects)
    model = build_model(ship, 3 if ship.planar_only else chosen.dof, declared)
    kept = set(names_of(fix) or ())
    params = coefficient_set(model, tuple(n for n in names_of(free) or model.coefficients if n not in kept))
    stated = {p.name for p in params.free if p.prior is not None}
    assumed = {p.name for p in params.free} - stated - set(params.joint.names if params.joint else ())
    params = with_prior(params, ASSUMED_RELATIVE_SD)
    options = SamplerOptions(
        ensembles=ensembles, walkers=walkers, max_steps=min(max_steps, QUICK_STEPS) if quick else max_steps,
        seed=seed, first=100 if quick else 200,
    )  # fmt: skip
    shown = progress or Progress(quiet=True)
    if blown := wind_words(ship, chosen):
        shown.note(blown)
    shown.expect(3)
    with shown.stage("fit") as stage:
        found = fit_in_pieces(
            chosen, pieces, ship, out, params=params, parts=None if composite else NoiseParts(),
            effects=names_of(with_effects) or [], declared=declared,
            watch=lambda n, cost, step: stage.step(info=f"cost {cost:.6g}"),
        )  # fmt: skip
    if not found.fit.converged:
        shown.note(f"the fit had not converged ({found.fit.message}); sampling starts off the mode")
    problem, told = found.problem, chosen.noise
    honest = None
    if composite and found.posterior is not None and found.posterior.parts.share < FULL_WEIGHT:
        # the power of the likelihood as noise so much larger, which the residuals must not undo
        problem = weighed(problem, found.posterior.parts.weight)
        choice, told = replace(choice, noise="fixed", memory="ignore"), {}
        honest = found.posterior.mean, found.posterior.covariance
    density = trial_density(problem, found.fit.z, choice, told, honest)
    levels = dict(zip(density.channels, map(float, density.noise_prior.scale), strict=True))
    if least := raised(levels, model.scales["L"], model.scales["U"]):
        shown.note(f"{raised_words(least)}; chains are slow where a channel has none")
        density = trial_density(problem, found.fit.z, choice, {**told, **least}, honest)
    with shown.stage("sample") as stage:
        if sampler == "nuts":
            posterior = sample_nuts_until(
                GradientTrialDensity(density), density.laplace, options.max_steps,
                NutsOptions(chains=ensembles, seed=seed, draws=QUICK_DRAWS if quick else 1000),
                watch=lambda draws, note: stage.step(draws, info=note or None),
            )  # fmt: skip
        else:
            posterior = draw(
                density, density.laplace, options, Path(out), resume=resume,
                watch=lambda steps, note: stage.step(steps, info=note or None),
            )  # fmt: skip
    likelihood = "white noise" if found.posterior is None else found.posterior.parts.describe()
    facts = {"fit": found.fit.message, "likelihood": likelihood if composite else memory}
    posterior = replace(posterior, settings={**posterior.settings, **facts})
    with shown.stage("look"):
        view = view_posterior(
            posterior, density, assumed, seed, "--prior" if prior is not None else "vehicle file"
        )
        posterior.to_netcdf(
            Path(out) / "posterior.nc", arviz_groups(density, posterior, seed), variable_units(density)
        )
    return SampleResult(found, posterior, view, Path(out))


@dataclass(frozen=True, eq=False, repr=False)
class SampleResult(Result):
    """A posterior.

    Attributes
    ----------
    found : the fit it starts from
    posterior : draws and what there is to trust or distrust them
    view : priors, combinations fixed and open, influence of the prior, runs predicted before and after
    out : folder of the chain and of posterior.nc
    """

    found: TrialFit
    posterior: Posterior
    view: PosteriorView
    out: Path

    def to_dataframe(self) -> pandas.DataFrame:
        return table(COLUMNS, rows(self.posterior, self.found.vehicle)).set_index(COLUMNS[0])

    def to_xarray(self) -> Any:
        """The draws for ArviZ, read from posterior.nc: InferenceData (ArviZ 0.x) or DataTree (1.x)."""
        return arviz().from_netcdf(str(self.out / "posterior.nc"))

    def leave_one_run_out(self) -> Any:
        """ArviZ's PSIS leave-one-run-out: elpd, its error, and Pareto k per run (above .7: not valid there).

        Raises
        ------
        SampleError
            the likelihood is no sum over runs: noise integrated out, or adjusted to what `fit` finds
        """
        data = self.to_xarray()
        if "log_likelihood" not in getattr(data, "children", ()) and not hasattr(data, "log_likelihood"):
            raise SampleError(
                "no leave-one-run-out here: the likelihood is no sum over runs (noise integrated out, or "
                'adjusted for residuals with memory); sample with memory="ignore" or "inflate"'
            )
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of a large k, which the result carries
            return arviz().loo(data, var_name="runs", pointwise=True, reff=1.0)

    def report(self) -> Report:
        return sample_report(self.found, self.posterior, self.view)

    def save(self, folder: str | os.PathLike[str]) -> Path:
        return write_sample_report(self.found, self.posterior, self.view, Path(folder))

    def record(self) -> Mapping[str, Any]:
        return {
            "trial": self.found.trial.name,
            "vehicle": self.found.vehicle.name,
            **self.posterior.summary(),
            **self.view.record(),
        }

    def summary(self, verbose: bool = False) -> str:
        p, g, view, vehicle = self.posterior, self.posterior.convergence, self.view, self.found.vehicle
        failed = screen.failures(self.found, p, view, verdict(p), noise_words(self.found, p))
        lines = [f"Check failed: {text.replace('`', '')}" for text in failed]
        lines += [screen.headline(self.found, p, view), ""]
        if view.ridges.groups:
            rows_of = [
                [", ".join(g.names), g.best.name, 100 * g.best.left, g.worst.name, 100 * g.worst.left]
                for g in view.ridges.groups
            ]
            lines += [f"Combinations, {screen.UNIT}; left: sd over prior sd.", ""]
            lines += [table_text(screen.TOGETHER, rows_of, 2), ""]
        lines += [table_text(screen.COEFFICIENTS, screen.coefficient_rows(p, view, vehicle), 3), ""]
        lines += ["Conflict: distance from the prior, without a sign. Prior twice: + is away from zero.", ""]
        if verbose:
            lines += [
                table_text(COLUMNS, rows(p, vehicle)),
                "",
                table_text(PRIORS, prior_rows(view, vehicle)),
                "",
            ]
        lines += [
            f"{self.found.trial.name}: {len(p.names)} unknowns, {screen.chains(p)}, {p.steps} steps after "
            f"{p.discarded}, {p.seconds:.1f} s of CPU",
            f"R-hat {g.rhat.max():.4f}, {g.n_tau:.0f} autocorrelation times of {g.tau.max():.0f} steps, "
            f"effective size {g.ess_bulk.min():.0f} (bulk) and {g.ess_tail.min():.0f} (tail), acceptance "
            f"{p.acceptance.min():.2f} .. {p.acceptance.max():.2f}",
        ]
        if p.converged:
            lines.append(verdict(p))
        if diverged := p.counts["diverged"]:
            lines.append(f"{diverged} of {p.counts['all']} simulations diverged and count as impossible.")
        lines += ["", f"posterior: {self.out / 'posterior.nc'}"]
        return "\n".join(lines)
