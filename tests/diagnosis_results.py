"""A diagnosis of plain values with no fit behind it, and its parts with other numbers: for tests of views."""

from dataclasses import replace

import numpy as np

from bayesid.diagnosis.data.event import Event
from bayesid.diagnosis.evidence.effect_draws import DensityCheck, EffectDraws, ParameterDraws
from bayesid.diagnosis.evidence.holdout import HoldoutValidation, HorizonError
from bayesid.diagnosis.evidence.missing_force import MissingForce, MissingForceTerm
from bayesid.diagnosis.final_values import gap_of
from bayesid.diagnosis.hypotheses.thresholds import Thresholds
from bayesid.diagnosis.next_manoeuvre import Proposal
from bayesid.diagnosis.result import Result
from bayesid.diagnosis.result_parts import (
    Coefficient,
    Corner,
    Detectability,
    Diagnosed,
    Drawings,
    Effect,
    Estimate,
    Force,
    Location,
    Noise,
    Outlier,
    Refit,
    Region,
    Screened,
    Value,
)

MODELS = ("nominal", "recalibrated", "with effect")


def a_horizon(name="6 L/U", before=12.0, after=0.5, significant=True, shrink=0.96, seconds=9.0):
    excess = {"nominal": 30.0, "recalibrated": before, "with effect": after}
    rows = {m: {"psi": 0.1, "z": float("nan")} for m in excess}
    return HorizonError(name, seconds, excess, shrink, (0.9, 0.98), significant, 1.1, rows, rows, 4, 16)


def a_gap(*horizons):
    return gap_of(HoldoutValidation(horizons, ("r2",) if horizons else ()))


def draws(agrees=False, ratio=0.38, force=-1.13, converged=True, rough=0.01, between=0.02):
    """Draws of a wind, a coefficient and the amplitude of the environment."""

    def parameter(mean, sd_over_laplace=1.0):
        return ParameterDraws(mean, 0.01, mean - 0.06, mean + 0.06, sd_over_laplace, 0.0)

    parameters = {"wind.V": parameter(0.1, ratio), "N_v": parameter(-20.0), "log force": parameter(force)}
    check = DensityCheck(3, (0.0, 0.1, 0.2), rough, between, {"force": (0.5, 2.0)})
    return EffectDraws(parameters, agrees, converged, ("short",), -12.0, 0.05, check)


DESCRIPTION = MissingForce(
    (MissingForceTerm("Y_vv", "Y", "v*abs(v)", True, -3.0, 0.2, "kg/m", 0.9, 20.0, ("Y_rr",)),),
    20.0, None, {"Y": 0.8}, ("Y_vv",), ("The missing force in Y goes as v abs(v).",),
)  # fmt: skip

_T = np.linspace(0.0, 9.0, 10)
DRAWINGS = Drawings(
    Force(("X", "Y", "N"), ("r1",), (_T,), (np.tile(np.sin(_T)[:, None], 3),), (np.full((10, 3), 0.1),)),
    ("wind", "ocean_current"),
    np.array([[50.0, 2.0], [3.0, 40.0]]),
    Corner(("V", "N_v / nominal"), *np.random.default_rng(0).standard_normal((2, 400, 2))),
)

RESULT = Result(
    format=1, bayesid="0",
    trial=Diagnosed("pond", "ab", 3, ("x", "psi"), "remus100", "ef", "Data of a pond."),
    model="cd", seed=0, verdict="effect",
    effects=(
        Effect("wind", 0.97, {"V_wind": Value(5.0, 0.5, "m/s")}, {"V_wind": "its speed"}, "0 to 10 m/s"),
    ),
    probabilities={"none": 0.0, "wind": 0.97, "outside": 0.03},
    acting={"none": 0.0, "wind": 0.97, "outside": 0.03}, set95=("wind",),
    unseen=(), hidden_by_coefficients=(), reasons=("it gains -0.0 nats",), rule="effect",
    thresholds=Thresholds(3.5, 12.7, 2.6, 2000), screen=(Screened("wind", 50.0), Screened("gyro_bias", 1.0)),
    refits=(
        Refit((), 0.0, 4.0, True, {}), Refit(("wind",), 50.0, 1.0, True, {"wind.V_wind": Estimate(5.0, 0.5)}),
    ),
    explanation=("wind",), ambiguity_groups=(("wind", "ocean_current"),), ambiguity_size=0.3,
    detectability={"wind": Detectability(300.0, 0.2), "ocean_current": Detectability(200.0, 0.1)},
    where=Location(
        "psi", {"psi": 30.0, "Y": 15.0}, None, (Region("r1", 3.0, "window", 0.5),), (), {"Y": 0.1}
    ),
    gap=a_gap(a_horizon()),
    measures=(
        {"run": "r2", "name": "advance", "unit": "m", "logged": 9.0} | dict.fromkeys(MODELS, 8.0),
    ),
    events=(Event("r1", 1.0, 2.0, "psi", "sensor", 12.0),), outliers=(Outlier("r1", 3.0, "r"),),
    posterior=draws(), description=DESCRIPTION,
    environment=Noise("measured", (1.0, 1.0, 1.0), 2.0, 0.1, 30.0, None, (0.0,)),
    coefficients={"N_r": Coefficient(-0.1, 0.01)}, model_form=None,
    next_manoeuvre=(Proposal("zigzag", 60.0, 1.0, 9.0),),
    warnings=("no straight run",), drawings=DRAWINGS,
)  # fmt: skip


def a_result(word="effect", named=("wind",), best=("wind",), gain=50.0, free=30.0, channel="psi", **others):
    """`RESULT` with another verdict, best explanation and evidence."""
    refit = Refit(best, gain, 1.0, True, {})
    return replace(
        RESULT,
        verdict=word,
        effects=tuple(Effect(n, 0.97, {}) for n in named),
        refits=(RESULT.refits[0], *((refit,) if best else ())),
        explanation=best if gain > 0 else (),
        where=replace(RESULT.where, channel=channel, evidence={"psi": free, "Y": free / 2}),
        **others,
    )
