"""Other spellings of coefficient names: many are read, a few are written.

Takes: a name such as `Yvav`, `Y_vabsv`, `Yvdot`, `Ydelta`, `Zuw`, `xDotU`, `paramYvv` or `X_du`.
Does not: convert values; a dialect says how a name is spelt, not its sign convention or its units.
"""

from __future__ import annotations

import difflib
import re

from bayesid.errors import VehicleError
from bayesid.model.terms.row import Term
from bayesid.model.terms.table import TERMS

#: dialects `alias` writes; each is read back to the same row
WRITTEN = ("canonical", "ascii", "abs")
#: dialects `canonical_name` takes to settle what spelling alone cannot
READ = ("prestero", "vrx", "diffuv")

_TOKEN = re.compile(
    r"abs\(?([uvwpqr])\)?|\|([uvwpqr])\||a([uvwpqr])"  # |v|
    r"|([uvwpqr])dot|dot([uvwpqr])|d([uvwpq])"  # v-dot
    r"|delta([rsb]?)|d([rsb])"  # fins
    r"|(star|\*)|(eta)|([uvwpqr0])"
)
_BARS = re.compile(r"\|(.)\|")
_KEY = tuple[str, ...]


def _tokens(text: str) -> _KEY | None:
    """Sorted tokens of the arguments ("|v|r" -> r, |v|), or None where the text has other letters."""
    found, position = [], 0
    text = text.lower().replace("_", "").replace(",", "").replace("δ", "delta")
    text = text.replace("star", "*")  # before "ar" can be read as |r|
    while position < len(text):
        match = _TOKEN.match(text, position)
        if match is None:
            return None
        a, b, c, d, e, f, delta, fin, star, eta, plain = match.groups()
        if inside := (a or b or c):
            found.append(f"|{inside}|")
        elif rate := (d or e or f):
            found.append(f"{rate}dot")
        elif delta is not None or fin:
            found.append(f"d{delta or fin or '?'}")
        else:
            found.append("*" if star else "eta" if eta else plain)
        position = match.end()
    if found == ["0"]:
        found = ["*"]
    return tuple(sorted(found))


def _without_bars(key: _KEY) -> _KEY:
    return tuple(sorted(token.strip("|") for token in key))


def _spelt_with_u(row: Term) -> _KEY:
    """Key of the whole regressor, as in Prestero's Yuv, Zuuds."""
    names = {"delta_r": "dr", "delta_s": "ds", "delta_b": "db"}
    return tuple(
        sorted(f"|{f.symbol}|" if f.wrap == "abs" else names.get(f.symbol, f.symbol) for f in row.factors)
    )


def _unnamed_fin(key: _KEY) -> _KEY:
    return tuple(sorted("d?" if token in ("dr", "ds", "db") else token for token in key))


# rows over U and numbers have one spelling each
_NAMED = tuple(row for row in TERMS if row.group in ("base", "eta"))
_NAMES = {row.name for row in TERMS}
_KEYS: dict[str, _KEY] = {row.name: _tokens(row.arguments) or () for row in _NAMED}


def _candidates(axis: str, key: _KEY) -> list[str]:
    """Rows a key may mean: exactly, with bars dropped, with an unnamed fin, or with every u spelt out."""
    rows = [row for row in _NAMED if row.axis == axis]
    found = [row.name for row in rows if _KEYS[row.name] == key]
    if not any("|" in token for token in key):
        # one letter alone never stands for |w|: Zw is Z_w
        found += [
            r.name
            for r in rows
            if len(_KEYS[r.name]) > 1 and _without_bars(_KEYS[r.name]) == key and r.name not in found
        ]
    found = found or [row.name for row in rows if _unnamed_fin(_KEYS[row.name]) == key]
    return found or [row.name for row in rows if _spelt_with_u(row) == key]


def _by_dialect(axis: str, key: _KEY, dialect: str, candidates: list[str]) -> list[str]:
    if dialect == "diffuv" and key == ("dr",):  # X_du, N_dr: d stands for the rate
        return _candidates(axis, ("rdot",))
    if dialect == "vrx" and len(key) == 1 and f"{axis}_{key[0]}0" in _NAMES:  # yV: linear, without u
        return [f"{axis}_{key[0]}0"]
    if dialect in ("vrx", "prestero") and len(key) == 2 and key[0] == key[1]:
        return [name for name in candidates if "|" in name] or candidates
    return candidates


def canonical_name(spelling: str, dialect: str | None = None) -> str:
    """Canonical name of a coefficient spelt in any of the dialects met so far.

    Parameters
    ----------
    spelling : a canonical name passes through unchanged
    dialect : None, or one of `READ`, where spelling alone leaves two rows: in "prestero" and "vrx" Xuu is
        X_u|u|; in "vrx" yV is the damping without u, Y_v0; in "diffuv" N_dr is N_rdot

    Raises
    ------
    VehicleError
        if no row, or more than one row, is meant; names the nearest rows or the candidates
    """
    if dialect is not None and dialect not in READ:
        raise VehicleError(f"dialect {dialect!r} is not known; use one of {', '.join(READ)} or leave it out")
    if spelling in _NAMES and dialect is None:
        return spelling
    text = spelling.strip().removeprefix("param").rstrip("'").removesuffix("_prime")
    axis, key = text[:1].upper(), _tokens(text[1:])
    found = _candidates(axis, key) if key else []
    if dialect is not None and key and "delta" not in text.replace("δ", "delta"):
        found = _by_dialect(axis, key, dialect, found)
        found = [spelling] if spelling in found and dialect != "diffuv" else found
    if len(found) == 1:
        return found[0]
    if found:
        raise VehicleError(f"coefficient {spelling!r} may mean {' or '.join(found)}; write the one you mean")
    if spelling in _NAMES:
        return spelling
    near = difflib.get_close_matches(text, [*_NAMES, *_ASCII], n=4, cutoff=0.6)
    near = list(dict.fromkeys(_ASCII.get(name, name) for name in near))[:3]
    hint = f"; did you mean {' or '.join(near)}?" if near else ""
    raise VehicleError(f"no coefficient {spelling!r} in the force table{hint}")


def alias(name: str, dialect: str = "ascii") -> str:
    """Spelling of a canonical name in a dialect of `WRITTEN`.

    "ascii" gives `Yvav Ndr Zwaw Mq Xudot`, "abs" gives `Y_vabsv`. Where the short spelling could be read
    as another row (X_uu beside X_u|u|) the canonical name is kept.

    Raises
    ------
    VehicleError
        if the name is no row or the dialect is not written
    """
    if dialect not in WRITTEN:
        raise VehicleError(f"dialect {dialect!r} is not written; use one of {', '.join(WRITTEN)}")
    if name not in _NAMES:
        name = canonical_name(name)
    axis, _, arguments = name.partition("_")
    if dialect == "canonical" or name not in _KEYS:
        return name
    text = arguments.replace("*", "star")
    if dialect == "abs":
        return f"{axis}_" + _BARS.sub(r"abs\1", text).replace(",", "_")
    short = axis + _BARS.sub(r"a\1", text).replace(",", "")
    return short if _candidates(axis, _tokens(short[1:]) or ()) == [name] else name


_ASCII = {alias(row.name): row.name for row in _NAMED}
