"""The report of a diagnosis: cause, location, hold-out validation, limits and figures, one module each.

Takes a diagnosis as the record that is written to `diagnosis.json`. Does not compute.
"""
