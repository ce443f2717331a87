"""The mechanisation: an ideal IMU gives its motion back; turned axes turn the answer; chunks are the batch."""

import itertools
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from tests.runs import said_by_a_second_process, some
from truenorth.core.attitude import dcm_from_euler, rotation_vector_from_dcm
from truenorth.core.earth import earth_rate_n, normal_gravity, radii, transport_rate_n
from truenorth.core.errors import UsageError
from truenorth.records import ImuRecord
from truenorth.state.state import State
from truenorth.strapdown.level import VELOCITY, go_on, inertial_integrals, integrate_attitude, mechanise, underway

ALGORITHMS = ("previous", "1", "2", "3", "4")
METRES = np.array([6.4e6, 6.4e6, 1.0])  # of latitude, longitude, height
NODES, WEIGHTS = np.polynomial.legendre.leggauss(6)


class Drive:
    """Analytic motion over the ellipsoid, smooth: a vehicle that climbs, brakes, turns through south and rolls.

    Latitude, longitude, height, heading, pitch, roll are sums of sinusoids; derivatives are by complex steps, exact to
    rounding, so that nothing is shared with the mechanisation but the earth.
    """

    def __init__(self, lat: float, speed: float = 1.0) -> None:
        self.lat, self.speed = lat, speed

    def position(self, t):
        s = self.speed
        lat = self.lat + s * (2e-4 * np.sin(0.011 * t) + 1e-5 * np.sin(0.13 * t))
        lon = 1.9 + s * (3e-4 * np.sin(0.007 * t + 1) + 1e-5 * np.sin(0.11 * t)) / np.cos(self.lat)
        return lat, lon, 300.0 + s * (80 * np.sin(0.012 * t) + 2 * np.sin(0.15 * t))

    def euler(self, t):
        heading = 2.8 + 1.5 * np.sin(0.015 * t) + 0.2 * np.sin(0.3 * t)
        pitch = 0.05 * np.sin(0.21 * t + 0.3) + 0.1 * np.sin(0.02 * t)
        return heading, pitch, 0.08 * np.sin(0.35 * t)

    def v_n(self, t):
        lat, _, alt = self.position(t)
        d_lat, d_lon, d_alt = derivative(self.position, t)
        R_M, R_N = radii(lat)
        return (R_N + alt) * np.cos(lat) * d_lon, (R_M + alt) * d_lat, d_alt

    def C_nb(self, t):
        return dcm_from_euler(*self.euler(t))

    def rates(self, t):
        """``w_ib_b`` and ``f_b``, (..., 3), at times t."""
        lat, _, alt = self.position(t)
        v = stacked(self.v_n(t))
        w_ie, w_en = earth_rate_n(lat), transport_rate_n(lat, alt, v)
        f_n = stacked(derivative_of_velocity(self, t)) + np.cross(2 * w_ie + w_en, v)
        f_n[..., 2] += normal_gravity(lat, alt)
        C_bn = np.swapaxes(self.C_nb(t), -1, -2)
        _, _, roll = self.euler(t)
        d_heading, d_pitch, d_roll = derivative(self.euler, t)
        # C_nb = Rz(-heading) Rx(pitch) Ry(roll): each rate about its own axis, turned into the body.
        zero = np.zeros_like(roll)
        about_up = C_bn[..., :, 2] * -d_heading[..., None]
        about_x = stacked((np.cos(roll), zero, np.sin(roll))) * d_pitch[..., None]
        about_y = stacked((zero, d_roll, zero))
        w_nb_b = about_up + about_x + about_y
        return w_nb_b + np.einsum("...ij,...j->...i", C_bn, w_ie + w_en), np.einsum("...ij,...j->...i", C_bn, f_n)

    def record(self, T: float, duration: float) -> ImuRecord:
        """Exact increments by Gauss-Legendre quadrature with six nodes an interval."""
        t = T * np.arange(round(duration / T) + 1)
        parts = [self.rates(t[:-1] + T / 2 * (1 + x)) for x in NODES]
        dtheta, dvel = (T / 2 * sum(w * p[i] for w, p in zip(WEIGHTS, parts)) for i in (0, 1))
        return ImuRecord(t[1:], dtheta, dvel, "increments")

    def state(self, t: float = 0.0) -> State:
        at = np.float64(t)
        return State.at(self.C_nb(at), *map(float, self.position(at)), stacked(self.v_n(at)))


