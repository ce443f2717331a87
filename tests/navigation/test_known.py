"""A start whose heading is known: the level of the log, and what a heading says of the biases."""

import math

import numpy as np
import pytest
from typer.testing import CliRunner

import truenorth as tn
from benchmarks.honesty.circling import received
from truenorth.cli import app
from truenorth.core.attitude import euler_from_dcm, euler_jacobian, rotation_vector_from_dcm
from truenorth.formats import write_imu
from truenorth.records.specs import imu_spec
from truenorth.simulation import rest, simulate
from truenorth.simulation.course import course
from truenorth.simulation.manoeuvres import accelerate, straight, turn
from truenorth.state.layout import BG, SLOW_GYRO
from truenorth.state.track import Track

PLACE = tn.Position.from_degrees(48.0, 11.0, 500.0)
HEADING = math.radians(123.0)
SIGMA = math.radians(0.5)


def error(C_nb, true):
    return -rotation_vector_from_dcm(C_nb @ true.T)


@pytest.fixture(scope="module")
def poor():
    """Gyros that do not see the earth turn, 60 s at rest."""
    return simulate(rest(PLACE, HEADING, 0.02, -0.03), rate=50.0, duration=60.0, imu="consumer", seed=4)


def test_a_level_and_a_heading_are_an_attitude(poor):
    level = tn.align(poor.record, PLACE, "consumer")
    assert level.status == "level_only"
    answer = tn.with_heading(level, HEADING + 0.3 * SIGMA, SIGMA)
    assert answer.status == "aligned"
    assert any("123." in reason and "given" in reason for reason in answer.reasons)
    phi = error(answer.C_nb, poor.truth.C_nb[-1])
    assert np.all(np.abs(phi) < 4.0 * np.sqrt(np.diag(answer.phi_covariance)))
    assert answer.heading == pytest.approx(HEADING + 0.3 * SIGMA)
    assert answer.euler_sigma[0] == pytest.approx(SIGMA, rel=0.01)
    np.testing.assert_allclose(answer.euler[1:], level.euler[1:], atol=1e-9)


def test_a_heading_tells_the_east_gyro_bias():
    """Of 12 runs with true headings to .001 deg: the bias across is found far better, and as well as is said."""
    spec = imu_spec("navigation")
    ratios, gain = [], []
    for run in range(12):
        made = simulate(rest(PLACE, HEADING), rate=20.0, duration=300.0, imu=spec, seed=9, run=run)
        own = tn.align(made.record, PLACE, spec)
        sigma = math.radians(0.001)
        given = HEADING + sigma * np.random.default_rng(run).standard_normal()
        answer = tn.with_heading(own, given, sigma)
        east = made.truth.C_nb[-1][0]
        variance = east @ answer.handover.P[3:6, 3:6] @ east
        before = east @ own.handover.P[3:6, 3:6] @ east
        off = east @ (answer.gyro_bias - made.errors.gyro_bias)
        ratios.append(off / math.sqrt(variance))
        gain.append(math.sqrt(variance / before))
        assert abs(math.remainder(answer.heading - given, 2 * math.pi)) < 3 * sigma
    assert max(gain) < 0.6  # what is left is the noise of 300 s
    assert 0.5 < np.sqrt(np.mean(np.square(ratios))) < 1.6  # 95 % of such a mean lies between .61 and 1.39


def test_a_heading_for_an_alignment_that_refused_its_own():
    """Tactical gyros see the earth, not north to 5 deg: heading and biases are joint, and a heading 7 deg away turns both.

    Of 12 drawn attitudes: the 36 biases are as far off as their sigma says (their RMS of sigmas within .77 and 1.24 in 95 % of such
    draws; the half that the prior decides is less), and the horizontal ones are known far better than the specification says.
    """
    spec = imu_spec("tactical")
    ratios = []
    for run in range(12):
        rng = np.random.default_rng(run)
        heading, pitch, roll = rng.uniform(0.0, 2 * np.pi), *rng.normal(0.0, 0.1, 2)
        made = simulate(rest(PLACE, heading, pitch, roll), rate=20.0, duration=60.0, imu=spec, seed=6, run=run)
        own = tn.align(made.record, PLACE, spec)
        assert own.status == "level_only"
        answer = tn.with_heading(own, heading + SIGMA * rng.standard_normal(), SIGMA)
        assert np.sort(answer.gyro_bias_sigma)[0] < 0.6 * spec.gyro_bias
        ratios.append((answer.gyro_bias - made.errors.gyro_bias) / answer.gyro_bias_sigma)
        phi = error(answer.C_nb, made.truth.C_nb[-1])
        assert np.all(np.abs(phi) < 4.0 * np.sqrt(np.diag(answer.phi_covariance)))
        assert abs(math.remainder(answer.heading - heading, 2 * math.pi)) < 4.0 * SIGMA
    assert 0.6 < np.sqrt(np.mean(np.square(ratios))) < 1.24


