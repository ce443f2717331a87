"""Groups of a speed log: what it shows beyond the vehicle's velocity over the ground.

    v_log = v + d + k v + mu (v_N, -v_E) + C b + noise        east, north; errors measured minus true

| group | states | unit |
| --- | --- | --- |
| `DRIFT` | d, east and north: a current (its opposite, for a log in the water), a wrong zero; Gauss-Markov | m/s |
| `SCALE` | k | 1 |
| `MOUNTING` | mu, the log's axes turned clockwise, seen from above | rad |
| `BIAS` | b, right and forward, fixed to the hull | m/s |

A drift whose correlation time nobody knows is found from the data: the walk of what INS and log differ by has the density
``2 sigma^2/tau``, and the INS itself is smooth (:mod:`truenorth.damping.drift`).

The presets, and why: in the water a log shows the current, some decimetres a second that tides and eddies change in hours
(R. Stewart, *Introduction to Physical Oceanography*, ch. 10, 17). An electromagnetic log sees the boundary layer of the hull, and
after calibration on a measured mile it is good to half a per cent and a tenth of a metre a second (IMO resolution MSC.96(72)
admits 2 % or .2 kn). A Doppler log errs with the speed of sound, some parts in a thousand; over the ground it knows no current.
A mounting is found by such runs to .2-.3 deg.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truenorth.core.errors import UsageError
from truenorth.errors.group import Group

Array = NDArray[np.float64]

NAME = "velocity log"
DRIFT, SCALE, MOUNTING, BIAS = (f"{NAME} {part}" for part in ("drift", "scale", "mounting", "bias"))


@dataclass(frozen=True)
class LogErrors:
    """Slow errors of a speed log, one-sigma.

    Attributes
    ----------
    drift : float, m/s
        East and north.
    drift_time : float or None, s
        Its correlation time; infinite: a constant. None: found from the data where that is possible, else a constant.
    scale : float
    mounting : float, rad
        About the vertical.
    bias : float, m/s
        Constant, right and forward.

    Raises
    ------
    UsageError
        A sigma below zero, a time that is not positive.
    """

    drift: float = 0.0
    drift_time: float | None = None
    scale: float = 0.0
    mounting: float = 0.0
    bias: float = 0.0

    def __post_init__(self) -> None:
        if not all(0.0 <= x < math.inf for x in (self.drift, self.scale, self.mounting, self.bias)):
            raise UsageError(f"errors of the velocity log {self}; expected sigmas of zero or more")
        if self.drift_time is not None and not self.drift_time > 0.0:
            raise UsageError(f"drift of the velocity log over {self.drift_time:g} s; expected a time above zero")

    @property
    def time(self) -> float:
        """Correlation time of the drift as far as it is known, s."""
        return math.inf if self.drift_time is None else self.drift_time

    def groups(self) -> tuple[Group, ...]:
        """States along the level, the drift first; see :func:`log_rows`."""
        found = (
            Group(DRIFT, np.full(2, self.drift), self.time, unit="m/s"),
            Group(SCALE, np.full(1, self.scale)),
            Group(MOUNTING, np.full(1, self.mounting), unit="rad"),
            Group(BIAS, np.full(2, self.bias), unit="m/s"),
        )
        return tuple(group for group in found if np.any(group.sigma > 0.0))


LOGS = {
    "reference": LogErrors(drift=0.3),
    "em": LogErrors(drift=0.5, scale=0.005, mounting=math.radians(0.3), bias=0.1),
    "doppler-water": LogErrors(drift=0.5, scale=0.003, mounting=math.radians(0.2), bias=0.02),
    "doppler-bottom": LogErrors(scale=0.003, mounting=math.radians(0.2), bias=0.02),
}  # by kind; a reference has been turned to east and north by others, who calibrated it
USUAL = {"navigation": "reference", "body": "em"}  # by the frame of a record of which no kind is named


def log_errors(given: LogErrors | str | None, frame: str) -> LogErrors:
    """Of a kind's name, or as given; None: the usual ones of a record in this frame.

    Raises
    ------
    UsageError
        An unknown kind.
    """
    if isinstance(given, LogErrors):
        return given
    kind = USUAL[frame] if given is None else given
    if kind not in LOGS:
        raise UsageError(f"velocity log of kind {kind!r}; expected one of {', '.join(LOGS)}, or LogErrors(...)")
    return LOGS[kind]


def log_rows(groups: Sequence[Group], C_nb: ArrayLike, v_n: ArrayLike) -> Array:
    """(..., 2, m) what one unit of each of these groups' states adds to the log's velocity east, north.

    Parameters
    ----------
    groups : sequence of Group
        Of :meth:`LogErrors.groups`; others have zeros.
    C_nb : (..., 3, 3) array
    v_n : (..., 3) array, m/s
    """
    C, v = np.asarray(C_nb, dtype=np.float64), np.asarray(v_n, dtype=np.float64)[..., :2]
    shown = {
        DRIFT: np.broadcast_to(np.eye(2), (*v.shape[:-1], 2, 2)),
        SCALE: v[..., None],
        MOUNTING: np.stack([v[..., 1], -v[..., 0]], axis=-1)[..., None],
        BIAS: C[..., :2, :2],
    }
    none = [np.zeros((*v.shape[:-1], 2, 0))]
    return np.concatenate(
        none + [shown.get(group.name, np.zeros((*v.shape, len(group.prior)))) for group in groups], axis=-1
    )