def stacked(parts):
    return np.stack(parts, axis=-1)


def derivative(of, t):
    return tuple(part.imag / 1e-100 for part in of(t + 1e-100j))


def derivative_of_velocity(drive, t):
    """Central differences of fourth order and a Richardson step: complex steps are in use inside already."""

    def slope(h):
        return np.array(
            [
                (8 * (b - a) - (d - c)) / (12 * h)
                for a, b, c, d in zip(drive.v_n(t - h), drive.v_n(t + h), drive.v_n(t - 2 * h), drive.v_n(t + 2 * h))
            ]
        )

    return tuple((16 * slope(0.5) - slope(1.0)) / 15)


def departure(out, drive):
    """Largest attitude (rad), velocity (m/s) and position (m) error over the outputs."""
    attitude = rotation_vector_from_dcm(out.C_nb @ np.swapaxes(drive.C_nb(out.time), -1, -2))
    velocity = out.v_n - stacked(drive.v_n(out.time))
    lat, lon, alt = drive.position(out.time)
    R_M, R_N = radii(lat)
    position = stacked(
        (
            (out.position[:, 1] - lon) * R_N * np.cos(lat),
            (out.position[:, 0] - lat) * R_M,
            out.position[:, 2] - alt,
        )
    )
    return tuple(np.linalg.norm(e, axis=-1).max() for e in (attitude, velocity, position))


@pytest.fixture(scope="module")
def drive():
    return Drive(0.6)


@pytest.fixture(scope="module")
def record(drive):
    return drive_at(0.6, 600.0)[1]


@pytest.fixture(scope="module")
def double_rate(drive):
    return drive.record(0.005, 600.0)


@cache
def drive_at(lat, duration):
    """A drive at a latitude, and its log at 100 Hz."""
    drive = Drive(lat)
    return drive, drive.record(0.01, duration)


@pytest.mark.parametrize("algorithm", ["previous", "2"])
@pytest.mark.parametrize(
    ("lat", "duration"), some([(0.6, 100.0), (-0.6, 100.0), (1.4, 100.0)], [(0.6, 600.0), (-0.6, 600.0), (1.4, 600.0)])
)
def test_ideal_imu_gives_its_motion_back(lat, duration, algorithm):
    """100 Hz: 1e-9 rad and 5 mm in 10 minutes, and what a wrong sign or a small cosine would do within seconds elsewhere."""
    drive, record = drive_at(lat, duration)
    out = mechanise(record, drive.state(), algorithm=algorithm, every=2)
    attitude, velocity, position = departure(out, drive)
    assert attitude < 1e-9
    assert velocity < 1e-6
    assert position < 5e-3


@pytest.mark.slow
@pytest.mark.parametrize("algorithm", ["3", "4"])
def test_ideal_imu_with_three_and_four_samples(drive, double_rate, algorithm):
    """Their coefficients are made for coning, not for symmetry in time: 200 Hz for the same figures (see below)."""
    attitude, velocity, position = departure(mechanise(double_rate, drive.state(), algorithm=algorithm, every=5), drive)
    assert attitude < 1e-9
    assert velocity < 1e-6
    assert position < 5e-3


@pytest.mark.slow
def test_without_correction_the_motion_does_not_come_back(drive, record):
    """So that the round trips above are known to see coning and sculling."""
    attitude, _, position = departure(mechanise(record, drive.state(), algorithm="1", every=100), drive)
    assert attitude > 1e-7
    assert position > 0.1


@pytest.mark.slow
@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_errors_fall_with_the_sampling_interval(drive, algorithm):
    """Attitude: second order without correction; third where crosses with the last sample make an update that is not
    symmetric in time; two samples are symmetric and do better. Velocity and position: at least second.
    """
    coarse, fine = (
        np.array(departure(mechanise(drive.record(T, 480.0), drive.state(), algorithm=algorithm), drive))
        for T in (0.08, 0.04)
    )
    order = np.log2(coarse / fine)
    if algorithm == "1":
        assert order[0] == pytest.approx(2, abs=0.1)
    elif algorithm == "2":
        assert order[0] > 1.9
    else:
        assert order[0] == pytest.approx(3, abs=0.1)
    assert np.all(order[1:] > 1.9)


