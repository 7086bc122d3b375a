"""What the report of a diagnosis says is so: labels, limits, intervals, zeros. Built from plain values."""

from dataclasses import fields, replace
from types import SimpleNamespace

import numpy as np
import pytest
from diagnosis_results import MODELS, RESULT, a_gap, a_horizon, a_result, draws
from matplotlib.colors import to_hex

from bayesid.diagnosis.answer import answer
from bayesid.diagnosis.data.dependence import Dependence
from bayesid.diagnosis.evidence.effect_draws import choice, warning
from bayesid.diagnosis.next_manoeuvre import Proposal
from bayesid.diagnosis.result_parts import Moved, RunError
from bayesid.diagnosis.run import Diagnosis
from bayesid.diagnosis.summary import unsigned_zeros
from bayesid.report.diagnosis.cause import where_blocks
from bayesid.report.diagnosis.effect_interval import why
from bayesid.report.diagnosis.effect_posterior import to_use
from bayesid.report.diagnosis.evidence import cause_blocks, held_words, moved_blocks, runs_blocks
from bayesid.report.diagnosis.figures import bars, symlog_ticks
from bayesid.report.diagnosis.holdout import holdout_blocks, proof_label
from bayesid.report.diagnosis.limits import next_blocks
from bayesid.report.diagnosis.report import diagnosis_report, write_diagnosis_report
from bayesid.report.diagnosis.words import in_words
from bayesid.report.figure_style import COLOURS
from bayesid.report.writer.blocks import Section, Text, cell_text
from bayesid.report.writer.markup import to_markdown


@pytest.mark.thorough
def test_the_report_is_written_from_the_result_alone(tmp_path):
    """No fit, problem, model or trial is behind this result: whatever the report says and draws is in it."""
    written = write_diagnosis_report(RESULT, tmp_path).parent
    text = (written / "report.md").read_text(encoding="utf-8")
    for said in ("Wind acts (probability 0.97).", "its speed", "Usual size: 0 to 10 m/s", "Y_vv",
                 "zigzag", "r1", "Data of a pond.", "no straight run", "advance"):  # fmt: skip
        assert said in text, said
    drawn = {p.stem for p in written.glob("*.png")} | {p.stem for p in (written / "figures").glob("*.png")}
    assert drawn >= {"where", "force", "screen", "effect_corner", "horizon_errors", "isolability"}


@pytest.mark.thorough
def test_saving_needs_no_working_object(tmp_path):
    from bayesid.api.diagnose import DiagnoseResult

    bare = Diagnosis(**dict.fromkeys((f.name for f in fields(Diagnosis)), None) | {"result": RESULT})
    found = DiagnoseResult(bare)
    assert found.save(tmp_path).exists() and (tmp_path / "diagnosis.json").exists()
    assert found.effects == ("wind",) and "wind" in found.summary() and len(found.to_dataframe()) == 1


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
    assert proof_label(a_result(word, named, best, gain)) == label


def test_the_caption_of_the_runs_says_where_the_explanation_misses_by_more():
    """A straight run goes where disturbances push it, whatever explains the others."""
    better = a_replayed("r2", "zigzag 8/8", "holdout", (12.0, 8.0, 1.3))
    assert "no larger than as given in 1 of 1 row (held-out runs: 1 of 1)." in _caption_of_runs(better)
    straight = a_replayed("r5", "straight run", "identify", (114.0, 116.0, 116.4))
    said = _caption_of_runs(better, straight)
    result = replace(RESULT, runs=(straight, better))
    assert [row[:3] for row in runs_blocks(result, answer(result))[0].rows] == [
        ("r2", "zigzag 8/8", "held out"), ("r5", "straight run", "read")
    ]  # fmt: skip
    assert "in 1 of 2 rows (held-out runs: 1 of 1)" in said
    assert said.endswith("They are larger on: straight run (r5), position 116 m instead of 114.")
    alike = a_replayed("r5", "straight run", "identify", (116.1, 116.0, 116.4))
    assert "in 1 of 1 row." in _caption_of_runs(alike)
    lost = a_replayed("r4", "turn 25", "holdout", (3.0, 2.0, None))
    said = _caption_of_runs(lost)
    assert "in 0 of 1 row (held-out runs: 0 of 1)" in said
    assert said.endswith("held-out turn 25 (r4), position diverges instead of 3.")


def a_replayed(name, manoeuvre, role, position):
    return RunError(
        name, manoeuvre, role, 90.0, 5.0, dict(zip(MODELS, position, strict=True)),
        {m: {"x": p, "y": p} for m, p in zip(MODELS, position, strict=True)},
    )  # fmt: skip


def _caption_of_runs(*runs):
    result = replace(RESULT, runs=runs)
    return runs_blocks(result, answer(result))[0].caption


