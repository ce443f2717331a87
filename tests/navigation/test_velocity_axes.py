"""Velocities in other axes are shown by the IMU's own changes of velocity; those that are right never are."""

import numpy as np
import pytest

from tests.runs import few_and_all
from truenorth.aiding.aids import Gnss
from truenorth.core.attitude import dcm_from_euler
from truenorth.core.errors import DataError
from truenorth.core.position import Position
from truenorth.errors.model import InsModel
from truenorth.navigation.known import known_start
from truenorth.navigation.velocity_axes import FORWARD_LEFT, check_axes, check_velocities
from truenorth.records import GnssRecord, OdometerRecord, Trajectory, VelocityRecord
from truenorth.records.specs import imu_spec
from truenorth.simulation import rest, simulate
from truenorth.state.mounting import Mounting

RATE, N = 5.0, 900
T = 50.0 + np.arange(N) / RATE
EYE = np.eye(3)
NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])


def track(drift=(0.02, -0.03, 0.0)):
    """A drive with turns, hills and speeds; the INS drifts and its heading is off by a degree."""
    s = T - T[0]
    heading, pitch = 0.6 + 0.8 * np.sin(s / 9.0), 0.08 * np.sin(s / 25.0)
    speed = 12.0 + 5.0 * np.sin(s / 7.0)
    C = dcm_from_euler(heading, pitch, 0.0 * s)
    v_n = speed[:, None] * C[:, :, 1]
    nothing = np.zeros(N)
    ins = Trajectory(
        T, dcm_from_euler(heading + 0.02, pitch, 0.0 * s), v_n + s[:, None] * drift, nothing + 0.8, nothing, nothing
    )
    return ins, C, v_n


def record_of(frame, R, noise=0.1, seed=0):
    _, C, v_n = track()
    v = v_n if frame == "navigation" else np.einsum("kji,kj->ki", C, v_n)
    v = v + noise * np.random.default_rng(seed).standard_normal(v.shape)
    return v @ R.T


@pytest.mark.parametrize(
    ("frame", "handed_in", "words"),
    [
        ("navigation", ("navigation", NED), ["north, east, down", "expected east, north, up"]),
        ("navigation", ("navigation", NED * [[1.0], [1.0], [-1.0]]), ["north, east, up"]),
        ("navigation", ("navigation", np.diag([1.0, 1.0, -1.0])), ["counted downwards", "name the column VD"]),
        ("navigation", ("body", EYE), ["right, forward, up of the body"]),
        ("body", ("body", NED), ["forward, right, down", "expected right, forward, up"]),
        ("body", ("body", FORWARD_LEFT.T), ["forward, left, up"]),
        ("body", ("body", np.diag([-1.0, -1.0, 1.0])), ["counted the other way"]),
        ("body", ("navigation", EYE), ["east, north, up"]),
        ("body", ("navigation", NED), ["north, east, down"]),
    ],
)
def test_other_axes_are_named(frame, handed_in, words):
    ins, _, _ = track()
    check_axes(VelocityRecord(T, record_of(frame, EYE), frame), ins, 0.0, EYE)
    wrong = VelocityRecord(T, record_of(*handed_in), frame, source="dvl.csv")
    with pytest.raises(DataError) as caught:
        check_axes(wrong, ins, 0.0, EYE)
    for word in ("dvl.csv: velocities change otherwise than the IMU says", *words):
        assert word in str(caught.value), caught.value


def test_gnss_an_odometer_that_counts_backward_and_a_turned_sensor():
    ins, C, v_n = track()
    absent = np.full(N, np.nan)
    check_axes(GnssRecord(T, absent, absent, absent, v_n), ins, 0.0, EYE)
    with pytest.raises(DataError, match="north, east, down"):
        check_axes(GnssRecord(T, absent, absent, absent, v_n @ NED), ins, 0.0, EYE)
    speed = np.einsum("ki,ki->k", C[:, :, 1], v_n)
    check_axes(OdometerRecord(T, speed, "speed"), ins, 0.0, EYE)
    with pytest.raises(DataError, match="counted the other way, backward"):
        check_axes(OdometerRecord(T, -speed, "speed"), ins, 0.0, EYE)
    C_mb = dcm_from_euler(0.7, 0.0, 0.0)
    check_axes(VelocityRecord(T, record_of("body", C_mb)), ins, 0.0, C_mb)
    check_axes(VelocityRecord(T, record_of("body", EYE)).shifted(0.4), ins, 0.4, EYE)


@few_and_all(100, few=15)
def test_noise_gaps_and_rest_are_no_contradiction(runs):
    """Noise as large as the motion, a vehicle at rest, few rows, absent axes: none of four a run is refused."""
    ins, _, _ = track()
    still = Trajectory(
        T, np.tile(EYE, (N, 1, 1)), 1e-3 * (T - T[0])[:, None] * [1.0, -1.0, 0.0], ins.lat, ins.lon, ins.alt
    )
    rng = np.random.default_rng(1)
    for frame in ("body", "navigation"):
        for seed in range(runs):
            check_axes(VelocityRecord(T, record_of(frame, EYE, 5.0, seed), frame), ins, 0.0, EYE)
            check_axes(VelocityRecord(T, 0.05 * rng.standard_normal((N, 3)), frame), still, 0.0, EYE)
    few = VelocityRecord(T[:15], record_of("body", NED)[:15])
    check_axes(few, ins, 0.0, EYE)
    forward = np.where([False, True, False], record_of("body", EYE), np.nan)
    check_axes(VelocityRecord(T, forward), ins, 0.0, EYE)
    check_axes(VelocityRecord(T + 1e4, record_of("body", NED)), ins, 0.0, EYE)


def test_a_vertical_bias_is_no_other_sign():
    """An accelerometer's 8 mg change velocity by 1.6 m/s in 20 s: a drone that hardly climbs was said to count downwards."""
    ins, _, v_n = track()
    slow = np.column_stack([v_n[:, :2], 0.3 * np.sin(2.0 * np.pi * T / 90.0)])
    biased = slow + 0.08 * (T - T[0])[:, None] * [0.0, 0.0, 1.0]
    own = Trajectory(T, ins.C_nb, biased, ins.lat, ins.lon, ins.alt)
    absent = np.full(N, np.nan)
    check_axes(GnssRecord(T, absent, absent, absent, slow), own, 0.0, EYE)
    with pytest.raises(DataError, match="counted downwards"):
        check_axes(GnssRecord(T, absent, absent, absent, slow * [1.0, 1.0, -1.0]), own, 0.0, EYE)


@pytest.mark.slow
def test_a_start_whose_level_is_poor_does_not_run_away():
    """Half a degree pushes by 0.09 m/s^2: after half an hour without aids the height was 12 km below, and refused."""
    place, spec = Position.from_degrees(45.0, 1.0, 100.0), imu_spec("navigation")
    record = simulate(rest(place, 0.3), rate=20.0, duration=1900.0, imu=spec, seed=1).record
    still = known_start(record, place, spec, 0.3, 0.02, pitch=0.015, roll=-0.015, level_sigma=0.009)
    time = np.arange(1.0, 1900.0)
    same = np.ones(len(time))
    gnss = GnssRecord(time, place.lat * same, place.lon * same, place.alt * same, np.zeros((len(time), 3)))
    check_velocities(record, still, InsModel.from_spec(spec), [Gnss(gnss, Mounting())], 0.2)