def test_rates_give_the_motion_back_to_third_order(drive):
    """Point rates, with the two rows before the start known: no beginning to be guessed."""
    errors = []
    for T in (0.02, 0.01):
        t = T * np.arange(-1, round(300 / T) + 1)
        rates = ImuRecord(t, *drive.rates(t))
        _, out = go_on(rates[2:], underway(drive.state(), before=rates[:2]))
        errors.append(departure(out, drive))
    np.testing.assert_allclose(np.log2(np.array(errors[0]) / errors[1]), 3, atol=0.1)
    attitude, _, position = errors[1]
    assert attitude < 1e-9
    assert position < 5e-3


@pytest.mark.parametrize("lat", [-0.6, 0.0, 1.4])
@pytest.mark.parametrize("altitude", ["free", "fixed"])
def test_a_base_at_rest_stays(lat, altitude):
    C_nb = dcm_from_euler(4.0, 0.1, -0.2)
    T, count = 0.01, 60_000
    dtheta = np.tile(T * C_nb.T @ earth_rate_n(lat), (count, 1))
    dvel = np.tile(T * C_nb.T @ [0, 0, normal_gravity(lat, 500.0)], (count, 1))
    record = ImuRecord(T * np.arange(1, count + 1), dtheta, dvel, "increments")
    out = mechanise(record, State.at(C_nb, lat, 1.0, 500.0), altitude=altitude, every=count)
    rounding = 2 * np.finfo(float).eps * count  # of a quaternion that stands still: the same way each time
    assert np.linalg.norm(rotation_vector_from_dcm(out.C_nb[0] @ C_nb.T)) < rounding
    np.testing.assert_allclose(out.v_n[0], 0, atol=9.8 * 600 * rounding)
    moved = (out.position[0] - [lat, 1.0, 500.0]) * METRES
    np.testing.assert_allclose(moved, 0, atol=9.8 * 600**2 / 2 * rounding + METRES[0] * rounding / 2)


@pytest.mark.slow
def test_fixed_altitude_holds_height_and_vertical_velocity(drive, record):
    start = replace(drive.state(), v_n=np.array([3.0, 4.0, 5.0]))
    out = mechanise(record[:500], start, altitude="fixed")
    assert np.all(out.position[:, 2] == start.alt)
    assert np.all(out.v_n[:, 2] == 0.0)


@pytest.mark.parametrize("options", [{"altitude": "held"}, {"every": 0}, {"algorithm": "5"}])
def test_wrong_options(drive, record, options):
    with pytest.raises(UsageError):
        mechanise(record[:10], drive.state(), **options)


rotations = (
    st.tuples(*[st.floats(-1, 1)] * 4)
    .filter(lambda q: np.linalg.norm(q) > 0.1)
    .map(lambda q: Rotation.from_quat(q).as_matrix())
)
slow_settings = settings(max_examples=20, deadline=None)


@slow_settings
@given(C=rotations, algorithm=st.sampled_from(ALGORITHMS))
def test_turning_the_body_axes_turns_the_answer(drive, record, C, algorithm):
    """The same motion, in velocity and position; the attitude ``C_nb C'``."""
    some, start = record[20_000:23_000], drive.state(200.0)
    turned_start = State.at(start.C_nb @ C.T, start.lat, start.lon, start.alt, start.v_n)
    out = mechanise(some, start, algorithm=algorithm, every=50)
    turned = mechanise(some.rotated(C), turned_start, algorithm=algorithm, every=50)
    np.testing.assert_allclose(turned.C_nb, out.C_nb @ C.T, atol=1e-12)
    np.testing.assert_allclose(turned.v_n, out.v_n, atol=1e-10)
    np.testing.assert_allclose(turned.position * METRES, out.position * METRES, rtol=0, atol=1e-7)


