"""Compiled equations of motion: generated from the term table and the effects, loaded by `load_kernel`."""

from bayesid.kernels.layout import KernelSpec
from bayesid.kernels.runtime import LANES, Declared, Functions, Kernel, load_kernel

__all__ = ["LANES", "Declared", "Functions", "Kernel", "KernelSpec", "load_kernel"]
