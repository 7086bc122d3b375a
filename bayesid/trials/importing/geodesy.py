"""Latitude, longitude and height as local metres: north, east and down of a stated origin on the WGS84
ellipsoid.

Through earth-centred axes, so exact for the tangent plane at any distance. Does not: know other datums or
maps.
"""

from __future__ import annotations

import numpy as np

from bayesid.trials.trial import Floats

A = 6378137.0  # semi-major axis, m (NIMA TR8350.2)
F = 1.0 / 298.257223563
E2 = F * (2.0 - F)


def earth_centred(lat: Floats, lon: Floats, height: Floats) -> tuple[Floats, Floats, Floats]:
    """Earth-centred earth-fixed metres of rad, rad, m."""
    normal = A / np.sqrt(1.0 - E2 * np.sin(lat) ** 2)
    return (
        (normal + height) * np.cos(lat) * np.cos(lon),
        (normal + height) * np.cos(lat) * np.sin(lon),
        (normal * (1.0 - E2) + height) * np.sin(lat),
    )


def local_metres(
    lat: Floats, lon: Floats, height: Floats, origin: tuple[float, float, float]
) -> tuple[Floats, Floats, Floats]:
    """(north, east, down) [m] of points from an origin.

    Parameters
    ----------
    lat, lon : (n,) rad
    height : (n,) m above the ellipsoid
    origin : rad, rad, m
    """
    lat0, lon0, height0 = (np.asarray(v, dtype=float) for v in origin)
    here, zero = earth_centred(lat, lon, height), earth_centred(lat0, lon0, height0)
    dx, dy, dz = (a - b for a, b in zip(here, zero, strict=True))
    out = np.cos(lon0) * dx + np.sin(lon0) * dy
    return (
        -np.sin(lat0) * out + np.cos(lat0) * dz,
        -np.sin(lon0) * dx + np.cos(lon0) * dy,
        -(np.cos(lat0) * out + np.sin(lat0) * dz),
    )
