"""Several effects at once: what is tried, and which explanation is kept."""

from types import SimpleNamespace

import numpy as np
import pytest

from bayesid.diagnosis.data import problem as problems
from bayesid.diagnosis.hypotheses import search
from bayesid.diagnosis.hypotheses.sensitivity_bank import Isolability
from bayesid.errors import ModelError

# (name, family): lag and dead are one family, wind and push too
FAMILY = {"wind": "force", "push": "force", "lag": "timing", "dead": "timing", "scale": "scale"}


def effect(name):
    return SimpleNamespace(name=name, family=FAMILY[name], smooth=True)


MODEL = SimpleNamespace(effects={n: effect(n) for n in FAMILY})
PROBLEM = SimpleNamespace(model=MODEL)


def candidate(value, *names, chi2=1.0, converged=True):
    points = ("points of " + "+".join(names),)
    fit = SimpleNamespace(converged=converged, chi2=chi2, points=points, followed=points)
    return SimpleNamespace(effects=names, log_evidence=value, fit=fit)


class Tried:
    """Stands in for a refit: looks evidence up and keeps what was asked."""

    def __init__(self, value, chi2=1.0):
        self.value, self.chi2, self.asked, self.starts = value, chi2, [], []

    def refit(self, problem, effects, notify, sizes=None, smaller=None, promised=np.inf):
        names = tuple(e.name for e in effects)
        self.asked.append(frozenset(names))
        return [candidate(self.value.get(frozenset(names), 0.0), *names, chi2=self.chi2)]

    def again(self, problem, effects, start, initial_noise_scale, first, notify):
        self.starts.append((tuple(e.name for e in effects), tuple(start)))
        return first


@pytest.fixture
def rivals():
    like = {"wind": ("push",), "push": ("wind",), "lag": ("dead", "scale"), "dead": ("lag",), "scale": ()}
    return SimpleNamespace(rivals=lambda name: like[name])


def exchanged(monkeypatch, tried, current, rivals):
    monkeypatch.setattr(search, "refit", tried.refit)
    monkeypatch.setattr(search, "refit_again", tried.again)
    monkeypatch.setattr(search, "first_fit", lambda problem, effects, points: points)
    return search._exchanged(PROBLEM, [current], current, rivals, lambda text: None)


def test_alike_effects_change_places_until_nothing_is_gained(monkeypatch, rivals):
    value = {("push", "lag"): 400.0, ("wind", "dead"): 50.0, ("push", "dead"): 900.0}
    tried = Tried({frozenset(k): v for k, v in value.items()})
    refits, best = exchanged(monkeypatch, tried, candidate(100.0, "wind", "lag"), rivals)
    assert set(best.effects) == {"push", "dead"}  # two exchanges away
    assert len(tried.asked) == len(set(tried.asked))  # nothing twice
    assert frozenset(("wind", "lag")) not in tried.asked
    assert {frozenset(c.effects) for c in refits} >= set(tried.asked)


def test_two_of_one_family_are_never_put_together(monkeypatch):
    every = SimpleNamespace(rivals=lambda name: tuple(n for n in FAMILY if n != name))
    tried = Tried({})
    exchanged(monkeypatch, tried, candidate(100.0, "wind", "lag"), every)
    assert tried.asked
    for names in tried.asked:
        assert len({FAMILY[n] for n in names}) == len(names)


def test_an_exchange_that_does_not_explain_the_data_is_not_made(monkeypatch, rivals):
    tried = Tried({frozenset(("push", "lag")): 1e6}, chi2=5.0)
    _, best = exchanged(monkeypatch, tried, candidate(100.0, "wind", "lag"), rivals)
    assert set(best.effects) == {"wind", "lag"}


def test_a_pair_that_does_not_arrive_starts_once_more_from_the_part_that_does(monkeypatch):
    tried = Tried({}, chi2=5.0)
    monkeypatch.setattr(search, "refit", tried.refit)
    monkeypatch.setattr(search, "refit_again", tried.again)
    monkeypatch.setattr(search, "first_fit", lambda problem, effects, points: points)
    poor, good = candidate(900.0, "lag", chi2=4.0), candidate(300.0, "wind")
    pair = (effect("wind"), effect("lag"))
    search._beside(PROBLEM, [poor, good], pair, lambda text: None)
    assert tried.starts == [(("wind", "lag"), ("points of wind",))]
    tried.starts.clear()
    search._beside(PROBLEM, [poor], pair, lambda text: None)
    assert not tried.starts  # nothing explains: no better place to begin


