"""From the records of aiding sensors to measurements for the closed loop."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truenorth.core.attitude import dcm_from_euler
from truenorth.core.errors import UsageError
from truenorth.models.ins import Extra
from truenorth.navigation.aiding import FALSE_REJECTION, Aiding, Role, state
from truenorth.navigation.gnss_frames import check_frames
from truenorth.records import GnssRecord, HeightRecord, OdometerRecord, VelocityRecord

Array = NDArray[np.float64]

POSITION_SIGMA = np.array([3.0, 3.0, 5.0])  # m, of a fix whose receiver says nothing; times the dilution of precision
USER_RANGE = 2.0  # m, of one range, where only dilutions of precision are given
VELOCITY_SIGMA = np.array([0.1, 0.1, 0.2])  # m/s
ODOMETER_SIGMA = 0.05  # m/s, beside the pulses' size
SLIP_SIGMA = 0.1  # m/s, of a wheel sideways and of a body on its springs up and down
LOG_SIGMA = 0.1  # m/s
BARO_SIGMA, BARO_DRIFT, BARO_TIME = 1.0, 10.0, 3600.0  # m, m, s: noise, weather
LONGEST_ARM = 100.0  # m; ships have no longer ones
FASTEST = 10.0  # Hz: faster odometers are averaged, since their errors are not new ten times a second


@dataclass(frozen=True)
class Mounting:
    """How an aiding sensor sits on the vehicle, and how well that is known.

    Attributes
    ----------
    lever_arm : (3,) array, m
        IMU to sensor (antenna, wheel), IMU body axes: right, forward, up.
    lever_arm_sigma : float, m
        0: known; else the arm is estimated.
    C_mb : (3, 3) array
        IMU body to vehicle axes (right, forward, up) for body velocities.
    angle_sigma : float, rad
        Of pitch and yaw of that; 0: known.
    scale_sigma : float
        Of an odometer's or a log's scale factor; 0: known.
    bias_sigma : float, m/s or m
        Of a slow error of a velocity log, a barometer or a receiver's positions; 0: none.
    bias_time : float, s
        Its correlation time.
    latency : float, s
        The measurement is older than its time stamp by this much.
    latency_sigma : float, s
        0: known; else the latency is estimated.
    gate : float
        Probability of rejecting a sound measurement; 0: none is rejected.
    noise : float or None, m/s or m
        One-sigma noise where the record itself does not say; None: a usual value.
    slip : float, m/s
        One-sigma velocity of a wheel sideways and upwards (the non-holonomic constraint).
    """

    lever_arm: Array = field(default_factory=lambda: np.zeros(3))
    lever_arm_sigma: float = 0.0
    C_mb: Array = field(default_factory=lambda: np.eye(3))
    angle_sigma: float = 0.0
    scale_sigma: float = 0.0
    bias_sigma: float = 0.0
    bias_time: float = math.inf
    latency: float = 0.0
    latency_sigma: float = 0.0
    gate: float = FALSE_REJECTION
    noise: float | None = None
    slip: float = SLIP_SIGMA

    def __post_init__(self) -> None:
        arm = np.asarray(self.lever_arm, dtype=np.float64)
        if arm.shape != (3,) or not np.all(np.isfinite(arm)):
            raise UsageError(f"lever arm {self.lever_arm!r}; expected three finite numbers: right, forward, up, metres")
        if np.linalg.norm(arm) > LONGEST_ARM:
            raise UsageError(
                f"lever arm {arm.tolist()} is {np.linalg.norm(arm):.0f} m long; expected metres (right, forward, up): were "
                "centimetres or millimetres handed in?"
            )
        object.__setattr__(self, "lever_arm", arm)

    def states(self, name: str, *roles: Role) -> dict[Role, Extra]:
        """States of those properties that are not known."""
        sigmas: dict[Role, ArrayLike] = {
            "lever arm": np.full(3, self.lever_arm_sigma),
            "mounting": np.full(2, self.angle_sigma),
            "scale": self.scale_sigma,
            "lag": self.latency_sigma,
        }
        found: dict[Role, Extra] = {}
        for role in roles:
            if np.any(np.asarray(sigmas[role]) > 0.0):
                found |= state(name, role, sigmas[role])
        return found


def mounting_angles(heading: float, pitch: float = 0.0, roll: float = 0.0) -> Array:
    """``C_mb`` from where the IMU's axes point on the vehicle: its heading, pitch, roll against the vehicle, rad."""
    return np.asarray(dcm_from_euler(heading, pitch, roll), dtype=np.float64)


def from_gnss(record: GnssRecord, mounting: Mounting, *, heights: bool = True) -> list[Aiding]:
    """Positions and velocities of an antenna.

    Parameters
    ----------
    record : GnssRecord
        Rows of quality 0 (no fix) and 6 (dead reckoning) are left out.
    mounting : Mounting
        Of the antenna.
    heights : bool
        Use heights and vertical velocities.

    Raises
    ------
    DataError
        Velocities that contradict the positions, and how they would fit (see :func:`check_frames`).
    """
    check_frames(record)
    time = record.time - mounting.latency
    sound = np.ones(len(record), dtype=bool) if record.quality is None else ~np.isin(record.quality, (0, 6))
    found = []
    place = record.has_position & sound
    if place.any():
        measured = np.stack([record.lat, record.lon, record.alt], axis=1)
        sigma = _position_sigma(record, POSITION_SIGMA if mounting.noise is None else np.full(3, mounting.noise))
        if not heights:
            measured[:, 2] = np.nan
        states = mounting.states("GNSS", "lever arm", "lag")
        if mounting.bias_sigma > 0.0:
            states |= state("GNSS", "bias", np.full(3, mounting.bias_sigma), mounting.bias_time)
        found.append(
            Aiding(
                "GNSS position",
                "position",
                time[place],
                measured[place],
                sigma[place],
                mounting.lever_arm,
                states=states,
                gate=mounting.gate,
            )
        )
    moving = record.has_velocity & sound
    if moving.any() and record.v_n is not None:
        measured = record.v_n.copy()
        if not heights:
            measured[:, 2] = np.nan
        sigma = _or_default(record.velocity_sigma, VELOCITY_SIGMA, len(record))
        states = mounting.states("GNSS", "lever arm", "lag")
        found.append(
            Aiding(
                "GNSS velocity",
                "velocity",
                time[moving],
                measured[moving],
                sigma[moving],
                mounting.lever_arm,
                states=states,
                gate=mounting.gate,
            )
        )
    return found


