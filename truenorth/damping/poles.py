"""Eigenvalues of the error dynamics under a Kalman filter's own gain: how fast what it does not know dies away."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from truenorth.damping.course import linearised
from truenorth.damping.filters import Filter
from truenorth.damping.loop import Mode
from truenorth.errors.marine import DV
from truenorth.state.track import Track

Array = NDArray[np.float64]
ROUNDING = 1e-9  # of an eigenvalue of one step: constants stay where they are, and their eigenvalue is 1


def filter_modes(course: Track, kind: Filter, P: Array, epoch: int = -1) -> list[Mode]:
    """Modes of ``(I - K H) Phi``, constants left out, with the gain of a covariance after an update, ``K = P H' R^-1``.

    Parameters
    ----------
    course : Track
    kind : Filter
    P : (n, n) array
        Such as an estimate's last one.
    epoch : int
        Interval about which the dynamics are taken; a window of filter 2 is no longer than it.
    """
    first = epoch % (len(course) - 1)
    part = course[first : first + 2]
    F, Phi = linearised(part, kind.model)
    n = kind.model.states
    H = F[0, DV] if kind.window > 0.0 else kind.rows(part)[0]
    K = P @ H.T / kind.sigma**2
    values = np.linalg.eigvals((np.eye(n) - K @ H) @ Phi[0]).astype(np.complex128)
    rates = np.log(values) / course.interval
    kept = [complex(v) for v in rates if v.imag >= -ROUNDING / course.interval]
    return [Mode("filter", v) for v in sorted(kept, key=abs, reverse=True) if abs(v) > ROUNDING / course.interval]
