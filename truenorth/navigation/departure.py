"""Until when the beginning of a log goes nowhere: the speed that it gains, since a gentle departure looks like a tilt for long.

A train or a ship gains 0.1 m/s^2 within ten seconds. To a look of half a minute that is a level which drifts. So the mean of the
specific force over the first half of a span foretells the second half. What it misses there, summed up, is a speed gained: of a
level that drifts steadily eight times what the first half itself wanders by, of white noise some two to three times. A vehicle
that sways or is pushed wanders by as much in both halves; where the first half is less than a wave, what was missed comes back
before the span is twice as long. The force is looked at twice, in axes of the body, to which poor gyros do no harm, and carried by
the gyros into axes that do not turn, in which no tilt looks like a push; a departure shows in both. A turn shows in the gyros in
the same way.

A base that swings three times within a minute, and goes nowhere by the first half of it nor, backwards, by the second, has not
departed. It was not calm before: what was, and then goes to and fro, has left. Where nothing departs so, means of half a minute
show one that departs in waves.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.quality.regimes import motion_summary
from truenorth.quality.signals import even_rates, second_means, unturned, white_noise
from truenorth.records import ImuRecord

Array = NDArray[np.float64]

LEAST_GAIN = 0.03  # m/s: what people getting in, and a vehicle that settles on its springs, leave
LEAST_TURN = np.radians(0.3)
BY_NOISE = 5.0  # times the random walk over half a span: means of half a minute hardly wander, and are no better known
WANDERS = 10.0  # times what the first half wanders by
GONE = 0.5  # of the gain that is plain: where it begins to rise
UNSEEN_GAIN = GONE * LEAST_GAIN  # m/s: of which nothing is seen
BACK = 2.4  # times from there to where it is plain: of a push that grows, half the speed is gained in 0.7 to 0.8 of the time
SHORTEST = 10  # s: two halves of five
WAVES = 60  # s: in the halves of it any sea has more than a wave
WAVE = 15  # s
LEFT = (10.0 / (math.pi * WAVE)) ** 2  # of waves of 10 s, at most, by means of twice that
FEWEST_SWINGS = 6  # from one side to the other: three waves
RESTS = 0.2  # of what a base gains: as little as this it may gain at rest
ASIDE = 0.5  # of the RMS: a swing goes as far


class Departure(NamedTuple):
    """When a base begins to gain speed or to turn, and what may be wrong with a start before that."""

    time: float  # s, on the record's clock: its beginning where the base is not seen to stay at all
    unseen: float  # m/s: what speed it may have gained by then, or sways by


def departure(record: ImuRecord) -> Departure | None:
    """The departure of a base; None where it does not depart, or the log is below 10 s."""
    motion = motion_summary(record)
    if len(motion.time) < SHORTEST:
        return None
    interval, rates = even_rates(record)
    per_second = max(1, round(1.0 / interval))
    rates = rates[:, : len(motion.time) * per_second]
    steady = second_means(unturned((rates[:3] - motion.rate_bias[:, None]) * interval, rates[3:]), per_second)
    forces = (_level(steady), _level(second_means(rates[3:], per_second)))
    seen, sways = _Seen(forces, second_means(rates[:3], per_second)), motion.overall == "swaying"
    first, found = 0, _found(seen, sways)
    if found is None and len(motion.time) >= WAVES:
        noise = white_noise(record)
        first, found = (
            WAVE - 1,
            _found(seen.smooth(float(np.max(noise[3:])), float(np.max(noise[:3]))), sways),
        )
    if found is None:
        return None
    span, calm = found
    if not calm:
        return Departure(float(record.time[0]), math.inf)
    time = float(motion.time[first + calm - 1] - BACK * (span - calm) * per_second * interval)
    return Departure(time, max(UNSEEN_GAIN, float(_gained(forces[0][:, : first + calm]).max())))


@dataclass(frozen=True)
class _Seen:
    """Second by second, the level specific force (3, m) in two sets of axes, and the turns; what noise and waves leave of them."""

    forces: tuple[Array, Array]
    turns: Array
    force_walk: float = 0.0  # m/s/sqrt(s)
    turn_walk: float = 0.0  # rad/sqrt(s)
    waves: tuple[float, float] = (0.0, 0.0)  # m/s, rad

    def first(self, span: int) -> _Seen:
        """Of the first seconds."""
        a, b = self.forces
        return replace(self, forces=(a[:, :span], b[:, :span]), turns=self.turns[:, :span])

    def backwards(self) -> _Seen:
        """The last second first."""
        a, b = self.forces
        return replace(self, forces=(a[:, ::-1], b[:, ::-1]), turns=self.turns[:, ::-1])

    def smooth(self, force_walk: float, turn_walk: float) -> _Seen:
        """In which there are hardly any waves: means of half a minute, the middle of which counts most."""
        a, b = self.forces

        def left(rate: Array) -> float:
            return LEFT * float(np.sqrt(np.mean(_gained(rate) ** 2)))

        return _Seen((_smooth(a), _smooth(b)), _smooth(self.turns), force_walk, turn_walk, (left(a), left(self.turns)))

    def plain(self) -> float:
        """How plain a departure is, as a share of what is enough."""
        walks = BY_NOISE * math.sqrt(0.5 * self.turns.shape[1])
        moved = min(_share(force, LEAST_GAIN + walks * self.force_walk + self.waves[0]) for force in self.forces)
        return max(moved, _share(self.turns, LEAST_TURN + walks * self.turn_walk + self.waves[1]))

    def to_and_fro(self) -> bool:
        """Whether a base swings, and goes nowhere: by its first half and, backwards, by its second.

        One that has left within the first half, and then goes on at its speed, wanders only there.
        """
        swings = max(map(_swings, self.forces)) >= FEWEST_SWINGS
        return swings and self.plain() <= GONE and self.backwards().plain() <= GONE

    def rests(self, calm: int) -> bool:
        """Whether so many first seconds gain next to nothing of what the base gains in all: what then goes to and fro, has left.

        A forklift shuttles so, after a rest. Waves are there from the first second on.
        """
        force = self.forces[0]
        return calm > 0 and bool(_gained(force[:, :calm]).max() < RESTS * _gained(force).max())


def _found(seen: _Seen, sways: bool) -> tuple[int, int] | None:
    """After how many seconds a departure is plain, and for how many the base is calm before."""
    seconds = seen.turns.shape[1]
    shares = [seen.first(span).plain() for span in range(SHORTEST, seconds + 1)]
    calm = 0
    for k, share in enumerate(shares):
        span = SHORTEST + k
        if share <= GONE:
            calm = span
        if share <= 1.0 or (sways and min(shares[k : 2 * max(calm, SHORTEST) - SHORTEST + 1]) <= GONE):
            continue
        longer = range(span + 1, min(seconds, max(2 * calm, WAVES)) + 1)
        if not any(seen.first(n).to_and_fro() and not seen.first(n).rests(calm) for n in longer):
            return span, calm
    return None


def _smooth(rate: Array) -> Array:
    """(3, m - 28) means of a rate (3, m), weighed by a triangle."""
    weight = np.convolve(np.ones(WAVE), np.ones(WAVE)) / WAVE**2
    return np.stack([np.convolve(row, weight, mode="valid") for row in rate])


def _swings(rate: Array) -> int:
    """How often what a rate (3, m) gains goes from one side to the other, along the axis in which it goes farthest.

    A curve is taken off it: what a level that is not known, and drifts, makes of it. A departure swings two or three times about
    such a curve, a stop and a start in traffic five times.
    """
    gained = np.cumsum(rate, axis=1).T
    curve = np.polynomial.legendre.legvander(np.linspace(-1.0, 1.0, len(gained)), 2)
    gained = gained - curve @ np.linalg.lstsq(curve, gained, rcond=None)[0]
    way = gained @ np.linalg.eigh(gained.T @ gained)[1][:, -1]
    sides = np.sign(way[np.abs(way) > ASIDE * np.sqrt(np.mean(way**2))])
    return int(np.count_nonzero(np.diff(sides)))


def _level(force: Array) -> Array:
    """(3, m) what of a specific force is level, as the base stands in the first seconds."""
    up = force[:, : SHORTEST // 2].mean(axis=1)
    up /= np.linalg.norm(up)
    return np.asarray(force - np.outer(up, up @ force))


def _share(rate: Array, least: float) -> float:
    """What the second half gains by a rate (3, m) beyond the first half's, as a share of what is plain."""
    half, gained = rate.shape[1] // 2, _gained(rate)
    return float(gained[-1] / (least + WANDERS * gained[:half].max()))


def _gained(rate: Array) -> Array:
    """(m,) size of what a rate (3, m) gains beyond the mean of its first half, second by second."""
    half = rate.shape[1] // 2
    return np.asarray(np.linalg.norm(np.cumsum(rate - rate[:, :half].mean(axis=1)[:, None], axis=1), axis=0))
