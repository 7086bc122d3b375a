"""The search for several effects, step by step, in a world whose evidences are given: no fit is made.

Thresholds are those of the table: 5 nats to add an effect, half of what a free force gains, 3 nats to keep
one, three effects, three exchanges of two rivals each, 20 nats that two linearisations may differ by.
"""

from dataclasses import dataclass
from types import SimpleNamespace as Plain

import numpy as np
import pytest

from bayesid.diagnosis.hypotheses import search
from bayesid.model.effects import CATALOGUE

FAMILY = {
    "wind": "force", "push": "force", "lag": "timing", "dead": "timing", "scale": "scale", "bias": "sensor",
    "drag": "drag",
}  # fmt: skip
EFFECTS = {n: Plain(name=n, family=f, smooth=True) for n, f in FAMILY.items()}
PROBLEM = Plain(model=Plain(effects=EFFECTS))


GOOD = Plain(converged=True, chi2=1.0, points="p", path_points="p", followed="p", path_force_level=0.01)


def key(*names):
    return "+".join(sorted(names))


class World:
    """Refits with evidence by name ("lag+wind"), a screen by what is in the model, a log of what was asked.

    Parameters
    ----------
    poor : sets whose refit does not follow the data
    lost : sets whose refit did not converge
    none : sets that cannot be refitted
    free : what a free force gains beside a set
    along : evidence of the last effect of a set along the set's own path
    """

    def __init__(self, monkeypatch, evidence, screen, free=None, poor=(), lost=(), none=(), along=None):
        self.evidence, self.scores, self.free = evidence, screen, free or {}
        self.poor, self.lost, self.none, self.along = poor, lost, none, along or {}
        self.asked, self.banks, self.starts, self.remainders, self.nested = [], [], [], [], []
        self.rivals, self.again = {}, {}
        for name in ("refit", "refit_again", "build_bank", "screen", "remainder", "nested"):
            monkeypatch.setattr(search, name, getattr(self, f"_{name}"))
        monkeypatch.setattr(
            search, "_switched_off", lambda problem, larger, fewer: f"{key(*larger.effects)} with less"
        )
        monkeypatch.setattr(search, "first_fit", lambda problem, effects, points: (points, names(effects)))
        monkeypatch.setattr(search, "levels_between", lambda problem, level: level)
        monkeypatch.setattr(search, "effect_prior", lambda model, effect: (effect.name,))

    def candidate(self, *effects):
        k = key(*effects)
        fit = Plain(
            converged=k not in self.lost, chi2=2.0 if k in self.poor else 1.0, points=f"points of {k}",
            path_points=f"path of {k}", path_force_level=0.01,
            followed=f"path of {k}" if k in self.lost else f"points of {k}",
        )  # fmt: skip
        return Plain(effects=tuple(effects), log_evidence=self.evidence.get(k, 0.0), fit=fit)

    def _refit(self, problem, effects, notify, sizes=None, smaller=None, promised=np.inf):
        # what a screen promised is of the refit along whose path it was
        assert (smaller is None) == (promised == np.inf)
        self.asked.append(key(*names(effects)))
        return [] if self.asked[-1] in self.none else [self.candidate(*names(effects))]

    def _refit_again(self, problem, effects, start, level, first, notify):
        self.starts.append((key(*names(effects)), start, level))
        again = self.again.get(self.starts[-1][0])
        return first if again is None else [Plain(effects=names(effects), log_evidence=again, fit=GOOD)]

    def _build_bank(self, problem, points, level, others, inside):
        self.banks.append((points, level, names(others), inside))
        return key(*inside)

    def _screen(self, bank):
        return [Plain(name=n, gain=g) for n, g in self.scores.get(bank, ())]

    def _remainder(self, problem, candidate):
        self.remainders.append(key(*candidate.effects))
        return Plain(outside=1000.0 + self.free.get(self.remainders[-1], 0.0), base=1000.0)

    def _nested(self, problem, larger, keep):
        self.nested.append((key(*larger.effects), key(*keep)))
        return self.along.get(key(*larger.effects), 1e6)

    def run(self, *first, refits=()):
        start = self.candidate(*first)
        alike = Plain(rivals=lambda name: self.rivals.get(name, ()))
        every = list(EFFECTS.values())
        found, left = search.search_several(PROBLEM, [start, *refits], start, every, alike, lambda text: None)
        return [key(*c.effects) for c in found], left


