"""Alignment on the move on real recordings."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from tests import recordings
from tests.helpers import start_before
from truenorth import align, navigate
from truenorth.aiding.aids import Gnss, Odometer
from truenorth.alignment.in_motion import align_in_motion
from truenorth.alignment.in_motion_start import backtracked
from truenorth.coarse.odometer import gnss_track
from truenorth.core.position import METRES_PER_RADIAN
from truenorth.navigation import Mounting
from truenorth.state.layout import ANTENNA_ARM, DP

FOG = {
    "name": "FOG",
    "gyro": {"bias": "0.05 deg/h", "random_walk": "0.005 deg/sqrt(h)"},
    "accel": {"bias": "200 ug", "random_walk": "50 ug/sqrt(Hz)"},
}
# Its wheel speed is coarse, 4 Hz; how the IMU lies in the car is left open by 15 deg.
CAR_WHEEL = Mounting(scale_sigma=0.05, angle_sigma=math.radians(15.0), lever_arm_sigma=1.0, noise=0.4, slip=0.2)


def signed(angle):
    return (angle + np.pi) % (2 * np.pi) - np.pi


@pytest.mark.slow
def test_fog_aligned_with_gnss_while_the_engine_idles():
    """Against the aligner for a base that stays; latitude from GNSS."""
    imu, position = recordings.fog_gps_xian()
    moving = align_in_motion(imu, FOG, gnss=recordings.fog_gps_xian_gnss())
    at_rest = align(imu, position, FOG)
    assert moving.status == at_rest.status == "aligned"
    assert moving.moving.heading_from == "the earth's rate"
    sigma = np.hypot(moving.euler_sigma[0], at_rest.euler_sigma[0])
    assert abs(signed(moving.heading - at_rest.heading)) < 2.5 * sigma < math.radians(4.0)
    assert abs(moving.pitch - at_rest.pitch) < math.radians(0.02)
    assert abs(moving.roll - at_rest.roll) < math.radians(0.02)


@pytest.mark.slow
@pytest.mark.parametrize("closed", [False, True])
def test_cart_knows_how_late_its_receiver_is(monkeypatch, closed):
    """Places by themselves know it, as late by any latency; velocities are not of their moment, nor do they show the mast's swing.

    One delay for both was 1.17 s by open last passes and 1.13 s by closed ones, each said to .01 s.
    """
    if closed:
        monkeypatch.setattr("truenorth.alignment.in_motion.open_track", lambda *_: None)
    imu, _ = recordings.stim300_cart_chicago()
    gnss = recordings.stim300_cart_chicago_gnss()
    places = replace(gnss, v_n=None, velocity_sigma=None)
    found = []
    for log, latency in ((gnss, 0.2), (places, 0.2), (places, 0.5)):
        antenna = Mounting(lever_arm=np.array([0.0, 0.0, 2.0]), latency_sigma=latency)
        answer = align_in_motion(imu, "industrial", gnss=log, antenna=antenna)
        assert answer.status == "aligned", answer.reasons
        assert answer.moving.rejected["GNSS position"][0] == 0
        found.append(answer.moving.delays["GNSS"])
    for (one, sigma), (other, its) in itertools.combinations(found, 2):
        assert abs(one - other) < 3.0 * math.hypot(sigma, its)
        assert sigma < 0.05


@pytest.mark.slow
def test_cart_gets_its_heading_from_motion():
    """Its IMU looks backwards: the course is 180 deg from the y axis, along the whole way."""
    imu, _ = recordings.stim300_cart_chicago()
    gnss = recordings.stim300_cart_chicago_gnss()
    on_time = Mounting(lever_arm=np.array([0.0, 0.0, 2.0]))
    antenna = replace(on_time, latency_sigma=0.2)
    answer = align_in_motion(imu, "industrial", gnss=gnss, antenna=antenna)
    assert answer.status == "aligned", answer.reasons
    assert answer.moving.heading_from == "motion"
    # Its stamps are most of a second late; a receiver said to be on time is contradicted, and by how much.
    late, sigma = answer.moving.delays["GNSS"]
    assert late > 0.5
    assert sigma < 0.05
    said = align_in_motion(imu, "industrial", gnss=gnss, antenna=on_time)
    looked = next(item.figures for item in said.evidence if item.key == "second_look.late")
    assert abs(looked["size"] - late) < 3.0 * math.hypot(sigma, looked["sigma"])
    apart = abs(signed(said.heading - answer.heading))
    assert said.status == "inconsistent" or apart < 2.0 * said.euler_sigma[0]
    v = gnss.v_n[:, :2]
    fast = (np.hypot(*v.T) > 0.6) & (gnss.time < answer.time)
    track = answer.moving.track
    heading = np.interp(gnss.time[fast], track.time, np.unwrap(answer.history.euler[:, 0]))
    off = np.degrees(signed(heading + np.pi - np.arctan2(v[fast, 0], v[fast, 1])))
    assert fast.sum() > 40
    assert abs(np.median(off)) < 10.0
    # Before it moves nothing but the earth's rate could tell, and these gyros do not see it.
    still = align_in_motion(imu.between(None, imu.time[0] + 80.0), "industrial", gnss=gnss, antenna=antenna)
    assert still.status in ("level_only", "not_converged", "inconsistent")
    assert still.summary()["heading_deg"] is None


@pytest.fixture(scope="module")
def car():
    imu, odometer, gnss = recordings.car_mems_odo_gnss()
    return imu, odometer, gnss, align_in_motion(imu, "consumer", odometer=odometer, gnss=gnss, wheel=CAR_WHEEL)


@pytest.mark.slow
def test_car_heading_with_a_tilted_imu(car):
    """Vehicle's heading, its IMU turned in the car by 8 deg about the vertical, against GNSS course above 4 m/s."""
    _, _, gnss, answer = car
    assert answer.status == "aligned", answer.reasons
    track, wheel = answer.moving.track, answer.moving.wheel
    v, _ = gnss_track(gnss, track.time)
    fast = np.hypot(v[:, 0], v[:, 1]) > 4.0
    forward = track.C_nb @ wheel.C_mb[1]
    off = np.degrees(signed(np.arctan2(forward[fast, 0], forward[fast, 1]) - np.arctan2(v[fast, 0], v[fast, 1])))
    assert np.median(np.abs(off)) < 3.0
    assert abs(np.median(off)) < 2.0
    yaw = answer.moving.summary()["mounting_deg"][0]
    assert abs(yaw - 8.9) < 3.0  # its author's


