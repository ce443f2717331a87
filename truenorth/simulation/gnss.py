"""Simulated GNSS receiver and barometer: places and heights of points of the body."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.core.earth import earth_rate_n, radii, transport_rate_n
from truenorth.records import GnssRecord, HeightRecord
from truenorth.records.motion import MotionStates, Moving
from truenorth.records.unit_spec import value
from truenorth.simulation.aiding import Aided, Draws, OutlyingSpec, kept, outliers
from truenorth.simulation.motion import displaced
from truenorth.simulation.processes import first_order, gauss_markov
from truenorth.simulation.sensing import NODES, WEIGHTS

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class GnssSpec(OutlyingSpec[GnssRecord]):
    """A GNSS receiver and its errors; each value is of east and north, and `vertical` times as large upwards.

    Attributes
    ----------
    position_noise, position_drift : float, m
        Sigma of white noise, and of a first-order Gauss-Markov error.
    velocity_noise, velocity_drift : float, m/s
        The same of the velocity.
    correlation_time : float, s
        Of both Gauss-Markov errors.
    vertical : float
        Vertical sigma by horizontal.
    outlier_size : float, m
        Sigma of a position outlier.
    lever_arm : (3,) floats, m
        From the IMU to the antenna, IMU axes.
    """

    sensor = "gnss"
    position_noise: float = value("length", "m")
    position_drift: float = value("length", "m")
    velocity_noise: float = value("speed", "m/s")
    velocity_drift: float = value("speed", "m/s")
    correlation_time: float = value("time", "s", 100.0, sign="positive")
    vertical: float = value("ratio", "%", 1.5, sign="positive")
    outlier_size: float = value("length", "m", 30.0)
    lever_arm: tuple[float, float, float] = value("length length length", "m m m", (0.0, 0.0, 0.0), sign="any")

    def sense(self, body: Moving, times: Array, draws: Draws) -> Aided[GnssRecord]:
        """A GNSS receiver: the record's sigmas are those of drift and noise together, None where both are zero.

        Errors row by row: ``position_drift, position_noise, outliers`` (N, 3) m, ``velocity_drift, velocity_noise`` (N, 3) m/s.
        """
        shape, ratio = (len(times), 3), np.array([1.0, 1.0, self.vertical])
        errors: dict[str, Array] = {}
        for what in ("position", "velocity"):
            drift, noise = getattr(self, f"{what}_drift") * ratio, getattr(self, f"{what}_noise") * ratio
            generator = draws(f"{what}_drift")
            errors[f"{what}_drift"] = gauss_markov(drift, self.correlation_time, 1.0 / self.rate, len(times), generator)
            errors[f"{what}_noise"] = noise * draws(f"{what}_noise").standard_normal(shape)
        errors["outliers"] = outliers(self, self.outlier_size * ratio, shape, draws)
        there = kept(self, times, draws)
        times, errors = times[there], {name: error[there] for name, error in errors.items()}

        lat, lon, alt, v_n = place_of(body.states(times), self.lever_arm)
        lat, lon, alt = moved(lat, lon, alt, errors["position_drift"] + errors["position_noise"] + errors["outliers"])
        record = GnssRecord(
            times + self.latency,
            lat,
            lon,
            alt,
            v_n + errors["velocity_drift"] + errors["velocity_noise"],
            _sigma(math.hypot(self.position_drift, self.position_noise), ratio, len(times)),
            _sigma(math.hypot(self.velocity_drift, self.velocity_noise), ratio, len(times)),
            source="simulation",
        )
        return Aided(record, times, errors)


@dataclass(frozen=True, kw_only=True)
class HeightSpec(OutlyingSpec[HeightRecord]):
    """A barometer and its errors.

    Attributes
    ----------
    bias_sigma : float, m
        Constant, drawn anew in each run, on top of `bias`.
    drift, correlation_time : float, m and s
        Sigma of a first-order Gauss-Markov error.
    noise : float, m
        White, of each row.
    lag : float, s
        Time constant with which the reading follows the true height.
    outlier_size : float, m
    """

    sensor = "height"
    bias: float = value("length", "m", sign="any")
    bias_sigma: float = value("length", "m")
    drift: float = value("length", "m")
    correlation_time: float = value("time", "s", 1000.0, sign="positive")
    noise: float = value("length", "m")
    lag: float = value("time", "s")
    outlier_size: float = value("length", "m", 30.0)

    def sense(self, body: Moving, times: Array, draws: Draws) -> Aided[HeightRecord]:
        """A barometer, its reading settled at the start where it lags.

        Errors ``bias``, and row by row ``drift, noise, outliers, lag`` (N,) m, the last being what the lag leaves.
        """
        bias = self.bias + self.bias_sigma * draws("bias").standard_normal()
        drift = gauss_markov(self.drift, self.correlation_time, 1.0 / self.rate, len(times), draws("drift"), axes=1)[
            :, 0
        ]
        noise = self.noise * draws("noise").standard_normal(len(times))
        wild = outliers(self, self.outlier_size, times.shape, draws)
        there = kept(self, times, draws)
        true = body.states(times).alt
        lag = _lagging(body, times, self.lag) - true if self.lag > 0 else np.zeros_like(true)
        sigma = math.hypot(self.drift, self.noise)
        record = HeightRecord(
            times[there] + self.latency,
            (true + lag + bias + drift + noise + wild)[there],
            np.full(np.count_nonzero(there), sigma) if sigma > 0 else None,
            "simulation",
        )
        errors: dict[str, Any] = {"drift": drift, "noise": noise, "outliers": wild, "lag": lag}
        return Aided(record, times[there], {name: error[there] for name, error in errors.items()} | {"bias": bias})


def place_of(at: MotionStates, arm: Any) -> tuple[Array, Array, Array, Array]:
    """Latitude, longitude, height and velocity of a point of the body at an arm (m, body axes; one, or one each) from the IMU."""
    if not np.any(arm):
        return at.lat, at.lon, at.alt, at.v_n
    r = np.asarray(arm, dtype=np.float64)
    w_in_n = earth_rate_n(at.lat) + transport_rate_n(at.lat, at.alt, at.v_n)
    w_nb_b = at.w_ib_b - np.einsum("...ji,...j->...i", at.C_nb, w_in_n)
    away, moving = (at.C_nb @ r[..., None])[..., 0], np.einsum("...ij,...j->...i", at.C_nb, np.cross(w_nb_b, r))
    away, moving, v_n, still = (np.moveaxis(x, -1, 0) for x in (away, moving, at.v_n, np.zeros_like(away)))
    lat, lon, alt, v_n, _ = displaced((at.lat, at.lon, at.alt, v_n, still), (away, moving, still))
    return lat, lon, alt, np.ascontiguousarray(np.moveaxis(v_n, 0, -1))


def moved(lat: Array, lon: Array, alt: Array, error: Array) -> tuple[Array, Array, Array]:
    """A place with errors of metres east, north, up (..., 3)."""
    R_M, R_N = radii(lat)
    east, north, up = np.moveaxis(error, -1, 0)
    return lat + north / (R_M + alt), lon + east / ((R_N + alt) * np.cos(lat)), alt + up


def _sigma(horizontal: float, ratio: Array, count: int) -> Array | None:
    return np.tile(horizontal * ratio, (count, 1)) if horizontal > 0 else None


def _lagging(motion: Moving, times: Array, lag: float) -> Array:
    """Solution of ``lag y' + y = alt``, settled at the first time: the exact recursion, its input by quadrature."""
    step = float(times[1] - times[0])
    parts = math.ceil(max(4 * step / lag, 8 * step / motion.shortest_period))
    h = step / parts
    left = times[0] + h * np.arange(parts * (len(times) - 1))
    alt = motion.states(left[:, None] + 0.5 * h * (1.0 + NODES)).alt
    weights = 0.5 * h * WEIGHTS * np.exp(-0.5 * h * (1.0 - NODES) / lag) / lag
    first = float(motion.states(times[0]).alt)
    # Heights above the first keep the sum's rounding small.
    y = first_order(math.exp(-h / lag), (alt - first) @ weights)
    return first + np.concatenate([[0.0], y[parts - 1 :: parts]])
