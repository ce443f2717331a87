"""A vehicle that vibrates faster than its rows show: they are noisier than the specification says, and no bias wanders."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

import truenorth as tn
from benchmarks.honesty import moving
from benchmarks.honesty.harness import simulated
from truenorth.core.attitude import rotation_vector_from_dcm
from truenorth.estimate.noisier import as_noisy_as_its_rows
from truenorth.records import ImuRecord
from truenorth.records.specs import imu_spec
from truenorth.state.evidence import contradiction

SEED = 43  # any


@pytest.mark.slow
@pytest.mark.parametrize("run", range(2))
def test_a_vehicle_that_vibrates_is_navigated(run):
    """By the specification it was `inconsistent`; by the noise of the rows attitude is within four sigmas, and it is said."""
    case = next(case for case in moving.CASES if case.name == "GNSS, car")
    log = simulated(case.scenario(np.random.default_rng([SEED, run])), SEED, run)
    rng = np.random.default_rng([SEED, run, 1])
    size = np.repeat([np.radians(rng.uniform(0.2, 0.5)), 9.8 * rng.uniform(0.05, 0.2)], 3) * log.record.interval
    noise = size * rng.standard_normal((len(log.record), 6))
    record = replace(log.record, gyro=log.record.gyro + noise[:, :3], accel=log.record.accel + noise[:, 3:])
    half = record.time[0] + 0.6 * record.duration
    gnss = tn.Gnss(log.aiding["gnss"])
    start = tn.align(record.between(None, half), imu="industrial", aid=gnss)
    found = tn.navigate(record, start, imu="industrial", aid=gnss)
    assert found.status == "navigated", found.reasons
    assert found.evidence[0].key == "specification.noisier"
    phi = rotation_vector_from_dcm(found.track.C_nb[-1] @ log.C_nb(found.track.time[-1]).T)
    assert np.all(np.abs(phi) < 4.0 * found.track.sigma[-1, :3])
    assert found.track.sigma[-1, 2] < np.radians(5.0)


@dataclass(frozen=True)
class Found:
    """An answer."""

    status: str
    imu_source: str = "tactical"
    evidence: tuple = ()


@pytest.mark.parametrize("silent", ["gyro_random_walk", "accel_random_walk"])
@pytest.mark.parametrize("rows", [slice(0, 6000), np.r_[0:2000, 2100:6000]], ids=["whole", "a gap"])
def test_noisy_rows_of_a_specification_that_is_silent(silent, rows):
    """A walk that a data sheet leaves out is that of the rows, and a gap hides nothing."""
    rng = np.random.default_rng(SEED)
    data = np.repeat([0.01, 0.1], 3) * rng.standard_normal((6000, 6))
    time = np.arange(1, 6001) / 100.0
    record = ImuRecord(time[rows], data[rows, :3], data[rows, 3:] + [0.0, 0.0, 9.8])
    spec = replace(imu_spec("tactical"), **{silent: 0.0})
    asked = []

    def again(other):
        asked.append(other)
        return Found("aligned")

    answer = as_noisy_as_its_rows(Found("inconsistent"), record, spec, again)
    assert answer.status == "aligned"
    assert answer.evidence[0].urgent
    assert asked[0].gyro_random_walk == pytest.approx(0.001, rel=0.15)
    assert asked[0].accel_random_walk == pytest.approx(0.01, rel=0.15)
    assert asked[0].name == "tactical, noise of the rows"


def test_a_receiver_led_away_at_rest_is_no_noise():
    """However noisy the rows are, a vehicle that stands does not move."""
    data = np.repeat([0.01, 0.1], 3) * np.random.default_rng(SEED).standard_normal((6000, 6))
    record = ImuRecord(np.arange(1, 6001) / 100.0, data[:, :3], data[:, 3:] + [0.0, 0.0, 9.8])
    answer = Found("inconsistent", evidence=(contradiction("innovations.at_rest"),))
    assert as_noisy_as_its_rows(answer, record, imu_spec("tactical"), lambda spec: Found("aligned")) is answer


def test_a_log_as_noisy_as_specified_is_navigated_once():
    """A contradiction that is none of its noise is left as it is."""
    spec, rng = imu_spec("tactical"), np.random.default_rng(SEED)
    data = np.repeat([spec.gyro_random_walk, spec.accel_random_walk], 3) * 10.0 * rng.standard_normal((6000, 6))
    record = ImuRecord(np.arange(1, 6001) / 100.0, data[:, :3], data[:, 3:] + [0.0, 0.0, 9.8])

    def again(other):
        raise AssertionError(other)

    answer = Found("inconsistent")
    assert as_noisy_as_its_rows(answer, record, spec, again) is answer
