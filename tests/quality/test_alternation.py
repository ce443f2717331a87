"""Rows of two sensors in turn are found, with what their mean is turned by; vibration and coarse counters do not alternate."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from tests import recordings
from tests.runs import some
from truenorth.alignment import align
from truenorth.campaign.fault_benches import BENCHES
from truenorth.core.attitude import dcm_from_rotation_vector
from truenorth.core.earth import GRAVITY_EQUATOR
from truenorth.quality.alternation import alternation, alternation_evidence, turn_in_turn
from truenorth.records import ImuRecord

RATE, SPAN = 100.0, 240.0


def two_in_turn(record, rotation, period=2):
    """One in so many rows is another sensor's."""
    C = dcm_from_rotation_vector(np.array(rotation))
    gyro, accel = record.gyro.copy(), record.accel.copy()
    gyro[1::period], accel[1::period] = gyro[1::period] @ C.T, accel[1::period] @ C.T
    return replace(record, gyro=gyro, accel=accel)


def still(seed, kind="rates", vibration=0.0, frequency=0.0, step=0.0):
    rng = np.random.default_rng(seed)
    n = round(SPAN * RATE)
    time = np.arange(1, n + 1) / RATE
    gyro, accel = 1e-4 * rng.standard_normal((n, 3)), 0.01 * rng.standard_normal((n, 3))
    accel += [0.3, -0.2, GRAVITY_EQUATOR]
    accel += vibration * np.sin(2.0 * np.pi * frequency * time + rng.uniform(0.0, 6.0))[:, None]
    unit = 1.0 / RATE if kind == "increments" else 1.0
    gyro, accel = gyro * unit, accel * unit
    if step:  # a counter that carries its remainder on
        accel = np.diff(np.floor(np.cumsum(accel, axis=0, dtype=np.float64) / step), axis=0, prepend=0.0) * step
    return ImuRecord(time, gyro, accel, kind, "still")


@pytest.mark.parametrize("kind", ["rates", "increments"])
@pytest.mark.parametrize("degrees", [0.05, 1.0])
def test_half_the_turn_of_one_against_the_other_is_found(kind, degrees):
    found = alternation_evidence(two_in_turn(still(1, kind), [np.radians(degrees), 0.0, 0.0]))
    assert found[0].effect.level == pytest.approx(np.radians(degrees) / 2.0, rel=0.06)


@pytest.mark.parametrize("kind", ["rates", "increments"])
@pytest.mark.parametrize("degrees", [0.05, 1.0])
def test_of_one_in_three_two_thirds_of_its_turn_are_found(kind, degrees):
    (found,) = alternation_evidence(two_in_turn(still(1, kind), [np.radians(degrees), 0.0, 0.0], 3))
    assert (found.key, found.figures["rows"]) == ("record.in_turn", 3)
    assert found.effect.level == pytest.approx(2.0 / 3.0 * np.radians(degrees), rel=0.06)


@pytest.mark.parametrize("kind", ["rates", "increments"])
@pytest.mark.parametrize("degrees", [0.1, 1.0])
def test_of_one_in_five_four_fifths_of_its_turn_are_found(kind, degrees):
    (found,) = alternation_evidence(two_in_turn(still(1, kind), [np.radians(degrees), 0.0, 0.0], 5))
    assert (found.key, found.figures["rows"]) == ("record.in_turn", 5)
    assert found.effect.level == pytest.approx(0.8 * np.radians(degrees), rel=0.06)


@pytest.mark.parametrize("degrees", [0.1, 1.0])
def test_of_one_in_four_every_second_row_differs(degrees):
    """At half the rate a quarter of its turn is seen: as much as the mean of all is turned."""
    (found,) = alternation_evidence(two_in_turn(still(1), [np.radians(degrees), 0.0, 0.0], 4))
    assert found.key == "record.alternates"
    assert found.effect.level == pytest.approx(np.radians(degrees) / 4.0, rel=0.06)


@cache
def drawn(procedure, run):
    return BENCHES[procedure].draw(771240, run)[0]["record"]


@pytest.mark.parametrize("period", [3, 5])
@pytest.mark.parametrize("procedure", ["still", "swaying", "rotary", "gnss", "odometer", "transfer", "attitude"])
@pytest.mark.parametrize("run", some([0], [2]))
def test_one_in_so_many_is_found_on_every_procedure(procedure, period, run):
    """Once silent: of one in three twelve of twelve, by 7 to 84 sigmas, of one in five 33 of 40, by 3 to 156."""
    record = drawn(procedure, run)
    assert not alternation_evidence(record)
    (found,) = alternation_evidence(two_in_turn(record, np.radians([0.3, 0.2, 0.3]), period))
    assert found.figures["rows"] == period


