"""From the records of aiding sensors to measurements for the closed loop."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truenorth.aiding.heading import HEADING
from truenorth.aiding.source import Aiding, Role, state
from truenorth.aiding.wheel import COMPLIANCE, COUNTED_FORWARD, WHEEL
from truenorth.core.errors import UsageError
from truenorth.errors.group import Group
from truenorth.errors.log import DRIFT, NAME, LogErrors
from truenorth.records import GnssRecord, HeightRecord, OdometerRecord, VelocityRecord
from truenorth.records.gnss_frames import check_frames
from truenorth.state.mounting import Mounting

Array = NDArray[np.float64]

POSITION_SIGMA = np.array([3.0, 3.0, 5.0])  # m, of a fix whose receiver says nothing; times the dilution of precision
USER_RANGE = 2.0  # m, of one range, where only dilutions of precision are given
VELOCITY_SIGMA = np.array([0.1, 0.1, 0.2])  # m/s
HEADING_SIGMA = math.radians(1.0)  # of a baseline whose receiver says nothing
ODOMETER_SIGMA = 0.05  # m/s, besides the pulses' size
LOG_SIGMA = 0.1  # m/s
DRIFT_TIME = 3.0 * 3600.0  # s, of a log's drift where nobody knows it: between tides and eddies
UNEVEN = math.radians(3.0)  # pitch of a line of two antennas: who gives its heading says nothing of 5 cm up in a metre
BARO_SIGMA = 1.0  # m: noise; the weather is a group of its own, see `aids.WEATHER`
FASTEST = 10.0  # Hz: faster odometers are averaged, since their errors are not new ten times a second


def states_of(mounting: Mounting, name: str, *roles: Role) -> dict[Role, Group]:
    """States of those properties of a sensor that are not known."""
    sigmas: dict[Role, ArrayLike] = {
        "lever arm": np.full(3, mounting.lever_arm_sigma),
        "mounting": np.full(2, mounting.angle_sigma),
        "scale": mounting.scale_sigma,
        "lag": mounting.latency_sigma,
    }
    found: dict[Role, Group] = {}
    for role in roles:
        if np.any(np.asarray(sigmas[role]) > 0.0):
            found |= state(name, role, sigmas[role])
    return found


def _of_receiver(mounting: Mounting, name: str, *roles: Role) -> dict[Role, Group]:
    """States of a receiver, whose clock may run at another rate than the IMU's."""
    found = states_of(mounting, name, *roles)
    if "lag" in found:
        found["lag"] = replace(found["lag"], drift=mounting.clock.rate_sigma)
    return found


def from_gnss(record: GnssRecord, mounting: Mounting, *, heights: bool = True) -> list[Aiding]:
    """Positions and velocities of an antenna, and the heading of the line to a second one.

    Parameters
    ----------
    record : GnssRecord
        Rows of quality 0 (no fix) and 6 (dead reckoning) are left out.
    mounting : Mounting
        Of the antenna. The second one lies along the forward axis of ``C_mb``, to `angle_sigma`. Velocities may be as late as its
        `velocities` say, and have a delay of their own then.
    heights : bool
        Use heights and vertical velocities.

    Raises
    ------
    DataError
        Velocities that contradict the positions, and how they would fit (see :func:`check_frames`).
    """
    check_frames(record)
    time = record.time - mounting.late_at(record.time)
    sound = np.ones(len(record), dtype=bool) if record.quality is None else ~np.isin(record.quality, (0, 6))
    found = []

    def rows_of(
        row: str, there: NDArray[np.bool_], measured: Array, sigma: Array, states: Mapping[Role, Group]
    ) -> Aiding:
        rows = time[there], measured[there], sigma[there]
        return Aiding(f"GNSS {row}", row, *rows, mounting.lever_arm, states=states, gate=mounting.gate)

    place = record.has_position & sound
    if place.any():
        measured = np.stack([record.lat, record.lon, record.alt], axis=1)
        sigma = _position_sigma(record, POSITION_SIGMA if mounting.noise is None else np.full(3, mounting.noise))
        if not heights:
            measured[:, 2] = np.nan
        states = _of_receiver(mounting, "GNSS", "lever arm", "lag")
        if mounting.slow > 0.0:
            states |= state("GNSS", "bias", mounting.slow * _axes(sigma[place]), mounting.bias_time)
        found.append(rows_of("position", place, measured, sigma, states))
    moving = record.has_velocity & sound
    if moving.any() and record.v_n is not None:
        by_imu = 1.0 / (1.0 - mounting.clock.rate)  # of a metre in a second of the receiver's, by the IMU's seconds
        measured = by_imu * record.v_n
        if not heights:
            measured[:, 2] = np.nan
        sigma = by_imu * _or_default(record.velocity_sigma, VELOCITY_SIGMA, len(record))
        states = _of_receiver(mounting, "GNSS", "lever arm", "lag")
        shown = rows_of("velocity", moving, measured, sigma, states)
        if "lag" in states and states["lag"].drift > 0.0:
            shown = replace(shown, figures=(1.0,))
        found.append(shown if mounting.velocities is None else _of_own_clock(shown, mounting))
    turned = record.has_heading & sound
    if turned.any() and record.heading is not None:
        states = _of_receiver(mounting, "GNSS", "lag")
        if mounting.angle_sigma > 0.0:
            states |= state("GNSS", "mounting", [max(mounting.angle_sigma, UNEVEN), mounting.angle_sigma])
        said = None if record.heading_sigma is None else record.heading_sigma[:, None]
        sigma = np.tile(_or_default(said, np.array([HEADING_SIGMA]), len(record)), 3)
        found.append(
            Aiding(
                "GNSS heading",
                HEADING,
                time[turned],
                record.heading[turned, None],
                sigma[turned],
                C_mb=mounting.C_mb,
                states=states,
                gate=mounting.gate,
            )
        )
    return found


