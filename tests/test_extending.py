"""The example of docs/extending.md: a compass with its own bias, in alignment on the move and in navigation, honest in both."""

import importlib.util
import re
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import chi2

import truenorth as tn
from tests.runs import few_and_all
from truenorth.core.attitude import dcm_from_rotation_vector, euler_from_dcm, rotation_vector_from_dcm
from truenorth.core.position import Position
from truenorth.records import GnssRecord
from truenorth.records.specs import imu_spec
from truenorth.simulation import ideal_log, simulate
from truenorth.simulation.course import course
from truenorth.simulation.manoeuvres import s_turn, straight
from truenorth.state.layout import PHI
from truenorth.state.state import Start

PAGE = Path(__file__).parents[1] / "docs" / "extending.md"
SECONDS, BIAS, NOISE = 60.0, np.radians(4.0), np.radians(1.0)
IMU = imu_spec("industrial")
SIGMA = np.concatenate([np.repeat([np.radians(0.2), 0.05, 2.0], 3), np.sqrt(IMU.bias_variance)])
SIGMA[2] = np.radians(8.0)  # heading


@pytest.fixture(scope="module")
def plugin(tmp_path_factory):
    text = re.search(r"```python\n(.*?)```", PAGE.read_text("utf-8"), re.DOTALL)[1]
    assert len(text.splitlines()) < 60
    file = tmp_path_factory.mktemp("plugin") / "compass_of_mine.py"
    file.write_text(text, "utf-8")
    spec = importlib.util.spec_from_file_location("compass_of_mine", file)
    module = sys.modules[spec.name] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def drive():
    legs = [*straight(10.0), *s_turn(np.radians(30.0), np.radians(5.0)), *straight(60.0)]
    motion = course(Position.from_degrees(50.0, 10.0, 100.0), legs, heading=0.7, speed=8.0)
    return motion, ideal_log(motion, rate=50.0, duration=SECONDS)


def run_of(drive, plugin, run):
    """Record, fixes, compass and the compass's true bias at the end."""
    motion, ideal = drive
    rng = np.random.default_rng([3, run])
    simulation = simulate(ideal, imu=IMU, seed=9, run=run)
    t = np.arange(0.5, SECONDS, 0.5)
    at = motion.states(t)
    noise = rng.standard_normal((len(t), 6))
    v = at.v_n + 0.05 * noise[:, 3:]
    sigma = np.full((len(t), 3), 0.05)
    fixes = GnssRecord(t, at.lat, at.lon, at.alt, v_n=v, velocity_sigma=sigma)
    bias = BIAS * rng.standard_normal()
    heading = euler_from_dcm(at.C_nb)[0] + bias + NOISE * rng.standard_normal(len(t))
    compass = plugin.Compass(SimpleNamespace(time=t, heading=heading), NOISE, BIAS, 1e6)
    return simulation.record, fixes, compass, bias, rng


def total_of(track, motion, bias):
    """NEES of heading and the compass's bias together, at the end."""
    true = motion.states(track.time[-1:]).C_nb
    phi = -rotation_vector_from_dcm(track.C_nb[-1:] @ np.swapaxes(true, 1, 2))[0]
    at = [PHI.stop - 1, track.layout.first_of("compass bias")]
    error = np.array([phi[2], bias - track.sensors[-1, at[1]]])
    P = track.P[-1][np.ix_(at, at)]
    assert np.sqrt(P[0, 0]) < np.radians(4.0)
    return error @ np.linalg.solve(P, error)


def inside(total, runs):
    """Of two numbers a run; a false alarm in one of a thousand tests."""
    low, high = chi2.ppf([5e-4, 1.0 - 5e-4], 2 * runs)
    return low < total < high


@few_and_all(12, few=2)
def test_navigation_is_honest_with_it(drive, plugin, runs):
    motion, total = drive[0], 0.0
    for run in range(runs):
        record, fixes, compass, bias, rng = run_of(drive, plugin, run)
        s = motion.states(0.0)
        dx = SIGMA * rng.standard_normal(15)
        C = dcm_from_rotation_vector(-dx[PHI]) @ s.C_nb
        place = float(s.lat), float(s.lon), float(s.alt)
        start = Start(0.0, C, s.v_n + dx[3:6], *place, np.zeros(3), np.zeros(3), np.diag(SIGMA**2))
        result = tn.navigate(record, start, imu=IMU, aid=[tn.Gnss(fixes), compass], check_clocks=False)
        total += total_of(result.track, motion, bias)
    assert inside(total, runs)


@pytest.mark.slow
@few_and_all(12, few=2)
def test_alignment_on_the_move_is_honest_with_it(drive, plugin, runs):
    total = 0.0
    for run in range(runs):
        record, fixes, compass, bias, _ = run_of(drive, plugin, run)
        result = tn.align(record, imu=IMU, aid=[tn.Gnss(fixes), compass])
        total += total_of(result.moving.track, drive[0], bias)
    assert inside(total, runs)
