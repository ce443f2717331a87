"""A cone that is no motion: axes of gyros that hum out of step, while gravity does not tilt as it would.

Axes that turn to and fro out of step make a cone, and a base on a cone drifts: the integration of the gyros follows it. A hum of
their electronics, or of a fan or a supply that they pick up, looks alike to it, and makes a drift ``<theta x w>/2`` that nothing
has. Of 1 arcmin about two axes at 20 Hz that is .2 deg/h.

A base that turns by theta turns gravity with it: its accelerometers show ``g x theta`` across the vertical, and more where they
stand off the axis. An arm r makes ``w^2 r theta`` of its own, and takes all of gravity's part away at ``r = g/w^2`` alone: a
pendulum, a raft on a wave. From 5 Hz on that is a centimetre and less, so that a line of the gyros whose tilt the accelerometers
do not show is no turn. What cone is left of such lines counts as a bias of the gyros, whose size is known, and the turn itself is
one that the attitude at a row does not have.

Both densities are of the same windows, summed over the log. Noise of accelerometers passes for a tilt: what it hides is not
said.

Sources: P. Savage, "Strapdown inertial navigation integration algorithm design", J. Guid. Control Dyn. 21 (1998), part 1 (coning);
the comparison is ours.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.core.earth import EARTH_RATE, GRAVITY_EQUATOR
from truenorth.core.remembered import remembered
from truenorth.records import ImuRecord
from truenorth.records.vibration import share_left, share_of_increments
from truenorth.state.evidence import Effect, Evidence, Figure
from truenorth.state.limits import limit

Array = NDArray[np.float64]

BLOCKS = (
    20.0,
    1.0,
)  # s of a window: the longer, the less noise of accelerometers; on an indexer gravity moves in the longer one
FEWEST = 64  # rows of a window
LINE = 3  # frequencies of a tone, by the taper of a window
STAYS = 0.3  # rad, between the halves of a window
SLOWEST = 2.0 * math.pi * 5.0  # rad/s, from which on an arm of a centimetre cannot hide the tilt
LEAST = 2e-10  # rad/s, 4e-5 deg/h: no gyro has as small a bias


class Hum(NamedTuple):
    """Of gyros, where gravity does not tilt."""

    drift: Array  # (3,) rad/s about body axes, of a cone that no motion makes
    turn: float  # rad, RMS about the worst axis


@remembered
def hum_of(record: ImuRecord) -> Hum:
    """What gyros show of turns from 5 Hz on whose tilt the accelerometers do not show."""
    length = _window(record)
    blocks = len(record) // length
    w = 2.0 * math.pi * np.arange(length // 2 + 1) / (length * record.interval)
    fast = w >= SLOWEST
    x = np.asarray(w[fast] * record.interval)
    made = share_of_increments(x) if record.kind == "increments" else 1.0 + share_left(x)
    if not blocks or np.count_nonzero(fast) < LINE:
        return Hum(np.zeros(3), 0.0)
    unit = 1.0 / record.interval if record.kind == "increments" else 1.0
    window = np.hanning(length)
    scale = unit * 2.0 * math.sqrt(8.0 / 3.0) / length  # to amplitudes: a window of power 3/8
    w = w[fast]
    cone, turned, tilt, shown = np.zeros((len(w), 3)), np.zeros((len(w), 3)), np.zeros(len(w)), np.zeros(len(w))
    for start in range(len(record) - blocks * length, len(record), length):
        rate, force = (
            scale
            * np.fft.rfft(((x := sensor[start : start + length]) - x.mean(axis=0)) * window[:, None], axis=0)[fast]
            for sensor in (record.gyro, record.accel)
        )
        up = record.accel[start : start + length].mean(axis=0)
        up /= max(float(np.linalg.norm(up)), 1e-300)
        turn = rate / (1j * w[:, None])
        cone += 0.25 * np.real(np.cross(turn, rate.conj()))
        turned += np.abs(turn) ** 2
        tilt += np.sum(np.abs(GRAVITY_EQUATOR * np.cross(up, turn)) ** 2, axis=1)
        shown += np.sum(np.abs(np.cross(up, force)) ** 2, axis=1)
    line = np.ones(LINE)
    alone = np.convolve(shown, line, "same") < limit("tilt of a turn") * np.convolve(tilt, line, "same")
    largest = float(turned[alone].sum(axis=0).max())
    return Hum(made[alone] @ cone[alone] / blocks, math.sqrt(0.5 * largest / blocks))


def _window(record: ImuRecord) -> int:
    """Rows of the longest window in which gravity stays where it is in the axes of the IMU."""
    for time in BLOCKS:
        length = max(round(time / record.interval), FEWEST)
        half = length // 2
        halves = record.accel[: len(record) // length * length].reshape(-1, length, 3)
        before, after = halves[:, :half].mean(axis=1), halves[:, half:].mean(axis=1)
        across = np.linalg.norm(np.cross(before, after), axis=1)
        if len(halves) and bool(np.all(across < STAYS * np.einsum("ki,ki->k", before, after))):
            break
    return length


def hum_evidence(record: ImuRecord, lat: float) -> list[Evidence]:
    """What a hum of the gyros does to a base that stays at a latitude (rad)."""
    drift, turn = hum_of(record)
    return _evidence(
        drift, math.hypot(float(np.linalg.norm(drift)) / max(EARTH_RATE * math.cos(lat), 1e-12), turn), turn
    )


def moving_hum_evidence(record: ImuRecord) -> list[Evidence]:
    """What it does to the attitude at a row of a base that moves; its drift is a bias, which aids show."""
    drift, turn = hum_of(record)
    return _evidence(drift, turn, turn)


def _evidence(drift: Array, heading: float, turn: float) -> list[Evidence]:
    size = float(np.linalg.norm(drift))
    if max(size, turn * EARTH_RATE) < LEAST:
        return []
    figures: dict[str, Figure] = {"drift": size, "heading": heading, "level": turn}
    return [Evidence("record.hum", figures, "known", Effect(heading, turn), ("source",))]
