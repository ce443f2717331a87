"""Damping networks: a transfer function in the velocity that levels the platform, tuned by the damping it gives.

A level channel of an INS is an undamped pendulum, ``s^2 + w_s^2 = 0``. A network ``H(s)`` in the velocity by which its
platform is carried over the earth makes it ``s^2 + w_s^2 H(s) = 0``. All networks here have ``H(0) = 1``: a constant
velocity passes unchanged, and the platform stays level on a moving base.

- First order, ``H = (p/z) (s + z)/(s + p)``: ``s^2 (s + p) + w_s^2 (p/z)(s + z) = (s^2 + 2 zeta w s + w^2)(s + q)``.
- Second order, ``H = (s^2 + d s + b)/(s^2 + a s + b)``, which is 1 at high frequency too, so that no noise is amplified:
  ``s^2 (s^2 + a s + b) + w_s^2 (s^2 + d s + b) = (s^2 + 2 zeta w s + w^2)(s^2 + 2 zeta_2 w_2 s + w_2^2)``.

Compared term by term, each follows in closed form from the damping ratio ``zeta`` and ``w = stretch w_s``; a third order places
all five poles of its channel (:func:`third_order`). :mod:`truenorth.damping.design` chooses among them by overshoot and time.

Sources: D. Huang, L. Cheng, *Inertial Navigation Systems* (1986), ch. 5 (horizontal damping); F. Qin, A. Li, J. Xu,
J. Chin. Inert. Technol. 19 (3), 2011 (continuously adjustable damping). The closed forms are derived here.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.core import earth
from truenorth.core.errors import UsageError

Array = NDArray[np.float64]

SCHULER_RATE = math.sqrt(earth.normal_gravity(math.radians(45.0), 0.0) / 6_371_000.0)  # rad/s; a period of 84.4 min
DAMPING = 0.5
STRETCH = math.sqrt(2.0)


@dataclass(frozen=True)
class Network:
    """``H(s)``, numerator and denominator in falling powers of s, the denominator's first coefficient 1.

    Attributes
    ----------
    numerator, denominator : tuples of float
        Of equal length.
    """

    numerator: tuple[float, ...]
    denominator: tuple[float, ...]

    def __post_init__(self) -> None:
        top, bottom = self.numerator, self.denominator
        if len(top) != len(bottom) or not bottom or bottom[0] != 1.0:
            raise UsageError(f"network {top} over {bottom}: expected as many terms above as below, the first below 1")
        if not math.isclose(top[-1], bottom[-1], rel_tol=1e-9):
            raise UsageError(
                f"network with H(0) = {top[-1] / bottom[-1]:g}; expected 1: any other tilts the platform of a moving vehicle"
            )
        if len(bottom) > 1 and np.roots(bottom).real.max() >= 0.0:
            raise UsageError(f"network with the poles {np.roots(bottom)}; expected all in the left half plane")

    @property
    def order(self) -> int:
        """States of a channel."""
        return len(self.denominator) - 1

    def response(self, s: Any) -> Any:
        """``H(s)`` at complex rates (rad/s), one or an array."""
        return np.polyval(self.numerator, s) / np.polyval(self.denominator, s)

    def realised(self) -> tuple[Array, Array, Array, float]:
        """``A, B, C, D`` of ``xi' = A xi + B v``, ``H v = C xi + D v`` (controllable form)."""
        n = self.order
        A, B = np.zeros((n, n)), np.zeros(n)
        tail = np.array(self.denominator[1:])
        if n:
            A[:-1, 1:] = np.eye(n - 1)
            A[-1], B[-1] = -tail[::-1], 1.0
        D = self.numerator[0]
        C = (np.array(self.numerator[1:]) - D * tail)[::-1]
        return A, B, C, D


NO_NETWORK = Network((1.0,), (1.0,))


