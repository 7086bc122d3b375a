"""The study of logged ships, on logs that are simulated: the real ones are not part of the project."""

from __future__ import annotations

from types import SimpleNamespace

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
    """Ten vehicles through two runs; vehicle 3 diverged in the first of them, vehicle 7 in the second."""
    from studies.real_logs.bands import _channels, above_by_chance, bands_section, good_by_chance

    seen = [{"psi": {"inside": 0.9}, "u": {"inside": 1.0}}, {"psi": {"inside": 0.7}}]
    first = np.linspace(0.5, 0.95, 10)
    draws = [{"psi": first, "u": np.full(10, 0.95)}, {"psi": 1.88 - first}]
    draws[0]["psi"][3] = draws[0]["u"][3] = draws[1]["psi"][7] = np.nan
    found, good, above = _channels(list(zip(seen, draws, strict=True)))
    assert found["psi"]["inside"] == pytest.approx(0.8)
    # vehicle by vehicle the two shares add up to 1.88, so that chance leaves no spread; paired by position
    # among those that are left, vehicle 4 would stand beside vehicle 3
    assert found["psi"]["chance"] == pytest.approx([0.94, 0.94])
    assert found["u"] == {"inside": 1.0, "chance": pytest.approx([0.95, 0.95])}
    assert np.flatnonzero(np.isnan(good)).tolist() == [3, 7]
    assert set(good[np.isfinite(good)]) == {2.0} and np.nansum(above) <= 7  # ties are a matter of rounding
    chance = good_by_chance([good, np.array([1.0] * 9 + [np.nan])])
    assert chance == pytest.approx([3.0, 3.0, 3.0])  # of the seven that no run of either kind lost
    kinds = {"zigzag": {"runs": 2, "channels": found}}
    bands = {
        "kinds": kinds, "good_by_chance": chance, "above_by_chance": [0.4, 2.0], "lost": 3, "drawn": 10,
        "not_predicted": {"r9": "diverges"},
    }  # fmt: skip
    text, table = bands_section(bands).blocks
    assert "0 of 2 cells lie within 90 to 98, 1 below" in text.body and "r9: diverges" in text.body
    assert "a median of 3 and lies within 3 to 3 for 90 % of them" in text.body
    assert "1 of the cells lie above it, of such a vehicle 0.4 on average and at most 2" in text.body
    assert "diverge in one of the runs: 3 of 10." in text.body
    assert list(table.rows[0]) == ["2 zigzag", "80 (94 to 94)", "100 (95 to 95)"]
    assert "diverge" not in bands_section(bands | {"lost": 0, "not_predicted": {}}).blocks[0].body
    assert good_by_chance([]) == [0.0, 0.0, 0.0] and above_by_chance([]) == [0.0, 0.0]  # nothing predicted


def test_held_out_runs_are_other_occasions_of_the_same_vehicles(monkeypatch):
    import studies.real_logs.bands as bands
    from bayesid.prediction.prediction import Prediction
    from bayesid.trials import Run

    t, met = np.arange(50.0), []
    runs = [Run(f"r{i}", "zigzag 10/10", "holdout", t, {"u": np.ones(50)}) for i in range(3)]
    runs[2] = Run("r2", "zigzag 10/10", "holdout", t, {"u": np.where(t > 10.0, np.nan, 1.0)})

    def predicted(model, run, draws, seed, occasion):
        met.append((run.name, seed, occasion))
        left = np.delete(np.arange(draws), occasion)  # vehicle k diverges in run k
        values = np.random.default_rng(occasion).normal(1.0, 0.1, (left.size, 50, 1))
        return Prediction(
            run.name, run.manoeuvre, t, ("u",), values, {}, None, 10.0, 1, np.zeros(1), vehicles=left,
            occasion=occasion,
        )  # fmt: skip

    sized = SimpleNamespace(level={}, tau=1.0, channel={}, keeps_prior=False)
    monkeypatch.setattr(bands, "predictive_model", lambda *_: (None, sized))
    monkeypatch.setattr(bands, "predict_run", predicted)
    found = bands.held_out_bands(None, runs, 7)
    assert met == [("r0", 7, 0), ("r1", 7, 1), ("r2", 7, 2)]
    assert found["lost"] == 2 and found["kinds"]["zigzag"]["runs"] == 2
    assert found["not_predicted"] == {"r2": "nothing is read after its first 10 s"}


def test_a_kind_of_motion_of_which_nothing_is_read_counts_no_cell():
    from studies.real_logs.bands import _channels, above_by_chance, good_by_chance

    found, good, above = _channels([({}, {})])
    assert found == {}
    assert good_by_chance([good, np.ones(5)]) == [1.0, 1.0, 1.0]
    assert above_by_chance([above, np.zeros(5)]) == [0.0, 0.0]


def test_cells_above_by_chance_are_as_many_as_their_limits_leave():
    """Of 12 cells whose vehicles fill any share alike, .05 each lie above; of one that all fill, none."""
    from studies.real_logs.bands import _channels, above_by_chance

    rng = np.random.default_rng(1)
    names = [f"c{i}" for i in range(12)]
    draws = {name: rng.uniform(size=400) for name in names} | {"full": np.full(400, 1.0)}
    seen = {name: {"inside": 0.95} for name in draws}
    _, _, above = _channels([(seen, draws)])
    mean, most = above_by_chance([above])
    assert mean == pytest.approx(0.6) and most == 2.0


def test_a_lost_run_is_the_worst_of_a_median():
    from studies.real_logs.report import _median

    assert _median([{"psi": 5.0}, {"psi": np.nan}, {"psi": 37.0}], "psi") == 37.0
    assert _median([{"psi": np.nan}, {"psi": np.nan}, {"psi": 37.0}], "psi") == np.inf
