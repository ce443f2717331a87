"""What compiled rows and columns are given of the vehicle at one epoch: one vector of numbers, by the places in it."""

from __future__ import annotations

from typing import Any

from truenorth.core.compiled import borrowing, compiled

# Places in the vector `now`: the state of strapdown.wander first (24 numbers, along the level frame w), then
NOW_C = 24  # C_wb, 9, by rows
NOW_MEAN_RATE = 33  # mean of w_ib_b since the last event, rad/s, sensor errors taken off
NOW_TURN = 36  # rate of the body against the earth, body axes, rad/s: by that mean, or by `NOW_RATE` once that is there
NOW_PUSH = 39  # dv_w/dt by the mean specific force since the last event, m/s^2
NOW_EARTH = 42  # the earth's rate along w, rad/s
NOW_RATE = 45  # w_ib_b at this very time, rad/s: for rows that ask for it (`instant`)
NOW_SPIN = 48  # its derivative, rad/s^2
NOW_FORCE = 51  # f_b at this time, m/s^2
NOW_SINCE = 54  # length of the means, s
NOW_GYRO_NOISE = 55  # density of the gyros' white noise, rad^2/s
NOW_BEHIND = 56  # s by which this epoch is later than the stamp: 0 but for rows that are re-timed
NOW_NORTH = 57  # sine and cosine of the direction of north in w (x, y)
NOW_FORCE_W = 59  # mean specific force along w since the last event, m/s^2
NOW_FORCE_B = 62  # the same along the body
NOW_OTHER_RATE = 65  # w_ib_b at this very time, of noise that is independent of that of `NOW_RATE`
NOW_RATE_NOISE = 68  # variance of a component of `NOW_RATE` by the gyros' white noise, (rad/s)^2
NOW_LENGTH = 69


@borrowing
def vector_of(values: Any, first: int) -> Any:
    """Three numbers of a vector as a tuple."""
    return values[first], values[first + 1], values[first + 2]


@compiled
def matrix_of(values: Any, first: int) -> Any:
    """A (3, 3) view of nine numbers of a vector."""
    return values[first : first + 9].reshape((3, 3))
