"""A warning is an error here: what a user would see on the terminal is part of the behaviour.

Each exception names the library that gives the warning and why it cannot be fixed on this side.
"""

from __future__ import annotations

import os
from importlib import import_module

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
    monkeypatch.setattr(
        import_module("bayesid.report.import_figure"), "draw_runs", lambda proposal, folder: []
    )
