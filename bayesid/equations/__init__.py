"""Compiled equations of motion, printed from the term table and the effects at first use: `load_kernel`."""

from bayesid.equations.layout import KernelSpec
from bayesid.equations.runtime import LANES, Declared, Functions, Kernel, load_kernel

__all__ = ["LANES", "Declared", "Functions", "Kernel", "KernelSpec", "load_kernel"]
