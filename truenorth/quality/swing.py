"""An antenna's swing that its receiver does not show: its velocity is a mean over a time, and the swing on an arm is quicker.

A receiver has its velocities from phases over a part of its interval, and filters them. An antenna on an arm l moves by ``w x l``
besides its vehicle: on a mast of 2 m on a cart by .1 to .2 m/s (RMS over a second), where the gyros show each shake and the
receiver hardly any. What is predicted of that is noise then, on rough ground alone: rows were rejected, and the filter explained
the rest by a delay that was twenty of its sigmas off, or by a shorter arm.

A share k of the swing, its RMS over the interval about a row, is added to the sigmas of velocities. It is the likeliest one, by
differences of innovations as the scatter of stamps (:mod:`truenorth.quality.stamps`), and none where chance explains it. A
receiver that shows nothing of the swing has a share of 1. One that shows that of another moment has the root of 2, both swings
count: so nothing is learnt where a delay is given, since one that is wrong would hide in it.

The share is of an arm that is known. Of one that is estimated, the part of it whose swing is not shown is estimated with it
(:mod:`truenorth.aiding.velocity`), for the rate about each axis by itself: the swing says nothing else of it. With the share
alone the arm up of a mast of 2 m came out as nothing, 37 to 57 of its sigmas off. Navigation estimates that part of a known arm
as well, where the log is likelier with it: without it, 16 of 18 drives with a mast of 2 to 9 m on rough ground lost their track.

The rule is ours.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from truenorth.aiding.source import Aiding
from truenorth.aiding.velocity import SHAKEN_VELOCITY, SMOOTHED_VELOCITY
from truenorth.core.remembered import remembered
from truenorth.errors.group import Group
from truenorth.quality.stamps import likelihoods, pairs
from truenorth.quality.whiteness import FEWEST
from truenorth.records import ImuRecord
from truenorth.state.layout import ANTENNA_ARM
from truenorth.state.limits import limit
from truenorth.state.track import Track
from truenorth.strapdown.increments import increments

Array = NDArray[np.float64]

VELOCITIES = "GNSS velocity"
SMOOTHED = 1.0  # s, over which a receiver takes a mean, or its interval where that is shorter
SHAKEN = 0.05  # s, over which a shake is looked at: what is quicker no receiver shows
UNSEEN_ARM = "GNSS unseen arm"  # the name of its states
LEAST = 1e-6  # m, one sigma of an arm that is nothing along an axis
SEEN = 0.3  # of the noise of a row, from which a swing (RMS) is seen in it: a tenth of its variance
SHARES = np.concatenate([[0.0], np.geomspace(0.1, 2.0, 40)])


def unseen_swing(track: Track, record: ImuRecord, arm: Array, had: float) -> float:
    """The share of an antenna's swing that its velocities do not show; 0 where chance explains it.

    Parameters
    ----------
    track : Track
        Of a pass with these velocities.
    record : ImuRecord
    arm : (3,) array, m
        IMU to antenna.
    had : float
        The share that is in their sigmas already.
    """
    for r in track.residuals:
        if r.name == VELOCITIES:
            squares, variance, swings = pairs(r, swing(track, record, arm, r.time), had)
            if len(squares) >= FEWEST:
                likelihood = likelihoods(squares, variance, swings, SHARES)
                best = int(np.argmax(likelihood))
                return float(SHARES[best]) if likelihood[best] - likelihood[0] > limit("rival") else 0.0
    return 0.0


def shown_arm(track: Track, given: Array) -> Array:
    """(3,) of an antenna, as a track has found it beyond what was given, m, without the part whose swing is not shown."""
    arm = np.array(given, dtype=np.float64) - unseen_arm(track)[0]
    if (there := track.layout.slice_of(ANTENNA_ARM)) is not None:
        arm += track.sensors[-1, there]
    return arm


def unseen_arm(track: Track) -> tuple[Array, Array]:
    """(3,) m: the part of an antenna's arm whose swing is not shown, of both rates that swing it, and how well it is known."""
    where = track.layout.slice_of(UNSEEN_ARM)
    if where is None:
        return np.zeros(3), np.zeros(3)
    D = track.sensors[-1, where].reshape(3, 3)
    weight = 1.0 / np.maximum(track.sigma[-1, where].reshape(3, 3), LEAST) ** 2
    i, j = [1, 2, 0], [2, 0, 1]  # of k = 0, 1, 2; q x d = D q: d_k is in it with q_j along i, and with -q_i along j
    total = weight[i, j] + weight[j, i]
    d = (weight[i, j] * D[i, j] - weight[j, i] * D[j, i]) / total
    return d, 1.0 / np.sqrt(total)


