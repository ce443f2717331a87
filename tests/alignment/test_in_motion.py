"""Alignment on the move: the ring track of system 5, and what may be wrong with an odometer."""

import functools
import math
import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from tests.runs import few_and_all
from truenorth import OdometerRecord, UsageError, VelocityRecord, align, imu_spec, navigate
from truenorth.aiding.aids import WHEEL, Odometer, VelocityLog
from truenorth.alignment.in_motion import align_in_motion
from truenorth.alignment.in_motion_start import backtracked, departures, path_to_the_end
from truenorth.alignment.in_motion_task import LATENCY_SIGMA, POSITION_FLOOR, VELOCITY_FLOOR
from truenorth.coarse.odometer import odometer_alignment
from truenorth.core.attitude import dcm_from_euler, rotation_vector_from_dcm
from truenorth.core.position import METRES_PER_RADIAN, Position
from truenorth.errors.log import LogErrors
from truenorth.navigation import Mounting
from truenorth.quality.slow_aids import USUAL_TIME
from truenorth.simulation import OdometerSpec, simulate, simulate_sensor
from truenorth.simulation.scenario import read_scenario
from truenorth.state.layout import BG, DP

ARCMIN = math.radians(1.0) / 60.0
RING = read_scenario("odometer_ring")
PLACE = Position(RING.position.lat, RING.position.lon, RING.position.alt)


@pytest.fixture(scope="module")
def ring():
    """What all runs share: the motion."""
    return RING.ideal()


def changed(**content):
    """The ring with other content."""
    return read_scenario({**RING.to_mapping(), **content})


def logs(ring, run, **odometer):
    """IMU and odometer of a run, and the truth."""
    scenario = changed(odometer={**RING.odometer, **odometer})
    sim = scenario.simulate(run=run, seed=7, ideal=ring)
    return sim, scenario.simulate_aiding(run=run, seed=7)["odometer"].record


@functools.cache
def usual(run):
    """IMU, odometer and truth of a run, and what alignment makes of it; several tests begin with the same."""
    sim, odometer = logs(RING.ideal(), run)
    return sim, odometer, align_in_motion(sim.record, RING.imu_spec, odometer=odometer, position=PLACE)


def band(runs):
    """Within which the RMS over sigma of so many numbers lies in 98.4 % (chi-square)."""
    return np.sqrt(chi2.ppf([0.01, 0.994], runs) / runs)


def error(answer, sim):
    """(3,) phi, arcmin."""
    C = sim.motion.states(np.array([answer.time])).C_nb[0]
    return rotation_vector_from_dcm(C @ answer.C_nb.T) / ARCMIN


@pytest.mark.slow
@few_and_all(6, few=3)
def test_ring_from_any_heading(runs):
    errors, sigmas = [], []
    for run in range(runs):
        sim, _, answer = usual(run)
        assert answer.status == "aligned"
        errors.append(error(answer, sim))
        sigmas.append(np.sqrt(np.diag(answer.phi_covariance)) / ARCMIN)
        assert abs(answer.moving.v_n - sim.motion.states(np.array([answer.time])).v_n[0]).max() < 0.03
    errors, sigmas = np.array(errors), np.array(sigmas)
    # How well heading is known, and (below) that errors are no larger: the RMS of a few errors says neither by itself.
    assert sigmas[:, 2].max() < 1.5
    assert np.sqrt(np.mean(errors[:, :2] ** 2)) < 0.05
    low, high = band(runs)
    assert low < np.sqrt(np.mean((errors[:, 2] / sigmas[:, 2]) ** 2)) < high


