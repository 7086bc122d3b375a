"""What is compared, and in which order: fits, screen, refits, remainder, weights; no fit is made.

Thresholds are those of the table: 5 nats to add, 20 that two linearisations may differ by, chi-square 1.5 to
follow the data and 25 not to follow it at all, 3 nats from which a remainder shows.
"""

from dataclasses import dataclass, replace
from types import SimpleNamespace as Plain

import numpy as np
import pytest

from bayesid.diagnosis.hypotheses import comparison

EFFECTS = tuple(Plain(name=n, where=(n, "everywhere")) for n in ("wind", "lag", "faint"))


def hypothesis(value, *effects, chi2=1.0, converged=True):
    """A refit; those with a wide prior on a coefficient are written "coefficient_error:N_r"."""
    points = [f"points of {effects}"]
    fit = Plain(converged=converged, chi2=chi2, points=points, par=np.arange(4.0) + value, equations=())
    return Plain(
        effects=effects, log_evidence=value, fit=fit,
        widens=bool(effects) and effects[0].startswith("coefficient_error"),
    )  # fmt: skip


def located(best=8.0, outside=0.0, base=0.0, kept="kept"):
    return Plain(
        places=(Plain(evidence=best), Plain(evidence=1.0)),
        outside=outside,
        base=base,
        kept=lambda after: kept,
    )


OWN_PATH = Plain(par=np.zeros(4))  # of the data, parameters at nominal
FIT = Plain(points=["points of the fit"])


class World:
    """Stands in for everything `compare` calls; keeps what it was called with.

    Parameters
    ----------
    none : without any effect
    refits : of the shortlist; `wide` of coefficients
    gains : of the screen
    """

    def __init__(self, monkeypatch, none, refits=(), wide=(), gains=None, where=None, after=None, excess=1.0):
        self.none, self.seen, self.gains = none, {}, gains or {"wind": 60.0, "lag": 20.0}
        self.where, self.after = where or located(), after or located(4.0)
        self.again, self.plainer = hypothesis(-999.0), []
        fakes = {
            "weighted_hypothesis": self._weighted,
            "fit_with": lambda problem, effects, **more: self._kept("fit_with", more, FIT),
            "fit_without": lambda problem: self._kept("fit_with", {}, FIT),
            "testable": lambda problem, effect: effect.name != "faint",
            "build_bank": lambda problem, points, levels, effects: self._kept(
                "build_bank", (points, levels, [e.name for e in effects]), "bank"
            ),
            "levels_between": lambda problem, level: level,
            "screen": lambda bank: [Plain(name=n, gain=g) for n, g in self.gains.items()],
            "standing_for": lambda problem, bank, fitted, leaves, least: (),
            "isolability": lambda bank: "alike",
            "tried": lambda problem: 7,
            "thresholds": lambda bank, tried, seed: self._kept(
                "thresholds", (tried, seed), Plain(named=3.0, remainder=12.0, conflict=3.0)
            ),
            "locate": lambda problem, points, free: self._kept("locate", points, self.where),
            "widened": lambda bank, names: {w.effects[0]: 1.0 for w in wide},
            "shortlist": lambda scores: scores,
            "refit_screened": lambda problem, bank, score, notify, none: [
                r for r in refits if r.effects[0] == score.name
            ],
            "likely_coefficients": lambda wide_, scores: [w.effects[0] for w in wide],
            "refit_wide": lambda problem, name, notify, none, promised: [
                w for w in wide if w.effects[0] == name
            ],
            "checked": self._checked,
            "search_several": self._several,
            "in_plainer_form": lambda problem, refits, effects, notify: self.plainer,
            "remainder": lambda problem, candidate: self._kept("remainder", candidate.effects, self.after),
            "evidences": lambda problem, none, refits, scores, wide_, where: self._kept(
                "evidences", (none, [r.effects for r in refits]), {"wind": 1.0, "outside": 0.5}
            ),
            "excess_where_apart": lambda equations, k: excess,
            "probabilities": self._probabilities,
            "replace": lambda point, par: (point, tuple(par)),
        }  # fmt: skip
        for name, fake in fakes.items():
            monkeypatch.setattr(comparison, name, fake)
        self.joint, self.left = [], {}

    def _kept(self, name, value, gives):
        self.seen.setdefault(name, []).append(value)
        return gives

    def _weighted(self, problem, effects, fit):
        first = "weighted" not in self.seen
        return self._kept("weighted", fit, self.none if first else self.again)

    def _checked(self, problem, candidate, none, gains):
        return self._kept("checked", (candidate.effects, none.log_evidence, gains), candidate)

    def _several(self, problem, refits, first, effects, alike, notify, left):
        self._kept("several", (first.effects, [r.effects for r in refits]), None)
        return [*refits, *self.joint], self.left | left

    def _probabilities(self, evidence, refits, none, where, excess, left, places, error):
        self._kept("weights", (excess, left, places), None)
        return Plain(shared={"none": 1.0}, inside={"none": 1.0}, sets={("none",): 1.0})

    def run(self, base=None):
        coefficients = Plain(names=("a", "b"), where=np.array([1, 2]))
        problem = Plain(
            model=Plain(kernel=Plain(effects=EFFECTS)), path=[OWN_PATH], path_level=0.02,
            coefficients=coefficients, stated=coefficients, form=None,
        )  # fmt: skip
        return comparison.compare(problem, seed=3, base=base)

    @property
    def left_by(self):
        return self.seen["weights"][-1][1]


