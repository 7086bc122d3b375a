"""Blind checks: packs with committed answers, verdicts committed before the answers are opened, and their
score.

Takes bundles and answers. Does not diagnose by itself (`bayesid.diagnosis` does).
"""

from bayesid.benchmark.protocol.commitment import BlindError

__all__ = ["BlindError"]