@pytest.mark.slow
def test_what_is_learnt_of_the_place_turns_nothing():
    """The vehicle went as its velocity says, wherever the track's first half was believed to be."""
    sim, _, answer = usual(0)
    track = answer.moving.track
    path = path_to_the_end(track)
    np.testing.assert_allclose(path[:, :2] * METRES_PER_RADIAN, track.position[:, :2] * METRES_PER_RADIAN, atol=15.0)
    elsewhere = track.position + np.where(track.time[:, None] < 300.0, [0.0, math.radians(0.3), 0.0], 0.0)
    moved = replace(track, position=elsewhere)
    np.testing.assert_array_equal(departures(sim.record, moved), departures(sim.record, track))
    np.testing.assert_array_equal(backtracked(sim.record, moved), backtracked(sim.record, track))


@pytest.mark.slow
def test_coarse_alignment_by_the_odometer(ring):
    """Both forms, six runs, against the bars of 4 deg after 120 s and 10 arcmin after 600 s."""
    found = {(form, end): [] for form in ("velocity", "position") for end in (120.0, 600.0)}
    for run in range(6):
        sim, odometer = logs(ring, run)
        C = sim.motion.states(np.array([0.0])).C_nb[0]
        for form, end in found:
            coarse = odometer_alignment(sim.record.between(0.0, end), odometer, PLACE, form=form)
            found[form, end].append(rotation_vector_from_dcm(C @ coarse.C_n0_i.T)[2])
    rms = {key: np.sqrt(np.mean(np.square(values))) for key, values in found.items()}
    assert max(rms["velocity", 120.0], rms["position", 120.0]) < math.radians(4.0)
    assert max(rms["velocity", 600.0], rms["position", 600.0]) < 10.0 * ARCMIN


@pytest.mark.slow
@pytest.mark.parametrize(
    ("wrong", "scale"),
    [
        ({"slips": [[f"{t} s", f"{t + 1.5} s", "30 %"] for t in (30, 130, 200, 300, 420, 500)]}, None),
        ({"scale": "2 %"}, 0.02),
        ({"lost": "1 %"}, -0.01),
    ],
    ids=["slip", "scale", "lost"],
)
def test_a_bad_odometer(ring, wrong, scale):
    sim, odometer = logs(ring, 1, **{"scale_sigma": "0 %"}, **wrong)
    answer = align_in_motion(sim.record, RING.imu_spec, odometer=odometer, position=PLACE)
    assert answer.status == "aligned"
    assert abs(error(answer, sim)[2]) < 3.5 * np.sqrt(answer.phi_covariance[2, 2]) / ARCMIN < 6.0
    if scale is None:
        assert 60 <= answer.moving.rejected["odometer"][0] <= 100  # 6 times 1.5 s at 10 Hz
    else:
        assert abs(answer.moving.wheel.scale - scale) < 1.5e-3
        assert (
            answer.moving.rejected["odometer"][0] < 0.02 * 6000
        )  # two lost pulses of a tenth of a second are an outlier


@pytest.mark.slow
def test_mounting_and_lever_arm_are_found():
    """The IMU stands askew, in front of the axle on which the vehicle turns; the wheel sits on that axle."""
    arm, C = np.array([0.4, -0.8, 0.0]), dcm_from_euler(*np.radians([1.5, -1.0, 0.0]))  # C: vehicle's axes to the IMU's
    scenario = changed(
        lever_arm=[f"{-x} m" for x in arm], odometer={**RING.odometer, "lever_arm": [f"{x} m" for x in arm]}
    )
    sim = scenario.simulate(run=2, seed=7)
    odometer = scenario.simulate_aiding(run=2, seed=7)["odometer"].record
    # On a ring at one speed tyres that give way do what a forward arm does: it shows of a body that is rigid.
    rigid = replace(WHEEL, compliance=0.0)
    answer = align_in_motion(sim.record.rotated(C), RING.imu_spec, odometer=odometer, position=PLACE, wheel=rigid)
    assert answer.status == "aligned"
    wheel, sigma = answer.moving.wheel, answer.moving.wheel.angle_sigma
    assert np.allclose(rotation_vector_from_dcm(wheel.C_mb @ C)[[0, 2]], 0.0, atol=4.0 * sigma.max())
    assert sigma.max() < math.radians(0.05)
    assert np.all(np.abs(wheel.lever_arm - C @ arm)[:2] < 4.0 * wheel.lever_arm_sigma[:2])
    assert np.all(wheel.lever_arm_sigma[:2] < 0.1)
    # Of the vehicle, whose axes are those of the simulated body; the IMU's own heading is another one.
    true = math.atan2(*sim.motion.states(np.array([answer.time])).C_nb[0, :2, 1])
    off = (answer.moving.vehicle_heading - true + math.pi) % (2 * math.pi) - math.pi
    assert abs(off) < 3.5 * answer.moving.vehicle_heading_sigma < math.radians(0.15)
    assert abs(answer.heading - answer.moving.vehicle_heading) > math.radians(1.0)


