"""Clocks of a slave and its master where one manoeuvre looks like the next: chance says which of them agree best."""

from dataclasses import replace

import numpy as np
import pytest

from tests.runs import some
from truenorth.alignment.transfer_delay import delay_by_arm, find_delay
from truenorth.alignment.transfer_filter import Assumed
from truenorth.alignment.transfer_start import common_clock, parted_clocks
from truenorth.campaign.fault_benches import BENCHES
from truenorth.core.earth import GRAVITY_EQUATOR
from truenorth.core.position import Position
from truenorth.records import ImuRecord, MasterRecord
from truenorth.records.specs import imu_spec
from truenorth.simulation import MasterSpec, simulate, simulate_sensor
from truenorth.simulation.course import course
from truenorth.simulation.manoeuvres import s_turn, straight

DEG = np.radians(1.0)
LATE = 0.03  # s


@pytest.fixture(scope="module", params=some([0], [1]))
def logs(request):
    """An aircraft with two S-turns alike, and a master that puts each row of ten a second out five times."""
    legs = [*straight(30.0), *s_turn(20 * DEG, 3 * DEG), *straight(60.0), *s_turn(20 * DEG, 3 * DEG), *straight(200.0)]
    way = course(Position.from_degrees(62.0, 20.0, 3000.0), legs, heading=0.6, speed=150.0)
    seeds = {"seed": 90889, "run": request.param}
    slave = simulate(way, rate=100.0, duration=200.0, imu=imu_spec("tactical"), **seeds).record
    of_master = MasterSpec(clock_offset=LATE, velocity_noise=0.05, attitude_noise=DEG / 60.0)
    master = simulate_sensor(way, of_master, duration=200.0, **seeds).record
    time = np.arange(master.time[0], master.time[-1], 0.02)
    held = np.searchsorted(master.time, time + 1e-9) - 1
    named = {name: getattr(master, name)[held] for name in ("lat", "lon", "alt", "v_n", "C_nb")}
    return slave, replace(master, time=time, **named)


def test_a_turn_that_comes_again_is_no_other_clock(logs):
    slave, master = logs
    assert parted_clocks(slave, master, np.eye(3), 0.0) is None
    found = find_delay(slave, master, np.eye(3)).delay
    assert abs(found - LATE - 0.05) < 0.03  # a row that is held is later by half of its time


def test_a_clock_that_steps_between_them_is_named(logs):
    slave, master = logs
    stepped = replace(master, time=master.time + 3.0 * (master.time > 100.0))
    assert parted_clocks(slave, stepped, np.eye(3), 0.0) is not None


@pytest.mark.parametrize("run", some([0], [1, 2]))
@pytest.mark.parametrize("step", [0.0, 1.0, 22.0])
def test_the_end_of_a_log_that_resembles_a_turn_is_no_other_clock(run, step):
    """100 s with two S-turns, two rows a second: the last third fits the last 11 s best, by how rows lie. 22 s were named."""
    legs = [*straight(15.0), *s_turn(20 * DEG, 3 * DEG), *straight(30.0), *s_turn(20 * DEG, 3 * DEG), *straight(300.0)]
    way = course(Position.from_degrees(50.0, 20.0, 3000.0), legs, heading=0.6, speed=100.0)
    seeds = {"seed": 6120, "run": run}
    slave = simulate(way, rate=50.0, duration=100.0, imu=imu_spec("tactical"), **seeds).record
    of_master = MasterSpec(rate=2.0, velocity_noise=0.05, attitude_noise=DEG / 60.0)
    master = simulate_sensor(way, of_master, duration=100.0, **seeds).record
    stepped = replace(master, time=master.time + step * (master.time > 50.0))
    assert (parted_clocks(slave, stepped, np.eye(3), 0.0) is not None) == (step > 0.0)


@pytest.mark.parametrize("run", range(3))
def test_what_happened_in_an_outage_has_no_course_in_time(run):
    """A turn that begins while the master is silent: between its rows it would seem to turn slowly all the while."""
    inputs, _ = BENCHES["attitude"].draw(11, run)
    slave, master = inputs["record"], inputs["master"]
    turns = np.abs(np.diff(np.unwrap(np.arctan2(master.C_nb[:, 0, 1], master.C_nb[:, 1, 1]))))
    begin = master.time[np.argmax(turns > 0.5 * turns.max())] - 1.0
    heard = np.flatnonzero((master.time < begin) | (master.time > begin + 6.0))
    rows = {name: getattr(master, name)[heard] for name in ("time", "lat", "lon", "alt", "v_n", "C_nb")}
    assert parted_clocks(slave, replace(master, **rows), np.eye(3), 0.0) is None


