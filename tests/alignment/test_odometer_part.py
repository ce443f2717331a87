"""An odometer that begins after the log, or ends before it: the rest of the log shows the attitude."""

import numpy as np
import pytest

import truenorth as tn
from tests.quality.test_clock_apart import drive
from tests.quality.test_wheel_unit import wheel
from truenorth.aiding.aids import Gnss, Odometer
from truenorth.coarse.odometer import odometer_alignment
from truenorth.core.errors import DataError
from truenorth.core.position import Position
from truenorth.records import OdometerRecord
from truenorth.records.specs import imu_spec

PLACE = Position.from_degrees(48.0, 11.0, 500.0)


@pytest.fixture(scope="module")
def under_way():
    """A log that begins on the way, with its motion, receiver, and the wheel's times and speeds."""
    motion, record, gnss = drive(5)
    return motion, record.between(40.0, None), gnss, *wheel(motion)


def within(t, v, begin, end):
    kept = (t > begin) & (t < end)
    return OdometerRecord(t[kept], v[kept], kind="speed")


@pytest.mark.parametrize(("begin", "end"), [(43.0, 239.0), (40.0, 236.0), (40.0, 200.0)])
def test_coarse_alignment_takes_what_is_there(under_way, begin, end):
    """Level by a part is that by the whole, to what some seconds of unknown speed make of it; these gyros see no heading."""
    _, record, _, t, v = under_way
    part, whole = (odometer_alignment(record, within(t, v, *ends), PLACE) for ends in ((begin, end), (39.0, 240.0)))
    assert np.degrees(np.arccos(part.C_n0_i[2] @ whole.C_n0_i[2])) < 0.5


def test_one_that_is_elsewhere_is_refused(under_way):
    _, record, _, t, v = under_way
    for begin, end in ((0.0, 45.0), (60.0, 239.0)):
        with pytest.raises(DataError, match="covers the log, on its clock"):
            odometer_alignment(record, within(t, v, begin, end), PLACE)


@pytest.mark.slow
@pytest.mark.parametrize("imu", ["tactical", "industrial"])
@pytest.mark.parametrize(("begin", "end"), [(43.0, 239.0), (60.0, 239.0), (0.0, 236.0), (43.0, 210.0)])
def test_a_car_with_a_receiver_is_aligned(imu, begin, end):
    motion, record, gnss = drive(5, imu=imu_spec(imu))
    record, (t, v) = record.between(40.0, None), wheel(motion)
    answer = tn.align(record, None, imu_spec(imu), aid=[Gnss(gnss), Odometer(within(t, v, begin, end))])
    C = motion.states(record.time[-1:]).C_nb[0]
    off = np.angle(np.exp(1j * (answer.heading - np.arctan2(C[0, 1], C[1, 1]))))
    assert answer.status == "aligned"
    assert abs(off) < 4.0 * answer.euler_sigma[0]