@pytest.mark.slow
def test_navigation_goes_on_from_it(ring, tmp_path):
    """Aligned over 300 s of driving, navigated to the end, from the result and from its folder, with the same odometer."""
    sim, odometer = logs(ring, 0)
    answer = align_in_motion(sim.record.between(0.0, 300.0), RING.imu_spec, odometer=odometer, position=PLACE)
    wheel = Mounting(scale_sigma=0.01)
    track = navigate(sim.record, answer, aid=Odometer(odometer, wheel), check_clocks=False).track
    end = sim.motion.states(track.time[-1:])
    assert abs(track.v_n[-1] - end.v_n[0]).max() < 0.05
    start_off = 6371e3 * (answer.position.lat - sim.motion.states(np.array([300.0])).lat[0])
    assert abs(6371e3 * (track.position[-1, 0] - end.lat[0]) - start_off) < 10.0
    answer.save(tmp_path)
    again = navigate(sim.record, tmp_path, aid=Odometer(odometer, wheel), check_clocks=False).track
    assert np.allclose(again.position, track.position, rtol=0.0, atol=1e-12)
    assert np.allclose(again.P[0, BG, BG], answer.moving.P[BG, BG], rtol=1e-6)


def test_usage():
    record = changed(duration="20 s").simulate(seed=1).record
    with pytest.raises(UsageError, match="odometer= or velocity=, gnss= or both"):
        align_in_motion(record, "navigation", position=PLACE)


def test_poor_gyros_and_an_odometer_tell_no_heading():
    short = changed(duration="60 s", imu="industrial")
    sim, odometer = short.simulate(seed=1), short.simulate_aiding(seed=1)["odometer"].record
    answer = align_in_motion(sim.record, imu_spec("industrial"), odometer=odometer, position=PLACE)
    assert answer.status == "level_only"
    assert "velocity along the vehicle does not show north" in answer.reasons[0]
    assert answer.summary()["heading_deg"] is None
    assert answer.summary()["vehicle_heading_deg"] is None


def late(record, odometer, begin):
    """The logs from a time on: the vehicle is under way at the first sample."""
    return record.between(begin, None), odometer.between(begin - 1.0, None)


@pytest.mark.slow
def test_under_way_at_the_first_sample(ring):
    sim, odometer = logs(ring, 4)
    record, odometer = late(sim.record, odometer, 40.0)
    answer = align_in_motion(record, RING.imu_spec, odometer=odometer, position=PLACE)
    assert answer.status == "aligned"
    assert abs(error(answer, sim)[2]) < 3.5 * np.sqrt(answer.phi_covariance[2, 2]) / ARCMIN < 7.0
    assert np.sqrt(np.mean(error(answer, sim)[:2] ** 2)) < 0.1


