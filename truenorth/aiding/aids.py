"""What aids an alignment or a navigation besides the IMU: each sensor's record and how it is mounted.

Arms, angles and latencies mean the same for every aid; see :mod:`truenorth.state.mounting`. An aid of your own is a frozen
dataclass with a `key`, a `record` and a method `sources`, as :class:`Gnss` has; navigation takes it as it is.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar, Protocol, Self, runtime_checkable

from numpy.typing import ArrayLike

from truenorth.aiding.matching import What
from truenorth.aiding.sensors import from_gnss, from_height, from_odometer, from_velocity
from truenorth.aiding.source import Aiding
from truenorth.errors.log import LogErrors, log_errors
from truenorth.records import EncoderRecord, GnssRecord, HeightRecord, MasterRecord, OdometerRecord, VelocityRecord
from truenorth.records.flexure import FlexureSpec
from truenorth.state.evidence import Evidence, note
from truenorth.state.mounting import Mounting

if TYPE_CHECKING:
    from truenorth.errors.master import MasterErrors

ARM_SIGMA = 0.05  # m: how far an IMU may sit from a turntable's axes
BASELINE = math.radians(1.0)  # of a second antenna said to be ahead of the first
# m, of an antenna of which nothing is said: a metre or two on cars, 10 to 20 m on lorries, aircraft, ships
VEHICLE_ARM = 5.0
HULL = 15.0  # m: how far from the IMU a velocity log may sit of which nothing is said, under a ship's bow
LATENCY_SIGMA = 0.2  # s, of a receiver of which nothing is said
ANTENNA = Mounting(  # of which nothing is said
    lever_arm_sigma=VEHICLE_ARM, angle_sigma=BASELINE, latency_sigma=LATENCY_SIGMA
)
WHEEL = Mounting(  # of which nothing is said; a vehicle's bus takes some .01 s
    scale_sigma=0.03, angle_sigma=math.radians(3.0), lever_arm_sigma=1.0, latency_sigma=0.05
)
WEATHER = Mounting(bias_sigma=10.0, bias_time=3600.0)  # of a barometer whose mounting is not given


@runtime_checkable
class Aid(Protocol):
    """What navigation needs of an aid.

    Attributes
    ----------
    key : str
        Name in summaries; one aid of a key at a time.
    record : record or None
        Its rows; ``record.notes`` go into the reasons.
    """

    key: ClassVar[str]

    @property
    def record(self) -> Any:
        """Rows of the sensor."""

    def sources(self, altitude: str) -> list[Aiding]:
        """Measurements for the closed loop; `altitude` says how height is kept (fixed, free, baro, gnss)."""


@dataclass(frozen=True)
class _Mounted:
    """An aid with a mounting; None: the usual one of its kind, or of the procedure."""

    record: Any
    mounting: Mounting | None = None
    usual: ClassVar[Mounting] = Mounting()

    def mounted(self, mounting: Mounting) -> Self:
        """The same aid, mounted so."""
        return replace(self, mounting=mounting)


@dataclass(frozen=True)
class Gnss(_Mounted):
    """A GNSS receiver.

    Attributes
    ----------
    record : GnssRecord
        Procedures leave out fixes that are written again while the vehicle goes on.
    mounting : Mounting, optional
        Of the antenna; a second one is on the forward axis of ``C_mb``, to `angle_sigma` (1 deg when left out). Left out, arm
        (5 m, and more where the data ask for it) and latency (.2 s) are estimated.
    """

    record: GnssRecord
    key: ClassVar[str] = "gnss"
    usual: ClassVar[Mounting] = ANTENNA

    def sources(self, altitude: str) -> list[Aiding]:
        """Positions and velocities."""
        return from_gnss(self.record, self.mounting or self.usual, heights=altitude in ("gnss", "free"))


@dataclass(frozen=True)
class Odometer(_Mounted):
    """A wheel that counts distance or speed.

    Attributes
    ----------
    record : OdometerRecord
    mounting : Mounting, optional
        Lever arm: to the wheel, the rear axle where nothing steers it. Left out, scale (3 %), mounting (3 deg), arm (1 m) and
        latency (.05 s) are estimated.
    """

    record: OdometerRecord
    key: ClassVar[str] = "odometer"
    usual: ClassVar[Mounting] = WHEEL

    def sources(self, altitude: str) -> list[Aiding]:
        """Body velocities."""
        return from_odometer(self.record, self.mounting or self.usual)


@dataclass(frozen=True)
class VelocityLog(_Mounted):
    """A Doppler or electromagnetic log, or any reference velocity.

    Attributes
    ----------
    record : VelocityRecord
    mounting : Mounting, optional
        Left out, the arm (15 m) is estimated.
    errors : LogErrors or {"reference", "em", "doppler-water", "doppler-bottom"}, optional
        Its slow errors; left out, those that are usual for a log in its axes: body axes, one in the water. ``LogErrors()``: none
        but those of the mounting.
    """

    record: VelocityRecord
    errors: LogErrors | str | None = None
    key: ClassVar[str] = "velocity"
    usual: ClassVar[Mounting] = Mounting(lever_arm_sigma=HULL)

    @property
    def unsaid(self) -> list[Evidence]:
        """That nobody has said what kind of log it is, and what is taken for possible then."""
        if self.errors is not None:
            return []
        return [note("log.kind_unsaid", "log_kind", drift=log_errors(None, self.record.frame).drift)]

    def sources(self, altitude: str) -> list[Aiding]:
        """Velocities, in body or navigation axes."""
        errors = log_errors(self.errors, self.record.frame)
        return from_velocity(self.record, self.mounting or self.usual, errors)


@dataclass(frozen=True)
class Barometer(_Mounted):
    """A sensor of height.

    Attributes
    ----------
    record : HeightRecord
    mounting : Mounting, optional
        The weather's slow error (10 m, 1 h) is estimated when it is left out.
    loop : float, s
        Time constant of a third-order vertical loop; 0: a Kalman gain.
    """

    record: HeightRecord
    loop: float = 0.0
    key: ClassVar[str] = "baro"
    usual: ClassVar[Mounting] = WEATHER

    def sources(self, altitude: str) -> list[Aiding]:
        """Heights, where height is kept by the barometer."""
        return from_height(self.record, self.mounting or self.usual, self.loop) if altitude == "baro" else []


@dataclass(frozen=True)
class Master(_Mounted):
    """The solution of a master INS on the same vehicle.

    Attributes
    ----------
    record : MasterRecord
    mounting : Mounting, optional
        Lever arm from the IMU to the master, ``C_mb`` from the IMU's to the master's axes, and what they are uncertain by. Left
        out: angles zero to 3 deg, latency to 50 ms, the arm to 1 m, or to 5 m where the log shows one of 5 m and more.
    matching : {"auto", "velocity", "attitude", "both", "position", "acceleration", "position+attitude", "acceleration+attitude"}
    flexure : FlexureSpec, optional
        The IMU's seat bends.
    errors : MasterErrors or {"navigation", "tactical"}, optional
        The master's own slow errors; left out, what its record says of them. With neither, or "none", it is taken for the truth,
        and sigma is relative to it.
    velocity_noise, attitude_noise, position_noise, acceleration_noise : float, optional, m/s, rad, m and m/s^2
        White noise of the master's rows; fitted when left out.
    heading : float, rad, optional
        Of the IMU at the start, where the master has no attitude.
    """

    record: MasterRecord
    matching: What = "auto"
    flexure: FlexureSpec | None = None
    errors: MasterErrors | str | None = None
    velocity_noise: float | None = None
    attitude_noise: float | None = None
    position_noise: float | None = None
    acceleration_noise: float | None = None
    heading: float | None = None
    key: ClassVar[str] = "master"


@dataclass(frozen=True)
class Indexer:
    """An indexer (rotation mechanism) that carries the IMU on the body.

    Attributes
    ----------
    record : EncoderRecord or None
        Angles of its axes. None: the body is still, its axes are the IMU's at the record's beginning.
    axes : sequence of {"x", "y", "z"}
        The outermost first.
    lever_arm : (3,) array, m, optional
        From the IMU to the body's centre of rotation, body axes; estimated when it is left out.
    angle_sigma : float, rad
        One-sigma error of the indexer's own angles and axes, which the body's attitude has in full.
    offset_sigma : float, m
        One sigma, along each of its axes, of how far the IMU sits from the axes of the indexer; estimated. 0: on them.
    latency_sigma : float, s
        One sigma of what the encoder is late or early by, where no start or stop of an axis shows it; one that shows is taken off.
    """

    record: EncoderRecord | None
    axes: tuple[str, ...] = ("z", "x")
    lever_arm: ArrayLike | None = None
    angle_sigma: float = 0.0
    offset_sigma: float = 0.01
    latency_sigma: float = 0.0
    key: ClassVar[str] = "indexer"


@dataclass(frozen=True)
class Positions:
    """A turntable that takes the IMU from position to position; turns are found in the log.

    Attributes
    ----------
    arm_sigma : float, m
        How far the IMU may sit from the table's axes.
    """

    arm_sigma: float = ARM_SIGMA
    record: None = None
    key: ClassVar[str] = "positions"
