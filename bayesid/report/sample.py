"""The report of a sampled posterior: may it be believed, what it says, how it was made.

Takes a `TrialFit` and its `Posterior`. Does not sample. Below the convergence check no interval is given as
final.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from bayesid.estimation.sampling import Posterior
from bayesid.estimation.trial_fit import TrialFit
from bayesid.model.vehicles import Vehicle
from bayesid.report import coefficient_cells, writer
from bayesid.report import sample_figures as figures
from bayesid.report.writer import Figure, Report, Section, Table, Text, literal

COLUMNS = (
    "unknown", *coefficient_cells.COLUMNS, "sd [%]", "5 % (SI)", "95 % (SI)", "sd / prior sd", "R-hat",
    "bulk size",
)  # fmt: skip
MOST_SHOWN = 24  # unknowns in the figures
MOST_NAMED = 12  # channels whose memory is listed one by one
MISFIT = 3.0  # noise found over noise stated beyond which the model, not the sensor, is the limit


def verdict(posterior: Posterior) -> str:
    """One sentence on the chain."""
    if posterior.converged:
        return "Converged: ensembles agree and are long enough."
    return f"Not converged; no interval is final: {'; '.join(posterior.convergence.reasons)}."


def rows(posterior: Posterior, vehicle: Vehicle) -> list[list[Any]]:
    """One row per unknown: mean as prime and SI value, sd in percent of it, interval in SI."""
    edges, g = posterior.interval(0.9), posterior.convergence
    found = []
    for i, name in enumerate(posterior.names):
        ratio = posterior.sd[i] / posterior.prior_sd[i] if np.isfinite(posterior.prior_sd[i]) else None
        mean = float(posterior.mean[i])
        value = coefficient_cells.cells(vehicle, name, mean)
        spread = 100 * posterior.sd[i] / abs(mean) if mean else None
        found.append([name, *value, spread, *edges[i], ratio, float(g.rhat[i]), round(float(g.ess_bulk[i]))])
    return found


def write_sample_report(found: TrialFit, posterior: Posterior, out: Path) -> Path:
    """Write report.html, report.md and results.json; gives the page."""
    results = {
        "inputs": {
            "trial": found.trial.name, "trial_digest": found.trial.digest,
            "vehicle": found.vehicle.name, "vehicle_digest": found.vehicle.digest,
        },
        **posterior.summary(),
    }  # fmt: skip
    return writer.write(sample_report(found, posterior), out, results)


def sample_report(found: TrialFit, posterior: Posterior) -> Report:
    """The report as plain data."""
    title = f"What {literal(found.trial.name)} says about {literal(found.vehicle.name)}"
    sections = (_unknowns(posterior, found.vehicle), _chain(posterior), _model(found, posterior))
    return Report(title, _lead(found, posterior), sections)


def _lead(found: TrialFit, posterior: Posterior) -> str:
    n = posterior.n_params
    ratio = posterior.sd[:n] / posterior.prior_sd[:n]
    fixed = int(np.sum(ratio < 0.1))
    loose = int(np.sum(ratio > 0.9))
    words = (
        f"{verdict(posterior)} Of {n} parameters the data narrow {fixed} to less than a tenth of their prior "
        f"and leave {loose} almost as they were."
    )
    if not found.fit.converged:
        words += f" The fit it starts from had not converged ({found.fit.message})."
    return f"{words} {noise_words(found, posterior)}".rstrip()


def noise_words(found: TrialFit, posterior: Posterior) -> str:
    """A sentence where sampled noise is far above the stated; empty elsewhere."""
    stated = found.trial.noise
    far = []
    for name, mean in zip(posterior.names, posterior.mean, strict=True):
        channel = name.removeprefix("sigma:")
        if channel != name and stated.get(channel, 0.0) > 0 and mean > MISFIT * stated[channel]:
            far.append(f"{channel} {mean / stated[channel]:.2g}")
    if not any(name.startswith("sigma:") for name in posterior.names):  # held at the power of the likelihood
        for channel, rms in found.fit.channel_rms.items():
            if stated.get(channel, 0.0) > 0 and rms > MISFIT * stated[channel]:
                far.append(f"{channel} {rms / stated[channel]:.2g}")
    if not far:
        return ""
    return (
        f"Noise comes out larger than stated ({', '.join(far)} times): so much is error of the model or a "
        "disturbance, and the intervals are those of a model that misses something; see `bayesid diagnose`."
    )


def _memory(taus: dict[str, float]) -> str:
    """How many readings count as one, by channel or, for many pieces, in all."""
    if not taus:
        return "none does here"
    if len(taus) <= MOST_NAMED:
        return ", ".join(f"{literal(n)} one in {t:.1f}" for n, t in taus.items())
    low, middle, high = np.quantile(list(taus.values()), [0.0, 0.5, 1.0])
    return (
        f"{len(taus)} channels of runs or pieces, one in {low:.1f} to one in {high:.1f}, half of them "
        f"more than one in {middle:.1f} (each in results.json)"
    )


def _unknowns(posterior: Posterior, vehicle: Vehicle) -> Section:
    words = (
        f"Means: {coefficient_cells.FORM} `sigma` is the noise of a channel, `phi` the correlation of "
        "neighbours among residuals, in SI. Intervals hold the central 90 %, given the model: an effect it "
        "does not know makes them wrong without making them wide."
    )
    if not posterior.converged:
        words = f"**{literal(verdict(posterior))}** The numbers below are for looking only. {words}"
    k = min(posterior.n_params, MOST_SHOWN)
    centre, width = posterior.prior_mean[:k], posterior.prior_sd[:k]
    blocks: list[Any] = [Text(words)]
    if np.isfinite(width).all():
        drawn = figures.intervals(posterior.names[:k], (posterior.params[:, :k] - centre) / width)
        caption = (
            "50 and 90 % intervals of the posterior in prior standard deviations; grey: 90 % of the prior."
        )
        blocks.append(Figure("intervals", drawn, caption))
    return Section("Unknowns", (*blocks, Table(COLUMNS, rows(posterior, vehicle), digits=5)))


def _chain(posterior: Posterior) -> Section:
    g, counts = posterior.convergence, posterior.counts
    worst = np.argsort(-g.tau)[:4]
    drawn = figures.traces(
        [posterior.names[i] for i in worst], posterior.draws[..., worst].mean(axis=2),
        posterior.draws[..., worst].std(axis=2), posterior.thin,
    )  # fmt: skip
    table = [
        ("R-hat across ensembles, largest", float(g.rhat.max()), "<= 1.01"),
        ("steps in autocorrelation times", g.n_tau, ">= 50"),
        ("change of that time in the last quarter", g.tau_change, "<= 0.1"),
        ("effective size, bulk", float(g.ess_bulk.min()), ">= 400"),
        ("effective size, tail", float(g.ess_tail.min()), ">= 400"),
        ("walkers that hardly moved", len(g.stuck), "0"),
    ]
    text = (
        f"{posterior.draws.shape[0]} ensembles of {posterior.draws.shape[2]} walkers, started wide about "
        f"the fit; {posterior.discarded} steps of warm-up left out, {posterior.steps} kept; acceptance "
        f"{posterior.acceptance.min():.2f} to {posterior.acceptance.max():.2f}; {counts['all']} evaluations, "
        f"{counts['out of bounds']} out of bounds, {counts['diverged']} of vehicles that diverge; "
        f"{posterior.seconds:.1f} s of processor time, {posterior.ess_per_second:.0f} effective draws a "
        "second."
    )
    caption = (
        "The four slowest unknowns: mean and sd over the walkers of each ensemble; lines should not drift."
    )
    return Section(
        "The chain", (Text(text), Table(("", "found", "limit"), table), Figure("traces", drawn, caption))
    )


def _model(found: TrialFit, posterior: Posterior) -> Section:
    density = posterior.settings.get("density", {})
    taus = {n: t for n, t in posterior.settings.get("correlation_times", {}).items() if t > 1}
    names = ", ".join(literal(run.name) for run in found.trial.identify)
    if len(found.problem.runs) > len(found.trial.identify):
        names += f", cut into {len(found.problem.runs)} pieces"
    memory = {
        "ignore": "Residuals are taken as white.",
        "ar1": "Residuals of a channel follow a first-order autoregression.",
        "inflate": "Residuals that persist count for fewer readings: " + _memory(taus) + ".",
    }[density.get("memory", "ignore")]
    if posterior.settings.get("adjusted"):
        memory = (
            "The likelihood is that of white noise, its argument mapped about the fit so that coefficients "
            f"have the covariance of the fit ({posterior.settings.get('likelihood')}); where that is wider "
            "than the prior, the prior stands."
        )
    text = (
        f"Runs {names}; {found.fit.n_readings} readings. Noise {density.get('noise')}, initial states "
        f"{density.get('initial')}"
        + (f", Student-t with {density['student']:g} degrees of freedom" if density.get("student") else "")
        + f". {memory} The fit: {literal(found.fit.verdict)}."
    )
    return Section("The model", (Text(text),))
