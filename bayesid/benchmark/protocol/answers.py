"""What is true of each bundle: answers of `bayesid blind make`, of the plant, or a list of labels.

Takes a folder of <bundle>.json or one JSON file with a list of labels. Gives frozen `Answer`s. Does not read
verdicts.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from bayesid.benchmark.protocol.cause_families import family_of
from bayesid.benchmark.protocol.commitment import (
    PACK_COMMITMENTS_FILE,
    BlindError,
    digest_of_file,
    read_json,
)
from bayesid.benchmark.protocol.detectability import Detectability, from_json

KINDS = ("none", "effect", "two", "variant", "outside")


@dataclass(frozen=True)
class Cause:
    """One thing that is wrong with the vehicle or its log.

    Attributes
    ----------
    name : of the effect contract, or the plant's own for a cause outside it
    variant : "" as the catalogue words it, else the other form
    size : 1 is the reference magnitude (nan: not told)
    parameters : under the names of the contract, SI; empty where they are not to be scored
    shown : how plainly it shows (None: not computed)
    """

    name: str
    variant: str = ""
    size: float = float("nan")
    parameters: Mapping[str, float] | None = None
    shown: Detectability | None = None


@dataclass(frozen=True)
class Answer:
    """Truth of one bundle.

    Attributes
    ----------
    kind : one of KINDS
    causes : what is planted, empty for none
    factors : vehicle, dof, sensors, sea, campaign and prior, as text, for tables
    coefficients : true over nominal - 1 per coefficient
    digest : of the file it came from, the commitment where it was committed ("" for labels)
    source : the plain data
    """

    name: str
    kind: str
    causes: tuple[Cause, ...]
    factors: Mapping[str, str]
    coefficients: Mapping[str, float]
    digest: str
    source: Mapping[str, Any]

    @property
    def families(self) -> frozenset[str]:
        """Families that are right: of the causes, or none, or outside."""
        if self.kind in ("none", "outside"):
            return frozenset({self.kind})
        return frozenset(family_of(c.name) for c in self.causes)


def load_answers(path: Path) -> dict[str, Answer]:
    """Answers by bundle name.

    Raises
    ------
    BlindError                 nothing there, or it is no answer; names the file
    """
    if path.is_file():
        from bayesid.benchmark.protocol.labels import answer_of_label

        labels = read_json(path, "a list of labels")
        if not isinstance(labels, list):
            raise BlindError(f"{path.name}: is no list of labels; give the folder of answers or such a list")
        found = [answer_of_label(label, path) for label in labels]
        _once([a.name for a in found], path)
        return {a.name: a for a in found}
    files = [file for file in sorted(path.glob("*.json")) if file.name != PACK_COMMITMENTS_FILE]
    plain = {file.stem: _from_plant(file) for file in files}
    if not plain:
        raise BlindError(f"{path}: no <bundle>.json in this folder; give the folder `blind make` wrote")
    return plain


def _once(names: list[str], path: Path) -> None:
    twice = sorted({n for n in names if names.count(n) > 1})
    if twice:
        raise BlindError(f"{path.name}: two labels for {', '.join(twice)}; a bundle has one answer")


def with_shown(answer: Answer, shown: tuple[Detectability, ...]) -> Answer:
    """The answer with how plainly its causes show."""
    causes = tuple(replace(c, shown=s) for c, s in zip(answer.causes, shown, strict=True))
    return replace(answer, causes=causes)


def _from_plant(file: Path) -> Answer:
    raw = read_json(file, "an answer")
    try:
        shown = raw.get("detectability")
        causes = []
        for k, e in enumerate(raw["effects"]):
            scored = e["parameters"] if e["kind"] == "effect" and e["name"] != "coefficient_error" else None
            detect = from_json(shown[k]) if shown else None
            size = math.nan if e["size"] is None else float(e["size"])
            causes.append(Cause(e["name"], e["variant"], size, scored, detect))
        factors = {
            "vehicle": str(raw["vehicle"]),
            "dof": str(raw["dof"]),
            "sensors": str(raw["sensors"]),
            "sea": str(raw["environment"]["sea"]),
            "campaign": str(raw["campaign"]),
            "prior": f"{float(raw['prior_relative_sd']):g}",
        }
        return Answer(
            file.stem, _kind(raw["kind"], causes), tuple(causes), factors, raw["coefficient_draw_relative"],
            digest_of_file(file), raw,
        )  # fmt: skip
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise BlindError(
            f"{file.name}: is no answer of a blind pack ({type(error).__name__}: {error})"
        ) from None


def _kind(kind: str, causes: list[Cause]) -> str:
    if kind not in KINDS or (kind == "none") != (not causes):
        raise BlindError(f"an answer says kind {kind!r} with {len(causes)} causes; kinds: {', '.join(KINDS)}")
    return kind