@pytest.mark.slow
def test_driving_backwards():
    """The wheel counts negative; one that counts magnitudes is shown by a contradiction, not by a wrong heading."""
    legs = [{"kind": "straight", "duration": "5 s"}]
    for speed in ("6 m/s", "0 m/s", "9 m/s", "4 m/s"):
        legs += [
            {"kind": "accelerate", "to": speed, "acceleration": "1 m/s^2"},
            {"kind": "straight", "duration": "10 s"},
            {"kind": "turn", "angle": "170 deg", "rate": "6 deg/s"},
        ]
    forwards = changed(duration="300 s", motion={"kind": "legs", "heading": "40 deg", "legs": legs}).build_motion()
    motion = replace(forwards, heading_offset=math.pi)
    sim = simulate(motion, duration=300.0, imu=RING.imu_spec, seed=7)
    spec = OdometerSpec(output="pulses", scale_sigma=0.003)
    odometer = simulate_sensor(motion, spec, duration=300.0, seed=7).record
    assert odometer.values.min() < -20
    answer = align_in_motion(sim.record, RING.imu_spec, odometer=odometer, position=PLACE)
    assert answer.status == "aligned"
    assert abs(error(answer, sim)[2]) < 3.5 * np.sqrt(answer.phi_covariance[2, 2]) / ARCMIN < 20.0
    unsigned = OdometerRecord(odometer.time, np.abs(odometer.values), "pulses", odometer.pulse_size, signed=False)
    assert align_in_motion(sim.record, RING.imu_spec, odometer=unsigned, position=PLACE).status == "inconsistent"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("imu", "heading", "runs"), [("industrial", 0.3, 1), ("industrial", 0.3, 12), ("tactical", 0.1, 40)]
)
def test_gnss_from_an_unknown_heading(imu, heading, runs):
    """A van in town, 150 s, with the receiver that the filter supposes where nobody says more.

    Its fixes are off together for a minute, and late; floors are real errors. Without these a tactical IMU's heading is better than
    its sigma: RMS of error over sigma .8 in 180 runs, with them .94 in 224 of four other seeds. Seed and number of these runs were
    fixed before they were drawn.
    """
    content = read_scenario("van").to_mapping()
    content |= {"duration": "150 s", "imu": imu, "odometer": None}
    far, fast, ratio = 0.5, 0.05, np.array([1.0, 1.0, 1.5])
    content["gnss"] = {
        "rate": "5 Hz",
        "position_noise": f"{math.hypot(far, POSITION_FLOOR)} m",
        "position_drift": f"{math.hypot(far, POSITION_FLOOR)} m",
        "correlation_time": f"{USUAL_TIME} s",
        "velocity_noise": f"{math.hypot(fast, VELOCITY_FLOOR)} m/s",
    }
    van = read_scenario(content)
    off = []
    for run in range(runs):
        sim, gnss = van.simulate(seed=9417, run=run), van.simulate_aiding(seed=9417, run=run)["gnss"].record
        said = {"position_sigma": far * ratio, "velocity_sigma": fast * ratio}
        gnss = replace(gnss, **{name: np.tile(sigma, (len(gnss.time), 1)) for name, sigma in said.items()})
        late = np.random.default_rng([9417, run]).normal(0.0, LATENCY_SIGMA)
        answer = align_in_motion(sim.record, imu, gnss=gnss.shifted(late))
        assert answer.status == "aligned"
        sigma = np.sqrt(answer.phi_covariance[2, 2])
        assert sigma < math.radians(heading)
        off.append(error(answer, sim)[2] * ARCMIN / sigma)
    low, high = band(runs)
    assert low < np.sqrt(np.mean(np.square(off))) < high


