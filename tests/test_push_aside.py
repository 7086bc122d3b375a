"""Beside a model form a push to one side shares what it explains better than a named cause."""

from __future__ import annotations

from dataclasses import dataclass, field
from types import SimpleNamespace as Plain

import pytest

from bayesid.diagnosis.hypotheses import push_aside
from bayesid.diagnosis.hypotheses.push_aside import with_push_aside
from bayesid.equations.model import build_model
from bayesid.errors import ModelError
from bayesid.model.vehicles import load_vehicle

PUSH = "hull_misalignment"


@dataclass(frozen=True)
class Hypotheses:
    """Those fields of a comparison that are read or changed."""

    none: Plain
    refits: tuple
    inside: dict
    probabilities: dict
    evidence: dict = field(default_factory=dict)
    sets: dict = field(default_factory=dict)
    thresholds: Plain = field(default_factory=lambda: Plain(named=4.0))

    @property
    def best(self):
        return self.refits[0]


def hypotheses(*names: str, share: float = 0.99) -> Hypotheses:
    best = Plain(effects=names, log_evidence=100.0, widens=False)
    told = dict.fromkeys(names, share) | {PUSH: 0.0, "outside": 1.0 - share}
    sets = {tuple(sorted(names)): share, ("outside",): 1.0 - share}
    return Hypotheses(Plain(log_evidence=0.0), (best,), dict(told), dict(told), {}, sets)


@pytest.fixture
def asked(monkeypatch) -> list[tuple[str, ...]]:
    """Explanations that are refitted, in their order; with a push they have 120 nats."""
    tried: list[tuple[str, ...]] = []

    def refitted(problem, names, fitted):
        tried.append(names)
        both = len(names) > problem.causes
        return Plain(effects=names, log_evidence=problem.beside if both else problem.worth, widens=False)

    monkeypatch.setattr(push_aside, "explains", lambda _: True)
    monkeypatch.setattr(push_aside, "fit_with", lambda *_: None)
    monkeypatch.setattr(push_aside, "weighted_hypothesis", refitted)
    return tried


def problem(worth: float = 120.0, form: object = "a form", beside: float = 121.0, causes: int = 1) -> Plain:
    model = build_model(load_vehicle("remus100"), 3)
    return Plain(form=form, model=model, worth=worth, beside=beside, causes=causes)


def test_a_push_that_explains_more_has_half_of_the_probability(asked):
    before = hypotheses("rudder_offset")
    found = with_push_aside(problem(), before)
    assert asked == [(PUSH,), ("rudder_offset", PUSH)]
    for table in (found.inside, found.probabilities):
        assert table["rudder_offset"] == table[PUSH] == pytest.approx(0.495)
        assert sum(table.values()) == pytest.approx(1.0)
    assert found.sets == pytest.approx({("rudder_offset",): 0.495, (PUSH,): 0.495, ("outside",): 0.01})
    assert [c.effects for c in found.refits] == [("rudder_offset",), (PUSH,)]
    assert found.best is before.best


def test_a_push_takes_the_place_of_one_cause_only(asked):
    found = with_push_aside(problem(causes=2), hypotheses("actuator_lag", "rudder_offset"))
    assert found.inside[PUSH] == pytest.approx(0.495) and found.inside["rudder_offset"] == 0.99
    assert sum(found.sets.values()) == pytest.approx(1.0)
    assert all(len(set(names)) == len(names) for names in found.sets)


def test_a_cause_is_asked_by_its_family(asked):
    """Neither less thrust nor more drag is as probable as a name asks for, both together are."""
    before = hypotheses("thrust_loss", share=0.6)
    before.inside["hull_fouling"] = 0.35
    found = with_push_aside(problem(), before)
    assert asked[0] == (PUSH,) and found.inside["thrust_loss"] == pytest.approx(0.3)


@pytest.mark.parametrize("worth", [99.0, 100.0])
def test_a_push_that_explains_less_changes_nothing(asked, worth):
    before = hypotheses("rudder_offset")
    assert with_push_aside(problem(worth), before) is before
    assert asked


def test_a_push_beside_which_the_cause_still_explains_something_is_no_rival(asked):
    """A drag that rises on the way, on a ship that one screw pushes aside: both act."""
    before = hypotheses("drag_step")
    assert with_push_aside(problem(beside=130.0), before) is before
    assert len(asked) == 2


def test_of_two_causes_the_one_in_whose_place_it_stands_shares(asked):
    found = with_push_aside(problem(causes=2), hypotheses("actuator_lag", "heading_bias"))
    # a sensor is judged by kinematics
    assert asked == [(PUSH, "heading_bias"), ("actuator_lag", "heading_bias", PUSH)]
    assert found.inside["heading_bias"] == 0.99
    assert found.inside["actuator_lag"] == found.inside[PUSH] == pytest.approx(0.495)
    assert found.sets[("heading_bias", PUSH)] == pytest.approx(0.495)


@pytest.mark.parametrize(
    ("given", "share"),
    [({"form": None}, 0.99), ({}, 0.6)],  # without a form it is a hypothesis as any other; nothing is named
)
def test_it_is_not_asked_where_no_name_rests_on_it(asked, given, share):
    before = hypotheses("rudder_offset", share=share)
    assert with_push_aside(problem(**given), before) is before
    assert not asked


def test_a_push_that_follows_nothing_is_no_rival(asked, monkeypatch):
    def lost(*_):
        raise ModelError("diverges")

    monkeypatch.setattr(push_aside, "fit_with", lost)
    before = hypotheses("rudder_offset")
    assert with_push_aside(problem(), before) is before
