"""A group of error states beyond the fifteen of the INS: its prior, how it runs by itself, and what it does to the INS."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.core.compiled import compiled_callback
from truenorth.core.errors import UsageError
from truenorth.core.plugins import plugin
from truenorth.core.pointers import Pointer
from truenorth.records.specs import ImuSpec

Array = NDArray[np.float64]

COLUMNS = "void(float64[::1], float64[::1], int64, float64[::1], float64[:, ::1])"
FIGURES = 8
columns_at = Pointer(COLUMNS)


def columns(function: Callable[..., None]) -> Any:
    """Compile what a group does to the INS: ``columns(now, figures, first, assumed, F)``.

    It fills in ``F[0:9, first:]``: how fast phi, dv and dp (along w, see :mod:`truenorth.state.now`) grow by one unit of
    each of its states. The loop takes what is assumed of the group off the INS by the same columns.
    """
    return compiled_callback(COLUMNS)(function)


@dataclass(frozen=True)
class Group:
    """States of one cause: what is true of it less what is assumed.

    Constants, random walks, first-order Gauss-Markov processes in time or along the way, or processes of second order:
    ``x'' = -2 zeta omega x' - omega^2 x + white noise``, whose rates are states too, behind the values. Or what grows at a steady
    rate: ``x'' = 0``.

    Attributes
    ----------
    name : str
        Such as "odometer scale".
    sigma : (n,) array
        One-sigma at the start, and of the stationary process where it has a correlation time.
    correlation_time : float or (n,) array, s
        Infinite: a constant, or a random walk.
    walk : float
        Density of a random walk, sigma's unit/sqrt(s).
    correlation_distance : float, m
        Of a process along the way; infinite: it does not change with place.
    frequency : float, rad/s
        Natural frequency of a process of second order; 0: none.
    damping : float
        Its damping ratio: 1 critical, 0 an oscillator.
    drift : float
        One sigma of a steady rate, sigma's unit/s, whose states stand behind the values; 0: there is none.
    considered : bool
        It counts in the covariance and is not corrected (Schmidt).
    rotation : bool
        Three states that are a small rotation: what is found is composed, not added.
    acts : compiled callback or None
        What it does to the INS, see :func:`columns`.
    figures : tuple of float
        At most eight, for `acts`.
    unit : str
        Of the states, SI.
    """

    name: str
    sigma: Array
    correlation_time: float | Array = math.inf
    walk: float = 0.0
    correlation_distance: float = math.inf
    frequency: float = 0.0
    damping: float = 1.0
    drift: float = 0.0
    considered: bool = False
    rotation: bool = False
    acts: Any = None
    figures: tuple[float, ...] = ()
    unit: str = "1"

    def __post_init__(self) -> None:
        object.__setattr__(self, "sigma", np.atleast_1d(np.asarray(self.sigma, dtype=np.float64)))
        if not (np.all(self.sigma >= 0.0) and np.all(self.lasts > 0.0) and self.walk >= 0.0):
            raise UsageError(f"{self.name}: a sigma, a correlation time or a walk is negative or not a number")
        if not (self.correlation_distance > 0.0 and 0.0 <= self.frequency < math.inf and 0.0 <= self.damping <= 1.0):
            raise UsageError(
                f"{self.name}: correlation distance {self.correlation_distance:g} m, frequency {self.frequency:g} rad/s, damping "
                f"{self.damping:g}; expected a positive distance, a frequency of zero or more, a damping from 0 to 1"
            )
        lasting = bool(np.isinf(self.lasts).all()) and self.frequency == self.walk == 0.0 and not self.rotation
        if not 0.0 <= self.drift < math.inf or (self.drift > 0.0 and not lasting):
            raise UsageError(
                f"{self.name}: drift {self.drift:g}; expected zero or more, and no walk, correlation time or frequency"
            )
        if self.rotation and len(self.sigma) != 3:
            raise UsageError(f"{self.name}: {len(self.sigma)} states; expected three of a rotation")
        if len(self.figures) > FIGURES:
            raise UsageError(f"{self.name}: {len(self.figures)} figures; expected {FIGURES} at most")

    @property
    def prior(self) -> Array:
        """(m,) one-sigma of all its states at the start, rates included."""
        if self.drift > 0.0:
            return np.concatenate([self.sigma, np.full_like(self.sigma, self.drift)])
        return self.sigma if self.frequency == 0.0 else np.concatenate([self.sigma, self.frequency * self.sigma])

    @property
    def lasts(self) -> Array:
        """(n,) correlation times of its states, s."""
        return np.broadcast_to(np.asarray(self.correlation_time, dtype=np.float64), self.sigma.shape)


def groups_of(errors: Sequence[Group | str], spec: ImuSpec) -> tuple[Group, ...]:
    """Groups as they are, or of plug-ins by name: entry points ``truenorth.errors`` of functions ``make(spec) -> Group``.

    Raises
    ------
    UsageError
        No plug-in of such a name, or two groups of one name.
    """
    found = tuple(each if isinstance(each, Group) else plugin("truenorth.errors", each)(spec) for each in errors)
    names = [group.name for group in found]
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise UsageError(f"two groups of error states are called {twice[0]!r}; expected different names")
    return found
