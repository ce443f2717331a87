"""Corrections in the closed loop: rows evaluated, gated, and what they found fed back."""

from __future__ import annotations

from typing import Any

import numpy as np

from truenorth.aiding.row import AT_FILTER, beyond_noise, by_axes, row_at
from truenorth.core import earth
from truenorth.core.attitude import quaternion_from_rotation_vector, quaternion_product
from truenorth.core.compiled import borrowing
from truenorth.core.linalg import dot_at
from truenorth.errors.invariant import rotation_vector_of
from truenorth.estimate.memory import Events, Memory, Model, Sources
from truenorth.filters.recursion import (
    NO_INNOVATION_VARIANCE,
    NOT_POSITIVE,
    ROUNDING,
    SOUND,
    remember_largest,
    row_variance,
    still_positive,
)
from truenorth.state.now import NOW_NORTH, NOW_OTHER_RATE, NOW_RATE, NOW_RATE_NOISE, vector_of
from truenorth.strapdown.wander import displace

_PHI, _DV, _DP, _BG, _BA = 0, 3, 6, 9, 12
MOST_TURNED = 0.1**2  # rad^2: beyond it the second order is not the last
GRAVITY_GRADIENT = 2.0 * earth.GRAVITY_EQUATOR / earth.SEMI_MAJOR  # 1/s^2: of the free vertical channel


@borrowing(forceinline=True)
def measure(m: Memory, model: Model, sources: Sources, source: int, measured: Any, now: Any, w: Any, R: Any) -> None:
    """Fill in `H`, `z` and what the row adds to `R` (3,)."""
    for i in range(3):
        w.z[i] = np.nan
        for j in range(w.H.shape[1]):
            w.H[i, j] = 0.0
    row_at(sources.row[source])(now, sources.figures[source], sources.states[source], m.aux, measured, w.H, w.z, R)
    for slow, whole in ((model.sensors[0], _BG), (model.sensors[1], _BA)):  # a slow bias is a bias like the other
        if slow >= 0:
            for i in range(3):
                for j in range(3):
                    w.H[i, slow + j] = w.H[i, whole + j]
    if sources.swings[source]:
        quick = (0.0, 0.0, 0.0)
        if sources.states[source, AT_FILTER] >= 0:
            quick = (measured[3], measured[4], measured[5])
        swing_as_gyros_say(model.sensors[2], m.aux, now, quick, w.H, w.z, R)


@borrowing(forceinline=True)
def swing_as_gyros_say(axes: int, assumed: Any, now: Any, quick: Any, H: Any, z: Any, R: Any) -> None:
    """What the gyros' errors do to the swing of a sensor on its arm, beyond those of their biases.

    The swing ``w x l`` is of a rate ``w_hat = (I + M) w + eps + n``. A row has the column B of eps, ``C [e x l]`` of a velocity.
    That of an element of M is ``B_i w_j``: on a mast that swings by 1 m/s a gyro that is 1 % askew looks like a body that is
    turned by .6 deg, and it is a state already for what it does to attitude. What is assumed of M is taken off. The noise n of the
    moment is new in each row, ``B n`` with the variance ``q sum a^2 dt`` of weights a over samples dt. Columns are by a rate whose
    noise is not that of `z`, as those of an arm by a master (:mod:`truenorth.aiding.master`): one that is in both would be taken
    for a scale. What M does to the `quick` part of the rate a row may have in states of its own (:mod:`truenorth.aiding.velocity`).
    """
    if axes >= 0:
        rate, other = vector_of(now, NOW_RATE), vector_of(now, NOW_OTHER_RATE)
        off = by_axes(assumed, axes, (rate[0] - quick[0], rate[1] - quick[1], rate[2] - quick[2]))
        other = (other[0] - quick[0], other[1] - quick[1], other[2] - quick[2])
        seen = beyond_noise(other, now[NOW_RATE_NOISE])
        for i in range(3):
            for j in range(3):
                z[i] -= H[i, _BG + j] * off[j]
                for k in range(3):
                    H[i, axes + 3 * j + k] += seen * H[i, _BG + j] * other[k]
    for i in range(3):
        for j in range(3):
            R[i] += now[NOW_RATE_NOISE] * H[i, _BG + j] * H[i, _BG + j]


