"""`navigate`: from an alignment onward, free inertial or aided, with a verdict."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from typing import TYPE_CHECKING, Any, TypeVar, get_args

import numpy as np
from numpy.typing import NDArray

from truenorth.aiding.sensors import from_gnss, from_height, from_odometer, from_velocity
from truenorth.aiding.source import Aiding
from truenorth.core.errors import DataError, UsageError
from truenorth.core.position import Position
from truenorth.errors.model import InsModel
from truenorth.estimate.run import navigate_track, with_states
from truenorth.navigation.result import Altitude, Navigation, judged_navigation
from truenorth.navigation.second_look import second_look, slow_errors
from truenorth.navigation.start import read_start, start_from_alignment
from truenorth.navigation.stops import zero_updates
from truenorth.navigation.velocity_axes import check_axes
from truenorth.navigation.whereabouts import check_fixes, check_heights
from truenorth.quality.innovations import innovation_evidence
from truenorth.records import GnssRecord, HeightRecord, ImuRecord, OdometerRecord, Record, Trajectory, VelocityRecord
from truenorth.records.specs import ImuSpec, imu_spec
from truenorth.state.evidence import Evidence, note, notes
from truenorth.state.layout import BA, BG, DP, PHI
from truenorth.state.mounting import Mounting
from truenorth.state.state import Start
from truenorth.state.track import Track

if TYPE_CHECKING:
    from truenorth.alignment import Alignment
    from truenorth.damping.options import Damper
    from truenorth.records.calibration import Calibration

Array = NDArray[np.float64]
R = TypeVar("R", bound=Record)

LONG = 3600.0  # s, up to which the filter predicts every FINE seconds, then every COARSE
FINE, COARSE = 0.2, 1.0
# Of the log, what tells axes of velocities: at most this long, and until an INS without aiding has tilted or drifted so far.
AXES_TIME, AXES_TILT, AXES_DRIFT = 1800.0, 0.02, 5000.0  # s, rad, m
SHORTEST_AXES = 20.0  # s
LONGEST_BRIDGE = 1.0  # s: of a gap in the IMU's log that the rate before it may bridge


@dataclass(frozen=True)
class Sources:
    """Records of the aiding sensors and how they sit."""

    gnss: GnssRecord | None = None
    odometer: OdometerRecord | None = None
    velocity: VelocityRecord | None = None
    baro: HeightRecord | None = None


def navigate(
    record: ImuRecord,
    start: Alignment | Start | str | PathLike[str],
    *,
    gnss: GnssRecord | None = None,
    odometer: OdometerRecord | None = None,
    velocity: VelocityRecord | None = None,
    baro: HeightRecord | None = None,
    altitude: Altitude | None = None,
    zupt: str | Sequence[tuple[float, float]] | None = None,
    smooth: bool = False,
    imu: ImuSpec | str | None = None,
    antenna: Mounting | None = None,
    wheel: Mounting | None = None,
    log: Mounting | None = None,
    barometer: Mounting | None = None,
    baro_loop: float = 0.0,
    scale_factors: bool = False,
    calibration: Calibration | None = None,
    offset: float = 0.0,
    check_clocks: bool = True,
    interval: float | None = None,
    output: float | None = None,
    damping: Damper | None = None,
    progress: Callable[[str], None] | None = None,
) -> Navigation:
    """Carry a log on from an alignment.

    Parameters
    ----------
    record : ImuRecord
        Holds the alignment's epoch, or begins there.
    start : Alignment, Start, or path
        Of the alignment, or the folder it was saved in.
    gnss, odometer, velocity, baro : records, optional
        Aiding sensors.
    altitude : {"fixed", "free", "baro", "gnss"}, optional
        How height is kept; by default what the sensors allow, and fixed (at sea) where there is none.
    zupt : "auto" or pairs of seconds, optional
        Stops, with zero velocity (and zero rotation where nothing moves at all).
    smooth : bool
        Give each epoch what the whole log says of it.
    imu : ImuSpec or str, optional
        Specification; the alignment's own when left out.
    antenna, wheel, log, barometer : Mounting, optional
        How each sensor sits, and what of that is to be estimated. Without `wheel` an odometer sits and counts as an
        alignment on the move has found.
    baro_loop : float, s
        Time constant of a third-order loop on the barometer instead of a Kalman gain; 0: none.
    scale_factors : bool
        Estimate the IMU's scale factors.
    calibration : Calibration, optional
        Known errors, taken off first.
    offset : float, s
        Added to the times of all aiding logs, to bring them onto the IMU's clock.
    check_clocks : bool
        Look for a clock offset, a wrong lever arm, scale or mounting in a second pass; told as warnings.
    interval : float, s, optional
        Of the filter; .2 s, and 1 s for logs beyond an hour.
    output : float, s, optional
        Of the track; 1 s, more for very long logs.
    damping : Damper, optional
        Damp the oscillations of a free INS at sea; `velocity` is then the reference, and there is no other aiding.
    progress : callable, optional
        Told what is being done.

    Returns
    -------
    Navigation

    Raises
    ------
    UsageError
        Contradicting options, or numbers that cannot be.
    DataError
        The log does not hold the alignment's epoch; a gap too long to bridge; an aiding log that does not overlap, or in
        other axes.
    AlignmentError
        The alignment has no usable heading.
    """
    tell = progress or (lambda stage: None)
    logs: dict[str, Record | None] = {"gnss": gnss, "odometer": odometer, "velocity": velocity, "baro": baro}
    given = {name: aid for name, aid in logs.items() if aid is not None}
    begin, spec, imu_source = _start_of(start, imu)
    wheel = wheel or begin.wheel
    if calibration is not None:
        record = calibration.apply(record)
    record = _from_start(record, begin)
    record, gaps, disturbances = bridge_gaps(record)
    reference = None if damping is None else _shifted(velocity, offset)
    velocity = velocity if damping is None else None
    sources = Sources(
        _shifted(gnss, offset), _shifted(odometer, offset), _shifted(velocity, offset), _shifted(baro, offset)
    )
    height, why = _altitude(altitude, sources)
    mountings = {"gnss": antenna, "odometer": wheel, "velocity": log, "baro": barometer}
    mounting = {name: m or Mounting() for name, m in mountings.items()}
    aiding = _aiding(sources, mounting, height, baro_loop)
    _check_overlap(record, aiding)
    _check_places(sources, begin, height)
    interval = (FINE if record.duration <= LONG else COARSE) if interval is None else interval
    output = max(1.0, record.duration / 20_000.0) if output is None else output
    if not (interval > 0.0 and output > 0.0):
        raise UsageError(f"interval {interval:g} s, output {output:g} s; expected both above zero")
    tell("looking for stops" if zupt is not None else "navigating")
    seen = sources.odometer, sources.gnss, sources.velocity
    stops = [] if zupt is None else zero_updates(record, zupt, interval, *seen)
    every = max(1, round(output / interval))
    noise = spec.with_random_walks(record.interval)
    plain = InsModel.from_spec(noise, scale_factors=scale_factors, fixed_altitude=height == "fixed")

    def run(sensors: Sequence[Aiding], **options: Any) -> Track:
        used = [*sensors, *stops, *disturbances]
        return navigate_track(record, begin, with_states(plain, used), used, interval=interval, every=every, **options)

    _check_axes(record, begin, plain, sources, mounting)
    tell("navigating")
    track = run(aiding, smooth=smooth)
    evidence = innovation_evidence(track.residuals) + why
    if odometer is not None and _is_the_alignments(wheel, begin):
        evidence.append(note("odometer.taken_over"))
    if baro is not None and height != "baro":
        evidence.append(note("height.barometer_unused", "use_barometer", altitude=height))
    evidence += slow_errors(track, mounting["gnss"])
    evidence += [item for aid in given.values() for item in notes(aid.notes)]
    if check_clocks and aiding:
        tell("checking clocks and mountings")
        evidence += second_look(lambda loose: run(_aiding(sources, loose, height, baro_loop)), track, mounting)
    result = Navigation(
        status="navigated",
        evidence=(),
        track=track,
        altitude=height,
        smoothed=smooth,
        gaps=gaps,
        stops=sum(len(r.time) for r in track.residuals if r.name == "zero velocity"),
        imu_source=imu_source,
        source=record.source,
        late={name: aid.late for name, aid in given.items() if aid.late.rows},
    )
    if damping is None:
        return judged_navigation(result, evidence)
    from truenorth.damping.navigation import damp_navigation

    tell(f"damping: {damping.method}")
    return damp_navigation(replace(result, evidence=tuple(evidence)), reference, noise, damping, log)


def _is_the_alignments(wheel: Mounting | None, start: Start) -> bool:
    """Whether an odometer is taken to sit and count as the alignment has found."""
    found = start.wheel
    return (
        wheel is not None
        and found is not None
        and bool(np.all(wheel.C_mb == found.C_mb))
        and wheel.scale_sigma == found.scale_sigma
    )


def _start_of(start: Any, imu: ImuSpec | str | None) -> tuple[Start, ImuSpec, str]:
    spec = None if imu is None else imu_spec(imu)
    if isinstance(start, Start):
        if spec is None:
            raise UsageError(
                "a start without a specification of the IMU; expected imu='navigation', a file or an ImuSpec"
            )
        return start, spec, spec.name
    if isinstance(start, (str, PathLike)):
        begin, own, _ = read_start(start)
        where = own.name
    else:
        own, where = start.imu, start.imu_source
        begin = start_from_alignment(start)
    return begin, spec or own, where if spec is None else spec.name


def _shifted(record: R | None, offset: float) -> R | None:
    return None if record is None else record.shifted(offset)


def _from_start(record: ImuRecord, start: Start) -> ImuRecord:
    """The rows after the start's epoch."""
    begin = record.time[0] - record.interval
    slack = 0.5 * record.interval
    if not begin - slack <= start.time < record.time[-1] - record.interval:
        raise DataError(
            f"{record.source}: runs from {begin:.3f} s to {record.time[-1]:.3f} s, but the alignment holds at {start.time:.3f} "
            "s; expected a log that holds the alignment's epoch and goes on from it, on the same clock"
        )
    first = int(np.searchsorted(record.time, start.time + slack))
    return record[first:]