def quick_part(record: ImuRecord, time: Array) -> Array:
    """(3,) part of an arm along each axis that may be made of how a receiver of these times filters its swing, 0 to 1.

    Of a tone of the rate w with a quick part ``e w`` a receiver leaves out ``e w x d``, with a d of its own for each tone. The
    states have one d for all: an arm comes out wrong by up to ``E[q w] / E[w^2]`` of d. That is some hundredths of a long swell,
    nearly all of rough ground. An arm along an axis is shown by the rates about the two others.
    """
    return _part(*_quick(record, time))


def meant_part(record: ImuRecord, time: Array) -> Array:
    """(3,) part of an arm along each axis by which it seems shorter to means over a receiver's interval, 0 to 1.

    A mean over T leaves ``sinc(f T)`` of a tone: nothing is missing of a swell at 10 Hz, an eighth of one of .35 s. Of a rate whose
    tones are as quick as each other it looks like an arm that is shorter: no part of the swing seems to be left out then.
    """
    half = 0.5 * _filters(time)
    middle, rates, _ = _rates(record, 2.0 * half)
    now = _at(middle, rates, time)
    return _part(now, now - _means(record, rates, time, half))


def _part(now: Array, left: Array) -> Array:
    """(3,) part of an arm along each axis that is shown by what is `left` out of rates, 0 to 1."""
    (x, y, z), (a, b, c) = np.mean(now**2, axis=0), np.mean(now * left, axis=0)
    swing, part = np.array([y + z, x + z, x + y]), np.array([b + c, a + c, a + b])
    return np.where(swing > 0.0, np.clip(part / np.where(swing > 0.0, swing, 1.0), 0.0, 1.0), 1.0)


def unseen_sigma(arm: Array, askew: float) -> Array:
    """(9,) m: sigmas of D by rows: of ``q x d``, d as long as the arm, and of ``M q x l``, elements of M of `askew`, 1."""
    of_axes = askew * np.hypot(arm[[1, 2, 0]], arm[[2, 0, 1]])
    of_arm = np.abs(np.array([[0.0, arm[2], arm[1]], [arm[2], 0.0, arm[0]], [arm[1], arm[0], 0.0]]))
    return np.asarray(np.hypot(of_arm, of_axes[:, None]).ravel())


def swing(track: Track, record: ImuRecord, arm: Array, time: Array) -> Array:
    """(M, 3) RMS of an antenna's swing on its arm about some times, east, north, up, m/s."""
    if len(time) < 2 or not arm.any():
        return np.zeros((len(time), 3))
    moves = np.cross(increments(record)[0] / record.steps[:, None], arm)
    squares = (moves[:, :, None] * moves[:, None, :]).reshape(-1, 9)
    means = _means(record, np.hstack([moves, squares]), time, 0.5 * _filters(time))
    covariance = means[:, 3:].reshape(-1, 3, 3) - means[:, :3, None] * means[:, None, :3]
    C = track.C_nb[np.clip(np.searchsorted(track.time, time), 0, len(track.time) - 1)]
    return np.asarray(np.sqrt(np.maximum(np.einsum("kia,kab,kib->ki", C, covariance, C), 0.0)))


