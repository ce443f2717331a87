"""Columns of delay and lever arm in rows of velocity, of which the noise of a slave's sensors is no knowledge.

A vehicle that flies along its own forward axis at a speed `v` has ``a = v d(C e)/dt``: in all its turns a delay of the master and
an arm forward ``v`` times as long are one. What parts them in a filter is then the noise of their columns. Over K rows of noise
`sigma` its squares count as so much information on each,

    N_arm = 2 K s_w^2 / sigma^2,    N_delay = K (2 |r|^2 s_w'^2 + 3 s_f^2) / sigma^2

with `s` of a component of rate, spin and force. It is of nothing, and moves the answer besides: where N is as large as what is
known, an answer is ``1 + N / known`` of its sigmas off. A consumer slave on an aircraft had three times as much.

So a column is replaced by what is expected of it where that noise is known of (regression calibration): with ``G = sum H' H /
sigma^2`` over the log, noise included,

    H_calibrated = H (1 - G^-1 N)

whose squares are what its noise leaves of the motion's, direction by direction: of a delay with an arm that undoes it, nothing.
Columns are means over `h` before and after a row with weights of a triangle, both the same one, in n:

    delay   mean of C f - corrections - C'' r,      arm   mean of C'

Where a seat bends, and its end by another coupling than is assumed, columns have as much of its motion as noise.

`h` is that with which the calibrated columns know most. What the gyros' noise in such a mean has in common with that of the rate in
the row itself is taken off.

Sources: W. Fuller, "Measurement error models" (1987), chapters 1 and 2; R. Carroll, D. Ruppert, L. Stefanski, C. Crainiceanu,
"Measurement error in nonlinear models", 2nd ed. (2006), chapter 4 (regression calibration). The means are ours.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.transfer_bending import Bend
from truenorth.alignment.transfer_nominal import Carried
from truenorth.alignment.transfer_turns import HALVES, INSTANT
from truenorth.core.attitude import dcm_from_quaternion, skew
from truenorth.core.earth import earth_rate_n, gravity_n, transport_rate_n
from truenorth.errors.master import ARM, DELAY, FILTER, TransferModel
from truenorth.records import ImuRecord
from truenorth.state.layout import ACCEL_AXES, BA
from truenorth.state.track import Track
from truenorth.strapdown.increments import increments, interval_lengths

Array = NDArray[np.float64]
Integers = NDArray[np.intp]

SMALL = 0.1  # of what is known: less noise of the columns of the instant is left as it is
# Variances of the instant (`describe_instant`) by those of a sample's rate: of the rate in columns of the arm, of the spin by T^2;
# of a sample's force.
OTHER_NOISE, SPIN_NOISE, FORCE_NOISE = 0.4, 0.25, 0.25


@dataclass(frozen=True)
class Columns:
    """What delay and arm do to a master's velocity, (M,) rows, n; NaN where a log is too short before or after a row."""

    push: Array  # (M, 3) m/s^2: the master's acceleration
    of: Array  # (M, 3, 4) of the delay, m/s^2, and of the arm, 1/s, calibrated
    common: Array  # (M, 3, 4): ``C [w x]`` of the instant times that is in them, as far as its noise is the same