@borrowing(forceinline=True)
def arm_turned(at: int, C: Any, w: Any, R: Any) -> None:
    """What an arm that is not known, turned by an attitude that is not known, adds to the variances of a place, m^2.

    ``phi x C dl`` is of the second order: of .1 rad and 1 m a decimetre, which fixes of centimetres take for knowledge of either.
    Its mean square is in the noise, the two taken as independent (A. Jazwinski, *Stochastic Processes and Filtering Theory*, 1970,
    sec. 9.3, filters of second order). Where heading is open passes about narrow guesses find it, and this is left out.
    """
    if at < 0 or w.H[2, _DP + 2] == 0.0 or w.P[_PHI + 2, _PHI + 2] > MOST_TURNED:
        return  # no such arm, no place
    d = (0.0, 0.0, 0.0)  # variances of the arm along the level frame
    for i in range(3):
        for k in range(3):
            d = (
                d[0] + C[0, i] * w.P[at + i, at + k] * C[0, k],
                d[1] + C[1, i] * w.P[at + i, at + k] * C[1, k],
                d[2] + C[2, i] * w.P[at + i, at + k] * C[2, k],
            )
    east, north, up = w.P[_PHI, _PHI], w.P[_PHI + 1, _PHI + 1], w.P[_PHI + 2, _PHI + 2]
    level = max(north * d[2] + up * d[1], east * d[2] + up * d[0])  # whichever way a level frame points
    R[0], R[1], R[2] = R[0] + level, R[1] + level, R[2] + east * d[1] + north * d[0]


@borrowing(forceinline=True)
def touched(H: Any, columns: Any) -> int:
    """Put down the columns of `H` that are not zero, in order; how many there are."""
    count = 0
    for j in range(H.shape[1]):
        if H[0, j] != 0.0 or H[1, j] != 0.0 or H[2, j] != 0.0:
            columns[count] = j
            count += 1
    return count


@borrowing(forceinline=True)
def joint_nis(size: Any, w: Any, columns: Any, S: Any, sigma: Any) -> Any:
    """How many rows are present, and ``nu' S^-1 nu`` of them together, by Cholesky's factor of ``S``."""
    count = 0
    nis = 0.0
    for i in range(3):
        sigma[i] = np.nan
    for i in range(3):
        if np.isnan(w.z[i]):
            continue
        _, variance, _ = row_variance(size, w, i, False, columns)
        sigma[i] = np.sqrt(variance)
        whitened = w.z[i]
        S[i, i] = variance
        for j in range(i):
            if np.isnan(w.z[j]):
                continue
            total = dot_at(columns, w.H[j], w.a)
            for k in range(j):
                if not np.isnan(w.z[k]):
                    total -= S[i, k] * S[j, k]
            S[i, j] = total / S[j, j]
            S[i, i] -= S[i, j] * S[i, j]
            whitened -= S[i, j] * S[j, 3]
        S[i, i] = np.sqrt(S[i, i])
        S[i, 3] = whitened / S[i, i]
        nis += S[i, 3] * S[i, 3]
        count += 1
    return count, nis


@borrowing
def update_held(size: Any, w: Any, held: Any, columns: Any = None) -> int:
    """Condition on all rows with the optimal gain, but none for the states that are considered only (Schmidt).

    With ``a = P h`` and ``k = a/s`` where a state is estimated, 0 where not: ``P = (I - k h') P (I - k h')' + k r k'``,
    Joseph's form, which is ``P - (k a' + a k') + s k k'``.

    Source: S. Schmidt, "Application of state-space methods to navigation problems", Adv. Control Syst. 3 (1966).
    """
    remember_largest(size, w)
    for row in range(w.z.shape[0]):
        if np.isnan(w.z[row]):
            continue
        nu, variance, _ = row_variance(size, w, row, False, columns)
        if not variance > 0.0:
            return NO_INNOVATION_VARIANCE
        if variance < (1.0 - ROUNDING) * w.R[row, row]:
            return NOT_POSITIVE
        for i in range(len(size)):
            w.k[i] = w.a[i] / variance
        for i in range(len(held)):
            if held[i]:
                w.k[i] = 0.0
        for i in range(len(size)):
            w.x[i] += w.k[i] * nu
            for j in range(len(size)):
                w.P[i, j] += variance * w.k[i] * w.k[j] - (w.k[i] * w.a[j] + w.a[i] * w.k[j])
    return SOUND if still_positive(size, w) else NOT_POSITIVE


