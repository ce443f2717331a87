"""By what errors of an indexer's angles turn its base, and by what no such error does.

An axis' disc that is out of centre turns the base about it, in step with the angle. A sway goes with the time. Where an axis turns
at one rate from the first row to the last, about a direction that stays, the two are one: the gyros and the accelerometers are
behind the axis and see the IMU turn, which a false angle does not change, and the base is seen by way of the angle alone. (A sway
would push an IMU that is away from its centre; that nothing pushes shows no more than that it is not.) What tells the two apart
is that the axis turns back, rests, or turns at another rate.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

HARMONICS = (1, 2)
DETUNED = (-3, -2, -1, 1, 2, 3)  # turns more in the whole log, of patterns nearly as fast
BAND = (-1.0, -0.5, 0.0, 0.5, 1.0)  # the same, of a sway that is one line to the log
FINER = 8  # times the steps of a spectrum by its own length, in which its highest line is looked for
TURNS = 0.1  # rad by which an axis turns that shows a disc
STAYS = 0.9  # length of the mean direction of an axis: more, and it stays within some tens of degrees
LIKE = 0.05  # of the energy of a pattern: where no more than that is its own, a sway of one line may make it


@dataclass(frozen=True)
class Turns:
    """How the base turns about its mean attitude, at even times.

    Attributes
    ----------
    time : (K,) array, s
    turn : (K, 3) array, rad
        Rotation vector from the mean attitude, its axes.
    there : (K,) bool array
        Whether the encoder has a row there.
    angles : (K, A) array, rad
    C_bs : (K, 3, 3) array
        Attitude of the IMU in the base.
    directions : tuple of A (K, 3) arrays
        Of the axes in the base, the outermost first.
    gyro : (K, 3, m) array
        By what errors of the gyros turn the base.
    gyro_sigma : (m,) array
        Their one-sigmas.
    up : (3,) array
        The vertical in the base, in the mean.
    rates : (K, A) array, rad/s
        Of the angles.
    """

    time: Array
    turn: Array
    there: Mask
    angles: Array
    C_bs: Array
    directions: tuple[Array, ...]
    gyro: Array
    gyro_sigma: Array
    up: Array
    rates: Array

    @property
    def step(self) -> float:
        """Between the times, s."""
        return float(self.time[1] - self.time[0])

    def thinned(self, cell: float) -> Turns:
        """Those of times about `cell` s apart."""
        every = max(1, round(cell / self.step))
        rows = slice((len(self.time) - 1) % every, None, every)  # the last one is there
        return replace(
            self,
            time=self.time[rows],
            turn=self.turn[rows],
            there=self.there[rows],
            angles=self.angles[rows],
            C_bs=self.C_bs[rows],
            directions=tuple(u[rows] for u in self.directions),
            gyro=self.gyro[rows],
            rates=self.rates[rows],
        )


def bell(turns: Turns) -> Array:
    """(K,) weights that fade at both ends, zero where there is no row."""
    K = len(turns.time)
    return np.where(turns.there, np.sin(math.pi * (np.arange(K) + 0.5) / K) ** 4, 0.0)


def waves(direction: Array, phase: Array) -> Array:
    """(K, 3, 2) cosine and sine of a phase (K,) about a direction (K, 3)."""
    return np.stack([direction * np.cos(phase)[:, None], direction * np.sin(phase)[:, None]], axis=2)


def patterns_of(turns: Turns) -> Iterator[tuple[str, Array]]:
    """By what errors of the angles turn the base, by name: ``zero``, and ``1.2`` for the first axis twice a turn.

    The disc of an axis that rests is a zero. What its angle changes by is the encoder's noise, which turns the base as computed: a
    disc of half a radian would explain all of it.
    """
    if len(turns.directions) > 1:
        yield "zero", turns.directions[-1][:, :, None]
    for axis, u in enumerate(turns.directions):
        rests = np.ptp(turns.angles[turns.there, axis]) < TURNS
        for n in () if rests else HARMONICS:
            yield f"{axis + 1}.{n}", waves(u, n * turns.angles[:, axis])


def unlike(turns: Turns, name: str, detuned: Sequence[float] = DETUNED) -> tuple[list[Array], list[Array]]:
    """Patterns by which no error of the angles turns the base, by families: as fast as that of a name, and nearly as fast."""
    outer, share = turns.directions[0], 2.0 * math.pi * np.linspace(0.0, 1.0, len(turns.time))
    a = turns.angles[:, 0]
    across = np.cross(outer, np.eye(3)[int(np.argmin(np.abs(outer[0])))])
    across /= np.linalg.norm(across, axis=1)[:, None]
    if name.startswith("1"):
        n = int(name[-1])
        same = [waves(v, n * a) for v in (across, np.cross(outer, across))]
        return same, [waves(outer, n * a + k * share) for k in detuned]
    u, quarter = turns.directions[1], np.cross(outer, turns.directions[1])

    def turned(by: Array) -> Array:
        c, s = np.cos(by)[:, None], np.sin(by)[:, None]
        pair = np.stack([c * u + s * quarter, c * quarter - s * u], axis=2)
        if name == "zero":
            return pair
        b = int(name[-1]) * turns.angles[:, 1]
        return np.concatenate([pair * np.cos(b)[:, None, None], pair * np.sin(b)[:, None, None]], axis=2)

    still = np.zeros(len(a))
    same = [turned(still)[:, :, 1::2], turned(-2.0 * a)]
    return same, [turned(way + k * share) for way in (still, -2.0 * a) for k in detuned]


def lines_in_time(turns: Turns, name: str) -> Array | None:
    """(K, 3, 10) sways of about one line about an axis that stays in the base, as fast as the pattern of a name is in the mean.

    None of an axis that another one turns: no sway goes with it.
    """
    axis, K = int(name[0]) - 1, len(turns.time)
    u = turns.directions[axis]
    if np.linalg.norm(u.mean(axis=0)) < STAYS:
        return None
    spectrum = np.abs(np.fft.fft(np.exp(1j * int(name[-1]) * turns.angles[:, axis]) * bell(turns), FINER * K))
    turned = 2.0 * math.pi * float(np.argmax(spectrum)) / FINER * np.arange(K) / K
    share = 2.0 * math.pi * np.linspace(0.0, 1.0, K)
    return np.concatenate([waves(u, turned + k * share) for k in BAND], axis=2)


def own_share(pattern: Array, others: Array) -> float:
    """The largest part of the energy of patterns (K, 3, n), whatever their sum, that others (K, 3, m) do not make."""
    P, L = pattern.reshape(-1, pattern.shape[2]), others.reshape(-1, others.shape[2])
    left = P - L @ np.linalg.lstsq(L, P, rcond=1e-9)[0]
    return float(np.max(np.linalg.eigvals(np.linalg.pinv(P.T @ P) @ (left.T @ left)).real))
