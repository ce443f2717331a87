"""Which moment a receiver shows of an antenna that shakes more quickly than its delay is known.

A filter is linear in a delay. Of a train whose body rolls by .05 deg at 5 Hz an antenna on an arm of 3 m goes to and fro by .1 m/s,
and a delay that is known to .15 s is one of seven periods of that: in the first rows the filter takes the one that its noise
likes, and is sure of it (70 of its sigmas off). Rows that come as often as the antenna shakes make it worse: they show a slow wave,
which looks like a tilt. So such a log is tried with delays in steps in which the shake turns by a radian, each with half a step as
its sigma: a sum of Gaussians (H. Sorenson and D. Alspach, "Recursive Bayesian estimation using Gaussian sums", Automatica 7
(1971)). The next passes begin with the likeliest, with what is known of the delay beforehand. Delays that a log does not tell from
it by more than their likelihoods scatter are in sigma (Q. Vuong, "Likelihood ratio tests for model selection and non-nested
hypotheses", Econometrica 57 (1989)).

What turns by less than half a period in a sigma of the delay is found by passes one after the other
(:mod:`truenorth.estimate.latency`); what is quicker than 10 Hz receivers do not show. Nor do those whose velocities are means:
there each delay fits as well, and passes find it, too.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.aiding.aids import LATENCY_SIGMA
from truenorth.core.errors import DataError
from truenorth.estimate.latency import as_stamped, delay_of
from truenorth.estimate.rivals import effect_of, likelihood_ratio
from truenorth.quality.swing import VELOCITIES, shake, shown_arm
from truenorth.records import ImuRecord
from truenorth.state.evidence import NO_EFFECT, Evidence, Figure
from truenorth.state.limits import limit
from truenorth.state.mounting import Mounting
from truenorth.state.track import Residuals, Track

Array = NDArray[np.float64]

TURNS = 3.5  # rad, by which the shake turns in one sigma of the delay: half a period and more
SEEN = 6.0  # sigmas, in which all rows together show the shake
USUAL_ARM = 1.0  # m, at least, of an antenna of which nobody says where it is
# Twice the logarithm of a likelihood ratio: half a period away a shake that is seen as well as that leaves four times as much.
SHOWN = SEEN**2
BY_CHANCE = 2.0  # sigmas of what such a ratio scatters by
FAR = 3.5  # sigmas of the delay, as far as it is tried
EDGE = 2.0  # rad of the shake: so near the farthest ones the likeliest stands for a delay that is farther still
MOST = 60  # delays
BEGINS = 20.0  # s, in which a filter comes to know level and heading
PART = 240.0  # s on the move, that tell them apart
SETS_OFF = 1.0  # m/s
ROUNDS, FINALISTS = 2, 8  # of the likeliest, each begun with the delay that it has found
PHASE = 0.1  # rad of a shake, by which filters of gyros and receivers, and what an engine adds, may turn it
TINY = 1e-300
APART = 3.0  # sigmas, by which a delay is another one than that found


class Moment(NamedTuple):
    """A log with a receiver that is later or earlier."""

    antenna: Mounting
    track: Track


def quickness(antenna: Mounting, record: ImuRecord, track: Track) -> float:
    """How quickly an antenna shakes that is shown by estimated delays, rad/s; 0 where its receiver's velocities do not show it."""
    rows = next((r for r in track.residuals if r.name == VELOCITIES), None)
    if antenna.latency_sigma == 0.0 or rows is None or len(rows.time) < 2:
        return 0.0
    until = tells_until(track)
    record = record.between(until - PART, until)
    some = (rows.time > until - PART) & (rows.time < until)
    # Of a shake at a wrong moment an arm that is estimated comes out as nothing.
    arm = np.maximum(np.abs(antenna.lever_arm), np.abs(shown_arm(track, antenna.lever_arm)))
    size, quick = shake(track, record, np.maximum(arm, min(antenna.lever_arm_sigma, USUAL_ARM)))
    seen = size * math.sqrt(np.sum(some)) / float(np.nanmedian(rows.sigma))
    return quick if seen > SEEN and quick * max(antenna.latency_sigma, LATENCY_SIGMA) > TURNS else 0.0


def tells_until(track: Track) -> float:
    """Until when, s, a log is looked at: what tells delays apart begins when the vehicle sets off."""
    moves = np.linalg.norm(track.v_n, axis=1) > SETS_OFF
    return float(track.time[int(np.argmax(moves)) if moves.any() else 0]) + PART


