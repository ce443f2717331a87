"""From a log at rest to what a filter needs of its noise, in one call.

The Allan variance of each channel is fitted by the processes that an :class:`truenorth.records.specs.ImuSpec` is made of, and that
filters and the simulator take: random walk, quantisation, and a bias that wanders as a first-order Gauss-Markov process,

``sigma^2(tau) = (2 b^2 / x) (1 - (3 - 4 e^-x + e^-2x) / (2 x))``, ``x = tau / T``, with b its sigma and T its correlation time,

which rises to .617 b at 1.89 T. Flicker noise and rate random walk, as far as the record is long, look like it.

Source: IEEE Std 952-1997, annex C, eq. C.20 (exponentially correlated noise).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truenorth.analysis.allan import (
    SHORTEST_RECORD,
    AllanDeviation,
    NoiseCoefficients,
    fit_noise,
    fit_shapes,
    overlapping_adev,
)
from truenorth.core.errors import UsageError
from truenorth.records import ImuRecord
from truenorth.records.spec_keys import unnamed
from truenorth.records.specs import ImuSpec, imu_spec

Array = NDArray[np.float64]

PER_OCTAVE = 2  # correlation times tried
SHORTEST = 20  # intervals: below it a wandering bias is noise
LONGEST = 4.0  # of the record's length


@dataclass(frozen=True)
class LogNoise:
    """Noise of an IMU as its log shows it."""

    spec: ImuSpec  # with the worst axis of each term
    # (2, 3): of gyros and accelerometers, SI, axis by axis; the step of the quantisation, the sigma of the Gauss-Markov bias
    random_walk: Array
    quantisation: Array  # (2, 3)
    bias_instability: Array  # (2, 3)
    random_walk_sigma: Array  # (2, 3): one-sigma of each; NaN where the log does not show the term
    quantisation_sigma: Array  # (2, 3)
    bias_instability_sigma: Array  # (2, 3)
    gyro: AllanDeviation  # what they were fitted to
    accel: AllanDeviation


def gauss_markov_variance(tau: ArrayLike, correlation_time: float) -> Array:
    """Allan variance (M,) of a first-order Gauss-Markov process of sigma 1 at averaging times `tau` (M,), s."""
    x = np.asarray(tau, dtype=np.float64) / correlation_time
    # Below .01 the closed form cancels; its series is x (2/3 - x/2 + 7 x^2/30).
    small = x < 0.01
    safe = np.where(small, 1.0, x)
    closed = 2.0 / safe * (1.0 - (3.0 - 4.0 * np.exp(-safe) + np.exp(-2.0 * safe)) / (2.0 * safe))
    return np.where(small, x * (2.0 / 3.0 - x / 2.0 + 7.0 * x**2 / 30.0), closed)


def noise_coefficients(record: ImuRecord) -> tuple[NoiseCoefficients, NoiseCoefficients]:
    """Noise coefficients of the gyros and of the accelerometers of a record at rest.

    The Allan variance at octave averaging times is fitted by the sum of the quantisation, random walk, bias
    instability and rate random walk terms (IEEE Std 952-1997, C.1), by weighted least squares, with no
    coefficient below zero and none that the data do not ask for. A record in motion gives the noise of the
    motion. The sigma of the random walk is honest on white noise (z-scores of RMS 0.95 over 900 simulated
    channels); that of the rate random walk, carried by few degrees of freedom, is optimistic by about 1.6.

    Parameters
    ----------
    record : ImuRecord
        At rest, evenly sampled.

    Returns
    -------
    gyro, accel : NoiseCoefficients

    Raises
    ------
    UsageError
        Fewer than 20 rows.
    """
    if len(record) < SHORTEST_RECORD:
        raise UsageError(f"{record.source}: {len(record)} rows; noise coefficients need at least {SHORTEST_RECORD}")
    gyro, accel = (fit_noise(data, record.interval, record.kind) for data in (record.gyro, record.accel))
    return gyro, accel


def noise_from_log(
    record: ImuRecord, like: ImuSpec | str | PathLike[str] | Mapping[str, Any] | None = None, name: str = "from log"
) -> LogNoise:
    """Fit the noise of an IMU to a record at rest.

    A record in motion gives the noise of the motion. What an Allan deviation cannot see (biases, scale factors, ranges) comes
    from `like`. The slope at which a bias wanders, ``b sqrt(2 / T)``, which is what a filter takes, comes out to 23 % from a record
    of ten correlation times and to 10 % from fifty (240 simulated channels each); b and T alone are looser, T within a factor of
    two. The sigma of the random walk is honest (z-scores of RMS .97), that of b optimistic by 1.5. A quantum much larger than
    the noise of a sample is no white noise, and distorts the other terms.

    Parameters
    ----------
    record : ImuRecord
        At rest, evenly sampled.
    like : ImuSpec, str, path or mapping, optional
        Specification of the other terms; zero (and no limit of range) as a rule.
    name : str
        Of the new specification.

    Raises
    ------
    UsageError
        Fewer than 20 rows, or gaps.
    """
    if len(record) < SHORTEST_RECORD:
        raise UsageError(f"{record.source}: {len(record)} rows; noise from a log needs at least {SHORTEST_RECORD}")
    if len(record.gaps):
        row = int(record.gaps[0])
        raise UsageError(
            f"{record.source}: a gap of {record.steps[row]:g} s before row {row + 1}; the Allan deviation needs even sampling: "
            "take a part without gaps (record.between)"
        )
    allan = [overlapping_adev(data, record.interval, kind=record.kind) for data in (record.gyro, record.accel)]
    tries = _correlation_times(record)
    fits = [_fit(allan, T) for T in tries]
    best = int(np.argmin([misfit for *_, misfit in fits]))
    values, sigmas, _ = fits[best]

    quantisation, random_walk, instability = values * np.array([np.sqrt(12.0), 1.0, 1.0])[:, None, None]
    worst = {"random_walk": random_walk, "quantisation": quantisation, "bias_instability": instability}
    terms: dict[str, Any] = {
        f"{group}_{key}": float(a[i].max()) for key, a in worst.items() for i, group in enumerate(("gyro", "accel"))
    }
    base = ImuSpec(unsaid=unnamed(terms)) if like is None else imu_spec(like)
    seen = bool(instability.any())
    spec = replace(base, **terms, correlation_time=tries[best] if seen else base.correlation_time, name=name)
    return LogNoise(
        spec,
        random_walk,
        quantisation,
        instability,
        sigmas[1],
        np.sqrt(12.0) * sigmas[0],
        sigmas[2],
        allan[0],
        allan[1],
    )


def with_terms_seen(spec: ImuSpec, gyro: NoiseCoefficients, accel: NoiseCoefficients) -> ImuSpec:
    """A specification of :func:`noise_from_log` without terms that the coefficients of the same record do not show.

    A Gauss-Markov bias stands for bias instability and for rate random walk. Where only the latter is seen, it is written as such,
    with the slope ``b sqrt(2 / T)``: the sigma b of a bias that wanders for longer than the record is an extrapolation.
    """
    drive = np.sqrt(2.0 / spec.correlation_time)
    terms: dict[str, Any] = {}
    for group, seen in (("gyro", gyro), ("accel", accel)):
        if seen.bias_instability.any():
            continue
        if seen.rate_random_walk.any():
            terms[f"{group}_rate_random_walk"] = float(drive * getattr(spec, f"{group}_bias_instability"))
        terms[f"{group}_bias_instability"] = 0.0
    found = replace(spec, **terms)
    found = replace(found, unsaid=unnamed(())) if spec.unsaid else found
    return replace(found, unsaid=found.still_unsaid)  # what rest does not show is not zero


def _correlation_times(record: ImuRecord) -> list[float]:
    shortest, longest = SHORTEST * record.interval, LONGEST * record.duration
    count = 1 + int(np.ceil(PER_OCTAVE * np.log2(longest / shortest)))
    return [float(T) for T in np.geomspace(shortest, longest, max(count, 2))]


def _fit(allan: list[AllanDeviation], correlation_time: float) -> tuple[Array, Array, float]:
    """Coefficients and sigmas, (3, 2, 3) by process, sensor and axis, and the misfit of all channels together."""
    values, sigmas, total = np.zeros((3, 2, 3)), np.full((3, 2, 3), np.nan), 0.0
    for sensor, curve in enumerate(allan):
        tau = curve.tau
        shapes = np.stack([3.0 / tau**2, 1.0 / tau, gauss_markov_variance(tau, correlation_time)], axis=-1)
        for axis in range(3):
            values[:, sensor, axis], sigmas[:, sensor, axis], misfit = fit_shapes(
                shapes, curve.deviation[:, axis], curve.sigma[:, axis]
            )
            total += misfit
    return values, sigmas, total
