"""A start that lies within a row of the IMU, as that of a transfer does: the row counts from there."""

import math

import numpy as np
import pytest

import truenorth as tn
from truenorth.core.attitude import misalignment
from truenorth.live import Navigator
from truenorth.navigation import Start
from truenorth.records.specs import imu_spec
from truenorth.simulation import Sway, Tone, simulate

PLACE, SPEC = tn.Position.from_degrees(45.0, 10.0), imu_spec("navigation")
SIGMA = np.repeat([1e-4, 0.01, 3.0, SPEC.gyro_bias, SPEC.accel_bias], 3)
SHIP = Sway(PLACE, roll_tones=(Tone(0.1, 9.0, 0.4),), pitch_tones=(Tone(0.05, 7.0),), lever_arm=(1.0, 5.0, 2.0))


def start_at(time, within=True):
    q, zero = SHIP.states(time), np.zeros(3)
    place = (float(q.lat), float(q.lon), float(q.alt))
    return Start(time, q.C_nb, q.v_n, *place, zero, zero, np.diag(SIGMA**2), within=within)


def live(record, start):
    run = Navigator(start, SPEC, kind=record.kind, altitude="free")
    run.push(record.time, record.gyro, record.accel)
    return run.answer.time, run.answer.C_nb, run.answer.motion.v_n


def batch(record, start):
    track = tn.navigate(record, start, imu=SPEC, altitude="free").track
    return track.time[-1], track.C_nb[-1], track.v_n[-1]


@pytest.mark.parametrize("by", [batch, live])
@pytest.mark.parametrize("kind", ["rates", "increments"])
@pytest.mark.parametrize("time", [2.001, 2.011, 2.029, 2.039])  # of rows of 40 ms
def test_the_turn_from_the_epoch_on_counts_and_no_other(by, kind, time):
    record = simulate(SHIP, rate=25.0, duration=10.0, kind=kind).record
    at, C_nb, v_n = by(record, start_at(time))
    true = SHIP.states(at)
    assert np.abs(misalignment(C_nb, true.C_nb)).max() < 2e-5
    assert np.abs(v_n - true.v_n).max() < 2e-3


def test_an_epoch_at_the_end_of_a_row_is_as_it_was():
    record = simulate(SHIP, rate=25.0, duration=10.0).record
    one, other = (batch(record, start_at(2.0, within)) for within in (True, False))
    assert math.isclose(one[0], other[0])
    np.testing.assert_allclose(one[1], other[1], rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(one[2], other[2], rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("rows", [0.0, 0.6, 1.0, 1.4])
def test_a_start_in_the_last_rows_has_nothing_to_go_on_with(rows):
    """It ended in a message about a record of one sample."""
    record = simulate(SHIP, rate=50.0, duration=20.0, imu=SPEC).record
    with pytest.raises(tn.DataError, match="goes on from it"):
        tn.navigate(record, start_at(float(record.time[-1]) - rows * record.interval), imu=SPEC)
