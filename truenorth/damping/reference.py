"""A reference velocity made ready for damping: on the navigation's epochs, along east and north, freed of outliers and jumps.

The difference between an undamped INS and a healthy log is smooth: Schuler's oscillation changes it by millimetres a second
in a second, and its curvature over a minute is below a centimetre a second. So what jumps is the log, and it is found before
any filter sees it: no damping method has to survive it.

- An *outlier* differs from the running median by more than noise can: left out.
- A *jump* of the level, of either axis, is where straight lines through the minute before and the minute after do not meet:
  the log is held to its level before. Damping needs its changes, not its level; which of the two levels was right nobody knows.
  What the log does all the time, such as to drift, and what may turn with the hull in a turn, is no jump.
- A *gap* stays one: methods coast.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from truenorth.core.errors import DataError
from truenorth.damping.course import motion_at
from truenorth.errors.log import LogErrors, log_rows
from truenorth.records import VelocityRecord
from truenorth.state.evidence import Evidence, note
from truenorth.state.limits import limit
from truenorth.state.track import Track

Array = NDArray[np.float64]

MINUTE = 60.0  # s, of a running median and of the lines on both sides of a jump
FEWEST = 5  # measurements of them, where the epochs are far apart
SPLIT = 10.0  # s, of a gap over which nothing is compared
LEAST_NOISE = 1e-4  # m/s
GAP = 60.0  # s, from which a gap is named


@dataclass(frozen=True)
class Reference:
    """A reference velocity on the epochs of a course.

    Attributes
    ----------
    velocity : (K+1, 2) array, m/s
        East, north; NaN where absent.
    noise : float, m/s
        One-sigma white noise of an epoch.
    outliers : int
        Epochs left out.
    jumps : tuple of (float, float, float)
        Time (s) and size east, north (m/s) of each jump that was taken out.
    gaps : tuple of (float, float)
        Time and length (s) of each gap.
    source : str
    """

    velocity: Array
    noise: float
    outliers: int
    jumps: tuple[tuple[float, float, float], ...]
    gaps: tuple[tuple[float, float], ...]
    source: str

    def evidence(self) -> list[Evidence]:
        """What was wrong with it."""
        found = [note("log.outliers", count=self.outliers)] if self.outliers else []
        found += [note("log.jump", time=time, east=east, north=north) for time, east, north in self.jumps]
        return found + [note("log.silent", time=time, length=length) for time, length in self.gaps]


def reference_of(course: Track, record: VelocityRecord, errors: LogErrors, fine: Track | None = None) -> Reference:
    """Bring a velocity log onto a course.

    A log in body axes is turned by the course's attitude; one of forward speed alone is taken to make no leeway. What INS and
    log differ by, each row at its own time, is averaged about an epoch: that is smooth, also in turns and in waves, which the
    velocities are not.

    Parameters
    ----------
    course : Track
    record : VelocityRecord
    errors : LogErrors
        Its slow errors.
    fine : Track, optional
        The same INS at finer epochs, by which rows between the epochs of `course` are compared.

    Raises
    ------
    DataError
        No measurement within the course; navigation axes without east or north.
    """
    there = record.measured
    if record.frame == "navigation" and not there[:2].all():
        raise DataError(f"{record.source}: VE or VN is missing; expected both for damping")
    if record.frame == "body" and not there[1]:
        raise DataError(f"{record.source}: v_forward is missing; expected it for damping")
    T = course.interval
    nearest = np.floor((record.time - course.time[0]) / T + 0.5).astype(int)
    value = record.velocity[:, [1]] if record.frame == "body" else record.velocity[:, :2]
    inside = (record.time >= course.time[0]) & (record.time <= course.time[-1]) & np.isfinite(value).all(axis=1)
    if not inside.any():
        raise DataError(
            f"{record.source}: runs from {record.time[0]:.3f} s to {record.time[-1]:.3f} s, navigation from "
            f"{course.time[0]:.3f} s to {course.time[-1]:.3f} s: no overlap; expected one clock"
        )
    nearest, velocity = nearest[inside], np.nan_to_num(record.velocity[inside])
    seen = course if fine is None else fine
    C_nb, v_n = motion_at(seen, record.time[inside])
    if record.frame == "body":
        velocity = np.einsum("kij,kj->ki", C_nb, velocity)
    count = np.bincount(nearest, minlength=len(course))
    mean = np.full((len(course), 2), np.nan)
    full = count > 0
    times = np.bincount(nearest, record.time[inside], minlength=len(course))[full] / count[full]
    for axis in range(2):
        total = np.bincount(nearest, v_n[:, axis] - velocity[:, axis], minlength=len(course))
        off = _on_epochs(total[full] / count[full], times, course.time[full], T)
        mean[full, axis] = course.v_n[full, axis] - off
    given = None
    if record.sigma is not None:
        known = record.sigma[inside][np.isfinite(record.sigma[inside])]
        if known.size:
            given = float(np.median(known) / np.sqrt(np.median(count[full])))
    return cleaned(course, mean, record.source, given, change_of(course, errors))


def change_of(course: Track, errors: LogErrors) -> Array:
    """(K+1,) one-sigma of what errors fixed to the hull change in two minutes about each epoch, of the worse axis, m/s."""
    n = max(1, round(MINUTE / course.interval))
    k = np.arange(len(course))
    before, after = np.maximum(k - n, 0), np.minimum(k + n, len(course) - 1)
    groups = errors.groups()
    rows = log_rows(groups, course.C_nb, course.v_n)
    own = np.concatenate([np.zeros(0), *(group.prior for group in groups)])
    return np.asarray(np.sqrt(((rows[after] - rows[before]) ** 2 @ own**2).max(axis=1)))


def _on_epochs(off: Array, times: Array, epochs: Array, interval: float) -> Array:
    """Means of rows, carried from their mean times to the epochs by the median slope of two minutes, free of jumps and outliers."""
    if len(off) < FEWEST or np.abs(times - epochs).max() < 1e-6:
        return off
    n = max(FEWEST, round(2.0 * MINUTE / interval)) | 1
    slope = _running_median(np.diff(off) / np.diff(times), n)
    return np.asarray(off + np.append(slope, slope[-1]) * (epochs - times))


def cleaned(
    course: Track,
    velocity: Array,
    source: str = "reference",
    noise: float | None = None,
    change: Array | float = 0.0,
) -> Reference:
    """Free a reference velocity (K+1, 2) on a course's epochs of outliers and jumps.

    Parameters
    ----------
    course : Track
    velocity : (K+1, 2) array, m/s
        NaN where absent.
    source : str
    noise : float, optional
        White noise of an epoch, if known; the larger of this and what the data show is used.
    change : (K+1,) array or float, m/s
        One-sigma of what slow errors change from a minute before to a minute after.
    """
    allowed = limit("slow change of a log") * np.broadcast_to(np.asarray(change, dtype=np.float64), course.time.shape)
    rows = np.flatnonzero(np.isfinite(velocity).all(axis=1))
    n = max(FEWEST, round(MINUTE / course.interval)) | 1
    apart = max(SPLIT, 2.0 * course.interval) / course.interval
    d = course.v_n[:, :2] - velocity
    sigma = max(noise or 0.0, *(_white(column) for column in d[rows].T), LEAST_NOISE)
    kept, outliers, jumps = [], 0, []
    out = np.full_like(velocity, np.nan)
    level = np.zeros(2)
    for part in np.split(rows, np.flatnonzero(np.diff(rows) > apart) + 1):
        good = np.ones(len(part), dtype=bool)
        for column in d[part].T:
            off = np.abs(column - _running_median(column, n))
            good &= (
                off <= limit("outlier of a log") * max(sigma, _usual(off)) + limit("curvature of a log") + allowed[part]
            )
        outliers += int(np.sum(~good))
        part = part[good]
        held = np.tile(level, (len(part), 1))
        for k in _jumps(d[part], sigma, n, allowed[part]):
            size = _step(d[part], k, n)
            held[k:] += size
            jumps.append((float(course.time[part[k]]), float(-size[0]), float(-size[1])))
        out[part] = velocity[part] + held
        level = held[-1] if len(held) else level
        kept.append(part)
    return Reference(out, float(sigma), outliers, tuple(jumps), _gaps(course, np.concatenate(kept)), source)


def _white(x: Array) -> float:
    """White noise of a smooth signal's samples, from the median size of its second differences."""
    if len(x) < 10:
        return 0.0
    return float(1.4826 * np.median(np.abs(x[2:] - 2.0 * x[1:-1] + x[:-2])) / np.sqrt(6.0))