def test_percent_and_standard_deviations_of_a_coefficient_have_one_sign():
    """Both of a damping of -2 found at -1.6, and of a force of 2 found at 1.6, are towards zero."""
    moved = {
        "N_r": Moved(-2.0, 0.2, -1.6, -2.0), "Y_r": Moved(2.0, 0.2, 1.6, 2.4),
        "X_vr": Moved(0.0, 0.1, 0.2, -0.1)
    }  # fmt: skip
    result = replace(RESULT, moved=moved)
    table = moved_blocks(result, answer(result))[0]
    cells = {row[0]: [cell_text(c) for c in (*row[3:5], *row[7:9])] for row in table.rows}
    assert cells["N_r"] == ["-20.0", "-2.0", "0.0", "0.0"]
    assert cells["Y_r"] == ["-20.0", "-2.0", "+20.0", "+2.0"]
    assert cells["X_vr"] == ["–", "+2.0", "–", "-1.0"]
    assert "+ is further from zero" in table.caption


def test_a_channel_no_held_out_run_reads_has_a_dash():
    rms = {m: {"x": 2.0, "psi": float("nan")} for m in ("nominal", "recalibrated", "with effect")}
    table = holdout_blocks(replace(RESULT, gap=a_gap(replace(a_horizon(), rms=rms))))[3]
    cells = {row[0]: [cell_text(c) for c in row[1:]] for row in table.rows}
    assert cells == {"x [m]": ["2"] * 3, "psi [deg]": ["–"] * 3}


def test_the_line_in_the_figure_is_the_threshold_of_the_record():
    figure = where_blocks(a_result(free=400.0))[1].image
    line = next(a for a in figure.axes[0].lines if to_hex(a.get_color()) == COLOURS["orange"].lower())
    assert list(line.get_xdata()) == [12.7, 12.7]
    assert "12.7" in line.get_label()


def test_the_place_named_is_that_of_all_hypotheses_not_of_a_free_signal():
    said = {c: where_blocks(a_result(free=400.0, channel=c))[0].body for c in ("psi", "current", None)}
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
    lines = held_words(a_result(free=free, gain=gain))
    assert bool(lines) == said
    assert all("already holds" in line for line in lines)


@pytest.mark.parametrize(
    "posterior, use",
    [
        (draws(agrees=True, ratio=1.0, force=0.1), "either"),
        (draws(force=-1.13), "draws"),  # their density is right wherever they go
        (draws(ratio=1.6, force=0.1), "draws"),
        (draws(ratio=0.6, force=0.1), "draws"),
        (draws(ratio=0.6, rough=0.8), "Laplace"),  # not right where they go: the wider one
        (draws(ratio=1.6, between=0.8), "draws"),
        (draws(converged=False), "Laplace"),
    ],
)
def test_warning_and_section_send_a_reader_to_the_same_interval(posterior, use):
    assert choice(posterior) == use
    section, told = why(posterior, "measured"), warning(posterior)
    if use == "either":
        assert told is None and "say the same" in section
        return
    assert ("shown is that of the draws" in section) == (use == "draws")
    assert ("use the intervals of the draws" in told) == (use == "draws")


def test_the_reason_for_an_interval_has_the_factor_on_the_environment():
    said = why(draws(force=-1.13), "measured")
    assert "0.32 of it" in said and "0.38 of Laplace's" in said and "took it for process noise" in said
    assert "took it for process noise" not in why(draws(force=-1.13), "assumed")
    assert "follow the bend" in why(draws(force=-0.3), "measured")
    assert "only right to 0.8 nats" in why(draws(rough=0.8), "measured")


def test_what_the_equations_lack_is_said_on_the_first_screen_and_has_its_section():
    from bayesid.diagnosis.result_parts import Estimate, FormRow, ModelFormPart

    part = ModelFormPart(
        294.0,
        {"Y": 3e-4, "N": 1e-3},
        28.9,
        ("roll_motion", "crossflow_drag"),
        (FormRow("N_|v|r", "N", 1.9e-3, 3e-4),),
    )
    plain = diagnosis_report(RESULT)
    assert "equations lack" not in plain.lead and "What the equations lack" not in [
        s.title for s in plain.sections
    ]
    named = diagnosis_report(replace(RESULT, model_form=part, verdict="effect"))
    screen = to_markdown("".join(b.body for s in named.first if isinstance(s, Section) for b in s.blocks))
    assert "The equations also lack a force" in screen
    assert "crossflow drag and roll with a period of 28.9 s" in screen
    assert "What the equations lack" in [s.title for s in named.sections]
    curves = replace(part, sizes={}, period=None, looks_like=(), drag_power=Estimate(2.6, 0.05))
    section = next(
        s
        for s in diagnosis_report(replace(RESULT, model_form=curves, verdict="effect")).sections
        if s.title == "What the equations lack"
    )
    assert "to the power 2.600, not 2 (95 %: 2.502 to 2.698)" in to_markdown(
        "".join(b.body for b in section.blocks if isinstance(b, Text))
    )
    alone = diagnosis_report(replace(RESULT, model_form=part, verdict="model_form", effects=()))
    assert "The equations lack a force that depends on the motion" in alone.lead


