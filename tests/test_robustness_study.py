"""The robustness study counts what the present code did, adds days up, and tells the rest apart."""

from __future__ import annotations

from bayesid.files import write_json
from studies.robustness.kept import Kept, added
from studies.robustness.report import growth_words, robustness_report
from studies.robustness.run import SUMS, _found
from studies.robustness.scaling import DASK, HERE, KILLED, PROCESSES, WORKS

KILL = {"command": "fit", "fault": "SIGINT", "sent": 3, "finished": 3, "same": 3, "wrong": []}


def test_rows_of_other_code_are_kept_apart_and_those_of_several_days_add_up(tmp_path, monkeypatch):
    monkeypatch.setattr("studies.robustness.kept.loaded_code", lambda: "new")
    kept = Kept(tmp_path, ("new",))
    write_json(tmp_path / "old.json", {"code": "old", "commit": "abc", "rows": [KILL | {"same": 1}]})
    kept.write("seed 1, fit", [KILL], done=3)
    kept.write("seed 2, fit", [KILL | {"same": 2, "wrong": ["differs"]}], done=3)
    found = _found(kept, SUMS["kills"])
    assert found["rows"] == [KILL | {"sent": 6, "finished": 6, "same": 5, "wrong": ["differs"]}]
    assert found["earlier"] == {"abc": [KILL | {"same": 1}]}
    assert kept.read("seed 1, fit")["done"] == 3
    assert kept.read("seed 3, fit") is None
    both = Kept(tmp_path, ("new", "old"))
    assert sum(r["same"] for r in added(both.rows(), *SUMS["kills"])) == 6


def test_the_report_of_plain_rows_says_what_differed():
    def row(way, apart=()):
        return {
            "work": "pack of 40 bundles", "way": way, "tasks": 40, "codes": [0], "words": "", "cpu": 80.0,
            "task_cpu": 60.0, "scheduler_cpu": 1.0, "client_cpu": 1.0, "command_cpu": 5.0, "busy": 0.9,
            "apart": list(apart),
        }  # fmt: skip

    empty = row(DASK) | {"work": "500 tasks without work", "tasks": 500}
    assert empty["work"] in WORKS
    found = {
        "kills": {"commits": ["abc"], "rows": [KILL], "earlier": {"old": [KILL]}},
        "faults": {"commits": ["abc"], "rows": [], "earlier": {}},
        "fuzz": {"commits": ["abc"], "rows": [], "earlier": {}},
        "scaling": {"commits": ["abc"], "rows": [row(HERE), row(PROCESSES), row(DASK), row(KILLED), empty]},
        "sizes": {"commits": ["abc"], "rows": []},
    }
    text = repr(robustness_report(found))
    assert "none differs" in text and "3 of 3 the same (old)" in text
    assert "hands out 500 a second" in text  # 500 tasks, 1 s of the scheduler
    found["scaling"]["rows"][2] = row(DASK, ["b00/diagnosis.json: differs"])
    assert "1 differ" in repr(robustness_report(found))


def test_growth_of_memory_is_that_of_the_rows():
    rows = [
        {"size": f"length {h} h, diagnose", "mb": mb, "rows": 3600 * h} for h, mb in ((3, 600.0), (10, 852.0))
    ]
    assert "from 10800 to 36000 samples it grows by 10 kB" in growth_words(rows)
    assert growth_words(rows[:1]) == ""
