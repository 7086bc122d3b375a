"""A share in % or a pulse width mapped to revolutions or an angle: told, with the line to write."""

from __future__ import annotations

import numpy as np
import pytest

from bayesid.cli.main import run as bayesid

T = np.arange(0.0, 60.0, 0.5)
PSI = 0.3 * np.sin(T / 10)
NORTH, EAST = 0.5 * np.cumsum([np.cos(PSI), np.sin(PSI)], axis=1)
SWING = np.where((T // 10) % 2 == 0, 1.0, -1.0)
HEAD = "t [s],north [m],east [m],heading [rad],rudder_deg,rudder_pct,throttle_pct,servo_us,shaft"
MAP = """format = 1
[sources.log]
files = ["a.csv"]
[channels]
north = { from = "north [m]", unit = "m" }
east = { from = "east [m]", unit = "m" }
heading = { from = "heading [rad]", unit = "rad" }
"""
RUDDER = 'delta_r_cmd = "rudder_deg"'
RPM = 'n_cmd = { from = "throttle_pct", scale = ..., unit = "rpm" } (scale: rpm at full throttle over 100)'
PULSE = 'n_cmd = { from = "servo_us", scale = ..., offset = ..., unit = "rpm" }'


def imported(folder, *lines):
    columns = (T, NORTH, EAST, PSI, 6 * SWING, 20 * SWING, 65 + 5 * SWING, 1500 + 200 * SWING, 700 + SWING)
    rows = [",".join(f"{x:.5f}" for x in row) for row in zip(*columns, strict=True)]
    (folder / "a.csv").write_text("\n".join([HEAD, *rows]) + "\n")
    (folder / "map.toml").write_text(MAP + "\n".join(lines) + "\n")
    order = ["trial", "import", str(folder / "a.csv"), "--map", str(folder / "map.toml")]
    return bayesid([*order, "--out", str(folder / "bundle")])


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ('n_cmd = { from = "throttle_pct", unit = "%" }', f"% is a share, and n_cmd is in rpm; write {RPM}"),
        ('n_cmd = { from = "throttle_pct", unit = "percent" }', RPM),
        ('n_cmd = "throttle_pct"', RPM),
        ('n_port_cmd = { from = "throttle_pct", unit = "%" }', f"write {RPM.replace('n_cmd', 'n_port_cmd')}"),
        ('n_cmd = { from = "servo_us" }', f"[us] is a pulse width, and n_cmd is in rpm; write {PULSE}"),
        (  # what is given stays
            'n_cmd = { from = "throttle_pct", scale = 15 }',
            'write n_cmd = { from = "throttle_pct", scale = 15.0, unit = "rpm" }',
        ),
        (
            'delta_s_cmd = { from = "rudder_pct", unit = "%" }',
            'scale = ..., unit = "deg" } (scale: degrees at full deflection over 100)',
        ),
        ('u = "throttle_pct"', "[%] is a unit of share, but speed"),  # no actuator's: as before
    ],
)
def test_a_share_is_refused_with_what_to_write(tmp_path, capsys, line, words):
    assert imported(tmp_path, RUDDER, line) == 2
    assert words in capsys.readouterr().err


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ('n_cmd = { from = "throttle_pct", unit = "rpm" }', f"read as n_cmd in rpm as it is; write {RPM}"),
        ('n_cmd = { from = "throttle_pct", scale = 15.0, unit = "rpm" }', None),
        ('n_cmd = { from = "servo_us", unit = "rpm" }', "'servo_us' is called a pulse width in us and"),
        ('n_cmd = { from = "servo_us", offset = -1500.0, unit = "rpm" }', None),
        ('n_cmd = { from = "shaft", unit = "rpm" }', None),
    ],
)
def test_a_share_read_as_revolutions_without_a_scale_is_remarked(tmp_path, capsys, line, words):
    assert imported(tmp_path, RUDDER, line) == 0
    said = capsys.readouterr().out
    assert "as it is; write" not in said if words is None else words in said
