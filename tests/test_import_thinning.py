"""A `step` keeps one reading per channel and step, also of logs that write a line per message."""

import numpy as np
import pytest

from bayesid.trials.importing.raw import Request, SourceOptions
from bayesid.trials.importing.readers import read_log
from bayesid.trials.importing.tables import Columns, channels_of, choose_time
from bayesid.trials.importing.thinning import Thinning

NAN = float("nan")


@pytest.mark.parametrize("cut", [None, 7])
def test_channels_that_share_no_row_are_each_thinned_by_themselves(cut):
    """Orders at 20 Hz, positions at 4 Hz in rows of their own: thinned by rows, only orders were left."""
    t = np.sort(np.concatenate([np.arange(0.0, 10.0, 0.05), np.arange(0.02, 10.0, 0.25)]))
    place = np.isclose((t - 0.02) % 0.25, 0.0, atol=1e-9) | np.isclose((t - 0.02) % 0.25, 0.25, atol=1e-9)
    columns = {"lat": np.where(place, t, NAN), "order": np.where(place, NAN, np.floor(t / 3.1)), "other": t}
    request = Request(frozenset({"lat", "order"}), step=0.5, switching=frozenset({"order"}))
    thinning, times, read = Thinning(request), [], {"lat": [], "order": []}
    for part in np.split(np.arange(t.size), [cut] if cut else []):
        rows, data = thinning.keep(t[part], {n: v[part] for n, v in columns.items()})
        times.append(t[part][rows])
        for name, values in data.items():
            read[name].append(values)
    times, read = np.concatenate(times), {n: np.concatenate(v) for n, v in read.items()}
    seen = times[np.isfinite(read["lat"])]
    np.testing.assert_array_equal(np.unique(np.floor(seen / 0.5), return_counts=True)[1], np.ones(20))
    np.testing.assert_array_equal(read["lat"][np.isfinite(read["lat"])], seen)
    ordered = np.isfinite(read["order"])
    changes = times[ordered][1:][np.diff(read["order"][ordered]) != 0]
    was = t[~place][1:][np.diff(columns["order"][~place]) != 0]
    np.testing.assert_array_equal(changes, was)
    assert 20 <= ordered.sum() <= 23


def test_the_first_row_stays_for_windows_count_from_it():
    request = Request(frozenset({"x"}), step=1.0)
    rows, data = Thinning(request).keep(np.array([0.0, 0.2, 0.4]), {"x": np.array([NAN, NAN, 3.0])})
    assert list(rows) == [0, 2] and data["x"][1] == 3.0


@pytest.mark.parametrize("as_text", [True, False])
def test_a_file_whose_wanted_columns_are_empty_is_read(tmp_path, as_text):
    request = Request(frozenset({"x"}), step=1.0)
    if as_text:
        (tmp_path / "log.csv").write_text("t,x\n0.0,\n0.5,\n2.5,\n")
        found = dict(read_log(tmp_path / "log.csv", request=request).by_name)
    else:
        columns = Columns({"t": np.array([0.0, 0.5, 2.5]), "x": np.full(3, NAN)})
        choice = choose_time(columns, SourceOptions(), "log")
        found = {c.name: c for c in channels_of(columns, choice, request, "log")[0]}
    assert all(not np.isfinite(c.values).any() for c in found.values())
