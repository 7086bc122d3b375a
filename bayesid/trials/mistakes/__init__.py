"""Mistakes of a log as hypotheses: what was written down wrongly, how sure that is, the line that mends it.

Takes the runs of a trial. Gives `InputFinding`s. The table is `table`; what kinematics says of it `judge`.
Does not: simulate a vehicle (`bayesid.diagnosis.input`), or change the trial.
"""

from bayesid.trials.mistakes.finding import SIMULATOR, InputCheck, InputFinding
from bayesid.trials.mistakes.judge import check_input
from bayesid.trials.mistakes.table import MISTAKES, Mistake

__all__ = ["MISTAKES", "SIMULATOR", "InputCheck", "InputFinding", "Mistake", "check_input"]
