"""The study of logged ships, on logs that are simulated: the real ones are not part of the project."""

from __future__ import annotations

import numpy as np
import pytest


@pytest.fixture(scope="module")
def study():
    import studies.real_logs.run as real_logs

    return real_logs


@pytest.mark.parametrize("name", ["kvlcc2_hsva", "esso_osaka"])
def test_the_plain_set_has_no_product_of_three_velocities_and_no_race_row(study, name):
    from bayesid.model.terms import term

    ship = study.load_vehicle(study.HERE / name / "vehicle.toml")
    plain = study.plain(ship)
    assert not [n for n in plain.coef if term(n).group == "eta" or term(n).velocity_power > 2]
    lost = set(ship.coef) - set(plain.coef)
    assert all(term(n).group == "eta" or term(n).velocity_power > 2 for n in lost)
    assert set(study.QUADRATIC_ROWS) <= set(plain.coef)


def test_a_run_begins_where_the_ship_has_gathered_way(study):
    from bayesid.trials import Run

    t = np.arange(0.0, 100.0, 1.0)
    run = Run("a", "zigzag 10/10", "identify", t, {"u": np.minimum(t / 50.0, 1.0)})
    begun = study.begun(run, 0.7)
    assert begun.t[0] == pytest.approx(36.0)  # first sample beyond 0.7 of full speed
    assert study.begun(run, None) is run


def test_an_opened_wind_is_interpolated_as_a_vector(study, tmp_path):
    from bayesid.trials import Run

    # from 350 degrees at 2 s, from 10 degrees at 4 s: from north between them, not from 180
    file = tmp_path / "a.csv"
    file.write_text(f"t[s],wind_speed[m/s],wind_from[rad]\n2,1,{np.radians(350)}\n4,1,{np.radians(10)}\n")
    t = np.array([2.0, 3.0, 4.0])
    run = study.with_wind(Run("a", "zigzag 10/10", "holdout", t, {"u": np.ones(3)}), file)
    x, y = (run.exogenous["wind_speed"] * f(run.exogenous["wind_from"]) for f in (np.cos, np.sin))
    np.testing.assert_allclose(x, np.cos(np.radians(10)), rtol=1e-12)
    np.testing.assert_allclose(y, np.sin(np.radians([-10.0, 0.0, 10.0])), atol=1e-12)


def test_without_opened_wind_the_report_says_nothing_of_it(study, tmp_path):
    from bayesid.trials import Run, Trial

    run = Run("a", "zigzag 10/10", "holdout", np.arange(3.0), {"u": np.ones(3)})
    trial = Trial("pond", tmp_path, "remus100", 3, (run,))
    assert study.in_opened_wind(trial, None, tmp_path / "wind_opened") == ""


def test_bands_count_the_time_inside_and_what_chance_makes_of_it():
    """Two runs; in one of them a draw diverged, so that it has one share fewer."""
    from studies.real_logs.bands import _channels, bands_section, good_by_chance

    seen = [{"psi": {"inside": 0.9}, "u": {"inside": 1.0}}, {"psi": {"inside": 0.7}}]
    draws = [{"psi": np.linspace(0.5, 1.0, 11), "u": np.full(11, 0.95)}, {"psi": np.linspace(0.5, 0.95, 10)}]
    found, good = _channels(list(zip(seen, draws, strict=True)))
    assert found["psi"]["inside"] == pytest.approx(0.8)
    # both have the same ten shares .5 to .95, a draw being one vehicle in both runs
    assert found["psi"]["chance"] == pytest.approx(list(np.quantile(draws[1]["psi"], (0.05, 0.95))))
    assert found["u"] == {"inside": 1.0, "chance": pytest.approx([0.95, 0.95])}
    # u of every draw is within 90 to 98 %, psi of the one that fills .95
    assert list(good[:8]) == [1] * 8 and good[9] == 2  # .9 itself is a matter of rounding
    chance = good_by_chance([good, np.zeros(7, dtype=int)])
    assert chance == pytest.approx([1.0, 1.0, 1.0])  # seven draws of both kinds
    kinds = {"zigzag": {"runs": 2, "channels": found}}
    bands = {"kinds": kinds, "good_by_chance": chance, "not_predicted": {"r9": "diverges"}}
    text, table = bands_section(bands).blocks
    assert "0 of 2 cells lie within 90 to 98, 1 below" in text.body and "r9: diverges" in text.body
    assert "1 do (1 to 1 in 90 % of them)" in text.body
    assert good_by_chance([]) == [0.0, 0.0, 0.0]  # no run was predicted
    assert list(table.rows[0]) == ["2 zigzag", "80 (52 to 93)", "100 (95 to 95)"]


def test_a_lost_run_is_the_worst_of_a_median():
    from studies.real_logs.report import _median

    assert _median([{"psi": 5.0}, {"psi": np.nan}, {"psi": 37.0}], "psi") == 37.0
    assert _median([{"psi": np.nan}, {"psi": np.nan}, {"psi": 37.0}], "psi") == np.inf