def columns_along(
    slave: ImuRecord,
    track: Track,
    carried: Carried,
    model: TransferModel,
    held: Array,
    assumed: tuple[Array, float, float],
    sigma: float,
    calibrated: bool,
    bend: Bend | None = None,
) -> Columns | None:
    """Columns about the motion that a pass has found; None where those of the instant have little noise.

    Parameters
    ----------
    carried : Carried
        The attitude along it.
    held : (M,) array, s
        When a master's rows held.
    assumed : (3,) array, float, float
        Lever arm, m, its sigma, and that of the delay, s: before the log.
    sigma : float, m/s
        Noise of a row.
    calibrated : bool
        Whether the pass was made with such columns: then none of what it knows is noise.
    bend : Bend, optional
        How its seat bends.
    """
    arm, arm_sigma, delay_sigma = assumed
    P, at = track.P[-1], track.layout.slice_of(ARM)
    arm = arm + (0.0 if at is None else track.sensors[-1, at])
    reach = float(arm @ arm) + (0.0 if at is None else float(np.trace(P[at, at])))
    T, which = _places(track)
    prior = np.array([math.hypot(delay_sigma, model.filter[0]), arm_sigma, arm_sigma, arm_sigma])[which]
    known = np.linalg.inv(T @ P @ T.T / np.outer(prior, prior))
    step, walk, push = slave.interval, model.gyro_random_walk**2, model.accel_random_walk**2

    means = Means(slave, track, carried, held, arm, bend)

    def noise(rate: float, spin: float, force: float, half: float) -> Array:
        """(n,) information of columns of noise on delay and arm, by that before the log; variances of a component."""
        push, turn = means.unsure(half)
        of = len(track) / sigma**2 * np.array([2.0 * reach * spin + 3.0 * force + push, *[2.0 * rate + turn] * 3])
        return np.asarray(of[which] * prior**2)

    of_instant = noise(OTHER_NOISE * walk / step, SPIN_NOISE * walk / step**3, FORCE_NOISE * push / step, step)
    known = _at_least_one(known if calibrated else known - np.diag(of_instant))
    halves = [half for half in HALVES if half > 2.0 * step]
    false = np.linalg.eigvalsh(np.sqrt(of_instant)[:, None] * np.linalg.inv(known) * np.sqrt(of_instant))
    if np.max(false, initial=0.0) <= SMALL or not halves:
        return None
    best, most = None, -np.inf
    for half in halves:
        force, of, common = means.over(half)
        usable = np.isfinite(common)
        H = of[usable][:, :, which].reshape(-1, len(which)) * prior / sigma
        # Of weights of a triangle without what the instant has in common with them, and of their slope.
        own, tied = 2.0 / (3.0 * half), step / (INSTANT * half)
        N = noise(walk * (own - tied / half) / (1.0 - tied) ** 2, 2.0 * walk / half**3, push * own, half)
        A, knows = _calibrated(H.T @ H, N)
        if knows > most:
            whole = np.zeros((4, 4))
            whole[np.ix_(which, which)] = prior[:, None] * A / prior
            of[:, :, 1:] *= (1.0 + common)[:, None, None]
            most, best = knows, Columns(force, of @ whole, common[:, None, None] * whole[1:])
    return best


def _places(track: Track) -> tuple[Array, Integers]:
    """(k, n) which states make the delay of a velocity and the arm, and which of (delay, arm) there are.

    A velocity that went through a filter is late by what that delays it, too.
    """
    T = np.zeros((4, track.P.shape[-1]))
    for name, own in ((DELAY, slice(0, 1)), (ARM, slice(1, 4))):
        if (at := track.layout.slice_of(name)) is not None:
            T[own, at] = np.eye(at.stop - at.start)
    if (at := track.layout.slice_of(FILTER)) is not None:
        T[0, at.start] = T[0].any()
    which = np.flatnonzero(T.any(axis=1))
    return T[which], which


def _at_least_one(information: Array) -> Array:
    size, axes = np.linalg.eigh(information)
    return np.asarray((axes * np.maximum(size, 1.0)) @ axes.T)


def _calibrated(G: Array, N: Array) -> tuple[Array, float]:
    """``1 - G^-1 N`` of information G (n, n), N (n,) of it noise, and the logarithm of what the columns know then."""
    root = np.sqrt(np.maximum(N, 1e-300))
    size, axes = np.linalg.eigh(G / np.outer(root, root))
    share = np.maximum(1.0 - 1.0 / np.maximum(size, 1e-300), 0.0)
    A = (axes * share) @ axes.T / root[:, None] * root
    return A, float(np.linalg.slogdet(np.eye(len(N)) + A.T @ G @ A)[1])


