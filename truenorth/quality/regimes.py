"""How the base moved: still, disturbed, swaying, rotating or moving, second by second, from the IMU alone.

The raw variance of a sample says nothing: a cheap gyro at rest is noisier than a good one on a ship. What
separates motion from noise is where the power lies. White rate noise gives an angle that wanders as
``N sqrt(t)``; motion moves the angle by more than that over seconds, though single samples may not show it.
Acceleration is separated from tilt by carrying the specific force with the gyros into axes that do not turn.

`auto` alignment calls it on every record.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from truenorth.core.attitude import length_of
from truenorth.core.remembered import remembered
from truenorth.quality.signals import (
    LEVEL_WINDOW,
    STILL_ANGLE,
    WINDOW,
    acceleration,
    angle_wander,
    bias_by_gravity,
    box_mean,
    even_rates,
    offset,
    rate_bias,
    second_means,
    unturned,
    white_noise,
)
from truenorth.records import ImuRecord

Array = NDArray[np.float64]
Kind = Literal["still", "disturbed", "swaying", "rotating", "moving", "unknown"]
KINDS: tuple[Kind, ...] = ("still", "disturbed", "swaying", "rotating", "moving")
STILL, DISTURBED, SWAYING, ROTATING, MOVING = range(5)

TURN_WINDOW = 21  # s, odd; a sway cancels in it, a turn does not
NOISE_FACTOR = 4.0  # wander beyond this many times the noise's: below 1e-6 a window by chance
QUIETEST = 3.0  # times the wander of the quietest window: white noise has more in one of a million windows
ONE_VALUE = 1e-9  # rad: wander of a window of equal rows, up to rounding
SWAY_ANGLE = np.radians(1.0)  # amplitude from which an oscillation is called swaying
TURN_RATE = np.radians(0.5)  # rad/s
TURN_ANGLE = np.radians(3.0)  # net angle from which a turn is called rotating
TURN_SHARE = 0.4  # of the RMS rate that is net rotation; a sway of 15 s period has at most 0.33
TURN_WAY = 0.7  # of the way that the attitude goes, the same: of a turn of a second at rest all of it, of that sway at most .37
MOVING_ACCELERATION = 0.08  # m/s^2 over one second; tilt error, bias and people in the car stay below 0.05
LATER = 2  # s, at the most, by which what surely gains speed is seen later: of 72 starts
LEAST_GAIN = 0.04  # m/s^2 over WINDOW: waves that come and go within it leave less, a start of .4 m/s more
NOISY_BIAS = 200.0  # sqrt(Hz): the same of a noisier one, in its noise ...
LARGEST_BIAS = 1.0  # m/s^2: ... at the most
SWAY_ACCELERATION = 0.2  # m/s^2 over WINDOW: a rocking base with less gains no speed
SEEN_LATE = 3.0  # s: motion is found in whole seconds, and its onset is gentle
MOVING_PAUSE = 60  # s between two accelerations, without rest, that counts as moving too (cruising)
TURNED_BIAS = 0.5  # m/s^2 for a radian: level error and bias of a cheap sensor that a turn shows as acceleration
SHORTEST_SWAY = 30  # s; accelerations during a shorter rocking are not put down to it
SHORTEST_RECORD = 3.0  # s
OVERALL_SHARE = 0.05  # of the seconds, from which a kind of motion names the record


@dataclass(frozen=True)
class Regime:
    """A stretch of one kind of motion.

    Parameters
    ----------
    start, stop : float, s
        On the record's own clock.
    kind : str
        ``still``: no motion beyond the sensor's noise and 3 arcsec; ``disturbed``: bounded motion below a
        degree (people, wind, an engine); ``swaying``: a bounded oscillation of a degree and more;
        ``rotating``: a net turn; ``moving``: acceleration; ``unknown``: shorter than 3 s.
    """

    start: float
    stop: float
    kind: Kind

    @property
    def duration(self) -> float:
        """Length, s."""
        return self.stop - self.start


@dataclass(frozen=True)
class MotionSummary:
    """Motion of the base, second by second.

    Parameters
    ----------
    time : (m,) array, s
        End of each second, on the record's clock; ``m`` is 0 for a record shorter than 3 s.
    kind : (m,) array of int
        Index into `KINDS`.
    rate : (m, 3) array, rad/s
        Mean angular rate of each second, body axes, constant bias taken out where it could be found.
    specific_force : (m, 3) array, m/s^2
        Mean specific force of each second, body axes.
    acceleration : (m,) array, m/s^2
        Acceleration of each second: specific force that neither tilt nor gravity explains.
    wander : (m,) array, rad
        RMS of the detrended angle over 10 s around each second, the largest of three axes.
    rate_bias : (3,) array, rad/s
        What was taken out (sensor bias and earth rate).
    angle_noise : (3,) array, rad/sqrt(s)
        Angle random walk of the quiet quarter of the record, or of its quietest 10 s where that is less; vibration above 2 Hz
        counts as noise.
    regimes : tuple of Regime
        Stretches in order, without holes.
    """

    time: Array
    kind: NDArray[np.int8]
    rate: Array
    specific_force: Array
    acceleration: Array
    wander: Array
    rate_bias: Array
    angle_noise: Array
    regimes: tuple[Regime, ...]

    def fraction(self, kind: str) -> float:
        """Share of the record's seconds that are of this kind, 0..1."""
        if kind not in KINDS or self.kind.size == 0:
            return float(kind == "unknown" and self.kind.size == 0)
        return float(self._shares[KINDS.index(kind)])

    @property
    def moves_at(self) -> float | None:
        """When the base first goes somewhere, s on the record's clock; None if it stays."""
        return next((float(stretch.start) for stretch in self.regimes if stretch.kind == "moving"), None)

    @cached_property
    def overall(self) -> Kind:
        """The strongest kind of motion, in the order of `KINDS`, that over 5 % of the seconds show."""
        if self.kind.size == 0:
            return "unknown"
        return KINDS[int((self._shares > OVERALL_SHARE).nonzero()[0][-1])]

    @cached_property
    def _shares(self) -> Array:
        """Of each kind."""
        return np.bincount(self.kind, minlength=len(KINDS)) / self.kind.size

    @property
    def still_fraction(self) -> float:
        """Share of seconds without any motion above the noise, 0..1."""
        return self.fraction("still")

    @property
    def rate_rms(self) -> float:
        """RMS of the norm of the one-second mean rates, bias taken out, rad/s."""
        return float(np.sqrt(np.mean(np.sum(self.rate**2, axis=1)))) if self.time.size else np.nan

    @property
    def angular_amplitude(self) -> float:
        """Amplitude of the sine with the same RMS as the angle's wander over the record, rad."""
        return float(np.sqrt(2.0 * np.mean(self.wander**2))) if self.time.size else np.nan

    @property
    def force_rms(self) -> float:
        """RMS deviation of the one-second mean specific force from its mean, m/s^2 (tilt included)."""
        if not self.time.size:
            return np.nan
        deviation = self.specific_force - self.specific_force.mean(axis=0)
        return float(np.sqrt(np.mean(np.sum(deviation**2, axis=1))))

    @property
    def acceleration_rms(self) -> float:
        """RMS of `acceleration`, m/s^2 (tilt taken out)."""
        return float(np.sqrt(np.mean(self.acceleration**2))) if self.time.size else np.nan

    def longest(self, *kinds: Kind) -> Regime | None:
        """Find the longest stretch in which only these kinds occur, the first of equals; None where there is none."""
        return max(self.stretches(*kinds), key=lambda run: run.duration, default=None)

    def stretches(self, *kinds: Kind) -> list[Regime]:
        """All stretches in which only these kinds occur, in order."""
        runs: list[Regime] = []
        joined = False
        for regime in self.regimes:
            if regime.kind in kinds:
                start = runs.pop().start if joined else regime.start
                runs.append(Regime(start, regime.stop, regime.kind))
            joined = regime.kind in kinds
        return runs


