"""`bayesid identify`: what a bundle leaves open, before and after a fit, and that a report is written."""

from __future__ import annotations

import json

import pytest

import bayesid
from bayesid.cli.main import run


@pytest.fixture(scope="module")
def pond(tmp_path_factory):
    folder = tmp_path_factory.mktemp("pond")
    noise = ["--noise", "x=1", "--noise", "y=1", "--noise", "psi=0.01"]
    executed = ["simulate", "generic_sub", "zigzag:20/20", "--dt", "2", "--out", str(folder)]
    assert run([*executed, *noise, "--seed", "1"]) == 0
    return folder


def test_a_bundle_names_its_structural_directions(pond, capsys):
    assert run(["identify", str(pond), "--no-profile", "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    words = [d["words"] for d in answer["directions"] if d["kind"] == "structural"]
    assert words == ["scale of the sway equation", "scale of the yaw equation"]
    assert answer["n_fixed"] + len(answer["directions"]) == len(answer["names"]) == 22
    assert any("no noise is stated for" in line for line in answer["remarks"])


@pytest.mark.thorough
def test_three_coefficients_are_fixed_and_a_report_says_so(pond, tmp_path, capsys):
    assert run(["identify", str(pond), "--free", "N_v,N_r,N_dr", "--out", str(tmp_path), "--quick"]) == 0
    assert (
        "The data fix all 3 combinations of the 3 coefficients; 3 coefficients singly."
        in capsys.readouterr().out
    )
    assert {p.name for p in tmp_path.iterdir()} >= {
        "report.html",
        "report.md",
        "results.json",
        "profile.jsonl",
    }


@pytest.mark.usefixtures("without_pictures")
def test_a_fit_moves_the_point_looked_at(pond, tmp_path, capsys):
    assert run(["fit", str(pond), "--free", "N_v,N_dr", "--out", str(tmp_path), "--quick"]) == 0
    capsys.readouterr()
    assert run(["identify", str(pond), "--fit", str(tmp_path), "--json", "--no-profile"]) == 0
    answer = json.loads(capsys.readouterr().out)
    stored = json.loads((tmp_path / "fit.json").read_text())
    assert answer["names"] == ["N_v", "N_dr"] and "earlier fit" in answer["point"]
    assert answer["entries"]["N_dr"]["value"] == pytest.approx(stored["z"][1])


def test_an_unknown_coefficient_is_refused_in_one_sentence(pond, capsys):
    assert run(["identify", str(pond), "--free", "N_nothing"]) == 2
    assert "N_nothing" in capsys.readouterr().err


def test_channels_without_noise_do_not_fix_what_nothing_excites():
    """A simulated log has no noise on u and v unless asked for: N_v was told to 1e-14 of its value."""
    trial = bayesid.simulate("generic_sub", "turn:25", dt=2.0, noise={"x": 1.0, "y": 1.0, "psi": 0.005})
    found = bayesid.identify(trial, free="N_v,N_r,N_dr", prior=0.2, profile=False)
    assert any("no noise to speak of in u, v, r" in remark for remark in found.facts["remarks"])
    sd = {e.name: e.sd / e.prior_sd for e in found.found.entries}
    assert 1e-3 < sd["N_v"] < 1.0 and 1e-3 < sd["N_r"] < 1.0
