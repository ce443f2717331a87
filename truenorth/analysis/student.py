"""Student's t distribution, from the standard library alone: ``scipy.special`` costs .2 s of import, a sixth of an alignment.

The tail is an incomplete beta function, ``P(T > t) = I_x(nu/2, 1/2) / 2`` with ``x = nu / (nu + t^2)``, by its continued fraction;
that takes the more terms the more degrees of freedom there are. Of many, Hill's expansion has eleven digits.

Sources: M. Abramowitz and I. Stegun, Handbook of Mathematical Functions (1964), 26.7.1; W. Press et al., Numerical Recipes
(3rd ed. 2007), section 6.4 (its continued fraction, by Lentz's method); G. Hill, Student's t-distribution, Algorithm 395, Comm.
ACM 13 (1970).
"""

from __future__ import annotations

import math
from statistics import NormalDist

MANY = 1000.0  # degrees of freedom, from which Hill's expansion is taken
PRECISE = 1e-15  # relative: the fraction's last term
STEPS = 100  # of Newton's method, at the most; it takes some five


def tail(t: float, dof: float) -> float:
    """Probability that a Student's t variable exceeds `t`, which is not negative."""
    if dof >= MANY:
        return 0.5 * math.erfc(_hill(t, dof) / math.sqrt(2.0))
    a, b, x = 0.5 * dof, 0.5, dof / (dof + t * t)
    y = t * t / (dof + t * t)  # 1 - x, with all its digits
    both = a * math.log(x) + b * math.log(y) if y > 0.0 else -math.inf
    front = math.exp(math.lgamma(a + b) - math.lgamma(a) - math.lgamma(b) + both)
    if x < (a + 1.0) / (a + b + 2.0):  # where the fraction converges soon; else that of the mirrored function does
        return 0.5 * front * _fraction(a, b, x) / a
    return 0.5 - 0.5 * front * _fraction(b, a, y) / b


def below(t: float, dof: float) -> float:
    """Probability that a Student's t variable is less than `t`."""
    return 1.0 - tail(t, dof) if t > 0.0 else tail(-t, dof)


def student_limit(chance: float, dof: float) -> float:
    """What the size of a Student's t variable exceeds with the given probability: of a mean over its own estimated sigma."""
    if dof <= 0:
        return math.inf
    # The logarithm of the tail is concave in that of t: Newton's method comes to the root from one side.
    wanted = math.log(0.5 * chance)
    u = math.log(max(1e-300, -NormalDist().inv_cdf(0.5 * chance)))
    norm = math.lgamma(0.5 * (dof + 1.0)) - math.lgamma(0.5 * dof) - 0.5 * math.log(dof * math.pi)
    for _ in range(STEPS):
        t = math.exp(u)
        p = tail(t, dof)
        density = math.exp(norm - 0.5 * (dof + 1.0) * math.log1p(t * t / dof))
        step = (math.log(p) - wanted) * p / (density * t)
        u += step
        if abs(step) < 1e-14:
            break
    return math.exp(u)


def as_normal(size: float, dof: float) -> float:
    """How many sigmas of a normal variable are as rare as a Student's t variable of this size."""
    size = abs(size)
    if math.isinf(dof):
        return size
    if dof >= MANY:
        return _hill(size, dof)
    chance = tail(size, dof)
    return -NormalDist().inv_cdf(chance) if chance > 0.0 else math.inf


def _hill(t: float, dof: float) -> float:
    """The normal variable that is as rare, of many degrees of freedom."""
    a = dof - 0.5
    b = 48.0 * a * a
    y = a * math.log1p(t * t / dof)
    more = (((-0.4 * y - 3.3) * y - 24.0) * y - 85.5) / (0.8 * y * y + 100.0 + b) + y + 3.0
    return (more / b + 1.0) * math.sqrt(y)


def _fraction(a: float, b: float, x: float) -> float:
    """The continued fraction of the incomplete beta function."""
    tiny = 1e-300
    c, d = 1.0, 1.0 - (a + b) * x / (a + 1.0)
    d = 1.0 / (d if abs(d) > tiny else tiny)
    value = d
    m = 0
    while True:
        m += 1
        for term in (
            m * (b - m) * x / ((a + 2 * m - 1.0) * (a + 2 * m)),
            -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1.0)),
        ):
            d, c = 1.0 + term * d, 1.0 + term / c
            d, c = 1.0 / (d if abs(d) > tiny else tiny), c if abs(c) > tiny else tiny
            value *= d * c
        if abs(d * c - 1.0) < PRECISE or m > 10_000:
            return value
