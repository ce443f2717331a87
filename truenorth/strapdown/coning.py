"""Coning and sculling: what the increments of an update amount to when their axes turn between samples.

An update spans N samples; ``A`` and ``B`` are its sums of angle and velocity increments, ``a`` and ``b`` those of its
last sample, and ``K = sum k_i a_i``, ``L = sum k_i b_i`` the weighted sums of the samples before the last. Then

    rotation vector     phi = A + K x a
    velocity increment  dv  = B + (1 - cos|A|)/|A|^2 A x B + (1 - sin|A|/|A|)/|A|^2 A x (A x B) + K x b + L x a

the second in body axes at the beginning of the update, its two middle terms exact for a rate and a force that stand
still in the body.

Sources: P. Savage, "Strapdown inertial navigation integration algorithm design", J. Guid. Control Dyn. 21 (1998), part
1 (coning), part 2 (rotation compensation and sculling); R. Miller, "A new strapdown attitude algorithm", J. Guid.
Control Dyn. 6 (1983) (three samples); M. Ignagni, "Efficient class of optimized coning compensation algorithms", J.
Guid. Control Dyn. 19 (1996) (only the distance of two samples matters, so that crosses with the last suffice); K.
Roscoe, "Equivalency between strapdown inertial navigation coning and sculling integrals/algorithms", J. Guid. Control
Dyn. 24 (2001) (the same coefficients serve both).
"""

from __future__ import annotations

import math
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from truenorth.core.attitude import cross
from truenorth.core.compiled import borrowing
from truenorth.core.errors import UsageError

Array = NDArray[np.float64]
Algorithm = Literal["previous", "1", "2", "3", "4"]

# k_1 .. k_{N-1} of the samples of an update before its last. They solve, up to lambda^(2N-1), the coning equation
#   sum_p k_{N-p} 2 (1 - cos lambda) sin(p lambda) = (N lambda - sin(N lambda))/2,   lambda: coning phase in a sample,
# and what is left, times the square of the cone's half-angle, is the drift of an update.
WITHIN: dict[str, tuple[float, ...]] = {
    "previous": (),
    "1": (),
    "2": (2.0 / 3.0,),
    "3": (9.0 / 20.0, 27.0 / 20.0),
    "4": (54.0 / 105.0, 92.0 / 105.0, 214.0 / 105.0),
}
# Coefficient of the sample before the update's first; "1" corrects nothing: the yardstick of the others.
BEFORE: dict[str, float] = {"previous": 1.0 / 12.0, "1": 0.0, "2": 0.0, "3": 0.0, "4": 0.0}
SMALL = 1e-2  # rad^2, of the square of an update's angle, below which the series is exact to rounding


def coefficients(algorithm: str) -> tuple[Array, float]:
    """Coefficients of the samples within an update, (N - 1,), and of the sample before it.

    Raises
    ------
    UsageError
        An algorithm that is not known.
    """
    if algorithm not in WITHIN:
        raise UsageError(f"algorithm {algorithm!r} is not known; choose one of {', '.join(WITHIN)}")
    return np.array(WITHIN[algorithm]), BEFORE[algorithm]


@borrowing(forceinline=True)
def update_sums(rows: Any, start: int, samples: int, k: Any, k_before: float, before: Any) -> Any:
    """Weighted sum of the samples before the last, sum of all, and the last, of the update that begins at a row."""
    last = start + samples - 1
    a = (rows[last, 0], rows[last, 1], rows[last, 2])
    A = a
    K = (k_before * before[0], k_before * before[1], k_before * before[2])
    for i in range(samples - 1):
        x, y, z = rows[start + i, 0], rows[start + i, 1], rows[start + i, 2]
        K = (K[0] + k[i] * x, K[1] + k[i] * y, K[2] + k[i] * z)
        A = (A[0] + x, A[1] + y, A[2] + z)
    return K, A, a


@borrowing(forceinline=True)
def rotation_vector(K: Any, A: Any, a: Any) -> Any:
    """``phi = A + K x a``: rotation vector of an update, coning corrected."""
    coning = cross(K, a)
    return A[0] + coning[0], A[1] + coning[1], A[2] + coning[2]


@borrowing(forceinline=True)
def velocity_increment(K: Any, A: Any, a: Any, L: Any, B: Any, b: Any) -> Any:
    """Velocity increment of an update in body axes at its beginning: rotation and sculling corrected."""
    square = A[0] * A[0] + A[1] * A[1] + A[2] * A[2]
    if square < SMALL:
        return velocity_of_small(K, A, a, L, B, b)
    angle = math.sqrt(square)
    return _turned((1.0 - math.cos(angle)) / square, (1.0 - math.sin(angle) / angle) / square, K, A, a, L, B, b)


@borrowing(forceinline=True)
def velocity_of_small(K: Any, A: Any, a: Any, L: Any, B: Any, b: Any) -> Any:
    """The same of an update that turns by less than .1 rad: without a choice, so that a loop over many goes in vectors."""
    square = A[0] * A[0] + A[1] * A[1] + A[2] * A[2]
    # By factors: a division takes as long as five products.
    c1 = 0.5 - (1.0 / 24.0) * square * (1.0 - (1.0 / 30.0) * square * (1.0 - (1.0 / 56.0) * square))
    c2 = 1.0 / 6.0 - (1.0 / 120.0) * square * (1.0 - (1.0 / 42.0) * square * (1.0 - (1.0 / 72.0) * square))
    return _turned(c1, c2, K, A, a, L, B, b)


@borrowing(forceinline=True)
def _turned(c1: float, c2: float, K: Any, A: Any, a: Any, L: Any, B: Any, b: Any) -> Any:
    """``B + c1 A x B + c2 A x (A x B) + K x b + L x a``."""
    once = cross(A, B)
    twice = cross(A, once)
    s1, s2 = cross(K, b), cross(L, a)
    return (
        B[0] + c1 * once[0] + c2 * twice[0] + s1[0] + s2[0],
        B[1] + c1 * once[1] + c2 * twice[1] + s1[1] + s2[1],
        B[2] + c1 * once[2] + c2 * twice[2] + s1[2] + s2[2],
    )
