"""Blind checks: packs with sealed answers, verdicts sealed before the answers are opened, and their score.

Takes bundles and answers. Does not diagnose by itself (`bayesid.diagnose` does).
"""

from bayesid.blind.seal import BlindError

__all__ = ["BlindError"]
