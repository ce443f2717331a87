"""A ship whose IMU is too poor to see the earth turn, or of which nobody says how good it is."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.honesty import vehicles
from benchmarks.honesty.foreign_rows import aligned
from tests.runs import some
from truenorth.alignment import align
from truenorth.alignment.turning import sway_walks
from truenorth.campaign.fault_benches import BENCHES, misses
from truenorth.core.attitude import UNIFORM_SIGMA, misalignment
from truenorth.core.position import Position
from truenorth.records.specs import imu_spec
from truenorth.simulation.scenario import read_scenario


def _ship(imu: str, seed: int, duration: float):
    scenario = dict(BENCHES["swaying"].scenario(np.random.default_rng(seed)))
    built = read_scenario(scenario | {"imu": imu, "duration": f"{duration:g} s"})
    body = built.build_motion(seed, 0)
    at = body.states(np.array(0.0))
    place = Position(float(at.lat), float(at.lon), float(at.alt))
    return built.simulate(seed=seed, run=0).record, place, lambda time: body.states(np.array(time))


@pytest.mark.parametrize("imu", ["navigation", "tactical", "industrial", "consumer"])
def test_noise_is_read_from_what_is_faster_than_the_sway(imu: str) -> None:
    record, _, _ = _ship(imu, 3, 120.0)
    walks, spec = sway_walks(record), imu_spec(imu)
    assert walks.gyro_random_walk == pytest.approx(spec.gyro_random_walk, rel=0.3)
    assert walks.accel_random_walk == pytest.approx(spec.accel_random_walk, rel=0.3)


@pytest.mark.parametrize(("imu", "given"), some([("industrial", False)], [("industrial", True), ("consumer", True)]))
def test_level_of_a_ship_by_gyros_that_do_not_see_the_earth_turn(imu: str, given: bool) -> None:
    """Carried through ten minutes, such gyros turn by degrees: of logs like these half were refused, or 16 sigmas off."""
    record, place, truth = _ship(imu, 4, 180.0)
    answer = align(record, place, imu if given else None)
    assert answer.status == "level_only", answer.reasons
    assert np.max(np.abs(misses(answer, truth)["level"])) < 4.0
    # The heading of the history is a convention as the answer's is: it was stated to 2 to 20 deg.
    assert answer.history is not None
    np.testing.assert_allclose(answer.history.phi_covariance[:, 2, 2], UNIFORM_SIGMA**2)
    np.testing.assert_allclose(answer.history.phi_covariance[-1], answer.phi_covariance, rtol=1e-2)


@pytest.mark.parametrize("seed", some([4], [5, 6, 7]))
def test_an_accelerometer_that_steps_is_said_and_counts(seed: int) -> None:
    """By 30 mg after 100 s: level was 4.9 to 10.6 sigmas off, in silence. Sound logs show no step."""
    record, place, truth = _ship("industrial", seed, 180.0)
    step = np.array([0.0, 0.3, 0.0]) * (record.time > 100.0)[:, None] * record.interval
    for fault in (False, True):
        answer = align(replace(record, accel=record.accel + fault * step), place, "industrial")
        assert any(item.key == "bias.accel_steps_level" for item in answer.evidence) == fault
        if answer.status == "level_only":
            assert np.max(np.abs(misses(answer, truth)["level"])) < 4.0


def _buoy(run: int, amplitude: float, period: float):
    """A buoy whose heading swings slowly, its place and its attitude at the end."""
    rng = np.random.default_rng([7, run])

    def tone(size: float, shortest: float, longest: float):
        lasts, begins = rng.uniform(shortest, longest), rng.uniform(0.0, 360.0)
        return [{"amplitude": f"{size} deg", "period": f"{lasts:.4f} s", "phase": f"{begins:.2f} deg"}]

    heading = f"{rng.uniform(0.0, 360.0):.2f} deg"
    rocking = {"roll": tone(2.0, 4.0, 8.0), "pitch": tone(1.0, 3.0, 6.0)}
    tones = rocking | {"heading": tone(amplitude, 0.8 * period, 1.2 * period)}
    scenario = {
        "name": "buoy",
        "duration": "120 s",
        "rate": "50 Hz",
        "position": {"lat": "45 deg", "lon": "10 deg"},
        "imu": "industrial",
        "motion": {"kind": "sway", "heading": heading, "tones": tones},
        "lever_arm": ["0 m", "0 m", "1 m"],
    }
    simulation = read_scenario(scenario).simulate(seed=5, run=run)
    return simulation.record, Position.from_degrees(45.0, 10.0), simulation.truth.C_nb[-1]


@pytest.mark.parametrize("runs", some([1], [12]))
@pytest.mark.parametrize(("amplitude", "period"), [(30.0, 150.0), (50.0, 200.0)])
def test_a_heading_that_swings_slowly_shows_biases_and_no_step(runs: int, amplitude: float, period: float) -> None:
    """Biases acted by the mean heading: of 20 logs each 8 and 12 showed accelerometers that step, 2 and 5 were refused for it."""
    z = []
    for run in range(runs):
        record, place, C_nb = _buoy(run, amplitude, period)
        answer = align(record, place, "industrial")
        assert answer.status == "level_only", answer.reasons
        sigma = np.sqrt(np.diag(answer.phi_covariance)[:2])
        assert np.all(sigma < np.radians(0.35))  # the bias of the accelerometers alone is .46 deg
        z.append(misalignment(answer.C_nb, C_nb)[:2] / sigma)
    assert np.max(np.abs(z)) < 4.0
    assert runs < 10 or 0.7 < np.sqrt(np.mean(np.square(z))) < 1.35


@pytest.mark.parametrize("run", some([0], [1, 2, 3]))
def test_a_step_on_a_heading_that_swings_is_not_silent(run: int) -> None:
    """By 30 mg after 70 s: refused, or within sigma."""
    record, place, C_nb = _buoy(run, 50.0, 200.0)
    step = np.array([0.0, 0.3, 0.0]) * (record.time > 70.0)[:, None] * record.interval
    answer = align(replace(record, accel=record.accel + step), place, "industrial")
    assert any(item.key == "bias.accel_steps_level" for item in answer.evidence)
    if answer.status == "level_only":
        z = misalignment(answer.C_nb, C_nb)[:2] / np.sqrt(np.diag(answer.phi_covariance)[:2])
        assert np.max(np.abs(z)) < 4.0


@pytest.mark.parametrize("duration", some([150.0], [240.0]))
def test_a_good_imu_of_which_nothing_is_said_keeps_its_heading(duration: float) -> None:
    record, place, truth = _ship("navigation", 5, duration)
    answer = align(record, place)
    assert answer.status == "aligned", answer.reasons
    assert max(float(np.abs(x).max()) for x in misses(answer, truth).values()) < 4.0


@pytest.mark.slow
@pytest.mark.parametrize(("imu", "given"), [("tactical", False), ("tactical", True)])
def test_a_buoy_in_a_rough_sea_stays_and_its_level_is_honest(imu: str, given: bool) -> None:
    """Its swing of tens of degrees was a table's turn, its waves a departure; noise of a navigation grade was assumed."""
    found = aligned(vehicles.buoy, imu, 200.0, given=given)(1, 4)
    assert not found.refused
    assert np.max(np.abs(found.ratios["level"])) < 4.0


