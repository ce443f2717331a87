"""What rounding leaves on the move: as much as drawn means lose, and nothing of counters that carry their remainders on."""

import numpy as np
import pytest

from truenorth.aiding.aids import Odometer
from truenorth.alignment import align
from truenorth.campaign.fault_benches import BENCHES, misses
from truenorth.campaign.faults import run_faults
from truenorth.quality.rounding import rounding_walks, with_rounding
from truenorth.records import ImuRecord
from truenorth.records.specs import imu_spec

RATE, ROWS, RUNS = 50.0, 2000, 60


def _record(values: np.ndarray, kind: str = "rates") -> ImuRecord:
    """One channel that counts in steps of one; the others are noise."""
    rng = np.random.default_rng(4)
    gyro, accel = rng.standard_normal((len(values), 3)), rng.standard_normal((len(values), 3))
    accel[:, 1] = values
    return ImuRecord(np.arange(1, len(values) + 1) / RATE, gyro, accel, kind)


@pytest.mark.parametrize(("amplitude", "noise"), [(0.8, 0.05), (1.1, 0.0), (1.1, 0.15), (1.6, 0.1), (0.0, 0.25)])
def test_a_vibration_leaves_no_more_than_is_claimed(amplitude: float, noise: float) -> None:
    """Over means drawn anywhere between two steps: the error of the velocity after the log, in its sigma."""
    rng = np.random.default_rng(12)
    time = np.arange(1, ROWS + 1) / RATE
    off = []
    for mean in rng.uniform(0.0, 1.0, RUNS):
        true = mean + amplitude * np.sin(2.0 * np.pi * (11.3 * time + rng.random()))
        true += noise * rng.standard_normal(ROWS)
        counts = np.round(true)
        if len(np.unique(counts)) > 1:  # else nothing tells how long a step is
            sigma = rounding_walks(_record(counts))[1] * np.sqrt(time[-1])
            off.append((counts - true).sum() / RATE / sigma)
    assert len(off) > 15
    assert 0.15 < np.sqrt(np.mean(np.square(off))) < 1.5
    assert np.max(np.abs(off)) < 4.0


def test_counters_and_fine_steps_claim_nothing() -> None:
    rng = np.random.default_rng(13)
    whole = np.cumsum(0.3 + 0.2 * np.sin(0.01 * np.arange(ROWS)) + 0.05 * rng.standard_normal(ROWS))
    assert rounding_walks(_record(np.diff(np.round(whole)), "increments")) == (0.0, 0.0)
    assert rounding_walks(_record(np.round(9.0 * rng.standard_normal(ROWS)))) == (0.0, 0.0)
    assert rounding_walks(_record(rng.standard_normal(ROWS))) == (0.0, 0.0)
    assert rounding_walks(_record(np.zeros(ROWS))) == (0.0, 0.0)


def test_counters_whose_third_axis_is_hidden_by_motion_claim_nothing() -> None:
    """A ring-laser IMU under way: two accelerometers show that they carry on, the third has the floor of a road."""
    rng = np.random.default_rng(15)
    accel = 0.3 + 0.05 * rng.standard_normal((ROWS, 3))
    accel[:, 0] += 2.0 * np.convolve(rng.standard_normal(ROWS), np.ones(8) / 8.0, "same")
    counts = np.diff(np.round(np.cumsum(accel, axis=0)), axis=0)
    gyro = rng.standard_normal(counts.shape)
    record = ImuRecord(np.arange(1, ROWS) / RATE, gyro, counts, "increments")
    assert rounding_walks(record) == (0.0, 0.0)
    alone = ImuRecord(record.time, gyro, np.where(np.arange(3) == 0, counts, gyro), "increments")
    assert rounding_walks(alone)[1] > 0.0


