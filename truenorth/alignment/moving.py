"""What an alignment on the move knows besides attitude: velocity, place, and how the wheel sits."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from truenorth.core.attitude import dcm_from_rotation_vector, euler_from_dcm
from truenorth.core.earth import EARTH_RATE, radii
from truenorth.core.position import eastward
from truenorth.errors.axes import standing
from truenorth.state.layout import ACCEL_AXES, BA, BG, DP, DV, GYRO_AXES, PHI, SLOW_ACCEL, SLOW_GYRO, STATES

if TYPE_CHECKING:
    from truenorth.state.track import Track

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Wheel:
    """How the odometer, or the velocity log, was found to sit and to count.

    Attributes
    ----------
    C_mb : (3, 3) array
        IMU body to vehicle axes.
    angle_sigma : (2,) array, rad
        Of its pitch and yaw.
    scale, scale_sigma : float
        Relative error of what it counts.
    lever_arm, lever_arm_sigma : (3,) arrays, m
        IMU to wheel, body axes.
    sensor : {"odometer", "velocity log"}
    """

    C_mb: Array
    angle_sigma: Array
    scale: float
    scale_sigma: float
    lever_arm: Array
    lever_arm_sigma: Array
    sensor: str = "odometer"


@dataclass(frozen=True)
class Moving:
    """The rest of the state at the alignment's epoch.

    Attributes
    ----------
    v_n : (3,) array, m/s
    P : (15 + m, 15 + m) array
        Covariance of phi, dv, dp, gyro and accelerometer bias (:mod:`truenorth.errors.ins`), and of `known` behind them.
    distance : float, m
        Travelled.
    heading_from : str
        "the earth's rate" or "motion": what showed the heading.
    rejected : mapping of sensor to (rejected, all) measurements
    wheel : Wheel or None
    vehicle_heading, vehicle_heading_sigma : float, rad
        Of the vehicle's forward axis; the IMU's own where no odometer says how it sits.
    track : Track
        The whole way, each epoch as unsure of heading as the last. What evidence adds to sigma is in `P` alone.
    delays : mapping of sensor to (delay, sigma), s
        By which a sensor's stamps are late, where that was left open and the data show it.
    clocks : mapping of sensor to (rate, sigma), s/s
        By which those delays grow, where the data show it.
    known : mapping of name to (m,) values
        The IMU's scale factors and misalignments (:mod:`truenorth.errors.axes`), and an antenna's arm of which nothing was said,
        where they were estimated. A push on an accelerometer that is askew looks like a tilt, and an arm hides a place: both are
        known together.
    force : (3,) array, m/s^2
        Specific force at rest, body axes: the accelerometers' axes of `known` act on what differs from it.
    acting_bias : (3,) array or None, m/s^2
        What acts as the accelerometers' bias at that force, scale factors and misalignments included: `P` is of it, and navigation
        goes on with it. None: in a result of an earlier version, whose `accel_bias` it is.
    in_body : bool
        No sensor showed velocity or place over the ground: they are off as heading is.
    """

    v_n: Array
    P: Array
    distance: float
    heading_from: str
    rejected: dict[str, tuple[int, int]]
    wheel: Wheel | None
    vehicle_heading: float
    vehicle_heading_sigma: float
    track: Track
    delays: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    clocks: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    known: Mapping[str, Array] = field(default_factory=dict)
    force: Array = field(default_factory=standing)
    acting_bias: Array | None = None
    in_body: bool = False

    def less_sure(self, heading: float, level: float = 0.0, velocity: float = 1.0, position: float = 1.0) -> Moving:
        """The same state with these variances (rad^2) added to heading and level, and sigmas so many times as large.

        What is added is an error of its own. Were velocity all so many times as far off, a log would see heading by the rest.
        """
        P = self.P + heading * np.outer(self.turn, self.turn)
        P[PHI, PHI] += np.diag([level, level, 0.0])
        for part, factor in ((DV, velocity), (DP, position)):
            P[part, part] += np.diag((factor**2 - 1.0) * np.diag(P)[part])
        return replace(self, P=P, vehicle_heading_sigma=math.sqrt(self.vehicle_heading_sigma**2 + heading))

    def off_together(self, phi: Array) -> Moving:
        """The same state with a covariance (3, 3) of its attitude added, rad^2."""
        P = self.P.copy()
        P[PHI, PHI] += phi
        return replace(self, P=P, vehicle_heading_sigma=math.sqrt(self.vehicle_heading_sigma**2 + float(phi[2, 2])))

    def turned(self, heading: float) -> Moving:
        """The same state, heading less sure by this variance (rad^2), where no sensor shows velocity or place in n.

        A wheel shows neither which way it rolls nor which way it came (:func:`off_by_heading`).
        """
        turned = replace(self, in_body=True)
        P = off_by_heading(self.P, heading, turned.turn)
        return replace(turned, P=P, vehicle_heading_sigma=math.sqrt(self.vehicle_heading_sigma**2 + heading))

    @property
    def turn(self) -> Array:
        """(15 + m,) all that a heading error of one radian goes with, to first order."""
        if not self.in_body:
            return np.eye(len(self.P))[PHI.stop - 1]
        last = self.track.position[-1]
        return turning(len(self.P), self.v_n, gone(self.track.position[0], last), self.track.C_nb[-1], last[0])

    def summary(self) -> dict[str, Any]:
        """In datasheet units, ready for JSON."""
        result: dict[str, Any] = {
            "velocity_m_s": self.v_n.tolist(),
            "velocity_sigma_m_s": np.sqrt(np.diag(self.P)[DV]).tolist(),
            "position_sigma_m": np.sqrt(np.diag(self.P)[DP]).tolist(),
            "distance_m": self.distance,
            "heading_from": self.heading_from,
            "rejected": {name: list(counts) for name, counts in self.rejected.items()},
            "vehicle_heading_deg": math.degrees(self.vehicle_heading),
            "vehicle_heading_sigma_deg": math.degrees(self.vehicle_heading_sigma),
            "delays_s": {name: list(delay) for name, delay in self.delays.items()},
            "delays_grow_ppm": {name: [1e6 * rate for rate in rates] for name, rates in self.clocks.items()},
        }
        if self.wheel is not None:
            w = self.wheel
            result |= {
                f"{w.sensor.replace(' ', '_')}_scale": w.scale,
                f"{w.sensor.replace(' ', '_')}_scale_sigma": w.scale_sigma,
                "mounting_C_mb": w.C_mb.tolist(),
                "mounting_deg": [math.degrees(_signed(float(a))) for a in euler_from_dcm(w.C_mb)],
                "mounting_sigma_deg": np.degrees(w.angle_sigma).tolist(),
                "wheel_arm_m": w.lever_arm.tolist(),
                "wheel_arm_sigma_m": w.lever_arm_sigma.tolist(),
            }
        return result


def turning(states: int, v_n: Array, way: Array, C_nb: Array, lat: Array) -> Array:
    """(..., n) all that a heading error of one radian goes with, to first order, where no sensor shows velocity or place in n.

    It turns velocity (..., 3), and the way since the beginning, (..., 2), about the vertical; and gyros are biased by what it makes
    of the earth's rate (:mod:`truenorth.errors.azimuth_free`).
    """
    turn = np.zeros((*np.shape(lat), states))
    turn[..., PHI.stop - 1] = 1.0
    for part, along in ((DV, v_n), (DP, way)):
        turn[..., part.start], turn[..., part.start + 1] = along[..., 1], -along[..., 0]
    turn[..., BG] = -EARTH_RATE * np.cos(lat)[..., None] * C_nb[..., 0, :]
    return turn


def gone(begin: Array, place: Array) -> Array:
    """(..., 2) m; east and north, from the place (3,) where a track begins to places (..., 3) of it."""
    (lat, lon, alt), (lat0, lon0, _) = np.moveaxis(place, -1, 0), begin
    R_M, R_N = radii(0.5 * (lat + lat0))
    return np.stack([(R_N + alt) * np.cos(lat) * eastward(lon, lon0), (R_M + alt) * (lat - lat0)], axis=-1)


def off_by_heading(P: Array, heading: Array | float, turn: Array) -> Array:
    """Covariance (..., n, n) with heading less sure by a variance, rad^2, and all that goes with it.

    Along the tangent (:func:`turning`) all of it goes with the heading error ``h``, whole: to navigation by the same sensors what
    is missing of velocity or bias would be heading seen. Velocity and the way are off by ``sin h`` sideways, by ``1 - cos h``
    backwards. Backwards they go by no heading, of a Gaussian of variance s^2

        E (1 - cos h)^2 = 3/2 - 2 exp(-s^2 / 2) + exp(-2 s^2) / 2

    and a log that shows the speed shows nothing of the way.
    """
    heading = np.asarray(heading)
    whole = P[..., PHI.stop - 1, PHI.stop - 1] + heading
    back = np.maximum(1.5 - 2.0 * np.exp(-0.5 * whole) + 0.5 * np.exp(-2.0 * whole), 0.0)
    found = P + heading[..., None, None] * turn[..., :, None] * turn[..., None, :]
    for part in (DV, DP):
        level = slice(part.start, part.start + 2)
        along = turn[..., level][..., ::-1] * [-1.0, 1.0]
        found[..., level, level] += back[..., None, None] * along[..., :, None] * along[..., None, :]
    return found


def _signed(angle: float) -> float:
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


def fifteen(track: Track, *others: slice) -> Array:
    """(K, 15, 15) covariance of phi, dv, dp and the whole biases, their slow parts included; `others` of the states behind."""
    layout = track.layout
    kept = np.concatenate([np.arange(STATES), *(np.arange(own.start, own.stop) for own in others)])
    M = np.eye(layout.states)[kept]
    for group, slow in ((BG, SLOW_GYRO), (BA, SLOW_ACCEL)):
        own = layout.slice_of(slow)
        if own is not None:
            M[group, own] = np.eye(3)
    return np.asarray(M @ track.P @ M.T)


def handed_on(track: Track, groups: Sequence[str] = (GYRO_AXES, ACCEL_AXES)) -> tuple[Array, dict[str, Array]]:
    """What navigation goes on with at the end of a track: covariance of the fifteen and of groups behind them, their values.

    Parameters
    ----------
    groups : sequence of str
        Those to be handed on, where the track has them.
    """
    found = {name: track.layout.slice_of(name) for name in groups}
    there = {name: own for name, own in found.items() if own is not None}
    return fifteen(track[-1:], *there.values())[0], {name: track.sensors[-1, own] for name, own in there.items()}


def wheel_of(track: Track, sensor: str, C_mb: Array, lever_arm: Array) -> Wheel:
    """How the wheel (or the log) sits after a track, from what was assumed."""
    layout, sensors, sigma = track.layout, track.sensors[-1], track.sigma[-1]
    scale, angles, arm = (layout.slice_of(f"{sensor} {role}") for role in ("scale", "mounting", "lever arm"))
    if angles is not None:
        about_x, about_z = sensors[angles]
        C_mb = dcm_from_rotation_vector(-np.array([about_x, 0.0, about_z])) @ C_mb
    return Wheel(
        C_mb=C_mb,
        angle_sigma=np.zeros(2) if angles is None else sigma[angles],
        scale=0.0 if scale is None else float(sensors[scale.start]),
        scale_sigma=0.0 if scale is None else float(sigma[scale.start]),
        lever_arm=lever_arm if arm is None else lever_arm + sensors[arm],
        lever_arm_sigma=np.zeros(3) if arm is None else sigma[arm],
        sensor=sensor,
    )


def moving_of(
    track: Track,
    distance: float,
    heading_from: str,
    mounting: tuple[str, Array, Array] | None,
    groups: Sequence[str] = (GYRO_AXES, ACCEL_AXES),
) -> Moving:
    """The rest of the state at the end of a track.

    Parameters
    ----------
    mounting : (sensor, C_mb, lever arm), optional
        Of the odometer or log, as assumed.
    groups : sequence of str
        Those to be handed on, where the track has them.
    """
    (P, known), C_nb = handed_on(track, groups), track.C_nb[-1]
    wheel = None if mounting is None else wheel_of(track, *mounting)
    C_mb = np.eye(3) if wheel is None else wheel.C_mb
    forward = C_nb @ C_mb[1]
    variance = P[PHI, PHI][2, 2]
    if wheel is not None:
        # Heading and mounting yaw are correlated: the error of the vehicle's heading is phi_U and what is left of the yaw.
        angles = track.layout.slice_of(f"{wheel.sensor} mounting")
        if angles is not None:
            full = track.P[-1]
            yaw = angles.start + 1
            variance = max(full[2, 2] + full[yaw, yaw] + 2.0 * full[2, yaw], 0.0)
    return Moving(
        v_n=track.v_n[-1],
        P=P,
        distance=distance,
        heading_from=heading_from,
        rejected={r.name: (r.rejected, len(r.time)) for r in track.residuals},
        wheel=wheel,
        vehicle_heading=float(np.arctan2(forward[0], forward[1]) % (2.0 * np.pi)),
        vehicle_heading_sigma=float(np.sqrt(variance)),
        track=track,
        known=known,
    )
