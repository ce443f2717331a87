"""The rotation mechanism against the strapdown, against derivatives of its own attitude, and its encoder."""

from dataclasses import dataclass

import numpy as np
import pytest

from tests.helpers import come_back
from tests.simulation.test_simulation import SHIP
from truenorth.core.attitude import rotation_vector_from_dcm
from truenorth.core.errors import UsageError
from truenorth.core.indexing import C_bs_from_angles
from truenorth.records.specs import ImuSpec, imu_spec
from truenorth.simulation import (
    Axis,
    EncoderSpec,
    Indexed,
    Indexer,
    Spin,
    Sway,
    Swing,
    Tone,
    ideal_log,
    scheme,
    simulate,
    simulate_runs,
    simulate_sensor,
    steps,
)
from truenorth.simulation.axis_angles import SCHEMES

deg = np.radians
ARCSEC = deg(1 / 3600)

# System 1: 6 deg/s about z of the body, 18 deg/s about x.
DUAL = Indexer((Axis("z", Spin(deg(6))), Axis("x", Spin(deg(18)))))
SLEWS = Indexer(tuple(Axis(a, s) for a, s in zip("zx", scheme("8", dwell=2.0, duration=60.0, rate=1.0), strict=True)))
CROOKED = Indexer(
    (
        Axis("z", Spin(0.3, 1.0), tilt=(1e-3, -2e-3, 0.0)),
        Axis("x", Swing(Tone(0.8, 5.0, 0.3), 0.2), tilt=(0.0, 1e-3, 5e-3)),
        Axis("y", Spin(-0.2)),
    )
)


def Rx(a):
    return np.array([[1, 0, 0], [0, np.cos(a), np.sin(a)], [0, -np.sin(a), np.cos(a)]])


def Rz(a):
    return np.array([[np.cos(a), np.sin(a), 0], [-np.sin(a), np.cos(a), 0], [0, 0, 1]])


def residual(indexer, rate, duration):
    """Largest error of attitude (arcsec) and velocity (m/s) of an ideal IMU through the strapdown."""
    _, turned, velocity, _ = come_back(Indexed(SHIP, indexer), rate, duration, every=round(rate))
    return np.max(np.abs(turned)) / ARCSEC, np.max(np.abs(velocity))


def test_the_ideal_imu_of_system_1_comes_back():
    """720 s at 100 Hz: .05 arcsec and 1e-4 m/s are wanted."""
    attitude, velocity = residual(DUAL, 100.0, 720.0)
    assert attitude < 0.05
    assert velocity < 1e-4


@pytest.mark.slow
@pytest.mark.parametrize("indexer", [DUAL, CROOKED, SLEWS], ids=["system 1", "crooked", "eight positions"])
def test_what_the_strapdown_leaves_is_its_own(indexer):
    """It falls by eight when the interval is halved, the order of the algorithm: the increments are not what limits it."""
    coarse, fine = (residual(indexer, rate, 240.0) for rate in (100.0, 200.0))
    np.testing.assert_allclose(np.divide(coarse, fine), 8.0, rtol=0.05)


def test_attitude_in_the_body_is_that_of_elementary_frame_rotations():
    """``C_sb = Rx(w1 t) Rz(w2 t)``."""
    t = np.array([0.0, 1.7, 55.0, 719.0])
    for k, C_bs in enumerate(DUAL.C_bs(t)):
        np.testing.assert_allclose(C_bs.T, Rx(deg(18) * t[k]) @ Rz(deg(6) * t[k]), atol=1e-12)
    np.testing.assert_allclose(C_bs_from_angles("zx", DUAL.angles(t)), DUAL.C_bs(t), atol=1e-15)
    body, imu = SHIP.states(t), Indexed(SHIP, DUAL).states(t)
    np.testing.assert_allclose(imu.C_nb, body.C_nb @ DUAL.C_bs(t), atol=1e-14)
    np.testing.assert_allclose(np.einsum("kij,kj->ki", DUAL.C_bs(t), imu.f_b), body.f_b, atol=1e-12)


