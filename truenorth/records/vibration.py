"""Vibration that a log of rates hardly samples: what the integration of its rows makes of it.

**The angle at a row.** Rates are integrated by the causal rule of third order (:func:`truenorth.strapdown.increments.increments`).
Gregory's formula, summed from one end of a log to the other, leaves differences about the epoch alone; the angle by the rule less
the true one is, but for a constant that any filter takes for attitude,

    T (delta^2/24 - 11/720 mu delta^3 + 191/60480 mu delta^5 - ..) w,

with central differences ``delta`` and means ``mu`` of the rate ``w``. It does not grow, and averages out of what a filter learns.

**The drift.** Axes that vibrate out of step make a cone, whose true drift is ``<theta x w>/2``. With ``x`` the angle of a tone
in an interval, the rule makes ``H`` of an angle, and the coning term ``dtheta' x dtheta/12`` of the mechanisation leaves

    |H|^2 sin x (1 + (1 - cos x)/3)/x - 1,    H = j x (5 + 8/z - 1/z^2)/(12 (1 - 1/z)),    z = exp(j x)

of that drift: -.13 at five rows a period, -.01 at ten, -.0006 at twenty. This acts as a bias of the gyros.

What turns by pi and more between two rows no log shows. Increments have neither error.

**The mean rate.** A base that only trembles turns with the earth, and the mean of its gyros does not: it is less by that drift of
the cone, whatever the rows. Of .06 deg about two axes at 10 Hz that is 4 deg/h.

Sources: F. B. Hildebrand, "Introduction to Numerical Analysis", 2nd ed. (1974), sec. 5.8 and 5.9 (Gregory's formula); P. Savage,
"Strapdown inertial navigation integration algorithm design", J. Guid. Control Dyn. 21 (1998), part 1 (coning). The rest is ours.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from truenorth.core.remembered import remembered
from truenorth.records.imu import ImuRecord
from truenorth.records.one_pass import passed

Array = NDArray[np.float64]

BLOCK = 20.0  # s, in which an engine runs as it does
FEWEST = 32  # rows of a block
LEAST_CONE = 2e-10  # rad/s, 4e-5 deg/h: no gyro has as small a bias

SECOND = np.array([0.0, 0.0, 1.0, -2.0, 1.0, 0.0, 0.0])
THIRD = np.array([0.0, -1.0, 2.0, 0.0, -2.0, 1.0, 0.0]) / 2.0
FIFTH = np.array([-1.0, 4.0, -5.0, 0.0, 5.0, -4.0, 1.0]) / 2.0
ERROR = SECOND / 24.0 - 11.0 / 720.0 * THIRD + 191.0 / 60480.0 * FIFTH  # of the rates at rows k-3 .. k+3, times T


def sampling_error(rates: Array, interval: float) -> float:
    """RMS error at a row in the last block of rates (N, 3) that are integrated, along the direction where it is largest."""
    last = rates[-max(round(BLOCK / interval), FEWEST) :]
    count = len(last) - len(ERROR) + 1
    if count < 1:
        return 0.0
    error = interval * sum(c * last[i : i + count] for i, c in enumerate(ERROR))
    return math.sqrt(max(float(np.linalg.eigvalsh(error.T @ error / count)[-1]), 0.0))


def coning_left(record: ImuRecord) -> float:
    """Drift about the worst axis that coning between rows leaves, rad/s: RMS over blocks of the log."""
    left = _cones(record)[..., 0]
    return math.sqrt(float(np.max(np.mean(np.square(left), axis=0)))) if len(left) else 0.0


def cone_drift(record: ImuRecord) -> Array:
    """(3,) by which the mean rate of a base falls short of that at which it turns, since its axes vibrate in cones, rad/s."""
    whole = _cones(record)[..., 1]
    return np.asarray(whole.mean(axis=0)) if len(whole) else np.zeros(3)


@remembered
def _cones(record: ImuRecord) -> Array:
    """(B, 3, 2) of blocks of the log, rad/s: what of ``<theta x w>/2`` is left by the rows, and what their mean lacks of it.

    No cone has more than the rates' variance over the slowest frequency of a block: where that is nothing, nothing is worked out.
    """
    length = max(round(BLOCK / record.interval), FEWEST)
    rates = record.kind == "rates"
    unit = 1.0 if rates else 1.0 / record.interval
    sums = passed(record).gyro
    variance = unit**2 * (sums[1] / len(record) - (sums[0] / len(record)) ** 2)
    slowest = 2.0 * math.pi / (length * record.interval)
    blocks = len(record) // length if float(variance.max()) > LEAST_CONE * slowest else 0
    if not blocks:  # of rows that are nanoseconds apart a block's spectrum would fill the memory
        return np.empty((0, 3, 2))
    mean = np.ones(len(record)) @ record.gyro / len(record)
    x = 2.0 * math.pi * np.arange(1, length // 2 + 1) / length
    shares = (share_left(x), np.ones_like(x)) if rates else (np.zeros_like(x), share_of_increments(x))
    # <theta x w>/2 of a tone of amplitude A: Im(A x conj(A))/(4 w), of whose two products each is the other's conjugate. A window
    # of power 3/8 makes A of W.
    scale = (8.0 / 3.0) * (2.0 * unit / length) ** 2 * record.interval / (2.0 * x)
    weight = np.stack(shares, axis=1) * scale[:, None]
    window, drift = np.hanning(length), np.empty((blocks, 3, 2))
    ends = record.gyro[len(record) - blocks * length :].reshape(blocks, length, 3)
    for at, rows in enumerate(ends):
        W = np.fft.rfft((rows - mean).T * window)[:, 1:]
        drift[at] = [(W[j].imag * W[k].real - W[j].real * W[k].imag) @ weight for j, k in ((1, 2), (2, 0), (0, 1))]
    return drift


def share_of_increments(x: Array) -> Array:
    """Of a cone by the mean rates of intervals, of tones that turn by x rad in one."""
    return np.asarray(np.square(0.5 * x / np.sin(0.5 * x)))


def integrated(x: Array, kind: str) -> Array:
    """What the sums of rows make of the integral of tones that turn by x rad in an interval, as a share of it."""
    return np.abs(_by_rule(x)) if kind == "rates" else 0.5 * x / np.sin(0.5 * x)


def share_left(x: Array) -> Array:
    """Share of the drift of a cone that the mechanisation makes too much, of tones that turn by x rad an interval."""
    return np.asarray(np.abs(_by_rule(x)) ** 2 * np.sin(x) * (1.0 + (1.0 - np.cos(x)) / 3.0) / x - 1.0)


def _by_rule(x: Array) -> NDArray[np.complex128]:
    """H of the module's text."""
    z = np.exp(-1j * x)
    return np.asarray(1j * x * (5.0 + 8.0 * z - z * z) / (12.0 * (1.0 - z)))