@pytest.mark.parametrize("part", [1 / 3, 1 / 5, 2 / 5])
@pytest.mark.parametrize("seed", some(range(5), range(5, 15)))
def test_an_engine_near_a_part_of_the_rate_is_none(seed, part):
    rng = np.random.default_rng([seed, 771241])
    frequency = RATE * part + rng.choice([-1.0, 1.0]) * 10 ** rng.uniform(-2.0, 1.0)
    kind = ("rates", "increments")[seed % 2]
    assert not alternation_evidence(still(seed, kind, vibration=rng.uniform(0.05, 2.0), frequency=frequency))


@pytest.mark.parametrize("period", [2, 3, 5, 2.5])
def test_a_beat_that_goes_round_once_in_a_stretch_is_a_vibration(period):
    """Of every stretch the same little is left then: of 36 shaken logs three alternated by that."""
    beat = 32.0 / SPAN
    for seed in range(4):
        shaken = still(seed, vibration=2.0, frequency=RATE / period - 0.998 * beat)
        assert not alternation_evidence(shaken)


@pytest.mark.parametrize("seed", some(range(8), range(8, 30)))
def test_sound_logs_do_not_alternate(seed):
    """Noise, an engine that idles near half the rate, and counters whose steps hide the noise."""
    rng = np.random.default_rng([seed, 7])
    frequency = RATE / 2.0 + rng.choice([-1.0, 1.0]) * 10 ** rng.uniform(-2.0, 1.0)
    kind = ("rates", "increments")[seed % 2]
    assert not alternation_evidence(still(seed, kind))
    assert not alternation_evidence(still(seed, kind, vibration=rng.uniform(0.05, 2.0), frequency=frequency))
    assert not alternation_evidence(still(seed, "increments", step=10 ** rng.uniform(-3.0, -1.0)))


def test_a_counter_alternates_by_a_part_of_its_step():
    """At half a step more than whole ones it counts one more in every second row, however long: nothing is lost."""
    n = 24_000
    counts = np.full((n, 3), 1e-3) * (10 + np.arange(n) % 2)[:, None]
    gyro = 1e-5 * np.random.default_rng(1).standard_normal((n, 3))
    assert not alternation(ImuRecord(np.arange(1, n + 1) / RATE, gyro, counts, "increments", "counter")).any()


@pytest.mark.parametrize("period", [2, 3, 5])
def test_a_channel_that_stands_on_one_value_does_not_alternate(period):
    """Coarse counts at rest: what rounding left of it was one sensor in three, of 8e-32 m/s^2."""
    record = still(3)
    accel = np.round(record.accel / 0.02) * 0.02
    accel[:, 0] = 0.3 / 0.02 * 0.02
    assert np.array_equal(alternation(replace(record, accel=accel), period), np.zeros(3))


def test_the_judge_weighs_what_it_does_to_level():
    inputs, _ = BENCHES["still"].draw(3, 0)
    answers = [
        align(two_in_turn(inputs["record"], [size, 0.0, 0.0]), inputs["place"], inputs["imu"]) for size in (0.0, 0.02)
    ]
    assert [answer.status for answer in answers] == ["aligned", "inconsistent"]
    assert "every second row of the accelerometers" in answers[1].reasons[0]


def test_recordings_do_not_alternate():
    logs = (recordings.rlg_vehicle_xian, recordings.fog_gps_xian, recordings.mems_rotation_table)
    for record, _ in (read() for read in logs):
        assert not alternation_evidence(record)


def test_a_turn_about_the_vertical_is_found_where_the_vehicle_turns():
    """Of 120 s of flight the two turns alone push sideways: before, 6.6 and 4.4 sigmas of heading in silence."""
    record = BENCHES["attitude"].draw(90415, 0)[0]["record"]
    turned = two_in_turn(record, [0.0, 0.0, np.radians(0.07)])
    assert turn_in_turn(turned) == pytest.approx(np.radians(0.035), rel=0.05)
    assert not turn_in_turn(record)


def test_on_an_indexer_the_difference_moves_with_gravity():
    inputs, _ = BENCHES["rotary"].draw(9131, 2)
    turn = np.array([0.004, -0.003, 0.006])
    assert turn_in_turn(inputs["record"]) == 0.0
    assert turn_in_turn(two_in_turn(inputs["record"], turn)) == pytest.approx(np.linalg.norm(turn) / 2.0, rel=0.05)
