"""A vehicle that vibrates faster than its rows show: they are noisier than the specification says, and no bias wanders."""

from dataclasses import replace

import numpy as np
import pytest

import truenorth as tn
from benchmarks.honesty import moving
from benchmarks.honesty.harness import simulated
from truenorth.core.attitude import rotation_vector_from_dcm
from truenorth.estimate.noisier import as_noisy_as_its_rows
from truenorth.records import ImuRecord
from truenorth.records.specs import imu_spec

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


def test_a_log_as_noisy_as_specified_is_navigated_once():
    """A contradiction that is none of its noise is left as it is."""
    spec, rng = imu_spec("tactical"), np.random.default_rng(SEED)
    data = np.repeat([spec.gyro_random_walk, spec.accel_random_walk], 3) * 10.0 * rng.standard_normal((6000, 6))
    record = ImuRecord(np.arange(1, 6001) / 100.0, data[:, :3], data[:, 3:] + [0.0, 0.0, 9.8])

    class Found:
        status, imu_source = "inconsistent", "tactical"

    def again(other):
        raise AssertionError(other)

    answer = Found()
    assert as_noisy_as_its_rows(answer, record, spec, again) is answer
