"""By how many seconds is a receiver's clock apart from the IMU's? What both see of the turns says it, however far that is.

GPS time is 18 s ahead of UTC, a logger counts from where it is switched on, a receiver counts the seconds of the day. A filter
finds a delay by itself as long as the vehicle goes about straight within it, some seconds; beyond that it loses the track. But the
course over ground and the gyros turn together: with the rate of course ``c``, clockwise, and that of the gyros about the vertical
``w``, the other way, both as means over a span, what is left of the turns at a lag ``l``

    E(l) = var(c(t + l) + w(t)) over all t that both have

is noise at the right one. No gain is fitted, so that stretches without turns explain nothing. The lag is known where one stands
out: most of the turns are explained there, but nowhere else, and not as the stamps are.

A vehicle that slips or flies sideways turns without its course and shows no lag. Where turns come again at even distances several
lags fit, and none is taken. The sums for all lags are correlations, found by FFT; what is absent counts nothing.

Source: C. H. Knapp and G. C. Carter, "The generalized correlation method for estimation of time delay", IEEE Trans. ASSP 24 (1976);
its use here, and the limits, are ours.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from truenorth.core.earth import radii
from truenorth.records import GnssRecord, ImuRecord
from truenorth.strapdown.increments import increments

Array = NDArray[np.float64]

SPANS = (1.0, 3.0, 10.0)  # s, of which means are taken: cars turn within seconds, ships within a minute
NEAR = 2.5  # s: a delay up to which a filter finds by itself
LONGEST = 7200.0  # s of each log, from its beginning, that are looked at
SLOWEST = 1.0  # m/s, below which a receiver's noise turns the course
REVERSED = math.radians(90.0)  # of course within a span: it drives back, or stands
LEAST = 30  # values that both have
EXPLAINED = 0.2  # of the turns is left at the lag, at most,
ELSEWHERE = 0.5  # and more than that anywhere else,
AS_STAMPED = 0.35  # and than that as the stamps are: turns of a ship last longer than clocks are apart
WHOLE = 0.5  # of the turns of one of them must lie where both are


def clock_apart(record: ImuRecord, gnss: GnssRecord) -> float | None:
    """Whole seconds by which a receiver's stamps are later than the IMU's, where turns show that they are; else None.

    The rest, and all that is less than some seconds, is a delay that a filter finds.
    """
    record = record[: max(2, int(np.searchsorted(record.time, record.time[0] + LONGEST)))]
    for span in SPANS:
        course, yaw = course_rate(gnss, span), yaw_rate(record, span)
        if course is None or yaw is None:
            continue
        lags, left = unexplained(course[1], yaw[1])
        late = course[0] - yaw[0] + 0.5 * span * lags
        if (best := _standing_out(late, left)) is not None:
            return float(round(best))
    return None


def _standing_out(late: Array, left: Array) -> float | None:
    """The lag that explains turns, s, where no other does and it is not about none."""
    best = int(np.argmin(left))
    if not 0 < best < len(left) - 1 or not np.isfinite(left[best - 1 : best + 2]).all():
        return None
    if left[best] > EXPLAINED or abs(late[best]) < NEAR:
        return None
    first, last = best, best  # of the dip about it
    while first > 0 and left[first - 1] < 1.0:
        first -= 1
    while last < len(left) - 1 and left[last + 1] < 1.0:
        last += 1
    others = np.append(left[:first], left[last + 1 :])
    as_stamped = left[np.argmin(np.abs(late))] if late[0] <= 0.0 <= late[-1] else np.inf
    if as_stamped < max(AS_STAMPED, 5.0 * left[best]) or np.any(others < max(ELSEWHERE, 3.0 * left[best])):
        return None
    before, there, after = left[best - 1 : best + 2]  # of a parabola through the three the lowest point
    return float(late[best] + 0.5 * (before - after) / (before - 2.0 * there + after) * (late[1] - late[0]))


def unexplained(course: Array, yaw: Array) -> tuple[Array, Array]:
    """(L,) lags in steps, from all of the one before the other to all behind, and the share of turns that is left at each.

    ``c[k + lag]`` is compared with ``w[k]``; infinite where too few have both. NaN is absent.
    """
    n = len(course) + len(yaw) - 1
    size = 1 << (n - 1).bit_length()

    def spectrum(a: Array) -> NDArray[np.complex128]:
        return np.asarray(np.fft.rfft(a, size))

    def together(a: Array, b: Array) -> Array:
        """Sum over k of ``a[k + lag] b[k]``, for each lag."""
        found = np.fft.irfft(spectrum(a) * np.conj(spectrum(b)), size)
        return np.asarray(
            np.concatenate([found[-(len(yaw) - 1) :] if len(yaw) > 1 else found[:0], found[: len(course)]])
        )

    has_c, has_w = np.isfinite(course) * 1.0, np.isfinite(yaw) * 1.0
    c, w = np.nan_to_num(course), np.nan_to_num(yaw)
    count = np.round(together(has_c, has_w))
    safe = np.maximum(count, 1.0)
    mean_c, mean_w = together(c, has_w) / safe, together(has_c, w) / safe
    of_c = together(c**2, has_w) / safe - mean_c**2
    of_w = together(has_c, w**2) / safe - mean_w**2
    both = together(c, w) / safe - mean_c * mean_w
    turns = np.maximum(of_c, of_w)
    share = np.maximum(*(count * of / max(float(np.max(count * of, initial=0.0)), 1e-300) for of in (of_c, of_w)))
    enough = (count >= LEAST) & (share > WHOLE) & (turns > 0.0)
    left = np.where(enough, (of_c + of_w + 2.0 * both) / np.where(enough, turns, 1.0), np.inf)
    return np.arange(-(len(yaw) - 1.0), len(course)), np.maximum(left, 0.0)


def course_rate(gnss: GnssRecord, span: float) -> tuple[float, Array] | None:
    """Time of the first value and mean rates of the course over a span, rad/s, clockwise, one each half span; NaN where unknown."""
    time, velocity = _velocity(gnss, span)
    some = time <= time[:1] + LONGEST
    time, velocity = time[some], velocity[some]
    if len(time) < LEAST or time[-1] - time[0] < LEAST * 0.5 * span or np.median(np.diff(time)) > span:
        return None
    at = time[0] + 0.5 * span * np.arange(int((time[-1] - time[0]) / (0.5 * span)) + 1)
    v = np.stack([np.interp(at, time, component) for component in velocity.T], axis=1)
    after = np.clip(np.searchsorted(time, at), 1, len(time) - 1)
    known = (time[after] - time[after - 1] <= 2.0 * span) & (np.linalg.norm(v, axis=1) > SLOWEST)
    course = np.where(known, np.arctan2(v[:, 0], v[:, 1]), np.nan)
    turned = np.angle(np.exp(1j * (course[2:] - course[:-2])))
    turned[~(np.abs(turned) < REVERSED)] = np.nan
    return float(at[1]), turned / span


def _velocity(gnss: GnssRecord, span: float) -> tuple[Array, Array]:
    """Times and (K, 2) velocities east and north: the receiver's, or of how far it gets in about a span."""
    if gnss.v_n is not None and gnss.has_velocity.sum() >= LEAST:
        known = gnss.has_velocity
        return gnss.time[known], gnss.v_n[known, :2]
    rows = np.flatnonzero(gnss.has_position)
    if len(rows) < LEAST:
        return np.zeros(0), np.zeros((0, 2))
    time, lat, lon = (a[rows] for a in (gnss.time, gnss.lat, gnss.lon))
    R_M, R_N = radii(float(lat[0]))
    place = np.stack([R_N * math.cos(lat[0]) * np.unwrap(lon), R_M * lat], axis=1)
    many = max(1, round(span / float(np.median(np.diff(time)))))
    step = time[many:] - time[:-many]
    return 0.5 * (time[many:] + time[:-many]), (place[many:] - place[:-many]) / step[:, None]


def yaw_rate(record: ImuRecord, span: float) -> tuple[float, Array] | None:
    """The same of the gyros about the vertical, which the mean specific force shows; counterclockwise."""
    if record.duration < LEAST * 0.5 * span:
        return None
    dtheta, dvel = increments(record)
    force = dvel.sum(axis=0)
    turned = np.cumsum(dtheta @ (force / max(float(np.linalg.norm(force)), 1e-300)))
    at = record.time[0] + 0.5 * span * np.arange(int(record.duration / (0.5 * span)) + 1)
    angle = np.interp(at, record.time, turned)
    return float(at[1]), (angle[2:] - angle[:-2]) / span