def test_a_fit_without_effects_that_explains_is_where_the_screen_is_taken(monkeypatch):
    world = World(monkeypatch, hypothesis(100.0))
    monkeypatch.setattr(comparison, "fit_without", None)  # a fit that is there is not made again
    found = world.run(base=Plain(points=["base's points"]))
    assert world.seen["build_bank"] == [(["base's points"], 0.0, ["wind", "lag"])]
    assert world.seen["locate"] == [("base's points",)] and world.seen["thresholds"] == [(7, 3)]
    assert found.refits == () and found.best is found.none and found.where_after is None
    assert world.left_by == comparison.Remainder({})
    assert world.seen["weights"][0][2] == {"wind": ("wind", "everywhere"), "lag": ("lag", "everywhere")}


def test_one_that_does_not_is_left_for_the_path_of_the_readings(monkeypatch):
    world = World(monkeypatch, hypothesis(100.0, chi2=3.0))
    found = world.run()
    assert world.seen["fit_with"] == [{}]
    assert world.seen["build_bank"][0][:2] == ([OWN_PATH], 0.02)
    assert world.seen["locate"] == [(OWN_PATH,)] and found.none.log_evidence == 100.0


def test_refits_are_ordered_by_evidence_and_coefficients_are_among_them(monkeypatch):
    world = World(
        monkeypatch, hypothesis(100.0, chi2=3.0),
        refits=[hypothesis(150.0, "lag", chi2=3.0), hypothesis(140.0, "wind", chi2=3.0)],
        wide=[hypothesis(145.0, "coefficient_error:N_r", chi2=3.0)],
    )  # fmt: skip
    world.gains = {"wind": 1.0, "lag": 1.0}
    found = world.run()
    assert [r.effects[0] for r in found.refits] == ["lag", "coefficient_error:N_r", "wind"]
    assert found.best.effects == ("lag",) and world.seen["checked"][0][2] == {"wind": 1.0, "lag": 1.0}


@pytest.mark.parametrize("gain, searched", [(5.0, False), (5.1, True)])
def test_several_effects_are_searched_where_a_single_one_that_explains_gains(monkeypatch, gain, searched):
    world = World(monkeypatch, hypothesis(100.0), refits=[hypothesis(100.0 + gain, "wind")])
    found = world.run()
    assert ("several" in world.seen) == searched and ("remainder" in world.seen) == searched
    assert (found.where_after is not None) == searched


@pytest.mark.parametrize("gain, searched", [(5.0, False), (5.1, True)])
def test_or_where_one_that_explains_nothing_gains_in_the_screen(monkeypatch, gain, searched):
    poor = hypothesis(900.0, "wind", chi2=3.0)
    world = World(monkeypatch, hypothesis(100.0, chi2=3.0), refits=[poor], gains={"wind": gain, "lag": 0.0})
    world.run()
    assert ("several" in world.seen) == searched


def test_the_search_starts_from_the_single_effect_that_stands_best(monkeypatch):
    """One that explains before one that does not; a coefficient is no effect to start from."""
    world = World(
        monkeypatch, hypothesis(100.0),
        refits=[hypothesis(120.0, "wind"), hypothesis(500.0, "lag", chi2=3.0)],
        wide=[hypothesis(900.0, "coefficient_error:N_r")],
    )  # fmt: skip
    world.joint = [hypothesis(700.0, "wind", "lag"), hypothesis(950.0, "lag", "wind")]
    found = world.run()
    assert world.seen["several"][0][0] == ("wind",)
    assert [r.log_evidence for r in found.refits] == [950.0, 900.0, 700.0, 500.0, 120.0]
    assert len(world.seen["checked"]) == 3 + 5  # what the search adds is held to the same limits


