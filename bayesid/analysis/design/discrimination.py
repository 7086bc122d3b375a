"""The third goal: tell candidate causes of a gap apart (T-optimal), with the bank of the gap diagnosis.

Takes a posed gap and the names of effects. Gives the expected log-evidence margin of the pair that is hardest
to tell apart, as it is and with a manoeuvre more, averaged over vehicles drawn. Does not diagnose.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from bayesid.diagnosis.data.problem import DiagnosisProblem
from bayesid.diagnosis.hypotheses.sensitivity_bank import SensitivityBank, build_bank, testable
from bayesid.diagnosis.next_manoeuvre import added_equations, worst_margin
from bayesid.errors import ModelError
from bayesid.estimation.filter_error.evidence import NormalEquations, posterior
from bayesid.manoeuvres import Manoeuvre

Array = np.ndarray
VIRTUAL_FORCE_LEVEL = 1e-5  # disturbance force over 1/2 rho L^2 U^2 taken for a trial that was never sailed
CAUSE_SIZE = 0.3  # of the causes, in their prior standard deviations, unless said otherwise


@dataclass(frozen=True, eq=False)
class Causes:
    """Effects to tell apart after the runs of a trial.

    size : of the true one, in prior standard deviations
    longest : length of a run that counts [L/U]
    """

    problem: DiagnosisProblem
    bank: SensitivityBank
    names: tuple[str, ...]
    size: float
    longest: float
    unit: str = "expected margin between them [nats]"

    @property
    def name(self) -> str:
        return "tell " + " from ".join(self.names) + " apart"

    @property
    def now(self) -> float:
        """Margin with the runs flown."""
        return worst_margin(self.bank, self.names, self.size)

    def matrices(self, manoeuvre: Manoeuvre, draws: Array) -> list[NormalEquations]:
        """What a manoeuvre would add, per vehicle drawn.

        Raises
        ------
        ModelError
            if one of them diverges, or the run is too short to be judged
        """
        found = []
        for par in draws:
            matrix = added_equations(self.problem, self.bank, manoeuvre, par, self.longest)
            if matrix is None or not np.isfinite(matrix.ss).all():
                raise ModelError(f"{manoeuvre.name}: too few readings, or the vehicle leaves its equations")
            found.append(matrix)
        return found

    def margin(self, matrices: Sequence[NormalEquations]) -> float:
        """Mean margin with each of the additions."""
        first, *rest = self.bank.equations[0]
        with_it = [replace(self.bank, equations=((first + g, *rest),)) for g in matrices]
        return float(np.mean([worst_margin(b, self.names, self.size) for b in with_it]))


def causes(
    problem: DiagnosisProblem, names: Sequence[str], size: float = CAUSE_SIZE, longest: float = 60.0
) -> Causes:
    """Goal of telling effects apart.

    Raises
    ------
    ModelError
        fewer than two names, an effect that does not exist or cannot show in these channels
    """
    model = problem.model
    unknown = [n for n in names if n not in model.effects]
    if unknown or len(set(names)) < 2:
        what = f"no effect {', '.join(unknown)}" if unknown else "name two effects or more"
        raise ModelError(f"causes to tell apart: {what}; there are {', '.join(model.effects)}")
    hidden = [n for n in names if not testable(problem, model.effects[n])]
    if hidden:
        raise ModelError(
            f"{', '.join(hidden)} cannot show in the channels {', '.join(problem.channels)}, is of an "
            "actuator whose position is measured in every run, or is a force whose rows the vehicle file has"
        )
    effects = [model.effects[n] for n in dict.fromkeys(names)]
    bank = build_bank(problem, problem.path, [problem.environment.noise_model], effects)
    return Causes(problem, bank, tuple(e.name for e in effects), size, longest)


def evidence(goal: Causes) -> dict[str, float]:
    """Log evidence [nats] of every cause alone over no cause at all, from the readings of the posed trial."""
    total = goal.bank.total(0)
    none = posterior(total.pick(goal.bank.columns(()))).log_evidence
    return {n: posterior(total.pick(goal.bank.columns((n,)))).log_evidence - none for n in goal.names}
