"""Fits that a stopped diagnosis made are read back with the same numbers, and only for the same question."""

from dataclasses import replace

import numpy as np
import pytest
from gap_trials import model_of, planted_trial

from bayesid.diagnosis.data.problem import build_problem, fit_with
from bayesid.errors import BayesidError
from bayesid.estimation.filter_error import fit_journal
from bayesid.estimation.filter_error.fit_journal import SUFFIX, fits_kept


@pytest.fixture(scope="module")
def problem():
    model = model_of("remus100")
    return build_problem(model, planted_trial(model, {}, 3))


@pytest.fixture(scope="module")
def first(problem, tmp_path_factory):
    folder = tmp_path_factory.mktemp("first")
    with fits_kept(folder):
        return folder, fit_with(problem, ())


def files(folder):
    return sorted(folder.glob("*" + SUFFIX))


def test_a_fit_read_back_has_every_number_of_the_one_made(problem, first):
    folder, made = first
    with fits_kept(folder) as journal:
        again = fit_with(problem, ())
    assert journal.used >= 1 and not again.held
    for name in ("values", "par"):
        assert np.array_equal(getattr(made, name), getattr(again, name))
    assert (made.log_evidence, made.chi2, made.iterations, made.converged, made.path_evidence) == (
        again.log_evidence, again.chi2, again.iterations, again.converged, again.path_evidence
    )  # fmt: skip
    assert again.noise_model is problem.environment.noise_model
    assert np.array_equal(made.posterior.covariance, again.posterior.covariance)
    for g, h in zip(made.equations, again.equations, strict=True):
        assert np.array_equal(g.ss, h.ss) and (g.ee, g.logdet, g.used) == (h.ee, h.logdet, h.used)
    for kept, anew in zip(made.paths, again.paths, strict=True):
        assert np.array_equal(kept.psi, anew.psi) and np.array_equal(kept.resid, anew.resid)
    for kept, anew in zip(made.points, again.points, strict=True):
        assert np.array_equal(kept.states, anew.states) and np.array_equal(kept.force, anew.force)


def test_a_fit_made_in_the_same_diagnosis_is_not_told_as_kept_from_a_stopped_one(problem, tmp_path):
    with fits_kept(tmp_path) as journal:
        first = fit_with(problem, (), iterations=1)
        again = fit_with(problem, (), iterations=1)
    assert journal.used == 0 and np.array_equal(first.values, again.values)


@pytest.mark.parametrize("change", ["reading", "prior", "noise", "start"])
def test_another_question_is_not_answered_by_it(problem, first, change):
    folder, _ = first
    c = problem.coefficients
    if change == "reading":
        log = problem.logs[0]
        readings = log.readings.copy()
        readings[5, 0] += 1e-9
        problem = replace(problem, logs=(replace(log, readings=readings), *problem.logs[1:]))
    elif change == "prior":
        problem = replace(problem, coefficients=replace(c, sd=c.sd * (1 + 1e-12)))
    elif change == "noise":
        noise = replace(problem.environment.noise_model, drift_tau=1e-9)
        problem = replace(problem, environment=replace(problem.environment, noise_model=noise))
    else:
        moved = replace(problem.path[0], states=problem.path[0].states + 1e-12)
        problem = replace(problem, path=(moved, *problem.path[1:]))
    with fits_kept(folder) as journal:
        fit_with(problem, (), iterations=1)
        assert journal.used == 0


def test_a_damaged_file_is_as_good_as_none(problem, first, tmp_path):
    folder, made = first
    for path in files(folder):
        (tmp_path / path.name).write_bytes(path.read_bytes()[:-200])
    with fits_kept(tmp_path) as journal:
        again = fit_with(problem, ())
    assert journal.used == 0 and np.array_equal(again.values, made.values)
    with fits_kept(tmp_path) as journal:  # and it is written anew
        fit_with(problem, ())
    assert journal.used == 1


def test_a_full_disk_is_one_warning_and_no_number_is_lost(problem, first, tmp_path, monkeypatch):
    def full(path, content):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(fit_journal, "write_atomic", full)
    with fits_kept(tmp_path), pytest.warns(UserWarning, match="refits cannot be kept there") as caught:
        again = fit_with(problem, ())
    assert len(caught) == 1 and np.array_equal(again.values, first[1].values)


def test_a_folder_that_cannot_be_made_is_an_error_with_its_path(tmp_path):
    (tmp_path / "file").write_text("")
    with (
        pytest.raises(BayesidError, match=r"file/refits: cannot be written"),
        fits_kept(tmp_path / "file" / "refits"),
    ):
        pass


def test_what_is_done_leaves_nothing_behind(problem, tmp_path):
    with fits_kept(tmp_path / "refits") as journal:
        fit_with(problem, (), iterations=1)
    assert files(tmp_path / "refits")
    journal.clear()
    assert not (tmp_path / "refits").exists()
