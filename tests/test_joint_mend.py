"""Mends of several mistakes as one table, which does what they do one after the other; its words."""

from dataclasses import replace

import numpy as np
import pytest

from bayesid.cli.main import run
from bayesid.cli.trial import _print
from bayesid.report.input import finding_sentence, joint_mend
from bayesid.trials import Run
from bayesid.trials.correction import Correction, apply, join, read_correction
from bayesid.trials.mistakes import InputCheck, InputFinding

T = np.linspace(0.0, 10.0, 21)
RUN = Run(
    "a",
    "",
    "identify",
    T,
    {"psi": 0.1 * T, "r": 0.1 + 0 * T, "u": 1 + 0 * T, "v": 0.2 + 0 * T},
    {"delta_r_cmd": 0 * T},
)
TOGETHER = [
    (Correction(scale={"psi": -1.0}), Correction(scale={"r": -1.0})),
    (Correction(scale={"psi": -1.0}), Correction(scale={"psi": 2.0, "u": 0.5})),
    (Correction(scale={"r": -1.0}), Correction(late={"u": 1.0}), Correction(offset={"psi": 0.2})),
    (Correction(offset={"psi": 0.2}), Correction(offset={"psi": -0.1})),
    (Correction(velocity_axes="earth"), Correction(offset={"psi": 0.2})),
]
APART = [
    (Correction(scale={"psi": -1.0}), Correction(offset={"psi": 0.2})),
    (Correction(scale={"psi": -1.0}), Correction(scale={"r": -1.0}, runs=("a",))),
    (Correction(rename={"u": "u_water"}), Correction(scale={"u_water": 2.0})),
    (Correction(time_scale=2.0), Correction(late={"u": 1.0})),
    *(
        pair
        for before in (
            Correction(scale={"psi": -1.0}),
            Correction(heading_from="east"),
            Correction(skip_repeats=("psi",)),
            Correction(exchange=(("psi", "r"),)),
            Correction(rename={"yaw_rate": "psi"}),
        )
        for pair in ((Correction(velocity_axes="earth"), before), (before, Correction(velocity_axes="earth")))
    ),
]


def a_finding(correction, **more):
    base = InputFinding("n", "the sign", ("psi",), ("a",), True, 0.499, ("yaw",), 0.5, 0.1, correction)
    return replace(base, **more)


@pytest.mark.parametrize("mends", TOGETHER)
def test_one_table_does_what_the_mends_do_one_after_the_other(mends):
    one, step = apply(join(mends), RUN), RUN
    for mend in mends:
        step = apply(mend, step)
    np.testing.assert_array_equal(one.t, step.t)
    for name in RUN.data:
        np.testing.assert_allclose(one.data[name], step.data[name])
    keys = [line.split(" =")[0] for line in join(mends).lines()]
    assert len(keys) == len(set(keys))


@pytest.mark.parametrize("mends", APART)
def test_mends_that_one_table_cannot_hold_are_not_joined(mends):
    assert join(mends) is None
    assert "cannot stand in one table" in joint_mend(InputCheck(tuple(map(a_finding, mends))))


def test_two_mistakes_under_one_key_are_told_as_one_line():
    words = joint_mend(InputCheck(tuple(map(a_finding, TOGETHER[0]))))
    assert "[corrections] scale = { psi = -1, r = -1 };" in words
    assert "its entries stay and these are added" in words
    problems: list[str] = []
    assert read_correction({"scale": {"psi": -1, "r": -1}}, problems) == join(TOGETHER[0]) and not problems
    assert not joint_mend(InputCheck((a_finding(TOGETHER[0][0]),))) and not joint_mend(InputCheck())


def test_the_table_of_all_mends_is_not_listed_as_a_mistake(capsys):
    """Two mistakes are two bullets."""
    summary = dict.fromkeys(("vehicle", "attribution", "name"), "") | {
        "holdout": [], "runs": [], "dof": 3, "noise": {}, "warnings": [], "joint_mend": "all mends: c",
        "input_in_order": "", "vehicle_problem": None,
    }  # fmt: skip
    _print(summary, ["a", "b"], [], False)
    out = capsys.readouterr().out
    assert out.count("  - ") == 2 and "All mends: c." in out


def test_what_a_mistake_is_not_told_from_has_its_probability_beside_it():
    words = finding_sentence(a_finding(TOGETHER[0][0], also=("psi late", "r late"), together=0.9999))
    assert "(probability 0.499; the heading against the yaw rate" in words
    told, together = words.split("; these runs do not tell it from: ")
    assert together == "psi late; r late (that one of all these is wrong has probability above 0.999)"
    assert told.count("probability") == 1


@pytest.mark.thorough
@pytest.mark.parametrize("sign, code", [(1, 0), (-1, 4)])
def test_a_check_that_finds_a_mistake_ends_with_its_own_code(sign, code, tmp_path, capsys):
    line = "simulate remus100 zigzag:10/10 turn:12 --dt 0.5 --noise x=0.2 --noise y=0.2 --noise psi=0.005"
    assert run([*line.split(), "--seed", "1", "--out", str(tmp_path / "swim")]) == 0
    with (tmp_path / "swim" / "trial.toml").open("a") as file:
        file.write(f"\n[corrections]\nscale = {{ psi = {sign} }}\n")
    assert run(["trial", "check", str(tmp_path / "swim")]) == code
    assert ("mistake" in capsys.readouterr().out) is (code == 4)