def test_coefficients_alone_start_no_search(monkeypatch):
    world = World(monkeypatch, hypothesis(100.0), wide=[hypothesis(900.0, "coefficient_error:N_r")])
    found = world.run()
    assert "several" not in world.seen and found.where_after is world.after
    assert world.left_by.rest == {}


def test_what_the_search_found_left_is_not_located_again(monkeypatch):
    world = World(monkeypatch, hypothesis(100.0), refits=[hypothesis(200.0, "wind")])
    known = located(6.0)
    world.left = {("wind",): known}
    assert world.run().where_after is known and "remainder" not in world.seen


@pytest.mark.parametrize(
    "free, excess, shows",
    [(12.0, 1.0, False), (12.1, 1.0, True), (1.0, 1.1, True), (1.0, 1.0, False)],
)
def test_a_remainder_shows_beyond_chance_or_where_runs_disagree(monkeypatch, free, excess, shows):
    world = World(
        monkeypatch, hypothesis(100.0), refits=[hypothesis(200.0, "wind")], after=located(free), excess=excess
    )
    world.run()
    assert world.left_by.shows == shows and world.seen["weights"][-1][0] == excess
    assert world.left_by.kept == "kept"


@pytest.mark.parametrize(
    "before, after, chi2, share",
    [(8.0, 4.0, 1.0, 0.5), (2.0, 1.5, 1.0, 0.5), (8.0, 4.0, 25.0, 0.5), (8.0, 4.0, 25.1, 1.0)],
)  # fmt: skip
def test_the_share_left_is_of_what_showed_before_and_all_where_nothing_follows(
    monkeypatch, before, after, chi2, share
):
    world = World(
        monkeypatch, hypothesis(100.0, chi2=50.0), refits=[hypothesis(200.0, "wind", chi2=chi2)],
        where=located(before), after=located(after),
    )  # fmt: skip
    world.run()
    assert world.left_by.share == pytest.approx(share)


def test_what_a_free_force_adds_counts_for_all_that_are_as_good_as_the_best():
    refits = [
        hypothesis(200.0, "wind"), hypothesis(180.1, "lag"), hypothesis(180.0, "faint"),
        hypothesis(199.0, "wind", "lag"), hypothesis(199.0, "coefficient_error:N_r"),
    ]  # fmt: skip
    after = located(outside=30.0, base=10.0)
    assert comparison._rests(refits, after) == {("wind",): 20.0, ("lag",): 20.0}
    assert comparison._rests(refits, None) == {}
    assert comparison._rests(refits[::-1], after) == {}  # a coefficient leaves nothing to an effect


def test_no_effect_starts_once_more_from_the_best_refit_that_explains(monkeypatch):
    refits = [hypothesis(150.0, "wind"), hypothesis(250.0, "lag"), hypothesis(900.0, "faint", chi2=3.0)]
    for value, kept in ((120.0, 120.0), (80.0, 100.0)):
        world = World(
            monkeypatch,
            hypothesis(100.0, chi2=3.0),
            refits=refits,
            gains=dict.fromkeys(("wind", "lag", "faint"), 1.0),
        )
        world.again = hypothesis(value)
        found = world.run()
        # coefficients of the refit, effects off
        assert world.seen["fit_with"][1]["start"] == [("points of ('lag',)", (0.0, 251.0, 252.0, 0.0))]
        assert found.none.log_evidence == kept and world.seen["evidences"][0][0].log_evidence == kept


@pytest.mark.parametrize(
    "none, refit",
    [
        (hypothesis(100.0), hypothesis(150.0, "wind")),
        (hypothesis(100.0, chi2=3.0), hypothesis(150.0, "wind", chi2=3.0)),
    ],
)  # fmt: skip
def test_it_does_not_where_it_arrived_or_no_refit_did(monkeypatch, none, refit):
    world = World(monkeypatch, none, refits=[refit])
    world.run()
    assert len(world.seen["fit_with"]) == 1


