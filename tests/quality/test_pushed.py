"""A push of the sea in step with a base's tilt against late gyros: what goes with the tilt beyond a delay."""

import numpy as np
import pytest

from benchmarks.honesty import vehicles
from benchmarks.honesty.foreign import sensed
from benchmarks.once_silent import _late
from tests.runs import some
from truenorth.campaign.fault_benches import BENCHES
from truenorth.quality.pushed import push_in_step
from truenorth.quality.tilt import check_tilt
from truenorth.quality.tilt_bench import TiltBench, shifted
from truenorth.records.specs import imu_spec

G, CELL = 9.81, 0.1


def tilts(rng, pieces=8, length=200):
    """(P, L, 2) small tilts about x and y at the middles of cells, and the turns (P, L, 3) in these: waves of many periods."""
    edges = CELL * np.arange(pieces * length + 1)
    angle = np.zeros((len(edges), 2))
    for w in rng.uniform(0.8, 2.5, 30):
        angle += 1e-3 * rng.standard_normal(2) * np.cos(w * edges[:, None] + rng.uniform(0.0, 6.28, 2))
    theta = np.zeros((pieces * length, 3))
    theta[:, :2] = np.diff(angle, axis=0)
    middle = 0.5 * (angle[1:] + angle[:-1])
    return middle.reshape(pieces, length, 2), theta.reshape(pieces, length, 3)


def felt(tilt, push):
    """Specific force (P, L, 3) in a body with these tilts, to first order, with a level push."""
    force = np.zeros((*tilt.shape[:2], 3))
    force[..., 0] = -G * tilt[..., 1] + push[..., 0]  # turned about y, x points down
    force[..., 1] = G * tilt[..., 0] + push[..., 1]
    force[..., 2] = G
    return force


@pytest.mark.parametrize("late", [0.2, -0.4])
def test_what_late_gyros_leave_is_explained_by_their_delay(late):
    rng = np.random.default_rng(1)
    tilt, theta = tilts(rng)
    bench = TiltBench(felt(tilt, 0.003 * rng.standard_normal(tilt.shape)), CELL, None)
    assert push_in_step(bench, shifted(theta, -late / CELL), theta).share < 0.05


@pytest.mark.parametrize("phase", [0.0, 1.0, 2.0, -1.0])
def test_a_push_in_step_leaves_what_no_delay_explains(phase):
    """Of one phase at all frequencies: at a quarter of a turn it is the most like a delay, whose push grows with the frequency."""
    rng = np.random.default_rng(2)
    tilt, theta = tilts(rng)
    spectrum = np.fft.rfft(tilt.reshape(-1, 2), axis=0) * np.exp(1j * phase)
    push = 0.4 * G * np.fft.irfft(spectrum, n=tilt[..., 0].size, axis=0).reshape(tilt.shape)
    bench = TiltBench(felt(tilt, push), CELL, None)
    delays = [delay for delay in np.arange(-0.8, 0.85, 0.1) if abs(delay) > 0.05]
    shares = [push_in_step(bench, theta, shifted(theta, delay / CELL)).share for delay in delays]
    assert min(shares) > 0.1


def test_the_level_force_that_is_left_is_that_of_an_axis():
    rng = np.random.default_rng(3)
    tilt, theta = tilts(rng)
    force = felt(tilt, 0.0 * tilt)
    force[..., 0] += 0.1 * rng.standard_normal(tilt.shape[:2])
    force[..., 2] += rng.standard_normal(tilt.shape[:2])  # heave, which is not level
    push = push_in_step(TiltBench(force, CELL, None), theta, shifted(theta, 0.2 / CELL))
    assert push.level == pytest.approx(0.1 / np.sqrt(2.0), rel=0.1)


@pytest.mark.parametrize("run", some([0], [3, 4, 6, 7, 8]))
def test_a_raft_that_follows_the_slope_of_waves_has_no_late_gyros(run):
    """Six of ten sound rafts that were refused: gyros .09 to .34 s early, about both axes alike."""
    rng = np.random.default_rng([31, run, 9])
    record = sensed(rng, vehicles.raft(rng, 200.0), imu_spec("tactical"))
    assert {item.kind for item in check_tilt(record).evidence()} <= {"hint"}


@pytest.mark.parametrize("run", some([0, 1], [2, 3]))
def test_late_gyros_of_a_ship_that_sways_are_named(run):
    inputs, _ = BENCHES["swaying"].draw(31, run)
    found = check_tilt(_late(0.4)(inputs)["record"])
    if found.rough:
        assert found.pushed.share < 0.05
    assert "tilt.gyros_late" in {item.key for item in found.evidence()}
