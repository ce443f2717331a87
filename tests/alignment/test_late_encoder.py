"""An encoder that is late by a log's own stamps: a log that ends in a slew is right all the same, and a sound one is as it was."""

import numpy as np
import pytest

import truenorth as tn
from tests.runs import few_and_all, some
from truenorth.alignment import rotary
from truenorth.alignment.encoder_angles import carried_angles
from truenorth.alignment.late_encoder import NOT_LATE, coarse_delay, late_evidence, left_of
from truenorth.core.attitude import dcm_from_euler, misalignment, rotation_vector_from_dcm
from truenorth.core.earth import normal_gravity
from truenorth.core.indexing import C_bs_from_angles
from truenorth.quality.encoder_delay import Delay, delay_of
from truenorth.quality.encoder_patterns import Turns
from truenorth.records import EncoderRecord, ImuRecord
from truenorth.state.evidence import Effect

ARCSEC = np.radians(1.0) / 3600.0
RATE, STILL = 50.0, 180.0  # Hz, s
PACE, WAY = np.radians(10.0), 20.0  # rad/s, and s one way
C_NB = dcm_from_euler(1.2, 0.01, -0.02)
SPEC = tn.imu_spec("navigation")


def to_and_fro(time):
    """An axis that turns back every 20 s within half a second: the integral of a rate that goes on as a sine at each turn."""
    fine = np.arange(-5.0, STILL + 5.0, 1e-3)
    rate = PACE * np.clip(np.sin(np.pi * fine / WAY) * WAY / np.pi / 0.25, -1.0, 1.0)
    angle = np.cumsum(rate) * 1e-3
    return np.interp(time, fine, angle - np.interp(0.0, fine, angle))


def one_pace(time):
    return PACE * time


def at_rest(time):
    """To and fro, and at rest from the sixth turn on."""
    return to_and_fro(np.minimum(time, 6 * WAY))


def indexed(seed, angle, late, axes="x"):
    """A still base, each of its axes at one angle; the encoder shows 20 rows a second, late, with 2 arcsec of noise."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, STILL - 5.0, 1.0 / RATE)
    angles = np.stack([angle(time)] * len(axes), axis=1)
    C_bs = C_bs_from_angles(axes, angles)
    middle = C_NB @ C_bs_from_angles(axes, 0.5 * (angles[1:] + angles[:-1]))
    place = tn.Position(np.radians(35.0), 0.0)
    earth = 7.292115e-5 * np.array([0.0, np.cos(place.lat), np.sin(place.lat)])
    gyro = rotation_vector_from_dcm(np.swapaxes(C_bs[:-1], 1, 2) @ C_bs[1:]) * RATE
    gyro += np.einsum("kji,j->ki", middle, earth)
    accel = np.einsum("kji,j->ki", middle, [0.0, 0.0, float(normal_gravity(place.lat, 0.0))])
    for values, bias, walk in (
        (gyro, SPEC.gyro_bias, SPEC.gyro_random_walk),
        (accel, SPEC.accel_bias, SPEC.accel_random_walk),
    ):
        values += bias * rng.standard_normal(3) + walk * np.sqrt(RATE) * rng.standard_normal(values.shape)
    stamps = time[::2]
    shown = np.stack([angle(stamps - late)] * len(axes), axis=1)
    shown = shown + 2.0 * ARCSEC * rng.standard_normal(shown.shape)
    return ImuRecord(time[1:], gyro / RATE, accel / RATE, "increments"), EncoderRecord(stamps, shown), place


def answered(seed, angle, late, axes="x", **more):
    record, encoder, place = indexed(seed, angle, late, axes)
    return tn.align(record, place, SPEC, aid=tn.Indexer(encoder, tuple(axes), **more))


def off(answer):
    return misalignment(answer.C_nb, C_NB) / np.sqrt(np.diag(answer.phi_covariance))


@few_and_all(8, few=2)
def test_an_encoder_that_is_late_by_tenths_of_a_second(runs):
    """What is linear in a delay found .1 s of -.5 s, and level was 52 sigmas off, `aligned`."""
    for seed in range(runs):
        late, axes = (-0.5, 0.5, 0.15, 1.2)[seed % 4], ("x", "zx", "y", "xz")[seed % 4]
        answer = answered(seed, to_and_fro, late, axes)
        assert np.abs(off(answer)).max() < 4.0
        assert [item.key for item in answer.evidence if item.key.startswith("encoder.late")] == ["encoder.late_taken"]
        (taken,) = (item for item in answer.evidence if item.key == "encoder.late_taken")
        assert abs(taken.figures["late"] - late) < 4.0 * taken.figures["sigma"]


@few_and_all(6, few=2)
def test_a_sound_encoder_has_no_long_delay(runs):
    """However its axes turn; and one that turns at one rate shows none."""
    for seed in range(runs):
        for angle, late in ((to_and_fro, 0.0), (at_rest, 0.02), (one_pace, 0.5)):
            record, encoder, _ = indexed(seed, angle, late)
            assert coarse_delay(carried_angles(encoder, record, "x")) == NOT_LATE


@few_and_all(12, few=1)
def test_a_late_encoder_and_a_log_that_ends_in_a_slew(runs):
    """5 and 20 ms late or early: level was 20 to 160 sigmas off, as it is by the delay times the rate, and `aligned`."""
    for seed in range(runs):
        late, axes = (0.005, 0.02, -0.005)[seed % 3], ("x", "zx", "x", "z")[seed % 4]
        answer = answered(seed, to_and_fro, late, axes)
        assert answer.status == "aligned", answer.reasons
        assert np.abs(off(answer)).max() < 4.0
        assert [item.key for item in answer.evidence if item.key.startswith("encoder.late")] == ["encoder.late_taken"]


@pytest.mark.parametrize(("angle", "late"), some([(to_and_fro, 0.0)], [(at_rest, 0.0), (at_rest, 0.02)]))
def test_a_sound_log_and_one_that_ends_at_rest_are_as_they_were(monkeypatch, angle, late):
    """To the bit."""
    answer = answered(1, angle, late)
    monkeypatch.setattr(rotary, "delay_of", lambda turns, slip: None)
    before = answered(1, angle, late)
    assert np.array_equal(answer.C_nb, before.C_nb)
    assert np.array_equal(answer.phi_covariance, before.phi_covariance)
    assert (answer.status, answer.reasons) == (before.status, before.reasons)
    assert np.abs(off(answer)).max() < 4.0


def test_an_axis_of_one_pace_shows_no_delay_and_a_usual_one_is_in_sigma():
    """By so much as the axis turns in that time, about a level axis: level."""
    plain, said = (answered(1, one_pace, 0.005, latency_sigma=sigma) for sigma in (0.0, 0.005))
    assert np.abs(off(plain)).max() > 10.0  # the limit of it
    assert np.abs(off(said)).max() < 2.0
    more = np.trace((said.phi_covariance - plain.phi_covariance)[:2, :2])
    assert np.sqrt(0.5 * more) == pytest.approx(0.005 * PACE, rel=0.01)
    with pytest.raises(tn.UsageError, match="latency_sigma"):
        answered(1, one_pace, 0.0, latency_sigma=-0.1)


def swung(rng, late, sway):
    """Turns of a base that sways, with an axis x that goes to and fro on it; the encoder's noise is 2 arcsec."""
    time = np.arange(0.0, STILL, 0.1)
    angles = to_and_fro(time)[:, None]
    rates = (to_and_fro(time + 0.01) - to_and_fro(time - 0.01))[:, None] / 0.02
    turn = 2.0 * ARCSEC * rng.standard_normal((len(time), 3))
    for axis in range(3):
        for _ in range(5):
            period, phase = rng.uniform(4.0, 20.0), rng.uniform(0.0, 6.0)
            turn[:, axis] += sway / np.sqrt(5) * np.sin(2.0 * np.pi * time / period + phase)
    direction = np.broadcast_to([1.0, 0.0, 0.0], (len(time), 3))
    turn += direction * (to_and_fro(time) - to_and_fro(time - late))[:, None]
    C, there = C_bs_from_angles("x", angles), np.ones(len(time), dtype=bool)
    bias, up = np.cumsum(C, axis=0) * 0.1, np.array([0.0, 0.0, 1.0])
    return Turns(time, turn, there, angles, C, (direction,), bias, np.full(3, 5e-8), up, rates)


