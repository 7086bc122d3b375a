"""A warning is an error here: what a user would see on the terminal is part of the behaviour.

Each exception names the library that gives the warning and why it cannot be fixed on this side.
"""

from __future__ import annotations

import os
from importlib import import_module
from warnings import catch_warnings, simplefilter

import pytest

os.environ.setdefault("MPLBACKEND", "Agg")
# `make test` runs a process per core: threads of the linear algebra would only wait for each other
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

ALLOWED_WARNINGS = (
    # arviz 0.23 announces its 1.x rewrite on import; both generations are supported through one module
    r"ignore:\s*ArviZ is undergoing a major refactor:FutureWarning",
    # libraries compiled against an older numpy report a larger array struct; harmless by numpy's own word
    "ignore:numpy.ndarray size changed:RuntimeWarning",
)


def pytest_configure(config):
    config.addinivalue_line("filterwarnings", "error")
    for line in ALLOWED_WARNINGS:
        config.addinivalue_line("filterwarnings", line)


def pytest_sessionstart(session):
    """Workers that start beside each other compile different parts first: each took 15 s for the filters of a
    fresh checkout, at the same time. Where all is compiled it costs a second, most of it imports."""
    first = {"gw0": compiled_filters, "gw1": compiled_plant}.get(os.environ.get("PYTEST_XDIST_WORKER", ""))
    if first is not None:
        with catch_warnings():
            simplefilter("ignore")
            first()


def compiled_filters():
    """Whitening and smoothing."""
    from bayesid.analysis.excitation.track_smoother import smooth_tracks
    from bayesid.api.simulate import simulate
    from bayesid.equations.model import build_model
    from bayesid.model.vehicles import load_vehicle

    trial = simulate(
        "generic_sub", "zigzag:20/20,duration=100", dt=4.0, noise={"x": 1.0, "y": 1.0, "psi": 0.01}
    )
    smooth_tracks(build_model(load_vehicle("generic_sub"), 3), trial.runs, trial.noise, 0.0)


def compiled_plant():
    """A run of the plant of the blind checks."""
    import numpy as np

    from bayesid.benchmark.plant.body import build
    from bayesid.benchmark.plant.execute_run import execute_run, start_state
    from bayesid.benchmark.plant.settings import settings
    from bayesid.model.vehicles import load_vehicle

    vehicle, gap = load_vehicle("generic_sub"), settings()
    orders = np.tile([0.0, 0.0, vehicle.rpm_ref], (3, 1))
    body = build(vehicle, vehicle.coef, 3, gap)
    execute_run(body, gap, np.arange(3.0), orders, start_state(2.0, 0.0, 0.0, gap, (0, 0)))


# one white pixel
PIXEL = bytes.fromhex(
    "89504e470d0a1a0a0000000d4948445200000001000000010802000000907753de0000000c49444154789c63f8ffff3f0005fe02fe"
    "0defbfe50000000049454e44ae426082"
)


@pytest.fixture
def without_pictures(monkeypatch):
    """Figures of reports and of imports are made but not rendered, which is half of what a command costs.

    For tests of words and numbers of a command whose pictures another test has rendered.
    """
    monkeypatch.setattr(
        import_module("bayesid.report.writer.write"), "png_and_svg", lambda figure: (PIXEL, None)
    )
    for name in ("draw_runs", "draw_imported"):
        monkeypatch.setattr(import_module("bayesid.report.import_figure"), name, lambda shown, folder: [])
