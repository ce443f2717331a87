"""White noise by the floor of the spectrum: under a sway, between the lines of an engine."""

import numpy as np
import pytest

from benchmarks.honesty import vehicles
from benchmarks.honesty.foreign import sensed
from truenorth.alignment.turning import sway_walks
from truenorth.quality.density import noise_densities
from truenorth.quality.floor import white_floor
from truenorth.records import ImuRecord
from truenorth.records.specs import imu_spec
from truenorth.records.vibration import coning_left

DENSITY = np.array([1e-5, 2e-5, 3e-5, 4e-4, 5e-4, 6e-4])


def shaken(kind="rates", duration=120.0, interval=0.01, lines=((21.0, 0.3), (42.0, 0.2), (10.5, 0.1))):
    """White noise in six channels, a sway of some deg/s and m/s^2, and an engine's lines in all of them."""
    rng = np.random.default_rng(5)
    time = interval * np.arange(1, round(duration / interval) + 1)
    motion = 0.05 * np.sin(0.9 * time) + 0.02 * np.sin(2.1 * time)
    motion = motion + sum(a * np.sin(2.0 * np.pi * f * time + 1.0) for f, a in lines)
    rows = motion[:, None] + DENSITY / np.sqrt(interval) * rng.standard_normal((len(time), 6))
    rows = rows * (interval if kind == "increments" else 1.0)
    return ImuRecord(time, rows[:, :3], rows[:, 3:], kind, "made")


@pytest.mark.parametrize("kind", ["rates", "increments"])
@pytest.mark.parametrize("lines", [(), ((21.0, 0.3), (42.0, 0.2), (10.5, 0.1))])
def test_the_floor_is_the_density_of_white_noise(kind, lines):
    assert white_floor(shaken(kind, lines=lines)) == pytest.approx(DENSITY, rel=0.12)


def test_noise_in_a_broad_band_raises_the_floor():
    record = shaken()
    rng = np.random.default_rng(6)
    louder = ImuRecord(
        record.time, record.gyro + 1e-3 * rng.standard_normal((len(record), 3)), record.accel, "rates", ""
    )
    assert np.all(white_floor(louder)[:3] > 3.0 * DENSITY[:3])


def test_a_short_log_has_no_floor():
    assert np.isnan(white_floor(shaken(duration=30.0))).all()


def test_a_ship_whose_engine_runs_shows_the_walks_of_her_imu():
    """Where no channel looked white, the noise of a navigation grade was assumed: 12 of 20 sound logs were refused."""
    rng = np.random.default_rng([31, 7, 9])
    spec = imu_spec("tactical")
    record = sensed(rng, vehicles.ship(rng, 100.0, moored=True), spec)
    assert not np.isfinite(noise_densities(record)[1]).any()
    walks = sway_walks(record)
    assert walks.gyro_random_walk == pytest.approx(spec.gyro_random_walk, rel=0.12)
    assert walks.accel_random_walk == pytest.approx(spec.accel_random_walk, rel=0.12)


def test_rows_that_are_nanoseconds_apart_fill_no_memory():
    """A window of them would have billions of frequencies (found by the fuzzer: 24 GB)."""
    record = ImuRecord(2e-9 * np.arange(1, 201), np.ones((200, 3)), np.ones((200, 3)))
    assert np.isnan(white_floor(record)).all()
    assert not coning_left(record)
