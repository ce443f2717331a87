"""The paper's model on the drives of the study: from starts that are off, and what is left of them against the truth."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.azimuth_filters import NOMINAL, Begin, Belief, Method, run_loop
from truenorth.core.attitude import misalignment, skew
from truenorth.errors import in_motion_azimuth as model
from truenorth.errors.in_motion_azimuth import AZIMUTH, STATES
from truenorth.errors.walks import Walks
from truenorth.papers.errors import AttitudeErrors
from truenorth.papers.odometer.scenario import Drives
from truenorth.state.layout import BA, BG, DV, PHI
from truenorth.state.prior import prior_covariance
from truenorth.state.state import Start, State
from truenorth.state.track import Track

Array = NDArray[np.float64]

LEVEL_SIGMA = np.radians(0.2)
VELOCITY_SIGMA = 0.05  # m/s, at a start from rest
POSITION_SIGMA = 1.0  # m


@dataclass(frozen=True)
class Errors(AttitudeErrors):
    """Errors of B runs at K epochs (B, K, 3), and the filter's own sigmas.

    Attributes
    ----------
    time : (K,) array, s
    velocity, gyro_bias, accel_bias : (B, K, 3) arrays, m/s, rad/s, m/s^2
    C_nb : (B, 3, 3) array
        Computed attitude at the last epoch.
    lost : (B,) array of bool
        Given up: a tilt beyond half a radian, where the model has no meaning.
    acted : (B,) array
        Share of the epochs in which a factor of strong tracking was above 1.
    """

    time: Array
    velocity: Array
    gyro_bias: Array
    accel_bias: Array
    C_nb: Array
    lost: NDArray[np.bool_]
    acted: Array


def run_method(
    drives: Drives,
    which: NDArray[np.int64],
    phi0: Array,
    azimuth_sigma: Array,
    method: str | Method,
    gated: bool = False,
    turned: bool = True,
    belief: Belief = NOMINAL,
    begin: int = 0,
) -> Errors:
    """Align B runs.

    Parameters
    ----------
    which : (B,) array of int
        The log of each.
    phi0 : (B, 3) array, rad
        Tilts and azimuth by which each begins off.
    azimuth_sigma : (B,) array, rad
        What the filter believes of that.
    method, gated, turned, belief
        As :func:`truenorth.alignment.azimuth_filters.run_loop`.
    begin : int
        Epoch to begin at, on the move: its velocity is then the odometer's, turned by the attitude that is off.
    """
    x0 = np.zeros((len(which), STATES))
    x0[:, PHI] = phi0
    off, v = np.swapaxes(model.correction(x0), 1, 2), drives.truth.v_n[begin]
    spec = drives.spec
    P = prior_covariance(LEVEL_SIGMA, VELOCITY_SIGMA, POSITION_SIGMA, spec.constant_variance, drives.scale_sigma)
    P = np.tile(P, (len(which), 1, 1))
    P[:, AZIMUTH, AZIMUTH] = azimuth_sigma**2
    J = np.eye(STATES)
    J[DV, PHI] = skew(v)  # dv = C v - v = v x phi
    C_nb, (lat, lon, alt) = off @ drives.truth.C_nb[begin], drives.truth.position[begin]
    starts = [
        Start.of(State.at(C, lat, lon, alt, v_hat), P0) for C, v_hat, P0 in zip(C_nb, off @ v, J @ P @ J.T, strict=True)
    ]
    start = Begin(begin, starts, Walks.of(spec).density(STATES, PHI, DV, BG, BA))
    found = run_loop(drives.logs, which, start, method, gated=gated, turned=turned, belief=belief)
    truth = drives.truth[begin + 1 :]

    def of_all(part: Callable[[Track], Array]) -> Array:
        return np.stack([part(track) for track in found.tracks])

    computed = of_all(lambda track: track.C_nb)
    return Errors.with_sigma(
        misalignment(computed, truth.C_nb),
        of_all(lambda track: track.sigma[:, PHI]),
        time=drives.time[begin:],
        velocity=of_all(lambda track: track.v_n - truth.v_n),
        gyro_bias=of_all(lambda track: track.gyro_bias) - drives.gyro_bias[which, None],
        accel_bias=of_all(lambda track: track.accel_bias) - drives.accel_bias[which, None],
        C_nb=computed[:, -1],
        lost=found.lost,
        acted=found.acted,
    )