@pytest.mark.slow
@pytest.mark.parametrize("given", [True, False])
def test_level_of_buoys_is_honest(given: bool) -> None:
    """Of seven of these twelve the answer was refused, and level up to 17 sigmas off."""
    runs = [aligned(vehicles.buoy, "tactical", 300.0, given=given)(1, number) for number in range(12)]
    assert sum(bool(run.refused) for run in runs) <= 1
    assert max(np.max(np.abs(run.ratios["level"])) for run in runs) < 4.0


@pytest.mark.slow
@pytest.mark.parametrize(("vehicle", "number"), [(vehicles.buoy, 4), (vehicles.buoy, 13), (vehicles.gondola, 11)])
def test_passes_that_go_round_leave_the_likeliest_of_them(vehicle, number: int) -> None:
    """Consumer IMUs of which nothing is said, on bases that swing by tens of degrees: refused as moving with 20 to 584 m/s."""
    found = aligned(vehicle, "consumer", 300.0, given=False)(1, number)
    assert not found.refused
    assert np.max(np.abs(found.ratios["level"])) < 4.0


@pytest.mark.slow
def test_biases_are_as_large_as_the_level_rates_of_a_sway_show() -> None:
    """Consumer gyros of .28 deg/s: seven times what is usual was taken for their bias, whatever the log showed."""
    for seed in range(6, 10):
        record, place, _ = _ship("consumer", seed, 120.0)
        answer = align(record, place)
        assert imu_spec("consumer").gyro_bias < answer.imu.gyro_bias < 0.02
        assert np.max(np.abs(answer.gyro_bias)) < 3.0 * answer.imu.gyro_bias
