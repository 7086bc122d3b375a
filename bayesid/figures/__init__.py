"""Figures drawn from results; each function returns a matplotlib figure and writes nothing."""
