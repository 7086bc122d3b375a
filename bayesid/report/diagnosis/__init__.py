"""The report of a diagnosis: cause, location, hold-out validation, limits and figures, one module each.

Takes the `Result` of a diagnosis, of which `diagnosis.json` is another view. Does not compute.
"""