def test_rivals_are_those_that_take_over_half_of_what_one_shows():
    detect, size = np.array([800.0, 800.0, 800.0]), 0.5
    shows = 0.5 * size**2 * detect[0]
    margin = shows * np.array([[0.0, 0.4, 0.1], [0.6, 0.0, 0.7], [0.2, 0.9, 0.0]])
    found = Isolability(("a", "b", "c"), detect, np.zeros(3), margin, (), size)
    assert found.rivals("a") == ("c", "b")  # most alike first
    assert found.rivals("b") == ()
    assert found.rivals("c", share=0.05) == ("a", "b")
    assert found.rivals("not in the bank") == ()


def forward(monkeypatch, gain, free, rivals):
    """Names `several` keeps where a second effect gains `gain` and a free force `free`."""
    tried = Tried({frozenset(("wind",)): 100.0, frozenset(("wind", "lag")): 100.0 + gain,
                   frozenset(("push", "lag")): 150.0 + gain})  # fmt: skip
    left = SimpleNamespace(outside=free, base=0.0)
    bank = SimpleNamespace(name="lag", gain=50.0)
    fakes = {"refit": tried.refit, "refit_again": tried.again, "first_fit": lambda p, e, points: points,
             "build_bank": lambda *a: None, "levels_between": lambda *a: [], "screen": lambda b: [bank],
             "_joint": lambda *a: None, "remainder": lambda *a: left}  # fmt: skip
    for name, fake in fakes.items():
        monkeypatch.setattr(search, name, fake)
    monkeypatch.setattr(search, "MOST_EFFECTS", 2)
    first = candidate(100.0, "wind")
    every = [effect(n) for n in FAMILY]
    refits, _ = search.search_several(PROBLEM, [first], first, every, rivals, lambda text: None)
    return set(refits[0].effects)


def test_a_second_effect_must_gain_half_of_what_a_free_force_does_and_is_then_exchanged(monkeypatch, rivals):
    assert forward(monkeypatch, 60.0, 100.0, rivals) == {"push", "lag"}
    assert forward(monkeypatch, 40.0, 100.0, rivals) == {"wind"}


def outcome(chi2, converged=False, iterations=25):
    return SimpleNamespace(
        converged=converged, iterations=iterations, chi2=chi2, points=["here"], log_evidence=-10.0
    )


NEAR, FAR, HOME = outcome(1.1), outcome(3.0), outcome(1.0, converged=True)


@pytest.mark.parametrize(
    "first, second, kept, calls, worth",
    [
        (NEAR, HOME, HOME, 2, -20.0),
        (NEAR, HOME, NEAR, 1, 0.0),  # what cannot be the answer any more does not go on
        (NEAR, FAR, NEAR, 2, -20.0),  # what went astray is not taken
        (NEAR, ModelError("lost"), NEAR, 2, -20.0),
        (FAR, HOME, FAR, 1, -20.0),
        (HOME, HOME, HOME, 1, -20.0),
        (outcome(float("nan")), HOME, None, 1, -20.0),
    ],
)
def test_a_fit_that_runs_out_of_passes_near_the_data_goes_on_once(
    monkeypatch, first, second, kept, calls, worth
):
    told = []

    def slow(model, logs, free, noise_model, start=None, initial_noise_scale=0.03, iterations=25):
        told.append((start, initial_noise_scale))
        out = (first, second)[len(told) - 1]
        if isinstance(out, Exception):
            raise out
        return out

    monkeypatch.setattr(problems, "fit", slow)
    posed = SimpleNamespace(model=None, logs=(), coefficients=None, path_level=0.1, path=("path",),
                            environment=SimpleNamespace(noise_model=None))  # fmt: skip
    found = problems.fit_with(posed, (), worth=worth)
    assert found is (kept or first)
    assert told == [(["path"], 0.1), (["here"], 0.0)][:calls]