def shake(track: Track, record: ImuRecord, arm: Array) -> tuple[float, float]:
    """RMS of the quick part of an antenna's velocity, m/s, and how quickly it turns, rad/s: its change over it.

    Of what is quicker than a second, and slower than a tenth of one: by the rates on the arm, and by the forces themselves.
    """
    dtheta, dvel = increments(record)
    T, middle = record.steps[:, None], record.time - 0.5 * record.steps
    swings = np.cross(dtheta / T - track.gyro_bias[-1], arm)
    pushed = np.cumsum(dvel - _means(record, dvel / T, middle, 0.5 * SMOOTHED) * T, axis=0)
    moves = swings + pushed
    slow = _means(record, moves, middle, 0.5 * SMOOTHED)
    quick = _means(record, moves - slow, middle, 0.5 * SHAKEN)
    change = np.gradient(quick, middle, axis=0)
    size, fast = (float(np.mean(np.sum(x**2, axis=1))) for x in (quick, change))
    shown = math.sqrt(max(size - _noise_of_shake(dtheta, dvel, record.interval, arm), 0.0))
    return shown, math.sqrt(fast / max(size, LEAST**2))


def _noise_of_shake(dtheta: Array, dvel: Array, T: float, arm: Array) -> float:
    """What white noise of rows makes of that, (m/s)^2: by their third differences, in which a shake of 10 Hz has hardly a part.

    The rates' is a mean over a shake. The forces' is a random walk, whose wander about its mean over a second is a twelfth.
    """
    rate, force = (
        np.mean(np.diff(x, 3, axis=0) ** 2, axis=0) / 20.0 if len(x) > 3 else np.zeros(3) for x in (dtheta, dvel)
    )
    swings = (arm**2).sum() - arm**2  # of the rate about each axis
    return float((rate * swings).sum() / (T * max(SHAKEN, T)) + force.sum() * SMOOTHED / (12.0 * T))


def with_unseen_arm(
    aiding: Iterable[Aiding],
    record: ImuRecord,
    askew: float,
    *,
    known: bool = False,
    late: bool = False,
    shaken: bool = False,
) -> list[Aiding]:
    """The same sources; a receiver's velocities with the part of an estimated arm whose swing they do not show, among their states.

    It is as long as the arm may be, along each axis; `askew`, scale factors and misalignments of the gyros, adds to it. With
    `known`, of an arm that is known as well, where its swing is large enough to be seen in a row's noise. With `late`, a delay that
    is estimated shows the slow swing of an earlier moment; with `shaken`, all of the swing.
    """
    return [_smoothed(s, record, askew, known, late, shaken) if s.name == VELOCITIES else s for s in aiding]


def _smoothed(source: Aiding, record: ImuRecord, askew: float, known: bool, late: bool, shaken: bool) -> Aiding:
    estimated = source.states.get("lever arm")
    known = known and bool(source.lever_arm.any())
    late = (late or shaken) and is_swung_late(source)
    if estimated is None and not (known or late):
        return source
    _, quick = _quick(record, source.time)
    middle = record.time - 0.5 * record.steps
    earlier = (shaken_rates if shaken else slow_rates)(record) if late else None
    at = [np.zeros_like(quick)] * 2 if earlier is None else [_at(middle, of, source.time) for of in earlier]
    kind = SHAKEN_VELOCITY if late and shaken else SMOOTHED_VELOCITY
    shown = replace(source, kind=kind, measured=np.hstack([source.measured, quick, *at]))
    if estimated is None:
        swings = np.linalg.norm(np.cross(quick, source.lever_arm), axis=1)
        if not known or math.sqrt(float(np.mean(swings**2))) < SEEN * float(np.nanmedian(source.sigma)):
            return shown if late else source
    arm = np.hypot(source.lever_arm, 0.0 if estimated is None else estimated.sigma)
    unseen = Group(UNSEEN_ARM, unseen_sigma(arm, askew), unit="m")
    return replace(shown, states={**source.states, "filter": unseen})


