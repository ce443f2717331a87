"""Transfer alignment in worlds that its model leaves out: late gyros, seats that bend, coloured rows, a master's own errors."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.honesty.transfer import ERRORS, aircraft, ship
from tests.alignment.test_transfer_loop import ARCMIN, DEG, MASTER, TACTICAL
from truenorth.aiding.aids import Master
from truenorth.alignment import align
from truenorth.alignment.transfer import align_transfer
from truenorth.alignment.transfer_delay import find_delay, runs_backwards
from truenorth.alignment.transfer_passes import _colour
from truenorth.alignment.transfer_verdict import _lasting
from truenorth.campaign.fault_benches import BENCHES, misses
from truenorth.core.attitude import dcm_from_euler, rotation_vector_from_dcm
from truenorth.core.errors import DataError, UsageError
from truenorth.core.position import Position
from truenorth.errors.master import MasterErrors, master_errors, own_errors
from truenorth.formats import read_master
from truenorth.formats.writing import write_record
from truenorth.records import ImuRecord, MasterRecord
from truenorth.records.specs import imu_spec
from truenorth.simulation import MasterSpec, simulate, simulate_sensor
from truenorth.simulation.course import course
from truenorth.simulation.manoeuvres import straight
from truenorth.simulation.scenario import read_scenario
from truenorth.simulation.sway import Disturbed
from truenorth.simulation.tones import Tone
from truenorth.state.track import Residuals


@pytest.mark.slow
@pytest.mark.parametrize("late", [0.2, 0.0])
def test_gyros_that_are_late_are_found_though_the_master_seems_early(late):
    """On a ship that rolls: attitude matching takes them for a master's delay, the accelerometers do not."""
    way = course(Position.from_degrees(40.0, 20.0), straight(200.0), heading=0.6, speed=6.0)
    tones = {"roll_tones": (Tone(4 * DEG, 8.0, 2.0),), "pitch_tones": (Tone(2 * DEG, 6.0, 1.0),)}
    ship = Disturbed(way, **tones)
    slave = simulate(ship, rate=50.0, duration=120.0, imu=TACTICAL, seed=6).record
    master = simulate_sensor(ship, MASTER, duration=120.0, seed=6).record
    rows = np.maximum(np.arange(len(slave)) - round(late / slave.interval), 0)
    answer = align_transfer(replace(slave, gyro=slave.gyro[rows]), master, TACTICAL)
    found = [item.figures["delay"] for item in answer.evidence if item.key == "delay.gyros_late"]
    assert found == ([pytest.approx(0.2, abs=0.021)] if late else [])
    assert (answer.status == "aligned") == (late == 0.0)


@pytest.mark.slow
@pytest.mark.parametrize("step", [0.0, 10.0])
def test_errors_of_the_master_are_no_wander_of_the_gyros(step):
    """In each sound flight gyros that wander followed the master and were likelier by 12 to 30; a step of 10 deg/h is one."""
    way, spec = aircraft(), imu_spec("tactical")
    own = MasterSpec(
        level=0.3 * ARCMIN, heading=2.0 * ARCMIN, velocity=0.05, velocity_noise=0.05, attitude_noise=ARCMIN
    )
    slave = simulate(way, rate=100.0, duration=200.0, imu=spec, seed=8825).record
    master = simulate_sensor(way, own, duration=200.0, seed=8825).record
    off = np.outer(slave.time > 100.0, [slave.interval * math.radians(step / 3600.0), 0.0, 0.0])
    answer = align_transfer(replace(slave, gyro=slave.gyro + off), master, spec, master_errors=ERRORS)
    found = [item.key for item in answer.evidence if item.key.startswith("rival.")]
    assert found == (["rival.gyro_wanders"] if step else [])


def test_the_first_row_of_a_turn_shows_no_delay():
    """The master's log ends as a turn begins: a second later there is enough of it."""
    t, level = 0.02 * np.arange(1, 3001), np.zeros(3000)
    rate = np.radians(3.0) * np.clip(t - 39.85, 0.0, 0.5)
    noise = 4e-5 * np.random.default_rng(2).standard_normal((3000, 3))
    slave = ImuRecord(
        t, np.stack([level, level, -rate], axis=1) + noise, np.tile([0.0, 0.0, 9.8], (3000, 1)), "rates", "made"
    )
    heading = np.interp(0.1 * np.arange(1, 600), t, np.cumsum(rate) * 0.02)
    C = np.stack([dcm_from_euler(angle, 0.0, 0.0) for angle in heading])
    master = MasterRecord(0.1 * np.arange(1, 600), C, np.zeros((599, 3)), source="made")
    assert not find_delay(slave, master[:399], np.eye(3)).sure
    later = find_delay(slave, master[:450], np.eye(3))
    assert later.sure
    assert later.delay == pytest.approx(0.0, abs=0.02)


