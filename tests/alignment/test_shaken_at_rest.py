"""A truck at rest whose engine runs: it is tilted and pushed in step, which is no bias of an accelerometer on a base that tilts."""

import math

import numpy as np
import pytest

from benchmarks.honesty.foreign import STEP, attitude, sensed, world
from tests.runs import some
from truenorth.alignment import align
from truenorth.core.attitude import dcm_from_rotation_vector, rotation_vector_from_dcm
from truenorth.core.position import Position
from truenorth.errors.staying import local_axes
from truenorth.errors.sway import SHAKES, without_shaking
from truenorth.records.specs import imu_spec
from truenorth.strapdown.inertial import InertialIntegrals

DEG, SECONDS, LAT = math.radians(1.0), 300.0, math.radians(48.0)


def truck(rng):
    """An engine of several orders that tilts and pushes, and a driver who gets out."""
    t = STEP * np.arange(round(SECONDS / STEP) + 1)
    turns = 2.0 * np.pi * rng.uniform(9.0, 11.0) * t
    roll, pitch, moves = np.zeros_like(t), np.zeros_like(t), np.zeros((len(t), 3))
    for order in (0.5, 1.0, 1.5):
        roll += rng.uniform(0.01, 0.03) * DEG / order * np.sin(order * turns + rng.uniform(0.0, 6.28))
        pitch += rng.uniform(0.003, 0.01) * DEG / order * np.sin(order * turns + rng.uniform(0.0, 6.28))
        for axis in range(3):
            size = rng.uniform(0.5, 1.5) / (2.0 * np.pi * 10.0 * order)
            moves[:, axis] += size * np.cos(order * turns + rng.uniform(0.0, 6.28))
    out = 1.0 / (1.0 + np.exp(-(t - rng.uniform(100.0, 250.0)) / 0.4))
    roll, pitch = roll + 0.04 * DEG * out, pitch + 0.01 * DEG * out
    C = attitude(np.full(len(t), rng.uniform(0.0, 6.28)), pitch + rng.normal(0.0, 2.0) * DEG, roll)
    place = np.array([LAT, 0.2, 300.0])
    return world(rng, place, moves, C, np.zeros((len(t), 3)), np.zeros_like(t))


@pytest.mark.parametrize("run", some([3], [0, 1, 2, *range(4, 12)]))
def test_an_engine_that_tilts_and_pushes_shows_no_bias(run):
    """Without a specification. Runs 1 and 3: level was 6.6 and 11.0 sigmas off, in silence."""
    rng = np.random.default_rng([61, run])
    true = truck(rng)
    answer = align(sensed(rng, true, imu_spec("tactical"), 100.0), Position(*true.place[0]))
    off = rotation_vector_from_dcm(answer.C_nb @ true.C[round(answer.time / STEP)].T)
    assert np.abs(off / np.sqrt(np.diag(answer.phi_covariance)))[:2].max() < 3.0


C_0 = dcm_from_rotation_vector(np.array([0.1, -0.2, 1.0]))


def of_base(vectors):
    """Integrals of a base at rest that is turned by vectors (K, 3) in the local frame, each over a second."""
    time = np.arange(len(vectors) + 1.0)
    back = np.swapaxes(local_axes(time, LAT) @ C_0, 1, 2)
    C_mean = back @ dcm_from_rotation_vector(vectors)
    ends = np.zeros((len(time), 3))
    return InertialIntegrals(0.0, time, np.zeros((len(time), 3, 3)), ends, ends, C_mean, C_mean, np.zeros((0, 3, 3)))


def test_shaking_goes_and_the_earth_still_turns():
    slowly = np.linspace(0.0, 1.0, 600)[:, None] * np.array([2e-4, -1e-4, 3e-4])
    shaking = 1e-3 * np.sin(2.0 * np.arange(600))[:, None] * np.array([1.0, 0.5, -0.5])
    found = without_shaking(of_base(slowly + shaking), C_0, LAT)
    left = found.C_mean - of_base(slowly).C_mean
    assert np.abs(left).max() < 1e-2 * np.abs(shaking).max()
    np.testing.assert_array_equal(found.C_mean, found.C_late)


def test_a_base_that_is_tilted_keeps_its_tilt():
    """Which shows biases: a box on a table that is put on its side, or a truck that is jacked up."""
    log = of_base(np.where(np.arange(600) < 200, 0.0, 4.0 * SHAKES)[:, None] * np.array([1.0, 0.0, 0.0]))
    assert without_shaking(log, C_0, LAT) is log