@pytest.mark.parametrize(
    "best, outside, asked",
    [
        (hypothesis(120.1, "wind"), 0.0, True),
        (hypothesis(120.0, "wind"), 0.0, False),
        (hypothesis(300.0, "wind"), 399.0, True),
        (hypothesis(300.0, "wind"), 400.0, False),  # half of what a free force explains
        (hypothesis(300.0, "wind", chi2=3.0), 0.0, False),
        (hypothesis(300.0, "coefficient_error:N_r"), 0.0, False),
    ],
)
def test_runs_are_compared_where_the_best_explains_and_gains_beyond_linearisation(
    monkeypatch, best, outside, asked
):
    monkeypatch.setattr(comparison, "excess_where_apart", lambda equations, k: 2.5)
    found = comparison._excess([best, hypothesis(0.0, "lag")], hypothesis(100.0), 2, outside)
    assert found == (2.5 if asked else 1.0)
    assert comparison._excess([], hypothesis(100.0), 2, 0.0) == 1.0


def test_a_refit_that_is_worse_with_a_form_than_without_begins_again_where_it_ended_without(monkeypatch):
    """A form may be nought: far below the evidence without it lies only what the search missed."""

    def refitted(name, evidence, follows=True, points=()):
        fit = Plain(converged=follows, chi2=1.0, points=points)
        return Plain(effects=(name,), log_evidence=evidence, fit=fit, widens=False)

    asked = []

    def again(problem, effects, start, level, first, notify):
        asked.append((effects, start))
        return [refitted(effects[0], 100.0)]

    monkeypatch.setattr(comparison, "refit_again", again)
    monkeypatch.setattr(comparison, "_ranked", lambda problem, refits, none, gains: tuple(refits))
    problem = Plain(model=Plain(effects={n: n for n in "abcd"}), form=None)
    lost = refitted("d", 95.0, points=("far",))
    ended = (refitted("a", 90.0, points=("there",)), refitted("b", 75.0), refitted("c", 80.0, follows=False))
    known = Plain(refits=(*ended, lost), leading=lost)

    @dataclass(frozen=True)
    class Single:
        refits: tuple
        none: object = None
        gains: tuple = tuple("abcd")

    single = Single((refitted("a", 40.0), refitted("b", 60.0), refitted("c", 10.0)))
    found = comparison._arrived(problem, single, known, lambda text: None)
    # 15 nats are scatter, and c did not follow
    assert asked == [(("a",), ["there"]), (("d",), ["far"])]
    told = [(c.effects[0], c.log_evidence) for c in found.refits]
    assert told == [("a", 100.0), ("b", 60.0), ("c", 10.0), ("d", 100.0)]
    part = replace(single, gains=tuple("abc"))  # d is part of the form
    assert len(comparison._arrived(problem, part, known, lambda text: None).refits) == 3


@pytest.mark.parametrize(
    ("effects", "refitted", "widens", "chi2", "kept"),
    [
        (("a", "b"), (("a",), ("b",)), False, 1.0, True),
        (("a",), (("b",),), False, 1.0, True),  # not on the shortlist of this environment
        (("a",), (("a",), ("b",)), False, 1.0, False),  # there already
        (("a", "d"), (("a",),), False, 1.0, False),  # d is part of the form
        (("coefficient_error:N_r",), (("a",),), True, 1.0, False),
        ((), (("a",),), False, 1.0, False),
        (("a", "b"), (("a",),), False, 2.0, False),  # does not follow the data
    ],
)
def test_the_best_of_another_environment_is_begun_where_it_ended(
    monkeypatch, effects, refitted, widens, chi2, kept
):
    """Coefficients and effects as they ended; a form that is not free here as the vehicle has it."""
    ended = np.array([5.0, 6.0, 7.0, 8.0])  # coefficient, effects a and b, row of a form
    where = {"a": 1, "b": 2}
    begun = []

    class Free:
        def __init__(self, where):
            self.where = where

        def __add__(self, other):
            return Free([*self.where, *other.where])

    @dataclass(frozen=True)
    class Point:
        par: np.ndarray
        states: str

    def again(problem, chosen, start, level, first, notify):
        begun.append((chosen, start))
        return [Plain(effects=effects, log_evidence=1.0, fit=Plain(converged=True, chi2=chi2))]

    monkeypatch.setattr(comparison, "refit_again", again)
    monkeypatch.setattr(comparison, "effect_prior", lambda model, effect: Free([where[effect]]))
    problem = Plain(
        model=Plain(effects={n: n for n in "ab"}), coefficients=Free([0]), path=[Point(np.zeros(4), "raw")]
    )
    single = Plain(
        refits=tuple(Plain(effects=r) for r in refitted), effects=tuple(Plain(name=n) for n in "abc")
    )
    earlier = Plain(effects=effects, widens=widens, fit=Plain(points=[Point(ended, "smoothed")]))
    found = comparison._tried_again(problem, single, earlier, lambda text: None)
    assert (found is not None) is kept
    if kept:
        ((chosen, (start,)),) = begun
        assert chosen == effects and start.states == "smoothed"
        assert start.par.tolist() == [5.0, 6.0, 7.0 if "b" in effects else 0.0, 0.0]
    else:
        assert not begun or chi2 > 1.5


