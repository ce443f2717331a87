"""Errors of an IMU on ideal increments, term by term from its specification.

Each term draws from a stream of its own, ``SeedSequence(seed, spawn_key=(scenario, run, stream))``: switching one off
leaves the others' draws as they were, and a run does not depend on how many there are.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from truenorth.simulation.streams import STREAMS, stream
from truenorth.specs import ImuSpec

Array = NDArray[np.float64]


@dataclass(frozen=True)
class TrueErrors:
    """The errors that were really drawn.

    Attributes
    ----------
    gyro_bias, accel_bias : (3,) arrays, rad/s and m/s^2
        Constant part, measured minus true.
    gyro_matrix, accel_matrix : (3, 3) arrays
        Scale factors and misalignments, ``measured = (I + matrix) true``.
    """

    gyro_bias: Array
    accel_bias: Array
    gyro_matrix: Array
    accel_matrix: Array


def apply_errors(
    dtheta: Array, dvel: Array, interval: float, spec: ImuSpec, *, seed: int, run: int = 0, scenario: int = 0
) -> tuple[Array, Array, TrueErrors]:
    """Ideal increments as the IMU of a specification would give them.

    Parameters
    ----------
    dtheta, dvel : (N, 3) arrays, rad and m/s
    interval : float, s
    spec : ImuSpec
        Terms that are zero are left out.
    seed, run, scenario : int

    Returns
    -------
    dtheta, dvel : (N, 3) arrays
    errors : TrueErrors
    """
    measured, biases, matrices = [], [], []
    for group, ideal in (("gyro", dtheta), ("accel", dvel)):

        def draw(term: str, group: str = group) -> np.random.Generator:
            return stream(seed, scenario, run, STREAMS[f"{group}_{term}"])

        def sigma(term: str, group: str = group) -> float:
            return float(getattr(spec, f"{group}_{term}"))

        matrix = np.zeros((3, 3))
        if sigma("scale_factor") > 0:
            matrix += np.diag(sigma("scale_factor") * draw("scale_factor").standard_normal(3))
        if sigma("misalignment") > 0:
            off = sigma("misalignment") * draw("misalignment").standard_normal((3, 3))
            matrix += off - np.diag(np.diag(off))
        bias = sigma("bias") * draw("bias").standard_normal(3)
        out = ideal + ideal @ matrix.T if matrix.any() else ideal.copy()
        out += bias * interval
        if sigma("random_walk") > 0:
            out += sigma("random_walk") * np.sqrt(interval) * draw("random_walk").standard_normal(out.shape)
        if sigma("bias_instability") > 0:
            drift = _gauss_markov(
                sigma("bias_instability"), spec.correlation_time, interval, len(out), draw("bias_instability")
            )
            out += drift * interval
        full_scale = sigma("range") * interval
        if np.isfinite(full_scale):
            np.clip(out, -full_scale, full_scale, out=out)
        if sigma("quantisation") > 0:
            out = _quantised(out, sigma("quantisation"))
        measured.append(out)
        biases.append(bias)
        matrices.append(matrix)
    return measured[0], measured[1], TrueErrors(biases[0], biases[1], matrices[0], matrices[1])


def without_bias(spec: ImuSpec) -> ImuSpec:
    """The same IMU calibrated perfectly: noise alone."""
    return replace(spec, gyro_bias=0.0, accel_bias=0.0, name=f"{spec.name}, no bias")


def _gauss_markov(sigma: float, tau: float, interval: float, count: int, rng: np.random.Generator) -> Array:
    """First-order Gauss-Markov process of three axes, stationary from the first sample, (N, 3)."""
    from scipy.signal import lfilter

    decay = np.exp(-interval / tau)
    noise = sigma * np.sqrt(1 - decay**2) * rng.standard_normal((count, 3))
    noise[0] = sigma * rng.standard_normal(3)
    return lfilter([1.0], [1.0, -decay], noise, axis=0)


def _quantised(increments: Array, quantum: float) -> Array:
    """Whole quanta of the running sum: what a counter gives, the residue carried on to the next sample."""
    counts = np.floor(np.cumsum(increments, axis=0) / quantum)
    return np.diff(counts, axis=0, prepend=np.zeros((1, 3))) * quantum
