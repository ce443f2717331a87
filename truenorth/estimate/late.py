"""A place that is shown late: what a correction of the motion does to what is known of the delay.

Fixes alone show ``p - tau v``. Whatever the motion, another delay and the same motion at another moment look alike but for what the
IMU shows of when it pushes. What is known after a fix is therefore

    eta = dp + v dtau,   eta' = dv + a dtau

and with columns at the latest velocity, ``H = v_hat``, it is not what is known at the next: a correction has taken ``x_v`` off the
velocity, which nothing has pushed, and the column has a step that looks like one of a motion. A fix after it seems to show how
late it is, by the noise of the one before. Of a robot that does 1 m/s with a consumer IMU and fixes of a metre most of what the
filter knew of a delay was of that kind, and errors of fixes that last, alike from row to row, led it away: by nine of its sigmas,
pass by pass. So errors are carried over a correction so that ``eta`` and ``eta'`` stay:

    dp <- dp + (v_before - v_after) dtau,   dv <- dv + (a_before - a_after) dtau

Source: G. Huang, A. Mourikis and S. Roumeliotis, "Observability-based rules for designing consistent EKF SLAM estimators", Int. J.
Robotics Research 29 (2010): what nothing shows must stay so from row to row. These errors of a delay are ours.
"""

from __future__ import annotations

from typing import Any

from truenorth.core.attitude import cross
from truenorth.core.compiled import borrowing
from truenorth.estimate.memory import Memory, Model

_PHI, _DV, _DP, _BA = 0, 3, 6, 12


@borrowing(forceinline=True)
def steps(m: Memory, model: Model, x: Any) -> Any:
    """By how much velocity and its change are less after a correction `x` than before, m/s and m/s^2 along w: tuples."""
    f, C, slow = m.means.vectors[0], m.sums.C_now, model.sensors[1]
    b = (x[_BA], x[_BA + 1], x[_BA + 2])
    if slow >= 0:
        b = (b[0] + x[slow], b[1] + x[slow + 1], b[2] + x[slow + 2])
    turned = cross((x[_PHI], x[_PHI + 1], x[_PHI + 2]), (f[0], f[1], f[2]))
    a = (
        C[0, 0] * b[0] + C[0, 1] * b[1] + C[0, 2] * b[2] - turned[0],
        C[1, 0] * b[0] + C[1, 1] * b[1] + C[1, 2] * b[2] - turned[1],
        C[2, 0] * b[0] + C[2, 1] * b[1] + C[2, 2] * b[2] - turned[2],
    )
    return (x[_DV], x[_DV + 1], x[_DV + 2]), a


@borrowing(forceinline=True)
def keep_moment(m: Memory, model: Model, x: Any, w: Any) -> None:
    """Carry `w.P` over a correction `x` that is about to be fed back."""
    lag = model.lag
    if lag < 0:
        return
    v, a = steps(m, model, x)
    N = w.P.shape[0]
    for j in range(N):
        for i in range(3):
            w.P[_DV + i, j] += a[i] * w.P[lag, j]
            w.P[_DP + i, j] += v[i] * w.P[lag, j]
    for j in range(N):
        for i in range(3):
            w.P[j, _DV + i] += a[i] * w.P[j, lag]
            w.P[j, _DP + i] += v[i] * w.P[j, lag]


@borrowing(forceinline=True)
def show(m: Memory, model: Model, exact: bool, w: Any) -> None:
    """Columns are from now on those of the motion less its known errors (`exact`), or those of the motion again."""
    sign = 1.0 if exact else -1.0
    m.shown[0] = 1.0 * exact
    for j in range(len(m.x)):
        w.x[j] = sign * m.x[j]
    keep_moment(m, model, w.x, w)
    if model.lag >= 0:
        v, a = steps(m, model, w.x)
        for i in range(3):
            m.x[_DV + i] += a[i] * m.x[model.lag]
            m.x[_DP + i] += v[i] * m.x[model.lag]
    for j in range(len(m.x)):
        w.x[j] = 0.0