def names(effects):
    return tuple(e.name for e in effects)


# wind alone 100, with lag 160, with scale as well 220, a fourth one more
THREE = {"wind": 100.0, "lag+wind": 160.0, "lag+scale+wind": 220.0, "bias+lag+scale+wind": 400.0}
SCREENS = {"wind": [("lag", 50.0)], "lag+wind": [("scale", 50.0)], "lag+scale+wind": [("bias", 50.0)]}


def test_effects_are_added_while_they_gain_and_never_more_than_three(monkeypatch):
    world = World(monkeypatch, THREE, SCREENS)
    found, left = world.run("wind")
    assert found[0] == "lag+scale+wind" and "bias+lag+scale+wind" not in world.asked
    assert [b[3] for b in world.banks] == [("wind",), ("wind", "lag")]  # what is in the model already
    assert set(left) == {("wind",), ("wind", "lag")} and world.remainders == ["wind", "lag+wind"]
    values = [world.evidence.get(k, 0.0) for k in found]
    assert values == sorted(values, reverse=True)


def test_an_effect_of_a_family_in_the_model_is_not_screened(monkeypatch):
    world = World(monkeypatch, THREE, SCREENS)
    world.run("wind")
    assert world.banks[0][2] == ("lag", "dead", "scale", "bias", "drag")
    assert world.banks[1][2] == ("scale", "bias", "drag")


@pytest.mark.parametrize(
    "lost, at",
    [((), ("points of wind", 0.0)), (("wind",), ("path of wind", 0.01))],
)
def test_the_screen_is_along_the_fit_or_the_path_that_follows_the_data(monkeypatch, lost, at):
    world = World(monkeypatch, THREE, SCREENS, lost=lost)
    world.run("wind")
    assert world.banks[0][:2] == at


def test_three_of_the_screen_are_tried_and_none_below_half_the_evidence_to_add(monkeypatch):
    ranked = [("lag", 50.0), ("scale", 40.0), ("bias", 30.0), ("drag", 20.0)]
    world = World(monkeypatch, {"wind": 100.0}, {"wind": ranked})
    world.run("wind")
    assert world.asked == ["lag+wind", "scale+wind", "bias+wind"]
    world = World(monkeypatch, {"wind": 100.0}, {"wind": [("lag", 2.51), ("scale", 2.5)]})
    world.run("wind")
    assert world.asked == ["lag+wind"]
    world = World(monkeypatch, {"wind": 100.0}, {"wind": [("lag", 2.5)]})
    assert world.run("wind") == (["wind"], {}) and not world.asked


def test_a_set_that_cannot_be_refitted_ends_the_search(monkeypatch):
    world = World(monkeypatch, THREE, SCREENS, none=("lag+wind",))
    assert world.run("wind") == (["wind"], {})


@pytest.mark.parametrize("gain, added", [(5.0, True), (4.9, False)])
def test_a_further_effect_needs_five_nats(monkeypatch, gain, added):
    world = World(monkeypatch, {"wind": 100.0, "lag+wind": 100.0 + gain}, {"wind": [("lag", 50.0)]})
    _, left = world.run("wind")
    assert (("wind",) in left) == added and (len(world.banks) == 2) == added


@pytest.mark.parametrize("free, added", [(120.0, True), (120.2, False)])
def test_a_further_effect_needs_half_of_what_a_free_force_gains(monkeypatch, free, added):
    world = World(monkeypatch, THREE, {"wind": [("lag", 50.0)]}, free={"wind": free})
    _, left = world.run("wind")
    assert ("wind",) in left and (len(world.banks) == 2) == added


def test_a_small_gain_must_also_be_there_along_its_own_path(monkeypatch):
    evidence = {"wind": 100.0, "lag+wind": 120.0}
    for along, added in ((4.9, False), (5.0, True)):
        world = World(monkeypatch, evidence, {"wind": [("lag", 50.0)]}, along={"lag+wind": along})
        _, left = world.run("wind")
        assert (("wind",) in left) == added and world.nested == [("lag+wind", "wind")]
    world = World(
        monkeypatch, {"wind": 100.0, "lag+wind": 120.1}, {"wind": [("lag", 50.0)]}, along={"lag+wind": 0.0}
    )
    _, left = world.run("wind")
    assert ("wind",) in left and not world.nested  # beyond what two linearisations may differ by


