"""`bayesid sample`: the answer, the exit code below the convergence check, and going on."""

from __future__ import annotations

import json
import shutil

import numpy as np
import pytest

from bayesid.cli.main import run
from bayesid.estimation.sampling import load_posterior

NOISE = {"x": 1.0, "y": 1.0, "psi": 0.005, "r": 0.0005}
CHOICE = ["--free", "N_v,N_r,N_dr", "--prior", "0.2"]


@pytest.fixture(scope="module")
def pond(tmp_path_factory):
    folder = tmp_path_factory.mktemp("pond")
    noise = [part for name, sigma in NOISE.items() for part in ("--noise", f"{name}={sigma}")]
    executed = ["simulate", "generic_sub", "turn:25,duration=200", "--dt", "4", "--out", str(folder)]
    assert run([*executed, *noise, "--seed", "1"]) == 0
    return folder


@pytest.mark.thorough
def test_a_chain_cut_short_is_code_3_and_resumed_it_converges_around_the_truth(pond, tmp_path, capsys):
    short = ["sample", str(pond), "--out", str(tmp_path), *CHOICE]
    assert run([*short, "--max-steps", "20"]) == 3
    said = capsys.readouterr().out
    assert "Not converged; no interval is final" in said
    assert "no interval is final" in (tmp_path / "report.md").read_text(encoding="utf-8")
    assert run([*short]) == 2
    assert "holds a chain already" in capsys.readouterr().err
    assert run([*short, "--resume", "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["converged"] and answer["rhat_max"] <= 1.01 and answer["steps_in_tau"] >= 50
    group = next(g for g in answer["groups"] if set(g["names"]) == {"N_v", "N_r"})
    best, worst = (group["combinations"][i] for i in (0, -1))
    assert best["sd_over_prior"] < 0.25 * worst["sd_over_prior"]  # a turn knows them by their ratio
    for one in (best, worst):  # the ridge bends: draws are a quarter wider than the Laplace approximation
        assert one["sd_over_prior"] == pytest.approx(one["laplace"], rel=0.5)
    page = (tmp_path / "report.md").read_text(encoding="utf-8")
    assert page.index(best["name"]) < page.index("R-hat across ensembles") and "N_dr" in page
    posterior = load_posterior(tmp_path / "posterior.nc")
    assert posterior.names[:3] == ("N_v", "N_r", "N_dr") and posterior.names[3].startswith("sigma:")
    truth = posterior.prior_mean[:3]  # the vehicle flew as its file says
    assert np.all(np.abs(posterior.mean[:3] - truth) < 4 * posterior.sd[:3])
    assert np.all(posterior.sd[:3] < 0.8 * posterior.prior_sd[:3])
    assert {p.name for p in tmp_path.iterdir()} >= {"chain", "fit.json", "report.html", "results.json"}


def test_settings_that_exclude_each_other_are_told_before_any_work(pond, tmp_path, capsys):
    assert run(["sample", str(pond), "--out", str(tmp_path), "--student", "4"]) == 2
    assert "Student-t noise has no closed form" in capsys.readouterr().err
    assert not any(tmp_path.iterdir())


@pytest.mark.thorough
@pytest.mark.usefixtures("without_pictures")
def test_runs_are_sampled_in_pieces_on_request(pond, tmp_path, capsys):
    line = [
        "sample",
        str(pond),
        "--out",
        str(tmp_path),
        *CHOICE,
        "--pieces",
        "100",
        "--max-steps",
        "10",
        "--quick",
    ]
    assert run(line) == 3
    assert "Not converged" in capsys.readouterr().out
    found = json.loads((tmp_path / "results.json").read_text(encoding="utf-8"))
    times = found["settings"]["correlation_times"]
    assert {name.split(":")[0].split()[-1] for name in times} == {"1/3", "2/3", "3/3"}
    page = (tmp_path / "report.md").read_text(encoding="utf-8")
    assert "cut into 3 pieces" in page and "Noise comes out larger" not in page


@pytest.mark.thorough
@pytest.mark.usefixtures("without_pictures")
def test_noise_stated_a_tenth_of_what_readings_show_is_told_and_not_used(pond, tmp_path, capsys):
    stated = tmp_path / "stated"
    shutil.copytree(pond, stated)
    text = (stated / "trial.toml").read_text(encoding="utf-8")
    assert "\ny = 1.0\n" in text
    (stated / "trial.toml").write_text(text.replace("\ny = 1.0\n", "\ny = 0.1\n"), encoding="utf-8")
    line = ["sample", str(stated), "--out", str(tmp_path / "out"), *CHOICE, "--max-steps", "10", "--quick"]
    assert run(line) == 3
    said = capsys.readouterr().out
    assert "Noise stated against noise seen" in said and "y 1/" in said
    assert "Noise comes out larger" not in said
    assert "noise seen" in (tmp_path / "out" / "report.md").read_text(encoding="utf-8")
