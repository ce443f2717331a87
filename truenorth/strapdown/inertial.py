"""What an IMU sees from a frame that does not rotate, and what the earth does there.

Two frames are frozen at the first sample: ``i``, the body frame, in which the gyros carry the attitude on without
knowing latitude or heading, and ``n0``, the local level frame (ENU), in which gravity's turn with the earth is known
in closed form. A constant rotation ``C_n0_i`` ties them: initial alignment is the search for it.

Source: Y. Qin, G. Yan et al., "Strapdown initial alignment on a swaying base using gravity in the inertial frame"
(2005); M. Wu et al., "Optimization-based alignment for inertial navigation systems", Aerosp. Sci. Technol. 15 (2011).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truenorth.core.attitude import skew
from truenorth.core.earth import EARTH_RATE, earth_rate_n, gravity_of_place
from truenorth.core.errors import AlignmentError
from truenorth.core.remembered import remembered
from truenorth.records import ImuRecord
from truenorth.strapdown.increments import in_blocks
from truenorth.strapdown.inertial_integration import at_start, go_on, integrals_of, interval_means

Array = NDArray[np.float64]
MOST_GRIDS = 4  # of one record
MOST_REMEMBERED = 10_000  # epochs: an alignment has 5000 at the most
SUB_EPOCHS = 5  # points within a filter interval at which the mean attitude is sampled


def earth_rotation(t: ArrayLike, lat: float) -> Array:
    """``C_n0_n(t)``: the local level frame at time t after freezing, seen from ``n0`` (Rodrigues, exact)."""
    return _earth_integral(t, lat, 0)


def gravity_velocity(t: ArrayLike, lat: float, alt: float) -> Array:
    """Integral of gravity in ``n0`` from 0 to t, (..., 3), m/s; the base stays where it is on the earth."""
    return _of_gravity(t, lat, alt, 1)


def gravity_position(t: ArrayLike, lat: float, alt: float) -> Array:
    """Second integral of gravity in ``n0`` from 0 to t, (..., 3), m."""
    return _of_gravity(t, lat, alt, 2)


def _earth_integral(t: ArrayLike, lat: float, order: int) -> Array:
    """Integrate ``exp([w_ie t x])`` `order` times from 0 to t; nobody writes to it."""
    t = np.asarray(t, dtype=np.float64)
    if t.ndim == 0:
        return _of_epochs(t.tobytes(), float(lat), order)[0]
    if t.ndim == 1 and t.size <= MOST_REMEMBERED:
        return _of_epochs(t.tobytes(), float(lat), order)
    return _integrated_rotation(t, lat, order)


def _of_gravity(t: ArrayLike, lat: float, alt: float, order: int) -> Array:
    """Gravity in ``n0``, integrated `order` times; nobody writes to it."""
    t = np.asarray(t, dtype=np.float64)
    if t.ndim == 1 and t.size <= MOST_REMEMBERED:
        return _gravity_of_epochs(t.tobytes(), float(lat), float(alt), order)
    return _earth_integral(t, lat, order) @ np.array([0.0, 0.0, -gravity_of_place(lat, alt)])


@lru_cache(maxsize=32)
def _gravity_of_epochs(times: bytes, lat: float, alt: float, order: int) -> Array:
    found = _of_epochs(times, lat, order) @ np.array([0.0, 0.0, -gravity_of_place(lat, alt)])
    found.flags.writeable = False
    return np.asarray(found)


@lru_cache(maxsize=32)
def _of_epochs(times: bytes, lat: float, order: int) -> Array:
    """The same of times (of doubles) that come again: in each pass over a log, and in each run of a campaign."""
    found = _integrated_rotation(np.frombuffer(times), lat, order)
    found.flags.writeable = False
    return found


def _integrated_rotation(t: Array, lat: float, order: int) -> Array:
    """``I a + K b + K^2 c`` with ``K = [w_ie x]/|w_ie|``."""
    t = t[..., None, None]
    K = skew(np.asarray(earth_rate_n(lat))) / EARTH_RATE
    w = EARTH_RATE
    half = np.sin(w * t / 2)
    if order == 0:
        a, b, c = np.ones_like(t), np.sin(w * t), 2 * half**2
    elif order == 1:
        a, b, c = t, 2 * half**2 / w, t - np.sin(w * t) / w
    else:
        a, b, c = t**2 / 2, (t - np.sin(w * t) / w) / w, t**2 / 2 - 2 * half**2 / w**2
    return np.asarray(a * np.eye(3) + b * K + c * (K @ K))


@dataclass(frozen=True)
class InertialIntegrals:
    """Attitude and integrated specific force of one log in frame ``i``, at the K + 1 ends of K filter intervals."""

    start: float  # s; time, on the record's clock, at which ``i`` is frozen: the beginning of the first row's interval
    time: Array  # (K+1,) s: since `start`; the first is 0
    C_ib: Array  # (K+1, 3, 3)
    velocity: Array  # (K+1, 3) m/s: ``int C_ib f_b dt``
    position: Array  # (K+1, 3) m: its integral
    C_mean: Array  # (K, 3, 3): mean of ``C_ib`` over each interval
    C_late: Array  # (K, 3, 3): mean of ``C_ib`` weighted by the elapsed part of the interval, ``(1/T^2) int s C_ib ds``
    C_ib_at: Array  # (M, 3, 3): ``C_ib`` after the rows that were asked for besides

    @cached_property
    def intervals(self) -> Array:
        """(K,) lengths of the filter intervals, s."""
        return np.diff(self.time)

    @cached_property
    def mean_velocity(self) -> Array:
        """(K, 3) mean over each interval of the integrated specific force, m/s."""
        return np.diff(self.position, axis=0) / self.intervals[:, None]

    @cached_property
    def mean_force(self) -> Array:
        """(K, 3) mean specific force of each interval in ``i``, m/s^2."""
        return np.diff(self.velocity, axis=0) / self.intervals[:, None]


def integrate(
    record: ImuRecord,
    interval: float = 1.0,
    gyro_bias: Array | None = None,
    accel_bias: Array | None = None,
    rows_at: ArrayLike = (),
    context: int = 0,
) -> InertialIntegrals:
    """Integrate a log in the inertial frame, known biases taken off.

    Parameters
    ----------
    record : ImuRecord
    interval : float, s
        Length of a filter interval; samples after the last whole interval serve `rows_at` alone.
    gyro_bias : (3,) array, rad/s, optional
    accel_bias : (3,) array, m/s^2, optional
    rows_at : sequence of int
        Rows after which the attitude is wanted besides.
    context : int
        Rows at the beginning that only serve the integration rules: the integrals begin after them.

    Raises
    ------
    AlignmentError
        The record is shorter than two filter intervals.
    """
    extra = np.asarray(rows_at, dtype=np.int64) + 1
    grid = _grid(record, interval, extra, context)
    if grid is None:
        raise AlignmentError(
            f"{record.source}: {_length(record, context):.2f} s of data; at least {2 * interval:g} s are needed for any answer: "
            "record longer, or use more of the log (`record.between`)"
        )
    C_all, v_all, p_all = _integrals(record, grid.every, gyro_bias, accel_bias)
    if context:  # every[0] is the edge after the context: epochs begin there
        C_0, v_0, since = C_all[0].T, v_all[0], grid.since[:, None]
        C_all, v_all, p_all = C_0 @ C_all, (v_all - v_0) @ C_0.T, (p_all - p_all[0] - since * v_0) @ C_0.T

    C, ends = C_all.take(grid.on_grid, axis=0), grid.on_grid[:: grid.sub]
    C_mean, C_late = interval_means(C, grid.time, grid.sub)
    return InertialIntegrals(
        start=float(record.time[context] - record.steps[context]),
        time=grid.time[:: grid.sub],
        C_ib=C_all.take(ends, axis=0),
        velocity=v_all.take(ends, axis=0),
        position=p_all.take(ends, axis=0),
        C_mean=C_mean,
        C_late=C_late,
        C_ib_at=C_all[grid.at],
    )


class _Grid(NamedTuple):
    """Where a log is cut: its times alone decide it."""

    every: NDArray[np.int64]  # (E,) rows after which anything is wanted, ascending
    on_grid: NDArray[np.intp]  # places among them of the points within intervals
    at: NDArray[np.intp]  # and of the rows that were asked for besides
    time: Array  # s; of the points
    since: Array  # (E,) s; of all, since the first
    sub: int  # points an interval


def _grid(record: ImuRecord, interval: float, extra: NDArray[np.int64], context: int) -> _Grid | None:
    """The cuts of a record, remembered for those that share its times; None where it is too short."""
    grids, key = _grids(record.time), (interval, extra.tobytes(), context)
    if key in grids:
        return grids[key]
    edges = _edges(record, context)
    count = int((edges[-1] + 0.5 * record.interval) // interval)
    if count < 2:
        return None
    sub = max(1, min(SUB_EPOCHS, int(interval / record.interval)))
    wanted = np.arange(count * sub + 1) * (interval / sub)
    epochs = np.clip(np.searchsorted(edges, wanted - 0.5 * record.interval), 0, len(record))
    every, back = np.unique(np.concatenate((epochs, extra)), return_inverse=True)
    if len(grids) == MOST_GRIDS:
        grids.clear()
    since = edges[every] - edges[every[0]]
    grids[key] = _Grid(every, back[: len(epochs)], back[len(epochs) :], edges[epochs], since, sub)
    return grids[key]


@remembered
def _grids(time: Array) -> dict[tuple[float, bytes, int], _Grid]:
    """What :func:`_grid` remembers of a record's times; those of a campaign's runs are one array."""
    return {}


def _edges(record: ImuRecord, context: int) -> Array:
    """(N + 1,) s: edge r stands before row r, at the end of row r - 1; zero behind the context."""
    edges = np.concatenate(([0.0], np.cumsum(record.steps)))
    return edges - edges[context]


def _length(record: ImuRecord, context: int) -> float:
    return float(_edges(record, context)[-1])


def _integrals(
    record: ImuRecord, every: NDArray[np.int64], gyro_bias: Array | None, accel_bias: Array | None
) -> tuple[Array, Array, Array]:
    """Attitude, velocity and position after so many rows each (ascending)."""
    none = np.zeros(3)
    bias = np.concatenate([none if gyro_bias is None else gyro_bias, none if accel_bias is None else accel_bias])
    state, out, done = at_start(), np.empty((len(every), 10)), 0
    for rows, dtheta, dvel in in_blocks(record):
        last = rows.stop == len(record)
        upto = len(every) if last else int(np.searchsorted(every, rows.stop, "right"))
        epochs = every[done:upto] - rows.start
        go_on(dtheta, dvel, record.steps[rows], epochs, bias, state, out[done:upto])
        done = upto
    return integrals_of(out)
