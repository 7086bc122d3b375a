"""Time stamps of any clock as seconds from a zero, and what UTC that zero is.

Takes numbers, dates or texts. Does not: compare clocks of several files (`joining`).
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

import numpy as np

from bayesid.trials.importing.raw import ImportLogError
from bayesid.trials.trial import Floats

CLOCKS = ("relative", "unix", "gps", "gps_week", "date", "time_of_day", "datenum")
UNIT_SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0, "d": 86400.0}
GPS_EPOCH = 315964800  # 1980-01-06 as UTC seconds since 1970
DATENUM_EPOCH = 719529.0  # MATLAB's day number of 1970-01-01
# GPS - UTC [s] from this UTC on (IERS Bulletin C); seven before the first are not needed by any log of today
LEAPS = (
    (0, 13.0),
    (1136073600, 14.0),
    (1230768000, 15.0),
    (1341100800, 16.0),
    (1435708800, 17.0),
    (1483228800, 18.0),
)
_DOTTED = r"\s*\d{1,2}\.\d{1,2}\.\d{2,4}"  # 10.06.2024: no country puts the month first with points
_NUMERIC_DATE = re.compile(r"\d{1,4}[-/.]\d{1,2}[-/.]\d{1,4}")
_TIME_OF_DAY = re.compile(r"\s*\d{1,2}:\d{2}(:\d{2}([.,]\d+)?)?\s*")


@dataclass(frozen=True)
class Stamps:
    """t (n,) seconds from zero; start: UTC of zero or None; words: how the stamps were read."""

    t: Floats
    start: float | None
    words: str


def gps_to_utc(seconds: Any) -> Any:
    """UTC seconds since 1970 of seconds since the GPS epoch; leap seconds by the date of the first."""
    utc = np.asarray(seconds, dtype=float) + GPS_EPOCH
    first = float(np.nanmin(utc)) if utc.size else 0.0
    leap = [count for since, count in LEAPS if first >= since + count]
    return utc - (leap[-1] if leap else 0.0)


def guess_clock(values: np.ndarray, unit: str | None) -> tuple[str, str, str | None]:
    """(clock, unit, doubt) of the numbers of a time column; the doubt is a question, None where there is
    none."""
    good = values[np.isfinite(values)]
    if good.size == 0:
        return "relative", unit or "s", None
    first = float(np.median(good))
    if unit is None:
        for name, factor in (("s", 1.0), ("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9)):
            if 9e8 < first * factor < 4.2e9 and (name == "s" or first * factor > 9e8):
                return "unix", name, None
        if 6.9e5 < first < 7.9e5 and np.ptp(good) < 30.0:
            return "datenum", "d", None
        step = float(np.median(np.abs(np.diff(good)))) if good.size > 1 else 1.0
        if step <= 2.5:
            return "relative", "s", None
        return "relative", "ms" if step < 5e3 else "us" if step < 5e6 else "ns", "unit"
    factor = UNIT_SECONDS.get(unit, 1.0)
    if 1.2e9 < first * factor < 4.2e9:
        return "unix", unit, None
    if 6.9e5 < first < 7.9e5 and unit == "d":
        return "datenum", "d", None
    return "relative", unit, None


def from_numbers(values: np.ndarray, clock: str, unit: str) -> Stamps:
    """Stamps of one numeric column; nanoseconds of integers keep all their digits."""
    if unit not in UNIT_SECONDS:
        raise ImportLogError(f"time_unit {unit!r} is not known; one of {', '.join(UNIT_SECONDS)}")
    factor = UNIT_SECONDS[unit]
    if clock in ("relative", "time_of_day"):
        return Stamps(np.asarray(values, dtype=float) * factor, None, f"relative [{unit}]")
    good = np.isfinite(values) if values.dtype.kind == "f" else np.ones(values.shape, dtype=bool)
    if not good.any():
        return Stamps(np.full(values.shape, np.nan), None, "empty")
    if values.dtype.kind in "iu" and unit in ("ms", "us", "ns"):
        per = round(1.0 / factor)
        whole = int(values[good][0]) // per
        t = (values.astype(np.int64) - np.int64(whole * per)) * factor
        zero = float(whole)
    else:
        seconds = np.asarray(values, dtype=float)
        if clock == "datenum":
            seconds, factor = (seconds - DATENUM_EPOCH), 86400.0
        zero = float(np.floor(seconds[good][0] * factor))
        t = (seconds - zero / factor) * factor
    if clock == "gps":
        zero = float(gps_to_utc(np.array([zero]))[0])
    return Stamps(np.asarray(t, dtype=np.float64), zero, f"{clock} [{unit}]")


def from_week(week: np.ndarray, seconds: np.ndarray, unit: str) -> Stamps:
    """Stamps of GPS week and time of week."""
    total = np.asarray(week, dtype=float) * 604800.0
    tow = np.asarray(seconds, dtype=float) * UNIT_SECONDS.get(unit, 1.0)
    first = int(np.flatnonzero(np.isfinite(total + tow))[0])
    zero = total[first] + np.floor(tow[first])
    t = (total - total[first]) + (tow - np.floor(tow[first]))
    return Stamps(t, float(gps_to_utc(np.array([zero]))[0]), "gps_week")


def from_datetimes(values: np.ndarray) -> Stamps:
    """Stamps of numpy datetimes, UTC."""
    ns = values.astype("datetime64[ns]")
    bad = np.isnat(ns)
    if bad.all():
        return Stamps(np.full(ns.shape, np.nan), None, "empty")
    whole = ns[~bad][0].astype("datetime64[s]")
    t = (ns - whole.astype("datetime64[ns]")).astype(np.int64) * 1e-9
    t[bad] = np.nan
    return Stamps(t, float(whole.astype(np.int64)), "date, UTC")


def is_date_text(texts: list[str]) -> bool:
    """True if most of the texts are dates with or without a time of day."""
    hits = [t for t in texts if _NUMERIC_DATE.search(t) and not t.replace(".", "").replace("-", "").isalpha()]
    return bool(texts) and len(hits) > 0.8 * len(texts)


def is_time_of_day(texts: list[str]) -> bool:
    """True if most of the texts are hours, minutes and seconds."""
    return bool(texts) and sum(bool(_TIME_OF_DAY.fullmatch(t)) for t in texts) > 0.8 * len(texts)


def parse_dates(texts: np.ndarray) -> np.ndarray:
    """datetime64[ns] of texts, UTC; NaT where a text is no date. Day first where a first number exceeds 12,
    and where points stand between the numbers."""
    import pandas

    series = pandas.Series(texts).astype(str).str.strip().str.replace(",", ".", regex=False)
    iso = bool(re.match(r"\d{4}", series.iloc[0])) if len(series) else True
    head = series.str.extract(r"^(\d{1,2})[-/.](\d{1,2})[-/.]\d{2,4}")
    dotted = bool(re.match(_DOTTED, series.iloc[0])) if len(series) else False
    day_first = not iso and (dotted or bool((head[0].astype(float) > 12).any()))
    parsed = pandas.to_datetime(
        series, errors="coerce", utc=True, format="ISO8601" if iso else "mixed", dayfirst=day_first
    )
    if iso and parsed.isna().mean() > 0.5:
        parsed = pandas.to_datetime(series, errors="coerce", utc=True, format="mixed")
    return parsed.dt.tz_localize(None).to_numpy().astype("datetime64[ns]")


def ambiguous_day(texts: np.ndarray) -> bool:
    """True if day and month cannot be told apart (both up to 12, and differing) in dates such as
    03/04/2024."""
    for text in texts[:1]:
        found = re.match(r"\s*(\d{1,2})[-/](\d{1,2})[-/]\d{2,4}", str(text))
        return bool(found) and int(found[1]) <= 12 and int(found[2]) <= 12 and found[1] != found[2]  # type: ignore[index]
    return False


def parse_times_of_day(texts: np.ndarray) -> Floats:
    """Seconds since the first midnight; a step back by more than half a day is the next day."""
    out = np.full(len(texts), np.nan)
    for k, text in enumerate(texts):
        parts = str(text).strip().replace(",", ".").split(":")
        try:
            out[k] = sum(float(p) * f for p, f in zip(parts, (3600.0, 60.0, 1.0), strict=False))
        except ValueError:
            continue
    good = np.isfinite(out)
    step = np.diff(out[good])
    out[good] += 86400.0 * np.concatenate(([0.0], np.cumsum(step < -43200.0)))
    return out
