"""From an alignment at rest on: is the sigma of free inertial navigation that of the errors?"""

import json

import numpy as np
import pytest

from tests.runs import some
from truenorth.alignment import align
from truenorth.core.errors import DataError
from truenorth.core.position import Position
from truenorth.navigation import navigate
from truenorth.navigation.start import read_start, start_from_alignment
from truenorth.records.specs import imu_spec
from truenorth.results import save
from truenorth.simulation import Sway, Tone, ideal_log, rest, simulate
from truenorth.state.layout import BA, BG, PHI

PLACE = Position.from_degrees(40.0, 116.0, 50.0, horizontal_sigma=1e-3, vertical_sigma=1e-3)


def test_what_an_alignment_balances_navigation_knows_to_be_balanced(tmp_path):
    """Tilt against accelerometer bias, heading against east gyro bias: free inertial at rest sees the small differences only."""
    spec = imu_spec("navigation")
    record = simulate(ideal_log(rest(PLACE, 0.7), rate=20.0, duration=600.0), imu=spec, seed=3).record
    alignment = align(record, PLACE, spec, method="kalman")
    start = start_from_alignment(alignment)
    g, level = 9.80, 7.292115e-5 * np.cos(PLACE.lat)
    C = start.C_nb
    force = np.zeros((2, 15))  # of the level velocities: f x phi + C nabla
    force[0, 1], force[1, 0] = -g, g
    force[:, BA] = C[:2]
    rate = np.zeros(15)  # of phi_E: what drives north
    rate[2] = -level
    rate[BG] = -C[0]
    for row in (*force, rate):
        parts = np.sqrt(row**2 @ np.diag(start.P))
        assert np.sqrt(row @ start.P @ row) < 0.5 * parts  # noise leaves a third of it
    assert np.all(np.linalg.eigvalsh(start.P[PHI, PHI]) > 0)

    alignment.save(tmp_path)
    again, _, _ = read_start(tmp_path)
    for name in ("C_nb", "gyro_bias", "accel_bias", "P"):
        np.testing.assert_allclose(getattr(again, name), getattr(start, name), rtol=1e-12, atol=1e-30)
    np.testing.assert_allclose(again.whole.constant, start.whole.constant, rtol=1e-9)
    assert again.whole.averaged == start.whole.averaged == pytest.approx(600.0)


@pytest.mark.parametrize("number", ["9" * 400, "1e999", "NaN"])
def test_a_damaged_covariance_is_no_start(tmp_path, number):
    record = simulate(
        rest(Position.from_degrees(45.0, 8.0), 0.3), rate=20.0, duration=60.0, imu="navigation", seed=1
    ).record
    save(align(record, Position.from_degrees(45.0, 8.0), "navigation"), tmp_path)
    summary = tmp_path / "summary.json"
    content = json.loads(summary.read_text())
    content["navigation"]["handover"]["P"][0][0] = "HERE"
    summary.write_text(json.dumps(content).replace('"HERE"', number))
    with pytest.raises(DataError):
        read_start(tmp_path)


@pytest.mark.slow
def test_free_inertial_after_an_alignment_is_as_good_as_its_sigma():
    """100 runs: 300 s of alignment, an hour of free inertial at rest; RMS over sigma of position and velocity.

    RMS of 100 runs is within 20 % of its own sigma in 99.5 % of cases, of all four in 98 %.
    """
    spec = imu_spec("navigation")
    log = ideal_log(rest(PLACE, 0.7), rate=20.0, duration=3900.0)
    errors, sigmas = [], []
    for run in range(100):
        record = simulate(log, imu=spec, seed=21, run=run).record
        start = align(record.between(None, 300.0), PLACE, spec, method="kalman")
        result = navigate(record, start, interval=1.0, output=60.0)
        errors.append(np.hstack([result.displacement[-1], result.v_n[-1, :2]]))
        sigmas.append(np.hstack([result.position_sigma[-1, :2], result.v_sigma[-1, :2]]))
    ratio = np.sqrt(np.mean(np.square(errors), axis=0) / np.mean(np.square(sigmas), axis=0))
    print("RMS over sigma, position east north, velocity east north:", ratio)
    assert np.all((ratio > 0.8) & (ratio < 1.2))


@pytest.mark.slow
@pytest.mark.parametrize("seed", some([8], [9, 3]))
def test_what_scale_factors_make_of_gravity_is_handed_on_as_a_bias(seed):
    """A base that sheers has them among its states: velocities were up to 12 sigmas off after a minute."""
    place, rng = Position.from_degrees(20.0, 10.0), np.random.default_rng(seed)
    heading, *phases = rng.uniform(0.0, 6.0, 4)
    tones = [
        (Tone(size, period, phase),)
        for size, period, phase in zip((0.3, 0.01, 0.03), (100.0, 6.0, 9.0), phases, strict=True)
    ]
    motion = Sway(place, heading, heading_tones=tones[0], pitch_tones=tones[1], roll_tones=tones[2])
    record = simulate(motion, rate=25.0, duration=560.0, imu="navigation", seed=seed).record
    found = align(record.between(None, 500.0), place, "navigation")
    assert found.status == "aligned"
    assert len(found.ongoing.x) == 57  # they are states
    result = navigate(record, found, altitude="free")
    off = (result.v_n[-1] - motion.states(result.time[-1]).v_n) / result.v_sigma[-1]
    assert np.abs(off).max() < 3.0