def test_runs_are_kept_by_the_sorted_names_of_a_set_and_of_refits_that_follow_the_data(monkeypatch):
    """The keys under which weighing looks them up, whatever order the search found the effects in."""
    monkeypatch.setattr(comparison, "axes_of", lambda problem, name: frozenset("N"))
    monkeypatch.setattr(comparison, "by_kinematics", lambda problem, c: Plain(evidence=0.0))
    monkeypatch.setattr(comparison, "readable", lambda problem, effect, table: False)
    monkeypatch.setattr(comparison, "form_gain", lambda problem, best, axes=None: 40.0)
    monkeypatch.setattr(comparison, "left_out", lambda equations: equations)
    monkeypatch.setattr(comparison, "cost_of_sizes", lambda problem, c, sensors: c.log_evidence)
    refits = [
        hypothesis(300.0, "wind", "lag"),
        hypothesis(290.0, "lag", "wind"),
        hypothesis(200.0, "lag", chi2=9.0),
    ]
    refits += [hypothesis(250.0, "thrust"), hypothesis(240.0, "drift")]
    refits += [hypothesis(400.0, "coefficient_error:N_r")]
    for k, c in enumerate(refits):
        c.fit.equations = np.full(4, float(k))
        c.fit.free = Plain(names=("N_r",), mean=np.zeros(1), sd=np.ones(1))
        c.fit.values, c.fit.sd = np.array([0.5 if "thrust" in c.effects else 6.0]), np.full(1, 0.2)
    problem = Plain(model=Plain(kernel=Plain(effects=())))
    off = (Plain(effect="wind", coefficient="N_r", moved=5.0, certain=9.0),)
    found = comparison._form_error(problem, refits[0], refits, 100.0, off, ["N_r"], 3.0)
    # what a coefficient certainly off says is sure of the effect, of sets that have it, and of a wrong one
    assert found.holds[("wind",)] == found.holds[("lag", "wind")] == 9.0
    assert found.holds[("coefficient_error",)] > 3.0 and ("lag",) not in found.holds
    # and of a cause with which the coefficient is as stated, not of one that leaves it off
    assert found.holds[("thrust",)] == 9.0 and found.holds[("drift",)] == 0.0
    assert list(found.by_run) == [("drift",), ("thrust",), ("lag", "wind")]
    assert np.all(found.by_run[("lag", "wind")] == 0.0)  # of two searches of one set, the better
    assert found.leaves == 50.0
    assert found.costs == {("drift",): 240.0, ("thrust",): 250.0, ("lag", "wind"): 300.0}


@pytest.mark.parametrize(
    "screened, first, asked",
    [
        # the screen puts both no lower than the refits: asked one by one, until one lies far below
        ({"lag": 150.0, "scale": 140.0}, {"wind": 100.0, "bias": 90.0}, ["lag", "scale"]),
        ({"lag": 150.0, "scale": 80.0}, {"wind": 100.0, "bias": 90.0}, ["lag"]),  # the screen is below them
        ({"lag": 150.0}, {"wind": 100.0, "bias": 75.0}, []),  # nothing may claim as much as the best
        ({"lag": 150.0}, {}, []),  # no refit explains the data
        ({}, {"wind": 100.0}, []),  # all are refitted already
    ],
)
def test_an_effect_that_was_only_screened_is_refitted_where_it_would_claim_what_the_best_do(
    monkeypatch, screened, first, asked
):
    found = {"lag": hypothesis(85.0, "lag"), "scale": hypothesis(20.0, "scale", chi2=3.0)}
    monkeypatch.setattr(
        comparison, "refit_screened", lambda problem, bank, score, notify, none: [found[score.name]]
    )
    scores = [Plain(name=n, gain=g) for n, g in screened.items()]
    refits = [hypothesis(value, name) for name, value in first.items()]
    out = comparison._rivals(None, None, scores, refits, hypothesis(0.0, chi2=3.0), lambda text: None)
    assert [c.effects[0] for c in out] == asked