@pytest.mark.slow
@few_and_all(3, few=1)
def test_a_latitude_that_nobody_gives_is_found(runs):
    """Either hemisphere's mirror refused: within 3.3 sigma of the truth, heading as good as with it."""
    for run in range(runs):
        sim, odometer, given = usual(run)
        answer = align_in_motion(sim.record, RING.imu_spec, odometer=odometer)
        assert answer.status == "aligned"
        lat = sim.motion.states(np.array([answer.time])).lat[0]
        off = answer.moving.track.position[-1, 0] - lat
        sigma = answer.moving.track.sigma[-1, DP][1] / METRES_PER_RADIAN
        assert abs(off) < 3.3 * sigma < math.radians(0.2)
        shown = rf"the latitude was not given: found from the log, {math.degrees(off + lat):.2f} deg, to 0\.0\d+ deg"
        assert any(re.match(shown, reason) for reason in answer.reasons)
        assert abs(error(answer, sim)[2] - error(given, sim)[2]) < 0.5
        assert answer.phi_covariance[2, 2] > given.phi_covariance[2, 2]


@pytest.mark.slow
def test_poor_gyros_do_not_find_a_latitude(ring):
    scenario = changed(imu="consumer")
    sim = scenario.simulate(run=0, seed=7, ideal=ring)
    odometer = scenario.simulate_aiding(run=0, seed=7)["odometer"].record
    answer = align_in_motion(sim.record, scenario.imu_spec, odometer=odometer)
    assert answer.status == "level_only"
    assert answer.reasons[-1].startswith("the latitude was not given: 45 deg assumed")


@pytest.mark.slow
def test_a_receiver_that_is_late_is_found_late():
    """A van in town, .4 s that nobody tells: heading within 3.3 sigma in three runs, and half as far off as if it were timely."""
    mapping = read_scenario("van").to_mapping()
    del mapping["disturbances"]
    scenario = read_scenario({**mapping, "gnss": {**mapping["gnss"], "latency": "0.4 s"}, "duration": "180 s"})
    van, errors, sigmas = scenario.ideal(), {}, {}
    for name, antenna in {"open": None, "timely": Mounting()}.items():
        for run in range(3):
            sim = scenario.simulate(run=run, seed=3, ideal=van)
            gnss = scenario.simulate_aiding(run=run, seed=3)["gnss"].record
            answer = align_in_motion(sim.record, scenario.imu_spec, gnss=gnss, antenna=antenna)
            errors.setdefault(name, []).append(error(answer, sim)[2])
            sigmas.setdefault(name, []).append(math.sqrt(answer.phi_covariance[2, 2]) / ARCMIN)
    assert np.all(np.abs(errors["open"]) < 3.3 * np.array(sigmas["open"]))
    assert np.linalg.norm(errors["open"]) < 0.5 * np.linalg.norm(errors["timely"])


@pytest.mark.slow
@few_and_all(6, few=3)
def test_by_a_velocity_log(runs):
    """An underwater vehicle on its first leg."""
    auv = read_scenario({**read_scenario("auv").to_mapping(), "duration": "600 s"})
    place, off = Position(auv.position.lat, auv.position.lon, auv.position.alt), []
    for run in range(runs):
        sim = auv.simulate(seed=3, run=run)
        log = auv.simulate_aiding(seed=3, run=run)["velocity_log"].record
        answer = align(sim.record, place, auv.imu_spec, aid=VelocityLog(log, errors=LogErrors()))
        assert answer.status == "aligned"
        assert answer.moving.wheel.sensor == "velocity log"
        assert abs(answer.moving.wheel.scale) < 4.0 * answer.moving.wheel.scale_sigma < 0.012
        sigma = np.sqrt(np.diag(answer.phi_covariance)) / ARCMIN
        assert sigma[2] < 20.0
        off.append(error(answer, sim) / sigma)
    low, high = band(runs)
    assert low < np.sqrt(np.mean(np.square(off)[:, 2])) < high
    assert np.abs(off).max() < 4.0


def test_a_velocity_log_in_other_axes_is_refused():
    record = changed(duration="20 s").simulate(seed=1).record
    log = VelocityRecord(np.arange(0.0, 20.0), np.ones((20, 3)), "navigation")
    with pytest.raises(UsageError, match="velocities in body axes"):
        align_in_motion(record, "navigation", velocity=log, position=PLACE)
