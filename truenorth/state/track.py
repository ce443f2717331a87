"""Many epochs: the track of a vehicle, with covariance, and what the measurements on the way said."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.core.attitude import misalignment
from truenorth.core.earth import radii
from truenorth.core.errors import DataError
from truenorth.records.motion import MotionStates
from truenorth.state.layout import BA, BG, DV, SLOW_ACCEL, SLOW_GYRO, STATES, Layout

Array = NDArray[np.float64]
Rows = slice | NDArray[np.integer[Any]] | NDArray[np.bool_]

NOTHING = 1e-9  # m/s: a zero that was turned from axes into others
UNEVEN = 0.01  # share of the interval by which the time steps of even epochs may differ

ARRAYS = ("time", "C_nb", "v_n", "position", "sensors", "P")  # of a track, a row an epoch
RESIDUALS = ("time", "innovation", "sigma", "nis", "used", "stamp", "jumped")  # of residuals, a row a measurement


def velocity_sigma(sigma: Array) -> Array:
    """(..., 3) of all states' one-sigma those of the velocity, m/s; NaN where height is held and nobody measures its rate."""
    of_velocity = sigma[..., DV]
    return np.where(of_velocity > NOTHING, of_velocity, np.nan)


@dataclass(frozen=True)
class Residuals:
    """What one source's measurements said against the prediction.

    Attributes
    ----------
    name : str
    time : (M,) array, s
    innovation, sigma : (M, 3) arrays
        Predicted less measured, and the one-sigma expected of it; NaN where absent.
    nis : (M,) array
        Normalised innovation squared of the rows together; its mean is their number where the model is right.
    used : (M,) array of bool
        Not rejected by the gate.
    outside : int
        Measurements before the start or after the end of the IMU's log, and those that came too late.
    stamp : (M,) array, s
        The measurements' own times, which differ from `time` where they are re-timed.
    jumped : (M,) array of bool
        Where a jump was believed, and taken up.
    unit : str
        Of the innovations, SI.
    axes : tuple of str
        Names of their components.
    passed : int
        Of `outside`: measurements that came when a run had gone past their time.
    """

    name: str
    time: Array
    innovation: Array
    sigma: Array
    nis: Array
    used: NDArray[np.bool_]
    outside: int
    stamp: Array
    jumped: NDArray[np.bool_]
    unit: str = "m/s"
    axes: tuple[str, ...] = ("east", "north", "up")
    passed: int = 0

    @property
    def rows(self) -> NDArray[np.int64]:
        """(M,) how many components each measurement has."""
        return np.isfinite(self.innovation).sum(axis=1)

    @property
    def rejected(self) -> int:
        """How many the gate kept out."""
        return int(np.sum(~self.used))