def is_swung_late(source: Aiding) -> bool:
    """Whether a source has a delay that is estimated, and an arm on which it swings."""
    return "lag" in source.states and (bool(source.lever_arm.any()) or "lever arm" in source.states)


def _quick(record: ImuRecord, time: Array) -> tuple[Array, Array]:
    """(M, 3) rates at a receiver's times, and what is quick of them, rad/s.

    Two means of two such times each: .4 of what comes each fourth of them is slow, nothing each second, less than .05 beyond.
    """
    return _quick_at(record, np.asarray(time, dtype=np.float64).tobytes())


@remembered
def _quick_at(record: ImuRecord, times: bytes) -> tuple[Array, Array]:
    """The same; most passes ask at the times of the one before."""
    time = np.frombuffer(times)
    half = _filters(time)
    middle, rates, means = _rates(record, half)
    now = _at(middle, rates, time)
    return now, now - _means(record, means, time, half)


def _at(middle: Array, values: Array, time: Array) -> Array:
    """(M, 3) values (N, 3) of rows' middles at some times."""
    return np.stack([np.interp(time, middle, column) for column in values.T], axis=1)


@remembered
def _rates(record: ImuRecord, half: float) -> tuple[Array, Array, Array]:
    """Middles of the rows (N,), s, their rates (N, 3), rad/s, and means of these over twice `half`, s: each pass asks for them."""
    rates, middle = increments(record)[0] / record.steps[:, None], record.time - 0.5 * record.steps
    return middle, rates, _means(record, rates, middle, half)


@remembered
def slow_rates(record: ImuRecord) -> tuple[Array, Array]:
    """(N, 3) what is slow of the rates of the rows, rad/s, and how it changes, rad/s^2.

    Four means of a second each, and those of what they have left out: of a tone of 1 s and less hardly a thousandth is left, of
    1.5 s .06, of 3 s .7, of 6 s .97. Of quick shakes little may be left: their accelerations are tens of times those of a vehicle.
    """
    middle, rest, _ = _rates(record, 0.5 * SMOOTHED)
    slow = np.zeros_like(rest)
    for _ in range(2):
        part = rest
        for _ in range(4):
            part = _means(record, part, middle, 0.5 * SMOOTHED)
        slow, rest = slow + part, rest - part
    return slow, np.gradient(slow, middle, axis=0) if len(middle) > 1 else np.zeros_like(slow)


@remembered
def shaken_rates(record: ImuRecord) -> tuple[Array, Array, Array]:
    """(N, 3) rates of the rows, rad/s, how they change, rad/s^2, and specific forces, m/s^2, without what no receiver shows."""
    middle = record.time - 0.5 * record.steps
    both = np.hstack(increments(record)) / record.steps[:, None]
    means = _means(record, both, middle, 0.5 * SHAKEN)
    rates, forces = means[:, :3], means[:, 3:]
    return rates, np.gradient(rates, middle, axis=0) if len(middle) > 1 else np.zeros_like(rates), forces


def _filters(time: Array) -> float:
    """Over how long a receiver of these times may take a mean, s."""
    return min(SMOOTHED, float(np.median(np.diff(np.sort(time))))) if len(time) > 1 else SMOOTHED


def _means(record: ImuRecord, values: Array, time: Array, half: float) -> Array:
    """(M, m) of values (N, m) of a record's rows, from `half` (s) before to as much after some times."""
    sums = np.vstack([np.zeros(values.shape[1]), np.cumsum(values, axis=0)])
    begin, end = (np.searchsorted(record.time, time + side) for side in (-half, half))
    return np.asarray((sums[end] - sums[begin]) / np.maximum(end - begin, 1)[:, None])
