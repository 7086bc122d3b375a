"""The catalogue of effects: equation, parameters, usual size, sentence, picture, look-alikes."""

from __future__ import annotations

import io
import math
import re

import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt

from _generate.confusion import LEAST, SHOWN, VEHICLE, changed, changed_in_depth, constants, sizes, traces
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
_DEG = 180 / math.pi
# channels whose change a picture may show, the most telling first: label, factor, a clear change [SI]
PLANAR = (
    ("psi", "heading [deg]", _DEG, 0.005), ("r", "yaw rate [deg/s]", _DEG, 0.001),
    ("u", "speed ahead [m/s]", 1.0, 0.01), ("v", "speed abeam [m/s]", 1.0, 0.01),
    ("x", "north [m]", 1.0, 0.05),
)  # fmt: skip
VERTICAL = (
    ("theta", "pitch [deg]", _DEG, 0.02), ("phi", "roll [deg]", _DEG, 0.005), ("z", "depth [m]", 1.0, 0.01),
)  # fmt: skip
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
    """Inline SVG of what one prior sd does; None where the vehicle diverges with it."""
    planar = effect.acts_in(3)
    run = changed if planar else changed_in_depth
    with_it, without = run(effect), run(None)
    if with_it is None or without is None:
        return None
    (t, now), (_, then) = with_it, without
    channel, label, factor = _told_by(now, then, PLANAR if planar else VERTICAL)
    fig, (left, right) = plt.subplots(1, 2, figsize=(6.0, 1.5), layout="constrained")
    across, up = ("y", "x") if planar else (None, "z")
    for run_of, colour, width in ((then, "0.6", 2.2), (now, "#0072b2", 1.2)):
        left.plot(t if across is None else run_of[across], run_of[up], color=colour, lw=width)
    if planar:
        left.set(xlabel="east [m]", ylabel="north [m]")
    else:
        left.set(xlabel="time [s]", ylabel="depth [m]")
        left.invert_yaxis()
    change = factor * _apart(now[channel], then[channel], channel)
    right.axhline(0.0, color="0.6", lw=1)
    right.plot(t, change, color="#0072b2", lw=1.2)
    right.set(xlabel="time [s]", ylabel=label)
    for axes in (left, right):
        axes.tick_params(labelsize=7)
        axes.xaxis.label.set_size(7)
        axes.yaxis.label.set_size(7)
    held = io.StringIO()
    with plt.rc_context({"svg.hashsalt": effect.name, "svg.fonttype": "none"}):
        fig.savefig(held, format="svg", metadata={"Date": None}, transparent=False)
    plt.close(fig)
    svg = held.getvalue()
    svg = re.sub(r"\n\s*\n", "\n", svg[svg.index("<svg") :])
    # ids are local to a picture in a file, but not in a page
    svg = re.sub(r'(id="|url\(#|href="#)', rf"\g<1>{anchor(effect.name)}-", svg)
    words, kind = (
        label.partition(" [")[0],
        SHOWN.replace(":", " ") if planar else "doublet of the stern planes",
    )
    return (
        f'<figure class="signature" role="img" aria-label="{effect.name} on a {kind}">{svg}'
        f"<figcaption>{kind[:1].upper()}{kind[1:]} of {VEHICLE} without (grey) and with "
        f"{effect.name.replace('_', ' ')} at one prior sd (blue): {'track' if planar else 'depth'}, and "
        f"change of the {words}.</figcaption></figure>"
    )


def _apart(now: np.ndarray, then: np.ndarray, channel: str) -> np.ndarray:
    """Change of a channel; of an angle on the shorter side."""
    gap = now - then
    return (gap + np.pi) % (2 * np.pi) - np.pi if channel in ("psi", "phi", "theta") else gap


def _told_by(
    now: dict[str, np.ndarray], then: dict[str, np.ndarray], shown: tuple[tuple[str, str, float, float], ...]
) -> tuple[str, str, float]:
    """The first channel that changes clearly, else the one that changes most; label and factor of it."""
    most = {c: float(np.abs(_apart(now[c], then[c], c)).max()) / clear for c, _, _, clear in shown}
    best = next((c for c in most if most[c] > 1.0), max(most, key=lambda c: most[c]))
    return next((c, label, factor) for c, label, factor, _ in shown if c == best)