@pytest.mark.parametrize("indexer", [DUAL, CROOKED, SLEWS], ids=["spins", "crooked", "slews"])
def test_rates_are_the_derivatives_of_attitude(indexer):
    """Central differences; at the fifth time the positions slew about x, at the sixth an onset is on its way."""
    t, h = np.array([0.4, 3.3, 12.5, 33.1, 8.1, 2.2]), 1e-4
    rig = Indexed(SHIP, indexer)
    before, at, after = (rig.states(t + s * h) for s in (-1, 0, 1))
    w_ns_n = rotation_vector_from_dcm(after.C_nb @ np.swapaxes(before.C_nb, 1, 2)) / (2 * h)
    body = SHIP.states(t)
    C_nb_before, C_nb_after = SHIP.states(t - h).C_nb, SHIP.states(t + h).C_nb
    w_nb_n = rotation_vector_from_dcm(C_nb_after @ np.swapaxes(C_nb_before, 1, 2)) / (2 * h)
    w_is_n = np.einsum("kij,kj->ki", at.C_nb, at.w_ib_b)
    w_ib_n = np.einsum("kij,kj->ki", body.C_nb, body.w_ib_b)
    np.testing.assert_allclose(w_is_n - w_ib_n, w_ns_n - w_nb_n, atol=2e-7)
    np.testing.assert_allclose(at.dw_ib_b, (after.w_ib_b - before.w_ib_b) / (2 * h), atol=2e-6)


@dataclass(frozen=True)
class OffCentre(Sway):
    """The ship with an accelerometer that goes round with the indexer, seen in the body."""

    place: tuple = (0.0, 0.0, 0.0)

    def arm(self, t):
        C, r = DUAL.C_bs(t), np.array(self.place)
        rates = np.array([deg(18), 0, 0]) + deg(6) * C[..., 2, :]  # row 2 of C_bs: the outer axis in s
        change = np.cross([deg(18), 0, 0], deg(6) * C[..., 2, :])  # of w_bs_s: minus w_1 x the outer axis
        inward = np.cross(rates, np.cross(rates, r)) - np.cross(change, r)
        fixed, still, _ = super().arm(t)
        return (
            fixed + np.einsum("...ij,j->...i", C, r),
            still + np.einsum("...ij,...j->...i", C, np.cross(rates, r)),
            still + np.einsum("...ij,...j->...i", C, inward),
        )


def test_size_effect_in_a_turning_imu():
    """Each accelerometer against a motion whose arm goes round with it."""
    places = ((0.2, 0.1, 0.0), (0.0, -0.3, 0.1), (0.1, 0.0, 0.2))
    record = simulate(Indexed(SHIP, DUAL), imu=ImuSpec(accel_positions=places), duration=20.0, kind="rates").record
    plain = simulate(Indexed(SHIP, DUAL), duration=20.0, kind="rates").record
    own = {name: getattr(SHIP, name) for name in SHIP.__dataclass_fields__}
    for axis, place in enumerate(places):
        there = Indexed(OffCentre(**own, place=place), DUAL).states(record.time)
        np.testing.assert_allclose(record.accel[:, axis], there.f_b[:, axis], atol=1e-6)
        assert np.max(np.abs(plain.accel[:, axis] - there.f_b[:, axis])) > 5e-3


def mean_attitude(name, dwell, rate):
    """Mean of ``C_bs`` over one cycle, and the angles at its ends."""
    turns = SCHEMES[name][1]
    cycle = sum(abs(angle) / rate + 0.5 + dwell for _, angle in turns)
    angles = scheme(name, dwell=dwell, duration=0.9 * cycle, rate=rate)
    indexer = Indexer(tuple(Axis(a, s) for a, s in zip("zx", angles, strict=False)))
    t = cycle * (np.arange(200_000) + 0.5) / 200_000
    return np.mean(indexer.C_bs(t), axis=0), indexer.angles(np.array([0.0, cycle]))


@pytest.mark.parametrize(("name", "left"), [("4", 0.15), ("8", 0.2), ("16", 1e-6)])
def test_a_cycle_of_a_scheme_averages_constant_errors_out(name, left):
    """Horizontal errors of one axis, all errors of two; of the sixteen positions the slews leave nothing either."""
    mean, ends = mean_attitude(name, dwell=60.0, rate=deg(6))
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-12)  # a scale factor error comes to nothing
    columns = slice(0, 2) if name == "4" else slice(None)
    assert np.max(np.abs(mean[:2, columns] if name == "4" else mean)) < left
    quick, _ = mean_attitude(name, dwell=2000.0, rate=deg(60))
    assert np.max(np.abs(quick[:2, :2] if name == "4" else quick)) < 1e-3
    if name == "8":
        assert np.max(np.abs(mean)) > 1e-2  # what the sixteen are for