def test_the_gain_is_that_of_the_evidence_where_its_own_path_says_more(monkeypatch):
    world = World(
        monkeypatch, {"wind": 100.0, "lag+wind": 104.0}, {"wind": [("lag", 50.0)]}, along={"lag+wind": 9.0}
    )
    assert world.run("wind")[1] == {}


def test_beside_what_does_not_explain_the_data_the_screen_decides(monkeypatch):
    """The second of two causes is added although the evidence of neither refit can be compared."""
    evidence = {"wind": 100.0, "lag+wind": 20.0, "scale+wind": 30.0}
    screens = {"wind": [("lag", 50.0), ("scale", 40.0)]}
    poor = ("wind", "lag+wind", "scale+wind")
    world = World(monkeypatch, evidence, screens, poor=poor)
    _, left = world.run("wind")
    assert left == {} and world.banks[1][3] == ("wind", "lag")
    world = World(monkeypatch, evidence, screens, poor=("wind", "lag+wind"))
    world.run("wind")
    assert world.banks[1][3] == ("wind", "scale")  # the one that does explain them goes first


def test_alike_effects_are_exchanged_once_there_are_two(monkeypatch):
    world = World(
        monkeypatch,
        THREE | {"lag+push": 500.0, "lag+push+scale": 600.0},
        SCREENS | {"lag+push": [("scale", 50.0)]},
    )
    world.rivals = {"wind": ("push",), "scale": ("bias",)}
    found, left = world.run("wind")
    assert found[0] == "lag+push+scale" and "lag+push" in found
    assert not [k for k in world.asked if "bias" in k]  # three are not exchanged any more
    assert ("lag", "push") in left or ("push", "lag") in left


@pytest.mark.parametrize("followed", [True, False])
def test_three_are_exchanged_where_no_pair_followed_the_readings(monkeypatch, followed):
    """A current is found third; only beside it is a late rudder told from a slow one, which came first."""
    evidence = THREE | {"dead+scale+wind": 900.0, "dead+wind": 950.0}
    world = World(monkeypatch, evidence, SCREENS, poor=() if followed else ("wind", "lag+wind"))
    world.rivals = {"lag": ("dead",)}
    world.evidence.update({"dead+wind": 120.0} if followed else {})
    world.poor = (*world.poor, "dead+wind")
    found, _ = world.run("wind")
    assert ("dead+scale+wind" in found) is not followed
    assert found[0] == ("lag+scale+wind" if followed else "dead+wind")


def test_a_pair_one_begins_with_is_exchanged_before_a_third_is_looked_for(monkeypatch):
    """Begun at the best pair of another environment, whose look-alike is better in this one."""
    evidence = {"lag+wind": 160.0, "lag+push": 190.0, "lag": 10.0, "push": 10.0, "wind": 10.0}
    world = World(monkeypatch, evidence, {})
    world.rivals = {"wind": ("push",)}
    found, _ = world.run("wind", "lag")
    assert found[0] == "lag+push" and world.asked[0] == "lag+push"


@pytest.mark.parametrize("loss, dropped", [(3.0, True), (3.1, False)])
def test_an_effect_the_others_can_do_without_is_dropped(monkeypatch, loss, dropped):
    """Of three, wind came first and owes its place to the others; then each of the pair is tried alone."""
    evidence = THREE | {"lag+scale": 220.0 - loss, "lag": 10.0, "scale": 10.0}
    world = World(monkeypatch, evidence, SCREENS)
    found, _ = world.run("wind")
    assert {"lag+scale", "scale+wind"} <= set(found)
    assert ("lag" in found) == dropped and ("scale" in found) == dropped


def test_what_was_refitted_is_not_refitted_again_on_the_way_back(monkeypatch):
    world = World(monkeypatch, THREE, SCREENS)
    found, _ = world.run("wind")
    assert len(world.asked) == len(set(world.asked)) and "wind" not in world.asked
    assert len(found) == len(set(found))


