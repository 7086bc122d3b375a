"""The result of a diagnosis: final values, made once; `diagnosis.json`, terminal and report are views of it.

The fields of `Result` are the keys of the format (1), in order; the schema is generated from their types and
from what is said of them here. Arrays that only figures need are in `Drawings`, which is not written. Does
not decide, fit or write (`final_values` makes it).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any

from bayesid.diagnosis.data.dependence import Dependence
from bayesid.diagnosis.data.event import Event
from bayesid.diagnosis.evidence.effect_draws import EffectDraws
from bayesid.diagnosis.evidence.missing_force import MissingForce
from bayesid.diagnosis.hypotheses.facts import Unnamed
from bayesid.diagnosis.hypotheses.rules import Word
from bayesid.diagnosis.hypotheses.thresholds import Thresholds
from bayesid.diagnosis.next_manoeuvre import Proposal
from bayesid.diagnosis.result_parts import (
    Coefficient,
    Detectability,
    Diagnosed,
    Drawings,
    Effect,
    Gap,
    InPlaceOf,
    Location,
    ModelFormPart,
    Moved,
    Noise,
    Outlier,
    Refit,
    Retuning,
    RunError,
    Screened,
    Share,
    SimulatorMistakeFound,
)
from bayesid.diagnosis.run_sizes import RunSizes
from bayesid.diagnosis.schema import About, described, plain

FORMAT = 1
# Keys every file of format 1 has, also one of an earlier version.
CONTRACT = (
    "format", "verdict", "effects", "probabilities", "set95", "ambiguity_groups", "where", "gap",
    "next_manoeuvre", "warnings",
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Result:
    """Everything a diagnosis says, as final plain values."""

    format: Annotated[int, About(checks={"const": FORMAT})]
    bayesid: Annotated[str, About("Version that diagnosed.")]
    trial: Annotated[
        Diagnosed,
        About(
            "What was diagnosed: name, digest of its readings, degrees of freedom, the channels used, the "
            "vehicle, and whom the data are owed to."
        ),
    ]
    model: Annotated[str, About("Digest of the equations and the vehicle's numbers.")]
    seed: Annotated[int, About("Of the draws behind thresholds and intervals.")]
    verdict: Annotated[
        Word,
        About(
            "none: nothing beyond noise, environment and stated uncertainty. effect: one effect explains the "
            "gap. effect_with_remainder: one effect is sure and does not explain all, be it that a free "
            "signal still gains, that runs disagree about it, or that others act beside it which are not "
            "sure. several: more than one is sure. outside: a gap, and no effect is named; those "
            "that may act beside what is not listed are in set95. coefficients: "
            "closed by moving coefficients beyond their uncertainty. ambiguous: these runs cannot tell the "
            "cause, or whether there is one, also where the most probable name has less than 90 %. "
            "model_form: a repeatable force that depends on the motion and that the equations lack is "
            "needed, and no cause beside it is told from what such a force leaves."
        ),
    ]
    effects: Annotated[
        tuple[Effect, ...],
        About(
            "What the verdict stands on; empty for none and outside. Of an ambiguous verdict the members of "
            "set95 but none and outside, which are possible, not named (or, where there is no other, the "
            "effect more probable than not, if any); of coefficients coefficient_error, or the effect more "
            "probable than not that acts alike. Parameters are those of the best explanation (Laplace, "
            "environment at its level), empty for an effect that is not in it; where the equations lack a "
            "form, of all explanations that hold the effect, averaged by their probability."
        ),
    ]
    probabilities: Annotated[
        Mapping[str, Share],
        About(
            "Of every hypothesis: none, each effect of the catalogue, coefficient_error, outside, and "
            "model_form, which takes the place of none where the runs need one. Sums to 1; "
            "effects that act together share their mass.",
            {"required": ["none", "outside"]},
        ),
    ]
    acting: Annotated[
        Mapping[str, Share],
        About(
            "Of every hypothesis: that it is true, alone or with others, before runs are left out or held "
            "out. Two effects that surely act together have 1 each; does not sum to 1."
        ),
    ]
    set95: Annotated[
        tuple[str, ...],
        About(
            "Fewest hypotheses that hold 95 % of the probability, most probable first. Those of unseen count "
            "as none; what a shape of a force the equations lack has in company counts as its causes'."
        ),
    ]
    unseen: Annotated[
        tuple[str, ...],
        About(
            "Effects these runs would hardly show at their usual size and do not speak for: not to be told "
            "from none here. Their probability is about what it was before the data."
        ),
    ]
    hidden_by_coefficients: Annotated[
        tuple[str, ...], About("Effects whose trace changed coefficients can take over.")
    ]
    reasons: Annotated[tuple[str, ...], About("Sentences behind the verdict, numbers included.")]
    rule: Annotated[
        str,
        About(
            "Name of the rule that decided; the rules stand in order in `bayesid.diagnosis.hypotheses.rules`."
        ),
    ]
    thresholds: Annotated[
        Thresholds,
        About(
            "What chance reaches in at most 1 of 100 trials: gain of the best effect (named) and of the best "
            "free signal (remainder) [nats], largest coefficient move (conflict) [prior sd]."
        ),
    ]
    screen: Annotated[
        tuple[Screened, ...], About("Every effect of the catalogue along one path, best first.")
    ]
    refits: Annotated[
        tuple[Refit, ...],
        About("Hypotheses refitted: no effect, then the others, best first."),
    ]
    explanation: Annotated[
        tuple[str, ...],
        About("Effects of the model `with effect` of gap and measures; empty where no effect gains."),
    ]
    ambiguity_groups: Annotated[
        tuple[tuple[str, ...], ...], About("Effects that leave nearly the same trace on these runs.")
    ]
    ambiguity_size: Annotated[
        float, About("Size at which these groups are alike [prior standard deviations].")
    ]
    detectability: Annotated[
        Mapping[str, Detectability],
        About(
            "Per effect these runs can test: expected noncentrality of its trace on them at one prior "
            "standard deviation, and the share of it that coefficients within their prior absorb."
        ),
    ]
    where: Annotated[Location, About("Where the gap lies.")]
    gap: Annotated[Gap, About("Prediction error on held-out runs, which were read after the verdict.")]
    measures: Annotated[
        tuple[Mapping[str, str | float | None], ...],
        About(
            "Overshoots, diameters and the like of held-out runs, as logged and as each model replays them."
        ),
    ]
    events: Annotated[
        tuple[Event, ...],
        About("Short pieces left out, or with an order held; see the report for their kinds."),
    ]
    outliers: Annotated[tuple[Outlier, ...], About("Single readings left out.")]
    posterior: Annotated[
        EffectDraws | None, About("Draws of the named effects' parameters, where asked for (SI).")
    ]
    description: Annotated[
        MissingForce | None,
        About("What the missing force is made of, where an effect does not explain all of it."),
    ]
    environment: Annotated[
        Noise,
        About(
            "Noise of the motion the diagnosis allowed for, one standard deviation: force per axis [N, N m] "
            "over force_tau [s], slow error of the position [m] over drift_tau [s], depth that of the depth "
            "[m] (null: as the position, or none logged), arms the moment a disturbance has per force [m]. "
            "Source: stated in the bundle, measured from straight runs, or assumed. Again: whether it was "
            "estimated again beside the best explanation (left out of records before this was told)."
        ),
    ]
    coefficients: Annotated[
        Mapping[str, Coefficient], About("With the best explanation, in the units of the vehicle file.")
    ]
    model_form: Annotated[
        ModelFormPart | None,
        About("The force the equations lack that every hypothesis has; null where the runs ask for none."),
    ]
    next_manoeuvre: Annotated[
        tuple[Proposal, ...],
        About(
            "Manoeuvres, best first, with the margin [nats] of the worst pair without and with each, what is "
            "ordered, and the text by which commands take it."
        ),
    ]
    warnings: Annotated[tuple[str, ...], About("What a reader has to know besides.")]
    runs: Annotated[
        tuple[RunError, ...],
        About(
            "Errors of every run, replayed open loop as given, re-tuned and with the best explanation. The "
            "first is the one the report shows: the held-out run (else the identify run) that the model as "
            "given misses most."
        ),
    ] = ()
    moved: Annotated[
        Mapping[str, Moved], About("How far each coefficient of the vehicle file moves, in its units.")
    ] = field(default_factory=dict)
    retuning: Annotated[
        Retuning | None, About("Whether the explanation is shown, and predicts, with coefficients re-tuned.")
    ] = None
    runs_agree: Annotated[
        float | None,
        About(
            "p-value of all identify runs having one and the same effect, the best explanation's; null where "
            "it was not asked."
        ),
    ] = None
    run_sizes: Annotated[
        Mapping[str, RunSizes],
        About(
            "Effect of the best explanation -> its sizes as single runs ask for them; empty where it was not "
            "asked."
        ),
    ] = field(default_factory=dict)
    simulator: Annotated[
        tuple[SimulatorMistakeFound, ...],
        About(
            "Mistakes of the simulator that close the gap, best first: with the numbers of the vehicle file "
            "changed as they ask for, no cause is left to look for. Empty where no mistake does; the verdict "
            "is that of the simulator as given."
        ),
    ] = ()
    together: Annotated[
        Share,
        About(
            "That more than one cause acts. Shapes of a force the equations lack, and that force, are none."
        ),
    ] = 0.0
    next_asked: Annotated[
        bool, About("Whether manoeuvres to run next were asked for; `--quick` does not.")
    ] = True
    dependence: Annotated[
        Dependence | None,
        About(
            "What a force that is left depends on, where neither the motion nor the controls decide it: "
            "place over ground, and over which distance it changes [m], or a period [s]; size rms, a share "
            "of the hull's forces or [N]; evidence beside the explanation, and without any effect [nats]."
        ),
    ] = None
    unnamed: Annotated[
        Mapping[str, Unnamed],
        About(
            "Effects of the explanation that are not named beside those that are, and why. range: a "
            "parameter is out of the range in which it is that effect. size: it is not told from none. "
            "leeway: that of a constant side force reads the same. form: no more than what the force the "
            "equations lack may leave. remainder: what is left is a large part of what it explains. "
            "probability: below that of a name."
        ),
    ] = field(default_factory=dict)
    in_place_of: Annotated[
        tuple[InPlaceOf, ...],
        About(
            "Effects that would do what coefficients do which the runs put elsewhere than stated, whatever "
            "force the equations lack; no run tells the two apart. Those of coefficients certainly further "
            "off than stated are in set95."
        ),
    ] = ()
    drawings: Drawings | None = field(default=None, metadata={"drawn": True}, compare=False)

    def record(self) -> dict[str, Any]:
        """Plain data of `diagnosis.json`."""
        return plain(self)


def schema() -> dict[str, Any]:
    """JSON Schema of `diagnosis.json`."""
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": f"bayesid diagnosis, format {FORMAT}",
        **described(Result),
        "required": list(CONTRACT),
    }
