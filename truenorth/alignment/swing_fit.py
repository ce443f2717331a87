"""How a ship swings that her lines hold: to and fro along east and north, slower than the sea, and about another point.

Lines and fenders are stiff springs, of periods from half a minute to some minutes, far from those of the sea; they hold her within
some metres. So a swing is one sinusoid along each level axis, whose frequency is looked for by the exact likelihood: first axis by
axis, with the sea fitted besides it, then of both axes with all that the filter of the whole log estimates left open
(attitude, biases, arms), as of any other signature.

The sea carries a ship to and fro in step with her roll and yaw, so that the point about which it seems to turn her is off by
metres to tens of metres. On her lines she turns about another one: the slow part of the heading has an arm of its own
(:func:`truenorth.errors.arm.slow_arm_rows`).

Sources: O. M. Faltinsen, *Sea Loads on Ships and Offshore Structures*, 1990, ch. 5 (slow drift of moored ships: little damped
resonances of one to two minutes); for the likelihood :mod:`truenorth.filters.scalar`. The search is ours.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.matched import whitened
from truenorth.alignment.motion_fit import search
from truenorth.alignment.motion_likelihood import Series, Walks
from truenorth.errors.arm import SLOWEST_SEA
from truenorth.errors.sway import MOST_OSCILLATORS, AxisMotion, Oscillator, with_motion
from truenorth.filters import LinearSystem, kalman
from truenorth.filters.gains import Gains, filter_gains, through

Array = NDArray[np.float64]

LONGEST = 200.0  # s: longer is no spring to a quay
FEWEST = 2.0  # periods in a log: of one that goes round less often nobody sees that it comes back
CELL = 0.8  # rad: phase over the log from one frequency that is tried to the next
ROUNDS = 2  # sea and lines, each with the other known
MOST_SLOW = 2  # lines besides the swing's, that are no sea
AROUND = 10  # cells on either side of a frequency, of a third each, then finer by as much
FINER, LEVELS = 5.0, 3
DAMPING = 1e-10  # of a line
ARM = 30.0  # m, one sigma: from the point about which the sea rolls a ship to that about which she turns on her lines
LEAST_TURN = 1e-4  # m/s RMS: less of a slow turn is lost in the noise of any sensor
MOST = 1.5  # m: amplitude along an axis; of 3 m to and fro large ships are hauled in


def is_swing(item: Oscillator) -> bool:
    """Whether an oscillator is slower than any sea."""
    return item.frequency < 2.0 * math.pi / SLOWEST_SEA


def long_enough(duration: float) -> bool:
    """Whether a log of that length, s, shows that the shortest swing comes back."""
    return duration > FEWEST * SLOWEST_SEA


def fit_swing(
    system: LinearSystem, interval: float, walks: Walks, plain: Sequence[AxisMotion], turns: Array
) -> tuple[AxisMotion, ...]:
    """The motion of a base that swings on lines, of a log that is long enough for one (:func:`long_enough`).

    Parameters
    ----------
    system : LinearSystem
        Of the log about a good attitude, without the motion.
    interval : float, s
    walks : Walks
    plain : three AxisMotion
        As fitted without a swing.
    turns : (K, 3, p) array
        What the slow part of the heading may make of the measurements.
    """
    duration = interval * len(system.z)
    low, high = 2.0 * math.pi * max(FEWEST / duration, 1.0 / LONGEST), 2.0 * math.pi / SLOWEST_SEA
    grid = np.arange(low, high, CELL / duration)  # of one frequency where the log is just long enough
    seas, levels = [_without_swings(axis) for axis in plain[:2]], []
    for axis in (0, 1):
        U, size, _ = np.linalg.svd(turns[:, axis], full_matrices=False)
        slow = U[:, size * ARM > LEAST_TURN * math.sqrt(len(U))]
        levels.append(_Level(system.z[:, axis], interval, walks, slow))
    for _ in range(ROUNDS):
        lines = _Lines(system, interval, (*seas, plain[2])).likeliest(grid)
        seas = [level.sea(sea, line) for level, sea, line in zip(levels, seas, lines, strict=True)]
    found = _Lines(system, interval, (*seas, plain[2]))
    items = found.items(found.likeliest(grid))
    moving = [AxisMotion(sea.white, (*sea.oscillators, item)) for sea, item in zip(seas, items, strict=True)]
    return (*moving, plain[2])


def _without_swings(motion: AxisMotion) -> AxisMotion:
    return AxisMotion(motion.white, tuple(item for item in motion.oscillators if not is_swing(item)))


class _Level:
    """The velocity along a level axis, and what the slow part of the heading makes of it (K, p)."""

    def __init__(self, z: Array, interval: float, walks: Walks, slow: Array) -> None:
        self.given, self.slow = (z, interval, walks), slow
        self.lags = Series(*self.given).lags

    def sea(self, guess: AxisMotion, line: float) -> AxisMotion:
        """The sea besides a line, and besides what else is as slow: sensors that an indexer turns make lines of their own."""
        slow, most = [line], MOST_OSCILLATORS[0]
        while True:
            waves = [wave for w in slow for wave in (np.cos(w * self.lags), np.sin(w * self.lags))]
            calm = Series(*self.given, np.column_stack([self.slow, *waves]))
            sea = min([search(calm, most), search(calm, most, guess)], key=calm.score)
            more = [item.frequency for item in sea.oscillators if is_swing(item)]
            if not more or len(slow) > MOST_SLOW:
                return _without_swings(sea)
            slow.append(more[0])


class _Lines:
    """Lines along both level axes besides the sea, with all that the filter of the whole log estimates left open.

    Of an indexer the errors of its sensors are as slow as a swing: what is known of them keeps the two apart.
    """

    def __init__(self, system: LinearSystem, interval: float, seas: Sequence[AxisMotion]) -> None:
        full = with_motion(system, interval, seas)
        estimates = kalman(full, history="full")
        self.gains = filter_gains(full, estimates)
        self.L: Array = np.asarray(np.linalg.cholesky(estimates.innovation_covariance), dtype=np.float64)
        self.nu = whitened(self.L, estimates.innovation[..., None]).ravel()
        self.t: Array = interval * (np.arange(len(system.z), dtype=np.float64) + 0.5)

    def likeliest(self, grid: Array) -> Array:
        """(2,) frequencies that make the log likeliest, rad/s: of a grid, one after the other, and finer and finer about them."""
        every = [self._made(axis, grid) for axis in (0, 1)]
        best, other = [0, 0], np.zeros((len(self.nu), 0))
        for axis in (0, 1, 0, 1):
            best[axis] = int(np.argmax(_gained(every[axis], other, self.nu)))
            other = every[axis][:, best[axis]]
        lines, spacing = grid[best], CELL / float(self.t[-1]) / 3.0
        for _ in range(LEVELS):
            for axis in (0, 1, 0, 1):
                cells = np.clip(lines[axis] + spacing * np.arange(-AROUND, AROUND + 1), grid[0], grid[-1])
                other = self._made(1 - axis, lines[1 - axis : 2 - axis])[:, 0]
                lines[axis] = cells[np.argmax(_gained(self._made(axis, cells), other, self.nu))]
            spacing /= FINER
        return np.asarray(lines)

    def items(self, lines: Array) -> list[Oscillator]:
        """Lines of these frequencies (2,), as large as they are."""
        both = np.concatenate([self._made(axis, lines[axis : axis + 1])[:, 0] for axis in (0, 1)], axis=1)
        size = np.linalg.lstsq(both, self.nu, rcond=None)[0].reshape(2, 2)
        sigma = np.sqrt(0.5 * np.sum(size**2, axis=1))
        return [Oscillator(1, float(s), float(w), DAMPING) for s, w in zip(sigma, lines, strict=True)]

    def _made(self, axis: int, frequencies: Array) -> Array:
        return _whitened(self.gains, self.L, self.t, axis, frequencies)


def _whitened(gains: Gains, L: Array, t: Array, axis: int, frequencies: Array) -> Array:
    """(3 K, m, 2) white innovations that cosine and sine of frequencies (m,) along an axis make."""
    signature = np.zeros((len(t), 3, 2 * len(frequencies)))
    phase = np.outer(t, frequencies)
    signature[:, axis, 0::2], signature[:, axis, 1::2] = np.cos(phase), np.sin(phase)
    return whitened(L, through(gains, signature)[0]).reshape(-1, len(frequencies), 2)


def _gained(columns: Array, other: Array, nu: Array) -> Array:
    """(m,) squares of `nu` (N,) that pairs of columns (N, m, 2) explain, besides those (N, 0 or 2) of another line."""
    Q = np.linalg.qr(other)[0]
    nu = nu - Q @ (Q.T @ nu)
    columns = columns - np.einsum("ia,aml->iml", Q, np.einsum("ia,iml->aml", Q, columns))
    normal, match = np.einsum("imk,iml->mkl", columns, columns), np.einsum("imk,i->mk", columns, nu)
    return np.asarray(np.sum(match * np.linalg.solve(normal, match[..., None])[..., 0], axis=1))