@few_and_all(30, few=4)
def test_the_delay_is_found_as_large_as_it_is(runs):
    """It came out a tenth too large, by rates from sample to sample."""
    for run in range(runs):
        rng = np.random.default_rng([run, 3])
        late = rng.uniform(-0.02, 0.02)
        found = delay_of(swung(rng, late, np.radians(0.003 * 1000.0 ** rng.random())))
        assert found is not None
        assert abs(found.size - late) < 2.0 * found.sigma + 0.01 * abs(late)


def test_what_a_delay_makes_of_an_answer():
    """A clear one is taken off; one that chance may show is in sigma; one that turns the body by nothing is left alone."""
    sigma, rate = Effect(1e-3, 1e-5), Effect(0.0, 0.1)
    clear, faint = Delay(5e-3, 1e-5, 100.0), Delay(5e-4, 1e-4, 5.0)
    (item,), take = late_evidence(clear, rate, sigma, NOT_LATE)
    assert (item.kind, item.effect.level, take) == ("bounded", pytest.approx(5e-4), clear)
    (item,), take = late_evidence(faint, rate, sigma, NOT_LATE)
    assert (item.kind, take) == ("hint", None)
    assert late_evidence(clear, Effect(), sigma, NOT_LATE) == ([], None)
    assert late_evidence(faint._replace(beyond=2.0), rate, sigma, NOT_LATE) == ([], None)
    (item,), take = late_evidence(None, rate, sigma, clear)
    assert (item.key, item.kind, take) == ("encoder.late_taken", "note", None)
    (said, item), take = late_evidence(clear, rate, sigma, clear)
    assert (said.key, item.key, take.size) == ("encoder.late_taken", "encoder.late", pytest.approx(1e-2))
    assert item.figures["late"] == clear.size  # what is left turns the body
    assert left_of(clear, None, 1.0) == clear.sigma
    assert left_of(NOT_LATE, None, 1e-3) == 1e-3
    assert left_of(NOT_LATE, Delay(0.0, 1e-5, 0.0), 1e-3) == 1e-5