@borrowing
def damp_height(size: Any, C: Any, T: float, time_constant: float, w: Any) -> None:
    """Third-order loop in place of a Kalman gain: height, velocity and accelerometer bias, all poles at -1/time_constant.

    ``e_h' = e_v - c1 e_h``, ``e_v' = (2 g/R - c2) e_h + b``, ``b' = -c3 e_h``: ``c1 = 3/tau``, ``c2 = 3/tau^2 + 2 g/R``,
    ``c3 = 1/tau^3``. The covariance is that of these gains: ``P = (I - k h) P (I - k h)' + k r k'``.
    """
    nu, variance, _ = row_variance(size, w, np.int64(0), False)
    rate = 1.0 / time_constant
    last = T * rate * rate * rate
    for i in range(len(size)):
        w.k[i] = 0.0
    w.k[_DP + 2] = 3.0 * T * rate
    w.k[_DV + 2] = T * (3.0 * rate * rate + GRAVITY_GRADIENT)
    for j in range(3):
        w.k[_BA + j] = C[2, j] * last
    for i in range(len(size)):
        w.x[i] += w.k[i] * nu
        for j in range(len(size)):
            w.P[i, j] += variance * w.k[i] * w.k[j] - (w.k[i] * w.a[j] + w.a[i] * w.k[j])


@borrowing(forceinline=True)
def feed_back(s: Any, aux: Any, x: Any, turns: Any) -> None:
    """Take the estimated errors off the state and the sensors; the estimate is zero again.

    `turns` are the first states of rotations: what is found is composed with what is assumed, not added.
    """
    q = quaternion_from_rotation_vector((x[0], x[1], x[2]))
    s[0], s[1], s[2], s[3] = quaternion_product(q, (s[0], s[1], s[2], s[3]))
    for j in range(3):
        s[4 + j] -= x[3 + j]
    displace(s, -x[6], -x[7], -x[8])
    for i in turns:
        found = quaternion_from_rotation_vector((x[i], x[i + 1], x[i + 2]))
        assumed = quaternion_from_rotation_vector((aux[i], aux[i + 1], aux[i + 2]))
        aux[i], aux[i + 1], aux[i + 2] = rotation_vector_of(quaternion_product(found, assumed))
        x[i], x[i + 1], x[i + 2] = 0.0, 0.0, 0.0
    for j in range(9, len(aux)):
        aux[j] += x[j]
    for j in range(len(x)):
        x[j] = 0.0


@borrowing(forceinline=True)
def keep_apart(known: Any, x: Any) -> None:
    """Add what was found to the errors that are known and not fed back; the estimate is zero again."""
    for j in range(len(known)):
        known[j] += x[j]
        x[j] = 0.0


@borrowing(forceinline=True)
def set_place(size: Any, m: Memory, now: Any, variance: Any, w: Any) -> None:
    """Put the vehicle where a row of position says (`z`, along east, north, up), its error independent of all others."""
    s, c = now[NOW_NORTH], now[NOW_NORTH + 1]
    displace(m.s, -(c * w.z[0] + s * w.z[1]), -(c * w.z[1] - s * w.z[0]), -w.z[2])
    for i in range(3):
        for j in range(len(size)):
            w.P[_DP + i, j] = 0.0
            w.P[j, _DP + i] = 0.0
        w.P[_DP + i, _DP + i] = variance[i]
        m.x[_DP + i] = 0.0


@borrowing
def disturb(of: Events, e: int, P: Any) -> None:
    """Add what the base may have done in a gap to the variances of attitude and velocity."""
    for a in range(3):
        P[_PHI + a, _PHI + a] += of.variance[e, a]
        P[_DV + a, _DV + a] += of.measured[e, a]
