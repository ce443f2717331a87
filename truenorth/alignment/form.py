"""Velocity or accelerometers? The form of the filter's measurement, picked by the disturbance that the log shows.

Bounded motion of a base is a velocity that comes and goes: seen as specific force it is differentiated, and neighbouring
intervals are correlated. Accelerometer noise is white. So the level specific force of the log itself says whether the base
moves beyond the noise of its sensors.

Source: G. M. Ljung, G. E. P. Box, On a measure of lack of fit in time series models, Biometrika 65, 1978.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from truenorth.errors.staying import Form
from truenorth.quality.regimes import MotionSummary

Array = NDArray[np.float64]

LAGS = 10
WHITE = 45.3  # chi-square of 2 x 10 degrees of freedom exceeds it in 1 of 1000 logs of white noise
FEWEST = 50  # intervals
TREND = 3  # parameters of a tilt, a wrong heading and a gyro bias: a parabola in time


def pick_form(gained: Array, motion: MotionSummary) -> tuple[Form, str]:
    """The form, and why.

    Parameters
    ----------
    gained : (K, 3) array, m/s
        Velocity gained in each interval, level axes first, of an INS that is about aligned.
    """
    if motion.overall != "still" or len(gained) < FEWEST:
        return "velocity", "velocity form"
    portmanteau = _portmanteau(gained[:, :2])
    if portmanteau > WHITE:
        return "velocity", (
            f"velocity form: the level specific force is coloured (Ljung-Box {portmanteau:.0f}, white noise stays below "
            f"{WHITE:.0f}), so the base moves a little"
        )
    return "force", (
        f"accelerometer form: the level specific force is white (Ljung-Box {portmanteau:.0f} of {WHITE:.0f}), so the base "
        "does not move beyond the noise of its sensors"
    )


def _portmanteau(x: Array) -> float:
    """Ljung and Box's statistic of both columns (K, 2), a parabola taken out."""
    count = len(x)
    trend = _trend(count)
    total = 0.0
    for e in np.ascontiguousarray((x - trend @ (trend.T @ x)).T):
        power = float(e @ e)
        total += sum([(float(e[lag:] @ e[:-lag]) / power) ** 2 / (count - lag) for lag in range(1, LAGS + 1)])
    return count * (count + 2) * total


@lru_cache(maxsize=2)
def _trend(count: int) -> Array:
    """(count, 3) orthonormal columns that span the parabolas; nobody writes to it."""
    basis = np.linalg.qr(np.vander(np.linspace(-1.0, 1.0, count), TREND))[0]
    basis.flags.writeable = False
    return np.asarray(basis, dtype=np.float64)