@slow_settings
@given(C=rotations)
def test_turning_the_body_axes_turns_the_inertial_integrals(record, C):
    some, epochs = record[:3000], np.arange(0, 3001, 100)
    turned = some.rotated(C)
    C_ib, v, p = inertial_integrals(some.gyro, some.accel, some.steps, epochs)
    C_ib_turned, v_turned, p_turned = inertial_integrals(turned.gyro, turned.accel, turned.steps, epochs)
    np.testing.assert_allclose(C_ib_turned, C @ C_ib @ C.T, atol=1e-12)
    np.testing.assert_allclose(v_turned, v @ C.T, atol=1e-9)
    np.testing.assert_allclose(p_turned, p @ C.T, atol=1e-8)


@slow_settings
@given(turn=st.floats(-3, 3))
def test_longitude_is_not_felt(drive, record, turn):
    some, start = record[:2000], drive.state()
    out = mechanise(some, start, every=100)
    moved = mechanise(some, replace(start, lon=start.lon + turn), every=100)
    np.testing.assert_array_equal(moved.C_nb, out.C_nb)
    np.testing.assert_array_equal(moved.v_n, out.v_n)
    rounding = 2000 * np.spacing(8.0)
    np.testing.assert_allclose(moved.position[:, 1] - turn, out.position[:, 1], rtol=0, atol=rounding)


@slow_settings
@given(
    cuts=st.lists(st.integers(2, 97), min_size=3, max_size=30),
    algorithm=st.sampled_from(ALGORITHMS),
    kind=st.sampled_from(["rates", "increments"]),
    every=st.integers(1, 7),
    altitude=st.sampled_from(["free", "fixed"]),
)
def test_chunks_have_the_bits_of_one_batch(drive, record, cuts, algorithm, kind, every, altitude):
    """Whatever the cuts: output epochs and what fills no update yet are carried over."""
    edges = np.concatenate([[0], np.cumsum(cuts)])
    part = record[: edges[-1]]
    part = ImuRecord(0.3 + part.time, part.gyro, part.accel, kind)  # stamps whose differences are not all the same
    start = underway(drive.state(), 0.01)
    options = {"algorithm": algorithm, "every": every, "altitude": altitude}
    end, batch = go_on(part, start, **options)
    state, chunks = start, []
    for first, last in itertools.pairwise(edges):
        state, track = go_on(part[first:last], state, **options)
        chunks.append(track)
    for name in ("time", "C_nb", "v_n", "position"):
        joined = np.concatenate([getattr(c, name) for c in chunks])
        np.testing.assert_array_equal(joined, getattr(batch, name))
    np.testing.assert_array_equal(state.motion, end.motion)
    np.testing.assert_array_equal(state.rest, end.rest)
    assert len(batch.time) == len(part) // (1 if algorithm == "previous" else int(algorithm)) // every


def test_a_correction_between_chunks_counts(drive, record):
    """A state is what it says it is: nothing hidden brings the old velocity back."""
    state, _ = go_on(record[:100], underway(drive.state()))
    motion = state.motion.copy()
    motion[VELOCITY] += [1.0, 0.0, 0.0]
    _, out = go_on(record[100:102], replace(state, motion=motion))
    _, unchanged = go_on(record[100:102], state)
    np.testing.assert_allclose(out.v_n - unchanged.v_n, np.tile([1.0, 0, 0], (2, 1)), atol=1e-5)


@pytest.mark.parametrize("kind", ["rates", "increments"])
def test_assumed_biases_are_taken_off(drive, record, kind):
    """A log whose sensors have biases, from a state that knows them, gives what the log without them gives."""
    some, gyro, accel = record[:500], np.array([1e-4, -2e-4, 3e-4]), np.array([0.01, -0.02, 0.03])
    scale = some.interval if kind == "increments" else 1.0
    true = ImuRecord(some.time, some.gyro, some.accel, kind)
    read = ImuRecord(some.time, some.gyro + scale * gyro, some.accel + scale * accel, kind)
    out = mechanise(read, replace(drive.state(), gyro_bias=gyro, accel_bias=accel))
    expected = mechanise(true, drive.state())
    for name, atol in (("C_nb", 1e-12), ("v_n", 1e-10)):
        np.testing.assert_allclose(getattr(out, name), getattr(expected, name), rtol=0, atol=atol)
    np.testing.assert_array_equal(out.gyro_bias, np.tile(gyro, (500, 1)))


