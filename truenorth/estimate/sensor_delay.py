"""Are gyros and accelerometers of one moment? The same log with its gyros earlier and later, and which of them it fits.

On a base that stays gravity says it (:mod:`truenorth.quality.tilt`). On the move the aiding measurements do: gyros that are late by
``d`` leave the attitude behind by ``w d`` while the vehicle turns, and the specific force is resolved along axes of another moment.
Twice the logarithm of a likelihood ratio is a parabola of the delay as long as that is short against a turn; from the ends of a
ladder of delays it leads to the likeliest one. Each rival is one fixed shift: by chance it exceeds c in less than exp(-c / 2) of
sound logs (Markov's inequality). That holds of measurements that are the same for all rivals. The mean rates of the gyros
themselves while nothing turns are not: each shift averages other rows of their noise. A delay does nothing to them, and they do
not count. Nor does it hold where the error of a measurement goes with the delay: a body that pitches on its springs by p at w rad/s
moves up and down by ``v p`` at a speed v, which no wheel shows, and gyros that are late by d, of an IMU on an arm l, by
``l d p'' = -l d w^2 p``. So that a wheel does not leave the road is no evidence of clocks (:func:`on_springs`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from truenorth.aiding.source import Aiding
from truenorth.aiding.wheel import COUNTED_FORWARD
from truenorth.core.errors import DataError
from truenorth.estimate.rivals import likelihood_ratio, moved, rival
from truenorth.quality.innovations import NO_ROTATION
from truenorth.records import ImuRecord
from truenorth.state.evidence import Evidence
from truenorth.state.limits import limit
from truenorth.state.track import Residuals, Track

Array = NDArray[np.float64]

LADDER = (0.05, 0.1, 0.2, 0.4)  # s; sensors' own filters differ by less than .02 s
LOOSE = 1e3  # times as noisy as it is: it counts for nothing
CLIMBS = 3  # from one delay to a likelier one: with the first taken off fewer measurements seem to be outliers


def gyro_delay_evidence(
    run: Callable[[ImuRecord], Track],
    first: Track,
    record: ImuRecord,
    led_by: Callable[[ImuRecord, ImuRecord], Track] | None = None,
) -> list[Evidence]:
    """Whether gyros that are taken earlier or later explain the measurements better, and what that does to the answer.

    Parameters
    ----------
    run, first, record
        As of :func:`truenorth.estimate.rivals.jump_evidence`.
    led_by : callable, optional
        A record from where `run` has begun its last pass with a second one. Where heading is hardly known, errors are linear about
        another beginning, too, and that alone may explain the log better: gyros without the delay have the same choice.

    Returns
    -------
    list of Evidence
        None, or one: of the likeliest delay, which may stand for what else the model leaves out (of the cart of
        `stim300_cart_chicago` gyros .056 s early): what it moves the answer by is its effect.
    """
    rows, track, ratio = 0, first, 0.0
    for _ in range(CLIMBS):
        step = _likelier(run, track, record, rows, led_by)
        if step is None:
            break
        ratio += step[2]
        rows, track = step[:2]
    if rows == 0:
        return []
    key, delay = f"delay.gyros_{'late' if rows > 0 else 'early'}", abs(rows) * record.interval
    return [rival(key, {"delay": delay}, ratio, moved(first, track), "common_clock")]


def on_springs(aiding: Sequence[Aiding]) -> list[Aiding]:
    """The same sources, but for wheels that do not leave the road: the body above them goes up and down."""
    return [
        replace(a, sigma=a.sigma * np.array([1.0, 1.0, LOOSE])) if a.figures == COUNTED_FORWARD else a for a in aiding
    ]


def _likelier(
    run: Callable[[ImuRecord], Track],
    base: Track,
    record: ImuRecord,
    at: int,
    led_by: Callable[[ImuRecord, ImuRecord], Track] | None,
) -> tuple[int, Track, float] | None:
    """Rows by which the gyros are more likely late than by `at`, the track without that delay, and the ratio; None: no others.

    `base` is the track with the delay `at` taken off.
    """
    ratios: dict[int, float] = {at: 0.0}
    tracks: dict[int, Track] = {}

    def tried(rows: int) -> float:
        if rows not in ratios:
            try:
                tracks[rows] = run(gyros_later(record, -rows))
                ratios[rows] = likelihood_ratio(not_of_gyros(base), tracks[rows].residuals, one_model=True)
            except DataError:  # the filter broke down: no explanation
                ratios[rows] = -math.inf
        return ratios[rows]

    for sign in (1, -1):
        for size in LADDER:
            rows = at + sign * max(1, round(size / record.interval))
            if 2 * abs(rows) >= len(record):
                break
            # Of a log that contradicts a hundred rows a first small step in the right direction may be no likelier yet.
            if tried(rows) < -limit("ruled out") and not (rows in tracks and _rejected(tracks[rows]) < _rejected(base)):
                break
    tried(_peak(ratios, max(ratios, key=ratios.__getitem__)))  # which may stand out where no rung of the ladder does
    best = max(ratios, key=ratios.__getitem__)
    ratio = ratios[best]
    if ratio > limit("rival") and led_by is not None:
        try:
            same = led_by(gyros_later(record, -at), gyros_later(record, -best))
        except DataError:  # the filter broke down: that beginning explains nothing
            return best, tracks[best], ratio
        ratio = min(ratio, likelihood_ratio(not_of_gyros(same), tracks[best].residuals, one_model=True))
    return (best, tracks[best], ratio) if ratio > limit("rival") else None


def _rejected(track: Track) -> int:
    """How many measurements of the aids seem to be outliers."""
    return sum(r.rejected for r in not_of_gyros(track))


def not_of_gyros(track: Track) -> list[Residuals]:
    """What the aids have measured, without the mean rates of the gyros themselves at rest."""
    return [r for r in track.residuals if r.name != NO_ROTATION]


def gyros_later(record: ImuRecord, rows: int) -> ImuRecord:
    """The record with its gyros so many rows later; where there are none the nearest are held."""
    at = np.clip(np.arange(len(record)) - rows, 0, len(record) - 1)
    return replace(record, gyro=record.gyro[at])


def _peak(ratios: dict[int, float], best: int) -> int:
    """Where the parabola through the likeliest delay and its neighbours is highest, in rows; at an end of them the end itself."""
    tried = sorted(rows for rows, ratio in ratios.items() if math.isfinite(ratio))
    k = tried.index(best)
    if not 0 < k < len(tried) - 1:
        return best
    x = np.array(tried[k - 1 : k + 2], dtype=np.float64)
    a, b, _ = np.polyfit(x, [ratios[rows] for rows in tried[k - 1 : k + 2]], 2)
    return best if a >= 0.0 else round(float(np.clip(-b / (2.0 * a), x[0], x[-1])))
