"""Studies: one folder per question, with `run.py` (settings and calls), its report and its targets.

Run one with `bayesid study NAME` or `python -m studies.NAME.run` from a checkout. Not part of the installed
package.
"""
