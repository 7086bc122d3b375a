"""A warning is an error here: what a user would see on the terminal is part of the behaviour.

Each exception names the library that gives the warning and why it cannot be fixed on this side.
"""

from __future__ import annotations

import os

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
