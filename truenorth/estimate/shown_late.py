"""A place that is shown late: what a correction of the motion does to what is known of the delay.

A fix shows ``p - tau v``. Whatever the motion, another delay and the same motion at another moment look alike, but for what the IMU
shows of when it pushes. What fixes tell is therefore

    eta = dp + v dtau

and not either of the two. The column of the delay is the latest velocity. Once a correction has taken ``x_v`` off that, ``eta``
is no more what was known: the column has a step that nothing has pushed, and the next fix seems to show how late it is, by the
noise of the one before. Of a robot that does 1 m/s, with a consumer IMU and fixes of a metre, most of what the filter knew of a
delay was of that kind. Errors of fixes that last, alike from row to row, led it away, pass by pass, by twenty of its sigmas. So
errors are carried over a correction such that ``eta`` stays,

    dp <- dp + (v_before - v_after) dtau

What is known of velocity stays as it is: a vehicle that stands shows it undelayed. (With ``dv <- dv + (a_before - a_after) dtau``
as well, zero velocities at rest seemed to show a delay to .03 s.)

An open loop (:mod:`truenorth.estimate.apart`) is linear about a motion that drifts away from what is known, with velocities that
tilts have made. The column of the delay is of the velocity and the delay that are known there, from the first row on, and so are
``-tau`` in that of velocity and ``-tau a`` in that of the delay: as if what is known were fed back.

Source: G. Huang, A. Mourikis and S. Roumeliotis, "Observability-based rules for designing consistent EKF SLAM estimators", Int. J.
Robotics Research 29 (2010): what nothing shows must be the same from row to row. The rule for a delay is ours.
"""

from __future__ import annotations

from typing import Any

from truenorth.core.compiled import borrowing
from truenorth.state.now import NOW_PUSH

_DV, _DP = 3, 6


@borrowing(forceinline=True)
def keep_moment(lag: int, x: Any, P: Any) -> None:
    """Carry `P` (N, N) over a correction `x` of the motion that columns are of; `lag`: the state of the delay, -1: none."""
    if lag < 0:
        return
    for j in range(P.shape[0]):
        for i in range(3):
            P[_DP + i, j] += x[_DV + i] * P[lag, j]
    for j in range(P.shape[0]):
        for i in range(3):
            P[j, _DP + i] += x[_DV + i] * P[j, lag]


@borrowing(forceinline=True)
def is_late(lag: int, H: Any) -> bool:
    """Whether a row is one of places that are shown late."""
    return lag >= 0 and H[2, _DP + 2] != 0.0 and (H[0, lag] != 0.0 or H[1, lag] != 0.0 or H[2, lag] != 0.0)


@borrowing(forceinline=True)
def as_it_moves(lag: int, x: Any, H: Any) -> None:
    """Take the errors `x` that are known off the velocity in the column of a place that is shown late."""
    if is_late(lag, H):
        for i in range(3):
            for j in range(3):
                H[i, lag] -= H[i, _DP + j] * x[_DV + j]


@borrowing(forceinline=True)
def as_late_as_known(lag: int, x: Any, now: Any, H: Any) -> None:
    """Make the columns of such a place those of a delay less its error `x`: ``-tau`` of velocity, ``v - tau a`` of the delay."""
    if is_late(lag, H):
        for i in range(3):
            for j in range(3):
                H[i, _DV + j] -= H[i, _DP + j] * x[lag]
                H[i, lag] -= H[i, _DP + j] * now[NOW_PUSH + j] * x[lag]


@borrowing(forceinline=True)
def keep_link(lag: int, x: Any, D: Any) -> None:
    """Fill in `D` (n, n), by which :func:`keep_moment` carries errors."""
    if lag >= 0:
        for i in range(3):
            D[_DP + i, lag] += x[_DV + i]
