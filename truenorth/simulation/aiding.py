"""What simulated aiding sensors share: sampling with delays and drop-outs, outliers, random streams.

A sensor is sampled at times of its own; its rows carry the time of sampling plus `latency`, so that a log whose delay nobody
compensates shows the truth of a little while ago. Every random term draws from a stream of its own
(:mod:`truenorth.simulation.streams`): switching one off leaves the others' draws as they were.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from truenorth.core.attitude import dcm_from_rotation_vector
from truenorth.core.earth import earth_rate_n
from truenorth.core.errors import UsageError
from truenorth.records import Record
from truenorth.records.motion import MotionStates
from truenorth.records.unit_spec import UnitSpec, value
from truenorth.simulation.sensing import MOST_SAMPLES
from truenorth.simulation.streams import stream

Array = NDArray[np.float64]
R = TypeVar("R", bound=Record)

# Streams by term, from 100 on; never renumbered, so that a seed keeps its data.
STREAMS = {
    "odometer_scale": 100,
    "odometer_mounting": 101,
    "odometer_phase": 102,
    "odometer_slips": 103,
    "odometer_lost": 104,
    "odometer_noise": 105,
    "odometer_outages": 106,
    "velocity_bias": 110,
    "velocity_scale": 111,
    "velocity_misalignment": 112,
    "velocity_drift": 113,
    "velocity_noise": 114,
    "velocity_outages": 115,
    "velocity_outliers": 116,
    "gnss_position_drift": 120,
    "gnss_position_noise": 121,
    "gnss_velocity_drift": 122,
    "gnss_velocity_noise": 123,
    "gnss_outages": 124,
    "gnss_outliers": 125,
    "height_bias": 140,
    "height_drift": 141,
    "height_noise": 142,
    "height_outages": 143,
    "height_outliers": 144,
    "master_attitude": 150,
    "master_attitude_drift": 151,
    "master_attitude_noise": 152,
    "master_velocity": 153,
    "master_velocity_drift": 154,
    "master_velocity_noise": 155,
    "master_position": 156,
    "master_schuler": 157,
    "master_jumps": 158,
    "master_outages": 159,
    "flexure": 170,
    "encoder_offset": 180,
    "encoder_eccentricity": 181,
    "encoder_noise": 182,
}


@dataclass(frozen=True, kw_only=True)
class AidingSpec(UnitSpec, ABC, Generic[R]):
    """What every aiding sensor has: a name for its random streams, and :meth:`sense`, which makes its record.

    Attributes
    ----------
    rate : float, Hz
    latency : float, s
        From sampling to the time that a row carries; may be negative, of a clock that is early.
    """

    sensor: ClassVar[str]
    rate: float = value("frequency", "Hz", 1.0, sign="positive")
    latency: float = value("time", "s", sign="any")

    @abstractmethod
    def sense(self, body: Any, times: Array, draws: Draws) -> Aided[R]:
        """The sensor on a body (of an encoder: an indexer), sampled at some times (N,)."""


@dataclass(frozen=True, kw_only=True)
class DroppingSpec(AidingSpec[R]):
    """What sensors have that drop out."""

    # tuple of (start, stop), s; in which no row is sampled
    outages: tuple[tuple[float, float], ...] = value("time time", "s s", (), sign="any", many=True)
    outage_rate: float = value("frequency", "Hz")  # 1/s; mean number of more outages a second, at random times
    outage_duration: float = value("time", "s", 10.0)  # s; of each of these

    def __post_init__(self) -> None:
        super().__post_init__()
        check_windows("outages", self.outages)


@dataclass(frozen=True, kw_only=True)
class OutlyingSpec(DroppingSpec[R]):
    """What sensors have that drop out and give outliers."""

    outlier_rate: float = value("ratio", "%")  # 1; part of the rows that are outliers

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.outlier_rate > 1.0:
            raise UsageError(f"outlier_rate is {self.outlier_rate:g}; expected a part of the rows, 0 to 100 %")


@dataclass(frozen=True)
class Aided(Generic[R]):
    """The log of a simulated aiding sensor.

    Attributes
    ----------
    record : Record
    sampled : (N,) array, s
        When each row was really sampled.
    errors : mapping
        The errors that were really drawn, SI, by name; arrays of N rows where they change in time.
    """

    record: R
    sampled: Array
    errors: Mapping[str, Any]


class Draws:
    """The random generators of one run, by term."""

    def __init__(self, sensor: str, seed: int, run: int, scenario: int) -> None:
        self.sensor, self.key = sensor, (seed, scenario, run)

    def __call__(self, term: str) -> np.random.Generator:
        """The generator of a term of the sensor."""
        name = f"{self.sensor}_{term}" if term else self.sensor
        return stream(*self.key, STREAMS[name])


def simulate_sensor(
    body: Any,
    spec: AidingSpec[R],
    *,
    duration: float,
    start: float = 0.0,
    seed: int = 0,
    run: int = 0,
    scenario: int = 0,
    **given: Any,
) -> Aided[R]:
    """Simulate an aiding sensor, or the encoder of an indexer.

    Parameters
    ----------
    body : Motion, Indexed or Indexer
        The motion of the IMU that the sensor stands by; of an encoder its indexer.
    spec : AidingSpec
        :class:`GnssSpec`, :class:`HeightSpec`, :class:`OdometerSpec`, :class:`VelocityLogSpec`, :class:`MasterSpec` or
        :class:`EncoderSpec`: each is an ideal sensor until it is given errors.
    duration, start : float, s
    seed, run, scenario : int
        The same three give the same bits.
    **given
        Errors in place of drawn ones, where the sensor's `sense` takes them.

    Returns
    -------
    Aided
        The record, when its rows were sampled, and the errors that were drawn: their names are those of the sensor's `sense`.

    Raises
    ------
    UsageError
        Less than two rows in the time, by rate, latency or outages.
    """
    return spec.sense(body, sample_times(spec, start, duration), Draws(spec.sensor, seed, run, scenario), **given)


def sample_times(spec: AidingSpec[Any], start: float, duration: float) -> Array:
    """When a sensor is sampled: from the start on, as long as its rows arrive before the end.

    Raises
    ------
    UsageError
        Less than two rows.
    """
    arriving = duration - max(spec.latency, 0.0)
    count = math.floor(arriving * spec.rate * (1.0 + 1e-12)) + 1 if math.isfinite(duration) else 0
    if count < 2:
        raise UsageError(
            f"{spec.rate:g} Hz over {duration:g} s with a latency of {spec.latency:g} s; expected two rows at least"
        )
    if count > MOST_SAMPLES:
        raise UsageError(
            f"{count:.3g} rows ({spec.rate:g} Hz over {duration:g} s); expected {MOST_SAMPLES:.0e} at most"
        )
    return start + np.arange(count) / spec.rate


def kept(spec: DroppingSpec[Any], times: Array, draws: Draws) -> NDArray[np.bool_]:
    """(N,) which rows are sampled in no outage.

    Raises
    ------
    UsageError
        Less than two are.
    """
    there = np.ones(len(times), dtype=bool)
    for start, stop in (
        *spec.outages,
        *random_windows(spec.outage_rate, spec.outage_duration, times, draws("outages")),
    ):
        there &= (times < start) | (times >= stop)
    if np.count_nonzero(there) < 2:
        raise UsageError("outages leave less than two rows; expected shorter ones")
    return there


def random_windows(rate: float, length: float, times: Array, rng: np.random.Generator) -> list[tuple[float, float]]:
    """Windows of a length that begin at random, `rate` of them a second in the mean, over the span of some times."""
    if rate == 0.0:
        return []
    span = float(times[-1] - times[0])
    starts = np.sort(times[0] + span * rng.random(rng.poisson(rate * span)))
    return [(float(start), float(start) + length) for start in starts]


def outliers(spec: OutlyingSpec[Any], sigma: Any, shape: tuple[int, ...], draws: Draws) -> Array:
    """Errors of a standard deviation in the rows that are outliers, zero in the others."""
    rng = draws("outliers")
    hit = rng.random(shape[0]) < spec.outlier_rate
    size = sigma * rng.standard_normal(shape)
    return np.where(hit.reshape(-1, *[1] * (len(shape) - 1)), size, 0.0)


def check_windows(name: str, windows: Any) -> None:
    """Refuse windows that end before they begin.

    Raises
    ------
    UsageError
        It names the window by its number.
    """
    for number, (start, stop, *_) in enumerate(windows, 1):
        if not stop > start:
            raise UsageError(
                f"{name}, number {number}: from {start:g} s to {stop:g} s; expected an end after its start"
            )


def velocity_b(at: MotionStates, arm: Any) -> Array:
    """Velocity over the ground, (..., 3) m/s in body axes, of a point of the body at an arm (m, body axes) from the IMU."""
    C_bn = np.swapaxes(at.C_nb, -1, -2)
    v = np.einsum("...ij,...j->...i", C_bn, at.v_n)
    if not np.any(arm):
        return v
    w_eb_b = at.w_ib_b - np.einsum("...ij,...j->...i", C_bn, earth_rate_n(at.lat))
    return v + np.cross(w_eb_b, np.asarray(arm, dtype=np.float64))


def rotation(angles: Any) -> Array:
    """``C_old_new`` of axes that are turned by a rotation vector (rad), (3, 3)."""
    return dcm_from_rotation_vector(np.asarray(angles, dtype=np.float64))