def bridge_gaps(record: ImuRecord) -> tuple[ImuRecord, tuple[tuple[float, float], ...], list[Aiding]]:
    """Gaps filled with the rate after them, and what they add to the uncertainty.

    What the base did in a gap is as different from that as its rates differ over the log.
    """
    rows = record.gaps[record.gaps > 0]
    if rows.size == 0:
        return record, (), []
    lengths = record.steps[rows]
    missing = lengths - record.interval
    if missing.max() > LONGEST_BRIDGE:
        worst = int(np.argmax(missing))
        raise DataError(
            f"{record.source}: row {rows[worst] + 1}, column time: a gap of {lengths[worst]:.3f} s after "
            f"{record.time[rows[worst] - 1]:.3f} s; expected gaps of {LONGEST_BRIDGE:g} s at most: what the vehicle did in it is "
            "not known; navigate the parts, each from an alignment of its own"
        )
    scale = 1.0 if record.kind == "rates" else 1.0 / record.interval
    unrest = [np.std(values * scale, axis=0).max() for values in (record.gyro, record.accel)]
    gaps = tuple((float(record.time[row - 1]), float(length)) for row, length in zip(rows, lengths))
    if record.kind == "increments":
        factor = np.ones(len(record))
        factor[rows] = lengths / record.interval
        record = replace(record, gyro=record.gyro * factor[:, None], accel=record.accel * factor[:, None])
    turn, push = (np.tile(missing[:, None] * max(rate, 1e-9), 3) for rate in unrest)
    # The kernel's form of a disturbance: variance of velocity as measured, of attitude as variance.
    return record, gaps, [Aiding("gap", "disturbance", record.time[rows], push**2, turn)]


