"""Seat, arm and sensors of a slave turned alike: what no motion shows, and what a filter must not think that it knows.

Turn gyros, accelerometers, lever arm and mounting together by `s` (slave axes): ``M_g = M_a = [s x]``, ``dr = -s x r``,
``mu = C_mb s``, ``phi = C s``. Nothing that the master or the slave measures changes. What is known of `s` is what was said of
each before:

    information   sum of squares of derivatives of (M_g, M_a, mu, r), each by its sigma

for a consumer IMU (30 arcmin each) .25 deg. A filter whose columns turn with what it learns takes that turning for knowledge: its
sigma of heading was .13 deg, and its answer six of these off. Where a loop is closed (:mod:`truenorth.alignment.transfer_nominal`)
its columns turn. So the answer is brought back to where the prior is likeliest along
`s`, which is where a consistent filter would have left it: ``s = -K x`` of what the filter found of these states. What it says of
everything else stands, of that along `s` the prior: with `N` the change of all states by `s`,

    P = (1 - N K) P (1 - N K)' + N information^-1 N'

(the difference of the turns of gyros and accelerometers, say, is known to some 10 arcmin, and moves the likeliest `s` too).

Source of the defect, and of the remedy's idea: G. Huang, A. Mourikis, S. Roumeliotis, "Observability-based rules for designing
consistent EKF SLAM estimators", Int. J. Robotics Research 29 (2010). The projection onto the prior is ours.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.transfer_filter import Assumed, axes_along
from truenorth.core.attitude import dcm_from_rotation_vector, rotation_vector_from_dcm, skew
from truenorth.errors.master import ARM, MOUNTING, TransferModel
from truenorth.state.layout import ACCEL_AXES, BA, GYRO_AXES, PHI
from truenorth.state.track import Track

Array = NDArray[np.float64]

# (9, 3): elements of [s x] by rows
TURNED = np.stack([skew(e).ravel() for e in np.eye(3)], axis=1)


def as_said_together(track: Track, model: TransferModel, said: Assumed, seats: bool) -> Track:
    """The track with what only the prior says left to the prior; the same one where something shows it.

    Parameters
    ----------
    said : Assumed
        Besides which the states stand.
    seats : bool
        Attitude is matched: the mounting must be a state then.
    """
    groups, at = model.groups, track.layout.slice_of
    if not {GYRO_AXES, ACCEL_AXES, ARM} <= groups.keys() or (seats and MOUNTING not in groups):
        return track
    last, C_mb = track.sensors[-1], axes_along(track, said)[-1]
    arm = said.lever_arm + last[at(ARM)]
    terms = [(name, TURNED, last[at(name)], groups[name].sigma) for name in (GYRO_AXES, ACCEL_AXES)]
    terms.append((ARM, skew(arm), arm - said.lever_arm, np.full(3, said.lever_arm_sigma)))
    if MOUNTING in groups:
        off = rotation_vector_from_dcm(C_mb @ said.C_mb.T)
        terms.append((MOUNTING, C_mb, off, np.full(3, said.mounting_sigma)))
    if any(np.any(J[sigma == 0.0]) for _, J, _, sigma in terms):
        return track  # one of them cannot turn
    weights = [np.where(sigma > 0.0, 1.0 / np.where(sigma > 0.0, sigma, 1.0) ** 2, 0.0) for *_, sigma in terms]
    information = np.sum([J.T @ (J * w[:, None]) for (_, J, _, _), w in zip(terms, weights, strict=True)], axis=0)
    variance = np.asarray(np.linalg.inv(information), dtype=np.float64)
    K, s = np.zeros((3, model.states)), np.zeros(3)
    for (name, J, x, _), w in zip(terms, weights, strict=True):
        own = variance @ (J * w[:, None]).T
        K[:, at(name)] = own
        s -= own @ x
    return _turned(track, model, said, s, variance, K)


def _turned(track: Track, model: TransferModel, assumed: Assumed, s: Array, variance: Array, K: Array) -> Track:
    """A track whose seat, arm and sensors are turned by s, slave axes, and known together as by this covariance.

    `K` (3, n) is what of an error of the states the choice of s takes as a turn.
    """
    at = {name: track.layout.slice_of(name) for name in (GYRO_AXES, ACCEL_AXES, ARM, MOUNTING)}
    C_mb, force = axes_along(track, assumed), np.array(model.groups[ACCEL_AXES].figures)
    N = np.zeros((len(track), model.states, 3))
    N[:, PHI], N[:, BA] = track.C_nb, -skew(force)
    for name in (GYRO_AXES, ACCEL_AXES):
        N[:, at[name]] = TURNED
    N[:, at[ARM]] = skew(assumed.lever_arm + track.sensors[:, at[ARM]])
    sensors = track.sensors.copy()
    if at[MOUNTING] is not None:
        N[:, at[MOUNTING]] = C_mb
        turned = dcm_from_rotation_vector(C_mb @ s) @ C_mb
        sensors[:, at[MOUNTING]] = rotation_vector_from_dcm(turned @ assumed.C_mb.T)
    for name in (GYRO_AXES, ACCEL_AXES, ARM):
        sensors[:, at[name]] += N[:, at[name]] @ s
    sensors[:, BA] += N[:, BA] @ s
    left = np.eye(model.states) - N @ K
    P = left @ track.P @ np.swapaxes(left, 1, 2) + N @ variance @ np.swapaxes(N, 1, 2)
    return replace(track, C_nb=track.C_nb @ dcm_from_rotation_vector(s), sensors=sensors, P=P)