@pytest.mark.slow
@pytest.mark.parametrize(("begin", "end"), [(0.0, 100.0), (0.0, 147.0), (30.0, 110.0), (50.0, 130.0), (70.0, 147.0)])
def test_car_of_which_nothing_is_said(begin, end):
    """Its wheel is off by .3 to 1.4 m/s for rows on end on the move, and exact at rest: nobody says so. As by GNSS alone."""
    imu, odometer, gnss = recordings.car_mems_odo_gnss()
    imu = imu.between(imu.time[0] - 0.01 + begin, imu.time[0] + end)
    by_both = align(imu, imu="consumer", aid=[Odometer(odometer), Gnss(gnss)])
    by_gnss = align(imu, imu="consumer", aid=[Gnss(gnss)])
    assert by_both.status == "aligned", by_both.reasons
    sigma = np.hypot(by_both.euler_sigma, by_gnss.euler_sigma)
    off = np.array([by_both.heading - by_gnss.heading, by_both.pitch - by_gnss.pitch, by_both.roll - by_gnss.roll])
    assert np.all(np.abs(signed(off)) < 3.0 * sigma)


@pytest.fixture(scope="module")
def standing():
    """A log of FOG gyros at rest, its receiver's, and what is made of both."""
    imu, _ = recordings.fog_gps_xian()
    gnss = recordings.fog_gps_xian_gnss()
    return imu, gnss, align(imu, imu="navigation", aid=[Gnss(gnss)])