@pytest.mark.parametrize("attitude", [False, True])
@pytest.mark.parametrize("off", some([-31.0], [24.0, 27.0, 38.0]))
def test_a_clock_far_off_is_not_taken_for_that_of_the_next_turn(off, attitude):
    """Turns that are alike: at another multiple of their time fewer of them agree, by chance better. 9 of 32 were `aligned` so."""
    legs = straight(20.0)
    for _ in range(5):
        legs = [*legs, *s_turn(25 * DEG, 4 * DEG), *straight(30.0)]
    way = course(Position.from_degrees(40.0, 20.0, 3000.0), legs, heading=0.6, speed=120.0)
    for run in range(4):
        seeds = {"seed": 1909, "run": run}
        slave = simulate(way, rate=50.0, duration=160.0, imu=imu_spec("tactical"), **seeds).record
        of_master = MasterSpec(clock_offset=off, velocity_noise=0.05, attitude_noise=DEG / 60.0)
        master = simulate_sensor(way, of_master, duration=160.0, **seeds).record
        found = find_delay(slave, master if attitude else replace(master, C_nb=None), np.eye(3))
        assert found.sure
        assert found.delay == pytest.approx(off, abs=0.05)


@pytest.mark.parametrize("along", [-0.2, 0.2])
def test_an_arm_moves_the_delay_that_lengths_of_forces_show(along):
    """As far as its part of the force says: a base that pitches in step with its pushes, near a master on time."""
    t = np.arange(0.0, 120.0, 0.02)
    slow, quick = 2.0 * np.pi / 7.0, 2.0 * np.pi / 3.0
    push = 2.0 * np.sin(slow * t) + 1.5 * np.sin(quick * t + 0.4)
    heave = np.sin(quick * t)
    v_n = np.stack(
        [0.0 * t, -2.0 / slow * np.cos(slow * t) - 1.5 / quick * np.cos(quick * t + 0.4), -np.cos(quick * t) / quick], 1
    )
    rate, turn = 0.2 * np.sin(quick * t + 1.0), 0.2 * quick * np.cos(quick * t + 1.0)
    gyro, arm = np.stack([rate, 0.0 * t, 0.0 * t], axis=1), np.array([0.0, along, 0.0])
    still = np.stack([0.0 * t, push, heave + GRAVITY_EQUATOR], axis=1)
    added = np.cross(np.stack([turn, 0.0 * t, 0.0 * t], axis=1), arm) + np.cross(gyro, np.cross(gyro, arm))
    master = MasterRecord(t[::5], v_n=v_n[::5])
    at, off = (ImuRecord(t, gyro, force, "rates") for force in (still, still + added))
    moved = find_delay(off, master, np.eye(3)).delay - find_delay(at, master, np.eye(3)).delay
    said = delay_by_arm(off, master, arm, 0.0)
    assert abs(moved) > 0.003
    assert said == pytest.approx(abs(moved), rel=0.3)
    assert (
        delay_by_arm(off, master, 0.0 * arm, 0.5) > 0.24 * said
    )  # of an arm that is uncertain by half a metre along each axis


@pytest.mark.parametrize("jump", some([1.0], [-5.0]))
def test_a_clock_that_jumps_between_turns_is_not_that_of_the_other_turn(logs, jump):
    """The last turn agrees with the first one all over: a delay of 90 s was taken, and the answer `aligned`."""
    slave, master = (log.between(None, 150.0) for log in logs)
    half = master.time > 80.0
    time = master.time + jump * half
    kept = ~half | (time > 80.0)
    rows = {name: getattr(master, name)[kept] for name in ("lat", "lon", "alt", "v_n", "C_nb")}
    jumped = replace(master, time=time[kept], **rows)
    assert abs(find_delay(slave, jumped, np.eye(3)).delay) > 80.0
    assumed = Assumed(delay_sigma=0.05)
    assert common_clock(slave, jumped, assumed) == (assumed, ())
    assert parted_clocks(slave, jumped, np.eye(3), 0.0) is not None
    late = replace(master, time=master.time + 20.0)
    assert abs(common_clock(slave, late, assumed)[0].delay - 20.0) < 0.1
