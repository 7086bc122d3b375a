"""Logs as they are become trial bundles: raw series read, mapped to channels, converted, joined, written.

`propose` guesses a map of files nobody has described; `apply_map` and `write_bundle` carry a map out.
Does not: change a log, or take anything doubtful without a question.
"""

from bayesid.trials.importing.bundle_out import check_bundle, write_bundle
from bayesid.trials.importing.joining import apply_map
from bayesid.trials.importing.log_map import LogMap, read_map
from bayesid.trials.importing.map_text import map_text
from bayesid.trials.importing.proposing import Proposal, propose
from bayesid.trials.importing.raw import ImportLogError

__all__ = [
    "ImportLogError",
    "LogMap",
    "Proposal",
    "apply_map",
    "check_bundle",
    "map_text",
    "propose",
    "read_map",
    "write_bundle",
]