def test_a_start_from_heading_and_place(poor):
    start = tn.known_start(poor.record, (48.0, 11.0, 500.0), "consumer", HEADING, SIGMA)
    assert start.time == pytest.approx(60.0)
    level = error(start.C_nb, poor.truth.C_nb[-1])
    assert np.all(np.abs(level) < 4.0 * np.sqrt(np.diag(start.P)[:3]))
    whole = tn.known_start(poor.record, PLACE, "consumer", HEADING, SIGMA, pitch=0.02, roll=-0.03)
    assert whole.time == pytest.approx(0.0)
    np.testing.assert_allclose(np.sqrt(np.diag(whole.P)[:2]), math.radians(0.5), rtol=0.01)
    result = tn.navigate(poor.record, whole, imu="consumer", zupt=[(1.0, 59.0)])
    assert np.all(np.abs(error(result.C_nb[-1], poor.truth.C_nb[-1])) < 4.0 * np.sqrt(np.diag(result.track.P[-1])[:3]))


@pytest.mark.slow
@pytest.mark.parametrize("acceleration", [4.0, 1.5])
def test_a_level_is_taken_before_the_vehicle_drives_off(acceleration):
    """Motion is found in whole seconds: the last of them before it may hold its onset, which tilts a level by degrees."""
    motion = course(PLACE, [*straight(30.0), *accelerate(15.0, acceleration, 0.0), *straight(20.0)], heading=HEADING)
    log = simulate(motion, rate=50.0, duration=50.0, imu="navigation", seed=2).record
    start = tn.known_start(log, PLACE, "navigation", HEADING, SIGMA)
    assert 25.0 < start.time <= 30.0
    off = error(start.C_nb, motion.states(start.time).C_nb)
    assert np.all(np.abs(off[:2]) < 4.0 * np.sqrt(np.diag(start.P)[:2]))
    refused = tn.align(log, PLACE, "navigation")
    until = refused.evidence[0].figures["end"]
    assert tn.align(log.between(None, until), PLACE, "navigation").status == "aligned"
    time = np.arange(28.0, 49.0)
    s = motion.states(time)
    fixes = tn.GnssRecord(time, s.lat, s.lon, s.alt, s.v_n)
    assert tn.navigate(log, start, aid=tn.Gnss(fixes), imu="navigation").status == "navigated"


def test_what_is_refused(poor):
    level = tn.align(poor.record, PLACE, "consumer")
    with pytest.raises(tn.UsageError, match="positive sigma"):
        tn.with_heading(level, 1.0, 0.0)
    with pytest.raises(tn.UsageError, match="expected both"):
        tn.known_start(poor.record, PLACE, "consumer", 1.0, 0.1, pitch=0.1)
    moving = course(PLACE, [*accelerate(20.0, 4.0, 5.0), *straight(30.0)], speed=5.0)
    log = simulate(moving, rate=50.0, duration=30.0, imu="consumer").record
    with pytest.raises(tn.AlignmentError, match="give pitch and roll"):
        tn.known_start(log, PLACE, "consumer", 1.0, 0.1)


def run(*arguments):
    """Exit code and message of the program."""
    done = CliRunner().invoke(app, [str(word) for word in arguments])
    wrong = done.exception if isinstance(done.exception, tn.TruenorthError) else None
    return (done.exit_code, done.output) if wrong is None else (wrong.exit_code, str(wrong))