class Means:
    """The master's acceleration and the columns of the arm as means about its rows, of the motion that a pass has found."""

    def __init__(
        self, slave: ImuRecord, track: Track, carried: Carried, held: Array, arm: Array, bend: Bend | None = None
    ) -> None:
        steps = interval_lengths(slave)
        self.slave, self.held = slave, held
        self.knots = np.append(slave.time[0] - steps[0], slave.time)
        C = dcm_from_quaternion(carried.q)  # in the axes of the body at the beginning
        middle = 0.5 * (C[1:] + C[:-1])
        velocity = _summed((middle @ _forces(slave, track, steps)[..., None])[..., 0])
        chord = C if bend is None else bend.turned(C)  # of the arm
        self.turned = _summed(0.5 * (chord[1:] + chord[:-1]) * steps[:, None, None])
        self.moved = _summed(0.5 * (velocity[1:] + velocity[:-1]) * steps[:, None]) - chord @ arm  # of the master
        row = np.clip(np.searchsorted(track.time, held), 0, len(track) - 1)
        lat, alt, v = track.position[row, 0], track.position[row, 2], track.v_n[row]
        self.bent: Array | None = None
        if bend is not None:  # where it holds the end, and how the chord turns, by as much as the coupling may be off
            self.bent, self.chord = np.cross(bend.unsure, arm), _summed(bend.unsure[1:] * steps[:, None])
        self.into_n = carried.C_n0[row]
        self.of_earth = skew(earth_rate_n(lat)) @ carried.C_nb[row]
        self.corrections = gravity_n(lat, alt) - np.cross(2.0 * earth_rate_n(lat) + transport_rate_n(lat, alt, v), v)

    def over(self, half: float) -> tuple[Array, Array, Array]:
        """Acceleration (M, 3), columns of delay and arm (M, 3, 4), n, and how much of the instant is in these (M,)."""
        # Towards the ends of the log means are shorter.
        span = np.minimum(half, np.minimum(self.held - self.knots[0], self.knots[-1] - self.held))
        span = np.where(span < HALVES[0], np.nan, span)
        force = self._slope(self.moved, span)
        push = (self.into_n @ force[..., None])[..., 0] + self.corrections
        of_arm = self.into_n @ self._slope(self.turned, span) - self.of_earth
        common = self.slave.interval / (INSTANT * span)
        common = common / (1.0 - common)
        return push, np.concatenate([push[..., None], of_arm], axis=2), common

    def unsure(self, half: float) -> tuple[float, float]:
        """Mean squares of what a coupling that is off puts into acceleration, m^2/s^4, and into the columns of the arm, 1/s^2."""
        if self.bent is None:
            return 0.0, 0.0
        span = np.full(len(self.held), half)
        of = (self._slope(values, span) for values in (self.bent, self.chord))
        push, turn = (float(np.mean(np.sum(values**2, axis=1))) for values in of)
        return push, turn

    def held_at(self, shift: float, half: float, bent: bool = False) -> Array:
        """(M, 3) the master's specific force so long after its rows, n, means; NaN beyond the log.

        Or (`bent`) what a coupling that is off makes of it.
        """
        there, whole = self.held + shift, self.bent if bent else self.moved
        if whole is None:
            return np.zeros((len(there), 3))
        span = np.where((there - half >= self.knots[0]) & (there + half <= self.knots[-1]), half, np.nan)
        force = self._slope(whole, span, shift)
        return np.asarray((self.into_n @ force[..., None])[..., 0])

    def _slope(self, whole: Array, span: Array, after: float = 0.0) -> Array:
        """Mean slope, so long after the rows, of what this is the integral of, by a triangle's weights: a second difference."""
        flat, far = whole.reshape(len(whole), -1), np.nan_to_num(span)
        late, now, early = (self._at(self.held + after + shift, flat) for shift in (far, 0.0, -far))
        return np.asarray((late - 2.0 * now + early) / span[:, None] ** 2).reshape(len(span), *whole.shape[1:])

    def _at(self, time: Array, flat: Array) -> Array:
        """(M, c) columns (N, c) of the knots at times (M,), along straight lines: all columns by one search."""
        k = np.clip(np.searchsorted(self.knots, time, side="right") - 1, 0, len(self.knots) - 2)
        behind = np.clip(time, self.knots[0], self.knots[-1]) - self.knots[k]
        slope = (flat[k + 1] - flat[k]) / (self.knots[k + 1] - self.knots[k])[:, None]
        return np.asarray(slope * behind[:, None] + flat[k])


def _forces(slave: ImuRecord, track: Track, steps: Array) -> Array:
    """(N, 3) increments of velocity, body axes, without what is found of the accelerometers."""
    dvel = increments(slave)[1] - track.sensors[-1, BA] * steps[:, None]
    axes = track.layout.slice_of(ACCEL_AXES)
    return dvel if axes is None else np.asarray(dvel - dvel @ track.sensors[-1, axes].reshape(3, 3).T)


def _summed(parts: Array) -> Array:
    return np.concatenate([np.zeros((1, *parts.shape[1:])), np.cumsum(parts, axis=0)])
