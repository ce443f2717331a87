"""Receivers whose clocks run apart from the IMU's by far more than two quartzes do: the rate that a log fits best.

A clock without a quartz is off by up to 1 %: 2 s in a log of 200 s, in which a ship gets 10 m further. A filter whose prior is that
of quartz does not find this. The prior costs ``(r / 150 ppm)^2``, which is 4400, and the log is worth some hundreds; a wider one
does not lead there either, since a delay acts as its first derivative only as long as it is short against a swing: 2 s are two
radians of a swell of 6 s. So a log that does not show its rate is tried with some of them, at steps of the delay at its end.
Twice the logarithm of a likelihood ratio says which fits. Each has a prior of its own, so a sound log exceeds c in less than
``exp(-c / 2)`` of cases (Markov's inequality); the next passes begin with the one that fits best, and find the rest. What a log
neither shows nor rules out is in sigma by its chance. A receiver that is later by the same all the time may explain it better, by
what is known of its delay beforehand: then its clock is no other one, and the next passes begin with that delay.

Measurements are taken by the IMU's seconds, ``y / (1 - r)`` of a velocity y. A density by y is that by the other one over
``1 - r``, and of 600 rows at 1 % this is 12 in twice the logarithm.

The rule is ours.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from truenorth.core.errors import DataError
from truenorth.estimate.latency import SHOWN_DELAY, WORST_CLOCK, as_stamped, best_rate
from truenorth.estimate.rivals import effect_of, last_sizes, likelihood_ratio
from truenorth.quality.swing import VELOCITIES
from truenorth.state.evidence import NO_EFFECT, Evidence, Figure
from truenorth.state.judge import weight
from truenorth.state.limits import limit
from truenorth.state.mounting import Drift, Mounting
from truenorth.state.track import Track

UNSAID = 1e-9  # s, one sigma of a delay that is given
STEP = 0.5  # s, of the delay at the end: within half of it a swell of 6 s turns by a quarter of a radian


class Clocked(NamedTuple):
    """A log with a receiver whose clock runs at another rate."""

    antenna: Mounting
    track: Track
    ratio: float  # twice the logarithm of its likelihood ratio against quartz clocks


def other_clocks(antenna: Mounting, track: Track) -> list[Mounting]:
    """Receivers on clocks that may run far apart, of a track that does not show at which rate; else none.

    Where a track shows it, the next passes find it.
    """
    rate, drift = best_rate(track), antenna.clock
    if rate is None or drift.rate != 0.0 or not 0.0 < drift.rate_sigma < WORST_CLOCK:
        return []
    if rate[1] < limit("not estimated") * rate[2]:
        return []
    begin = float(track.time[0])
    many = math.ceil(WORST_CLOCK * (float(track.time[-1]) - begin) / STEP)
    rates = np.linspace(-WORST_CLOCK, WORST_CLOCK, 2 * many + 1)
    return [replace(antenna, drift=Drift(float(r), WORST_CLOCK, begin)) for r in rates]


def best_clock(
    run: Callable[[Mounting], Track], antenna: Mounting, track: Track
) -> tuple[Clocked | None, list[Evidence]]:
    """The clock that a log fits better than two quartzes by more than chance explains, or None, and how unsure it is of them.

    Parameters
    ----------
    run : callable
        The same log with the antenna so mounted.
    antenna : Mounting
    track : Track
        With it.
    """
    found = []
    for other in other_clocks(antenna, track):
        try:
            clocked = run(other)
        except DataError:  # the filter broke down: no explanation
            continue
        found.append(Clocked(other, clocked, clock_ratio(track, clocked, antenna, other)))
    best = max(found, key=lambda one: one.ratio, default=None)
    if best is None or (shown := best_rate(best.track)) is None:
        return None, []
    if abs(best.antenna.clock.rate + shown[0]) <= SHOWN_DELAY * shown[1]:  # its freedom explains something else
        return None, []
    late = _late_all_the_time(run, antenna, track)
    of_late = late.ratio - ((late.antenna.latency - antenna.latency) / (antenna.latency_sigma or UNSAID)) ** 2
    if best.ratio - limit("rival") > max(of_late, 0.0):
        return best, []
    if of_late > limit("rival"):
        return late, []
    return None, _unsure(track, found, best)


def _late_all_the_time(run: Callable[[Mounting], Track], antenna: Mounting, track: Track) -> Clocked:
    """The best of clocks that run as the IMU's and are later or earlier by some steps, up to what a rate would make."""
    many = math.ceil(WORST_CLOCK * float(track.time[-1] - track.time[0]) / STEP)
    found = [Clocked(antenna, track, 0.0)]
    for step in (*range(-many, 0), *range(1, many + 1)):
        other = replace(antenna, latency=antenna.latency + STEP * step)
        try:
            late = run(other)
        except DataError:  # the filter broke down: no explanation
            continue
        found.append(Clocked(other, late, clock_ratio(track, late, antenna, other)))
    return max(found, key=lambda one: one.ratio)


def _unsure(track: Track, found: Sequence[Clocked], best: Clocked) -> list[Evidence]:
    """What clocks do that a log neither shows nor rules out, each by its chance (:mod:`truenorth.estimate.poorer`)."""
    odds = np.exp(0.5 * (np.array([one.ratio for one in found]) - limit("rival")))
    effect = NO_EFFECT
    for one, chance in zip(found, odds / (1.0 + odds.sum()), strict=True):
        effect = effect.joined(effect_of(track, one.track).times(math.sqrt(chance)))
    shown = best_rate(best.track)
    if shown is None or weight(effect, last_sizes(track)) <= limit("negligible"):
        return []
    rate = best.antenna.clock.rate + shown[0]
    figures: dict[str, Figure] = {"name": "GNSS", "size": 1e6 * abs(rate), "ratio": best.ratio}
    return [Evidence("clock.may_run", figures, kind="hint", effect=effect)]


def clock_ratio(first: Track, other: Track, antenna: Mounting, of_other: Mounting) -> float:
    """Twice the logarithm of the likelihood ratio of two tracks of one log, each with its receiver's clock."""
    rows = sum(int(np.sum(r.rows[r.used])) for r in other.residuals if r.name == VELOCITIES)
    by_own_seconds = 2.0 * rows * math.log((1.0 - antenna.clock.rate) / (1.0 - of_other.clock.rate))
    stamped = (as_stamped(track.residuals, m) for track, m in ((first, antenna), (other, of_other)))
    return likelihood_ratio(*stamped) + by_own_seconds
