"""The main job on real recordings; each test names the folder it needs and skips where that is missing."""

import numpy as np
import pytest

from tests import recordings
from tests.runs import some
from truenorth.alignment import align


def _windows(record, length):
    start = record.time[0] - record.interval
    count = int(record.duration / length + 0.01)
    return [record.between(start + k * length + 1e-6, start + (k + 1) * length + 1e-6) for k in range(count)]


def _heading(answer) -> float:
    return float(np.degrees(answer.heading))


class TestRingLaserOnADisturbedVehicle:
    """Heading of the y axis about 90.6 deg, by the recording's own header and by all windows."""

    @pytest.mark.slow
    def test_every_300_s_window(self):
        record, position = recordings.rlg_vehicle_xian()
        for window in _windows(record, 300.0):
            answer = align(window, position)
            assert answer.status == "aligned"
            assert abs(_heading(answer) - 90.6) < 0.1
            assert answer.method != "analytic"

    @pytest.mark.slow
    def test_scatter_of_120_s_windows_is_what_the_random_part_says(self):
        """Squares about the weighted mean, each over its own sigma: chi-square of 6 degrees of freedom, 1.24 to 14.45 in 95 %.

        The windows are not alike: sigma is .01 deg where nobody moves the vehicle, .1 where people get in.
        """
        record, position = recordings.rlg_vehicle_xian()
        answers = [align(window, position) for window in _windows(record, 120.0)]
        headings = np.array([_heading(a) for a in answers])
        assert len(headings) == 7
        assert np.all(np.abs(headings - 90.6) < 0.3)
        random = np.degrees([np.sqrt(a.euler_sigma[0] ** 2 - a.euler_sigma_floor[0] ** 2) for a in answers])
        mean = np.average(headings, weights=random**-2.0)
        assert 1.24 < np.sum(np.square((headings - mean) / random)) < 14.45

    @pytest.mark.slow
    def test_people_who_turn_the_vehicle_are_no_gyro_bias(self):
        """From 180 to 360 s it turns by 40 arcsec about the vertical: .21 deg/h, where ten pieces scatter by .08."""
        record, position = recordings.rlg_vehicle_xian()
        for window in _windows(record, 180.0):
            answer = align(window, position, "navigation")
            assert answer.status == "aligned", answer.reasons
            assert abs(_heading(answer) - 90.6) < 3 * np.degrees(answer.euler_sigma[0])

    def test_mean_rates_fail_and_say_so(self):
        record, position = recordings.rlg_vehicle_xian()
        errors, sigmas = [], []
        for window in _windows(record, 300.0):
            answer = align(window, position, method="analytic")
            errors.append(_heading(answer) - 90.6)
            sigmas.append(np.degrees(answer.euler_sigma[0]))
        assert np.max(np.abs(errors)) > 2.0
        assert np.all(np.abs(errors) < 3 * np.array(sigmas))

    @pytest.mark.parametrize(("method", "windows"), some([("inertial", 1)], [("inertial", 3), ("oba", 3)]))
    def test_other_inertial_methods_agree(self, method, windows):
        record, position = recordings.rlg_vehicle_xian()
        for window in _windows(record, 300.0)[:windows]:
            answer = align(window, position, method=method)
            assert abs(_heading(answer) - 90.6) < 3 * np.degrees(answer.euler_sigma[0])
            assert abs(_heading(answer) - 90.6) < 0.2


def test_navigation_grade_in_the_laboratory_meets_its_reference():
    record, position, given = recordings.navgrade_static_beijing()
    # Its gyros' noise over a second is 15 times the preset's walk, and falls off as a bounded angle does: no walk of the gyros.
    assert align(record, position, "navigation").status == "aligned"
    answer = align(record, position)
    assert answer.status == "aligned"
    heading, pitch, roll = np.degrees(answer.euler)
    assert abs(heading - given["heading_cw"]) < 0.15
    assert abs(pitch - given["pitch"]) < 0.002
    assert abs(roll - given["roll"]) < 0.002
    assert abs(heading - given["heading_cw"]) < 3 * np.degrees(answer.euler_sigma[0])


def test_idling_engine_50_s():
    record, position = recordings.fog_gps_xian()
    answer = align(record.between(None, 50.0), position)
    assert answer.status == "aligned"
    assert abs(_heading(answer) - 92.4) < 0.5


def test_a_vehicle_that_drives_off_is_noticed():
    (
        record,
        position,
    ) = recordings.fog_gps_xian()
    answer = align(record, position)
    if answer.status == "inconsistent":
        assert any("moves" in reason or "drifts" in reason for reason in answer.reasons)
    else:  # the recording's first 68 s hold little of the drive
        assert abs(_heading(answer) - 92.4) < 3 * np.degrees(answer.euler_sigma[0]) + 0.5


def _refused(answer):
    assert answer.status == "level_only", answer.reasons
    assert answer.summary()["heading_deg"] is None
    assert "deg/h" in answer.reasons[0]
    assert "refused" in answer.reasons[0]


@pytest.mark.parametrize("begin", some([9880.0], [0.0]))
def test_mems_adis16405_is_levelled_and_heading_refused(begin):
    """Its first two minutes, and the last two of ten thousand seconds, or all of them."""
    record, position = recordings.static_adis16405()
    assert record.duration > 9999.0
    first, last = align(record.between(None, 120.0), position), align(record.between(begin, None), position)
    for answer in (first, last):
        _refused(answer)
    # Levels hours apart agree within their sigmas.
    apart = np.abs(first.euler[1:] - last.euler[1:])
    assert np.all(apart < 3 * np.hypot(first.euler_sigma[1:], last.euler_sigma[1:]))


@pytest.mark.parametrize("direction", ["east", "north"])
def test_xsens_is_levelled_and_heading_refused(direction):
    record, position = recordings.xsens_four_headings(direction)
    answer = align(record, position)
    _refused(answer)
    assert np.all(np.abs(np.degrees(answer.euler[1:])) < 0.5)
    assert np.all(np.degrees(answer.euler_sigma[1:]) < 0.5)


def test_stim300_on_a_cart_its_still_part():
    record, position = recordings.stim300_cart_chicago()
    answer = align(record.between(None, record.time[0] + 80.0), position)
    _refused(answer)
    f = record.between(None, record.time[0] + 80.0).accel.mean(axis=0)
    assert np.degrees(answer.pitch) == pytest.approx(np.degrees(np.arcsin(f[1] / np.linalg.norm(f))), abs=0.1)


def test_stim300_cart_that_rolls_off_is_noticed():
    record, position = recordings.stim300_cart_chicago()
    answer = align(record, position)
    assert answer.status == "inconsistent"
    assert "moves" in answer.reasons[0]


def test_another_epoch_of_the_same_log():
    """The attitude at 100 s asked of a 200 s log is that of a log that ends there, within the sigmas."""
    record, position = recordings.rlg_vehicle_xian()
    window = record.between(None, 200.0)
    early = align(window, position, "navigation", at=100.0)
    alone = align(record.between(None, 100.0), position, "navigation")
    assert early.time == 100.0
    assert np.all(np.abs(early.euler - alone.euler) < 3 * alone.euler_sigma)
    assert early.euler_sigma[0] < alone.euler_sigma[0]
