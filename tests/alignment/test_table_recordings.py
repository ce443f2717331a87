"""Positions and rotation on real recordings; each test names the folder it needs and skips where that is missing."""

import numpy as np
import pytest

from tests import recordings
from truenorth.alignment import align
from truenorth.alignment.positions import align_positions
from truenorth.coarse import means, two_position
from truenorth.records.specs import imu_spec

# A MEMS whose axes are set as well as the better ones of its class: offsets are separated from tilt as well as that.
MEMS = {
    "gyro": {
        "bias": "0.4 deg/s",
        "random_walk": "2 deg/sqrt(h)",
        "bias_instability": "30 deg/h",
        "scale_factor": "0.5 %",
        "misalignment": "5 arcmin",
    },
    "accel": {
        "bias": "30 mg",
        "random_walk": "130 ug/sqrt(Hz)",
        "bias_instability": "0.4 mg",
        "scale_factor": "0.5 %",
        "misalignment": "5 arcmin",
    },
}
MG = 9.80665e-3


def test_mems_on_a_table_rotation_tells_offsets_from_tilt():
    """Still, levelled by its accelerometers, it seems to lie 1.3 deg askew; the turn says that most of it is offset."""
    record, position = recordings.mems_rotation_table()
    part = record.between(95.0, None)
    answer = align_positions(part, position, MEMS)
    assert answer.status == "level_only"
    assert "refused" in answer.reasons[0]
    offset = np.abs(answer.accel_bias[:2]) / MG
    assert np.all((offset > 10.0) & (offset < 40.0))
    assert np.all(answer.accel_bias_sigma[:2] / MG < 3.0)
    assert np.all(np.abs(np.degrees(answer.euler[1:])) < 0.5)
    assert np.all(np.degrees(answer.euler_sigma[1:]) < 0.15)
    # The circle that the level force runs through while the table turns: its middle is the offset, its radius the tilt.
    spin = record.between(132.0, 132.0 + 360.0 / 20.3).accel
    smooth = spin[: len(spin) // 100 * 100, :2].reshape(-1, 100, 2).mean(axis=1)
    middle = smooth.mean(axis=0)
    radius = np.degrees(np.sqrt(2) * np.sqrt(np.mean((smooth - middle) ** 2)) / 9.8)
    assert np.all(np.abs(answer.accel_bias[:2] - middle) / MG < 12.0)
    assert 0.5 < radius < 0.8


@pytest.mark.slow
def test_mems_on_a_table_that_was_touched():
    record, position = recordings.mems_rotation_table()
    answer = align_positions(record, position, MEMS)
    assert answer.status == "inconsistent"
    assert "touched" in answer.reasons[0]
    assert answer.table.touch.time == pytest.approx(90.0, abs=6.0)
    assert 8.0 < answer.table.touch.size / MG < 18.0
    assert align_positions(record.between(95.0, None), position, MEMS).table.touch is None
    assert "Positions()" in align(record, position, MEMS).method_reason  # who forgets it reads of it


def test_xsens_two_directions_tell_offset_from_tilt():
    """Set down by hand facing east, then north: 90 deg about the vertical between them, by the labels."""
    (east, position), (north, _) = (recordings.xsens_four_headings(d) for d in ("east", "north"))
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])  # C_b1_b2, anticlockwise from above
    spec = imu_spec("industrial")
    _, _, offset = two_position(
        means(east), means(north), turn, position.lat, spec.gyro_bias, imu_spec("consumer").accel_bias
    )
    levels = []
    for record in (east, north):
        f = record.accel.mean(axis=0) - offset
        levels.append(np.degrees([np.arcsin(f[1] / 9.8), np.arcsin(-f[0] / 9.8)]))
    # Each alone would put all of it down to tilt; together the table's own tilt is what turned with it.
    (pitch_e, roll_e), (pitch_n, roll_n) = levels
    assert pitch_n == pytest.approx(roll_e, abs=0.002)
    assert roll_n == pytest.approx(-pitch_e, abs=0.002)
    assert 0.3 < np.linalg.norm(offset[:2]) / MG < 2.0
    alone = align(east, position)
    assert np.degrees(alone.euler_sigma[1]) > 0.5 * abs(np.degrees(alone.pitch) - pitch_e)
