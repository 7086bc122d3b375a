"""Hypotheses about a gap: screened on linearised runs, located, refitted, compared, decided between.

Takes a problem of `diagnosis.data`. Does not validate on held-out runs; that is `diagnosis.evidence`.
"""