def test_only_what_comes_back_is_noise():
    """A seat that bends, of a second, at 20 Hz: noise of its density. A jump, and what drifts, are none."""
    rng, t = np.random.default_rng(3), 0.05 * np.arange(2000)
    white, bend = rng.standard_normal((2, 2000, 3))
    kept = math.exp(-0.05 / 1.0)
    for k in range(1, 2000):
        bend[k] = kept * bend[k - 1] + math.sqrt(1.0 - kept**2) * bend[k]
    assert _colour(t, white) == 1.0
    assert _colour(t, white + 30.0 * (t > 40.0)[:, None] * np.exp(-(t - 40.0) / 3.0)[:, None]) < 1.5
    assert _colour(t, white + (t[:, None] / 30.0) ** 2) < 1.5
    # A first-order process of a second has sqrt(40) times the white one's density; a line off ten seconds takes some.
    assert 3.0 < _colour(t, bend) < 7.0


@pytest.mark.slow
@pytest.mark.parametrize("said", [{"lever_arm_sigma": 10.0}, {}, {"lever_arm": (6.0, -8.0, 3.0)}])
def test_of_an_arm_nothing_is_said_or_it_is_measured(said):
    """A ship's master ten metres away: refused, since an arm of which nothing was said was taken for known to a metre."""
    way, arm = ship(), (6.2, -8.5, 3.4)
    slave = simulate(way, rate=50.0, duration=120.0, imu=TACTICAL, seed=11).record
    own = replace(MASTER, lever_arm=arm)
    answer = align_transfer(slave, simulate_sensor(way, own, duration=120.0, seed=11).record, TACTICAL, **said)
    assert answer.status == "aligned", answer.reasons
    expected = said.get("lever_arm_sigma", 1.0 if said else 5.0)  # what is said holds; nothing said: as the log shows
    assert answer.transfer.lever_arm_prior[0] == expected
    assert np.abs((answer.transfer.lever_arm - arm) / answer.transfer.lever_arm_sigma).max() < 4.0


@pytest.mark.slow
def test_a_tape_measures_an_arm_to_a_metre():
    """Seven metres off it is not the one that was measured; nothing being said of it, it may be."""
    way = ship()
    slave = simulate(way, rate=50.0, duration=120.0, imu=TACTICAL, seed=11).record
    master = simulate_sensor(way, replace(MASTER, lever_arm=(0.0, 9.0, 0.0)), duration=120.0, seed=11).record
    answer = align_transfer(slave, master, TACTICAL, lever_arm=(0.0, 2.0, 0.0))
    assert answer.status == "inconsistent"
    assert any(item.key == "transfer.lever_arm" for item in answer.evidence)


@pytest.mark.parametrize(("size", "found"), [(4e-3, []), (1e-1, ["transfer.lasting"])])
def test_what_lasts_below_a_usual_noise_of_a_master_is_no_contradiction(size, found):
    """Rows without noise are believed to .01 m/s at best: the filter follows them slowly, and its innovations follow each other."""
    rng, kept = np.random.default_rng(8), math.exp(-1.0 / 100.0)
    bend = rng.standard_normal((3000, 3))
    for k in range(1, len(bend)):
        bend[k] = kept * bend[k - 1] + math.sqrt(1.0 - kept**2) * bend[k]
    time, used = 0.05 * np.arange(len(bend)), np.ones(len(bend), dtype=bool)
    innovation, sigma = size * bend, np.full_like(bend, max(size, 0.01))
    rows = Residuals("master velocity", time, innovation, sigma, np.ones(len(time)), used, 0, time, ~used)
    assert [e.key for e in _lasting(SimpleNamespace(residuals=[rows]), 0.1)] == found
    # A first row of a start that is hardly known is large, as it says, and no size of the others.
    innovation[0], sigma[0] = 100.0, 100.0
    assert [e.key for e in _lasting(SimpleNamespace(residuals=[rows]), 0.1)] == found