def first_order(damping: float = DAMPING, stretch: float = STRETCH) -> Network:
    """The lead network that gives a damping ratio.

    Parameters
    ----------
    damping : float
        Of the Schuler oscillation, 0 to 1 (excluded).
    stretch : float
        Damped natural rate over Schuler's, above 1; the nearer to 1, the less noise and the slower the network.

    Raises
    ------
    UsageError
        A damping ratio or a stretch out of range.
    """
    _check(damping, stretch)
    w = stretch * SCHULER_RATE
    p = 2.0 * damping * w / (1.0 - 1.0 / stretch**2)
    q = p / stretch**2
    gain = (w * w + 2.0 * damping * w * q) / SCHULER_RATE**2
    return Network((gain, p), (1.0, p))


def second_order(damping: float = DAMPING, stretch: float = STRETCH, second_damping: float = 1.0) -> Network:
    """The network that gives a damping ratio and passes high frequencies unchanged.

    Parameters
    ----------
    damping, stretch : float
        As in :func:`first_order`.
    second_damping : float
        Of the other, faster pair of poles.

    Raises
    ------
    UsageError
        A damping ratio or a stretch out of range.
    """
    _check(damping, stretch)
    if not 0.0 < second_damping < 10.0:
        raise UsageError(f"second damping ratio {second_damping:g}; expected between 0 and 10")
    # (r^2 - 1)(x^2 - 1) = 4 zeta zeta_2 r x for x = w_2/w_s.
    a, b = stretch**2 - 1.0, 4.0 * damping * second_damping * stretch
    w, w2 = stretch * SCHULER_RATE, (b + math.sqrt(b * b + 4.0 * a * a)) / (2.0 * a) * SCHULER_RATE
    constant = (w * w2 / SCHULER_RATE) ** 2
    below = 2.0 * damping * w + 2.0 * second_damping * w2
    above = (2.0 * damping * w * w2**2 + 2.0 * second_damping * w2 * w**2) / SCHULER_RATE**2
    return Network((1.0, above, constant), (1.0, below, constant))


def third_order(
    damping: float = DAMPING,  # as in :func:`first_order`
    stretch: float = STRETCH,
    second: float = 2.5,  # of the other pair: its rate over Schuler's, and its damping ratio
    second_damping: float = 1.0,
    third: float = 2.5,  # the real pole over Schuler's rate
) -> Network:
    """The network of third order that puts all five poles of a level channel where they are asked for.

    ``s^2 D + w_s^2 N = (s^2 + 2 zeta w s + w^2)(s^2 + 2 zeta_2 w_2 s + w_2^2)(s + q)``, with N and D of third degree, both with
    the first coefficient 1 (high frequencies pass) and the same last one (``H(0) = 1``): five coefficients, five unknowns.

    Raises
    ------
    UsageError
        A figure out of range, or poles that no stable network gives.
    """
    _check(damping, stretch)
    if not (second > 0.0 and third > 0.0 and 0.0 < second_damping < 10.0):
        raise UsageError(f"poles at {second:g} and {third:g} times Schuler's rate; expected above 0")
    ws = SCHULER_RATE
    one = (1.0, 2.0 * damping * stretch * ws, (stretch * ws) ** 2)
    two = (1.0, 2.0 * second_damping * second * ws, (second * ws) ** 2)
    _, c4, c3, c2, c1, c0 = np.convolve(np.convolve(one, two), (1.0, third * ws)).tolist()
    last = c0 / ws**2
    return Network((1.0, (c2 - last) / ws**2, c1 / ws**2, last), (1.0, c4, c3 - ws**2, last))


def _check(damping: float, stretch: float) -> None:
    if not 0.0 < damping < 1.0:
        raise UsageError(f"damping ratio {damping:g}; expected between 0 and 1, such as 0.5")
    if not 1.0 < stretch <= 10.0:
        raise UsageError(f"stretch {stretch:g}; expected above 1, up to 10: a network that damps also stiffens")
