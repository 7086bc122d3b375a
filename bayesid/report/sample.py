"""The report of a sampled posterior: what the runs fix and leave open, may it be believed, how it was made.

Takes a `TrialFit`, its `Posterior` and `PosteriorView`. Does not sample. Below the convergence check no
interval is given as final.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from bayesid.analysis.identifiability.posterior_view import PosteriorView
from bayesid.estimation.sampling import Posterior
from bayesid.estimation.sampling.chain_statistics import autocorrelation, ess_growth
from bayesid.estimation.trial_fit import TrialFit
from bayesid.model.vehicles import Vehicle
from bayesid.report import coefficient_cells, posterior_figures, ridge_figures, sample_first_screen, writer
from bayesid.report import sample_figures as figures
from bayesid.report.writer import Block, Figure, Report, Section, Table, Text, literal

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


def write_sample_report(found: TrialFit, posterior: Posterior, view: PosteriorView, out: Path) -> Path:
    """Write report.html, report.md and results.json; gives the page."""
    results = {
        "inputs": {
            "trial": found.trial.name, "trial_digest": found.trial.digest,
            "vehicle": found.vehicle.name, "vehicle_digest": found.vehicle.digest,
        },
        **posterior.summary(),
        **view.record(),
    }  # fmt: skip
    return writer.write(sample_report(found, posterior, view), out, results)


def sample_report(found: TrialFit, posterior: Posterior, view: PosteriorView) -> Report:
    """The report as plain data."""
    title = f"What {literal(found.trial.name)} says about {literal(found.vehicle.name)}"
    screen = sample_first_screen
    failed = screen.failures(found, posterior, view, verdict(posterior), noise_words(found, posterior))
    sections = (
        _priors(view, found.vehicle),
        _together(view),
        _predicted(view),
        _unknowns(posterior, found.vehicle),
        _chain(posterior),
        _model(found, posterior),
    )
    lead = literal(screen.headline(found, posterior, view))
    return Report(title, lead, sections, failed, screen.first_blocks(found, posterior, view))


def prior_rows(view: PosteriorView, vehicle: Vehicle) -> list[list[Any]]:
    """One row per prior: prime and SI centre, sd in percent of it, kind, source."""
    rows = []
    for p in view.priors:
        prime, value, unit = coefficient_cells.cells(vehicle, p.name, p.centre)
        sd = p.sd if np.isfinite(p.sd) else None
        share = 100 * p.sd / abs(p.centre) if sd is not None and p.centre and np.isfinite(p.centre) else None
        rows.append([p.name, p.kind if sd is not None else "flat", prime, value, unit, sd, share, p.source])
    return rows


PRIORS = ("unknown", "prior", "centre (prime)", "centre (SI)", "SI unit", "sd (SI)", "sd [%]", "from")


def _priors(view: PosteriorView, vehicle: Vehicle) -> Section:
    text = (
        "What was taken as known before the runs. Everything on this page is said in these units: where a "
        "prior is "
        "too narrow, what is called open stays too narrow as well. A dash: flat, or no number."
    )
    return Section("Priors", (Text(text), Table(PRIORS, prior_rows(view, vehicle), digits=4)))


def _together(view: PosteriorView) -> Section:
    every = view.ridges.combinations
    count = {s: sum(c.status == s for c in every) for s in ("fixed", "narrowed", "open")}
    text = (
        f"Eigenvectors of the posterior covariance, {sample_first_screen.UNIT}: {count['fixed']} fixed (at "
        "most "
        f"10 % of the prior sd left), {count['narrowed']} narrowed, {count['open']} open (71 % and more "
        "left: "
        "most of the variance is the prior's). Open ones are turned to few names each."
    )
    shown = every[:MOST_SHOWN]
    drawn = ridge_figures.combinations(
        [c.name for c in shown], [c.left for c in shown], [c.laplace for c in shown]
    )
    caption = (
        "Share of the prior sd that is left along each combination, logarithmic. Plain bars: fixed; striped: "
        "narrowed; crossed: open. Black marks: Laplace approximation, which should end where the bar does."
    )
    rows = [[c.name, c.status, 100 * c.left, 100 * c.laplace] for c in every]
    table = Table(("combination", "", "left [%]", "Laplace [%]"), rows, digits=3)
    return Section("All combinations", (Text(text), Figure("combinations", drawn, caption), table))


def _predicted(view: PosteriorView) -> Section:
    text = (
        "Runs that were fitted, simulated from the fitted start with draws of the prior and of the "
        "posterior, without "
        "sensor noise. What is left open does not show here; in other manoeuvres it may."
    )
    blocks: list[Block] = [Text(text)]
    for number, run in enumerate(view.runs, 1):
        radius = {name: band.spread for name, band in run.bands.items()}
        drawn = figures.predicted(run.name, run.t, run.readings, run.tracks, radius)
        lost = run.bands["prior"].diverged
        caption = (
            f"{literal(run.name)}. Left: tracks of 30 draws of the prior (grey) and of the posterior "
            "(blue), log as "
            "dots. Right: radius around the median track that holds 90 % of the draws [m], logarithmic."
        )
        if lost:
            caption += f" {lost} of 200 vehicles of the prior diverge and are left out."
        blocks.append(Figure(f"predicted_{number}", drawn, caption))
    return Section("Predicted before and after", blocks)


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
    slow = [posterior.names[i] for i in worst]
    lags = max(10, int(4 * g.tau[worst[0]] / posterior.thin))
    steps, sizes = ess_growth(posterior.draws[..., worst])
    energy = -posterior.log_prob.reshape(posterior.draws.shape[0], -1)
    health = figures.chain_health(
        slow, autocorrelation(posterior.draws[..., worst], lags), posterior.thin,
        posterior.thin * steps, sizes,
        posterior.settings.get("sampler", {}).get("limits", {}).get("ess", 400.0), energy - energy.min(),
    )  # fmt: skip
    count = min(posterior.n_params, MOST_SHOWN)
    ranked = posterior.draws[..., :count].reshape(posterior.draws.shape[0], -1, count)
    ranked = ranked[:, :: max(1, ranked.shape[1] // 20_000)]
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
        f"{sample_first_screen.chains(posterior)}, started wide about the fit; "
        f"{posterior.discarded} steps of warm-up left out, {posterior.steps} kept; acceptance "
        f"{posterior.acceptance.min():.2f} to {posterior.acceptance.max():.2f}; {counts['all']} evaluations, "
        f"{counts['out of bounds']} out of bounds, {counts['diverged']} of vehicles that diverge; "
        f"{posterior.seconds:.1f} s of processor time, {posterior.ess_per_second:.0f} effective draws a "
        "second."
    )
    caption = (
        "The four slowest unknowns: mean and sd over the walkers of each ensemble; lines should not drift."
    )
    told = (
        "The four slowest unknowns. Left: autocorrelation, which should fall to 0 and stay there. Middle: "
        "effective "
        "draws as the chain grows; a straight line above the dotted limit is a chain that mixes, one that "
        "bends "
        "down is not. Right: energy (minus log density above its least) of every ensemble; the curves "
        "should lie on "
        "one another."
    )
    flat = "Ranks of every ensemble's draws among all, by twentieths; a step far from 1 is one elsewhere."
    return Section(
        "The chain",
        (
            Text(text), Table(("", "found", "limit"), table), Figure("chain_health", health, told),
            Figure("ranks", posterior_figures.ranks(posterior.names[:count], ranked), flat),
            Figure("traces", drawn, caption),
        ),
    )  # fmt: skip


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
