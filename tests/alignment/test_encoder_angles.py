"""Angles of an indexer between an encoder's rows: the gyros see a slew as it is; what remains is the body's own turn."""

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest

import truenorth as tn
from truenorth.alignment import rotary
from truenorth.alignment.encoder_angles import angles_at, carried_angles
from truenorth.alignment.fine import CoarseStart
from truenorth.core.attitude import (
    dcm_from_euler,
    dcm_from_rotation_vector,
    misalignment,
    rotation_vector_from_dcm,
)
from truenorth.core.earth import normal_gravity
from truenorth.core.indexing import C_bs_from_angles
from truenorth.quality.encoder import NET_TURN
from truenorth.records import EncoderRecord, ImuRecord
from truenorth.records.specs import ImuSpec

RATE, EVERY = 100.0, 10  # Hz, and rows of the IMU in one of the encoder
TIME = np.arange(0.0, 60.0 + 0.5 / RATE, 1.0 / RATE)


def slewed(start, length, size, time=TIME):
    """A slew by an angle that begins and ends smoothly."""
    x = np.clip((time - start) / length, 0.0, 1.0)
    return size * (x - np.sin(2.0 * np.pi * x) / (2.0 * np.pi))


def turned(axes, sway, last):
    """Angles, and what gyros and an encoder of 10 Hz that ends at a row of the IMU's show of them, on a body that sways."""
    angles = np.stack([slewed(10.0, 1.0, np.pi) + slewed(58.8, 2.0, -1.0), slewed(30.0, 1.5, -np.pi)], axis=1)[
        :, : len(axes)
    ]
    w = 2.0 * np.pi / 7.0
    C_nb = dcm_from_euler(
        0.4 + 0.5 * sway * np.sin(0.6 * w * TIME), 0.4 * sway * np.cos(w * TIME), sway * np.sin(w * TIME)
    )
    C = C_nb @ C_bs_from_angles(axes, angles)
    gyro = rotation_vector_from_dcm(np.swapaxes(C[:-1], 1, 2) @ C[1:])
    record = ImuRecord(TIME[1:], gyro, np.tile([0.0, 0.0, 9.8 / RATE], (len(gyro), 1)), "increments")
    rows = slice(0, last, EVERY)
    return angles, record, EncoderRecord(TIME[rows], angles[rows, 0] if len(axes) == 1 else angles[rows])


@pytest.mark.parametrize("axes", ["z", "x", "zx", "yz"])
@pytest.mark.parametrize("sway", [0.0, 0.07])
def test_between_rows_the_gyros_carry_the_angles(axes, sway):
    angles, record, encoder = turned(axes, sway, len(TIME) - 3)
    carried = carried_angles(encoder, record, axes)
    off = np.abs(angles_at(carried.record, TIME, axes) - angles)
    straight = np.abs(angles_at(encoder, TIME, axes) - angles)
    inside = encoder.time[-1] >= TIME
    assert straight[inside].max() > 4e-3
    assert off[inside].max() < 1e-4
    assert off[-1].max() < 1e-9 + 4.0 * carried.sigma(TIME[-1])  # beyond its last row, by 80 ms of a slew
    assert (
        carried.sigma(float(encoder.time[-1])) < 1e-5
    )  # no noise: the little that differences leave of the body's motion


@pytest.mark.parametrize("whole", [2.0 * np.pi, np.pi])
def test_an_encoder_that_begins_anew_at_each_turn_is_the_same(whole):
    """From -pi to pi, or 0 to 2 pi: jumps by a turn are no noise, and no turn."""
    angles, record, encoder = turned("zx", 0.07, len(TIME) - 3)
    more = 0.3 * TIME[:, None]  # both go on turning
    C = C_bs_from_angles("zx", angles + more)
    gyro = rotation_vector_from_dcm(np.swapaxes(C[:-1], 1, 2) @ C[1:])
    record = ImuRecord(record.time, gyro, record.accel, "increments")
    given = (angles + more)[: len(TIME) - 3 : EVERY]
    begun = (given - whole) % (2.0 * np.pi) + whole - 2.0 * np.pi
    assert np.abs(np.diff(begun, axis=0)).max() > 6.0
    found = carried_angles(EncoderRecord(encoder.time, begun), record, "zx")
    assert found.noise < 1e-5
    off = (found.record.angles - angles - more)[10:-10]
    assert np.abs(off - 2.0 * np.pi * np.round(off / (2.0 * np.pi))).max() < 1e-4


