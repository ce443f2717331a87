"""Gyros and accelerometers, or a receiver, of another moment: found on the move, and sound logs left alone."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.honesty.foreign_rows import CASES
from truenorth.aiding.aids import Gnss, Odometer
from truenorth.aiding.sensors import from_odometer
from truenorth.alignment import align
from truenorth.campaign.fault_benches import BENCHES, misses
from truenorth.core.position import Position
from truenorth.estimate.rivals import likelihood_ratio
from truenorth.estimate.sensor_delay import gyro_delay_evidence, gyros_later, on_springs
from truenorth.records import ImuRecord
from truenorth.simulation.scenario import read_scenario
from truenorth.state.layout import Layout
from truenorth.state.mounting import Mounting
from truenorth.state.track import Residuals, Track

SEED = 9305


def found(answer):
    return [item for item in answer.evidence if item.key.startswith("delay.gyros_")]


@pytest.mark.slow
@pytest.mark.parametrize("procedure", ["gnss", "odometer"])
@pytest.mark.parametrize("late", [0.1, -0.2])
def test_gyros_of_another_moment_are_found_on_the_move(procedure, late):
    """Which way, and by how much, to 30 ms; a good answer has it in its sigma."""
    bench = BENCHES[procedure]
    inputs, truth = bench.draw(SEED, 0)
    record = gyros_later(inputs["record"], round(late / inputs["record"].interval))
    answer = bench.align(inputs | {"record": record})
    (item,) = found(answer)
    assert item.key == ("delay.gyros_late" if late > 0.0 else "delay.gyros_early")
    assert item.figures["delay"] == pytest.approx(abs(late), abs=0.03)
    if answer.status == "inconsistent":
        assert answer.evidence[0].key == item.key
    else:
        assert max(np.abs(x).max() for x in misses(answer, truth).values()) < 3.0


@pytest.mark.slow
def test_the_drive_with_late_gyros_that_passed_in_silence():
    """Seed 8203: .1 s late, 4.2 sigmas off, `aligned`."""
    bench = BENCHES["gnss"]
    inputs, truth = bench.draw(8203, 0)
    answer = bench.align(inputs | {"record": gyros_later(inputs["record"], 5)})
    assert found(answer)
    assert answer.status == "inconsistent" or max(np.abs(x).max() for x in misses(answer, truth).values()) < 3.0


@pytest.mark.slow
@pytest.mark.parametrize("procedure", ["gnss", "odometer"])
def test_sound_gyros_are_of_one_moment(procedure):
    """Chance exceeds the limit once in 148 for each delay that is tried; here in none of four."""
    for run in range(4):
        inputs, _ = BENCHES[procedure].draw(SEED + 1, run)
        assert found(BENCHES[procedure].align(inputs)) == []


@pytest.mark.parametrize("name", ["odometer", "zero rotation"])
def test_gyros_do_not_speak_of_their_own_delay(name):
    """Mean rates while nothing turns are of other rows of noise in each rival: chance among them is no delay."""
    noise = np.random.default_rng(0).standard_normal((200, 3))
    late = gyros_later(ImuRecord(0.02 * np.arange(1, 201), noise, noise, "rates", "noise"), 5)

    def run(rival):
        nis = 10.0 if np.array_equal(rival.gyro, late.gyro) else 0.0
        n, stamp, ones = 40, np.arange(40.0), np.ones((40, 3))
        white = np.random.default_rng(1).standard_normal((n, 3))
        said = Residuals(name, stamp, white, ones, np.full(n, nis), np.ones(n, bool), 0, stamp, np.zeros(n, bool))
        level, P = np.tile(np.eye(3), (n, 1, 1)), np.tile(np.eye(15), (n, 1, 1))
        return Track(stamp, level, 0.0 * ones, 0.0 * ones, np.zeros((n, 15)), P, Layout(), (said,))

    evidence = gyro_delay_evidence(run, run(late), late)
    assert [item.key for item in evidence] == (["delay.gyros_late"] if name == "odometer" else [])


@pytest.mark.slow
def test_a_tractor_that_pitches_on_its_springs_has_gyros_of_one_moment():
    """Up and down the body moves with its pitch, which gyros that are .02 s late would show by the arm: a ratio of 59, refused."""
    case = next(case for case in CASES if case.name == "by odometer, navigation, tractor")
    assert case.run(1, 12).refused == ""


@pytest.mark.slow
def test_a_tractor_that_rough_ground_rocks_has_gyros_of_one_moment():
    """Its receiver is .01 s late within its .03: gyros .03 s later bring what the delay's column lacks, a ratio of 30, refused."""
    case = next(case for case in CASES if case.name == "by GNSS, tactical, tractor")
    assert case.run(1, 8).refused == ""