@pytest.mark.parametrize("amplitude", [0.0, 0.6, 1.1, 3.0])
@pytest.mark.parametrize("noise", [0.05, 0.15])
def test_a_vibration_does_not_hide_whether_remainders_are_carried_on(amplitude: float, noise: float) -> None:
    """By the floor of the spectrum between its lines, wherever they are: counters claim nothing, lost remainders a walk."""
    rng = np.random.default_rng(16)
    for _ in range(12):
        phase = 2.0 * np.pi * (rng.uniform(0.02, 0.48) * np.arange(ROWS) + rng.random())
        true = 0.3 + noise * rng.standard_normal(ROWS) + amplitude * np.sin(phase)
        kept = np.diff(np.round(np.cumsum(true)))
        assert rounding_walks(_record(kept, "increments"))[1] == 0.0
        lost = np.round(true)
        if len(np.unique(lost)) > 1 and np.mean(np.diff(lost) == 0.0) > 0.1:
            assert rounding_walks(_record(lost, "increments"))[1] > 0.0


def test_a_specification_that_counts_is_left_as_it_is() -> None:
    rng = np.random.default_rng(14)
    record = _record(np.round(0.3 * rng.standard_normal(ROWS)))
    plain = imu_spec("tactical")
    counter = imu_spec({**plain.to_mapping(), "accel": {**plain.to_mapping()["accel"], "quantisation": "0.01 m/s"}})
    for aided in (True, False):
        assert with_rounding(plain, record, aided=aided).accel_random_walk > plain.accel_random_walk
        assert with_rounding(counter, record, aided=aided) == counter


@pytest.mark.slow
@pytest.mark.parametrize(("run", "steps"), [(16, 1.16), (1, 1.04)])
def test_a_shaken_car_with_few_digits_is_no_more_sure_than_it_may_be(run: int, steps: float) -> None:
    """A vibration of about one step: 7.6 and 5.6 sigmas of heading, `aligned`, where rounding was in no sigma."""
    inputs, truth = BENCHES["odometer"].draw(9917, run)
    record = inputs["record"]
    gyro, accel = (
        step * np.round(values / step)
        for values, step in ((x, steps * np.median(np.abs(np.diff(x, axis=0)))) for x in (record.gyro, record.accel))
    )
    coarse = ImuRecord(record.time, gyro, accel, record.kind)
    answer = align(coarse, inputs["place"], inputs["imu"], aid=Odometer(inputs["odometer"], inputs["mounting"]))
    off = np.concatenate(list(misses(answer, truth).values()))
    assert answer.status != "aligned" or np.abs(off).max() < 4.0


def test_what_is_held_and_what_is_white_make_the_walk() -> None:
    """At the end of a log of one regime a bias and white noise leave what the walk does; a sensor without a step is as it was."""
    rng, spec = np.random.default_rng(16), imu_spec("tactical")
    record = _record(np.round(0.3 + 0.2 * rng.standard_normal(ROWS)))
    walk, held, time = rounding_walks(record)[1], with_rounding(spec, record), ROWS / RATE
    white, bias = (
        np.sqrt(getattr(held, name) ** 2 - getattr(spec, name) ** 2) for name in ("accel_random_walk", "accel_bias")
    )
    assert white == pytest.approx(1.0 / np.sqrt(12.0 * RATE))
    assert white**2 * time + (bias * time) ** 2 == pytest.approx(walk**2 * time, rel=0.01)
    walks = held.accel_rate_random_walk**2 - spec.accel_rate_random_walk**2
    assert walks * time == pytest.approx(2.0 * bias**2, rel=0.01)  # two regimes are independent
    assert (held.gyro_bias, held.gyro_random_walk) == (spec.gyro_bias, spec.gyro_random_walk)
    fine = _record(rng.standard_normal(ROWS))
    assert with_rounding(spec, fine) == spec


@pytest.mark.slow
def test_a_master_is_no_later_for_the_rounding_of_its_slave() -> None:
    """Run 7 of seed 308: level was 4.1 sigmas off, `aligned`."""
    trials = run_faults(["attitude"], ["coarse quantum"], runs=8, seed=308)
    assert [t for t in trials if t.outcome in ("silent", "crash")] == []
