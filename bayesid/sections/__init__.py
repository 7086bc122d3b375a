"""Results in words, tables and figures: one module per report. Does not compute results."""
