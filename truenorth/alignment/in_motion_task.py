"""What all passes of an alignment on the move share: its records, how their sensors sit, and one pass from a guess."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, TypeGuard

import numpy as np
from numpy.typing import NDArray

from truenorth.aiding.aids import ANTENNA, LATENCY_SIGMA, WHEEL
from truenorth.aiding.sensors import from_gnss, from_odometer, from_velocity
from truenorth.aiding.source import Aiding
from truenorth.aiding.sprung import of_the_path
from truenorth.alignment.in_motion_learnt import differs
from truenorth.alignment.in_motion_speed import driven, first_speed, speed_at
from truenorth.alignment.in_motion_start import Guess, coarse_guess, start_at
from truenorth.core.errors import AlignmentError, UsageError
from truenorth.core.position import Position
from truenorth.errors.axes import axis_sigma, standing
from truenorth.errors.group import Group, groups_of
from truenorth.errors.log import LogErrors
from truenorth.errors.model import InsModel
from truenorth.estimate.gaps import bridge_gaps
from truenorth.estimate.known_motion import of_known_motion
from truenorth.estimate.latency import mounting_found
from truenorth.estimate.memory import AS_IT_IS, OVER_GROUND
from truenorth.estimate.moment import as_unsure
from truenorth.estimate.run import navigate_track, with_states
from truenorth.estimate.sensor_delay import on_springs
from truenorth.navigation.stops import seconds_at_rest, updates_at, velocity_at_rest
from truenorth.navigation.whereabouts import check_fixes
from truenorth.quality.absolute import known_as_fixes
from truenorth.quality.aid_noise import changed, louder, noise_factors
from truenorth.quality.regimes import motion_summary
from truenorth.quality.rounding import with_rounding
from truenorth.quality.slow_aids import (
    FIXES,
    USUAL_TIME,
    Slow,
    as_lasting,
    one_less,
    slow_errors,
    usual_bias,
    with_slow,
)
from truenorth.quality.stamps import scattered, stamp_scatter, with_scatter
from truenorth.quality.swing import VELOCITIES, shown_arm, swing, unseen_swing, with_unseen_arm
from truenorth.quality.wheel_unit import check_unit
from truenorth.records import GnssRecord, ImuRecord, OdometerRecord, VelocityRecord
from truenorth.records.calibration import Calibration
from truenorth.records.overlap import no_overlap
from truenorth.records.specified import corrected, seen_in
from truenorth.records.specs import ImuSpec, imu_spec
from truenorth.state.evidence import Evidence
from truenorth.state.layout import BA
from truenorth.state.mounting import Mounting
from truenorth.state.track import Track

Array = NDArray[np.float64]

SHORTEST = 10.0  # s
# s, of the filter's prediction: the column of a delay takes the mean acceleration since the last event
INTERVAL = 0.2
OUTPUT = 1.0  # s, of the history
NO_LOG_ERRORS = LogErrors()
LONGEST_ALONE = 5.0  # s, that any IMU carries a vehicle before its first aid
USUAL_SPEED = 30.0  # m/s, of a vehicle
UNDER_WAY = 2.0  # m/s: fixes of some metres show half of that in `PACE` of a vehicle that stands
SOMEWHERE = math.radians(45.0)  # where the latitude is not known (yet)
POSITION_FLOOR, VELOCITY_FLOOR = 0.05, 0.05  # m, m/s
FIRST_FIX = 10.0, 20.0  # m, one sigma along the level and up
ANYWHERE = 1e5  # m, that a vehicle may have gone from its last fix: the clocks are apart


@dataclass(frozen=True)
class MovingTask:
    """What all passes share."""

    record: ImuRecord
    spec: ImuSpec
    model: InsModel
    position: Position
    odometer: OdometerRecord | VelocityRecord | None  # what shows velocity in body axes
    gnss: GnssRecord | None
    wheel: Mounting
    antenna: Mounting
    stops: Sequence[Aiding]  # and gaps of the log
    more: Sequence[Aiding]
    slow: LogErrors = NO_LOG_ERRORS
    errors: Sequence[Group | str] = ()  # further ones of the INS
    factors: Mapping[str, Array] = field(default_factory=dict)  # of noise, as learnt from the pass before
    scatter: float = 0.0  # s, one sigma of the receiver's stamps, so learnt
    unseen: float = 0.0  # share of the antenna's swing that the receiver does not show, so learnt
    swings: float = 0.0  # m/s, RMS over the rows of what that is
    scattered: Mapping[str, Array] = field(default_factory=dict)  # what both add to the sigmas
    waited: float = 0.0  # s, that the vehicle drove before anything aided: left out of the record
    # The slow error of fixes is the usual one, or innovations have shown it: nobody spoke of it
    usual_fixes: bool = False
    lasting: Slow = field(default_factory=dict)  # errors of aids that innovations have shown
    wanders: Sequence[Evidence] = ()  # and what is to be said of them
    # Scale factors and misalignments of the gyros are the constants that the specification says; else noise in turns besides
    steady: bool = False
    held: bool = False  # biases of the accelerometers across the vertical are taken for zero
    by_fix: bool = False  # the position is that of a fix: the IMU's but for the antenna's arm
    swing_apart: bool = False  # an arm that is estimated is not learnt from swings, of which velocities may show a part
    shaken: bool = False  # the antenna shakes more quickly than its delay was known
    delay_spread: float = 0.0  # s, one sigma of what else that delay may be
    moves: Track | None = None  # smoothed: by its velocities places are late
    sprung: bool = False  # the body goes up and down on its wheels: they do not say that it stays on the road

    def learnt(self, track: Track) -> tuple[MovingTask, bool]:
        """The task with what a pass has taught of its sensors, and whether that is much."""
        aiding = self.aiding(gated=False)
        factors = noise_factors(track, aiding, self.factors)
        antenna = mounting_found(self.antenna, track, "GNSS")
        scatter = stamp_scatter(track, aiding, self.scatter)
        arm = shown_arm(track, self.antenna.lever_arm)
        given = self.antenna.latency_sigma == 0.0
        unseen = 0.0 if given else unseen_swing(track, self.record, arm, self.unseen)
        scatters = differs(self.scatter, scatter) or differs(self.unseen, unseen)
        much = antenna is not self.antenna or changed(self.factors, factors) or scatters
        if not much:
            return self, False
        added, swings = scattered(aiding, track, scatter), 0.0
        for source in aiding if unseen else ():
            if source.name == VELOCITIES:
                more = unseen * swing(track, self.record, arm, source.time)
                swings = math.sqrt(float(np.mean(np.sum(more**2, axis=1))))
                added[VELOCITIES] = np.hypot(added.get(VELOCITIES, 0.0), more)
        learnt = replace(self, factors=factors, antenna=antenna, scatter=scatter, scattered=added)
        return replace(learnt, unseen=unseen, swings=swings), True

    def with_slow_errors(self, track: Track) -> MovingTask:
        """The task with slow errors of its aids that a pass has shown: the same one where there are none."""
        slow, wanders = slow_errors(track, self.aiding(gated=False))
        if not slow:
            return self
        lasting = {**self.lasting, **slow}
        return replace(
            self,
            usual_fixes=self.usual_fixes or FIXES in slow,
            lasting=lasting,
            wanders=(*self.wanders, *wanders),
        )

    def with_spec(self, spec: ImuSpec) -> MovingTask:
        """The task with another specification of the IMU."""
        # A gate that begins with any heading must bear what constants do not hold: without noise in turns the filter loses a cart
        # (`stim300_cart_chicago`) whose axes are not constants.
        groups = groups_of(self.errors, spec)
        model = InsModel.from_spec(spec, standing=standing(), unsteady=not self.steady, groups=groups)
        return replace(self, spec=spec, model=model)

    def with_constant_axes(self) -> MovingTask:
        """The task whose gyros have axes that stay as they are: the same one where there are no states of them."""
        other = replace(self, steady=True).with_spec(self.spec)
        return self if other.model.turn_noise == self.model.turn_noise else other

    def with_level_biases_held(self) -> MovingTask:
        """The task whose accelerometers have a bias along the vertical only: across it nothing tells a bias from a tilt."""
        model = InsModel.from_spec(self.spec, groups=groups_of(self.errors, self.spec))
        return replace(self, held=True, model=model)

    def without_slow_errors(self) -> list[MovingTask]:
        """The task without each of the slow errors that innovations have shown."""
        return [replace(self, lasting=less) for less in one_less(self.lasting)]

    def with_lasting_fixes(self, track: Track) -> Track:
        """A track of this task with position known no better than fixes whose slow error nobody spoke of; so of their delay."""
        known = as_unsure(known_as_fixes(track, self.gnss, self.antenna.bias_sigma), self.delay_spread)
        return as_lasting(known, self.aiding(gated=True)) if self.usual_fixes else known

    def aiding(self, *, gated: bool) -> list[Aiding]:
        """Of all sensors; without gates as long as the filter may be wrong itself."""
        wheel, antenna = (m if gated else replace(m, gate=0.0) for m in (self.wheel, self.antenna))
        found = list(self.stops)
        if self.odometer is not None:
            log = self.odometer
            found += (
                from_odometer(log, wheel) if isinstance(log, OdometerRecord) else from_velocity(log, wheel, self.slow)
            )
        if self.gnss is not None:
            shown = from_gnss(self.gnss, antenna)
            found += self._of_swing(shown)
        found += [source if gated else replace(source, gate=0.0) for source in self.more]
        found = with_scatter(louder(with_slow(found, self.lasting), self.factors), self.scattered)
        found = of_known_motion(found, self.moves)
        return on_springs(found) if self.sprung else found

    def _of_swing(self, shown: list[Aiding]) -> list[Aiding]:
        """A receiver's measurements with what is known of the antenna's swing."""
        if not (self.swing_apart or self.shaken):
            return shown
        askew = float(axis_sigma(self.spec)[0].max())
        return with_unseen_arm(shown, self.record, askew, shaken=self.shaken)

    def run(self, guess: Guess, *, gated: bool, until: float | None = None, smooth: bool = False) -> Track:
        """One pass from a guess of the attitude at the start; smoothed with a row at each interval."""
        record = self.record if until is None else self.record.between(self.record.time[0], until)
        used = of_the_path(self.aiding(gated=gated), record)
        start = start_at(self.record, guess, self.begin, self.spec, self.odometer, self.gnss, self.wheel, self.antenna)
        if self.held:
            up = start.C_nb[2]
            P = start.P.copy()
            P[BA, BA] = up @ P[BA, BA] @ up * np.outer(up, up)
            start = replace(start, P=P)
        return navigate_track(
            record,
            start,
            with_states(self.model, used),
            used,
            interval=INTERVAL,
            every=1 if smooth else max(1, round(OUTPUT / INTERVAL)),
            smooth=smooth,
            invariant=AS_IT_IS if self.odometer is None else OVER_GROUND,
        )

    @property
    def begin(self) -> Position:
        """Where the IMU begins: by a fix as well as the antenna's arm is known, which may point anywhere.

        A prior that is narrower bends an arm of 60 m to 10, until the first turn shows it by what looks like a receiver led away.
        """
        if not self.by_fix:
            return self.position
        sigma = math.hypot(*self.antenna.lever_arm, self.antenna.lever_arm_sigma)
        far, high = (math.hypot(own, sigma) for own in (self.position.horizontal_sigma, self.position.vertical_sigma))
        return replace(self.position, horizontal_sigma=far, vertical_sigma=high)

    def by_the_earth(self) -> Guess:
        """Coarse alignment."""
        return coarse_guess(self.record, self.position, self.odometer, self.gnss, self.wheel, self.antenna)


def moving_task(
    record: ImuRecord,
    imu: Any,
    odometer: OdometerRecord | VelocityRecord | None,
    gnss: GnssRecord | None,
    position: Position | None,
    wheel: Mounting | None,
    antenna: Mounting | None,
    more: Sequence[Aiding],
    zupt: bool,
    calibration: Calibration | None,
    offset: float,
) -> MovingTask:
    """From what is given to one task: gaps bridged, sensors on one clock, stops found."""
    if odometer is None and gnss is None:
        raise UsageError(
            "alignment on the move without an odometer, a velocity log and GNSS; expected odometer= or velocity=, gnss= or both"
        )
    if imu is None:
        raise UsageError("alignment on the move needs the IMU's specification: imu='navigation', a file or an ImuSpec")
    spec = with_rounding(imu_spec(imu), record)
    record, _, gaps = bridge_gaps(corrected(record, spec, calibration))
    if record.duration < SHORTEST:
        raise AlignmentError(f"{record.source}: {record.duration:g} s; at least {SHORTEST:g} s are needed on the move")
    odometer = None if odometer is None else odometer.shifted(offset)
    gnss = None if gnss is None else _with_floors(gnss.shifted(offset))
    record, waited = _from_the_first_aid(record, odometer, gnss)
    if waited and position is not None:
        far = math.hypot(position.horizontal_sigma, USUAL_SPEED * waited)
        position = None if has_fixes(gnss) else replace(position, horizontal_sigma=far)
    by_fix = position is None and has_fixes(gnss)
    if position is None:
        position = first_fix(record, gnss, odometer) if has_fixes(gnss) else Position(SOMEWHERE)
    elif gnss is not None:
        check_fixes(gnss, position, float(record.time[0]))
    wheel = WHEEL if wheel is None else wheel
    if isinstance(odometer, OdometerRecord):
        check_unit(record, odometer, gnss, wheel)
    spec = seen_in(spec, record).with_coning_of(record)
    stops: list[Aiding] = list(gaps)
    if zupt:
        still, disturbed = seconds_at_rest(record, odometer, gnss)
        stops += updates_at(record, still, disturbed, velocity_at_rest(disturbed, odometer, gnss), odometer)
    return MovingTask(
        record,
        spec,
        InsModel.from_spec(spec),
        position,
        odometer,
        gnss,
        wheel,
        usual_antenna(gnss) if antenna is None else antenna,
        stops,
        more,
        waited=waited,
        usual_fixes=antenna is None,
        by_fix=by_fix,
    )


def _from_the_first_aid(
    record: ImuRecord, odometer: OdometerRecord | VelocityRecord | None, gnss: GnssRecord | None
) -> tuple[ImuRecord, float]:
    """The record from where its aiding begins, and how much of it is left out, s: nothing where the vehicle stands until then.

    A vehicle that drives before the first fix has neither speed nor place nor heading: no guess of the attitude leads anywhere.

    Raises
    ------
    AlignmentError
        Of a vehicle that drives until then, fewer seconds are aided than are needed.
    DataError
        All aiding begins after the end of the record, or ends before it begins.
    """
    begin = float(record.time[0])
    logs = [log for log in (odometer, gnss) if log is not None]
    first = min(float(log.time[0]) for log in logs)
    if first > record.time[-1] or max(float(log.time[-1]) for log in logs) < begin:
        raise no_overlap(logs[-1].source, _span(logs[-1]), record.source, _span(record))
    if first - begin < LONGEST_ALONE:
        return record, 0.0
    motion = motion_summary(record.between(begin, first))
    stood = motion.fraction("moving") + motion.fraction("rotating") == 0.0
    if stood and first_speed(odometer, gnss, first) < UNDER_WAY:
        return record, 0.0
    aided = float(record.time[-1]) - first
    if aided < SHORTEST:
        raise AlignmentError(
            f"{record.source}: only {max(aided, 0.0):.1f} s of the log are aided, and the vehicle drives before that; at least "
            f"{SHORTEST:g} s are needed on the move"
        )
    return record.between(first, None), first - begin


def in_body_axes(
    odometer: OdometerRecord | None, velocity: VelocityRecord | None
) -> OdometerRecord | VelocityRecord | None:
    """The one sensor that shows velocity in body axes."""
    if odometer is not None and velocity is not None:
        raise UsageError("an odometer and a velocity log; expected one of them, and the other as a further source")
    if velocity is not None and velocity.frame != "body":
        raise UsageError(
            f"{velocity.source}: velocities east, north, up; alignment on the move takes those of a GNSS log, with positions, or "
            "velocities in body axes (v_right, v_forward, v_up)"
        )
    return odometer or velocity


def _with_floors(gnss: GnssRecord) -> GnssRecord:
    """A receiver's own sigma leaves out clocks, and what moves between its antenna and the IMU."""

    def floored(sigma: Array | None, floor: float) -> Array | None:
        return None if sigma is None else np.where(np.isfinite(sigma), np.hypot(sigma, floor), sigma)

    return replace(
        gnss,
        position_sigma=floored(gnss.position_sigma, POSITION_FLOOR),
        velocity_sigma=floored(gnss.velocity_sigma, VELOCITY_FLOOR),
    )