def test_errors_of_the_master_by_name():
    given = master_errors("level=0.3 arcmin, heading=2 arcmin,velocity=0.05 m/s,correlation_time=200 s")
    assert given == MasterErrors(
        0.3 * ARCMIN, 2.0 * ARCMIN, 0.05, 0.3 * ARCMIN, 0.05, 200.0, heading_drift=2.0 * ARCMIN
    )  # drifts that are left out are as large as the constants, but one that was said holds for heading too
    both = master_errors("level=0.3 arcmin,heading=2 arcmin,attitude_drift=0.1 arcmin")
    assert both.attitude_drifts == pytest.approx([0.1 * ARCMIN] * 3)
    for wrong, message in (
        ("level=1", "no unit"),
        ("tilt=1 arcmin", "expected one of"),
        ("level 1 deg", "expected one of"),
    ):
        with pytest.raises(UsageError, match=message):
            master_errors(wrong)


@pytest.mark.slow
@pytest.mark.parametrize("run", [0, 1, 2])
def test_level_of_a_consumer_slave_by_velocity_alone(run):
    """Ships of seed 88170: 7.4, 6.0 and 5.9 sigmas off, `aligned`, while each pass began with the level that the master gave."""
    rng = np.random.default_rng([88170, run])
    sits = {"lever_arm": tuple(rng.standard_normal(3)), "clock_offset": 0.05 * rng.standard_normal()}
    seat = tuple(3.0 * DEG * rng.standard_normal(3))
    spec = MasterSpec(mounting=seat, velocity_noise=0.05, attitude_noise=ARCMIN, **sits)
    slave = simulate(ship(), rate=100.0, duration=200.0, imu=imu_spec("consumer"), seed=88170, run=run).record
    master = simulate_sensor(ship(), spec, duration=200.0, seed=88170, run=run).record
    answer = align_transfer(slave, master, "consumer", matching="velocity", master_errors="none")
    off = -rotation_vector_from_dcm(answer.C_nb @ ship().states(np.array(answer.time)).C_nb.T)
    assert answer.status == "aligned"
    assert np.all(np.abs(off) < 4.0 * np.sqrt(np.diag(answer.phi_covariance)))


@pytest.mark.slow
def test_a_delay_that_cannot_be_seen_is_not_printed_as_seen():
    """Straight on in still air: the noise of the gyros, squared over two thousand rows, is no knowledge of a delay."""
    way = course(Position.from_degrees(62.0, 20.0, 3000.0), straight(200.0), heading=0.6, speed=150.0)
    spec = MasterSpec(clock_offset=0.06, velocity_noise=0.05, attitude_noise=math.radians(1.0 / 60.0))
    slave = simulate(way, rate=100.0, duration=150.0, imu=imu_spec("tactical"), seed=4).record
    master = simulate_sensor(way, spec, duration=150.0, seed=4).record
    answer = align_transfer(slave, master, "tactical").transfer
    assert not answer.delay_estimated
    assert abs(answer.delay - 0.06) < 2.0 * answer.delay_sigma


@pytest.mark.slow
def test_a_masters_own_sigmas_make_sigma_absolute(tmp_path):
    """Columns of its log, medians of which count: half of the variance constant, half of it drift; "none" leaves them out."""
    way = course(Position.from_degrees(62.0, 20.0, 3000.0), straight(200.0), heading=0.6, speed=150.0)
    slave = simulate(way, rate=100.0, duration=60.0, imu=imu_spec("tactical"), seed=4).record
    master = simulate_sensor(way, MasterSpec(velocity_noise=0.05), duration=60.0, seed=4).record
    rows, arcmin = len(master), math.radians(1.0 / 60.0)
    attitude_sigma = np.tile(np.array([60.0, 4.0, 4.0]) * arcmin, (rows, 1))
    attitude_sigma[3] = np.nan
    master = replace(master, attitude_sigma=attitude_sigma, velocity_sigma=np.full((rows, 3), 0.1))
    own = own_errors(master.attitude_sigma, master.velocity_sigma)
    whole = np.hypot(
        [own.level, own.heading, own.velocity], [own.attitude_drift, own.heading_drift, own.velocity_drift]
    )
    assert whole == pytest.approx([4.0 * arcmin, 60.0 * arcmin, 0.1])
    write_record(master, tmp_path / "master.csv")
    read = read_master(tmp_path / "master.csv")
    np.testing.assert_allclose(read.attitude_sigma, master.attitude_sigma, rtol=1e-9)
    np.testing.assert_allclose(read.velocity_sigma, master.velocity_sigma)
    absolute = align_transfer(slave, read, "tactical")
    relative = align_transfer(slave, read, "tactical", master_errors="none")
    assert absolute.transfer.considered
    assert not relative.transfer.considered
    # The master's heading comes on top, and its velocities tell less of the slave.
    assert absolute.euler_sigma[0] > 0.97 * np.hypot(relative.euler_sigma[0], 60.0 * arcmin)
    with pytest.raises(DataError, match="sigma"):
        replace(master, velocity_sigma=np.zeros((rows, 3)))


