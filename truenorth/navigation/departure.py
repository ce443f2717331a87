"""Until when the beginning of a log goes nowhere: the speed that it gains, since a gentle departure looks like a tilt for long.

A train or a ship gains 0.1 m/s^2 within ten seconds. To a look of half a minute that is a level which drifts. So the mean of the
specific force over the first half of a span foretells the second half. What it misses there, summed up, is a speed gained: of a
level that drifts steadily eight times what the first half itself wanders by, of white noise some two to three times. A vehicle
that sways or is pushed wanders by as much in both halves; where the first half is less than a wave, what was missed comes back
before the span is twice as long. The force is looked at twice, in axes of the body, to which poor gyros do no harm, and carried by
the gyros into axes that do not turn, in which no tilt looks like a push; a departure shows in both. A turn shows in the gyros in
the same way.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.quality.regimes import motion_summary
from truenorth.quality.signals import even_rates, second_means, unturned
from truenorth.records import ImuRecord

Array = NDArray[np.float64]

LEAST_GAIN = 0.03  # m/s: what people getting in, and a vehicle that settles on its springs, leave
LEAST_TURN = np.radians(0.3)
WANDERS = 10.0  # times what the first half wanders by
GONE = 0.5  # of the gain that is plain: where it begins to rise
UNSEEN_GAIN = GONE * LEAST_GAIN  # m/s: of which nothing is seen
BACK = 2.4  # times from there to where it is plain: of a push that grows, half the speed is gained in 0.7 to 0.8 of the time
SHORTEST = 10  # s: two halves of five
WAVES = 60  # s: in the halves of it any sea has more than a wave
FEWEST_SWINGS = 6  # from one side to the other: three waves
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
    views = [_level(steady), _level(second_means(rates[3:], per_second))]
    turns = second_means(rates[:3], per_second)

    spans = range(SHORTEST, len(motion.time) + 1)
    shares = [_plain(views, turns, span) for span in spans]
    calm, sways = 0, motion.overall == "swaying"
    for k, (span, share) in enumerate(zip(spans, shares, strict=True)):
        if share <= GONE:
            calm = span
        if share <= 1.0 or (sways and min(shares[k : 2 * max(calm, SHORTEST) - SHORTEST + 1]) <= GONE):
            continue
        if _goes_to_and_fro(views, turns, range(span + 1, min(len(motion.time), max(2 * calm, WAVES)) + 1)):
            continue
        if not calm:
            return Departure(float(record.time[0]), math.inf)
        time = float(motion.time[calm - 1] - BACK * (span - calm) * per_second * interval)
        return Departure(time, max(UNSEEN_GAIN, float(_gained(views[0][:, :calm]).max())))
    return None


def _plain(views: list[Array], turns: Array, span: int) -> float:
    """How plain a departure is within the first seconds, as a share of what is enough."""
    return max(min(_share(level[:, :span], LEAST_GAIN) for level in views), _share(turns[:, :span], LEAST_TURN))


def _goes_to_and_fro(views: list[Array], turns: Array, spans: range) -> bool:
    """Whether over one of these spans a base swings, and goes nowhere: told from its first half and, backwards, from its second.

    One that has left within the first half, and then goes on at its speed, wanders only there.
    """
    return any(
        max(map(_swings, (level[:, :span] for level in views))) >= FEWEST_SWINGS
        and _plain(views, turns, span) <= GONE
        and _plain([level[:, span - 1 :: -1] for level in views], turns[:, span - 1 :: -1], span) <= GONE
        for span in spans
    )


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