def test_noise_of_the_encoder_is_in_sigma():
    """It is found, and so is what it does to the tangent along which the last rows go on."""
    angles, record, encoder = turned("zx", 0.07, len(TIME) - 3)
    off = []
    for seed in range(6):
        noise = 1e-3 * np.random.default_rng(seed).standard_normal(encoder.angles.shape)
        carried = carried_angles(replace(encoder, angles=encoder.angles + noise), record, "zx")
        assert carried.sigma(carried.last) == pytest.approx(1e-3, rel=0.15)
        off.append((carried.record.angles[-1] - angles[-1]) / carried.sigma(float(TIME[-1])))
    assert 0.5 < np.sqrt(np.mean(np.square(off))) < 1.5


def test_an_encoder_that_goes_on_after_the_imu_does_not_turn_it():
    """Its next row, .4 of an interval of the IMU after the last one, in a slew: it was taken for the last row's own angle."""
    angles, record, _ = turned("zx", 0.0, len(TIME) - 3)
    end = int(59.5 * RATE)  # in the middle of the last slew
    time = np.append(TIME[:end:EVERY], TIME[end] + 0.4 / RATE)
    between = np.stack([np.interp(time, TIME, column) for column in angles.T], axis=1)
    carried = carried_angles(EncoderRecord(time, between), record.between(None, TIME[end] + 1e-6), "zx")
    assert np.abs(carried.record.angles[-1] - angles[end]).max() < 1e-4


def test_what_the_body_turns_after_the_last_row_is_in_sigma():
    """Bodies of all phases: the error of the last angles, by their sigma."""
    ratios = []
    for phase in np.linspace(0.0, 7.0, 15):
        angles, record, encoder = turned("zx", 0.07, len(TIME) - 3 - EVERY * round(phase))
        carried = carried_angles(encoder, record.between(None, encoder.time[-1] + 0.0801), "zx")
        end = float(carried.record.time[-1])
        ratios.append((carried.record.angles[-1] - angles[round(end * RATE)]) / carried.sigma(end))
    assert 0.3 < np.sqrt(np.mean(np.square(ratios))) < 2.0


def biased(name):
    """Biases and white noise of a preset, and no other errors."""
    plain = tn.imu_spec(name)
    return ImuSpec(
        gyro_bias=plain.gyro_bias, gyro_random_walk=plain.gyro_random_walk,
        accel_bias=plain.accel_bias, accel_random_walk=plain.accel_random_walk,
    )  # fmt: skip


