"""A gyro about the vertical of the wrong sign, on a ship that hardly yaws: the level force shows it under heave."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.honesty import vehicles
from benchmarks.honesty.foreign import sensed
from tests.runs import some
from truenorth.alignment import align
from truenorth.campaign.fault_benches import BENCHES
from truenorth.quality.tilt import check_tilt
from truenorth.records.specs import imu_spec

YAWS_LITTLE = (41131, 0)  # by 1.2 deg, and heaves by .3 m: 0.05 m/s^2 are left with either sign


def flipped(record, axis=2):
    return replace(record, gyro=record.gyro * np.where(np.arange(3) == axis, -1.0, 1.0))


def test_level_force_shows_a_sign_that_heave_hides():
    record = BENCHES["swaying"].draw(*YAWS_LITTLE)[0]["record"]
    assert check_tilt(record).sign is None
    tilt = check_tilt(flipped(record))
    assert tilt.best**2 > tilt.given**2 / 3.0  # of the whole force, too little to name another reading
    (found,) = tilt.evidence()
    assert (found.key, found.figures["axes"]) == ("tilt.axes", "+x +y -z")
    assert found.figures["best"] < 0.5 * found.figures["given"]


def test_the_axis_that_is_vertical_is_asked():
    """An IMU that lies on its side: its x is up."""
    record = BENCHES["swaying"].draw(*YAWS_LITTLE)[0]["record"]
    on_its_side = replace(record, gyro=record.gyro[:, [2, 0, 1]], accel=record.accel[:, [2, 0, 1]])
    assert check_tilt(on_its_side).sign is None
    assert check_tilt(flipped(on_its_side, 0)).sign.axis == 0


def test_a_sound_answer_is_a_good_one():
    inputs = BENCHES["swaying"].draw(*YAWS_LITTLE)[0]
    assert align(inputs["record"], inputs["place"], inputs["imu"]).status == "aligned"


@pytest.mark.usefixtures("without_gyro_matrix")
def test_such_an_answer_is_no_good_one():
    """It was `aligned`, its level 40 sigmas off."""
    inputs = BENCHES["swaying"].draw(*YAWS_LITTLE)[0]
    assert align(flipped(inputs["record"]), inputs["place"], inputs["imu"]).status == "inconsistent"


@pytest.mark.parametrize("run", some([20], [0, 26, 5]))
@pytest.mark.parametrize("kind", ["ship", "moored", "raft", "buoy"])
@pytest.mark.parametrize("grade", some(["tactical"], ["navigation"]))
def test_no_sound_log_has_a_wrong_sign(kind, run, grade):
    """Moored ship 20: without a bound on what is left, her own motion is 8 sigmas nearer to the other sign."""
    rng = np.random.default_rng([78, 1000 + run])
    make = (
        (lambda rng, length: vehicles.ship(rng, length, moored=True)) if kind == "moored" else getattr(vehicles, kind)
    )
    world = make(rng, 170.0)
    record = sensed(rng, world, imu_spec(grade), 50.0)
    for log in (record, replace(record, gyro=record.gyro[:, [2, 0, 1]], accel=record.accel[:, [2, 0, 1]])):
        tilt = check_tilt(log)
        assert tilt is None or tilt.sign is None


@pytest.mark.parametrize("rate", [1.0, 4.0])
def test_few_rows_a_second_name_no_sign(rate):
    record = BENCHES["swaying"].draw(3, 1)[0]["record"]
    step = round(1.0 / (rate * record.interval))
    rows = slice(step - 1, None, step)
    tilt = check_tilt(replace(record, time=record.time[rows], gyro=record.gyro[rows], accel=record.accel[rows]))
    assert tilt is None or tilt.sign is None
