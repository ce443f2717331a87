"""Navigation of the real recordings, with the figures they give."""

import numpy as np
import pytest

from tests import recordings
from truenorth.aiding.aids import Gnss, Odometer
from truenorth.alignment import align
from truenorth.core.attitude import dcm_from_euler, misalignment
from truenorth.navigation import Mounting, Start, navigate
from truenorth.records import GnssRecord
from truenorth.state.layout import PHI


@pytest.mark.slow
def test_ring_laser_on_a_parked_vehicle():
    """Aligned on 300 s, then free inertial for 600 s: it drifts 7 m and .03 m/s, and its sigma says so (15 m, .06 m/s).

    With its stops given it stays where it is: the sigma of velocity is that of the updates.
    """
    record, position = recordings.rlg_vehicle_xian()
    start = align(record.between(None, 300.0), position, "navigation")
    for altitude in ("fixed", "free"):
        result = navigate(record, start, altitude=altitude)
        away = np.hypot(*result.displacement[-1])
        assert away < 12.0
        assert np.hypot(*result.v_n[-1, :2]) < 0.05
        sigma = np.sqrt(result.position_sigma[-1, :2] ** 2 - result.position_sigma[0, :2] ** 2)
        assert np.all(np.abs(result.displacement[-1]) < 3 * sigma)
        assert np.all(np.abs(result.v_n[-1, :2]) < 3 * result.v_sigma[-1, :2])
        assert np.all(result.v_sigma[-1, :2] < 0.1)
    stopped = navigate(record, start, zupt="auto")
    assert stopped.status == "navigated", stopped.reasons
    assert stopped.stops > 500
    assert np.hypot(*stopped.displacement[-1]) < 1.0
    later = align(record, position, "navigation")
    off = stopped.euler[-1] - later.euler
    assert np.all(np.abs(off) < 3 * np.hypot(stopped.euler_sigma[-1], later.euler_sigma))


def test_fog_with_gnss_while_the_engine_idles():
    """Aligned on 55 s, aided for the 13 s left: positions within the scatter of the fixes, innovations as expected."""
    record, position = recordings.fog_gps_xian()
    start = align(record.between(None, 55.0), position, "navigation")
    if not start.heading_known:
        pytest.skip("55 s are too short for this recording's heading")
    result = navigate(record, start, aid=Gnss(recordings.fog_gps_xian_gnss()))
    assert result.status == "navigated", result.reasons
    assert result.altitude == "gnss"
    assert np.hypot(*result.displacement[-1]) < 2.0
    assert np.all(np.abs(result.v_n[-1]) < 0.1)


CAR_TO_IMU = np.array([[0.9880, -0.1472, -0.0463], [0.1540, 0.9605, 0.2319], [0.0103, -0.2363, 0.9716]])  # FRD
RECEIVER = Mounting(bias_sigma=2.0, bias_time=60.0)  # what is alike from fix to fix: multipath, atmosphere
SWAP = np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, -1]])


@pytest.fixture(scope="module")
def car():
    """The MEMS car: level from its accelerometers, heading as its author says (320 deg), left open by 20 deg."""
    imu, odometer, gnss = recordings.car_mems_odo_gnss()
    u, _, vt = np.linalg.svd(SWAP @ CAR_TO_IMU @ SWAP.T)
    C_mb = u @ vt
    still = slice(0, 2000)
    up = imu.accel[still].mean(axis=0)
    up /= np.linalg.norm(up)
    forward = C_mb[1] - up * (C_mb[1] @ up)
    forward /= np.linalg.norm(forward)
    level = np.stack([np.cross(forward, up), forward, up])
    sigma = np.array([0.03, 0.03, 0.35, 0.02, 0.02, 0.02, 3, 3, 5, *[5e-4] * 3, *[0.3] * 3])
    start = Start(
        float(imu.time[0] - imu.interval),
        dcm_from_euler(np.radians(320.0), 0.0, 0.0) @ level,
        np.zeros(3),
        float(gnss.lat[0]),
        float(gnss.lon[0]),
        float(gnss.alt[0]),
        imu.gyro[still].mean(axis=0),
        np.zeros(3),
        np.diag(sigma**2),
    )
    wheel = Mounting(C_mb=C_mb, angle_sigma=np.radians(3), scale_sigma=0.05, lever_arm_sigma=1.0, noise=0.4, slip=0.2)
    return imu, odometer, gnss, start, wheel


