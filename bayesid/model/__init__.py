"""What a vehicle model is made of: force terms, effects, vehicle files, propulsion, parameters, channels,
units.

Takes TOML files and the declarations in these packages. Holds data and their checks only: the equations of
motion are `bayesid.equations`, runs are `bayesid.simulation`. Every part is imported from its own module;
this one is empty.
"""
