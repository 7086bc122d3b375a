"""One kernel small enough to read, for review of the printer: three rows in the plane, one effect, the full
set of functions.

`python tests/golden_kernel.py` writes `data/golden_kernel.py` anew; the difference git shows is what a change
of the printer does to every kernel.
"""

from pathlib import Path
from unittest.mock import patch

from bayesid.equations.generate import module_source
from bayesid.equations.layout import KernelSpec
from bayesid.model.effects import Effect, EffectParameter
from bayesid.model.terms import term

PATH = Path(__file__).parent / "data" / "golden_kernel.py"
ROWS = ("X_uu", "Y_vdot", "N_dr")  # drag, added mass, rudder
PUSH = Effect(
    name="push", family="push", port="force", where=("Y",), source="assumed: a test", magnitude="any",
    parameters=(EffectParameter("F", "N", 1.0, about="force to starboard"),), force={"Y": "F"},
)  # fmt: skip


def golden_text():
    rows = tuple(term(name) for name in ROWS)
    with patch("bayesid.equations.layout.TERMS", rows), patch("bayesid.equations.dynamics.TERMS", rows):
        text = module_source(KernelSpec(3), (PUSH,))
    head, rest = text.split("BARE_STATES", 1)
    return head + "FULL_STATES" + rest.split("FULL_STATES", 1)[1]


if __name__ == "__main__":
    PATH.write_text(golden_text(), encoding="utf-8")