def _altitude(wanted: str | None, sources: Sources) -> tuple[Altitude, list[Evidence]]:
    heights = sources.gnss is not None and bool(np.isfinite(sources.gnss.alt).any())
    if wanted is not None and wanted not in get_args(Altitude):
        raise UsageError(f"altitude {wanted!r}; expected one of {', '.join(get_args(Altitude))}")
    if wanted == "baro" and sources.baro is None:
        raise UsageError("altitude 'baro' without a barometer's record; expected baro=record")
    if wanted == "gnss" and not heights:
        raise UsageError("altitude 'gnss' without heights of GNSS; expected gnss=record with a column of heights")
    if wanted is not None:
        return wanted, []  # type: ignore[return-value]  # one of the four
    if heights:
        return "gnss", []
    if sources.baro is not None:
        return "baro", []
    if sources.odometer is not None or sources.velocity is not None:
        return "free", [note("height.free")]
    return "fixed", [note("height.fixed", "height_sensor")]


def _aiding(sources: Sources, mounting: Mapping[str, Mounting], altitude: str, loop: float) -> list[Aiding]:
    found: list[Aiding] = []
    if sources.gnss is not None:
        found += from_gnss(sources.gnss, mounting["gnss"], heights=altitude in ("gnss", "free"))
    if sources.odometer is not None:
        found += from_odometer(sources.odometer, mounting["odometer"])
    if sources.velocity is not None:
        found += from_velocity(sources.velocity, mounting["velocity"])
    if sources.baro is not None and altitude == "baro":
        found += from_height(sources.baro, mounting["baro"], loop)
    return found