def test_steps_go_where_they_are_said():
    (angle,) = steps([(0, deg(90)), (0, deg(-90))], dwell=10.0, duration=40.0, rate=deg(10), start=[deg(5)])
    slew = 9.0 + 0.5
    for t, expected in ((5.0, 5), (10 + slew + 5, 95), (2 * (10 + slew) + 5, 5), (1000.0, 5)):
        assert np.degrees(angle(np.array(t))[0]) == pytest.approx(expected, abs=1e-9)
    assert angle.peak_rate == pytest.approx(deg(10), rel=1e-12)


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: scheme("5", dwell=1.0, duration=10.0), "4, 8, 16"),
        (lambda: steps([], dwell=1.0, duration=10.0), "0 turns"),
        (lambda: steps([(2, 1.0)], dwell=1.0, duration=10.0), "turn 1 is of axis 2"),
        (lambda: steps([(0, 1.0), (0, 0.0)], dwell=1.0, duration=10.0), "turn 2"),
        (lambda: Axis("w", Spin(1.0)), "x, y and z"),
        (lambda: Indexer(()), "without axes"),
        (lambda: EncoderSpec(noise=-1.0), "noise is -1"),
        (lambda: encoder(errors={"offset": [1.0]}), "offset"),
    ],
)
def test_mechanisms_that_make_no_sense(call, said):
    with pytest.raises(UsageError, match=said):
        call()


def encoder(spec=None, indexer=DUAL, **options):
    return simulate_sensor(indexer, spec or EncoderSpec(), duration=50.0, **options)


def test_a_perfect_encoder_tells_the_angles():
    log = encoder()
    record = log.record
    np.testing.assert_allclose(record.angles, np.outer(record.time, [deg(6), deg(18)]), atol=1e-12)
    assert not log.errors["offset"].any()
    table = record.to_frame()
    assert list(table.columns) == ["angle_1", "angle_2"]
    np.testing.assert_allclose(table["angle_2"], 18 * record.time, atol=1e-10)
    single = encoder(indexer=Indexer((Axis("y", Spin(1.0)),))).record
    np.testing.assert_allclose(single.angles, single.time)


def test_each_error_of_the_encoder():
    late = encoder(EncoderSpec(latency=0.004)).record
    np.testing.assert_allclose(late.angles, DUAL.angles(late.time - 0.004), atol=1e-12)
    coarse = encoder(EncoderSpec(resolution=17 * ARCSEC)).record
    true = DUAL.angles(coarse.time)
    assert 7 * ARCSEC < np.max(np.abs(coarse.angles - true)) < 8.5001 * ARCSEC
    np.testing.assert_allclose(coarse.angles / (17 * ARCSEC), np.round(coarse.angles / (17 * ARCSEC)), atol=1e-6)
    given = {"offset": [1e-4, -2e-4], "eccentricity": [[1e-5, 2e-5], [3e-5, -1e-5]]}
    wrong = encoder(errors=given)
    for i in range(2):
        c, s = wrong.errors["eccentricity"][i]
        expected = given["offset"][i] + c * np.cos(true[:, i]) + s * np.sin(true[:, i])
        np.testing.assert_allclose(wrong.record.angles[:, i] - true[:, i], expected, atol=1e-13)
    noisy = encoder(EncoderSpec(noise=ARCSEC)).record
    # 10,002 draws: one sigma of their RMS is .7 %; beyond 4.5 of them 1 in 150,000.
    assert np.std(noisy.angles - true) == pytest.approx(ARCSEC, rel=4.5 / np.sqrt(2e4))


def test_encoder_draws_are_its_own():
    whole = EncoderSpec(noise=ARCSEC, offset=ARCSEC, eccentricity=ARCSEC)
    a, b = (encoder(whole, seed=3, run=1) for _ in range(2))
    assert a.record.angles.tobytes() == b.record.angles.tobytes()
    assert a.record.angles.tobytes() != encoder(whole, seed=3, run=2).record.angles.tobytes()
    without = encoder(EncoderSpec(noise=ARCSEC, eccentricity=ARCSEC), seed=3, run=1)
    shift = np.broadcast_to(a.errors["offset"], a.record.angles.shape)
    np.testing.assert_allclose(a.record.angles - without.record.angles, shift, atol=1e-14)
    assert np.all(shift != 0)


def test_runs_share_an_indexed_motion():
    ideal = ideal_log(Indexed(SHIP, DUAL), rate=100.0, duration=2.0)
    spec = imu_spec("navigation")
    one, two = ([s.record.gyro.tobytes() for s in simulate_runs(ideal, spec, 3, workers=w)] for w in (1, 2))
    assert one == two
    truth = next(iter(simulate_runs(ideal, spec, 1))).truth
    np.testing.assert_array_equal(truth.C_nb, Indexed(SHIP, DUAL).states(ideal.edges[1:]).C_nb)
