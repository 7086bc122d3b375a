"""Which effects of a vehicle are listed, and how they are shown."""

import pytest

from bayesid.cli.main import run as command
from bayesid.model.effects.describe import equations
from bayesid.model.effects.named import named_effects
from bayesid.model.effects.shown import shown
from tests.test_x_stern import CROSS, X


@pytest.mark.parametrize(
    ("formula", "short"),
    [
        ("1*(u + q) + 0*(v + r) + 0*(w - p)", "u + q"),
        ("share*(a*0 - b*1)", "share*-b"),
        ("0*u + 0*v", "0"),
        ("x - (x - y)*tau/h", "x - (x - y)*tau/h"),
        ("10*u + 0.5*v", "10*u + 0.5*v"),
    ],
)
def test_a_formula_is_shown_without_factors_one_and_terms_nought(formula, short):
    assert shown(formula) == short


def test_what_is_shown_of_a_fin_is_worth_what_acts():
    effect = next(e for e in named_effects(X) if e.name == "delta_2_effectiveness")
    names = dict(
        zip(
            ["u", "v", "w", "p", "q", "r", "share", "delta_2"],
            (2.0, 0.3, -0.2, 0.1, 0.2, -0.3, 0.7, 0.1),
            strict=True,
        )
    )
    names |= {
        f"fin_2_{k}": 0.1 * i + 0.3 for i, k in enumerate(["x", "y", "z", "dx", "dy", "dz", "F_uu", "D_uu"])
    }
    lines = dict(line.split(" += ") for line in equations(effect))
    for axis, text in effect.force.items():
        value = eval(text, {"abs": abs}, names)
        assert eval(lines.get(axis, "0"), {"abs": abs}, names) == pytest.approx(value, abs=1e-12)
        assert "0*" not in lines.get(axis, "") and "(1*" not in lines.get(axis, "")


def test_four_fins_of_one_type_have_common_effects_and_twins_or_unlike_ones_none():
    names = {e.name for e in named_effects(X)}
    kinds = ("lag", "dead_time", "rate_limit", "effectiveness")
    assert {n for n in names if n.startswith("fins_")} == {f"fins_1_2_3_4_{kind}" for kind in kinds}
    lag = next(e for e in named_effects(X) if e.name == "fins_1_2_3_4_lag")
    assert lag.says.startswith("The fins 1 to 4 turn") and len(lag.adjust) == 4
    assert not any(e.name.startswith("fins_") for fins in (X[:2], CROSS) for e in named_effects(fins))


def test_an_effect_of_named_actuators_asked_without_a_vehicle_names_the_option(capsys):
    assert command(["effect", "show", "delta_2_effectiveness"]) != 0
    assert "--vehicle FILE" in capsys.readouterr().err
