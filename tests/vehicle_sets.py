"""Built-in sets by kind: tests with equations of their own are written for sets of rows alone."""

from bayesid.model.vehicles import builtin_names, load_vehicle

SHIPS = tuple(n for n in builtin_names() if load_vehicle(n).propulsion.model == "mmg")
ROW_SETS = tuple(n for n in builtin_names() if n not in SHIPS and not load_vehicle(n).thrusters)
