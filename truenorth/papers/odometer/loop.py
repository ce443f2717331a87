"""The paper's model in a closed loop, with any of the nonlinear filters: mechanised at 100 Hz, filtered and corrected at 1 Hz."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from truenorth.core.attitude import dcm_from_quaternion, misalignment, quaternion_from_dcm, skew
from truenorth.filters import (
    Estimates,
    Gate,
    NonlinearSystem,
    StrongTracking,
    cubature,
    extended,
    gauss_hermite,
    unscented,
)
from truenorth.filters.system import FilterState
from truenorth.models import in_motion_azimuth as model
from truenorth.models.in_motion_azimuth import AZIMUTH, BA, BG, DK, DP, DV, PHI, STATES
from truenorth.papers.odometer.mechanisation import mechanise_interval
from truenorth.papers.odometer.scenario import Drives
from truenorth.strapdown import wander

Array = NDArray[np.float64]
Filter = Callable[..., Estimates]

R_SIGMA = 0.02  # m, of a displacement over a second: the paper's pulse
LEVEL_SIGMA = np.radians(0.2)
VELOCITY_SIGMA = 0.05  # m/s, at a start from rest
POSITION_SIGMA = 1.0  # m
LOST = 0.5  # rad of tilt, by which the model has lost its meaning and the run is given up
CAP = 1.2  # of the factor of sgkf3_capped
GATE = Gate(0.9999, by="epoch", patience=20)


@dataclass(frozen=True)
class Method:
    """A filter with its options.

    Attributes
    ----------
    run : callable
        ``run(system, state, gate) -> Estimates``.
    tracking : bool
        Its adaptation begins with the factor of strong tracking.
    """

    run: Callable[[NonlinearSystem, FilterState | None, Gate | None], Estimates]
    tracking: bool = False


def _reduced(order: int, tracking: StrongTracking | None = None) -> Method:
    return Method(
        lambda system, state, gate: gauss_hermite(
            system, state, order=order, nonlinear=[AZIMUTH], tracking=tracking, gate=gate, innovations=True
        ),
        tracking=tracking is not None,
    )


METHODS = {
    "ekf": Method(lambda system, state, gate: extended(system, state, gate=gate)),
    "ukf": Method(
        lambda system, state, gate: unscented(system, state, alpha=1.0, beta=0.0, kappa=3.0 - STATES, gate=gate)
    ),
    "ckf": Method(lambda system, state, gate: cubature(system, state, gate=gate)),
    "gh3": _reduced(3),
    "gh5": _reduced(5),
    "gh7": _reduced(7),
    "sgkf3": _reduced(3, StrongTracking()),
    "sgkf7": _reduced(7, StrongTracking()),
    "sgkf3_capped": _reduced(3, StrongTracking(cap=CAP)),
}


@dataclass(frozen=True)
class Belief:
    """What a filter of the study believes, as factors on its covariances.

    Attributes
    ----------
    P0, Q, R : float
    """

    P0: float = 1.0
    Q: float = 1.0
    R: float = 1.0


@dataclass(frozen=True)
class Errors:
    """Errors of B runs at K epochs, and the filter's own sigmas.

    Attributes
    ----------
    time : (K,) array, s
    phi, velocity, gyro_bias, accel_bias : (B, K, 3) arrays, rad, m/s, rad/s, m/s^2
        Of phi the whole rotation vector, East, North, Up.
    sigma : (B, K, 3) array, rad
        Of phi.
    C_nb : (B, 3, 3) array
        Computed attitude at the last epoch.
    lost : (B,) array of bool
        Given up: a tilt beyond half a radian, where the model has no meaning.
    acted : (B,) array
        Share of the epochs in which a factor of strong tracking was above 1.
    """

    time: Array
    phi: Array
    velocity: Array
    gyro_bias: Array
    accel_bias: Array
    sigma: Array
    C_nb: Array
    lost: NDArray[np.bool_]
    acted: Array


NOMINAL = Belief()


def run_method(
    drives: Drives,
    which: NDArray[np.int64],
    phi0: Array,
    azimuth_sigma: Array,
    method: str,
    gated: bool = False,
    turned: bool = True,
    belief: Belief = NOMINAL,
    begin: int = 0,
) -> Errors:
    """Align B runs.

    Parameters
    ----------
    drives : Drives
    which : (B,) array of int
        The log of each.
    phi0 : (B, 3) array, rad
        Tilts and azimuth by which each begins off.
    azimuth_sigma : (B,) array, rad
        What the filter is told of that.
    method : str
        A key of `METHODS`.
    gated : bool
        Judge each epoch by its normalised innovation squared.
    turned : bool
        Turn the covariance of velocity with a correction of the azimuth; see
        :func:`truenorth.models.in_motion_azimuth.after_correction`.
    belief : Belief
    begin : int
        Epoch to begin at, on the move: its velocity is then the odometer's, turned by the attitude that is off.
    """
    B, epochs = len(which), len(drives.time)
    x0 = np.zeros((B, STATES))
    x0[:, PHI] = phi0
    off, v = _off(x0), drives.v_n[begin]
    s = np.stack([wander.state_at(C @ drives.C_nb[begin], C @ v, *drives.places[begin]) for C in off])
    first = drives.rows[begin]
    s[:, wander.LAST_ANGLE] = 2.0 * drives.dtheta[which, first] - drives.dtheta[which, first + 1]
    s[:, wander.LAST_VELOCITY] = 2.0 * drives.dvel[which, first] - drives.dvel[which, first + 1]
    spec = drives.spec
    sigma = np.zeros(STATES)
    sigma[PHI], sigma[DV], sigma[DP] = LEVEL_SIGMA, VELOCITY_SIGMA, POSITION_SIGMA
    sigma[BG], sigma[BA], sigma[DK] = spec.gyro_bias, spec.accel_bias, drives.scale_sigma
    P = np.tile(np.diag(sigma**2), (B, 1, 1))
    P[:, AZIMUTH, AZIMUTH] = azimuth_sigma**2
    J = np.eye(STATES)
    J[DV, PHI] = skew(v)  # dv = C v - v = v x phi
    P = belief.P0 * (J @ P @ J.T)
    noise = np.zeros(STATES)
    noise[PHI], noise[DV] = spec.gyro_random_walk**2, spec.accel_random_walk**2
    start = P.copy()
    p, z, errors = np.zeros((B, model.PARAMETERS)), np.zeros((B, 3)), np.zeros((B, 7))
    kept = {name: np.empty((B, epochs, 3)) for name in ("phi", "velocity", "gyro_bias", "accel_bias", "sigma")}
    lost = np.zeros(B, dtype=bool)
    gate, state = GATE if gated else None, None
    system: NonlinearSystem | None = None
    acted = np.zeros(B)
    for k in range(begin, epochs):
        ends = drives.rows[k : k + 2]
        mechanise_interval(
            drives.steps, drives.dtheta, drives.dvel, drives.wheel, which, ends[0], ends[1], errors, s, p, z
        )
        if system is None:
            system = NonlinearSystem(
                model.transition,
                model.measurement,
                Q=belief.Q * np.diag(noise * p[0, model.T])[None],
                R=belief.R * R_SIGMA**2 * np.eye(3)[None],
                z=z[:, None, :],
                x0=np.zeros(STATES),
                P0=P,
                p=p[:, None, :],
                transition_jacobian=model.transition_jacobian,
                measurement_jacobian=model.measurement_jacobian,
            )
        else:
            system = replace(system, z=z[:, None, :], p=p[:, None, :])
        found = METHODS[method].run(system, state, gate)
        if METHODS[method].tracking:
            acted += found.adaptation[:, -1, 0] > 1.0
        x = found.x[:, -1]
        P = model.after_correction(x, found.P[:, -1], velocity=turned)
        gone = ~(np.all(np.isfinite(x), axis=1) & (np.abs(x[:, :2]).max(axis=1) < LOST))
        gone |= ~(np.einsum("bii->bi", P)[:, :2].max(axis=1) < LOST**2)
        lost |= gone
        x[gone], P[gone] = 0.0, start[gone]
        C = model.correction(x) @ dcm_from_quaternion(s[:, wander.ATTITUDE])
        s[:, wander.ATTITUDE] = quaternion_from_dcm(C)
        s[:, wander.VELOCITY] -= x[:, DV]
        for b in range(B):
            wander.displace(s[b], -x[b, DP.start], -x[b, DP.start + 1], -x[b, DP.start + 2])
        errors[:, :3] += x[:, BG]
        errors[:, 3:6] += x[:, BA]
        errors[:, 6] += x[:, DK]
        state = FilterState(np.zeros((B, STATES)), P, found.state.log_likelihood, found.state.memory)
        C_nb, v_n, _, _ = wander.north(s)
        kept["phi"][:, k] = misalignment(C_nb, drives.C_nb[k + 1])
        kept["velocity"][:, k] = v_n - drives.v_n[k + 1]
        kept["gyro_bias"][:, k] = errors[:, :3] - drives.gyro_bias[which]
        kept["accel_bias"][:, k] = errors[:, 3:6] - drives.accel_bias[which]
        kept["sigma"][:, k] = np.sqrt(np.einsum("bii->bi", P)[:, PHI])
    kept = {name: values[:, begin:] for name, values in kept.items()}
    return Errors(drives.time[begin:], C_nb=C_nb, lost=lost, acted=acted / (epochs - begin), **kept)


def _off(x: Array) -> Array:
    """``C_n^n'`` of errors: what turns the true attitude into the computed one."""
    return np.swapaxes(model.correction(x), 1, 2)