def test_the_way_back_ends_where_nothing_can_be_refitted(monkeypatch):
    world = World(monkeypatch, THREE, {"wind": [("lag", 50.0)]}, none=("lag", "wind"))
    start = world.candidate("wind", "lag")
    alike = Plain(rivals=lambda name: ())
    found, _ = search.search_several(PROBLEM, [start], start, list(EFFECTS.values()), alike, print)
    assert [key(*c.effects) for c in found] == ["lag+wind"]


def test_fewer_effects_that_did_not_arrive_begin_again_where_more_of_them_did(monkeypatch):
    evidence = {
        "wind": 100.0,
        "lag+wind": 160.0,
        "lag+scale+wind": 220.0,
        "scale+wind": 130.0,
        "lag+scale": 5.0,
    }
    world = World(monkeypatch, evidence, SCREENS, poor=("scale+wind", "lag+scale", "wind"))
    world.again = {"scale+wind": 219.0}
    found, _ = world.run("wind")
    assert ("scale+wind", "lag+scale+wind with less", search.FOLLOWING_FORCE_LEVEL) in world.starts
    assert "lag+wind" not in [s[0] for s in world.starts]  # that one explains the data as it is
    assert found[:2] == ["lag+scale+wind", "scale+wind"]


def exchanged(world, *first, rivals):
    start = world.candidate(*first)
    alike = Plain(rivals=lambda name: rivals.get(name, ()))
    refits, best = search._exchanged(PROBLEM, [start], start, alike, lambda text: None)
    return key(*best.effects), [key(*c.effects) for c in refits]


def test_two_rivals_of_each_are_tried(monkeypatch):
    world = World(monkeypatch, {"lag+wind": 100.0}, {})
    exchanged(world, "wind", "lag", rivals={"wind": ("push", "scale", "bias")})
    assert world.asked == ["lag+push", "lag+scale"]


def test_no_more_than_three_exchanges_are_made_in_a_row(monkeypatch):
    chain = ("wind", "push", "scale", "bias", "drag")
    evidence = {key(n, "lag"): 100.0 * i for i, n in enumerate(chain)}
    world = World(monkeypatch, evidence, {})
    best, _ = exchanged(
        world, "wind", "lag", rivals=dict(zip(chain, [(n,) for n in chain[1:]], strict=False))
    )
    assert best == "bias+lag"


@pytest.mark.parametrize(
    "value, poor, taken", [(100.0, (), False), (100.1, (), True), (20.0, ("lag+wind",), True)]
)
def test_an_exchange_is_kept_where_it_gains_or_what_it_replaces_explains_nothing(
    monkeypatch, value, poor, taken
):
    world = World(monkeypatch, {"lag+wind": 100.0, "lag+push": value}, {}, poor=poor)
    best, refits = exchanged(world, "wind", "lag", rivals={"wind": ("push",)})
    assert best == ("lag+push" if taken else "lag+wind") and refits == ["lag+push", "lag+wind"]


def test_a_set_that_does_not_arrive_starts_from_the_best_part_that_does(monkeypatch):
    world = World(monkeypatch, {"wind": 300.0, "lag": 200.0, "scale": 900.0}, {}, poor=("lag+wind", "scale"))
    parts = [world.candidate(n) for n in ("lag", "wind", "scale", "bias")]
    search._beside(PROBLEM, parts, (EFFECTS["wind"], EFFECTS["lag"]), lambda text: None)
    # from wind, the better part; lag is what it lacks
    assert world.starts == [("lag+wind", ("points of wind", ("lag",)), search.FOLLOWING_FORCE_LEVEL)]


def test_one_of_several_refits_that_explains_is_enough_not_to_start_again(monkeypatch):
    world = World(monkeypatch, {"wind": 300.0}, {}, poor=("lag+wind",))
    good, bad = world.candidate("lag", "wind"), world.candidate("wind", "lag")
    good.fit.chi2 = 1.0
    monkeypatch.setattr(search, "refit", lambda *a: [bad, good])
    pair = (EFFECTS["wind"], EFFECTS["lag"])
    assert search._beside(PROBLEM, [world.candidate("wind")], pair, lambda text: None) == [bad, good]
    assert not world.starts