class Likeliest(NamedTuple):
    """The moment that a log fits best, and how unsure that is."""

    antenna: Mounting
    spread: float = 0.0  # s, one sigma, of what else the delay may be
    evidence: tuple[Evidence, ...] = ()
    shown: bool = True  # the receiver shows the shake


def likeliest_moment(
    run: Callable[[Mounting], Track],
    again: Callable[[Mounting, Track], Track],
    antenna: Mounting,
    quick: float,
) -> Likeliest:
    """The antenna with the delay that a log fits best; and how unsure that is.

    Parameters
    ----------
    run : callable
        A part of the log with the antenna so mounted.
    again : callable
        The same once more, begun where a track leads back to: what is not linear in a heading that is guessed differs by more than
        two delays do.
    antenna : Mounting
        The same is given back where its delay is known as well as its shake needs it.
    quick : float, rad/s
        How quickly it shakes.
    """
    found = _tried((other, partial(run, other)) for other in _moments(antenna, quick))
    if not found:
        return Likeliest(antenna)
    if not _is_shown(found, antenna, quick):
        return Likeliest(antenna, shown=False)
    for _ in range(ROUNDS):  # a delay that is half a step off costs the first rows, until they have found it
        best, ratios = _best(found, antenna)
        later = ((_as_found(one), one.track) for one in _apart(found, ratios))
        found = _tried((other, partial(again, other, track)) for other, track in later) or found
    best, ratios = _best(found, antenna)
    late, _ = _late(best)
    # A step to either side is no knowledge of its own: the log tells the delay better than that.
    antenna = replace(best.antenna, latency=late, latency_sigma=1.0 / quick)
    spread, evidence = _unsure(best, found, ratios)
    return Likeliest(antenna, math.hypot(spread, PHASE / quick), evidence)


def _is_shown(found: Sequence[Moment], given: Mounting, quick: float) -> bool:
    """Whether a receiver shows the shake: then half a period next to the likeliest moment it fits by far worse.

    A receiver whose velocities are means over its interval, or whose antenna does not shake with an IMU on its engine, does not.
    """
    best, ratios = _best(found, given)
    if min(abs(_step(one, best)) for one in (found[0], found[-1])) < EDGE / quick:
        return False  # a delay beyond those that are tried is left to the passes: they go as far as it takes
    period = 2.0 * math.pi / quick
    near = [(r, one) for one, r in zip(found, ratios, strict=True) if abs(_step(one, best)) < 0.75 * period]
    worst, other = min(near, key=lambda pair: pair[0])
    return worst < -max(SHOWN, BY_CHANCE * _scatter(best, other))


def _step(one: Moment, other: Moment) -> float:
    return one.antenna.latency - other.antenna.latency


def _tried(passes: Iterable[tuple[Mounting, Callable[[], Track]]]) -> list[Moment]:
    """The log with each of these, as far as the filter goes through."""
    found = []
    for antenna, run in passes:
        try:
            found.append(Moment(antenna, run()))
        except DataError:  # the filter broke down: no explanation
            continue
    return found


def _best(found: Sequence[Moment], given: Mounting) -> tuple[Moment, list[float]]:
    """The likeliest of them, and how much likelier each is than that: twice the logarithm of the ratio, zero at the most.

    Two are compared by the rows that both have used, so that three may be likelier than each other all round: each is taken once.
    """
    best = min(found, key=lambda one: abs(one.antenna.latency - given.latency))
    ratios, taken = [_ratio(best, one, given) for one in found], [best]
    while max(ratios) > 0.0:
        likelier = found[int(np.argmax(ratios))]
        if any(likelier is one for one in taken):
            break
        best = likelier
        ratios = [_ratio(best, one, given) for one in found]
        taken.append(best)
    return best, [min(ratio, 0.0) for ratio in ratios]


def _apart(found: Sequence[Moment], ratios: Sequence[float]) -> list[Moment]:
    """The likeliest few that have found delays of their own."""
    kept: list[Moment] = []
    for i in np.argsort(ratios)[::-1]:
        late, _ = _late(found[i])
        if all(abs(_late(other)[0] - late) > 2.0 * found[i].antenna.latency_sigma for other in kept):
            kept.append(found[i])
    return kept[:FINALISTS]


