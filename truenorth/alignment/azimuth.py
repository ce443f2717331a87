"""Published filters of a vehicle on the move with an odometer, on one's own log.

====================  ==========================================================================================
method                what it does with the paper's 16 states
====================  ==========================================================================================
ekf, ukf, ckf         extended, unscented and cubature Kalman filter in all states
gh3, gh5, gh7         Gauss-Hermite filter of order 3, 5, 7 with nodes in the azimuth alone
sgkf3, sgkf7          the same with the strong tracking factor; sgkf is sgkf3
====================  ==========================================================================================

They assume that the wheel sits at the IMU, that the vehicle goes where its forward axis points (the mounting is what is given,
known), and that displacements over a second have white noise of 2 cm. Coarse alignment takes the first part of the log and the
filter the rest, so that nothing is used twice. A gate leaves out what contradicts the filter by far, judged before fading.
Gyros must see the earth turn, and the answer is held against the closed loop on the same logs: a filter that begins far off, or
whose factor fires, believes a wrong heading with small innovations.

They are here to be compared: the closed loop with invariant errors of this library needs no nonlinear filter and estimates the
wheel's mounting and lever arm too.

Source: M. Wu, X. Tang, X. Huang, odometer-aided alignment on the move by a strong tracking Gauss-Hermite filter.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.azimuth_filters import METHODS, Begin, Logs, run_loop
from truenorth.coarse.odometer import odometer_alignment
from truenorth.core.attitude import skew
from truenorth.core.earth import EARTH_RATE
from truenorth.core.errors import AlignmentError, UsageError
from truenorth.core.position import Position
from truenorth.errors.in_motion_azimuth import STATES
from truenorth.errors.walks import Walks
from truenorth.records import ImuRecord, OdometerRecord
from truenorth.records.specs import ImuSpec
from truenorth.state.layout import BA, BG, DV, PHI
from truenorth.state.mounting import Mounting
from truenorth.state.prior import prior_covariance
from truenorth.state.state import Start, State
from truenorth.state.track import Track
from truenorth.strapdown.increments import increments
from truenorth.strapdown.inertial import earth_rotation

Array = NDArray[np.float64]

ALIASES = {"sgkf": "sgkf3"}
AZIMUTH_METHODS = (*(name for name in METHODS if not name.endswith("capped")), *ALIASES)
COARSE_TIME, COARSE_PART = 120.0, 0.4  # s, and at most this part of the log, of coarse alignment
LEVEL_SIGMA, HEADING_SIGMA = np.radians(0.2), np.radians(5.0)  # that it leaves, besides the gyros' bias
VELOCITY_SIGMA = 0.1  # m/s


def azimuth_track(
    record: ImuRecord,  # without gaps
    odometer: OdometerRecord | None,
    position: Position,  # at the start
    spec: ImuSpec,
    wheel: Mounting,  # its mounting, scale's sigma and latency are used
    method: str,  # one of `AZIMUTH_METHODS`
) -> tuple[Track, float | None]:
    """Track of a vehicle by one of the published filters, from the end of coarse alignment on.

    With the share of the epochs in which the factor of strong tracking acted; None where there is none.

    Raises
    ------
    UsageError
        No odometer.
    AlignmentError
        The filter left the tilts for which its model holds.
    """
    if odometer is None:
        raise UsageError(f"method {method!r} measures by an odometer; expected an odometer's log")
    C_mb = wheel.C_mb
    dtheta, dvel = (values @ C_mb.T for values in increments(record))
    begin = record.time[0] - record.steps[0]
    edges = np.append(begin, record.time)
    distance = np.interp(edges, odometer.time - wheel.latency, np.cumsum(odometer.distance))
    per_epoch = max(1, round(1.0 / record.interval))
    rows = np.arange(0, len(record) + 1, per_epoch)
    wheel_rows = np.diff(distance)[None]
    logs = Logs(record.steps, dtheta[None], dvel[None], wheel_rows, rows.astype(np.int64), edges[rows[1:]])

    epoch = round(min(COARSE_TIME, COARSE_PART * record.duration) / (per_epoch * record.interval))
    elapsed = float(edges[rows[epoch]] - begin)
    part = record.between(None, record.time[rows[epoch] - 1] + 0.1 * record.interval)
    coarse = odometer_alignment(part, odometer, position, wheel)
    C_n0_b = coarse.C_n0_i @ _turned(dtheta[: rows[epoch]] @ C_mb)
    C_nm = earth_rotation(elapsed, position.lat).T @ C_n0_b @ C_mb.T
    speed = float(np.interp(edges[rows[epoch]], odometer.time - wheel.latency, odometer.speed))
    v_n = C_nm[:, 1] * speed
    by_bias = float(np.sqrt(spec.bias_variance[0])) / (EARTH_RATE * np.cos(position.lat))
    angles = LEVEL_SIGMA, LEVEL_SIGMA, float(np.hypot(HEADING_SIGMA, by_bias))
    P = prior_covariance(angles, VELOCITY_SIGMA, position.sigma, spec.bias_variance, wheel.scale_sigma)
    J = np.eye(STATES)
    J[DV, PHI] = skew(v_n)
    lat, lon, alt = coarse.position[-1]
    start = Start.of(State.at(C_nm, lat, lon, alt, v_n, edges[rows[epoch]]), J @ P @ J.T)
    begin_at = Begin(epoch, [start], Walks.of(spec).density(STATES, PHI, DV, BG, BA))
    name = ALIASES.get(method, method)
    found = run_loop(logs, np.zeros(1, dtype=np.int64), begin_at, name, gated=True)
    if found.lost.any():
        raise AlignmentError(
            f"{record.source}: the filter {method} left a tilt of half a radian, where its model has no meaning: choose another "
            "method"
        )
    acted = float(found.acted[0]) if METHODS[name].tracking else None
    return _of_imu(found.tracks[0], C_mb), acted


def _turned(dtheta: Array) -> Array:
    """``C_ib`` at the end of increments, (3, 3)."""
    from truenorth.strapdown.level import inertial_integrals

    count = len(dtheta)
    return np.asarray(inertial_integrals(dtheta, np.zeros((count, 3)), np.ones(count), [count])[0][-1])


def _of_imu(track: Track, C_mb: Array) -> Track:
    """The track of the IMU: attitude, biases and their covariance from vehicle axes back to its own."""
    T = np.eye(STATES)
    T[BG, BG] = T[BA, BA] = C_mb.T
    return replace(track, C_nb=track.C_nb @ C_mb, sensors=track.sensors @ T.T, P=T @ track.P @ T.T)