def _usual(sizes: Array) -> float:
    """One-sigma of the most of these sizes: what a log does all the time, such as to drift, is no fault of a moment."""
    return float(1.4826 * np.median(sizes))


def _running_median(x: Array, n: int) -> Array:
    from scipy.ndimage import median_filter

    return np.asarray(median_filter(x, size=n, mode="nearest"))


def _end_weights(n: int) -> Array:
    """(n,) weights that give, of n values in a row, the straight line's value half a step behind the last."""
    i = np.arange(n) - 0.5 * (n - 1)
    return np.asarray(1.0 / n + i * (0.5 * n) / np.sum(i**2))


def _differences(d: Array, n: int) -> Array:
    """(N, 2) of each place between rows k-1 and k, the line after it less the line before; zero near the ends."""
    weights = _end_weights(n)
    out = np.zeros_like(d)
    for axis in range(2):
        before = np.convolve(d[:, axis], weights[::-1], "valid")  # of rows k-n .. k-1, for k = n .. N
        after = np.convolve(d[:, axis], weights, "valid")  # of rows k .. k+n-1, for k = 0 .. N-n
        out[n : len(d) - n + 1, axis] = after[n:] - before[: len(d) - 2 * n + 1]
    return out


def _jumps(d: Array, sigma: float, n: int, allowed: Array) -> list[int]:
    """Rows at which the level jumps, in order: the largest first found, none within a window of another."""
    if len(d) < 2 * n + 1:
        return []
    size = np.abs(_differences(d, n))
    own = max(_usual(size[n : len(d) - n + 1].ravel()), sigma * float(np.sqrt(2.0 * np.sum(_end_weights(n) ** 2))))
    size, most = size.max(axis=1), limit("jump of a log") * own + limit("curvature of a log")
    size[: len(d)] -= allowed
    found: list[int] = []
    while size.max() > most:
        k = int(np.argmax(size))
        found.append(k)
        size[max(k - n, 0) : k + n] = 0.0
    return sorted(found)


def _step(d: Array, k: int, n: int) -> Array:
    """(2,) the line after row k-1 less the line before."""
    weights = _end_weights(n)
    return np.asarray(weights[::-1] @ d[k : k + n] - weights @ d[k - n : k])


def _gaps(course: Track, rows: NDArray[np.int64]) -> tuple[tuple[float, float], ...]:
    edges = course.time[np.concatenate([[0], rows, [len(course) - 1]])]
    steps = np.diff(edges)
    least = max(GAP, 3.0 * course.interval)
    return tuple((float(edges[i]), float(steps[i])) for i in np.flatnonzero(steps > least))
