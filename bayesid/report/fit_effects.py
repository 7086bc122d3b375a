"""Effects freed in a fit, as sentences in engineering units with their standard deviation.

Takes a `TrialFit`. Gives text; words and units are those of the effects' declarations.
"""

from __future__ import annotations

import math

from scipy.stats import chi2

from bayesid.diagnosis.plain_words import sentence
from bayesid.diagnosis.result_parts import Effect, Value
from bayesid.diagnosis.size_names import UNTOLD, contract, in_sentence, said_of
from bayesid.estimation.trial_fit import TrialFit
from bayesid.words import digits

_DEGREE = 180.0 / math.pi
# unit inside -> unit shown and factor to it
SHOWN = {"rad": ("deg", _DEGREE), "rad/s": ("deg/s", _DEGREE), "s/rad": ("s/deg", 1.0 / _DEGREE)}
# Chance that an effect which is absent shows in a fit (likelihood ratio, chi-square of its amplitudes).
FALSE_ALARM = 0.01
# Standard deviations from which a size looks told by itself, and up to which it may be none.
FAR, NEAR = 3.0, 2.0
# Share of its prior's that a standard deviation keeps where the runs tell little of a size.
OPEN = 0.5


def effect_words(found: TrialFit) -> list[str]:
    """One text per effect freed: its sentence, and every parameter with one standard deviation."""
    out = []
    for effect in _effects(found):
        own = _own(found, effect.name)
        gain = found.gains.get(effect.name, math.inf)
        sizes = ", ".join(parameter_words(found, f"{effect.name}.{p}") for p in own)
        out.append(f"{_says(found, effect, own, gain)} ({sizes}, one sd; {gain:.3g} nats).")
    return out


def _says(found: TrialFit, effect: Effect, own: list[str], gain: float) -> str:
    """Whether an effect shows, is open, or is what its declaration says of it."""
    model, name = found.model, effect.name
    declared = model.effects[name]
    grows = [p for p in own if model.effect_off[model.index[f"{name}.{p}"]] == 0.0]
    dated = {p.name for p in declared.parameters if p.dated}  # a time that is sought fits noise as well
    shows = gain >= 0.5 * float(chi2.isf(FALSE_ALARM, max(len({*grows, *(dated & set(own))}), 1)))
    stated = {p for p in own if f"{name}.{p}" in model.vehicle.effects}
    sizes = _sizes(found, name, grows)
    if not shows:
        widths = [model.prior_sd(f"{name}.{p}") for p in grows]
        if grows and all(sd > OPEN * width for (_, sd, _), width in zip(sizes, widths, strict=True)):
            return f"These runs do not tell {name}"
        as_stated = "is as the vehicle file states" if stated else "does not show in these runs"
        far = any(abs(value - known) > FAR * sd for value, sd, known in _sizes(found, name, own))
        return f"{name} {as_stated}" + (
            ": with all else fitted again they do without these sizes as well" if far else ""
        )
    if grows and all(abs(value - known) < NEAR * sd for value, sd, known in sizes):
        none = "what the vehicle file states" if stated else "none"
        return f"{name} is open: its size is within two standard deviations of {none}"
    needed = in_sentence(declared, effect.says)
    told = needed & set(own)
    over = bool(stated) and effect.says != declared.says and needed <= set(own)
    if over or (told and not told & stated):
        return sentence(effect).removesuffix(".")
    # the sentence tells an effect the simulator has not, or sizes that were not asked for
    return f"{name} has other sizes than the vehicle file states"


def _sizes(found: TrialFit, effect: str, own: list[str]) -> list[tuple[float, float, float]]:
    """Value, sd, and value as the vehicle states it, of each parameter that was freed."""
    model = found.model
    return [
        (*_value(found, key), float(model.nominal[model.index[key]]))
        for key in (f"{effect}.{p}" for p in own)
    ]


def parameter_words(found: TrialFit, name: str) -> str:
    """ "tau 0.31 ± 0.02 s", in degrees where the program has radians."""
    value, sd = _value(found, name)
    unit, factor = SHOWN.get(found.model.parameter_unit(name) or "", (found.model.parameter_unit(name), 1.0))
    behind = "" if unit in (None, "-") else f" {unit}"
    return f"{name.partition('.')[2]} {digits(factor * value, 3)} ± {digits(factor * sd, 2)}{behind}"


def freed(found: TrialFit) -> tuple[str, ...]:
    """Effect parameters among the unknowns of the fit; rows of a model form are none of them."""
    asked = (n for n in found.fit.names[: found.fit.n_params] if "." in n)
    return tuple(n for n in asked if n in found.model.index and found.model.parameter_unit(n) is not None)


def _own(found: TrialFit, effect: str) -> list[str]:
    return [n.partition(".")[2] for n in freed(found) if n.startswith(f"{effect}.")]


def _value(found: TrialFit, name: str) -> tuple[float, float]:
    i = found.fit.names.index(name)
    return float(found.fit.z[i]), float(found.fit.sd[i])


def _effects(found: TrialFit) -> list[Effect]:
    model, out = found.model, []
    for name in dict.fromkeys(n.partition(".")[0] for n in freed(found)):
        declared = model.effects[name]
        values = {
            p: Value(*_value(found, f"{name}.{p}"), str(model.parameter_unit(f"{name}.{p}")))
            for p in _own(found, name)
        }
        known = {
            p.name: Value(float(model.nominal[model.index[declared.key(p.name)]]), 0.0, p.unit)
            for p in declared.parameters
        }
        instead = {n: float(model.nominal[model.index[n]]) for n in declared.adjust if n in model.index}
        sizes = contract(name, known | values, {p.name: p.assumed for p in declared.parameters})
        told = [p for p, v in values.items() if v.sd < UNTOLD * model.prior_sd(declared.key(p))]
        out.append(Effect(name, 1.0, sizes, says=said_of(declared, model, told), instead=instead))
    return out
