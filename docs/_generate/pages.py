"""What may stand for a marker `<!-- generated: name -->`: per name a function that gives Markdown."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

from _generate.commands import commands, exit_codes
from _generate.effects import effect_index, effects
from _generate.files import channels, coefficients_read, diagnosis_fields, propulsion, vehicles
from _generate.method import priors, references, rules, terms, thresholds
from _generate.names import manoeuvres, public_names
from _generate.real_logs import real_logs

PAGES: dict[str, Callable[[], str]] = {
    page.__name__: cache(page)
    for page in (
        channels, coefficients_read, commands, diagnosis_fields, effect_index, effects, exit_codes,
        manoeuvres, priors, propulsion, public_names, real_logs, references, rules, terms, thresholds,
        vehicles,
    )
}  # fmt: skip
