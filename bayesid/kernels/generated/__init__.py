"""Compiled-kernel sources, one module per kernel; see `bayesid.kernels.generate`."""
