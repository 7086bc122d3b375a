"""A log and its mirror image: y of the other sign, or heading and side of the rudder."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from bayesid.trials import Run
from bayesid.trials.correction import Correction, apply
from bayesid.trials.handedness import Handedness, handedness
from bayesid.trials.mistakes import check_input

MIRROR = "heading and side of the rudder mirrored (psi = -1, delta_r_cmd = -1)"


def log(seed: int, *rates: str) -> Run:
    """Zigzags of a first-order vehicle: position, compass, ordered rudder (positive turns to port)."""
    rng = np.random.default_rng(seed)
    t = 0.2 * np.arange(600)
    rudder = -0.2 * np.sign(np.sin(0.22 * t + seed))
    rate = [0.0]
    for order in rudder[1:]:
        rate.append(rate[-1] + 0.2 * (-0.7 * order - rate[-1]) / 1.5)
    r = np.array(rate)
    psi = 0.4 + seed + 0.2 * np.cumsum(r)
    way = 0.2 * np.cumsum(1.5 * np.exp(1j * psi))
    data = {
        "x": way.real + 0.1 * rng.normal(size=600), "y": way.imag + 0.1 * rng.normal(size=600),
        "psi": psi + 0.005 * rng.normal(size=600), "r": r + 0.003 * rng.normal(size=600),
    }  # fmt: skip
    kept = {k: v for k, v in data.items() if k in ("x", "y", "psi", *rates)}
    return Run(f"run {seed}", "", "identify", t, kept, {"delta_r_cmd": rudder})


def turned_compass(*rates: str) -> list[Run]:
    """As imported: the side of the rudder is that to which the vehicle turns by this compass."""
    wrong = Correction(scale={"psi": -1.0, "delta_r_cmd": -1.0})
    return [apply(wrong, log(seed, *rates)) for seed in (1, 2, 3)]


def test_a_compass_to_port_and_a_track_to_port_share_the_probability():
    (found,) = check_input(turned_compass()).findings
    assert {found.name, *found.also} == {"sign of y", MIRROR}
    assert 0.4 < found.probability < 0.6
    assert found.together > 0.999


def test_latitude_and_longitude_tell_that_it_is_the_compass():
    runs = turned_compass()
    (found,) = check_input(runs, known=Handedness(geographic=True)).findings
    assert found.name == MIRROR and found.also == () and found.probability > 0.99
    mended = [apply(found.correction, run) for run in runs]
    assert check_input(mended).findings == ()
    for run, true in zip(mended, (log(seed) for seed in (1, 2, 3)), strict=True):
        np.testing.assert_allclose(run.data["psi"], true.data["psi"])
        np.testing.assert_allclose(run.commands["delta_r_cmd"], true.commands["delta_r_cmd"])


def test_a_side_of_the_rudder_that_was_stated_tells_that_it_is_the_track():
    (found,) = check_input(turned_compass(), known=Handedness(side_stated=True)).findings
    assert found.name == "sign of y" and found.also == () and found.probability > 0.95


def test_a_gyro_that_counts_to_starboard_tells_that_it_is_the_compass_alone():
    wrong = Correction(scale={"psi": -1.0})
    (found,) = check_input([apply(wrong, log(seed, "r")) for seed in (1, 2, 3)]).findings
    assert found.name == "sign of psi" and not any("mirrored" in name for name in found.also)


@pytest.mark.parametrize("rates", [(), ("r",)])
def test_a_right_log_is_no_mirror_image(rates):
    assert check_input([log(seed, *rates) for seed in (1, 2, 3)]).findings == ()
    bare = [
        replace(one, data={"psi": one.data["psi"], "r": one.data["r"]}) for one in (log(1, "r"), log(2, "r"))
    ]
    assert check_input(bare).findings == ()  # without a track there is nothing to be the mirror image of


def test_what_is_known_is_read_from_the_bundle(tmp_path):
    assert handedness(tmp_path) == Handedness()
    (tmp_path / "trial.toml").write_text("format = 1\n")
    assert handedness(tmp_path) == Handedness(side_stated=True)
    for origin, stated in ((None, False), ({"latitude_deg": 59.0}, True)):
        said = {"format": 1, "origin": origin, "rudder_side_in_header": stated, "runs": []}
        (tmp_path / "provenance.json").write_text(json.dumps(said))
        assert handedness(tmp_path) == Handedness(origin is not None, stated)
    (tmp_path / "provenance.json").write_text("[")
    assert handedness(tmp_path) == Handedness(side_stated=True)


def test_an_import_writes_whether_the_header_says_the_side(tmp_path):
    from bayesid.trials.importing import apply_map, propose, write_bundle

    run = log(1)
    for head, stated in (("Rudder [deg]", False), ("Rudder (deg, port +)", True)):
        source = tmp_path / f"log_{stated}.csv"
        rows = np.column_stack((
            run.t, run.data["x"], run.data["y"], np.degrees(run.data["psi"]) % 360.0,
            np.degrees(run.commands["delta_r_cmd"]),
        ))  # fmt: skip
        heads = ["t [s]", "North [m]", "East [m]", "Heading [deg]", f'"{head}"']
        np.savetxt(source, rows, delimiter=",", header=",".join(heads), comments="")
        found = propose([source], "remus100", "trial").map
        runs, origin = apply_map(found, [source])
        write_bundle(found, runs, origin, tmp_path / f"bundle_{stated}", None)
        assert handedness(tmp_path / f"bundle_{stated}") == Handedness(side_stated=stated)


def test_the_lines_to_add_say_what_else_it_may_be(tmp_path, capsys):
    from bayesid.cli.trial_import import _mend_first

    findings = check_input(turned_compass()).findings
    _mend_first(findings, tmp_path)
    said = capsys.readouterr().out
    assert all(f"# unless it is: {name}" in said for name in findings[0].also) and findings[0].also
