"""Results in words, tables and figures: one module per command, its figures beside it, written by `writer`.

Takes the results of the library as they are. Computes nothing that a result does not hold.
"""
