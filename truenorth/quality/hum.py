"""A cone that is no motion: axes of gyros that hum out of step, while gravity does not tilt as it would.

Axes that turn to and fro out of step make a cone, and a base on a cone drifts: the integration of the gyros follows it. A hum of
their electronics, or of a fan or a supply that they pick up, looks alike to it, and makes a drift ``<theta x w>/2`` that nothing
has. Of 1 arcmin about two axes at 20 Hz that is .2 deg/h.

A base that turns by theta turns gravity with it: its accelerometers show ``g x theta`` across the vertical, and more where they
stand off the axis. An arm r makes ``w^2 r theta`` of its own, and takes all of gravity's part away at ``r = g/w^2`` alone: a
pendulum, a raft on a wave. From 5 Hz on that is a centimetre and less, so that a line of the gyros whose tilt the accelerometers
do not show is no turn. What cone is left of such lines counts as a bias of the gyros, whose size is known, and the turn itself is
one that the attitude at a row does not have.

Accelerometers that are slower than the gyros show less of a turn. Of its squares they show ``|H_a/H_g|^2`` of both low passes, as
the specification gives their bandwidths and orders, and no more than all. Where it gives none, equal bandwidths are assumed. What
lacks its tilt by that is a hum for sure

- where the accelerometers' bandwidth is given and lets most of it pass;
- where less is shown than the slowest accelerometers would show, of two poles at 5 Hz.

Else it may be a bandwidth of the accelerometers instead, and is a hint.

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
from truenorth.records.specs import ImuSpec
from truenorth.records.vibration import share_left, share_of_increments
from truenorth.state.evidence import Effect, Evidence, Figure, Kind
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
POLES = 2  # of the slowest low pass of accelerometers, as far down: the least setting of micromechanical ones
LEAST = 2e-10  # rad/s, 4e-5 deg/h: no gyro has as small a bias


class Hum(NamedTuple):
    """Of gyros, where gravity does not tilt."""

    drift: Array  # (3,) rad/s about body axes, of a cone that no motion makes
    turn: float  # rad, RMS about the worst axis

    def evidence(self, kind: Kind, lat: float | None = None) -> list[Evidence]:
        """What it does to a base that stays at a latitude (rad), or that moves; nothing where it is less than any gyro's bias."""
        size = float(np.linalg.norm(self.drift))
        if max(size, self.turn * EARTH_RATE) < LEAST:
            return []
        north = 0.0 if lat is None else size / max(EARTH_RATE * math.cos(lat), 1e-12)
        effect = Effect(math.hypot(north, self.turn), self.turn)
        figures: dict[str, Figure] = {"drift": size, "heading": effect.heading, "level": self.turn}
        key, remedy = ("record.hum", "source") if kind == "known" else ("record.hum_or_slow", "bandwidths")
        return [Evidence(key, figures, kind, effect, (remedy,))]


NONE = Hum(np.zeros(3), 0.0)


@remembered
def hum_of(record: ImuRecord, imu: ImuSpec | None = None) -> tuple[Hum, Hum]:
    """What gyros show of turns from 5 Hz on whose tilt the accelerometers do not show: for sure, and what slow ones may hide.

    Equal bandwidths of gyros and accelerometers are assumed where the specification gives none.
    """
    length = _window(record)
    blocks = len(record) // length
    w = np.asarray(2.0 * math.pi / (length * record.interval) * np.arange(length // 2 + 1), dtype=np.float64)
    fast = w >= SLOWEST
    x = np.asarray(w[fast] * record.interval)
    made = share_of_increments(x) if record.kind == "increments" else 1.0 + share_left(x)
    if not blocks or np.count_nonzero(fast) < LINE:
        return NONE, NONE
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
    line, least = np.ones(LINE), limit("tilt of a turn")
    tilt, shown = np.convolve(tilt, line, "same"), np.convolve(shown, line, "same")
    share = np.ones_like(w) if imu is None else np.minimum(_passed(imu, "accel", w) / _passed(imu, "gyro", w), 1.0)
    alone = shown < least * share * tilt
    said = imu is not None and math.isfinite(imu.accel_bandwidth)
    sure = alone & ((said & (share > least)) | (shown < least * low_pass(w, SLOWEST, POLES) * tilt))

    def of(lines: NDArray[np.bool_]) -> Hum:
        largest = float(turned[lines].sum(axis=0).max())
        return Hum(made[lines] @ cone[lines] / blocks, math.sqrt(0.5 * largest / blocks))

    return of(sure), of(alone & ~sure)


def _passed(imu: ImuSpec, sensor: str, w: Array) -> Array:
    """Share of the squares that the sensors' low pass leaves at frequencies (rad/s), as it is specified."""
    bandwidth, order = (getattr(imu, f"{sensor}_{key}") for key in ("bandwidth", "filter_order"))
    return low_pass(w, 2.0 * math.pi * bandwidth, order)


def low_pass(w: Array, corner: float, poles: int) -> Array:
    """Share of the squares at frequencies (rad/s) that a low pass of one pole leaves, or Butterworth's of two."""
    return np.asarray(1.0 / (1.0 + (w / corner) ** (2 * poles)))


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


def hum_evidence(record: ImuRecord, lat: float, imu: ImuSpec | None = None) -> list[Evidence]:
    """What a hum of the gyros does to a base that stays at a latitude (rad)."""
    sure, perhaps = hum_of(record, imu)
    return sure.evidence("known", lat) + perhaps.evidence("hint", lat)


def moving_hum_evidence(record: ImuRecord) -> list[Evidence]:
    """What it does to the attitude at a row of a base that moves; its drift is a bias, which aids show."""
    sure, perhaps = hum_of(record)
    return sure.evidence("known") + perhaps.evidence("hint")
