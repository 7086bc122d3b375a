"""python -m bayesid.benchmark.plant --count N --seed S --out FOLDER --answers FOLDER: bundles and their
answers."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from bayesid.benchmark.plant.bundles import write_pack
from bayesid.benchmark.plant.draw import KINDS, SEAS, VEHICLES
from bayesid.benchmark.plant.sensing import SUITES
from bayesid.errors import BayesidError


def main(arguments: Sequence[str] | None = None) -> int:
    """Exit code 0, or 2 with one message."""
    parser = argparse.ArgumentParser(
        prog="python -m bayesid.benchmark.plant", description="Make blind bundles."
    )
    parser.add_argument("--count", type=int, required=True)
    parser.add_argument("--seed", type=int, required=True, help="of the first bundle; the next ones count up")
    parser.add_argument("--out", required=True, help="folder of the bundles")
    parser.add_argument("--answers", required=True, help="folder of the answers, apart from the bundles")
    parser.add_argument("--kind", choices=KINDS)
    parser.add_argument("--effect", action="append", dest="effects", help="may be given twice")
    parser.add_argument("--vehicle", choices=VEHICLES)
    parser.add_argument("--dof", type=int, choices=(3, 6))
    parser.add_argument("--sensors", choices=SUITES)
    parser.add_argument("--sea", choices=SEAS)
    given = vars(parser.parse_args(arguments))
    count, seed, out, answers = (given.pop(key) for key in ("count", "seed", "out", "answers"))
    try:
        write_pack(count, seed, out, answers, **{key: value for key, value in given.items() if value})
    except BayesidError as error:
        print(error, file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