def _check_places(sources: Sources, begin: Start, altitude: str) -> None:
    """Refuse fixes and heights that lie far from where the alignment stands."""
    sigma = np.sqrt(np.diag(begin.P)[DP])
    place = Position(begin.lat, begin.lon, begin.alt, float(sigma[:2].max()), float(sigma[2]))
    if sources.gnss is not None:
        check_fixes(sources.gnss, place, begin.time, heights=altitude in ("gnss", "free"))
    if sources.baro is not None and altitude == "baro":
        check_heights(sources.baro, place, begin.time)


def _check_axes(
    record: ImuRecord, begin: Start, model: InsModel, sources: Sources, mounting: Mapping[str, Mounting]
) -> None:
    """Refuse velocities in other axes, by the IMU's own changes of velocity over the log's first part."""
    logs = {"gnss": sources.gnss, "odometer": sources.odometer, "velocity": sources.velocity}
    given = {name: log for name, log in logs.items() if log is not None}
    if not given:
        return
    sigma = np.sqrt(np.diag(begin.P))
    trusted = min(AXES_TIME, AXES_TILT / sigma[BG].max(), math.sqrt(2.0 * AXES_DRIFT / sigma[BA].max()))
    if trusted < SHORTEST_AXES or sigma[PHI][:2].max() > AXES_TILT:
        return
    part = record.between(None, record.time[0] + trusted)
    free = navigate_track(part, begin, model, interval=FINE, every=1, covariance=False)
    lat, lon, alt = free.position.T
    own = Trajectory(free.time, free.C_nb, free.v_n, lat, lon, alt, source=record.source)
    for name, log in given.items():
        check_axes(log, own, mounting[name].latency, mounting[name].C_mb)


def _check_overlap(record: ImuRecord, aiding: Sequence[Aiding]) -> None:
    for sensor in aiding:
        inside = (sensor.time > record.time[0] - record.interval) & (sensor.time <= record.time[-1])
        if not inside.any():
            raise DataError(
                f"{sensor.name}: runs from {sensor.time.min():.3f} s to {sensor.time.max():.3f} s, the navigated part of "
                f"{record.source} from {record.time[0] - record.interval:.3f} s to {record.time[-1]:.3f} s: no overlap; "
                "expected one clock: bring the aiding log onto the IMU's with --offset SECONDS"
            )
