"""What the report of a diagnosis says is so: labels, limits, intervals, zeros. Built from plain values."""

from types import SimpleNamespace as Plain

import numpy as np
import pytest
from matplotlib.colors import to_hex

from bayesid.diagnosis.evidence.effect_interval import choice, warning
from bayesid.diagnosis.summary import unsigned_zeros
from bayesid.report.diagnosis.cause import where_blocks
from bayesid.report.diagnosis.effect_interval import lead_words, why
from bayesid.report.diagnosis.figures import bars, symlog_ticks
from bayesid.report.diagnosis.holdout import proof_label, shrink_blocks
from bayesid.report.diagnosis.report import _held, _unlisted
from bayesid.report.diagnosis.words import in_words
from bayesid.report.figure_style import COLOURS
from bayesid.report.writer.blocks import cell_text

CHANCE = Plain(named=3.5, remainder=12.7)


def a_diagnosis(word="effect", named=("wind",), best=("wind",), gain=50.0, free=30.0, horizons=()):
    """As much of a diagnosis as the sections below read."""

    def of(effects, evidence):
        return Plain(effects=effects, log_evidence=evidence)

    none = of((), 100.0)
    places = (Plain(channel="psi", evidence=free, period=None), Plain(channel="Y", evidence=free / 2))
    found = Plain(
        none=none,
        refits=(of(best, 100.0 + gain),) if best else (),
        best=of(best, 100.0 + gain) if best else none,
        thresholds=CHANCE,
        where=Plain(places=places, masks=()),
    )
    return Plain(
        candidates=found,
        verdict=Plain(word=word, effects=named),
        shrink=Plain(horizons=horizons, runs=("r7",), measures=()),
        problem=Plain(environment=Plain(source="measured"), channels=("x", "psi")),
    )


@pytest.mark.parametrize(
    "word, named, best, gain, label",
    [
        ("effect", ("wind",), ("wind",), 50.0, "with the effect"),
        ("several", ("wind", "ballast_mass"), ("ballast_mass", "wind"), 50.0, "with the effects"),
        ("effect_with_remainder", ("wind",), ("wind",), 50.0, "with the effect"),
        ("effect_with_remainder", ("wind",), ("wind", "ballast_mass"), 50.0,
         "best explanation (wind + ballast mass)"),
        ("ambiguous", ("wind", "tether_drag"), ("wind",), 50.0, "best explanation (wind)"),
        ("none", (), ("wind",), 1.0, "best explanation (wind)"),
        ("none", (), ("wind",), -1.0, "best explanation (none)"),
        ("coefficients", ("coefficient_error",), ("coefficient_error:N_r",), 9.0,
         "best explanation (coefficient error of N_r)"),
    ],
)  # fmt: skip
def test_only_a_model_of_exactly_what_is_named_is_called_with_the_effect(word, named, best, gain, label):
    found = a_diagnosis(word, named, best, gain)
    assert proof_label(found) == label


def test_a_channel_no_held_out_run_reads_has_a_dash():
    rms = {"x": 2.0, "psi": float("nan")}
    models = ("nominal", "recalibrated", "with effect")
    horizon_row = Plain(
        horizon="full replay", seconds=float("nan"), excess=dict.fromkeys(models, 3.0), shrink=0.5,
        interval=(0.1, 0.9), worth=True, rms=dict.fromkeys(models, rms),
    )  # fmt: skip
    table = shrink_blocks(a_diagnosis(horizons=(horizon_row,)))[3]
    cells = {row[0]: [cell_text(c) for c in row[1:]] for row in table.rows}
    assert cells == {"x [m]": ["2"] * 3, "psi [deg]": ["–"] * 3}


def test_the_line_in_the_figure_is_the_threshold_of_the_record():
    found = a_diagnosis(free=400.0)
    figure = where_blocks(found, {"where": {"channel": "psi"}})[1].image
    line = next(a for a in figure.axes[0].lines if to_hex(a.get_color()) == COLOURS["orange"].lower())
    assert list(line.get_xdata()) == [12.7, 12.7]
    assert "12.7" in line.get_label()


def test_the_place_named_is_that_of_all_hypotheses_not_of_a_free_signal():
    found = a_diagnosis(free=400.0)
    said = {c: where_blocks(found, {"where": {"channel": c}})[0].body for c in ("psi", "current", None)}
    assert "**psi**." in said["psi"] and "not psi" not in said["psi"]
    assert "**current**, not psi" in said["current"]
    assert "no place is named" in said[None]


