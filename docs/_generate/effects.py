"""The catalogue of effects: equation, parameters, usual size, sentence, picture, look-alikes."""

from __future__ import annotations

import io
import math
import re

import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt

from _generate.confusion import LEAST, SHOWN, VEHICLE, changed, constants, sizes, traces
from _generate.markdown import code, fenced, plain, table
from bayesid.diagnosis.plain_words import sentence
from bayesid.diagnosis.result import Effect as Found
from bayesid.diagnosis.result_parts import Value
from bayesid.model.effects import CATALOGUE, Effect, EffectParameter
from bayesid.model.effects.describe import alternatives, equations

PORTS = {
    "input": "between order and actuator", "flow": "moving water", "force": "force on the vehicle",
    "sensor": "between state and reading",
}  # fmt: skip
_PLACE = re.compile(r"\{([^{}:]+):([^{}:]+)(?::[^{}]*)?\}")
ORDER = ("input", "flow", "force", "sensor")
WORTH_A_WORD = 0.5  # share absorbed by coefficients


def anchor(name: str) -> str:
    return f"effect-{name.replace('_', '-')}"


def link(name: str) -> str:
    return f"[{name.replace('_', ' ')}](#{anchor(name)})"


def effect_index() -> str:
    """All effects by where they enter."""
    rows = [
        [link(e.name), PORTS[e.port], plain(_said(e)), _dof(e)]
        for port in ORDER
        for e in CATALOGUE
        if e.port == port
    ]
    return table(("effect", "enters", "in words", "models"), rows)


def effects() -> str:
    """One section per effect."""
    groups = []
    for port in ORDER:
        groups.append(f"## {PORTS[port].capitalize()}")
        groups += [_section(e) for e in CATALOGUE if e.port == port]
    return "\n\n".join(groups)


def _dof(effect: Effect) -> str:
    return "6-DOF" if effect.dof == 6 else "planar" if effect.planar else "all"


def _said(effect: Effect) -> str:
    """What a report would say of it; places for sizes that no planar example can fill are left open."""
    if effect.acts_in(3):
        size = {key: Value(value, 0.0, unit) for key, (value, unit) in sizes(effect).items()}
        return sentence(Found(effect.name, 1.0, size, says=effect.says, instead=constants()))
    return _PLACE.sub("...", effect.says) or effect.name.replace("_", " ")


def _section(effect: Effect) -> str:
    parts = [
        f"({anchor(effect.name)})=\n### {effect.name}",
        f"{plain(_said(effect))}",
        fenced("\n".join(_wrapped(line) for line in equations(effect))),
        table(
            ("parameter", "unit", "meaning", "prior", "range", "off"),
            [_parameter(p) for p in effect.parameters],
        ),
        f"Usual size: {plain(effect.magnitude)}.",
        _confused(effect),
    ]
    if effect.form:
        parts.append(f"Form: {plain(effect.form)}")
    parts += [f"Another form: {code(o.name)}. {plain(o.form)}" for o in alternatives(effect)]
    also = f" Other names: {', '.join(code(a) for a in effect.aliases)}." if effect.aliases else ""
    family = f"Family: {code(effect.family)}. Models: {_dof(effect)}.{also}"
    parts.append(f"Source: {plain(effect.source)}. {family}")
    if (picture := _picture(effect)) is not None:
        parts.insert(3, picture)
    return "\n\n".join(parts)


def _wrapped(line: str, width: int = 96) -> str:
    out, rest = [], line
    while len(rest) > width:
        cut = rest.rfind(" ", 0, width)
        if cut <= 4:
            break
        out.append(rest[:cut])
        rest = "    " + rest[cut + 1 :]
    return "\n".join([*out, rest])


def _parameter(p: EffectParameter) -> list[str]:
    scale = "" if p.scale == "1" else f" {plain(p.scale)}"
    ends = [f"{x:.3g}" if math.isfinite(x) else "no limit" for x in (p.low, p.high)]
    span = "any" if ends == ["no limit"] * 2 else " to ".join(ends) + scale
    side = ", never negative" if p.one_sided else ""
    prior = f"{p.mean:g} ± {p.sd:.3g}{scale}{side}"
    return [code(p.name), plain(p.unit), plain(p.about), prior, span, f"{p.off:g}"]


def _confused(effect: Effect) -> str:
    found = traces().get(effect.name)
    if found is None:
        why = "it needs a 6-DOF model" if effect.dof == 6 else "it is part of the model form"
        return f"Confused with: not computed here ({why}); `bayesid diagnose` prints it for your runs."
    hidden = ""
    if found.absorbed > WORTH_A_WORD:
        hidden = f" Coefficients within their prior absorb {found.absorbed:.1%} of its trace."
    if found.shows < LEAST:
        return f"Confused with: nothing, because it does not show on the four runs at one prior sd.{hidden}"
    if not found.rivals:
        return f"Confused with: no other effect on the four runs.{hidden}"
    return f"Confused with, on the four runs: {', '.join(link(r) for r in found.rivals)}.{hidden}"


def _picture(effect: Effect) -> str | None:
    """Inline SVG of what one prior sd does to a zig-zag; None where a planar model cannot have it."""
    if not effect.acts_in(3) or effect.as_form == "only":
        return None
    with_it, without = changed(effect), changed(None)
    if with_it is None or without is None:
        return None
    (t, now), (_, then) = with_it, without
    turn = np.degrees(np.unwrap(now["psi"]) - np.unwrap(then["psi"]))
    fig, (left, right) = plt.subplots(1, 2, figsize=(6.0, 1.5), layout="constrained")
    left.plot(then["y"], then["x"], color="0.6", lw=2.2)
    left.plot(now["y"], now["x"], color="#0072b2", lw=1.2)
    left.set(xlabel="east [m]", ylabel="north [m]")
    right.axhline(0.0, color="0.6", lw=1)
    right.plot(t, turn, color="#0072b2", lw=1.2)
    right.set(xlabel="time [s]", ylabel="heading [deg]")
    for axes in (left, right):
        axes.tick_params(labelsize=7)
        axes.xaxis.label.set_size(7)
        axes.yaxis.label.set_size(7)
    if np.abs(turn).max() < 0.01:
        right.set_ylim(-1, 1)
    held = io.StringIO()
    with plt.rc_context({"svg.hashsalt": effect.name, "svg.fonttype": "none"}):
        fig.savefig(held, format="svg", metadata={"Date": None}, transparent=False)
    plt.close(fig)
    svg = held.getvalue()
    svg = re.sub(r"\n\s*\n", "\n", svg[svg.index("<svg") :])
    # ids are local to a picture in a file, but not in a page
    svg = re.sub(r'(id="|url\(#|href="#)', rf"\g<1>{anchor(effect.name)}-", svg)
    return (
        f'<figure class="signature" role="img" aria-label="{effect.name} on a zig-zag">{svg}'
        f"<figcaption>{SHOWN.replace(':', ' ')} of {VEHICLE} without (grey) and with "
        f"{effect.name.replace('_', ' ')} at one prior sd (blue): track, and change of the heading."
        "</figcaption></figure>"
    )