def test_a_wheel_says_nothing_of_the_road_to_clocks():
    """Sideways and forward it counts as before, and so do other sensors."""
    inputs, _ = BENCHES["odometer"].draw(SEED, 0)
    (wheel,) = from_odometer(inputs["odometer"], Mounting())
    log = replace(wheel, name="velocity log", figures=())
    loose, same = on_springs([wheel, log])
    assert np.array_equal(loose.sigma[:, :2], wheel.sigma[:, :2])
    assert np.all(loose.sigma[:, 2] > 100.0 * wheel.sigma[:, 2])
    assert same is log


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 3])
def test_a_consumer_imu_in_circles_by_odometer_has_gyros_of_one_moment(seed):
    """Its wheel is less noisy than is said: any shift whose filter was narrower by 2 % was likelier, by ratios of 62 and 26."""
    motion = {"kind": "legs", "heading": f"{70 * seed} deg", "speed": "10 m/s"}
    circles = [{"kind": "turn", "angle": "3600 deg", "rate": "10 deg/s"}]
    scenario = read_scenario(
        {
            "name": "circles",
            "duration": "200 s",
            "rate": "100 Hz",
            "position": {"lat": "45 deg", "lon": "10 deg"},
            "imu": "consumer",
            "motion": {**motion, "legs": circles},
            "odometer": {"rate": "10 Hz", "noise": "0.02 m/s"},
        }
    )
    wheel = scenario.simulate_aiding(seed=seed)["odometer"].record
    place = Position.from_degrees(45.0, 10.0, 0.0)
    assert found(align(scenario.simulate(seed=seed).record, place, "consumer", aid=Odometer(wheel))) == []


def test_rivals_of_one_model_have_one_variance():
    """Innovations that are a fifth of what is said, of variances that differ by 2 % by chance: they prefer neither."""
    n = 2400
    e = 0.2 * np.random.default_rng(3).standard_normal((n, 3))
    stamp, none = np.arange(float(n)), np.zeros(n, bool)

    def said(sigma):
        nis = np.sum((e / sigma) ** 2, axis=1)
        return [Residuals("odometer", stamp, e, np.full((n, 3), sigma), nis, ~none, 0, stamp, none)]

    assert likelihood_ratio(said(1.0), said(0.98)) > 200.0
    assert abs(likelihood_ratio(said(1.0), said(0.98), one_model=True)) < 0.1


@pytest.mark.slow
def test_the_shipped_van_has_gyros_of_one_moment():
    """Its rest said .05 s late by a likelihood ratio of 52, its odometer spoke against it by 26: seed 0, ratio 28."""
    van = read_scenario("van")
    odometer = van.simulate_aiding(seed=0, run=0)["odometer"].record
    place = Position.from_degrees(48.137, 11.575, 520.0)
    answer = align(van.simulate(seed=0, run=0).record, place, van.imu_spec, aid=Odometer(odometer))
    assert found(answer) == []


@pytest.mark.slow
def test_a_receiver_later_than_it_is_said_to_be():
    """Late by .4 s, said to be on time: the gyros are not at fault."""
    inputs, _ = BENCHES["gnss"].draw(SEED, 0)
    gnss = inputs["gnss"].shifted(0.4)
    said = replace(inputs["mounting"], latency_sigma=0.0)
    answer = align(inputs["record"], inputs["place"], inputs["imu"], aid=Gnss(gnss, said))
    keys = [item.key for item in answer.evidence]
    assert "second_look.late" in keys
    assert not any(key.startswith("delay.gyros") for key in keys)
    late = next(item for item in answer.evidence if item.key == "second_look.late")
    assert late.figures["size"] == pytest.approx(0.4, abs=0.1)


def test_rows_that_are_held_at_the_ends():
    inputs, _ = BENCHES["odometer"].draw(SEED, 0)
    record = inputs["record"]
    later = gyros_later(record, 3)
    assert np.array_equal(later.gyro[3:], record.gyro[:-3])
    assert np.array_equal(later.gyro[:3], record.gyro[[0, 0, 0]])
    assert np.array_equal(gyros_later(record, -3).gyro[:-3], record.gyro[3:])
    assert np.array_equal(later.accel, record.accel)
