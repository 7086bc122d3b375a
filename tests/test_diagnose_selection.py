"""Several effects at once: what is tried, and which explanation is kept."""

from types import SimpleNamespace

import numpy as np
import pytest

from bayesid.diagnose import problem as problems
from bayesid.diagnose import selection
from bayesid.diagnose.bank import Ambiguity

# (name, family): lag and dead are one family, wind and push too
FAMILY = {"wind": "force", "push": "force", "lag": "timing", "dead": "timing", "scale": "scale"}


def effect(name):
    return SimpleNamespace(name=name, family=FAMILY[name], smooth=True)


MODEL = SimpleNamespace(effects={n: effect(n) for n in FAMILY})
PROBLEM = SimpleNamespace(model=MODEL)


def candidate(value, *names, chi2=1.0, converged=True):
    fit = SimpleNamespace(converged=converged, chi2=chi2, points=("points of " + "+".join(names),))
    return SimpleNamespace(effects=names, log_evidence=value, fit=fit)


class Tried:
    """Stands in for a refit: looks evidence up and keeps what was asked."""

    def __init__(self, value, chi2=1.0):
        self.value, self.chi2, self.asked, self.starts = value, chi2, [], []

    def refit(self, problem, effects, say):
        names = tuple(e.name for e in effects)
        self.asked.append(frozenset(names))
        return [candidate(self.value.get(frozenset(names), 0.0), *names, chi2=self.chi2)]

    def again(self, problem, effects, start, loud, first, say):
        self.starts.append((tuple(e.name for e in effects), tuple(start)))
        return first


@pytest.fixture
def rivals():
    like = {"wind": ("push",), "push": ("wind",), "lag": ("dead", "scale"), "dead": ("lag",), "scale": ()}
    return SimpleNamespace(rivals=lambda name: like[name])


def exchanged(monkeypatch, tried, current, rivals):
    monkeypatch.setattr(selection, "refit", tried.refit)
    monkeypatch.setattr(selection, "again", tried.again)
    monkeypatch.setattr(selection, "begun", lambda problem, effects, points: points)
    return selection._exchanged(PROBLEM, [current], current, rivals, lambda text: None)


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
    monkeypatch.setattr(selection, "refit", tried.refit)
    monkeypatch.setattr(selection, "again", tried.again)
    monkeypatch.setattr(selection, "begun", lambda problem, effects, points: points)
    poor, good = candidate(900.0, "lag", chi2=4.0), candidate(300.0, "wind")
    pair = (effect("wind"), effect("lag"))
    selection._beside(PROBLEM, [poor, good], pair, lambda text: None)
    assert tried.starts == [(("wind", "lag"), ("points of wind",))]
    tried.starts.clear()
    selection._beside(PROBLEM, [poor], pair, lambda text: None)
    assert not tried.starts  # nothing explains: no better place to begin


def test_rivals_are_those_that_take_over_half_of_what_one_shows():
    detect, size = np.array([800.0, 800.0, 800.0]), 0.5
    shows = 0.5 * size**2 * detect[0]
    margin = shows * np.array([[0.0, 0.4, 0.1], [0.6, 0.0, 0.7], [0.2, 0.9, 0.0]])
    found = Ambiguity(("a", "b", "c"), detect, np.zeros(3), margin, (), size)
    assert found.rivals("a") == ("c", "b")  # most alike first
    assert found.rivals("b") == ()
    assert found.rivals("c", share=0.05) == ("a", "b")
    assert found.rivals("not in the bank") == ()


@pytest.mark.parametrize("chi2, calls", [(1.1, 2), (3.0, 1)])
def test_a_fit_that_runs_out_of_passes_close_to_the_data_goes_on_from_where_it_is(monkeypatch, chi2, calls):
    told = []

    def slow(model, logs, free, colours, start=None, loud=0.03, passes=25):
        told.append((start, loud))
        return SimpleNamespace(converged=False, passes=passes, chi2=chi2, points=["here"])

    monkeypatch.setattr(problems, "fit", slow)
    posed = SimpleNamespace(model=None, logs=(), coefficients=None, path_level=0.1, path=("path",),
                            environment=SimpleNamespace(colours=None))  # fmt: skip
    problems.fit_with(posed, ())
    assert len(told) == calls
    assert told[0] == (["path"], 0.1)
    assert told[1:] == [(["here"], 0.0)] * (calls - 1)
