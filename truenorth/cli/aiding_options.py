"""Options of the aids of an alignment: what `align` reads besides the IMU's log, and how it is mounted."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

from truenorth.cli.fields import (
    Sets,
    angles,
    arm,
    arm_of_master,
    arm_to_imu,
    axes,
    bending,
    degrees,
    given,
    known_latency,
    plain,
    quantity,
    quantity_and_time,
    second_antenna,
)
from truenorth.cli.options import option
from truenorth.cli.reading import numbers_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from truenorth.records import ImuRecord

GYROS = "gyros"

IndexerAxes = Annotated[str, option("Axes of the indexer, the outermost first."), Sets("indexer", axes)]
IndexerSigma = Annotated[
    str,
    option("One-sigma error of the indexer's own angles and axes: '10 arcsec'; the body's attitude has it in full."),
    Sets("indexer", quantity("angle_sigma", "angle")),
]
Baseline = Annotated[
    str | None,
    option(
        "Direction of the second GNSS antenna from the first on the vehicle, and its one sigma, deg; '0,1' without it."
    ),
    Sets("antenna", second_antenna),
]
KnownLatency = Annotated[
    float | None,
    option("GNSS measurements are older than their stamps by this, s; estimated without it."),
    Sets("antenna", known_latency),
]
LogKind = Annotated[
    str | None,
    option("Kind of the velocity log: reference, em, doppler-water or doppler-bottom; sets its slow errors."),
]
OdometerNoise = Annotated[
    float | None, option("One-sigma noise of the odometer's speed, m/s."), Sets("odometer", plain("noise"))
]
Errors = Annotated[list[str] | None, option("Error states of a plug-in, by name; more than one by repeating it.")]

Offset = Annotated[
    str | None,
    option("Added to the times of the aiding logs, s: '-0.35' to all of them, or by sensor 'gnss=-0.1,odometer=0.02'."),
]


def shifted(aids: Sequence[Any], offset: str | None, others: Sequence[str] = ()) -> list[Any]:
    """Sensors with the times of their logs as --offset corrects them; `others` are keys of those that it may name as well.

    Raises
    ------
    UsageError
        No number, or a sensor that is not there.
    """
    from dataclasses import replace

    from truenorth.core.errors import UsageError

    clocks = list(dict.fromkeys([*(aid.key for aid in aids if hasattr(aid, "record")), *others]))
    late: dict[str, float] = {}
    for part in () if offset is None else offset.split(","):
        name, equals, seconds = part.rpartition("=")
        (number,) = numbers_of(seconds, f"--offset {offset}:", 1, "seconds")
        for key in [name.strip()] if equals else clocks:
            if key not in clocks or key in late:
                wrong = "named twice" if key in late else "not given"
                raise UsageError(f"--offset {offset}: {key} is {wrong}; expected, once each, of: {', '.join(clocks)}")
            late[key] = number
    return [replace(aid, record=aid.record.shifted(late[aid.key])) if aid.key in late else aid for aid in aids]


def on_its_day(record: ImuRecord, aids: Sequence[Any]) -> list[Any]:
    """Sensors on the clock of the IMU's log where that counts from midnight and they from 1970, or the other way round.

    Their source says so. It is the one way in which whole days bring both together; others are asked about.
    """
    from dataclasses import replace

    from truenorth.records.overlap import DAY, days_apart

    found = []
    for aid in aids:
        log = getattr(aid, "record", None)
        days = 0.0 if log is None else days_apart((log.time[0], log.time[-1]), (record.time[0], record.time[-1]))
        if log is not None and days:
            said = f"{log.source} ({days / DAY:+.0f} days: one of both logs counts from midnight)"
            aid = replace(aid, record=replace(log.shifted(days), source=said))
        found.append(aid)
    return found


@dataclass(frozen=True)
class Turntable:
    """Options of an alignment on a turntable."""

    PANEL: ClassVar = "Turntable"
    positions: Annotated[
        str | None, option("auto: a turntable takes the IMU from position to position; turns are found in the gyros.")
    ] = None
    arm_sigma: Annotated[
        float, option("How far the IMU may sit from the table's axes, m."), Sets("positions", plain("arm_sigma"))
    ] = 0.05
    advise: Annotated[
        float | None,
        option(
            "A wanted one-sigma of heading, deg: how long, and in which positions, this IMU on this base needs for it."
        ),
    ] = None

    def aids(self) -> list[Any]:
        """Positions, where a turntable is named."""
        if self.positions is None:
            return []
        from truenorth.aiding.aids import Positions
        from truenorth.core.errors import UsageError

        if self.positions != "auto":
            raise UsageError(f"--positions {self.positions!r}; expected auto: turns and positions are found in the log")
        return [Positions(**given(self, "positions"))]


@dataclass(frozen=True)
class OnIndexer:
    """Options of an IMU on an indexer."""

    PANEL: ClassVar = "IMU on an indexer"
    indexer: Annotated[
        str | None,
        option("Log of the encoder's angles; or 'gyros': the body is still, the gyros show how the IMU turns."),
    ] = None
    indexer_axes: IndexerAxes = "z,x"
    indexer_sigma: IndexerSigma = "0 arcsec"
    lever_arm: Annotated[
        str | None,
        option(
            "Right, forward, up, m, from the body's centre of rotation (or from the master) to the IMU; estimated without it."
        ),
        Sets("indexer", arm_to_imu),
        Sets("on master", arm_of_master),
    ] = None

    def aids(self) -> list[Any]:
        """The indexer, where one is named."""
        if self.indexer is None:
            return []
        from truenorth.aiding.aids import Indexer
        from truenorth.formats import read_encoder

        return [Indexer(None if self.indexer == GYROS else read_encoder(self.indexer), **given(self, "indexer"))]


@dataclass(frozen=True)
class ByMaster:
    """Options of a transfer alignment."""

    PANEL: ClassVar = "Against a master INS"
    master: Annotated[
        Path | None,
        option("Log of the master: time, heading, pitch, roll and/or VE, VN, VU, and lat, lon, alt where it has them."),
    ] = None
    master_columns: Annotated[str | None, option("Names of the columns in the master's log, as 'time=t,VE=ve'.")] = None
    master_units: Annotated[str | None, option("Units of its columns, as 'attitude=rad,position=rad'.")] = None
    matching: Annotated[
        str,
        option("What is matched: auto, velocity, attitude or both; position, acceleration, or either with +attitude."),
        Sets("master", plain("matching")),
    ] = "auto"
    delay: Annotated[
        str | None,
        option(
            "By which the master's stamps are late: '30 ms', or with its uncertainty '30 ms,5 ms'; 0 and 50 ms without it."
        ),
        Sets("on master", quantity_and_time("latency", "time", "latency_sigma")),
    ] = None
    lever_arm_sigma: Annotated[
        float | None,
        option(
            "What the arm from the master to the IMU is uncertain by, m; 0: known. Without it 1 m; of an arm not given 5 m "
            "where the log contradicts 1 m."
        ),
        Sets("on master", plain("lever_arm_sigma")),
    ] = None
    master_sigma: Annotated[
        str | None,
        option(
            "Slow errors of the master's own solution: navigation, tactical, or 'level=0.3 arcmin,heading=2 arcmin,"
            "velocity=0.05 m/s'; without it what its log says (sigma_heading .. sigma_VU). With neither, or none, the master is "
            "taken for the truth, and sigma is against it."
        ),
        Sets("master", plain("errors")),
    ] = None
    flexure: Annotated[
        str | None,
        option("The IMU's seat bends: '3 arcmin,5 s', one sigma of each axis and correlation time."),
        Sets("master", bending),
    ] = None

    def aids(self, *others: Any) -> list[Any]:
        """The master, where one is named; `others` are groups that say of its mounting, too."""
        if self.master is None:
            return []
        from truenorth.aiding.aids import Master
        from truenorth.formats import read_master

        record = read_master(self.master, columns=self.master_columns, units=self.master_units)
        return [Master(record, self.mounted(*others), **given(self, "master"))]

    def mounted(self, *others: Any) -> Any:
        """How the master is mounted: what is usual, what the other groups say, and what these options do."""
        from dataclasses import replace

        from truenorth.alignment.transfer import ON_MASTER

        mounted = ON_MASTER
        for group in (*others, self):
            mounted = replace(mounted, **given(group, "on master"))
        return mounted


@dataclass(frozen=True)
class OnTheMove:
    """Options of an alignment on the move."""

    PANEL: ClassVar = "On the move"
    odometer: Annotated[
        Path | None, option("Odometer log of a vehicle that moves from the first second on (needs --imu).")
    ] = None
    gnss: Annotated[
        Path | None,
        option("GNSS log, positions and/or velocities, alone or with an odometer; --lat is then not needed."),
    ] = None
    velocity: Annotated[
        Path | None,
        option("Log of a Doppler or speed log in body axes (v_right, v_forward, v_up), in place of an odometer."),
    ] = None
    log_kind: LogKind = None
    offset: Offset = None
    wheel_arm: Annotated[
        str | None,
        option("IMU to the odometer's wheel or the velocity log, m: right,forward,up; estimated without it."),
        Sets("wheel", arm),
    ] = None
    antenna_arm: Annotated[
        str | None, option("IMU to the GNSS antenna, m: right,forward,up."), Sets("antenna", arm)
    ] = None
    latency: KnownLatency = None
    baseline: Baseline = None
    mounting: Annotated[
        str | None,
        option("Heading,pitch,roll of the IMU against the vehicle (or the master), deg."),
        Sets("wheel", angles),
        Sets("on master", angles),
    ] = None
    mounting_sigma: Annotated[
        float,
        option("How far off those may be, one sigma, deg; estimated."),
        Sets("wheel", degrees("angle_sigma")),
        Sets("on master", degrees("angle_sigma")),
    ] = 3.0
    odometer_noise: OdometerNoise = None
    error: Errors = None

    @property
    def named(self) -> bool:
        """Whether a sensor of motion is named."""
        return any(log is not None for log in (self.odometer, self.gnss, self.velocity))

    def aids(self) -> list[Any]:
        """Odometer, velocity log and GNSS, where they are named."""
        if not self.named:
            return []
        from dataclasses import replace

        from truenorth.aiding.aids import WHEEL, Gnss, Odometer, VelocityLog
        from truenorth.alignment.in_motion_task import usual_antenna
        from truenorth.core.errors import UsageError
        from truenorth.formats import read_gnss, read_odometer, read_velocity

        if not self.mounting_sigma > 0.0:
            raise UsageError(f"--mounting-sigma {self.mounting_sigma:g}: expected degrees above zero")
        found: list[Any] = []
        wheel = replace(WHEEL, **given(self, "wheel"))
        if self.odometer is not None:
            found.append(Odometer(read_odometer(self.odometer), replace(wheel, **given(self, "odometer"))))
        if self.velocity is not None:
            found.append(VelocityLog(read_velocity(self.velocity), wheel, self.log_kind))
        if self.gnss is not None:
            receiver = read_gnss(self.gnss)
            found.append(Gnss(receiver, replace(usual_antenna(receiver), **given(self, "antenna"))))
        return found