def _as_found(one: Moment) -> Mounting:
    """The antenna shown as late as its log has found."""
    return replace(one.antenna, latency=_late(one)[0])


def _moments(antenna: Mounting, quick: float) -> list[Mounting]:
    """Antennas that are shown later and earlier, in steps in which they turn by a radian, each half a step wide."""
    if quick * antenna.latency_sigma <= TURNS or antenna.velocities is not None:
        return []
    step = max(1.0 / quick, 2.0 * FAR * antenna.latency_sigma / MOST)
    many = math.ceil(FAR * antenna.latency_sigma / step)
    return [
        replace(antenna, latency=antenna.latency + step * i, latency_sigma=0.5 * step, drift=antenna.clock)
        for i in range(-many, many + 1)
    ]


def _ratio(first: Moment, other: Moment, given: Mounting) -> float:
    """Twice the logarithm of the ratio of their likelihoods, with what is known of the delay beforehand."""
    if first is other:
        return 0.0
    before, after = (((one.antenna.latency - given.latency) / given.latency_sigma) ** 2 for one in (first, other))
    stamped = ([_settled(r) for r in as_stamped(one.track.residuals, one.antenna)] for one in (first, other))
    return likelihood_ratio(*stamped, one_model=True) + before - after


def _settled(r: Residuals) -> Residuals:
    """Without the first rows, which say as much of where the filter begins: by a velocity of the same receiver, shake and all."""
    return replace(r, used=r.used & (r.time > r.time[0] + BEGINS)) if len(r.time) else r


def _scatter(first: Moment, other: Moment) -> float:
    """One sigma of twice the logarithm of the ratio of two delays that explain a log as well (Vuong's).

    Each reads the gyros at other times, and their noise on the arm is in what it predicts.
    """
    squares, others = 0.0, {r.name: r for r in as_stamped(other.track.residuals, other.antenna)}
    for r in as_stamped(first.track.residuals, first.antenna):
        _, at, of_other = np.intersect1d(r.stamp, others[r.name].stamp, return_indices=True)
        squares += float(np.sum((r.nis[at] - others[r.name].nis[of_other]) ** 2))
    return math.sqrt(squares)


def _unsure(best: Moment, found: Sequence[Moment], ratios: Sequence[float]) -> tuple[float, tuple[Evidence, ...]]:
    """By how much the delay may be another one, s, and what the others do that a log does not tell from it, by their chance."""
    late, sigma = _late(best)
    scatter = np.array([_scatter(best, one) for one in found])
    # Of Gaussian errors a ratio of ``-d^2`` scatters by ``2 d``: one that scatters by more says that much less. One sigma of it is
    # granted to the others.
    less = np.maximum(-np.array(ratios) - scatter, TINY)
    odds = np.exp(-0.5 * less / np.maximum(scatter**2 / (4.0 * less), 1.0))
    others = [
        (one, float(chance))
        for one, chance in zip(found, odds / odds.sum(), strict=True)
        if abs(_late(one)[0] - late) > APART * math.hypot(sigma, _late(one)[1])
    ]
    spread = math.sqrt(sum(chance * (_late(one)[0] - late) ** 2 for one, chance in others))
    if spread <= limit("negligible") * sigma:
        return 0.0, ()
    effect = NO_EFFECT
    for one, chance in others:
        effect = effect.joined(effect_of(best.track, one.track).times(math.sqrt(chance)))
    likeliest, chance = max(others, key=lambda pair: pair[1])
    figures: dict[str, Figure] = {"name": "GNSS", "size": late, "other": _late(likeliest)[0], "chance": chance}
    return spread, (Evidence("delay.one_of_several", figures, kind="hint", effect=effect),)


def as_unsure(track: Track, spread: float) -> Track:
    """The track whose receiver's delay may be another one by `spread`, s, one sigma."""
    where = track.layout.slice_of("GNSS lag")
    if where is None or spread == 0.0:
        return track
    P = track.P.copy()
    P[:, where.start, where.start] += spread**2
    return replace(track, P=P)


def _late(one: Moment) -> tuple[float, float]:
    """How late a receiver was found to be, and one sigma of it, s."""
    shown = delay_of(one.track, "GNSS")
    return (
        (one.antenna.latency, one.antenna.latency_sigma)
        if shown is None
        else (one.antenna.latency + shown[0], shown[1])
    )