@remembered
def motion_summary(record: ImuRecord) -> MotionSummary:
    """Tell the kinds of motion of a record apart.

    Gaps are bridged by interpolation; a second inside a gap takes the kind of its neighbours.

    Parameters
    ----------
    record : ImuRecord
        At least 3 s; a shorter one gives the kind ``unknown``.
    """
    if record.duration < SHORTEST_RECORD or len(record) < 2 * SHORTEST_RECORD:
        return _unknown(record)
    interval, rates = even_rates(record)
    per_second = max(1, round(1.0 / interval))
    seconds = rates.shape[1] // per_second
    if seconds < SHORTEST_RECORD:
        return _unknown(record)
    rates = rates[:, : seconds * per_second]

    noise = white_noise(record)
    wander = angle_wander(rates[:3], interval, per_second)  # (3, windows), of each window of up to 10 s
    angle_noise, force_noise = _no_motion(noise[:3], wander, seconds), noise[3:]
    bias = rate_bias(rates[:3], wander, per_second, angle_noise)
    force = second_means(rates[3:], per_second)
    still_gravity = bias_by_gravity(second_means(rates[:3], per_second), force)
    bias = bias if still_gravity is None else still_gravity
    gyro = rates[:3] - bias[:, None]
    rate = second_means(gyro, per_second)
    steady = unturned(gyro * interval, rates[3:])  # specific force in axes that do not turn
    motion, gain, surely = acceleration(second_means(steady, per_second), force)

    turned = np.minimum(1.0, np.linalg.norm(box_mean(rate, LEVEL_WINDOW), axis=0) * LEVEL_WINDOW)
    walked = angle_noise[:, None] * _walk(seconds)
    active = np.any(wander > np.hypot(STILL_ANGLE, NOISE_FACTOR * walked), axis=0)
    around = wander.max(axis=0)[offset(seconds, seconds - wander.shape[1] + 1)]
    noisy = length_of(force_noise)
    biased = min(max(NOISY_BIAS * noisy, TURNED_BIAS), LARGEST_BIAS)
    kind = _classify(
        rate,
        active=_in_every_window(active, seconds),
        sways=around * np.sqrt(2.0) > SWAY_ANGLE,
        accelerates=motion > np.hypot(MOVING_ACCELERATION, 3.0 * noisy) + biased * turned,
        gains=_near(surely > LEAST_GAIN, gain > LEAST_GAIN),
        gains_speed=_near(surely > SWAY_ACCELERATION, gain > SWAY_ACCELERATION),
        rate_noise=length_of(angle_noise),
    )
    time = record.time[0] - record.interval + per_second * interval * np.arange(1, seconds + 1)
    return MotionSummary(time, kind, rate.T, force.T, motion, around, bias, angle_noise, _stretches(time, kind, record))