def test_a_set_is_no_part_of_itself(monkeypatch):
    world = World(monkeypatch, {}, {}, poor=("lag+wind",))
    whole = world.candidate("wind", "lag")
    whole.fit.chi2 = 1.0
    search._beside(PROBLEM, [whole], (EFFECTS["wind"], EFFECTS["lag"]), lambda text: None)
    assert not world.starts


@dataclass
class Point:
    par: np.ndarray


def refits_of(*ranked):
    fit = Plain(converged=True, chi2=1.0)
    return [Plain(effects=tuple(e.split("+")), log_evidence=x, fit=fit, widens=False) for e, x in ranked]


@pytest.mark.parametrize(
    ("ranked", "first"),
    [
        # 1.3 nats are no ground to say that a current changes on the way; 3.1 are
        ((("ocean_current_varying", 50.0), ("ocean_current", 48.7)), "ocean_current"),
        ((("ocean_current_varying", 50.0), ("ocean_current", 46.9)), "ocean_current_varying"),
        # beside another effect, in any order, and not where that one is another
        ((("gyro_bias+ocean_current_varying", 50.0), ("ocean_current+gyro_bias", 48.0)),
         "ocean_current+gyro_bias"),
        ((("gyro_bias+ocean_current_varying", 50.0), ("ocean_current+gyro_scale", 48.0)),
         "gyro_bias+ocean_current_varying"),
        ((("gyro_bias+ocean_current_varying", 50.0), ("ocean_current", 48.0)),
         "gyro_bias+ocean_current_varying"),
        # alike, but no part of one another
        ((("hull_fouling", 50.0), ("thrust_loss", 49.0)), "hull_fouling"),
        ((("wind", 50.0), ("steady_force", 49.0)), "wind"),
        ((("ocean_current", 50.0), ("ocean_current_varying", 49.0)), "ocean_current"),
    ],
)  # fmt: skip
def test_the_plainer_form_of_an_effect_is_told_where_the_richer_is_worth_less_than_odds_of_twenty(
    ranked, first
):
    effects = {e.name: e for e in CATALOGUE}
    found = search.plainest_first(effects, refits_of(*ranked))
    assert found[0].effects == tuple(first.split("+")) and len(found) == len(ranked)


def test_a_plainer_form_that_was_not_tried_begins_at_the_values_of_the_richer_one(monkeypatch):
    effects = {e.name: e for e in CATALOGUE}
    keys = [effects[n].key(p.name) for n in ("ocean_current", "ocean_current_varying", "gyro_bias")
            for p in effects[n].parameters]  # fmt: skip
    model = Plain(effects=effects, index={k: i for i, k in enumerate(keys)}, nominal=np.zeros(len(keys)))
    values = dict(zip(keys, np.arange(1.0, len(keys) + 1.0), strict=True))
    point = Point(np.array([0.0 if k.startswith("ocean_current.") else values[k] for k in keys]))
    best = refits_of(("gyro_bias+ocean_current_varying", 50.0), ("gyro_bias", 3.0))
    best[0].fit.points = (point,)
    asked = []
    monkeypatch.setattr(
        search,
        "refit_again",
        lambda problem, effects, start, *a: asked.append((names(effects), start)) or ["it"],
    )
    problem, every = Plain(model=model), list(CATALOGUE)
    assert search.in_plainer_form(problem, best, every, print) == ["it"]
    ((chosen, (start,)),) = asked
    assert chosen == ("gyro_bias", "ocean_current")
    told = dict(zip(keys, start.par, strict=True))
    for name, value in told.items():
        effect, of = name.split(".")
        rich = values.get(f"ocean_current_varying.{of}")
        assert (
            value == {"ocean_current": rich, "ocean_current_varying": 0.0, "gyro_bias": values[name]}[effect]
        )
    # tried already, not in the trial, itself the plainest, or not at the data: nothing to try
    tried = [*best, *refits_of(("ocean_current+gyro_bias", 1.0))]
    plain = refits_of(("gyro_bias+ocean_current", 50.0))
    assert not search.in_plainer_form(problem, tried, every, print)
    assert not search.in_plainer_form(problem, best, [effects["gyro_bias"]], print)
    assert not search.in_plainer_form(problem, plain, every, print)
    best[0].fit.chi2 = 1e3
    assert not search.in_plainer_form(problem, best, every, print)
    assert len(asked) == 1
