"""Acceleration matching: the specific force of a master INS, turned by its own attitude, against that of the slave.

Of two points of a rigid body, the slave at r from the master (slave axes), the forces differ by
``D r = w x (w x r) + w' x r``. With the master late by tau and its attitude wrong by m (east, north, up):

    z = C_hat (f_hat - D_hat r) - C_master f_master = f x phi + C (nabla + M_a (f - f0)) + f' tau - f x m + C D dr - C dD r

with ``dD`` by ``M_g w`` and ``M_g w'`` (:mod:`truenorth.errors.axes`), and ``f' = C (w x f + f_b')``. For the columns of arm and
delay, w' and f_b' come with the row, taken over some tenths of a second: of a few samples w' is noise, and its square would be
taken for knowledge. For the same reason the arm should be *considered* here, not estimated: what is smoothed is not quite what
acts. The slave's force is a mean over six samples; what noise and vibration leave of it counts in the noise of the row.

Where the seat bends, `w` and `w'` of the arm are those of its chord (:mod:`truenorth.errors.bending`).

Source: Xia Jiahe et al., "Study on transfer alignment algorithm considering space-time difference", Navigation Positioning
and Timing 3 (2016), eq. 4, for a rigid body; its transformation on the right is the inverse of what its words say.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from truenorth.aiding.master import from_north
from truenorth.aiding.position import into_north
from truenorth.aiding.row import (
    ARM,
    AT_ARM,
    AT_BIAS,
    AT_FLEXURE,
    AT_LAG,
    AT_OWN,
    AT_SCALE,
    OWN,
    Row,
    by_axes,
    idle_part,
    lag_now,
    row,
    with_state,
)
from truenorth.core.attitude import cross, times
from truenorth.state.layout import BA, PHI
from truenorth.state.now import NOW_C, NOW_FORCE, NOW_RATE, NOW_SPIN, matrix_of, vector_of

_PHI, _BA = PHI.start, BA.start


@row
def _acceleration(now: Any, figures: Any, at: Any, assumed: Any, measured: Any, H: Any, z: Any, R: Any) -> None:
    """Measured: the master's specific force, east, north, up; the slave's w' and f_b', NaN where its log ends.

    Behind these how fast the seat bends, rad/s, and how fast that changes, rad/s^2, body axes, or NaN. Its own figures: the force
    at rest besides which the accelerometers' axes act; the coupling of a seat that bends (3).
    """
    if np.isnan(measured[0]):
        return
    r = with_state(figures, ARM, assumed, at[AT_ARM])
    C, w, spin, f = matrix_of(now, NOW_C), vector_of(now, NOW_RATE), vector_of(now, NOW_SPIN), vector_of(now, NOW_FORCE)
    said, growth, smooth = from_north(now, (measured[0], measured[1], measured[2])), (0.0, 0.0, 0.0), spin
    if not np.isnan(measured[3]):
        smooth, growth = vector_of(measured, 3), vector_of(measured, 6)
    still = vector_of(figures, OWN)
    more = (f[0] - still[0], f[1] - still[1], f[2] - still[2])
    of_f, of_w, of_spin = (
        by_axes(assumed, at[AT_SCALE], more),
        by_axes(assumed, at[AT_OWN], w),
        by_axes(assumed, at[AT_OWN], spin),
    )
    f = (f[0] - of_f[0], f[1] - of_f[1], f[2] - of_f[2])
    w = (w[0] - of_w[0], w[1] - of_w[1], w[2] - of_w[2])
    spin = (spin[0] - of_spin[0], spin[1] - of_spin[1], spin[2] - of_spin[2])
    bends = not np.isnan(measured[9])
    if bends:
        idle = idle_part(figures, OWN + 3, assumed, at[AT_FLEXURE], measured, 9)
        slower = idle_part(figures, OWN + 3, assumed, at[AT_FLEXURE], measured, 12)
        w = (w[0] - idle[0], w[1] - idle[1], w[2] - idle[2])
        spin = (spin[0] - slower[0], spin[1] - slower[1], spin[2] - slower[2])
    swing, roll = cross(w, cross(w, r)), cross(spin, r)
    at_master = (f[0] - swing[0] - roll[0], f[1] - swing[1] - roll[1], f[2] - swing[2] - roll[2])
    turn = cross(w, at_master)
    force, change = times(C, at_master), times(C, (turn[0] + growth[0], turn[1] + growth[1], turn[2] + growth[2]))
    lag = lag_now(now, assumed, at[AT_LAG])
    for i in range(3):
        z[i] = force[i] - lag * change[i] - said[i]
        if at[AT_LAG] >= 0:
            H[i, at[AT_LAG]] = change[i]
    for j in range(3):
        e = (1.0 * (j == 0), 1.0 * (j == 1), 1.0 * (j == 2))
        lean, swing, roll = cross(said, e), cross(w, cross(w, e)), cross(smooth, e)
        arm = times(C, (swing[0] + roll[0], swing[1] + roll[1], swing[2] + roll[2]))
        for i in range(3):
            H[i, _PHI + j], H[i, _BA + j] = lean[i], C[i, j]
            if at[AT_ARM] >= 0:
                H[i, at[AT_ARM] + j] = arm[i]
            if at[AT_SCALE] >= 0:
                for k in range(3):
                    H[i, at[AT_SCALE] + 3 * j + k] = C[i, j] * more[k]
        if at[AT_OWN] >= 0:
            inner, outer, roll = cross(e, cross(w, r)), cross(w, cross(e, r)), cross(e, r)
            for k in range(3):
                turned = times(
                    C,
                    (
                        (inner[0] + outer[0]) * w[k] + roll[0] * smooth[k],
                        (inner[1] + outer[1]) * w[k] + roll[1] * smooth[k],
                        (inner[2] + outer[2]) * w[k] + roll[2] * smooth[k],
                    ),
                )
                for i in range(3):
                    H[i, at[AT_OWN] + 3 * j + k] = -turned[i]
    if bends and at[AT_FLEXURE] >= 0:
        for j in range(3):
            rate, spins = measured[9 + j], measured[12 + j]
            turn = (rate * (j == 0), rate * (j == 1), rate * (j == 2))
            roll, inner, outer = (
                cross((spins * (j == 0), spins * (j == 1), spins * (j == 2)), r),
                cross(turn, cross(w, r)),
                cross(w, cross(turn, r)),
            )
            roll = times(
                C, (roll[0] + inner[0] + outer[0], roll[1] + inner[1] + outer[1], roll[2] + inner[2] + outer[2])
            )
            for i in range(3):
                H[i, at[AT_FLEXURE] + j] = roll[i]
    into_north(now, H, z)
    if at[AT_BIAS] >= 0:  # an error of the master's attitude stands along east, north, up, as what it said
        m, of = (measured[0], measured[1], measured[2]), at[AT_BIAS]
        for j in range(3):
            lean = cross(m, (1.0 * (j == 0), 1.0 * (j == 1), 1.0 * (j == 2)))
            for i in range(3):
                H[i, of + j] = -lean[i]
                z[i] += lean[i] * assumed[of + j]


MASTER_ACCELERATION = Row(
    "master acceleration",
    _acceleration,
    {"lever arm": 3, "bias": 3, "lag": 1, "scale": 9, "own": 9, "flexure": 3},
    width=15,
    instant=True,
    unit="m/s^2",
)