def _without(gnss, start, stop):
    kept = (gnss.time < start) | (gnss.time > stop)
    return GnssRecord(gnss.time[kept], gnss.lat[kept], gnss.lon[kept], gnss.alt[kept], dop=gnss.dop[kept])


@pytest.mark.slow
def test_car_with_gnss_and_odometer(car):
    """Innovations no larger than expected, smaller where the receiver's dilutions say more than it errs by; the car looks where it
    drives; the record's gap is bridged and named."""
    imu, odometer, gnss, start, wheel = car
    result = navigate(
        imu, start, aid=[Gnss(gnss, RECEIVER), Odometer(odometer, wheel)], imu="consumer", zupt=[(1.0, 20.0)]
    )
    assert result.status == "navigated", result.reasons
    assert len(result.gaps) == 1
    said = result.summary()["aiding"]
    assert said["GNSS position"]["rejected"] == 0
    assert said["odometer"]["rejected"] < 30
    for name in ("GNSS position", "odometer"):
        assert 0.2 < said[name]["nis_over_rows"] < 1.5
    forward = np.einsum("kij,j->ki", result.C_nb, wheel.C_mb[1])
    fast = np.hypot(result.v_n[:, 0], result.v_n[:, 1]) > 4.0
    course = np.arctan2(result.v_n[fast, 0], result.v_n[fast, 1])
    heading = np.arctan2(forward[fast, 0], forward[fast, 1])
    off = np.degrees((heading - course + np.pi) % (2 * np.pi) - np.pi)
    assert np.median(np.abs(off)) < 3.0


@pytest.mark.slow
@pytest.mark.parametrize(("aligned", "end"), [(75.0, 140.0), (100.0, 140.0)])
def test_car_of_whose_wheel_nothing_is_said(aligned, end):
    """Ten times as noisy on the move as wheels are: half of its rows were rejected, and the car 3 km off. As by GNSS alone."""
    imu, odometer, gnss = recordings.car_mems_odo_gnss()
    both = [Odometer(odometer), Gnss(gnss)]
    start = align(imu.between(None, aligned), imu="consumer", aid=both)
    result = navigate(imu.between(None, end), start, aid=both, imu="consumer")
    assert result.status == "navigated", result.reasons
    assert any(item.key == "noise.estimated" for item in result.evidence)
    by_gnss = navigate(imu.between(None, end), start, aid=[Gnss(gnss)], imu="consumer")
    off = misalignment(result.C_nb[-1], by_gnss.C_nb[-1])
    assert np.all(np.abs(off) < 3.0 * np.hypot(result.track.sigma[-1, PHI], by_gnss.track.sigma[-1, PHI]))


@pytest.mark.slow
@pytest.mark.parametrize(("begin", "end"), [(60.0, 120.0), (85.0, 145.0)])
def test_car_through_an_outage_of_a_minute(car, begin, end):
    """At its end, 400 to 600 m on: 2 to 7 m with the odometer, 300 to 750 m without it, both within 4 of their sigmas.

    Without it tilt is what counts, and half a degree of misalignment between the gyros' axes makes a degree of tilt in
    a turn of 120 degrees: taken for noise in turns, it is in the sigma.
    """
    imu, odometer, gnss, start, wheel = car
    whole = navigate(
        imu, start, aid=[Gnss(gnss), Odometer(odometer, wheel)], imu="consumer", smooth=True, check_clocks=False
    )
    k = int(np.argmin(np.abs(whole.time - (end - 1.0))))
    away = {}
    for name, more in (("with", [Odometer(odometer, wheel)]), ("without", [])):
        result = navigate(
            imu,
            start,
            aid=[Gnss(_without(gnss, begin, end), RECEIVER), *more],
            imu="consumer",
            zupt=[(1.0, 20.0)],
            check_clocks=False,
        )
        away[name] = result.displacement[k] - whole.displacement[k]
        assert np.all(np.abs(away[name]) < 4 * np.hypot(result.position_sigma[k, :2], 1.0))
    print(
        f"outage {begin:g} to {end:g} s: {np.hypot(*away['with']):.1f} m with, {np.hypot(*away['without']):.0f} m without"
    )
    assert np.hypot(*away["with"]) < 15.0
    assert np.hypot(*away["without"]) > 10 * np.hypot(*away["with"])