def test_what_an_effect_does_is_told_as_a_finding_only_where_it_is_named():
    """A newcomer read play, a late rudder and ballast as found, of five in question."""
    effects = tuple(replace(e, says="The air moves at {V_wind:m/s}.") for e in RESULT.effects)
    said = {
        word: to_markdown(cause_blocks(replace(RESULT, verdict=word, effects=effects))[0].body).split("\n")[0]
        for word in ("effect", "ambiguous")
    }
    flat, doubted = said["effect"], said["ambiguous"]
    assert flat.startswith("- ") and not flat.startswith("- If ")
    name, told = doubted.removeprefix("- If ").split(" acts (probability ")
    assert name == in_words(RESULT.effects[0].name)
    assert told.split("): ")[1] == flat[2].lower() + flat[3:]


def test_a_proposed_manoeuvre_says_what_is_ordered_and_none_says_why():
    chirp = Proposal("chirp", 69.0, 1.0, 9.0, "rudder up to 10 degrees to either side", "chirp:10")
    told = replace(RESULT, next_manoeuvre=(chirp,))
    assert any(
        "chirp, 69 s: rudder up to 10 degrees to either side; it tells" in s for s in answer(told).steps
    )
    assert next_blocks(told)[1].rows[0][2:] == ("rudder up to 10 degrees to either side", "chirp:10")
    quick = next_blocks(replace(RESULT, next_manoeuvre=(), next_asked=False))
    assert (
        quick[0].body
        == "No manoeuvre was ranked: `--quick` leaves it out (in Python `next_manoeuvre=False`)."
    )
    failed = next_blocks(replace(RESULT, next_manoeuvre=()))
    assert "--quick" not in failed[0].body and "see the notes" in failed[0].body


@pytest.mark.parametrize("half, said", [(0.0048, True), (0.0007, False), (0.0002, True)])
def test_the_interval_to_use_is_told_from_the_narrower_one_of_the_draws(half, said):
    size = SimpleNamespace(value=0.078, sd=half / 1.96, low95=None, high95=None)
    effect = SimpleNamespace(name="rudder_asymmetry", parameters={"asymmetry": size})
    drawn = SimpleNamespace(low95=0.0773, high95=0.0787)
    posterior = SimpleNamespace(parameters={"rudder_asymmetry.asymmetry": drawn, "Y_v": drawn})
    told = to_use(SimpleNamespace(effects=(effect,)), posterior)
    assert bool(told) == said
    assert not said or "first screen" in told
    assert ("from 0.0732 to 0.0828, 6.9 times as wide" in told) == (half == 0.0048)
    assert ("the interval of a size was widened" in told and "no narrower" in told) == (half == 0.0048)
    assert ("widened" in told) == ("no narrower" in told) == (half == 0.0048)
    assert not to_use(SimpleNamespace(effects=()), posterior)


@pytest.mark.parametrize("role", ["holdout", "identify"])
@pytest.mark.usefixtures("without_pictures")
def test_held_out_is_explained_where_it_is_first_shown_and_each_deviation_says_of_what_it_is(role, tmp_path):
    sizes = dict(zip(("nominal", "recalibrated", "with effect"), (9.0, 5.0, 1.0), strict=True))
    rms = {m: {"x": s, "y": 0.0} for m, s in sizes.items()}
    run = RunError("r1", "zig-zag", role, 60.0, 5.0, sizes, rms)
    result = replace(RESULT, runs=(run,), moved={"N_v": Moved(-1.0, 0.1, -1.2, -1.1)})
    text = (write_diagnosis_report(result, tmp_path).parent / "report.md").read_text(encoding="utf-8")
    assert ("Held out: no fit and no choice of a cause has read this run" in text) == (role == "holdout")
    assert ("by more than chance, is withdrawn" in text) == (
        role == "holdout"
    ) and "it only shows" not in text
    assert "standard deviations stated by the vehicle file" in text
    assert "one standard deviation of a refit" in text


@pytest.mark.thorough
@pytest.mark.parametrize(("acts", "row"), [("hull", (1.0, 2.0, 0.1)), ("ground", (1.0, 2.0, 3.0, -4.0))])
def test_a_force_with_the_place_is_drawn_on_the_tracks(acts, row, tmp_path):
    placed = Dependence("place", acts, 40.0, 40.0, 0.2, 50.0, (row, tuple(-x for x in row)))
    write_diagnosis_report(a_result("outside", (), dependence=placed), tmp_path)
    assert (tmp_path / "figures" / "place.png").stat().st_size > 5000
    assert "Map of a force that depends on the place" in (tmp_path / "report.html").read_text()
    without = tmp_path / "without"
    write_diagnosis_report(a_result("outside", (), dependence=replace(placed, map=())), without)
    assert not (without / "figures" / "place.png").exists()
