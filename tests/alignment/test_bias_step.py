"""A bias that steps on a swaying ship is found; scale factors and misalignments are none, though two sways make them beat."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.honesty.foreign import sensed
from benchmarks.honesty.vehicles import parked
from tests.runs import few_and_all, some
from truenorth import align
from truenorth.campaign.fault_benches import BENCHES, misses
from truenorth.core.attitude import rotation_vector_from_dcm
from truenorth.core.position import Position
from truenorth.records.specs import imu_spec
from truenorth.simulation import rest, simulate
from truenorth.simulation.scenario import read_scenario

PLACE = Position.from_degrees(45.0, 10.0)


def ship(run):
    """Sways of 18, 6 and 8 deg, roll and heading of nearly one period, the IMU 18 m from the centre."""
    rng = np.random.default_rng([91, run])

    def tone(amplitude, period):
        phase = rng.uniform(0.0, 360.0)
        return [{"amplitude": f"{amplitude} deg", "period": f"{period} s", "phase": f"{phase:.2f} deg"}]

    tones = {"roll": tone(18.0, 11.05), "pitch": tone(6.0, 7.28), "heading": tone(8.0, rng.uniform(10.7, 10.9))}
    scenario = {
        "name": "ship",
        "duration": "240 s",
        "rate": "50 Hz",
        "position": {"lat": "45 deg", "lon": "10 deg"},
        "imu": "navigation",
        "motion": {"kind": "sway", "heading": f"{rng.uniform(0.0, 360.0):.2f} deg", "tones": tones},
        "lever_arm": ["-6 m", "10 m", "14 m"],
    }
    built = read_scenario(scenario)
    return built.simulate(seed=5, run=run).record, built.imu_spec


@pytest.mark.slow
def test_sound_ships_show_no_step():
    """20 of them. Before: 8, by likelihood ratios of up to 24. What is left adds to sigma, and refuses none."""
    found = 0
    for run in range(20):
        answer = align(ship(run)[0], PLACE, ship(run)[1])
        assert answer.status == "aligned"
        found += any(item.key.startswith("bias.") for item in answer.evidence)
    assert found <= 4


@pytest.mark.slow
@pytest.mark.usefixtures("without_gyro_matrix")
@pytest.mark.parametrize("run", [0, 1])
def test_a_step_is_found(run):
    record, spec = ship(run)
    assert not any(item.key.startswith("bias.") for item in align(record, PLACE, spec).evidence)
    gyro = record.gyro.copy()
    gyro[record.time > 90.0, 0] += np.radians(0.3) / 3600.0
    answer = align(replace(record, gyro=gyro), PLACE, spec)
    assert answer.status == "inconsistent"
    assert any(item.key.startswith("bias.") for item in answer.evidence)


def quay(run, ramp=0.0):
    """A still base, and the same with an accelerometer whose bias grows by so many m/s^2 over the log."""
    heading = np.random.default_rng([92, run]).uniform(0.0, 6.28)
    spec = imu_spec("navigation")
    sim = simulate(rest(PLACE, heading), rate=50.0, duration=240.0, imu=spec, seed=8, run=run)
    assert sim.record.kind == "increments"
    course = ramp * sim.record.interval * np.arange(len(sim.record)) / len(sim.record)
    record = replace(sim.record, accel=sim.record.accel + np.outer(course, [1.0, 0.0, 0.0]))
    answer = align(record, PLACE, spec)
    return answer, next((item for item in answer.evidence if item.key == "bias.gravity_drifts"), None)


@pytest.mark.parametrize("run", [0, *some([], [1, 2, 3])])
def test_an_accelerometer_that_drifts_on_a_still_base_is_found_with_what_it_does(run):
    """As a tilt rate it turns heading by degrees, which no step of a bias shows: it is what another heading would show."""
    answer, found = quay(run, 0.009)
    assert answer.status == "inconsistent"
    sound = quay(run)[0].C_nb
    moved = rotation_vector_from_dcm(answer.C_nb @ sound.T)
    assert found.effect.level == pytest.approx(0.009 / 9.81, rel=0.05)
    assert 0.4 < np.linalg.norm(moved[:2]) / found.effect.level < 1.05  # heading has taken its part
    assert found.effect.heading == pytest.approx(abs(moved[2]), rel=0.3, abs=np.radians(0.5))


@few_and_all(60, few=4)
def test_gravity_of_a_sound_still_base_does_not_drift(runs):
    assert all(quay(run)[1] is None for run in range(runs))


@pytest.mark.parametrize("run", [0, *some([], [1, 2, 3, 4, 5])])
def test_people_who_get_in_and_out_are_no_drift(run):
    """Four steps of some arc minutes, which the gyros see: forces along a line were "an accelerometer drifts by 2 mg"."""
    rng = np.random.default_rng([93, run])
    spec = imu_spec("navigation")
    sim = simulate(rest(PLACE, rng.uniform(0.0, 6.28)), rate=50.0, duration=240.0, imu=spec, seed=8, run=run)
    record, tilt = sim.record, np.zeros((len(sim.record), 3))
    for at in rng.uniform(20.0, 220.0, 4):
        step = np.radians(3.0 / 60.0) * rng.standard_normal(2)
        tilt[:, :2] += step * (0.5 + 0.5 * np.tanh((record.time[:, None] - at) / 0.3))
    gyro = record.gyro + np.diff(tilt, axis=0, prepend=tilt[:1])
    answer = align(replace(record, gyro=gyro, accel=record.accel - np.cross(tilt, record.accel)), PLACE, spec)
    assert answer.status == "aligned"
    heading = rotation_vector_from_dcm(answer.C_nb @ sim.truth.C_nb[-1].T)[
        2
    ]  # tilted by less than an arc minute of that
    assert abs(heading) < 4.0 * answer.euler_sigma[0]


@pytest.mark.slow
def test_one_who_gets_in_while_gusts_rock_a_car_is_no_drift():
    """Seed 9021, run 17: gusts hid the step from a walk that was fitted to the tilts, and an accelerometer drifted by 956 ug."""
    rng = np.random.default_rng([9021, 17, 9])
    car = parked(rng, 300.0)
    answer = align(sensed(rng, car, imu_spec("navigation")), Position(*car.place.mean(axis=0).tolist()), "navigation")
    assert answer.status == "aligned"


def test_a_ramp_of_the_east_gyro_on_a_still_base_shows_in_its_rate() -> None:
    """.12 deg/h over three minutes: 5 sigmas of heading, and less than chance gives in the velocity of the base."""
    inputs, truth = BENCHES["still"].draw(4401, 2)
    record = inputs["record"]
    ramp = 6.04e-7 * np.maximum(np.arange(len(record)) / len(record) - 0.18, 0.0) / 0.82 * record.interval
    spoilt = replace(record, gyro=record.gyro + ramp[:, None] * [1.0, 0.0, 0.0])
    answer = align(spoilt, inputs["place"], inputs["imu"])
    assert answer.status == "inconsistent"
    assert answer.evidence[0].key == "bias.gyro_steps"
    sound = align(record, inputs["place"], inputs["imu"])
    assert sound.status == "aligned"
    assert not any(item.key == "bias.gyro_steps" for item in sound.evidence)
    assert abs(float(misses(sound, truth)["heading"][0])) < 4.0


@pytest.mark.parametrize("hertz", [10.0125, 9.9875, 14.3])
def test_a_generator_near_a_whole_number_of_periods_a_second_is_no_step_of_a_bias(hertz) -> None:
    """.013 deg at 10.01 Hz: from second to second attitude goes round in 80 s, which was "2 deg/h near 254 s"."""
    inputs, truth = BENCHES["still"].draw(4401, 2)
    record = inputs["record"]
    roll = np.radians(0.013) * np.sin(2.0 * np.pi * hertz * record.time)
    turned = np.diff(roll, prepend=roll[:1])[:, None] * [0.0, 1.0, 0.0]
    shaken = np.cross(roll[:, None] * [0.0, 1.0, 0.0], record.accel)
    answer = align(
        replace(record, gyro=record.gyro + turned, accel=record.accel - shaken), inputs["place"], inputs["imu"]
    )
    assert answer.status == "aligned", answer.reasons
    assert abs(float(misses(answer, truth)["heading"][0])) < 4.0