@pytest.mark.slow
def test_accelerometers_that_lag_by_less_than_a_rung_of_the_ladder_are_found():
    """A filter of .056 s in them, 50 rows a second: level was off by 10 sigmas where delays of .06 and .1 s were tried alone."""
    bench = BENCHES["transfer"]
    inputs, truth = bench.draw(66, 1)
    record = inputs["record"]
    keep = np.exp(-record.interval / 0.056)
    accel = record.accel.copy()
    for k in range(1, len(accel)):
        accel[k] = keep * accel[k - 1] + (1.0 - keep) * accel[k]
    answer = bench.align(inputs | {"record": replace(record, accel=accel)})
    assert any(item.key == "delay.gyros_early" for item in answer.evidence)
    assert max(float(np.abs(x).max()) for x in misses(answer, truth).values()) < 3.0


@pytest.mark.parametrize("attitude", [True, False])
def test_rows_that_run_backwards_are_no_clock_that_is_off(attitude):
    """A flight with two turns, reversed, agrees with its master at a shift that brings one turn upon itself."""
    inputs, _ = BENCHES["attitude"].draw(9131, 0)
    slave, master = inputs["record"], inputs["master"]
    master = master if attitude else replace(master, C_nb=None)
    backwards = replace(slave, gyro=slave.gyro[::-1], accel=slave.accel[::-1])
    assert find_delay(backwards, master, np.eye(3)).sure
    assert find_delay(backwards, master, np.eye(3)).delay > 60.0
    with pytest.raises(DataError, match="run backwards"):
        align(backwards, imu=inputs["imu"], aid=[Master(master, inputs["mounting"])])
    reversed_master = replace(master, **{k: x[::-1] for k in ("C_nb", "v_n") if (x := getattr(master, k)) is not None})
    # Its attitudes, reversed, turn the other way round; the size of its force is the same.
    assert runs_backwards(slave, reversed_master[200:], np.eye(3), 0.0, 0.3) is not attitude


@pytest.mark.slow
@pytest.mark.parametrize("late", [-60.0, -5.0, 5.0, 30.0, 71.0])
def test_clocks_that_are_off_by_minutes_are_brought_together(late):
    inputs, truth = BENCHES["attitude"].draw(9131, 0)
    slave, master = inputs["record"], inputs["master"].shifted(late)
    for one in (master, replace(master, C_nb=None)):
        assert not runs_backwards(slave, one, np.eye(3), 0.0, 0.3)
    found = align(slave, imu=inputs["imu"], aid=[Master(master, inputs["mounting"], matching="both")])
    assert found.status == "aligned"
    assert found.transfer.delay == pytest.approx(late + 0.03, abs=0.01)
    assert max(np.abs(off).max() for off in misses(found, truth).values()) < 4.0


def test_one_turn_looks_the_same_from_both_ends():
    """Turns at 25 s and, by the other's clock, at 75 s of 100 s: mirrored they agree without a shift, in no more of the motion."""
    scenario = {
        "name": "turn",
        "duration": "200 s",
        "rate": "50 Hz",
        "position": {"lat": "40 deg", "lon": "0 deg", "alt": "3000 m"},
        "imu": "tactical",
        "motion": {
            "kind": "legs",
            "heading": "20 deg",
            "speed": "120 m/s",
            "legs": [
                {"kind": "straight", "duration": "80 s"},
                {"kind": "turn", "angle": "60 deg", "rate": "3 deg/s", "onset": "0.5 s"},
                {"kind": "straight", "duration": "100 s"},
            ],
        },
        "master": {"rate": "10 Hz", "velocity_noise": "0.2 m/s"},
    }
    built = read_scenario(scenario)
    slave, master = built.simulate(seed=5).record, built.simulate_aiding(seed=5)["master"].record
    slave, master = slave.between(65.0, 165.0), master.between(15.0, 115.0).shifted(50.0)
    straight, mirrored = (find_delay(slave, master, np.eye(3), mirrored=m) for m in (False, True))
    assert straight.delay == pytest.approx(50.0, abs=0.1)
    assert abs(mirrored.delay) < 2.0
    assert mirrored.sure
    assert not runs_backwards(slave, master, np.eye(3), 0.0, 2.0)