def test_an_axis_that_is_not_linear_says_so_and_has_round_ticks():
    values = np.array([430.6, 12.0, -3.0])
    wide, narrow = bars("abc", values, "gain").axes[0], bars("abc", values / 20, "gain").axes[0]
    assert wide.get_xscale() == "symlog" and "logarithmic" in wide.get_xlabel()
    assert narrow.get_xscale() == "linear" and narrow.get_xlabel() == "gain"
    assert list(wide.get_xticks()) == [0, 5, 10, 30, 100, 300]
    assert symlog_ticks(-60.0, 5e5) == [-30, -10, -5, 0, 10, 100, 1000, 10000, 100000]


@pytest.mark.parametrize(
    "text, said",
    [
        ("would add -0.0", "would add 0.0"),
        ("by +0.0 at best (in Y)", "by 0.0 at best (in Y)"),
        ("-0.05 and +0.10 stay", "-0.05 and +0.10 stay"),
        ("r1 20-0 s, 1e-0, -0%", "r1 20-0 s, 1e-0, 0%"),
        ("-10.0 and +0.01", "-10.0 and +0.01"),
    ],
)
def test_zero_has_no_sign(text, said):
    assert unsigned_zeros(text) == said
    assert cell_text(-0.0) == "0"


def test_a_coefficient_keeps_its_underscore():
    assert in_words("coefficient_error:N_r") == "coefficient error of N_r"
    assert in_words("rudder_offset") == "rudder offset"


@pytest.mark.parametrize("free, gain, said", [(-0.0, 45.0, True), (30.0, 45.0, False), (-0.0, 2.0, False)])
def test_an_effect_where_a_free_signal_gains_nothing_is_explained(free, gain, said):
    lines = _held(a_diagnosis(free=free, gain=gain))
    assert bool(lines) == said
    assert all("already holds" in line for line in lines)


def a_posterior(agrees=False, ratio=0.38, force=-1.13, converged=True, rough=0.01, between=0.02):
    def parameter(mean, sd_over_laplace=1.0):
        return {
            "mean": mean, "sd": 0.01, "low95": mean - 0.06, "high95": mean + 0.06,
            "sd_over_laplace": sd_over_laplace, "shift_in_laplace_sd": 0.0,
        }  # fmt: skip

    parameters = {"wind.V": parameter(0.1, ratio), "N_v": parameter(-20.0), "log force": parameter(force)}
    return {
        "parameters": parameters, "agrees_with_laplace": agrees, "converged": converged, "reasons": ["short"],
        "linearised_anew": {"roughness_nats": rough, "loudness_nats": between},
    }  # fmt: skip


@pytest.mark.parametrize(
    "posterior, use",
    [
        (a_posterior(agrees=True, ratio=1.0, force=0.1), "either"),
        (a_posterior(force=-1.13), "draws"),  # their density is right wherever they go
        (a_posterior(ratio=1.6, force=0.1), "draws"),
        (a_posterior(ratio=0.6, force=0.1), "draws"),
        (a_posterior(ratio=0.6, rough=0.8), "Laplace"),  # not right where they go: the wider one
        (a_posterior(ratio=1.6, between=0.8), "draws"),
        (a_posterior(converged=False), "Laplace"),
    ],
)
def test_warning_lead_and_section_send_a_reader_to_the_same_interval(posterior, use):
    record = {"posterior": posterior}
    assert choice(posterior) == use
    lead, section, told = lead_words(record), why(posterior, "measured"), warning(posterior)
    if use == "either":
        assert lead == "" and told is None and "use either" in section
        return
    to_draws = use == "draws"
    assert ("Instead of the ±" in lead) == to_draws and ("Use this ±" in lead) != to_draws
    assert ("Use the intervals of the draws" in section) == to_draws
    assert ("use the intervals of the draws" in told) == to_draws and ("use the +-" in told) != to_draws


def test_without_draws_the_lead_says_nothing_of_them():
    assert lead_words({"posterior": None}) == ""


def test_the_reason_for_an_interval_has_the_factor_on_the_environment():
    said = why(a_posterior(force=-1.13), "measured")
    assert "0.32 of it" in said and "0.38 of Laplace's" in said and "took it for process noise" in said
    assert "took it for process noise" not in why(a_posterior(force=-1.13), "assumed")
    assert "follow the bend" in why(a_posterior(force=-0.3), "measured")
    assert "only right to 0.8 nats" in why(a_posterior(rough=0.8), "measured")


def test_the_lead_says_how_probable_it_is_that_the_cause_is_not_on_the_list():
    found = {"effects": [{"name": "wind"}], "set95": ["wind", "outside"]}
    record = found | {"probabilities": {"outside": 0.084}}
    assert "probability of 8%" in _unlisted(record)
    assert _unlisted(record | {"set95": ["wind"]}) == ""
    assert _unlisted(record | {"effects": []}) == ""