def test_inertial_frame_and_local_level_agree(drive, record):
    """``C_ib`` of attitude-only integration and of the inertial integrals is the analytic attitude seen from ``i``.

    Between the frames stands the turn of n: earth and transport rate, integrated here from the analytic motion.
    """
    some = record[:6000]
    q = integrate_attitude(some.gyro)
    C_ib, _, _ = inertial_integrals(some.gyro, some.accel, some.steps, np.arange(6001))
    quaternions = Rotation.from_quat(q, scalar_first=True).as_matrix()
    np.testing.assert_allclose(quaternions, C_ib, atol=1e-14)

    t = 0.01 * np.arange(6001)
    C_i_n = [np.eye(3)]
    for a in t[:-1]:  # the rate is smooth and tiny: the middle of each interval
        middle = np.float64(a + 0.005)
        lat, _, alt = drive.position(middle)
        rate = earth_rate_n(lat) + transport_rate_n(lat, alt, stacked(drive.v_n(middle)))
        C_i_n.append(C_i_n[-1] @ Rotation.from_rotvec(0.01 * rate).as_matrix())
    expected = drive.C_nb(t[0]).T @ np.array(C_i_n) @ drive.C_nb(t)
    np.testing.assert_allclose(C_ib, expected, atol=1e-9)


def test_inertial_integrals_of_an_analytic_force(record):
    """No rotation: velocity exact, position the trapezoid of velocity, at the epochs asked, repeats included."""
    T, count = 0.01, 1000
    t = T * np.arange(count + 1)
    v = np.stack([np.sin(t), 1 - np.cos(2 * t), 9.8 * t], axis=1)
    p = np.stack([1 - np.cos(t), t - np.sin(2 * t) / 2, 4.9 * t**2], axis=1)
    epochs = np.array([0, 0, 1, 500, 1000])
    C, v_i, p_i = inertial_integrals(np.zeros((count, 3)), np.diff(v, axis=0), np.full(count, T), epochs)
    np.testing.assert_array_equal(C, np.broadcast_to(np.eye(3), (5, 3, 3)))
    np.testing.assert_allclose(v_i, v[epochs], atol=1e-12)
    # T^2/12 times the change of force, of up to 1, 4 and 0 m/s^2.
    np.testing.assert_allclose(p_i, p[epochs], rtol=0, atol=T**2 / 12 * 4 + 1e-10)
    with pytest.raises(UsageError, match="between 0 and 1000"):
        inertial_integrals(np.zeros((count, 3)), np.zeros((count, 3)), np.full(count, T), [0, 1001])


PROGRAM = """
import numpy as np
from truenorth.strapdown import inertial_integration
from truenorth.state.state import State
from truenorth.strapdown import level as strapdown
from truenorth.strapdown.increments import last_rows
from truenorth.records import ImuRecord
rows = np.full((9, 3), 1e-3)
for kind in ("rates", "increments"):
    for algorithm in ("previous", "4"):
        record = ImuRecord(np.arange(9.0), rows, rows, kind)
        strapdown.mechanise(record, State.at(np.eye(3), 0.6), algorithm=algorithm)
strapdown.integrate_attitude(rows)
strapdown.integrate_attitude(rows.tolist(), algorithm="2")
strapdown.inertial_integrals(rows, record.accel, np.ones(9), [0, 9])
kernels = (strapdown.mechanise_increments, inertial_integration._integrate_attitude, inertial_integration._inertial_integrals)
print(*(len(k.signatures) for k in kernels), *(sum(k.stats.cache_misses.values()) for k in kernels))
"""


def test_a_second_process_compiles_nothing():
    """Each kernel has one signature, whatever the inputs, and comes from the disk the second time."""
    expected = ["1", "1", "1", "0", "0", "0"]
    assert said_by_a_second_process(PROGRAM, expected.__eq__) == expected
