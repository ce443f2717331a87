"""Deflection of the vertical: gravity does not point along the ellipsoid's normal, and the difference changes along the way.

    dv' = ... + g xi,        xi east, north: a Gauss-Markov process over distance

At one place it is an accelerometer bias that does not turn with the vehicle; under way it swings Schuler's pendulum. A vehicle
that has levelled itself at rest stands by the plumb line, ``phi_E = -xi_N, phi_N = xi_E``, as with an accelerometer bias.

Source: S. Jordan, "Self-consistent statistical models for the gravity anomaly, vertical deflections, and undulation of the geoid",
J. Geophys. Res. 77 (1972): first order over distance as the plainest of its family; 5-8 arcsec over 20-40 km away from mountains.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.core.earth import normal_gravity
from truenorth.core.errors import UsageError
from truenorth.errors.group import Group, columns
from truenorth.state.layout import BA, PHI
from truenorth.state.prior import positive

Array = NDArray[np.float64]

NAME = "deflection of the vertical"
STANDARD_GRAVITY = 9.80665  # m/s^2: half a per cent from any place's, of an effect of arc seconds


@columns
def _deflected(now: Any, figures: Any, first: int, assumed: Any, F: Any) -> None:
    F[3, first] = figures[0]
    F[4, first + 1] = figures[0]


@dataclass(frozen=True)
class Deflection:
    """How the vertical deflects; one sigma of each level axis.

    Attributes
    ----------
    sigma : float, rad
    distance : float, m
        Over which it is correlated.

    Raises
    ------
    UsageError
        A negative sigma, a distance that is not positive.
    """

    sigma: float = math.radians(6.0 / 3600.0)
    distance: float = 20e3

    def __post_init__(self) -> None:
        if not (0.0 <= self.sigma < math.inf and self.distance > 0.0):
            raise UsageError(
                f"deflection of the vertical {self.sigma:g} rad over {self.distance:g} m; expected no negative angle and a "
                "distance above zero"
            )

    @property
    def groups(self) -> tuple[Group, ...]:
        """Its two states; none where there is no deflection."""
        if self.sigma == 0.0:
            return ()
        states = Group(
            NAME,
            np.full(2, self.sigma),
            correlation_distance=self.distance,
            acts=_deflected,
            figures=(STANDARD_GRAVITY,),
            unit="rad",
        )
        return (states,)


def at_rest(P: Array, first: int, C_nb: Array, lat: float, alt: float, held: float) -> Array:
    """(n, n) covariance at the start of an INS that has levelled itself: tilt and deflection cancel each other.

    Parameters
    ----------
    P : (n, n) array
        Of all states; its tilt and accelerometer biases hold a deflection of one sigma `held` (rad) already.
    first : int
        The first of the two states of the deflection.
    C_nb : (3, 3) array
    lat, alt : float, rad and m
    held : float, rad

    Notes
    -----
    Tilt and accelerometer bias cancel each other so well that what is taken out has to be what was put in, to the place's gravity:
    half a per mille of it left an eigenvalue of -5e-7, and rounding leaves one below zero.
    """
    own = slice(first, first + 2)
    sigma = np.sqrt(np.diag(P)[own])
    tilt = np.array([[0.0, -1.0], [1.0, 0.0], [math.tan(lat), 0.0]])
    as_bias, as_plumb = np.zeros((len(P), 2)), np.zeros((len(P), 2))
    as_bias[PHI], as_bias[BA] = held * tilt, held * float(normal_gravity(lat, alt)) * C_nb[:2].T
    as_plumb[PHI], as_plumb[own] = sigma * tilt, np.diag(sigma)
    rest = P.copy()
    rest[own] = rest[:, own] = 0.0
    rest -= as_bias @ as_bias.T
    return positive(rest + as_plumb @ as_plumb.T)