def from_odometer(record: OdometerRecord, mounting: Mounting) -> list[Aiding]:
    """Forward speed of a wheel; sideways and upwards it does not move.

    Distances are mean speeds, taken at the middle of their interval. More than ten a second are averaged.

    Parameters
    ----------
    record : OdometerRecord
    mounting : Mounting
        Lever arm: to the wheel, the rear axle where nothing steers it.
        Its noise is that of the speed beside the size of the pulses.
    """
    sigma, slip = ODOMETER_SIGMA if mounting.noise is None else mounting.noise, mounting.slip
    block = max(1, round(record.rate / FASTEST))
    rows = len(record) // block * block
    steps, speed = record.steps[:rows].reshape(-1, block), record.speed[:rows].reshape(-1, block)
    length = steps.sum(axis=1)
    if record.kind == "speed":
        time = record.time[:rows].reshape(-1, block).mean(axis=1)
        forward = speed.mean(axis=1)
    else:
        time = record.time[block - 1 : rows : block] - 0.5 * length
        forward = (speed * steps).sum(axis=1) / length
    counted = 0.0 if record.pulse_size is None else record.pulse_size / np.sqrt(6.0) / length  # two edges, each uniform
    zero = np.zeros_like(forward)
    measured = np.stack([zero, forward, zero], axis=1)
    noise = np.stack([zero + slip, np.hypot(sigma, counted) + zero, zero + slip], axis=1)
    states = mounting.states("odometer", "lever arm", "scale", "mounting", "lag")
    return [
        Aiding(
            "odometer",
            "body velocity",
            time - mounting.latency,
            measured,
            noise,
            mounting.lever_arm,
            mounting.C_mb,
            states,
            mounting.gate,
        )
    ]


def from_velocity(record: VelocityRecord, mounting: Mounting) -> list[Aiding]:
    """A Doppler or electromagnetic log, or any reference velocity."""
    noise = LOG_SIGMA if mounting.noise is None else mounting.noise
    sigma = _or_default(record.sigma, np.full(3, noise), len(record))
    time = record.time - mounting.latency
    if record.frame == "navigation":
        states = mounting.states("velocity log", "lever arm", "lag")
        return [
            Aiding(
                "velocity log",
                "velocity",
                time,
                record.velocity,
                sigma,
                mounting.lever_arm,
                states=states,
                gate=mounting.gate,
            )
        ]
    states = mounting.states("velocity log", "lever arm", "scale", "mounting", "lag")
    if mounting.bias_sigma > 0.0:
        states |= state("velocity log", "bias", np.full(3, mounting.bias_sigma), mounting.bias_time)
    return [
        Aiding(
            "velocity log",
            "body velocity",
            time,
            record.velocity,
            sigma,
            mounting.lever_arm,
            mounting.C_mb,
            states,
            mounting.gate,
        )
    ]


def from_height(record: HeightRecord, mounting: Mounting, loop: float = 0.0) -> list[Aiding]:
    """A barometer: its height is off by the weather, slowly.

    Parameters
    ----------
    record : HeightRecord
    mounting : Mounting
    loop : float, s
        Time constant of the third-order vertical loop; 0: a Kalman gain.

    Raises
    ------
    UsageError
        A time constant that is negative or not finite.
    """
    if not 0.0 <= loop < math.inf:
        raise UsageError(f"vertical loop of {loop} s; expected a time constant above zero, such as 60 s, or 0 for none")
    measured = np.full((len(record), 3), np.nan)
    measured[:, 0] = record.alt
    sigma = np.full((len(record), 3), np.nan)
    noise = BARO_SIGMA if mounting.noise is None else mounting.noise
    sigma[:, 0] = noise if record.sigma is None else np.where(np.isfinite(record.sigma), record.sigma, noise)
    states: dict[Role, Extra] = {}
    if mounting.bias_sigma > 0.0:
        states = state("barometer", "bias", mounting.bias_sigma, mounting.bias_time)
    return [
        Aiding(
            "barometer",
            "height",
            record.time - mounting.latency,
            measured,
            sigma,
            mounting.lever_arm,
            states=states,
            gate=mounting.gate,
            loop=loop,
        )
    ]


def _position_sigma(record: GnssRecord, default: Array) -> Array:
    sigma = _or_default(record.position_sigma, default, len(record))
    if record.position_sigma is None and record.dop is not None:
        # A horizontal dilution is that of both axes together.
        h, v = record.dop[:, :1] / np.sqrt(2.0), record.dop[:, 1:]
        told = USER_RANGE * np.hstack([h, h, v])
        sigma = np.where(np.isfinite(told), told, sigma)
    return sigma


def _or_default(sigma: Array | None, default: Array, rows: int) -> Array:
    if sigma is None:
        return np.tile(default, (rows, 1))
    return np.where(np.isfinite(sigma), sigma, default)
