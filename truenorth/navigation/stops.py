"""Stops: while a vehicle stands, its velocity is zero, and while it stands still, its rotation too."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.aiding.source import Aiding
from truenorth.core.earth import radii
from truenorth.core.errors import UsageError
from truenorth.core.position import eastward
from truenorth.quality.aid_noise import STANDING
from truenorth.quality.innovations import NO_ROTATION
from truenorth.quality.regimes import DISTURBED, STILL, motion_summary
from truenorth.records import GnssRecord, ImuRecord, OdometerRecord, VelocityRecord
from truenorth.state.layout import DV
from truenorth.state.track import Track
from truenorth.strapdown.increments import increments

Array = NDArray[np.float64]

STILL_VELOCITY = 0.01  # m/s, one sigma of a base on which nothing is seen to move
DISTURBED_VELOCITY = 0.03  # m/s, of one that people, wind or an engine shake
BIAS_CHANGE = math.radians(
    0.05
)  # rad/s: of poor gyros while they warm up, or by the earth's rate when a vehicle has turned
FEWEST_FIXES = 5  # through which a line is laid
REACHES = (2.0, 5.0, 10.0, 20.0)  # s before and after a fix
SHARP = 0.4  # of the speed of standing: one sigma of a slope that is sharp enough
STANDING_PULSES = 1.5  # pulses of an odometer in a second: no more is standing
LEAST_ANGLE = 1e-9  # rad: of a simulated IMU that nothing shakes
NEAR = 1.0  # s, within which a second of rest must have been seen by a sensor
LONG_ENOUGH = 30.0  # s: of fewer epochs a filter does not separate a base's motion from its rate
CALM = 5.0  # times the acceleration of nearly all seconds at rest: a vehicle that moves pushes more
DIFFERS = 6.0  # times the usual difference of rates of two seconds at rest, from which a rate is another
MOST_VOTES = 300  # seconds that say what the usual rate is
APART = 1.5  # s: seconds further apart are two rests
EDGE = 3  # seconds at either end of a stop, in which a vehicle may still roll, or set off
INSIDE = 10  # seconds, further in, with which they are compared
FEWEST_SECONDS = 3  # of a stop: of fewer nothing says whether their force is tilt or braking
KNOWN = 3.0  # m/s, one sigma of the velocity of a free INS that says whether its vehicle moves
BEYOND = 6.0  # of its sigmas, by which that is more than the speed of standing
SPREAD = 0.25  # s before and after the middle of a second at rest, between which its row is drawn


def stops_in(record: ImuRecord) -> tuple[Array, Array]:
    """Seconds at rest, found from the IMU alone.

    Constant velocity looks like rest to an IMU, but a vehicle that drives shakes. Seconds without any motion above the
    sensor's noise count anywhere; seconds of small disturbances only before the vehicle first moves. The second after one in
    which it moves does not count: a vehicle sets off with a push, but rolls to rest, and may have .1 m/s in it, ten times the
    sigma of rest, with less acceleration than tells motion from tilt. Nor does one in which it turns evenly on the spot: its
    rate is not that of the other seconds, and no bias changes by so much. Seconds at the ends of a stop count where their forces,
    against those inside the stop, change no velocity beyond the sigma of rest.

    Returns
    -------
    still, disturbed : (m,) arrays, s
        Middles of the seconds, on the record's clock.
    """
    motion = motion_summary(record)
    if motion.time.size == 0:
        return np.empty(0), np.empty(0)
    moves = motion.kind > DISTURBED
    before = ~np.logical_or.accumulate(moves)
    rolls = np.concatenate([[False], moves[:-1]])
    still = ~rolls & (motion.kind == STILL)
    if still.any():
        off = np.linalg.norm(motion.rate - np.median(motion.rate[still], axis=0), axis=1)
        still &= off < BIAS_CHANGE + 5.0 * float(np.linalg.norm(motion.angle_noise))
    disturbed = before & (motion.kind == DISTURBED)
    stands = _without_rolling_ends(still, disturbed, motion.specific_force)
    middle = motion.time - 0.5
    return middle[still & stands], middle[disturbed & stands]


def _without_rolling_ends(still: NDArray[np.bool_], disturbed: NDArray[np.bool_], force: Array) -> NDArray[np.bool_]:
    """(m,) seconds at rest but for those at the ends of stops in which the base may move faster than the sigma of rest.

    Soft braking looks like tilt. Tilt and bias are those inside the stop; what the level force (m, 3) of a second is off from
    there changes the velocity, and that of the seconds further in, too, since it is zero at last.
    """
    stands = still | disturbed
    sigma = np.where(still, STILL_VELOCITY, DISTURBED_VELOCITY)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], stands, [False]]).astype(np.int8)))
    for first, end in zip(edges[::2], edges[1::2], strict=True):
        count = end - first
        if count < FEWEST_SECONDS:
            stands[first:end] = False
            continue
        ends = min(EDGE, (count - 1) // 2)
        for inwards in (np.arange(first, end), np.arange(first, end)[::-1]):
            inside = np.median(force[inwards[ends : min(ends + INSIDE, count - ends)]], axis=0)
            up = inside / max(float(np.linalg.norm(inside)), 1e-12)
            outwards = inwards[:ends][::-1]
            off = force[outwards] - inside
            # m/s: each lasts a second
            velocity = np.linalg.norm(np.cumsum(off - np.outer(off @ up, up), axis=0), axis=1)
            stands[outwards[np.logical_or.accumulate(velocity > sigma[outwards])]] = False
    return stands


def turned_in_stops(
    record: ImuRecord, *logs: OdometerRecord | GnssRecord | VelocityRecord | None
) -> tuple[Array, Array]:
    """Middles of seconds (m,) that would be rest but for their rate; by how much that is not the usual one of rest (m, 3), rad/s.

    Sensors of speed see the vehicle stand, and it pushes no more than at rest. Either it turns on the spot, or the biases of its
    gyros are not those of the other stops.
    """
    motion = motion_summary(record)
    rest = motion.kind == STILL
    if rest.sum() < 2:
        return np.empty(0), np.empty((0, 3))
    calm = motion.acceleration <= CALM * float(np.quantile(motion.acceleration[rest], 0.95))
    apart = float(np.median(np.linalg.norm(np.diff(motion.rate[rest], axis=0), axis=1)))  # from second to second
    near = max(BIAS_CHANGE, DIFFERS * apart)
    some = motion.rate[rest][:: max(1, int(rest.sum()) // MOST_VOTES)]
    close = np.linalg.norm(some[:, None] - some, axis=2) < 0.5 * near
    at, off = motion.time - 0.5, motion.rate - np.median(some[close[np.argmax(close.sum(axis=1))]], axis=0)
    another = calm & (np.linalg.norm(off, axis=1) > near)
    another &= _standing(at, [_speed_of(log) for log in logs if log is not None])
    return at[another], off[another]


def seconds_at_rest(
    record: ImuRecord,
    odometer: OdometerRecord | VelocityRecord | None = None,
    gnss: GnssRecord | None = None,
    velocity: VelocityRecord | None = None,
) -> tuple[Array, Array]:
    """Middles of the seconds in which the IMU sees no motion and no other sensor a speed: still, and disturbed, s.

    Steady driving on a good road looks like rest to an IMU alone; a wheel that stands may slide. All that look must agree, and
    where there are sensors of speed one must have looked.
    """
    seconds = stops_in(record)
    speeds = [_speed_of(log) for log in (odometer, gnss, velocity) if log is not None]
    if not speeds:
        return seconds
    agreed = [at[_standing(at, speeds)] for at in seconds]
    return agreed[0], agreed[1]


def _standing(at: Array, speeds: Sequence[tuple[Array, Any]]) -> NDArray[np.bool_]:
    """Around which of these times a sensor of speed has looked, and none has seen one."""
    looked = sum((_near(at, time) for time, _ in speeds), np.zeros(len(at), dtype=np.intp))
    moved = sum((_near(at, time[moves]) for time, moves in speeds), np.zeros(len(at), dtype=np.intp))
    return np.asarray((looked > 0) & (moved == 0))


def longest_rest(*seconds: Array) -> Array:
    """Middles of the seconds (m,) of the longest rest among seconds at rest, in any order; empty where it is too short to align."""
    all_of = np.sort(np.concatenate(seconds))
    longest = max(np.split(all_of, np.flatnonzero(np.diff(all_of) > APART) + 1), key=len)
    return longest if len(longest) >= LONG_ENOUGH else all_of[:0]


def _near(at: Array, times: Array, within: float = NEAR) -> NDArray[np.intp]:
    """How many of these times lie near each of those."""
    return np.searchsorted(times, at + within) - np.searchsorted(times, at - within)


def velocity_at_rest(at: Array, *logs: OdometerRecord | GnssRecord | VelocityRecord | None) -> float:
    """One-sigma velocity of a base that is shaken, m/s: as usual, or as its sensors of velocity say around these times.

    An underwater vehicle that hovers is at rest to wheel and IMU, and sways by .1 m/s. White noise, half the mean square of
    differences of rows that follow each other, is none of it.
    """
    found = DISTURBED_VELOCITY**2
    for log in logs:
        velocity = log.velocity if isinstance(log, VelocityRecord) else log.v_n if isinstance(log, GnssRecord) else None
        if log is None or velocity is None or not len(at):
            continue
        v = velocity[_near(log.time, at) > 0]
        for axis in v.T:
            axis = axis[np.isfinite(axis)]
            if len(axis) > FEWEST_FIXES:
                found = max(found, float(np.mean(axis**2) - 0.5 * np.mean(np.diff(axis) ** 2)))
    return math.sqrt(found)


def creeping(at: Array, wheel: OdometerRecord | VelocityRecord | None) -> Array:
    """(m,) speed that a wheel has in the seconds around these times, m/s; zero where it has no rows.

    A paver goes at 6 cm/s, as smooth as at rest; a car's wheels may show as much where it stands. No zero velocity is known better.
    """
    if not isinstance(wheel, OdometerRecord):
        return np.zeros(len(at))
    way, span = (np.concatenate([[0.0], np.cumsum(x)]) for x in (wheel.distance, wheel.steps))
    first, last = (np.searchsorted(wheel.time, at + half, "right") for half in (-0.5, 0.5))
    return np.asarray(np.abs(way[last] - way[first]) / np.maximum(span[last] - span[first], 1e-9))


def _speed_of(log: OdometerRecord | GnssRecord | VelocityRecord) -> tuple[Array, NDArray[np.bool_]]:
    """When a sensor gave a speed, and whether it was motion."""
    if isinstance(log, OdometerRecord):
        time = log.time - 0.5 * log.steps
        if log.pulse_size is None:
            return time, np.abs(log.speed) > STANDING
        # One pulse in a row of .1 s would be a speed, and none may be a creeping vehicle: pulses count over a second.
        way = np.concatenate([[0.0], np.cumsum(log.values)]) * log.pulse_size
        first, last = (np.searchsorted(log.time, time + half, "right") for half in (-0.5, 0.5))
        return time, np.abs(way[last] - way[first]) > max(STANDING, STANDING_PULSES * log.pulse_size)
    velocity = log.v_n if isinstance(log, GnssRecord) else log.velocity
    if velocity is None or not np.isfinite(velocity[:, :2]).any():
        return _speed_of_places(log) if isinstance(log, GnssRecord) else (np.empty(0), np.empty(0, dtype=bool))
    level = velocity[:, :2]
    said = np.isfinite(level).any(axis=1)
    return log.time[said], np.linalg.norm(np.nan_to_num(level[said]), axis=1) > STANDING


def _speed_of_places(log: GnssRecord) -> tuple[Array, NDArray[np.bool_]]:
    """The same of fixes without velocities: the slope of a line through the fixes around each.

    The shortest stretch is taken whose slope is sharp enough to tell standing from motion, the scatter of neighbouring fixes
    being noise. Where even the longest is not, the fix says nothing.
    """
    fixed = np.isfinite(log.lat) & np.isfinite(log.lon)
    time, lat, lon = log.time[fixed], log.lat[fixed], log.lon[fixed]
    if time.size < FEWEST_FIXES:
        return np.empty(0), np.empty(0, dtype=bool)
    R_M, R_N = radii(lat[0])
    place = np.stack([eastward(lon, lon[0]) * R_N * np.cos(lat[0]), (lat - lat[0]) * R_M], axis=1)
    # Second differences of white noise have six times its variance; a steady course has none.
    noise = float(np.median(np.abs(np.diff(place, n=2, axis=0)))) / 0.6745 / np.sqrt(6.0)
    speed, said = np.full(time.size, np.nan), np.zeros(time.size, dtype=bool)
    t = time - time[0]
    sums = np.concatenate(
        [np.zeros((1, 7)), np.cumsum(np.column_stack([t**0, t, t**2, place, t[:, None] * place]), axis=0)]
    )
    for reach in REACHES:
        first, last = np.searchsorted(time, time - reach), np.searchsorted(time, time + reach, side="right")
        n, st, stt, *rest = (sums[last] - sums[first]).T
        spread = np.maximum(stt - st**2 / n, 1e-12)
        slope = np.stack([(rest[2 + i] - st * rest[i] / n) / spread for i in range(2)])
        sharp = ~said & (n >= FEWEST_FIXES) & (noise / np.sqrt(spread) < SHARP * STANDING)
        speed[sharp], said[sharp] = np.linalg.norm(slope[:, sharp], axis=0), True
    return time[said], speed[said] > STANDING


def angle_scatter(record: ImuRecord, seconds: Array) -> Array:
    """(3,) RMS difference of two angles about a place, rad, in the seconds around these times: noise, quantum, vibration.

    Of all samples about the line through a second of them: means over an interval of its own would not see an engine whose turns
    it holds a whole number of.
    """
    angle = np.cumsum(increments(record)[0], axis=0)
    count = min(max(FEWEST_FIXES, round(1.0 / record.interval)), len(angle))
    first = np.minimum(np.searchsorted(record.time, seconds - 0.5), len(angle) - count)
    part = angle[first[:, None] + np.arange(count)]
    x = np.linspace(-1.0, 1.0, count)
    left = part - part.mean(axis=1, keepdims=True)
    left -= np.einsum("k,mki->mi", x, left)[:, None] / (x @ x) * x[None, :, None]
    return np.asarray(np.sqrt(2.0 * np.mean(left**2, axis=(0, 1))))


def uneven(seconds: Array) -> Array:
    """Times drawn about the middles of these seconds, s: the same for the same seconds, and uneven.

    A mean rate errs by the angle of a vibration at both ends of its interval. Of an engine at a whole number of turns a second,
    rows a second apart meet the same phase: the error is a constant, like a bias, and many rows show no more than one, though
    the filter takes them for independent. At drawn times the phase is drawn, whatever the engine's speed; no even steps do that.

    Source: H. S. Shapiro and R. A. Silverman, "Alias-free sampling of random noise", J. SIAM 8 (1960).
    """
    return np.asarray(seconds + np.random.default_rng(0).uniform(-SPREAD, SPREAD, len(seconds)))


def zero_updates(
    record: ImuRecord,
    stops: str | Sequence[tuple[float, float]],
    odometer: OdometerRecord | None = None,
    gnss: GnssRecord | None = None,
    velocity: VelocityRecord | None = None,
) -> list[Aiding]:
    """Zero velocities, and zero rotations of seconds without any motion.

    Parameters
    ----------
    stops : "auto" or sequence of (start, stop)
        Found from the IMU, or given, s on the record's clock. Of those that are given the IMU says in which seconds nothing moves.
    odometer, gnss, velocity : records, optional
        Sensors of speed that have a say in what is found.

    Raises
    ------
    UsageError
        A stop that ends before it begins.
    """
    if isinstance(stops, str):
        if stops != "auto":
            raise UsageError(f"zupt={stops!r}; expected 'auto' or pairs of seconds (start, stop)")
        still, disturbed = seconds_at_rest(record, odometer, gnss, velocity)
        shaken = velocity_at_rest(disturbed, gnss, velocity)
    else:
        shaken = DISTURBED_VELOCITY
        seconds = []
        for start, stop in stops:
            if not stop > start:
                raise UsageError(f"stop from {start:.12g} s to {stop:.12g} s; expected its end after its beginning")
            seconds.append(np.arange(start, stop, 1.0) + 0.5)
        given = np.concatenate(seconds) if seconds else np.empty(0)
        seen = stops_in(record)[0]
        still = seen[_inside(seen, stops)]
        disturbed = given[_near(given, still, 0.5) == 0]
    return updates_at(record, still, disturbed, shaken, odometer)


def _inside(at: Array, stops: Sequence[tuple[float, float]]) -> NDArray[np.bool_]:
    """Which seconds around these times lie in a stop."""
    inside = [(at - 0.5 >= start) & (at + 0.5 <= stop) for start, stop in stops]
    return np.any(inside, axis=0) if inside else np.zeros(len(at), dtype=np.bool_)


def updates_at(
    record: ImuRecord,
    still: Array,
    disturbed: Array,
    shaken: float = DISTURBED_VELOCITY,
    wheel: OdometerRecord | VelocityRecord | None = None,
) -> list[Aiding]:
    """Zero velocities in the seconds around these times, and zero rotations where nothing moves at all.

    `shaken` is the one-sigma velocity of the disturbed ones, m/s; a second in which the wheel goes may have its speed.
    """
    drawn = uneven(still)
    time = np.concatenate([drawn, disturbed])
    if time.size == 0:
        return []
    sigma = np.concatenate([np.full(still.size, STILL_VELOCITY), np.full(disturbed.size, shaken)])
    sigma = np.maximum(sigma, _shared(time, creeping(np.concatenate([still, disturbed]), wheel)))
    zero = np.zeros((time.size, 3))
    found = [Aiding("zero velocity", "velocity", time, zero, np.tile(sigma[:, None], 3))]
    if still.size:
        angle = np.tile(np.maximum(angle_scatter(record, still), LEAST_ANGLE), (still.size, 1))
        found.append(Aiding(NO_ROTATION, "rotation", drawn, np.zeros((still.size, 3)), angle))
    return found


def _shared(time: Array, speed: Array) -> Array:
    """(m,) sigma of zero velocities, m/s, of seconds in which the wheel goes: those of one stretch are off together, as one."""
    sigma, order = speed.copy(), np.argsort(time)
    goes = order[speed[order] > STILL_VELOCITY]
    for stretch in np.split(goes, np.flatnonzero(np.diff(time[goes]) > 2.0 * APART) + 1):
        sigma[stretch] *= math.sqrt(max(len(stretch), 1))
    return sigma


def while_it_stands(updates: Sequence[Aiding], free: Track) -> list[Aiding]:
    """Updates of stops without those at which a free INS still knows that its vehicle moves.

    An even speed looks like rest to an IMU: 16 m/s for the first 9 s of a drive did, and the start knew it to .1 m/s.

    Parameters
    ----------
    updates : sequence of Aiding
    free : Track
        From the start, with its covariance.
    """
    speed, sigma = np.linalg.norm(free.v_n[:, :2], axis=1), free.sigma[:, DV][:, :2].max(axis=1)
    known = np.logical_and.accumulate(sigma < KNOWN)
    moves = known & (speed > STANDING + BEYOND * sigma)
    found = []
    for source in updates:
        at = np.clip(np.searchsorted(free.time, source.time), 0, len(free.time) - 1)
        stands = ~moves[at] | (source.time > free.time[-1])
        if stands.any():
            rows = source.time[stands], source.measured[stands], source.sigma[stands]
            found.append(replace(source, time=rows[0], measured=rows[1], sigma=rows[2]))
    return found
