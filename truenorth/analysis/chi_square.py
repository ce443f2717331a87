"""Limits of chi-square variables of whole degrees of freedom, by the standard library: ``scipy.special`` takes .2 s to load.

The tail is a finite sum, ``Q_(k+2)(x) = Q_k(x) + (x/2)^(k/2) exp(-x/2) / Gamma(k/2 + 1)``, from ``Q_1 = erfc(sqrt(x/2))`` and
``Q_2 = exp(-x/2)``.

Source: M. Abramowitz and I. Stegun, Handbook of Mathematical Functions (1964), 26.4.4, 26.4.5; the first guess 26.2.23, 26.4.17.
"""

from __future__ import annotations

import math
from functools import lru_cache

MANY = 20_000  # degrees of freedom: their sums take longer than `scipy.special` to load
STEPS = 200  # of Newton's method, at the most; it takes four or so
NEAR = 1e-8  # relative: the step after one so short is shorter than rounding


def tail(x: float, dof: int) -> float:
    """Probability that a chi-square variable exceeds `x`."""
    half = 0.5 * x
    if half <= 0.0:
        return 1.0
    odd = dof % 2
    total = math.erfc(math.sqrt(half)) if odd else math.exp(-half)
    for k in range(2 - odd, dof, 2):
        total += math.exp(0.5 * k * math.log(half) - half - math.lgamma(0.5 * k + 1.0))
    return total


@lru_cache(maxsize=256)
def chi_square_limit(chance: float, dof: int) -> float:
    """What a chi-square variable exceeds with the given probability; 0 for no degree of freedom.

    Parameters
    ----------
    chance : float
        Above 0, and 1 at the most.
    dof : int
    """
    if dof <= 0 or chance >= 1.0:
        return 0.0
    if dof > MANY:
        from scipy.special import chdtri

        return float(chdtri(dof, chance))
    # The logarithm of the tail is concave: Newton's method comes to the root from one side. From below the first step is too long,
    # and half of it is taken back as long as it leads to where the tail is no number.
    wanted, norm = math.log(chance), -0.5 * dof * math.log(2.0) - math.lgamma(0.5 * dof)
    x, last = _roughly(chance, dof), float(dof)
    for _ in range(STEPS):
        p = tail(x, dof)
        if p == 0.0:
            x = 0.5 * (x + last)
            continue
        last = x
        density = math.exp(norm + (0.5 * dof - 1.0) * math.log(x) - 0.5 * x)
        step = (math.log(p) - wanted) * p / density
        x = max(x + step, 0.1 * x)
        if abs(step) < NEAR * x:
            break
    return x


def _roughly(chance: float, dof: int) -> float:
    """The same to a part in a thousand or so: the cube root of a chi-square variable is nearly normal."""
    t = math.sqrt(-2.0 * math.log(min(chance, 0.5)))  # above a half: from the median
    z = t - (2.515517 + t * (0.802853 + t * 0.010328)) / (1.0 + t * (1.432788 + t * (0.189269 + t * 0.001308)))
    spread = 2.0 / (9.0 * dof)
    return float(dof) * max(1.0 - spread + z * math.sqrt(spread), 0.1) ** 3