def indexed(spec, seed, still=900.0, rate=50.0):
    """A still base, and an indexer of one axis that turns by half a turn every 40 s; the log ends within a slew."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, still, 1.0 / rate)
    angle = sum(slewed(40.0 * k, 5.0, np.pi * (-1.0) ** k, time) for k in range(1, round(still / 40.0))) + slewed(
        still - 1.0, 5.0, np.pi, time
    )
    place = tn.Position(np.radians(35.0), 0.0)
    C_nb = dcm_from_euler(1.2, 0.01, -0.02)
    C_bs = C_bs_from_angles("z", angle[:, None])
    earth = 7.292115e-5 * np.array([0.0, np.cos(place.lat), np.sin(place.lat)])
    middle = C_nb @ C_bs_from_angles("z", 0.5 * (angle[1:] + angle[:-1])[:, None])
    gyro = rotation_vector_from_dcm(np.swapaxes(C_bs[:-1], 1, 2) @ C_bs[1:]) * rate + np.einsum(
        "kji,j->ki", middle, earth
    )
    accel = np.einsum("kji,j->ki", middle, [0.0, 0.0, float(normal_gravity(place.lat, 0.0))])
    for values, bias, walk in (
        (gyro, spec.gyro_bias, spec.gyro_random_walk),
        (accel, spec.accel_bias, spec.accel_random_walk),
    ):
        values += bias * rng.standard_normal(3) + walk * np.sqrt(rate) * rng.standard_normal(values.shape)
    step = round(rate / 5.0)  # rows
    return (
        ImuRecord(time[1:], gyro / rate, accel / rate, "increments"),
        EncoderRecord(time[:-3:step], angle[:-3:step]),
        place,
        C_nb,
    )


def test_angles_of_one_axis_may_be_a_column():
    angles = np.linspace(0.0, 1.0, 5)
    assert np.array_equal(EncoderRecord(np.arange(5.0), angles[:, None]).angles, angles)


@pytest.mark.slow
@pytest.mark.parametrize(("said", "still"), [("tactical", 900.0), (None, 420.0), (None, 900.0)])
def test_an_encoder_of_five_hertz_and_a_log_that_ends_in_a_slew(said, still):
    """Level and heading hold as sigma says; no scale factor is made of the noise of an accelerometer."""
    spec = biased("tactical")
    record, encoder, place, C_nb = indexed(spec, 7, still)
    answer = tn.align(record, place, said if said is None else spec, aid=tn.Indexer(encoder, axes=("z",)))
    off = misalignment(answer.C_nb, C_nb) / np.sqrt(np.diag(answer.phi_covariance))
    assert answer.status == "aligned", answer.reasons
    assert np.abs(off).max() < 4.0
    assert not any(item.key == "bias.accel_scale" for item in answer.evidence)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [8, *[2, 5, 10, 11]])
def test_a_gyro_bias_of_many_degrees_an_hour_is_no_turn_of_the_base(seed):
    """Nor does the noise of gyros about axes that hardly turn make a scale factor (80 to 116 % in five of twelve logs)."""
    spec = biased("industrial")
    record, encoder, place, C_nb = indexed(spec, seed, 420.0)
    turn = 1.5 * NET_TURN / (record.duration * 2.0 / 3.0)
    gyro = record.gyro + turn * record.interval * np.array([0.0, 0.0, 1.0])
    more = ImuRecord(record.time, gyro, record.accel, record.kind)
    answer = tn.align(more, place, spec, aid=tn.Indexer(encoder, axes=("z",)))
    assert answer.status in ("aligned", "not_converged"), answer.reasons
    assert not any(item.key == "encoder.drifts" for item in answer.evidence)
    off = misalignment(answer.C_nb, C_nb) / np.sqrt(np.diag(answer.phi_covariance))
    assert np.abs(off).max() < 4.0


@dataclass
class Fitted:
    """A fit of this likelihood that ended at a heading."""

    heading: float
    likelihood: float

    @property
    def estimates(self):
        return SimpleNamespace(log_likelihood=self.likelihood)

    def misalignment_at(self, C, time):
        return dcm_from_rotation_vector([0.0, 0.0, -self.heading]) @ C, None, None


@pytest.mark.parametrize(("ratio", "unsure"), [(166.0, 0.0), (3.0, 2.0)])
def test_of_fits_from_headings_all_round_the_likeliest_counts(monkeypatch, ratio, unsure):
    """Where another is as likely, its heading is in sigma; the likeliest is asked for a swing; good gyros fit once."""
    ends = iter([Fitted(1.0, 50.0 - 0.5 * ratio), Fitted(-1.0, 50.0), *4 * [Fitted(1.0, 50.0 - 0.5 * ratio)]])
    asked = []
    monkeypatch.setattr(rotary, "usual_sway", lambda start, mount, turned: next(ends))
    monkeypatch.setattr(rotary, "swinging", lambda fine, *made_of: asked.append(fine) or fine)
    monkeypatch.setattr(rotary, "sway_align", lambda start, mount, turned: next(ends))
    start = CoarseStart(None, np.eye(3), None, None, None, 0.1, None)
    found, off = rotary._from_headings(start, None, tn.imu_spec("industrial"), 0.6)
    assert found.heading == -1.0
    assert asked == [found]
    assert off == pytest.approx(unsure)
    ends = iter([Fitted(1.0, 10.0)])
    found, off = rotary._from_headings(start, None, tn.imu_spec("tactical"), 0.6)
    assert (found.heading, off) == (1.0, 0.0)
