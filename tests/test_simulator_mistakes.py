"""Mends of the table undo mistakes written by hand; only a mend that leaves no cause to look for is named."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest

from bayesid.diagnosis.events_counted import verdict_of
from bayesid.diagnosis.exclusions import compare_without
from bayesid.diagnosis.simulator import find_mistakes, judge
from bayesid.diagnosis.simulator.judge import Left, shifted
from bayesid.diagnosis.simulator.mending import mended_model, mended_prior, numbers_of
from bayesid.diagnosis.simulator.table import MISTAKES, Change, SimulatorMistake
from bayesid.diagnosis.simulator_words import mistake_sentence
from bayesid.equations.model import Model, build_model
from bayesid.errors import ModelError
from bayesid.estimation.filter_error.evidence import normal_equations, posterior
from bayesid.estimation.filter_error.noise_identification import NoiseIdentification
from bayesid.estimation.filter_error.noise_model import NoiseModel
from bayesid.estimation.parameters import NO_PARAMETERS, coefficient_prior
from bayesid.model.vehicles import Vehicle, load_vehicle, with_relative_prior
from studies.log_mistakes.campaigns import PRIOR_SD, VEHICLES, campaign
from studies.simulator_mistakes.plant import planted

NOTHING = Left()
BY_NAME = {m.name: m for m in MISTAKES}
# sizes planted -> size of the mend
SIZES = {
    "another length (1.06)": 1.06, "another length (0.9)": 0.9, "all coefficients halved": 2.0,
    "moments about x = 0.05 L": 0.05, "moments about x = -0.03 L": -0.03,
    "centre of buoyancy 0.005 L forward": -0.005,
}  # fmt: skip
# what is dropped is not known again
OPEN = ("no cross terms", "no cross terms but potential flow")


def _model(vehicle: Vehicle, dof: int) -> Model:
    return build_model(with_relative_prior(vehicle, PRIOR_SD), dof)


@pytest.mark.parametrize("name", VEHICLES)
@pytest.mark.parametrize("row", planted(), ids=lambda row: row.name)
def test_the_mend_undoes_a_mistake_written_by_hand(name: str, row) -> None:
    right = load_vehicle(name)
    wrong = row.change(right)
    if wrong is None or wrong == right or row.name in OPEN:
        pytest.skip("nothing to undo here, or of a size the file does not tell")
    wanted, given = _model(right, 6), _model(wrong, 6)
    change = BY_NAME[row.right[0]].mend(numbers_of(given), SIZES.get(row.name, 1.0))
    assert change is not None
    # U_ref is no number of the file: it follows from the drag
    rows = [i for n, i in wanted.index.items() if n != "U_ref"]
    got = mended_model(given, change).nominal
    scale = np.maximum(np.abs(wanted.nominal[rows]), np.abs(given.nominal[rows]))
    assert np.all(np.abs(got[rows] - wanted.nominal[rows]) <= 1e-6 * np.maximum(scale, 1e-12))


def test_no_mistake_changes_a_number_it_does_not_name() -> None:
    model = _model(load_vehicle("remus100"), 6)
    for mistake in MISTAKES:
        change = mistake.mend(numbers_of(model), mistake.sizes[0])
        if change is None:
            continue
        moved = np.flatnonzero(mended_model(model, change).nominal != model.nominal)
        assert {model.kernel.parameters[i] for i in moved} <= set(change.values)


def test_equations_of_another_prior_give_its_evidence() -> None:
    rng = np.random.default_rng(3)
    columns, resid = rng.standard_normal((40, 4)), rng.standard_normal(40)
    delta, scale = rng.standard_normal(4), np.array([0.5, 2.0, 1.0, 0.0])
    ours = posterior(shifted(normal_equations(resid, columns, 0.3, 40), delta, scale)).log_evidence
    covariance = np.eye(40) + (columns * scale**2) @ columns.T
    off = resid - columns @ delta
    _, logdet = np.linalg.slogdet(covariance)
    dense = -0.5 * (off @ np.linalg.solve(covariance, off) + logdet + 0.3 + 40 * np.log(2 * np.pi))
    assert ours == pytest.approx(dense, rel=1e-12)


def test_a_mended_coefficient_keeps_its_relative_deviation() -> None:
    model = _model(load_vehicle("remus100"), 3)
    stated = coefficient_prior(model)
    i = stated.names.index("N_v")
    mean, sd = mended_prior(stated, NO_PARAMETERS, Change({"N_v": 3.0 * float(stated.mean[i])}))
    assert sd[i] / abs(mean[i]) == pytest.approx(PRIOR_SD)
    assert np.delete(mean, i) == pytest.approx(np.delete(stated.mean, i))


@pytest.mark.parametrize(
    ("left", "wanted"),
    [
        ((NOTHING, NOTHING, NOTHING), (0, 1)),  # the third lies too far behind
        ((NOTHING, Left(50.0), NOTHING), (0,)),
        ((NOTHING, None, NOTHING), (0,)),
        ((NOTHING, Left(50.0, ("rudder_offset",)), NOTHING), (0,)),  # not alike: it needs a cause besides
        ((Left(50.0), NOTHING, NOTHING), ()),
        ((Left(50.0, ("rudder_offset",)), NOTHING, NOTHING), (0,)),
    ],
)
def test_an_alternative_that_leaves_a_gap_is_not_listed(monkeypatch, left, wanted) -> None:
    """Evidence 100, 98 and 90 nats; what each mend leaves is given. A cause that is named is no gap."""
    model = _model(load_vehicle("remus100"), 3)
    value = float(model.nominal[model.index["N_v"]])
    changes = [Change({"N_v": value * factor}) for factor in (2.0, 3.0, 4.0)]
    tried = [judge.Screened(m, 1.0, c, 50.0, 0.0) for m, c in zip(MISTAKES, changes, strict=False)]
    evidence = dict(zip(map(id, tried), (100.0, 98.0, 90.0), strict=True))
    fitted = [factor * value for factor in (6.0, 7.0, 8.0)]
    rest = dict(zip(fitted, left, strict=True))
    monkeypatch.setattr(judge, "_worth", lambda *_: tried)
    numbers = dict(zip(map(id, tried), fitted, strict=True))
    said = {key: judge.Mended(nats, {"N_v": numbers[key]}) for key, nats in evidence.items()}
    monkeypatch.setattr(judge, "mended_evidence", lambda model, trial, s, *_: said[id(s)])
    monkeypatch.setattr(judge, "mended_model", lambda model, change: change)
    # what is left is asked of the numbers the log gives to rows that a mend leaves free
    monkeypatch.setattr(judge, "left_over", lambda change, *_: rest[change.values["N_v"]])
    none = SimpleNamespace(log_evidence=0.0, widens=False, effects=())
    comparison = SimpleNamespace(none=none, refits=[], thresholds=SimpleNamespace(named=3.0))
    compared = SimpleNamespace(problem=SimpleNamespace(model=model, outliers=()), candidates=comparison)
    found = find_mistakes(None, compared, SimpleNamespace(word="effect"))
    assert [f.name for f in found] == [MISTAKES[k].name for k in wanted]
    assert all(f.beside == left[0].effects for f in found)
    assert sum(f.probability for f in found) == pytest.approx(1.0 if wanted else 0.0)
    for k, f in zip(wanted, found, strict=True):  # and told with them
        assert f.numbers["N_v"] * model.file_scale("N_v") == pytest.approx(fitted[k])


@pytest.mark.parametrize(
    ("cause", "wide", "told"),
    [
        (80.0, -np.inf, False),  # named
        (80.0, 95.0, True),  # five nats over wider coefficients: either
        (80.0, 98.0, None),  # two: nothing is told
        (95.0, -np.inf, None),  # a cause says nearly as much
    ],
)
def test_what_wider_coefficients_explain_nearly_as_well_is_listed_as_either(
    monkeypatch, cause, wide, told
) -> None:
    """A mended simulator of 100 nats beside the best cause and the best wider prior."""
    model = _model(load_vehicle("remus100"), 3)
    value = float(model.nominal[model.index["N_v"]])
    tried = judge.Screened(MISTAKES[0], 1.0, Change({"N_v": 2.0 * value}), 50.0, 0.0)
    monkeypatch.setattr(judge, "_worth", lambda *_: [tried])
    monkeypatch.setattr(judge, "mended_evidence", lambda *_: judge.Mended(100.0, {}))
    monkeypatch.setattr(judge, "left_over", lambda *_: NOTHING)
    none = SimpleNamespace(log_evidence=0.0, widens=False, effects=())
    refits = [
        SimpleNamespace(log_evidence=cause, widens=False, effects=("rudder_offset",)),
        SimpleNamespace(log_evidence=wide, widens=True, effects=("coefficient_error:N_v",)),
    ]
    comparison = SimpleNamespace(none=none, refits=refits, thresholds=SimpleNamespace(named=3.0))
    compared = SimpleNamespace(problem=SimpleNamespace(model=model, outliers=()), candidates=comparison)
    found = find_mistakes(None, compared, SimpleNamespace(word="coefficients"))
    assert [f.or_coefficients for f in found] == ([] if told is None else [told])
    sentence = mistake_sentence(SimpleNamespace(simulator=found))
    assert ("coefficients further off than stated" in sentence) is bool(told)


@pytest.mark.parametrize(
    ("mended", "before", "follows", "told"),
    [
        (7.5, 3.2, True, False),  # a tether taken for another length: two coefficients went 6 and 7 sd off
        (3.1, 0.5, True, True),  # no further than one of many does by chance
        (7.5, 9.0, True, True),  # nearer than without the mend
        (7.5, 3.2, False, True),  # nothing else follows the log: there is nothing to set it against
    ],
)
def test_a_mend_that_takes_coefficients_away_from_their_values_is_not_told(
    monkeypatch, mended, before, follows, told
) -> None:
    model = _model(load_vehicle("remus100"), 3)
    stated = coefficient_prior(model)
    value = float(model.nominal[model.index["N_v"]])
    change = Change({"N_v": 2.0 * value})
    behind = Change({"N_v": 3.0 * value})
    tried = [judge.Screened(m, 1.0, c, 50.0, 0.0) for m, c in zip(MISTAKES, (change, behind), strict=False)]
    said = dict(zip(map(id, tried), (judge.Mended(100.0, {}, mended), judge.Mended(99.0, {})), strict=True))
    monkeypatch.setattr(judge, "_worth", lambda *_: tried)
    monkeypatch.setattr(judge, "mended_evidence", lambda model, trial, s, *_: said[id(s)])
    monkeypatch.setattr(judge, "left_over", lambda *_: NOTHING)
    monkeypatch.setattr(judge, "explains", lambda _: follows)
    moved = stated.mean.copy()
    moved[stated.names.index("N_r")] += before * stated.sd[stated.names.index("N_r")]
    fit = SimpleNamespace(values=moved, free=stated)
    none = SimpleNamespace(log_evidence=0.0, widens=False, effects=(), fit=fit)
    limits = SimpleNamespace(named=3.0, conflict=3.4)
    problem = SimpleNamespace(model=model, stated=stated)
    compared = SimpleNamespace(
        problem=problem, candidates=SimpleNamespace(none=none, refits=[], thresholds=limits)
    )
    found = find_mistakes(None, compared, SimpleNamespace(word="model_form"))
    # nor is what lies behind it, for want of the right one
    assert [f.name for f in found] == ([m.name for m in MISTAKES[:2]] if told else [])


def test_a_row_that_a_mend_leaves_free_is_in_no_conflict() -> None:
    stated = coefficient_prior(_model(load_vehicle("remus100"), 3))
    moved = stated.mean + 2.0 * stated.sd
    moved[stated.names.index("N_v")] -= 9.0 * stated.sd[stated.names.index("N_v")]
    problem = SimpleNamespace(stated=stated)
    found = SimpleNamespace(fit=SimpleNamespace(values=moved, free=stated))
    assert judge.conflict(problem, found) == pytest.approx(7.0)
    assert judge.conflict(problem, found, {"N_v": 1.0}) == pytest.approx(2.0)
    # of a wider prior, as of a model form, no move of these is a conflict
    wide = SimpleNamespace(fit=SimpleNamespace(values=moved, free=replace(stated, sd=10.0 * stated.sd)))
    assert judge.conflict(problem, wide) == pytest.approx(0.7)


@pytest.mark.parametrize("first", ["effect", "coefficient"])
def test_a_mend_is_also_tried_beside_an_effect_that_goes_before_a_coefficient(monkeypatch, first) -> None:
    """The best explanation may be an effect though a single coefficient of a wide prior has more evidence."""
    monkeypatch.setattr(judge, "_worth", lambda *_: [judge.Screened(MISTAKES[0], 1.0, Change({}), 50.0, 0.0)])
    tried = []
    monkeypatch.setattr(judge, "mended_evidence", lambda *given: tried.append(given[-1]))
    effect = SimpleNamespace(log_evidence=12.0, widens=False, effects=("rudder_offset",))
    wide = SimpleNamespace(log_evidence=14.0, widens=True, effects=("coefficient_error:N_v",))
    refits = [effect, wide] if first == "effect" else [wide, effect]
    none = SimpleNamespace(log_evidence=0.0, widens=False, effects=())
    compared = SimpleNamespace(problem=None, candidates=SimpleNamespace(none=none, refits=refits))
    assert find_mistakes(None, compared, SimpleNamespace(word="effect")) == ()
    assert tried == [effect.effects if first == "effect" else ()]


def test_a_mended_simulator_reads_what_the_explanations_it_is_compared_with_read(monkeypatch) -> None:
    asked = []

    def built(model, trial, **given):
        asked.append(given)
        raise ModelError("enough")

    monkeypatch.setattr(judge, "build_problem", built)
    monkeypatch.setattr(judge, "mended_model", lambda model, change: model)
    outliers = (("r1", 12.0, "psi"),)
    problem = SimpleNamespace(model=None, events=("jam",), outliers=outliers)
    tried = judge.Screened(MISTAKES[0], 1.0, Change({}), 50.0, 0.0)
    assert judge.mended_evidence(problem, None, tried, None) is None
    assert asked == [{"as_built": None, "events": ("jam",), "outlying": outliers, "seek_outliers": False}]


def test_a_mistake_whose_mend_no_equations_can_weigh_does_not_change_the_order_of_the_others(
    monkeypatch,
) -> None:
    """Rates in degrees leave readings so far off that rounding takes all evidence: no gain, not one that
    compares with none of the others."""
    model = _model(load_vehicle("remus100"), 3)
    stated = coefficient_prior(model)
    value = float(stated.mean[stated.names.index("N_v")])
    tried = [
        SimulatorMistake(name, "", lambda numbers, size: Change({"N_v": size * value}), (1.0 + k,))
        for k, name in enumerate(("behind", "not weighed", "ahead"), start=1)
    ]
    nothing = normal_equations(np.zeros(1), np.zeros((1, len(stated.names))), 0.0, 1)
    none = posterior(nothing).log_evidence
    evidence = iter([none + 5.0, -np.inf, none + 9.0])
    monkeypatch.setattr(judge, "MISTAKES", tuple(tried))
    monkeypatch.setattr(judge, "_equations", lambda *_: [nothing])
    monkeypatch.setattr(judge, "_log_evidence", lambda _: next(evidence))
    found = judge.screened(SimpleNamespace(problem=SimpleNamespace(model=model, stated=stated)))
    assert [s.mistake.name for s in found] == ["ahead", "behind"]


@pytest.mark.parametrize(
    ("source", "again", "effects", "evidence"),
    [
        ("measured", True, (), 140.0),
        ("measured", False, (), 100.0),  # in the sea of the straight runs, as the explanations are
        ("assumed", True, (), 100.0),  # measured anew with the mended simulator
        ("assumed", True, ("ocean_current",), 140.0),  # and without the effect
    ],
)
def test_a_mend_is_weighed_in_a_quieter_sea_where_the_explanations_are(
    monkeypatch, source, again, effects, evidence
) -> None:
    """Process noise that straight runs overestimate costs a mended simulator 40 nats."""

    @dataclass(frozen=True)
    class Problem:
        environment: NoiseIdentification
        model: object = None
        events: tuple = ()
        outliers: tuple = ()
        stated: object = NO_PARAMETERS

    loud, quiet = (NoiseModel((f, f, f), 1.0, 0.0, 1.0) for f in (8.0, 1.0))
    measured = NoiseIdentification(loud, source, 0.5)
    monkeypatch.setattr(judge, "build_problem", lambda *_, **given: Problem(measured))
    monkeypatch.setattr(judge, "mended_model", lambda model, change: model)
    monkeypatch.setattr(
        judge, "noise_beside", lambda fit, noise, louder: (quiet if not louder else loud, 50.0)
    )

    def best(problem, beside):
        nats = 140.0 if problem.environment.noise_model is quiet else 100.0
        return SimpleNamespace(
            log_evidence=nats, effects=effects, fit=SimpleNamespace(free=NO_PARAMETERS, values=np.zeros(0))
        )

    monkeypatch.setattr(judge, "_best_of", best)
    asked = Problem(NoiseIdentification(quiet, source, 0.5, again=again))
    tried = judge.Screened(MISTAKES[0], 1.0, Change({}), 50.0, 0.0)
    assert judge.mended_evidence(asked, None, tried, None).log_evidence == evidence


@pytest.mark.parametrize(
    ("follows", "wanted"),
    [
        ((False, True), "abcde"),  # what gains without the effect stands for it
        ((True, True), "abc"),  # an effect that is not needed to follow the log
        ((False, False), "abc"),  # one that does not follow it either
    ],
)
def test_mistakes_are_sought_beside_a_large_effect_too(monkeypatch, follows, wanted) -> None:
    def found(names: str, gain: float) -> list:
        return [judge.Screened(SimpleNamespace(name=n), 1.0, Change({}), gain, 0.0) for n in names]

    none = SimpleNamespace(log_evidence=0.0, widens=False, effects=())
    best = SimpleNamespace(log_evidence=900.0, widens=False, effects=("ocean_current",))
    candidates = SimpleNamespace(none=none, refits=[best], best=best)
    compared = SimpleNamespace(problem=SimpleNamespace(form="a form"), candidates=candidates)
    lists = {None: found("abcx", 700.0), best.effects: found("cdey", 50.0)}
    monkeypatch.setattr(judge, "screened", lambda of, leading=None: lists[leading and leading.effects])
    monkeypatch.setattr(judge, "explains", lambda c: follows[c is best])
    assert "".join(s.mistake.name for s in judge._worth(compared)) == wanted


@pytest.mark.slow
@pytest.mark.parametrize("name", ["Munk moment missing", "all coefficients halved", "nothing"])
def test_a_mistaken_simulator_is_named_and_a_right_simulator_is_not(name: str) -> None:
    right = load_vehicle("remus100")
    trial = campaign("remus100", 5, step=0.2)
    row = next((r for r in planted() if r.name == name), None)
    model = _model(right if row is None else row.change(right), 3)
    compared = compare_without(model, trial)
    verdict = verdict_of(compared)
    found = [f.name for f in find_mistakes(trial, compared, verdict)]
    assert found[:1] == ([] if row is None else [row.right[0]])