def test_on_the_command_line(poor, tmp_path):
    write_imu(poor.record, tmp_path / "log.parquet")
    log = tmp_path / "log.parquet"
    known = ("--heading", "123,0.5", "--position", "48,11,500", "--imu", "consumer")
    code, said = run("navigate", log, *known, "--pitch", "1.15", "--roll", "-1.72", "--zupt", "1-59", "--json")
    assert code == 0, said
    tn.align(poor.record.between(None, 40.0), PLACE, "consumer").save(tmp_path / "level")
    assert run("navigate", log, "--start", tmp_path / "level")[0] == 4
    code, said = run(
        "navigate", log, "--start", tmp_path / "level", "--heading", "123,0.5", "--zupt", "41-59", "--json"
    )
    assert code == 0, said
    for arguments, words in (
        ((), "expected --start FOLDER, or --heading"),
        (("--heading", "123", "--position", "48,11"), "--heading"),
        (("--heading", "123,1", "--position", "48,11"), "--imu"),
        ((*known, "--pitch", "1"), "--pitch or --roll alone"),
        ((*known, "--speed", "8,1"), "--speed without --pitch"),
    ):
        code, said = run("navigate", log, *arguments)
        assert code == 2
        assert words in said


@pytest.mark.parametrize("pitch", [-0.2, 0.05])
def test_a_base_at_rest_does_not_show_a_heading_that_was_given(pitch):
    """Tilt and accelerometer bias cancel each other, and what a tilt turns about the vertical went with the tilt: .22 of sigma."""
    log = simulate(rest(PLACE, HEADING, pitch, 0.1), rate=20.0, duration=120.0, imu="consumer", seed=3).record
    start = tn.known_start(log.between(None, 60.0), PLACE, "consumer", HEADING, SIGMA)
    J = euler_jacobian(start.C_nb)[0]
    scale = SIGMA * np.sqrt(np.diag(start.P))
    np.testing.assert_allclose(J @ start.P[:3, 12:] / scale[12:], 0.0, atol=1e-3)
    assert J @ start.P[:3, :3] @ J == pytest.approx(SIGMA**2, rel=1e-6)
    result = tn.navigate(log, start, imu="consumer")
    # What the gyros' biases wander until the epoch is in their sigma: taken apart, it is not counted again.
    np.testing.assert_allclose(result.track.bias_sigma(BG, SLOW_GYRO)[0], np.sqrt(np.diag(start.P)[BG]), rtol=2e-2)
    free = result.euler_sigma[:, 0]
    stands = tn.navigate(log, start, imu="consumer", zupt=[(61.0, 119.0)]).euler_sigma[:, 0]
    assert stands[0] == pytest.approx(SIGMA, rel=1e-3)
    assert stands.min() > 0.99 * SIGMA
    assert stands[-1] < free[-1]  # its gyros' bias shows


def test_another_heading_takes_the_place_of_the_first(poor):
    """Of an alignment that has levelled only, and knows of no heading of its own."""
    level = tn.align(poor.record, PLACE, "consumer")
    once = tn.with_heading(level, HEADING, SIGMA)
    again = tn.with_heading(tn.with_heading(level, HEADING + 0.2, SIGMA), HEADING, SIGMA)
    np.testing.assert_allclose(again.C_nb, once.C_nb, atol=1e-12)
    np.testing.assert_allclose(again.phi_covariance, once.phi_covariance, rtol=0.02, atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("smooth", [False, True])
def test_a_phone_that_stands_and_sets_off(smooth):
    """Its accelerometers' bias is a tilt of some degrees. Heading was up to 15 sigmas off, smoothed vertical velocity up to 9."""
    spec, squares = imu_spec("consumer"), []
    for run in range(24):
        rng = np.random.default_rng([4, run])
        legs = straight(45.0)
        for angle in rng.choice([-90.0, 90.0], 3):
            legs += [*accelerate(9.0, 1.5, 0.0), *turn(np.radians(angle), np.radians(15.0)), *accelerate(0.0, 1.5, 9.0)]
        motion = course(PLACE, legs, heading=rng.uniform(-3.0, 3.0))
        made = simulate(motion, rate=50.0, duration=110.0, imu=spec, seed=8, run=run)
        fixes = received(motion, 109.5, 1.0, rng)
        heading = float(euler_from_dcm(motion.states(0.0).C_nb)[0]) + SIGMA * rng.standard_normal()
        start = tn.known_start(made.record, PLACE, spec, heading, SIGMA)
        answer = tn.navigate(made.record, start, imu=spec, aid=fixes, smooth=smooth)
        assert answer.status == "navigated"
        errors = answer.track.errors_against(Track.along(motion.states(answer.time))) / answer.track.sigma[:, :9]
        assert np.abs(errors[:, :6]).max() < 4.6
        squares.append(np.mean(errors**2, axis=0))
    assert np.sqrt(np.mean(squares, axis=0)[:6]).max() < 1.35  # 48 tilts: .999 of such means lie below 1.32
