"""The numbers a diagnosis decides by: symbol, value, unit, meaning and the evidence behind each.

One table, `TABLE`. A `Limit` is a float, so rules compare with it as with any number. Thresholds that depend
on the manoeuvres and sensors of a trial are not here: `thresholds` draws them from the design.
"""

from __future__ import annotations

from typing import Self


class Limit(float):
    """A number of the table.

    Attributes
    ----------
    symbol : its name in the code
    unit : "1" (a share or a probability), "nats", "sd", or what it counts
    meaning : what lies beyond it
    evidence : what fixed it; says so where nothing measured did
    """

    symbol: str
    unit: str
    meaning: str
    evidence: str

    def __new__(cls, symbol: str, value: float, unit: str, meaning: str, evidence: str) -> Self:
        out = super().__new__(cls, value)
        out.symbol, out.unit, out.meaning, out.evidence = symbol, unit, meaning, evidence
        return out

    def __getnewargs__(self) -> tuple[str, float, str, str, str]:  # type: ignore[override]
        return self.symbol, float(self), self.unit, self.meaning, self.evidence


EVEN_ODDS = Limit(
    "EVEN_ODDS", 0.5, "1",
    "Probability from which one answer is more probable than all others together.",
    "By definition. A review found that 'none' hung on its place in the 95 % set before.",
)  # fmt: skip
NAMING_PROBABILITY = Limit(
    "NAMING_PROBABILITY", 0.9, "1",
    "Probability of acting, alone or with others of its family, from which an effect is named.",
    "Used campaigns replayed: with 0.9, and look-alikes counted, wrong names among the hardest fell from "
    "12 of 30 to 5 of 60.",
)  # fmt: skip
SURE_PROBABILITY = Limit(
    "SURE_PROBABILITY", 0.97, "1",
    "Probability below which the answer says 'probably' before what is named.",
    "Eight sealed runs of campaigns of our own plant: of 268 names with less 23 were wrong (9 %), of 365 "
    "with at least this 11 (3 %, the most a very good diagnosis may have wrong).",
)  # fmt: skip
CONFOUNDED_SHARE = Limit(
    "CONFOUNDED_SHARE", 0.98, "1",
    "Share of an effect's trace that coefficients within their prior absorb, from which it is confounded "
    "with them where it is not sure.",
    "Chosen. A screw side force 1.8 million nats above re-tuned coefficients was not named by this share "
    "alone; wide priors of the coefficients are hypotheses since.",
)  # fmt: skip
UNDETECTABLE_NONCENTRALITY = Limit(
    "UNDETECTABLE_NONCENTRALITY", 10.0, "1",
    "Noncentrality at one prior sd below which an effect of its usual size leaves no trace.",
    "Used campaigns replayed: families in the 95 % set fell from 3.8 to 2.6 together with "
    "NAMING_PROBABILITY, UNLISTED_ALIKE_SHARE, OTHER_FORM_PROBABILITY.",
)  # fmt: skip
BARE_MENTION = Limit(
    "BARE_MENTION", 1.15, "nats",
    "Evidence up to which data do not speak for an effect that these runs would hardly show.",
    "Half a decade: not worth more than a bare mention (Jeffreys 1961). With nought sets of clean campaigns "
    "drawn for development held 3.3 families, with it 2.8.",
)  # fmt: skip
GAP_IS_SURE_BELOW = Limit(
    "GAP_IS_SURE_BELOW", 0.01, "1",
    "Probability of no effect below which there surely is a gap, which no undetectable effect explains.",
    "A review: with a sure gap, effects not to be seen counted as 'none'.",
)  # fmt: skip
MINOR_SHARE = Limit(
    "MINOR_SHARE", 0.1, "1",
    "Share of what one of several effects explains below which a remainder casts no doubt on its name.",
    "Practice a008: a loss of thrust grew to three effects (+13 and +23 of 105703 nats, a remainder of 333).",
)  # fmt: skip
PRIOR_CONFLICT = Limit(
    "PRIOR_CONFLICT", 3.0, "sd",
    "Coefficient move without an effect below which coefficients are not called wrong, whatever chance says.",
    "Chosen; no campaign isolates it.",
)  # fmt: skip
ONE_COEFFICIENT = Limit(
    "ONE_COEFFICIENT", 0.999, "1",
    "Share of an effect's trace that one coefficient has, from which it does what that coefficient does.",
    "More drag and X_u|u| have 1.0000; the next, a weaker rudder and N_dr, 0.988 to 0.998.",
)  # fmt: skip
LISTED_BESIDE_EVIDENCE = Limit(
    "LISTED_BESIDE_EVIDENCE", 20.0, "nats",
    "How far behind the best explanation an effect confounded with coefficients may lie and still be listed "
    "beside it.",
    "As LINEARISATION_SCATTER; no campaign isolates it.",
)  # fmt: skip
DISAGREEMENT_P_VALUE = Limit(
    "DISAGREEMENT_P_VALUE", 1e-3, "1",
    "p-value of all runs having one and the same effect, below which it is not the whole cause.",
    "A planted step of drag that no effect explains (chi2 640) was 'ambiguous' between effects of thrust.",
)  # fmt: skip
FOLLOWS_DATA_CHI2 = Limit(
    "FOLLOWS_DATA_CHI2", 1.5, "1",
    "Mean square of the residuals over the noise up to which a fit follows the data.",
    "Chosen; no campaign isolates it.",
)  # fmt: skip
NOT_FOLLOWING_CHI2 = Limit(
    "NOT_FOLLOWING_CHI2", 25.0, "1",
    "The same beyond which what a refit leaves says nothing.",
    "A review: a refit hundreds of times off counted as an explanation.",
)  # fmt: skip
ARRIVED_SHARE = Limit(
    "ARRIVED_SHARE", 0.8, "1",
    "Share of the gain a linear screen promised below which a refit that began at a smaller explanation "
    "begins anew from the readings, where it is short by more than LINEARISATION_SCATTER too.",
    "Fourteen trials of vehicles with other equations, 200 refits of both kinds: all but 5 agree within a "
    "tenth of what they gain. Of the 5 two end lower than from the readings (by 315 and 75 nats); one of "
    "them is far below this share, the other did not arrive from the readings either.",
)  # fmt: skip
FORM_EVIDENCE = Limit(
    "FORM_EVIDENCE", 20.0, "nats", "Gain a model form needs over the best explanation without one.",
    "As LINEARISATION_SCATTER; a wrong coefficient of practice a004 asked for a form at 5 nats.",
)  # fmt: skip
FORM_LEAVES = Limit(
    "FORM_LEAVES", 0.5, "1",
    "Share of the log evidence a model form is worth that what it leaves may still be worth: an effect that "
    "gains less is not told from it, and a lag of one cause behind another is worth odds of 20 to 1 there.",
    "Labelled trials of six vehicles with other equations: effects that were not there gained up to 0.42 of "
    "it.",
)  # fmt: skip
FORM_LEAVES_BESIDE = Limit(
    "FORM_LEAVES_BESIDE", 1.0, "1",
    "The same for an effect beside one that explains more.",
    "The same trials: second effects that were not there gained up to 0.37 of it.",
)  # fmt: skip
SIZE_DEVIATIONS = Limit(
    "SIZE_DEVIATIONS", 1.5, "1",
    "What standard deviations of sizes are multiplied by where the equations lack a form: what is wrong "
    "alike in every run shows in none of them.",
    "Labelled trials of three vehicles with other equations: of the 57 sizes it is taken from 95 % lay "
    "within 2.91 deviations, 1.96 times 1.5. Maine and Iliff (1981) multiply by 5 to 10, for coloured "
    "residuals alone.",
)  # fmt: skip
ADD_EVIDENCE = Limit(
    "ADD_EVIDENCE", 5.0, "nats", "Gain a further effect needs.",
    "Chosen; no campaign isolates it.",
)  # fmt: skip
DROP_EVIDENCE = Limit(
    "DROP_EVIDENCE", 3.0, "nats", "Loss below which one of several effects is dropped again.",
    "Odds of 20 to 1. Before effects were dropped again, an actuator lag of zero was named beside wind.",
)  # fmt: skip
MOST_EFFECTS = Limit(
    "MOST_EFFECTS", 3, "effects", "Most effects at once.",
    "Chosen; no campaign isolates it.",
)  # fmt: skip
LEAST_FREE_SIGNAL_SHARE = Limit(
    "LEAST_FREE_SIGNAL_SHARE", 0.5, "1",
    "Share of what a free force gains that a further effect must gain; and that the best must gain before "
    "runs that disagree about it temper the evidence.",
    "Used campaigns, together with MOST_EXCHANGES: both of two effects found in 44 of 57, 37 with the "
    "whole gain.",
)  # fmt: skip
MOST_EXCHANGES = Limit(
    "MOST_EXCHANGES", 3, "rounds", "Exchanges of alike effects in a row.",
    "Without exchanges the true pair, 460 to 775 nats better than the one kept, was never tried. The number "
    "is chosen.",
)  # fmt: skip
RIVALS_TRIED = Limit(
    "RIVALS_TRIED", 2, "effects", "Rivals of each effect that are tried in its place.", "As MOST_EXCHANGES.",
)  # fmt: skip
LINEARISATION_SCATTER = Limit(
    "LINEARISATION_SCATTER", 20.0, "nats",
    "Gains below which refits along paths of their own differ by chance as much as by what they explain.",
    "A clean campaign: +10.5 between two refits, +0.2 along one path.",
)  # fmt: skip
WALD_SLACK = Limit(
    "WALD_SLACK", 3.0, "nats",
    "Slack of the check of evidence against the distance of the parameters from zero.",
    "A refit that had not arrived named fluid memory at +93 nats with a share of 0.014 +- 0.012.",
)  # fmt: skip
LEAST_NAMING_EVIDENCE = Limit(
    "LEAST_NAMING_EVIDENCE", 3.0, "nats",
    "Least evidence that names an effect, whatever the design allows by chance.",
    "Odds of 20 to 1.",
)  # fmt: skip
INTERVAL_TOLD = Limit(
    "INTERVAL_TOLD", 0.95, "1",
    "Probability of the interval a size is told with: an effect whose interval holds nought is not named.",
    "By definition. Of 197 names on labelled trials of vehicles with other equations one had such a size "
    "(-0.7 with a deviation of 0.7), and was wrong.",
)  # fmt: skip
FALSE_ALARM = Limit(
    "FALSE_ALARM", 0.01, "1", "Share of trials without an effect that may pass a threshold of the design.",
    "Chosen; 2000 trials are drawn from the linearised model of each design.",
)  # fmt: skip
NOISE_MODEL_SLACK = Limit(
    "NOISE_MODEL_SLACK", 10.0, "nats",
    "What a free signal may gain on top of chance because the process noise is estimated.",
    "157 campaigns without any effect: free forces gained up to 20 nats.",
)  # fmt: skip
LEAST_RUNS = Limit(
    "LEAST_RUNS", 3, "runs",
    "Runs from which they tell of each other: how far a size scatters between them, and what leaving one out "
    "does.",
    "By definition: three that say alike have two degrees of freedom.",
)  # fmt: skip
PRIOR_NONE = Limit("PRIOR_NONE", 0.5, "1", "Prior of no effect.", "Stated before any data.")
PRIOR_CATALOGUE = Limit(
    "PRIOR_CATALOGUE", 0.4, "1", "Prior shared by the catalogue.", "Stated before any data."
)
PRIOR_OUTSIDE = Limit(
    "PRIOR_OUTSIDE", 0.1, "1", "Prior of a cause that is not listed.", "Stated before any data."
)
USUAL_SIZE_PROBABILITY = Limit(
    "USUAL_SIZE_PROBABILITY", 0.5, "1",
    "Prior of an effect having its usual size; the rest is shared by smaller ones that would show.",
    "Stated before any data. With the usual size alone two hulls out of line of a fiftieth of it were told "
    "as a propeller's and a rudder's side, which pay for one parameter (fourteenth sealed run).",
)  # fmt: skip
SHOWN_NONCENTRALITY = Limit(
    "SHOWN_NONCENTRALITY", 100.0, "1",
    "Noncentrality at one prior sd from which a size smaller than usual is tried.",
    "Three in four sizes drawn from such a prior would be named alone (a normal number beyond "
    "0.35). With 10, where one in four would, sets of clean campaigns held 4.2 families, 2.8 before smaller "
    "sizes.",
)  # fmt: skip
UNLISTED_ALIKE_SHARE = Limit(
    "UNLISTED_ALIKE_SHARE", 0.5, "1",
    "Share of what lies outside that looks like an effect of the catalogue rather than like any generic "
    "signal: a drag that grows in a step is not a loss of thrust, and yet more like it than like a free "
    "force.",
    "Used campaigns replayed: log score from 1.01 to 0.63 together with NAMING_PROBABILITY and "
    "OTHER_FORM_PROBABILITY.",
)  # fmt: skip
OTHER_FORM_PROBABILITY = Limit(
    "OTHER_FORM_PROBABILITY",
    0.25,
    "1",
    "Chance that an effect acts in another form than the catalogue's.",
    "As UNLISTED_ALIKE_SHARE.",
)
REMAINDER_EVIDENCE = Limit(
    "REMAINDER_EVIDENCE", 3.0, "nats", "Gain from which a remainder shows.", "Odds of 20 to 1."
)
LEAST_REMAINDER_SHARE = Limit(
    "LEAST_REMAINDER_SHARE", 1e-3, "1", "Smallest part of what an effect explains that another form of it leaves.",  # noqa: E501
    "Assumed; every magnitude between it and one counts as equally probable.",
)  # fmt: skip
FREE_SIGNAL_SLACK = Limit(
    "FREE_SIGNAL_SLACK", 10.0, "nats",
    "How much better a free signal may be alone than with an effect that has nothing to do beside it.",
    "6-DOF in still water: 'outside' at 2000 nats where the refit left 0.3.",
)  # fmt: skip
BRIEF_EVENT_EVIDENCE = Limit(
    "BRIEF_EVENT_EVIDENCE", 30.0, "nats",
    "Gain of a free force in a short time of a run, beyond the logarithm of how many such were tried, from "
    "which it is an event.",
    "At 20, as LINEARISATION_SCATTER, one was told at 24.5 of a simulated lever arm, and none in 38 opened "
    "trials of the plant without one.",
)  # fmt: skip
CAUSE_OVER_MOTION = Limit(
    "CAUSE_OVER_MOTION", 5.0, "nats",
    "How much more brief events (beyond the logarithm of how many were tried), or a free force in all runs, "
    "must gain than a force of the motion and the controls of any shape in their place.",
    "As DEPENDENCE_OVER_RIVALS. The execute of a ship's one turn at 35 degrees, told as an event before, "
    "gained 394 nats, such a force 470; of three trials whose rudder jammed 192, 310 and 83, such "
    "a force 175, 222 and 50.",
)  # fmt: skip
STUCK_TRIED = Limit(
    "STUCK_TRIED", 20.0, "nats",
    "Gain that linear theory gives an actuator that sticks, all runs together, from which the trial is "
    "refitted with its order held.",
    "As LINEARISATION_SCATTER; of five simulated rudders that jam in every run it lay between 35 and 220, "
    "and above it in nine of 42 opened trials without one.",
)  # fmt: skip
STUCK_EVIDENCE = Limit(
    "STUCK_EVIDENCE", 30.0, "nats",
    "How much better the best explanation must be with an actuator held where it stuck, beyond the logarithm "
    "of how many times, values and actuators were tried.",
    "As BRIEF_EVENT_EVIDENCE; of those nine none gained it but two that left as much to a free force.",
)  # fmt: skip
DEPENDENCE_EVIDENCE = Limit(
    "DEPENDENCE_EVIDENCE", 30.0, "nats",
    "Gain of a force with the place or a period, beside the explanation and a force of the motion and the "
    "controls of any shape, from which it is told.",
    "Before the environment was scaled the most of 34 opened trials of vehicles with other equations without "
    "such a cause was 13, the least of eight with one, left to a form or to sets before, 58.",
)  # fmt: skip
WIND_READ_SCATTER = Limit(
    "WIND_READ_SCATTER", 10.0, "nats",
    "Gain of another reading of the columns of a measured wind that counts as none.",
    "Of 16 selections of runs of a real ship in wind, rightly read, none was named a mistake; in ten others "
    "the most such a reading gained was 8.4, of a wind that is nearly the same.",
)  # fmt: skip
DEPENDENCE_OVER_RIVALS = Limit(
    "DEPENDENCE_OVER_RIVALS", 5.0, "nats",
    "How much more a force with the place or a period must gain than one that changes with time, or than an "
    "error of a sensor.",
    "In one run place and time are nearly one: of six simulated runs in gusts three told the place, by up to "
    "1.9 nats, before.",
)  # fmt: skip

TABLE: tuple[Limit, ...] = tuple(value for value in list(globals().values()) if isinstance(value, Limit))