def usual_antenna(gnss: GnssRecord | None) -> Mounting:
    """Of an antenna of which nothing is said: late by an unknown time, its fixes off together for minutes."""
    return replace(ANTENNA, bias_sigma=usual_bias(gnss), bias_time=USUAL_TIME)


def _span(log: ImuRecord | GnssRecord | OdometerRecord | VelocityRecord) -> tuple[float, float]:
    return float(log.time[0]), float(log.time[-1])


def has_fixes(gnss: GnssRecord | None) -> TypeGuard[GnssRecord]:
    """Whether there is a receiver with positions."""
    return gnss is not None and bool(gnss.has_position.any())


def first_fix(record: ImuRecord, gnss: GnssRecord, odometer: OdometerRecord | VelocityRecord | None = None) -> Position:
    """Where a log begins, by GNSS: no farther from the nearest fix than the vehicle goes in between, and while fixes are late.

    Raises
    ------
    DataError
        All fixes come after the log, or so long before it that it may have begun anywhere.
    """
    fixes = np.flatnonzero(gnss.has_position)
    nearest = fixes[int(np.argmin(np.abs(gnss.time[fixes] - record.time[0])))]
    alt = float(gnss.alt[nearest])
    lat, lon = float(gnss.lat[nearest]), float(gnss.lon[nearest])
    apart = abs(float(gnss.time[nearest] - record.time[0])) + LATENCY_SIGMA
    at = float(gnss.time[nearest])
    gone = max(apart * speed_at(gnss, at), driven(odometer, *sorted((at, float(record.time[0])))))
    far, high = math.hypot(FIRST_FIX[0], gone), math.hypot(FIRST_FIX[1], gone)
    if gnss.time[fixes[0]] > record.time[-1] or (gnss.time[fixes[-1]] < record.time[0] and far > ANYWHERE):
        raise no_overlap(gnss.source, _span(gnss), record.source, _span(record))
    return Position(lat, lon, alt if np.isfinite(alt) else 0.0, far, high)
