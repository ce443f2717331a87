"""Do the gyros turn as the base does? By its slow vertical velocity, in which no wave pushes in step with a tilt.

The sea pushes a base level, in step with its tilt, and such a push passes for a delay, a scale factor or another order of the gyros
(:mod:`truenorth.quality.pushed`): the level force alone cannot tell. The vertical can. Gyros that are off by a small turn ``d`` lay
the specific force ``(a, g + a_U)`` askew, and of the vertical they make

    f_U = g + a_U + (d x a)_U - g |d|^2 / 2

Push and turn both go with the waves, so that their products have a slow part, which comes and goes with the groups of waves: .2 s
on a buoy in a sea of 1 m make up to a milli-g of it. A base that goes neither up nor down, as any that floats or stands, has no
such acceleration: its displacement is bounded, and slower than the waves there is next to nothing of ``a_U``. An IMU away from the
centre goes down as its base tilts by ``b``, by ``r_z b^2 / 2`` of the arm along the vertical: 2 mm/s of 5 m on a ship that rolls
by 5 deg, since tilts come in groups, too. It is the velocity ``d(C r)_U / dt`` of an arm ``r`` that nobody knows, and grows with
the frequency where a wrong turn's falls. And where a push hides a delay altogether the level force is zero, but the accelerometers
still feel ``|f| = g + a^2 / (2 g)``.

So each reading of the gyros has a likelihood of its own. The vertical velocity that the log gives with it is projected on Slepian's
sequences: all that is slower than the waves, and of the waves a part of 1e-7. A smooth trend is taken out, which is that of biases
and a wrong level. What is left is what an arm makes, white motion of unknown size and the random walk of the accelerometer, no
smaller than it was said to be. Of 96 logs of buoys, rafts, ships at the quay and gondolas of another simulator (seed 72, tactical,
half of them .2 s late; before an arm was allowed for) what is found of the delay is .63 to .99 of its sigma off (RMS of each sort),
sigma .003 to .35 s; of the 48 sound ones none has a likelihood ratio beyond 5.

Source: D. Slepian, Prolate spheroidal wave functions, Fourier analysis, and uncertainty V, Bell Syst. Tech. J. 57, 1978.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from truenorth.core.position import Position
from truenorth.errors.staying import local_axes, mean_velocity
from truenorth.records import ImuRecord
from truenorth.records.interpolation import gyros_behind
from truenorth.strapdown.inertial import InertialIntegrals, earth_rotation, integrate

Array = NDArray[np.float64]

EPOCH = 1.0  # s, over which velocity is averaged
MOST = 600  # epochs that are looked at, the last ones; FEWEST: no waves are seen in less
FEWEST = 60
TREND = 4  # degree of the polynomial of velocity that is taken out
WAVES = 1e-3  # of the squares of the vertical acceleration, that lies below the band of the waves
BELOW = 0.9  # of that frequency, up to which a motion is slow
LEAK = 1e-7  # of the squares of a sequence that may lie beyond it
FEWEST_SLOW = 6  # sequences behind the trend, in which something can be seen
WHITE = np.geomspace(1e-5, 0.1, 60)  # m/s, tried
WALKS = np.array([1.0, 2.0, 4.0, 8.0, 16.0, 64.0, 256.0])  # times the variance of the random walk that was said
ARM = 30.0  # m, one sigma along each axis, from the point that goes neither up nor down
LONGEST = 0.6  # s, of a delay
NODES = LONGEST * chebyshev.chebpts1(
    11
)  # at which delays are tried; in between, the velocity is a polynomial of the delay
DELAYS = np.linspace(-LONGEST, LONGEST, 241)


class Delay(NamedTuple):
    """Of the gyros, by the vertical.

    Attributes
    ----------
    size, sigma : float, s
        By which they are late, and its one-sigma; of a flat prior over `LONGEST` either way, whose own sigma is .35 s.
    ratio : float
        Twice the logarithm of the likelihood ratio of the likeliest delay against none.
    """

    size: float
    sigma: float
    ratio: float

    @property
    def rms(self) -> float:
        """What the delay may be, s."""
        return math.hypot(self.size, self.sigma)


class Heave:
    """The slow vertical velocity of a base that stays, by any reading of its gyros.

    Parameters
    ----------
    record : ImuRecord
        Known errors taken off.
    C_n0_i : (3, 3) array
        Attitude at its start.
    position : Position
    walk : float, m/s/sqrt(s)
        Random walk of the accelerometers.
    """

    def __init__(self, record: ImuRecord, C_n0_i: Array, position: Position, walk: float) -> None:
        self.log, self.start, self.position, self.walk = record, C_n0_i, position, walk

    def misfit(self, read: Callable[[ImuRecord], ImuRecord] | None = None) -> float:
        """Minus twice the logarithm of the likelihood of a reading; of the gyros as given where it is left out.

        Zero where nothing slow can be seen: no reading is likelier then.
        """
        return float(self._misfits(self._slow(self._part[0] if read is None else read(self._part[0]))[None])[0])

    @cached_property
    def delay(self) -> Delay | None:
        """By which the gyros are late; None where nothing slow can be seen."""
        if self._basis.shape[1] < FEWEST_SLOW:
            return None
        tried = np.stack([self._slow(gyros_behind(self._part[0], -float(late))) for late in NODES])
        curve = chebyshev.chebfit(NODES / LONGEST, tried, len(NODES) - 1)
        misfits = self._misfits(np.asarray(chebyshev.chebval(DELAYS / LONGEST, curve).T, dtype=np.float64))
        likely = np.exp(-0.5 * (misfits - misfits.min()))
        likely /= likely.sum()
        size = float(likely @ DELAYS)
        sigma = math.sqrt(float(likely @ (DELAYS - size) ** 2))
        return Delay(size, sigma, float(misfits[len(DELAYS) // 2] - misfits.min()))

    @cached_property
    def _part(self) -> tuple[ImuRecord, Array]:
        """The rows that are looked at, and the attitude before the first of them."""
        log = self.log
        since = float(log.time[-1]) - MOST * EPOCH
        k = int(np.searchsorted(log.time, since, side="right"))
        if k == 0:
            return log, self.start
        before = integrate(log, EPOCH, rows_at=[k - 1])
        turned = earth_rotation(float(log.time[k - 1]) - before.start, self.position.lat)
        return log.between(float(log.time[k])), turned.T @ self.start @ before.C_ib_at[0]

    @cached_property
    def _integrals(self) -> InertialIntegrals:
        """By the gyros as given."""
        return integrate(self._part[0], EPOCH)

    @cached_property
    def _given(self) -> Array:
        return self._velocity(self._integrals)

    @cached_property
    def _of_arm(self) -> Array:
        """(n, 3) slow parts of the vertical velocity that an arm of one sigma along each axis makes."""
        log = self._integrals
        turned = earth_rotation(log.time, self.position.lat)
        up = (np.swapaxes(turned, 1, 2) @ self._part[1] @ log.C_ib)[:, 2]
        return np.asarray(ARM * self._basis.T @ (np.diff(up, axis=0) / log.intervals[:, None]))

    @cached_property
    def _basis(self) -> Array:
        """(K, n) orthonormal slow courses without a trend, of which the random walk makes independent parts."""
        K = len(self._given)
        if K < FEWEST:
            return np.zeros((K, 0))
        slow = slepian(K, round(BELOW * _begin_of_waves(np.diff(self._given)), 3))
        trend = slow.T @ np.polynomial.legendre.legvander(np.linspace(-1.0, 1.0, K), TREND)
        if slow.shape[1] < FEWEST_SLOW + TREND + 1:
            return np.zeros((K, 0))
        basis = slow @ np.linalg.qr(trend, mode="complete")[0][:, TREND + 1 :]
        return np.asarray(basis @ np.linalg.eigh(_walked(basis))[1])

    def _velocity(self, log: InertialIntegrals) -> Array:
        v = mean_velocity(log, self._part[1], self.position.lat, self.position.alt)
        # Along the vertical of its time: the one at the start is a degree off four minutes later, and a level motion shows in it.
        return np.einsum("ki,ki->k", local_axes(log.time, self.position.lat)[:, 2], v)

    def _slow(self, record: ImuRecord) -> Array:
        """(n,) the slow part of the vertical velocity, m/s."""
        return np.asarray(self._velocity(integrate(record, EPOCH)) @ self._basis)

    def _misfits(self, slow: Array) -> Array:
        """(m,) of slow parts (m, n), with the likeliest white motion and walk of each, and any arm."""
        walked = EPOCH * self.walk**2 * np.diag(_walked(self._basis))
        weight = 1.0 / (WHITE[:, None, None] ** 2 + WALKS[:, None] * walked).reshape(-1, len(walked))
        misfit = weight @ (slow**2).T - np.sum(np.log(weight), axis=1)[:, None]
        # The covariance is V + A A' of the arm's columns A: by Woodbury, with L L' = I + A' V^-1 A of three rows.
        arm = self._of_arm
        L = np.linalg.cholesky(np.eye(3) + np.einsum("vn,ni,nj->vij", weight, arm, arm, optimize=True))
        along = np.linalg.inv(L) @ ((weight[:, None] * arm.T) @ slow.T)
        misfit += 2.0 * np.sum(np.log(np.diagonal(L, axis1=1, axis2=2)), axis=1)[:, None]
        misfit -= np.einsum("vim,vim->vm", along, along)
        return np.asarray(misfit.min(axis=0))


def _walked(basis: Array) -> Array:
    """(n, n) covariance that a random walk of one unit an epoch has along courses (K, n)."""
    behind = np.cumsum(basis[::-1], axis=0)
    return np.asarray(behind.T @ behind)


def _begin_of_waves(change: Array) -> float:
    """Frequency below which `WAVES` of the squares of changes (K,) from epoch to epoch lies, cycles an epoch."""
    K = len(change)
    trend = np.polynomial.legendre.legvander(np.linspace(-1.0, 1.0, K), TREND - 1)
    change = change - trend @ np.linalg.lstsq(trend, change, rcond=None)[0]
    phase = 2.0 * np.pi * (np.arange(K) + 0.5) / K
    taper = (
        0.35875 - 0.48829 * np.cos(phase) + 0.14128 * np.cos(2.0 * phase) - 0.01168 * np.cos(3.0 * phase)
    )  # Harris 1978
    below = np.cumsum(np.abs(np.fft.rfft(change * taper)) ** 2)
    return float(np.interp(WAVES * below[-1], below, np.fft.rfftfreq(K)))


@lru_cache(maxsize=4)
def slepian(count: int, frequency: float) -> Array:
    """(count, n) orthonormal sequences that lie below a frequency, cycles a sample, but for `LEAK` of their squares.

    Each is even or odd about its middle: two matrices of half the size. A middle sample stands once, the others twice.
    """
    middle, k = count % 2, np.arange((count + 1) // 2)
    times = np.full(len(k), math.sqrt(0.5))
    times[len(k) - middle :] = 0.5
    near, across = (
        2.0 * frequency * np.sinc(2.0 * frequency * apart) for apart in (k - k[:, None], count - 1 - k - k[:, None])
    )
    found = []
    for sign in (1.0, -1.0):
        inside, halves = np.linalg.eigh(2.0 * times * (near + sign * across) * times[:, None])
        half = np.sqrt(0.5) * halves[:, inside > 1.0 - LEAK]
        half[len(k) - middle :] *= math.sqrt(2.0)
        found.append(np.concatenate([half, sign * half[::-1][middle:]]))
    return np.concatenate(found, axis=1)
