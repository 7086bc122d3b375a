"""Mistakes of the simulator, read out of a comparison once the verdict stands.

Takes a problem, its comparison and verdict. Gives the mistakes whose mend closes the gap. Does not change a
verdict, a vehicle file, or the search of causes.
"""

from bayesid.diagnosis.simulator.judge import find_mistakes

__all__ = ["find_mistakes"]
