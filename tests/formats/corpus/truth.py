"""One truth, three bases, and sensors of three grades: what every log of the corpus holds, in SI and right-forward-up."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

LAT = np.radians(48.0)
EARTH = 7.292115e-5 * np.array([0.0, np.cos(LAT), np.sin(LAT)])  # east, north, up
GRAVITY = 9.8088
DEG = np.pi / 180.0
# Gyro bias, angle random walk, accelerometer bias, velocity random walk: SI.
GRADES = {
    "navigation": (0.005 * DEG / 3600, 0.002 * DEG / 60, 3e-4, 1e-4),
    "tactical": (0.8 * DEG / 3600, 0.07 * DEG / 60, 5e-3, 8e-4),
    "consumer": (0.4 * DEG, 0.3 * DEG / 60, 8e-2, 3e-3),
}


@dataclass(frozen=True)
class Truth:
    """Rates and specific forces at `time`, or what they add up to over each interval."""

    time: Array
    gyro: Array
    accel: Array

    @property
    def interval(self) -> float:
        return float(self.time[1] - self.time[0])

    @property
    def increments(self) -> Truth:
        return replace(self, gyro=self.gyro * self.interval, accel=self.accel * self.interval)


@cache
def truth(base: str = "still", grade: str = "tactical", rate: float = 100.0, seconds: float = 20.0) -> Truth:
    """A base that is ``still`` (heading 30 deg, level to half a degree), ``swaying`` by degrees, or ``driven`` in bends."""
    time = np.arange(1, round(rate * seconds) + 1) / rate
    heading, pitch, roll = np.full_like(time, 30.0 * DEG), np.full_like(time, 0.4 * DEG), np.full_like(time, -0.3 * DEG)
    speed = np.zeros_like(time)
    if base == "swaying":
        heading = heading + 3 * DEG * np.sin(2 * np.pi * time / 17)
        pitch = pitch + 4 * DEG * np.sin(2 * np.pi * time / 7 + 0.3)
        roll = roll + 6 * DEG * np.sin(2 * np.pi * time / 9 + 1.1)
    elif base == "driven":
        heading = heading + 40 * DEG * np.sin(2 * np.pi * time / 30)
        roll = roll + 2 * DEG * np.sin(2 * np.pi * time / 11)
        pitch = pitch + 3 * DEG * np.sin(2 * np.pi * time / 13)
        speed = 6.0 + 2.0 * np.sin(2 * np.pi * time / 20)
    C_nb = _attitude(heading, pitch, roll)
    relative = np.einsum("kji,kjl->kil", C_nb, np.gradient(C_nb, time, axis=0))
    turning = np.stack([relative[:, 2, 1], relative[:, 0, 2], relative[:, 1, 0]], axis=1)
    velocity = speed[:, None] * np.stack([np.sin(heading), np.cos(heading), np.zeros_like(time)], axis=1)
    force_n = np.gradient(velocity, time, axis=0) + np.array([0.0, 0.0, GRAVITY])
    gyro = turning + np.einsum("kji,j->ki", C_nb, EARTH)
    accel = np.einsum("kji,kj->ki", C_nb, force_n)
    rng = np.random.default_rng([len(base), len(grade), round(rate)])
    bias, walk, offset, noise = GRADES[grade]
    gyro += bias * rng.normal(size=3) + walk * np.sqrt(rate) * rng.normal(size=gyro.shape)
    accel += offset * rng.normal(size=3) + noise * np.sqrt(rate) * rng.normal(size=accel.shape)
    return Truth(time, gyro, accel)


def _attitude(heading: Array, pitch: Array, roll: Array) -> Array:
    """``C_nb = Rz(-heading) Rx(pitch) Ry(roll)``, (N, 3, 3)."""
    s, c, zero, one = np.sin, np.cos, np.zeros_like(heading), np.ones_like(heading)
    Rz = [[c(heading), s(heading), zero], [-s(heading), c(heading), zero], [zero, zero, one]]
    Rx = [[one, zero, zero], [zero, c(pitch), -s(pitch)], [zero, s(pitch), c(pitch)]]
    Ry = [[c(roll), zero, s(roll)], [zero, one, zero], [-s(roll), zero, c(roll)]]
    Rz, Rx, Ry = (np.moveaxis(np.array(R), 2, 0) for R in (Rz, Rx, Ry))
    return Rz @ Rx @ Ry