@pytest.mark.slow
def test_receiver_led_away_while_the_vehicle_stands(standing):
    """By .3 m/s north from the first third on, places with it, which turns heading by 20 deg; the IMU rests, and knows better."""
    imu, gnss, as_it_was = standing
    speed = 0.3
    since = np.clip((gnss.time - 14.0) / 60.0, 0.0, None)
    led = replace(
        gnss,
        v_n=gnss.v_n + np.outer(speed * (since > 0.0), [0.0, 1.0, 0.0]),
        lat=gnss.lat + speed * 60.0 * since / METRES_PER_RADIAN,
    )
    answer = align(imu, imu="navigation", aid=[Gnss(led)])
    assert abs(signed(answer.heading - as_it_was.heading)) > math.radians(10.0)
    for found, refused in ((as_it_was, False), (answer, True)):
        assert any(item.key == "innovations.at_rest" for item in found.evidence) == refused
        assert (found.status == "inconsistent") == refused


@pytest.mark.slow
def test_car_dead_reckons_by_the_odometer(car):
    """150 s without GNSS, from the start that the aligner leads back to: the miss is what its sigma says.

    Gyros whose scale is off by a per cent lose 3 deg in 300 deg of turns, 5 % of the way: no bar below sigma holds by right. A
    wheel shows no heading, so that of the start gets worse: the bar is what the last heading's sigma makes of all the way.
    """
    imu, odometer, gnss, answer = car
    moving = answer.moving
    sigma = np.concatenate([np.radians([1.0, 1.0, 5.0]), [0.1] * 3, [3.0] * 3, [2e-4] * 3, [0.05] * 3])
    place, biases = (gnss.lat[0], gnss.lon[0], gnss.alt[0]), (answer.gyro_bias, answer.accel_bias)
    start = start_before(imu, backtracked(imu, moving.track), np.zeros(3), place, biases, sigma)
    wheel = Mounting(C_mb=moving.wheel.C_mb, lever_arm=moving.wheel.lever_arm, scale_sigma=0.02, noise=0.4)
    result = navigate(imu, start, aid=Odometer(odometer, wheel), imu="consumer", check_clocks=False)
    _, place = gnss_track(gnss, result.track.time)
    off = 6371e3 * (result.track.position[-1, :2] - place[-1, :2]) * [1.0, math.cos(place[-1, 0])]
    assert moving.distance > 900.0
    P = result.track.P[-1][DP, DP][:2, :2]
    assert off[::-1] @ np.linalg.solve(P, off[::-1]) < 9.2  # of chi-square with 2 degrees of freedom 99 %
    assert np.sqrt(np.trace(P)) < moving.distance * result.track.sigma[-1, 2]


@pytest.mark.slow
@pytest.mark.parametrize(("begin", "end"), [(35.0, 110.0), (50.0, 125.0)])
def test_car_levels_alike_by_gnss_and_by_both(begin, end):
    """A wheel that stays on the road and the heights of a receiver agree on pitch: these err by more than its places."""
    imu, odometer, gnss = recordings.car_mems_odo_gnss()
    part = imu.between(imu.time[0] + begin, imu.time[0] + end)
    alone = align_in_motion(part, "consumer", gnss=gnss)
    both = align_in_motion(part, "consumer", gnss=gnss, odometer=odometer, wheel=CAR_WHEEL)
    for name, one in (("pitch", 1), ("roll", 2)):
        off = getattr(both, name) - getattr(alone, name)
        assert abs(off) < 2.5 * np.hypot(both.euler_sigma[one], alone.euler_sigma[one]), name


@pytest.mark.slow
def test_car_without_gnss_claims_no_heading():
    from truenorth.core.position import Position

    imu, odometer, _ = recordings.car_mems_odo_gnss()
    place = Position.from_degrees(59.35, 18.07, 30.0)
    answer = align_in_motion(imu, "consumer", odometer=odometer, wheel=CAR_WHEEL, position=place)
    assert answer.status == "level_only"
    assert answer.summary()["heading_deg"] is None


@pytest.mark.slow
def test_a_mast_that_is_not_said():
    """2 m above the IMU on rough ground: velocities that do not show its swing made it -.36 m, known to .13."""
    record, _ = recordings.stim300_cart_chicago()
    answer = align_in_motion(record, "industrial", gnss=recordings.stim300_cart_chicago_gnss())
    arm, sigma = answer.moving.known[ANTENNA_ARM][2], np.sqrt(answer.moving.P[-1, -1])
    assert abs(arm - 2.0) < 3.3 * sigma
    assert any(item.key == "noise.swing" for item in answer.evidence)
