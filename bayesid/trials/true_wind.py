"""True wind from what an anemometer on board reads: from the bow, or with the vehicle's own way in it.

Takes the series of a run. Gives speed and direction of the true wind. Does not judge which one a log holds.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.interpolate import make_smoothing_spline

from bayesid.errors import TrialError
from bayesid.trials.trial import Floats

TRUE, FROM_BOW, APPARENT, APPARENT_BY_COMPASS = "true", "from the bow", "apparent", "apparent by compass"
READINGS = (TRUE, FROM_BOW, APPARENT, APPARENT_BY_COMPASS)
# Readings of a track from which its velocity is had; above as many, a smoothing spline is one of their means.
FEWEST, MOST = 5, 2_000


def true_wind(reading: str, t: Floats, series: Mapping[str, Floats], name: str = "") -> tuple[Floats, Floats]:
    """Speed [m/s] and direction the true wind comes from [rad], as read on board.

    Parameters
    ----------
    reading : "from the bow", the direction counts from the bow; "apparent", speed and direction are those
        of the air past the vehicle, counted from the bow; "apparent by compass", that, counted from north
    t : (n,) [s]
    series : channel -> (n,) SI: wind_speed, wind_from, psi, and, where the wind is apparent, u and v over
        ground or the track x, y
    name : of the run, for errors

    Raises
    ------
    TrialError
        if heading or velocity is not logged
    """
    speed, come = series["wind_speed"], series["wind_from"]
    psi = _filled(t, series, "psi")
    if reading in (FROM_BOW, APPARENT):
        if psi is None:
            raise TrialError(
                f'{name}: [corrections] wind = "{reading}" needs the heading psi, which is not logged'
            )
        come = come + psi
    if reading not in (APPARENT, APPARENT_BY_COMPASS):
        return speed, come
    over = _over_ground(t, series, psi)
    if over is None:
        raise TrialError(
            f'{name}: [corrections] wind = "{reading}" needs the velocity over ground: log u, v and psi, or '
            "the track x, y"
        )
    # the air past the vehicle comes from where it goes, too
    air = -speed * np.exp(1j * come) + over
    return np.abs(air), np.angle(-air)


def as_read(reading: str, t: Floats, series: Mapping[str, Floats]) -> tuple[Floats, Floats]:
    """What reads like that on board, of a true wind: the inverse of `true_wind`."""
    speed, come = series["wind_speed"], series["wind_from"]
    psi = _filled(t, series, "psi")
    if reading in (APPARENT, APPARENT_BY_COMPASS):
        over = _over_ground(t, series, psi)
        assert over is not None
        air = -speed * np.exp(1j * come) - over
        speed, come = np.abs(air), np.angle(-air)
    if reading in (FROM_BOW, APPARENT):
        assert psi is not None
        come = come - psi
    return speed, come


def _over_ground(t: Floats, series: Mapping[str, Floats], psi: Floats | None) -> np.ndarray | None:
    """(n,) velocity, north + i east [m/s]; None where nothing tells it."""
    u, v = (_filled(t, series, name) for name in ("u", "v"))
    if u is not None and v is not None and psi is not None:
        return np.asarray((u + 1j * v) * np.exp(1j * psi))
    north, east = (_slope(t, series.get(name)) for name in ("x", "y"))
    if north is not None and east is not None:
        return np.asarray(north + 1j * east)
    # the drift is a few percent of the speed but in tight turns
    return None if u is None or psi is None else np.asarray(u * np.exp(1j * psi))


def _filled(t: Floats, series: Mapping[str, Floats], name: str) -> Floats | None:
    values = series.get(name)
    good = np.zeros(0, dtype=bool) if values is None else np.isfinite(values)
    return None if values is None or not good.any() else np.interp(t, t[good], values[good])


def _slope(t: Floats, values: Floats | None) -> Floats | None:
    """Slope of a smoothing spline whose stiffness is chosen by cross-validation."""
    good = np.zeros(0, dtype=bool) if values is None else np.isfinite(values)
    if values is None or good.sum() < FEWEST:
        return None
    at, mean = t[good], values[good]
    if at.size > MOST:
        edges = np.linspace(0, at.size, MOST + 1).astype(int)[:-1]
        count = np.diff(np.append(edges, at.size))
        at, mean = np.add.reduceat(at, edges) / count, np.add.reduceat(mean, edges) / count
    smooth = make_smoothing_spline(at, mean).derivative()
    return np.asarray(smooth(np.clip(t, at[0], at[-1])))