def _near(surely: NDArray[np.bool_], maybe: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(m,) seconds in which a base gains speed by a coarser mean, near those in which it surely does: that sees its start later."""
    return np.asarray(maybe & (box_mean(surely[None].astype(np.float64), 2 * LATER + 1)[0] > 0.0))


def _walk(seconds: int) -> float:
    """RMS wander of a window by white noise of 1 rad/sqrt(s): a detrended random walk has ``N^2 T / 15``."""
    return float(np.sqrt(min(WINDOW, seconds) / 15.0))


def _no_motion(angle_noise: Array, wander: Array, seconds: int) -> Array:
    """(3,) white noise that leaves a window as quiet as the quietest one.

    The quiet quarter of a log that rests less than a quarter is in motion, and rough ground or steps look white. A sensor's noise
    is there at rest, too. An axis that stands on one value for a window is coarse, or stuck, and shows no noise.
    """
    quietest = wander.min(axis=1)
    return np.where(quietest > ONE_VALUE, np.minimum(angle_noise, QUIETEST * quietest / _walk(seconds)), angle_noise)


def _unknown(record: ImuRecord) -> MotionSummary:
    regime = Regime(float(record.time[0] - record.interval), float(record.time[-1]), "unknown")
    none, rows = np.empty(0), np.empty((0, 3))
    nan = np.full(3, np.nan)
    return MotionSummary(none, np.empty(0, np.int8), rows, rows, none, none, nan, nan, (regime,))


def _classify(
    rate: Array,
    active: NDArray[np.bool_],
    sways: NDArray[np.bool_],
    accelerates: NDArray[np.bool_],
    gains: NDArray[np.bool_],
    gains_speed: NDArray[np.bool_],
    rate_noise: float,
) -> NDArray[np.int8]:
    """(m,) index into `KINDS`: the strongest statement that holds."""
    turns = _turns(rate, rate_noise)
    sways = _closed(sways & ~turns & active, WINDOW)
    sways = _without_short(sways, min(WINDOW, rate.shape[1] // 2))
    rocks = _without_short(sways, min(SHORTEST_SWAY, rate.shape[1] // 2))  # its lever arms accelerate, too
    moves = accelerates & gains & ~(rocks & ~gains_speed)
    moves = _without_short(_closed(moves, MOVING_PAUSE, unless=~active & ~turns), 2)
    kind = np.full(rate.shape[1], STILL, dtype=np.int8)
    kind[active | accelerates] = DISTURBED
    kind[sways] = SWAYING
    kind[turns] = ROTATING
    kind[moves] = MOVING
    return kind


def _turns(rate: Array, rate_noise: float) -> NDArray[np.bool_]:
    """Seconds of net rotation: the rate is above noise, and does not cancel over 21 s as a sway does."""
    fast = np.linalg.norm(rate, axis=0) > TURN_RATE + 5.0 * rate_noise
    if not fast.any():
        return fast
    width = min(TURN_WINDOW, rate.shape[1])
    net = np.linalg.norm(box_mean(rate, width), axis=0)
    power = box_mean(np.sum(rate**2, axis=0, keepdims=True), width)[0]
    way = box_mean(np.linalg.norm(rate, axis=0, keepdims=True), width)[0]
    one_way = (net > TURN_SHARE * np.sqrt(power)) | (net > TURN_WAY * way)
    turns: NDArray[np.bool_] = fast & one_way & (net * width > TURN_ANGLE)
    return _closed(turns, 3)


def _in_every_window(active: NDArray[np.bool_], seconds: int) -> NDArray[np.bool_]:
    """Seconds all of whose windows are active: a second is at rest if any 10 s around it are."""
    length = seconds - active.size + 1
    if not active.any():
        return np.zeros(seconds, dtype=np.bool_)
    padded = np.pad(active, length - 1, constant_values=True)
    return np.asarray(sliding_window_view(padded, length).all(axis=1))


def _closed(flags: NDArray[np.bool_], pause: int, unless: NDArray[np.bool_] | None = None) -> NDArray[np.bool_]:
    """Fill the holes of up to `pause` seconds, except holes that `unless` touches."""
    filled = flags.copy()
    if not filled.any():
        return filled
    for first, last in _runs(~flags):
        inside = first > 0 and last < flags.size
        if inside and last - first <= pause and not (unless is not None and unless[first:last].any()):
            filled[first:last] = True
    return filled


def _without_short(flags: NDArray[np.bool_], shortest: int) -> NDArray[np.bool_]:
    kept = flags.copy()
    for first, last in _runs(flags):
        if last - first < shortest:
            kept[first:last] = False
    return kept


def _runs(flags: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First and past-last index of each run of true flags."""
    if not flags.any():
        return []
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8)))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist()))


def _stretches(time: Array, kind: NDArray[np.int8], record: ImuRecord) -> tuple[Regime, ...]:
    changes = (kind[1:] != kind[:-1]).nonzero()[0] + 1
    stops = [*time[changes - 1].tolist(), float(record.time[-1])]
    starts = [float(record.time[0] - record.interval), *stops[:-1]]
    kinds = kind[[0, *changes.tolist()]]
    return tuple(Regime(a, b, KINDS[k]) for a, b, k in zip(starts, stops, kinds.tolist()))
