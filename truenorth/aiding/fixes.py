"""Position fixes and azimuth resets from outside: a few, far apart, of a ship that navigates by itself in between.

One fix sets anew what it shows, and by the covariance what is correlated with it. What two of them differ by is what the gyros
have drifted in between. With ``theta`` the place's error as a small rotation, ``theta = (-dL, dlon cos L, dlon sin L)``, the
drift angle ``psi = phi - theta`` obeys

    psi' = -w_in x psi - C_nb eps:    psi(t_2) = A psi(t_1) - B eps,    A' = -[w_in x] A,    B = int A(t_2, t) C_nb(t) dt

Position and azimuth at both times give ``psi`` (level tilt is Schuler's, some arc seconds), and ``eps = B^-1 (A psi_1 - psi_2)``:
two-point calibration. With positions alone, two equations of three, a third fix is needed. The filter does the same with
every error weighed: comprehensive correction of position, azimuth and drifts at once.

Source: D. Huang, L. Cheng, *Inertial Navigation Systems* (1986), ch. 6 (comprehensive correction, two and three points);
K. Britting, *Inertial Navigation Systems Analysis* (1971), ch. 8 (psi angle).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from truenorth.aiding.heading import HEADING
from truenorth.aiding.source import Aiding
from truenorth.core.errors import UsageError

PLACE, AZIMUTH = "position fix", "azimuth reset"  # sources of measurements


@dataclass(frozen=True)
class PositionFix:
    """A place known from outside.

    Attributes
    ----------
    time : float, s
    lat, lon : float, rad
    sigma : float, m
        Of east and of north.

    Raises
    ------
    UsageError
        A sigma that is not positive, numbers that are no place.
    """

    time: float
    lat: float
    lon: float
    sigma: float

    def __post_init__(self) -> None:
        if not (self.sigma > 0.0 and abs(self.lat) <= 0.5 * math.pi and math.isfinite(self.time + self.lon)):
            raise UsageError(f"position fix {self}; expected a time, a place in rad and a sigma above zero")


@dataclass(frozen=True)
class AzimuthFix:
    """A heading of the forward axis known from outside.

    Attributes
    ----------
    time : float, s
    heading, sigma : float, rad

    Raises
    ------
    UsageError
        A sigma that is not positive, or no number.
    """

    time: float
    heading: float
    sigma: float

    def __post_init__(self) -> None:
        if not (self.sigma > 0.0 and math.isfinite(self.time + self.heading)):
            raise UsageError(f"azimuth reset {self}; expected a time, a heading and a sigma above zero, rad")


@dataclass(frozen=True)
class Fixes:
    """Position fixes and azimuth resets, as an aid.

    Attributes
    ----------
    positions : sequence of PositionFix
    azimuths : sequence of AzimuthFix
    """

    positions: Sequence[PositionFix] = ()
    azimuths: Sequence[AzimuthFix] = ()
    record: None = None
    key: ClassVar[str] = "fix"

    def sources(self, altitude: str) -> list[Aiding]:
        """Places and headings; none is rejected: whoever gives a fix means it."""
        found = []
        if self.positions:
            time, lat, lon, sigma = np.array([(p.time, p.lat, p.lon, p.sigma) for p in self.positions]).T
            places = np.column_stack([lat, lon, np.full(len(lat), np.nan)])
            found.append(Aiding(PLACE, "position", time, places, np.column_stack([sigma] * 3), gate=0.0))
        if self.azimuths:
            time, heading, sigma = np.array([(a.time, a.heading, a.sigma) for a in self.azimuths]).T
            found.append(Aiding(AZIMUTH, HEADING, time, heading[:, None], np.column_stack([sigma] * 3), gate=0.0))
        return found
