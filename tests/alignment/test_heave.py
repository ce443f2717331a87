"""The slow vertical velocity of a base that sways tells what its gyros do, whatever the sea does along the level."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.honesty import vehicles
from benchmarks.honesty.foreign import exp, log, sensed
from benchmarks.honesty.foreign_rows import CASES, moored
from truenorth.alignment import align
from truenorth.alignment.by_heave import columns, excluded, scaled, weighed_by_heave
from truenorth.alignment.heave import MOST, Heave, slepian
from truenorth.core.earth import gravity_of_place
from truenorth.core.position import Position
from truenorth.records import ImuRecord
from truenorth.records.interpolation import gyros_behind
from truenorth.records.specs import imu_spec
from truenorth.simulation.scenario import read_scenario
from truenorth.state.evidence import Effect, Evidence

POLE = Position(np.pi / 2, 0.0, 0.0)  # where the earth turns about the vertical
G, STEP, NOISE = gravity_of_place(np.pi / 2, 0.0), 0.05, 1e-4


def waves(rng, time, size):
    """(N,) waves of 4 to 9 s, which come in groups."""
    w = 2.0 * np.pi / rng.uniform(4.0, 9.0, 12)
    return size / np.sqrt(6.0) * np.cos(w * time[:, None] + rng.uniform(0.0, 6.28, 12)).sum(axis=1)


def floating(seed, hides=0.0, duration=300.0, noise=NOISE, above=0.0):
    """A base that rolls by 3 deg and heaves, and is pushed level just as gyros late by `hides` lay gravity askew.

    The log of a sound IMU, `above` metres above the point that neither rises nor sinks, and its attitude at the start.
    """
    rng = np.random.default_rng(seed)
    edge = STEP * np.arange(round(duration / STEP) + 1)
    middle = 0.5 * (edge[1:] + edge[:-1])
    tilts = [waves(np.random.default_rng([seed, 1]), edge - d, np.radians(3.0)) for d in (0.0, hides)]
    heave = waves(rng, middle, 0.5)
    x, y = tilts[0], 0.3 * tilts[0]
    sinks = above * np.cos(np.hypot(x, y))
    heave += np.gradient(np.diff(sinks) / STEP, STEP)
    zero = np.zeros_like(edge)
    C, late = (exp(np.stack([x, 0.3 * x, zero], axis=1)) for x in tilts)
    start = C[0]
    turned = log(np.swapaxes(C[:-1], 1, 2) @ C[1:])
    C, late = (x[:-1] @ exp(0.5 * log(np.swapaxes(x[:-1], 1, 2) @ x[1:])) for x in (C, late))
    up = np.einsum("kij,kj->ki", C, late[:, 2])  # where late gyros have the vertical
    force = (G + heave)[:, None] * up / up[:, 2:]
    felt = np.einsum("kji,kj->ki", C, force) + noise / np.sqrt(STEP) * rng.standard_normal(force.shape)
    return ImuRecord(edge[1:], turned, STEP * felt, "increments"), start


def heave_of(record, start, walk=NOISE):
    return Heave(record, start, POLE, walk)


@pytest.mark.parametrize("seed", range(3))
def test_a_push_that_hides_a_delay_altogether_hides_it_from_the_level_alone(seed):
    record, start = floating(seed, hides=0.2)
    delay = heave_of(gyros_behind(record, 0.2), start).delay
    assert delay.ratio > 25.0
    assert abs(delay.size - 0.2) < 4.0 * delay.sigma < 0.2


@pytest.mark.parametrize("seed", range(3))
def test_a_push_in_step_with_the_tilt_is_no_delay(seed):
    delay = heave_of(*floating(seed, hides=0.2)).delay
    assert delay.ratio < 12.0
    assert abs(delay.size) < 4.0 * delay.sigma < 0.2


@pytest.mark.parametrize("above", [-8.0, 8.0])
def test_an_arm_that_sinks_as_its_base_tilts_is_no_delay(above):
    """Of 8 m at 3 deg: 2 mm/s, as slow as the groups of waves. Ships were refused for gyros .07 s early."""
    found = [heave_of(*floating(seed, hides=0.2, above=above)).delay for seed in range(4)]
    assert max(delay.ratio for delay in found) < 12.0
    late = [floating(seed, hides=0.2, above=above) for seed in range(4)]
    seen = [heave_of(gyros_behind(record, 0.2), start).delay for record, start in late]
    assert min(delay.ratio for delay in seen) > 25.0


@pytest.mark.slow
def test_delays_of_quiet_seas_are_as_uncertain_as_their_sigma_says():
    """Twenty seas with accelerometers so noisy that sigma is a good part of what is asked."""
    seas = [floating(100 + k, 0.1, noise=3e-3) for k in range(20)]
    found = [heave_of(gyros_behind(record, 0.1), start, 3e-3).delay for record, start in seas]
    ratio = np.array([(delay.size - 0.1) / delay.sigma for delay in found])
    assert 0.02 < np.median([delay.sigma for delay in found]) < 0.2
    assert 0.5 < np.sqrt(np.mean(ratio**2)) < 1.5  # of twenty: one in 1e3 is beyond


def test_another_scale_or_order_of_sound_gyros_is_excluded_and_of_false_ones_it_is_not():
    record, start = floating(1, hides=0.2)
    sound = heave_of(record, start)
    assert excluded(sound, scaled(np.array([0.4, 0.0, 0.0])))
    assert excluded(sound, columns("+y -x +z"))
    for right, false in (
        (scaled(np.array([0.3, 0.0, 0.0])), lambda gyro: gyro * [1.3, 1.0, 1.0]),
        (columns("+y +x +z"), lambda gyro: gyro[:, [1, 0, 2]]),
    ):
        spoilt = replace(record, gyro=false(record.gyro))
        np.testing.assert_allclose(right(spoilt).gyro, record.gyro, atol=1e-15)
        heave = heave_of(spoilt, start)
        assert not excluded(heave, right)
        assert heave.misfit(right) < heave.misfit() - 25.0


def test_a_long_log_is_that_of_its_last_part():
    record, C = floating(2, 0.2, duration=MOST + 100.0)
    record = gyros_behind(record, 0.2)
    whole = heave_of(record, C).delay
    part = record.between(record.time[-1] - MOST + 0.5 * STEP)
    before = record.between(None, part.time[0] - 0.5 * STEP)
    for turn in exp(before.gyro):
        C = C @ turn
    assert whole == pytest.approx(heave_of(part, C).delay, rel=0.02)


def test_where_nothing_slow_is_seen_all_stays_as_it_was_said():
    record, start = floating(3, duration=30.0)
    item = Evidence("tilt.gyros_late", {"delay": 0.3}, "bounded", Effect(level=0.02))
    assert heave_of(record, start).delay is None
    for heave in (heave_of(record, start), None):
        assert weighed_by_heave(heave, [item], record) == [item]


def test_of_a_base_that_rests_no_delay_is_known():
    rng = np.random.default_rng(3)
    force = [0.0, 0.0, STEP * G] + NOISE * np.sqrt(STEP) * rng.standard_normal((6000, 3))
    delay = heave_of(ImuRecord(STEP * np.arange(1, 6001), 0.0 * force, force, "increments"), np.eye(3)).delay
    assert delay is None or (delay.ratio < 1.0 and delay.sigma > 0.3)


def test_slow_sequences_are_orthonormal_and_hold_no_wave():
    slow = slepian(300, 0.09)
    np.testing.assert_allclose(slow.T @ slow, np.eye(slow.shape[1]), atol=1e-12)
    assert 40 < slow.shape[1] < 54
    power = np.abs(np.fft.rfft(slow, 2**14, axis=0)) ** 2
    assert power[np.fft.rfftfreq(2**14) > 0.0901].sum() < 1e-6 * power.sum()


@pytest.mark.slow
@pytest.mark.parametrize(("late", "kind"), [(0.0, None), (0.2, "bounded")])
def test_late_gyros_of_a_buoy_are_named(late, kind):
    """Seed 32, run 5: of .2 s level was 9.7 sigmas off, `level_only`, without a word: the push hid them."""
    rng = np.random.default_rng([32, 5, 9])
    true = vehicles.buoy(rng, 200.0)
    record = gyros_behind(sensed(rng, true, imu_spec("tactical")), late)
    answer = align(record, Position(*true.place.mean(axis=0).tolist()), "tactical")
    found = {item.key: item for item in answer.evidence}.get("heave.delay")
    assert (found and found.kind) == kind
    assert (answer.status == "inconsistent") == (late > 0.0)
    assert found is None or abs(found.figures["delay"] - late) < 4.0 * found.figures["sigma"]


@pytest.mark.slow
@pytest.mark.parametrize("run", [6, 9])
def test_a_sea_that_pushes_a_ship_at_the_quay_makes_no_gyro_false(run):
    """Seed 61004: refused before, for gyros that do not turn as gravity does, and one that turns 41 % too far."""
    rng = np.random.default_rng([61004, run, 9])
    true = moored(rng, 300.0)
    answer = align(sensed(rng, true, imu_spec("navigation")), Position(*true.place.mean(axis=0).tolist()), "navigation")
    assert answer.status == "aligned"
    assert not [item for item in answer.evidence if item.key.startswith("tilt.") and item.kind != "hint"]


@pytest.mark.slow
def test_no_delay_is_seen_in_sound_rafts():
    """Four of them; by chance one of 500 such sets has one."""
    case = next(case for case in CASES if case.name == "swaying, tactical, raft")
    found = [case.run(515, run) for run in range(4)]
    assert not [outcome.refused for outcome in found if outcome.refused]


def test_a_level_motion_does_not_show_in_the_vertical_of_its_time():
    """An IMU 8 m to the side of a ship that yaws: 1 mm/s by the vertical at the start, which the earth turns by a degree.

    Sound gyros seemed .036 s late by it, with a likelihood ratio of 35.
    """

    def tone(amplitude, period):
        return [{"amplitude": amplitude, "period": period}]

    tones = {"heading": tone("2.7 deg", "10.1 s"), "pitch": tone("4.4 deg", "5.5 s"), "roll": tone("7 deg", "6.3 s")}
    built = read_scenario(
        {
            "name": "yaws",
            "duration": "240 s",
            "rate": "50 Hz",
            "position": {"lat": "40 deg"},
            "imu": {"gyro": {"random_walk": "1e-9 deg/sqrt(h)"}, "accel": {"random_walk": "1e-6 ug/sqrt(Hz)"}},
            "motion": {"kind": "sway", "heading": "30 deg", "tones": tones},
            "lever_arm": ["8 m", "0 m", "0 m"],
        }
    )
    record = built.simulate(seed=1).record
    begin = built.build_motion(1, 0).states(np.array(float(record.time[0] - record.interval)))
    place = Position(float(begin.lat), float(begin.lon), float(begin.alt))
    delay = Heave(record, begin.C_nb, place, 1e-4).delay
    assert delay.ratio < 1.0
    assert abs(delay.size) < 1e-4