@dataclass(frozen=True)
class Track:
    """The state along the track, ENU; one row an output epoch."""

    time: Array  # (K,) s
    C_nb: Array  # (K, 3, 3)
    v_n: Array  # (K, 3) m/s
    position: Array  # (K, 3): latitude, longitude (rad), height (m)
    sensors: Array  # (K, n): what is assumed of the sensors, in the places of the states: biases, scale factors, ..
    P: Array  # (K, n, n): covariance of the errors; K = 0 where none was asked for
    layout: Layout  # of the states
    residuals: tuple[Residuals, ...]
    smoothing: Callable[[], Track] | None = field(
        default=None, repr=False, compare=False
    )  # put off until it is asked for

    @classmethod
    def of_motion(cls, time: Array, C_nb: Array, v_n: Array, position: Array, biases: Array | None = None) -> Track:
        """A track that is a motion alone: the truth, or a free INS; `biases` (6,), of gyros and accelerometers, are assumed."""
        sensors = np.zeros(STATES)
        if biases is not None:
            sensors[BG], sensors[BA] = biases[:3], biases[3:]
        assumed = np.broadcast_to(sensors, (len(time), STATES))
        return cls(time, C_nb, v_n, position, assumed, np.zeros((0, STATES, STATES)), Layout(), ())

    def __len__(self) -> int:
        return len(self.time)

    def __getitem__(self, rows: Rows) -> Track:
        """Some of the epochs; the residuals, which have rows of their own, stay with the whole track."""
        some = {name: values[rows] if len(values) else values for name in ARRAYS for values in [getattr(self, name)]}
        return replace(self, residuals=(), smoothing=None, **some)

    def whole(self) -> Track:
        """The track smoothed, where that was put off; else itself.

        Innovations are the filter's either way, and so is the last epoch: most tracks that are tried are ruled out by these.
        """
        return self if self.smoothing is None else self.smoothing()

    @cached_property
    def interval(self) -> float:
        """From epoch to epoch, s.

        Raises
        ------
        DataError
            Fewer than two epochs, or time steps that differ.
        """
        steps = np.diff(self.time)
        if len(steps) < 1:
            raise DataError(f"a track of {len(self)} epochs; expected two at least")
        odd = np.flatnonzero(np.abs(steps - np.median(steps)) > UNEVEN * np.median(steps))
        if odd.size:
            raise DataError(
                f"a track with a step of {steps[odd[0]]:.3f} s after {self.time[odd[0]]:.3f} s, all others are "
                f"{np.median(steps):.3f} s; expected even epochs"
            )
        return float((self.time[-1] - self.time[0]) / len(steps))

    @classmethod
    def along(cls, motion: MotionStates) -> Track:
        """The track of a motion at times (K,): a simulator's truth."""
        place = np.stack([motion.lat, motion.lon, motion.alt], axis=1)
        return cls.of_motion(motion.time, motion.C_nb, motion.v_n, place)

    def errors_against(self, truth: Track, at: Rows = slice(None)) -> Array:
        """(K, 9) errors phi, dv and dp (rad, m/s, m; ENU, computed minus true) against the truth's epochs `at`, all by default."""
        C, v, (lat, lon, alt) = truth.C_nb[at], truth.v_n[at], truth.position[at].T
        R_M, R_N = radii(lat)
        away = (self.position[:, 1] - lon + np.pi) % (2.0 * np.pi) - np.pi
        north, up = (self.position[:, 0] - lat) * (R_M + alt), self.position[:, 2] - alt
        dp = np.stack([away * (R_N + alt) * np.cos(lat), north, up], axis=1)
        return np.concatenate([misalignment(self.C_nb, C), self.v_n - v, dp], axis=1)

    def bias(self, group: slice, slow: str) -> Array:
        """(K, 3) a sensor's whole bias, its slow part included."""
        own = self.layout.slice_of(slow)
        return self.sensors[:, group] + (0.0 if own is None else self.sensors[:, own])

    @property
    def gyro_bias(self) -> Array:
        """(K, 3) rad/s."""
        return self.bias(BG, SLOW_GYRO)

    @property
    def accel_bias(self) -> Array:
        """(K, 3) m/s^2."""
        return self.bias(BA, SLOW_ACCEL)

    def bias_sigma(self, group: slice, slow: str) -> Array:
        """(K, 3) one-sigma of :meth:`bias`."""
        J = np.eye(self.layout.states)[group]
        if (own := self.layout.slice_of(slow)) is not None:
            J[:, own] += np.eye(3)
        return np.sqrt(np.maximum(np.einsum("ij,kjl,il->ki", J, self.P, J), 0.0))

    @property
    def sigma(self) -> Array:
        """(K, n) one-sigma of the errors."""
        return np.sqrt(np.maximum(np.einsum("kii->ki", self.P), 0.0))


def in_one(tracks: Sequence[Track]) -> Track:
    """Tracks that follow each other, of one model and the same sources, as one."""
    if len(tracks) == 1:
        return tracks[0]
    together = zip(*(track.residuals for track in tracks), strict=True)
    return _joined(tracks, ARRAYS, residuals=tuple(_joined(parts, RESIDUALS) for parts in together))


def _joined(parts: Sequence[Any], names: Sequence[str], **more: Any) -> Any:
    """What has the arrays of all, and the rest of the last."""
    arrays = {name: np.concatenate([getattr(part, name) for part in parts]) for name in names}
    return replace(parts[-1], **arrays, **more)