def _of_own_clock(source: Aiding, mounting: Mounting) -> Aiding:
    """A receiver's velocities with the delay that is theirs alone."""
    own = mounting.of_velocities
    others = {key: group for key, group in source.states.items() if key != "lag"}  # that is of the places
    states = others | _of_receiver(
        replace(mounting, latency_sigma=own.latency_sigma, drift=mounting.clock), source.name, "lag"
    )
    return replace(source, time=source.time + mounting.latency - own.latency, states=states)


def from_odometer(record: OdometerRecord, mounting: Mounting) -> list[Aiding]:
    """Forward speed of a wheel; sideways and upwards it does not move.

    Distances are mean speeds, taken at the middle of their interval. More than ten a second are averaged.

    Parameters
    ----------
    mounting : Mounting
        Lever arm: to the wheel, the rear axle where nothing steers it.
        Its noise is that of the speed besides the size of the pulses.
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
    states = states_of(mounting, "odometer", "lever arm", "scale", "mounting", "lag")
    if mounting.compliance > 0.0:
        states["own"] = Group(COMPLIANCE, np.full(2, mounting.compliance), unit="rad s^2/m")
    return [
        Aiding(
            "odometer",
            WHEEL,
            time - mounting.latency,
            measured,
            noise,
            mounting.lever_arm,
            mounting.C_mb,
            states,
            mounting.gate,
            figures=COUNTED_FORWARD,
        )
    ]


def from_velocity(record: VelocityRecord, mounting: Mounting, errors: LogErrors) -> list[Aiding]:
    """A Doppler or electromagnetic log, or any reference velocity.

    Parameters
    ----------
    errors : LogErrors
        Its slow errors; the larger of these and those of the mounting count. A drift whose time nobody knows lasts `DRIFT_TIME`.

    Raises
    ------
    UsageError
        Errors that turn with the hull, of a log that has been turned to east and north.
    """
    noise = LOG_SIGMA if mounting.noise is None else mounting.noise
    sigma = _or_default(record.sigma, np.full(3, noise), len(record))
    body = record.frame == "body"
    if not body and (errors.scale or errors.mounting or errors.bias):
        raise UsageError(
            f"{record.source}: a scale, mounting or bias of a log that has been turned to east and north; expected a drift "
            "alone, or a log in body axes"
        )
    known = replace(
        mounting,
        scale_sigma=max(mounting.scale_sigma, errors.scale),
        angle_sigma=max(mounting.angle_sigma, errors.mounting),
        bias_sigma=max(mounting.slow, errors.bias),
    )
    states = states_of(known, NAME, "lever arm", *(("scale", "mounting") if body else ()), "lag")
    if body and known.slow > 0.0:
        states |= state(NAME, "bias", np.full(3, known.slow), known.bias_time)
    if errors.drift > 0.0:
        time = DRIFT_TIME if errors.drift_time is None else errors.drift_time
        states["own"] = Group(DRIFT, np.full(2, errors.drift), time, unit="m/s")
    return [
        Aiding(
            NAME,
            "body velocity" if body else "velocity",
            record.time - mounting.latency,
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
    states: dict[Role, Group] = {}
    if mounting.slow > 0.0:
        states = state("barometer", "bias", mounting.slow, mounting.bias_time)
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


def place_sigma(record: GnssRecord) -> float:
    """What a receiver says of its fixes, east and north alike, m; usual where it says nothing."""
    sigma = _position_sigma(record, POSITION_SIGMA)[record.has_position, :2]
    return float(np.median(sigma)) if sigma.size else float(POSITION_SIGMA[0])


def height_sigma(record: GnssRecord) -> Array:
    """(M,) what a receiver says of its heights, m; usual where it says nothing."""
    return _position_sigma(record, POSITION_SIGMA)[:, 2]


def place_axes(record: GnssRecord) -> Array:
    """(3,) sigma of a receiver's slow errors east, north, up by that of its places."""
    return _axes(_position_sigma(record, POSITION_SIGMA)[record.has_position])


def _axes(sigma: Array) -> Array:
    """Heights err more than places, and so do their slow errors; of sigmas (M, 3)."""
    return np.array([1.0, 1.0, _vertical(sigma)])


def _vertical(sigma: Array) -> float:
    """Sigma of heights by that of places, of sigmas (M, 3); at least 1."""
    level = np.hypot(sigma[:, 0], sigma[:, 1]) / math.sqrt(2.0)
    known = np.isfinite(sigma[:, 2]) & (level > 0.0)
    return max(1.0, float(np.median(sigma[known, 2] / level[known]))) if known.any() else 1.0


def _position_sigma(record: GnssRecord, default: Array) -> Array:
    sigma = _or_default(record.position_sigma, default, len(record))
    if record.position_sigma is None and record.dop is not None:
        # A horizontal dilution is that of both axes together.
        h, v = record.dop[:, :1] / np.sqrt(2.0), record.dop[:, 1:]
        said = USER_RANGE * np.hstack([h, h, v])
        sigma = np.where(np.isfinite(said), said, sigma)
    return sigma


def _or_default(sigma: Array | None, default: Array, rows: int) -> Array:
    if sigma is None:
        return np.tile(default, (rows, 1))
    return np.where(np.isfinite(sigma), sigma, default)
