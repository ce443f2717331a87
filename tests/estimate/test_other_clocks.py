"""Receivers and IMUs without quartz clocks, in logs too short to show it at once."""

import math
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.honesty.circling import drawn_start, received
from benchmarks.honesty.driving import STRAIGHT, ship
from truenorth.aiding.aids import Gnss
from truenorth.aiding.sensors import from_gnss
from truenorth.alignment import align
from truenorth.coarse.odometer import gnss_alignment
from truenorth.estimate.latency import counted_between
from truenorth.estimate.other_clocks import clock_ratio
from truenorth.estimate.poorer import poorer_evidence
from truenorth.estimate.rivals import likelihood_ratio
from truenorth.navigation import Mounting, navigate
from truenorth.records import GnssRecord, ImuRecord
from truenorth.records.specs import imu_spec
from truenorth.simulation import ideal_log, simulate
from truenorth.state.layout import Layout
from truenorth.state.mounting import QUARTZ, Drift
from truenorth.state.track import Residuals, Track

LONG = 200.0  # s


def sailed(grade, ppm, run):
    """A ship's log, whose IMU's clock runs fast by so much, its start, its receiver .1 s late, and the true motion."""
    spec, rng = imu_spec(grade), np.random.default_rng([5, run, 8])
    motion = ship(rng, LONG + 60.0)
    record = simulate(ideal_log(motion, rate=50.0, duration=LONG), imu=spec, seed=5, run=run, kind="rates").record
    start = drawn_start(motion, spec, rng)
    gnss = received(motion, LONG, 1.0, rng).record
    rates = (x / record.steps[:, None] if record.kind != "rates" else x for x in (record.gyro, record.accel))
    stretched = ImuRecord(record.time * (1.0 + 1e-6 * ppm), *rates, "rates", "ship")
    return stretched, start, replace(gnss, time=gnss.time + 0.1), motion, spec


def off(track, motion, ppm):
    """(K, 9) errors of a track over its sigmas."""
    true = Track.along(motion.states(track.time / (1.0 + 1e-6 * ppm)))
    return track.errors_against(true) / track.sigma[:, :9]


@pytest.mark.slow
@pytest.mark.parametrize("grade", ["industrial", "consumer", "tactical"])
@pytest.mark.parametrize("ppm", [0.0, 1e4, -1e4])
def test_a_ship_of_200_s_whose_clock_is_off_by_one_percent(grade, ppm):
    """It was 10 sigmas of place off in silence, for 4400 of its prior stood against what 200 s of a swell show."""
    record, start, gnss, motion, spec = sailed(grade, ppm, 1)
    result = navigate(record, start, aid=Gnss(gnss), imu=spec, deflection=STRAIGHT)
    assert result.status == "navigated"
    rows = np.array([np.argmin(np.abs(result.time - part * result.time[-1])) for part in (0.25, 0.5, 0.75, 1.0)])
    errors = off(result.track[rows], motion, ppm)
    assert (
        np.abs(errors[:, 3 if grade == "tactical" else 0 :]).max() < 4.0
    )  # its angles are 1 % of a turn too large, too
    said = {item.key for item in result.evidence if item.key.startswith("clock.")}
    assert said == ({"clock.runs_fast"} if ppm > 0.0 else {"clock.runs_slow"} if ppm < 0.0 else set())
    rate = result.estimated()["GNSS lag"] if ppm else None
    assert rate is None or abs(rate["value"][1] + 1e-6 * ppm) < 4.0 * rate["sigma"][1] < 0.01


@pytest.mark.slow
@pytest.mark.parametrize("run", range(3))
def test_aligned_on_a_clock_that_is_off_by_one_percent(run):
    record, _, gnss, motion, spec = sailed("industrial", -1e4, run)
    answer = align(record, None, aid=Gnss(gnss), imu=spec)
    assert answer.status in ("aligned", "level_only")
    error = off(answer.moving.track[-1:], motion, -1e4)
    assert np.abs(error).max() < 4.0, error
    assert "clock.runs_slow" in {item.key for item in answer.evidence}


@pytest.mark.slow
@pytest.mark.parametrize("grade", ["consumer", "industrial"])
def test_a_receiver_that_is_late_all_the_time_is_on_no_other_clock(grade):
    """By 1.5 s, whatever is usual: rates of half to one per cent come near it. The delay was up to 26 of its sigmas off."""
    record, start, gnss, motion, spec = sailed(grade, 0.0, 2)
    late = replace(gnss, time=gnss.time + 1.4)
    result = navigate(record, start, aid=Gnss(late), imu=spec, deflection=STRAIGHT)
    assert result.status == "navigated"
    assert np.abs(off(result.track[-1:], motion, 0.0)).max() < 4.0
    assert not any(item.key.startswith("clock.") for item in result.evidence)
    assert abs(result.estimated()["GNSS lag"]["value"][0] - 1.5) < 0.2


def test_a_delay_is_counted_from_that_of_the_same_moment():
    """A mounting whose delay is that of the end has another latency than that of the beginning, and is as late."""
    layout, still, sensors = Layout(("GNSS lag",), ((0.2, QUARTZ),)), np.zeros((2, 3)), np.zeros((2, 17))
    sensors[:, 15] = 0.02
    P = np.tile(np.eye(17), (2, 1, 1))
    track = Track(np.array([0.0, 100.0]), np.tile(np.eye(3), (2, 1, 1)), still, still, sensors, P, layout, ())
    given = Mounting(latency=0.1, drift=Drift(1e-3, 1e-4, 0.0))
    at_end = replace(given, latency=0.2, drift=Drift(1e-3, 1e-4, 100.0))
    np.testing.assert_allclose(counted_between(track, "GNSS", at_end, given).sensors[:, 15], 0.02, atol=1e-12)


def test_a_ratio_counts_the_seconds_of_each_clock():
    """A receiver's velocities and sigmas in two units are one log: the ratio of its likelihoods is one."""
    n, at, one, r = 200, np.arange(200.0), np.ones(200, dtype=bool), 0.01
    e = 0.05 * np.random.default_rng(1).standard_normal((n, 3))

    def track(scale, stamp):
        sigma = np.full((n, 3), 0.05 * scale)
        nis = np.sum((e / 0.05) ** 2, axis=1)
        said = Residuals("GNSS velocity", stamp, scale * e, sigma, nis, one, 0, stamp, np.zeros(n, dtype=bool))
        C, P = np.tile(np.eye(3), (n, 1, 1)), np.tile(np.eye(15), (n, 1, 1))
        return Track(at, C, 0.0 * e, 0.0 * e, np.zeros((n, 15)), P, Layout(), (said,))

    quartz, apart = Mounting(latency=0.1), Mounting(latency=0.1, drift=Drift(r, 0.0, 0.0))
    first, other = track(1.0, at - quartz.late_at(at)), track(1.0 / (1.0 - r), at - apart.late_at(at))
    assert clock_ratio(first, other, quartz, apart) == pytest.approx(0.0, abs=1e-6)
    assert clock_ratio(first, track(1.0, at - apart.late_at(at)), quartz, apart) == pytest.approx(
        1200.0 * -math.log(1.0 - r)
    )


def test_velocities_by_the_imus_seconds_have_their_noise_by_them_too():
    """Else a clock that runs slow explains receivers that are better than they say: 3 % was found in circles."""
    n, r = 20, 0.03
    at, rows = np.arange(float(n)), np.full((n, 3), 0.05)
    record = GnssRecord(at, np.full(n, 0.7), np.full(n, 0.2), np.zeros(n), v_n=10.0 * rows, velocity_sigma=rows)
    (by_own,) = (s for s in from_gnss(record, Mounting()) if s.name == "GNSS velocity")
    (by_imu,) = (s for s in from_gnss(record, Mounting(drift=Drift(r, 0.0, 0.0))) if s.name == "GNSS velocity")
    np.testing.assert_allclose(by_imu.sigma / by_imu.measured, by_own.sigma / by_own.measured, rtol=1e-12)
    np.testing.assert_allclose(by_imu.sigma, by_own.sigma / (1.0 - r), rtol=1e-12)


@pytest.mark.parametrize("velocities", [True, False])
def test_a_coarse_alignment_takes_a_rate_that_is_known(velocities):
    """A log by two clocks is the same by one; of 1 %, 2 s at the end, it was taken for none."""
    record, _, gnss, *_ = sailed("navigation", 0.0, 1)
    rate = 0.01
    gnss = gnss if velocities else replace(gnss, v_n=None, velocity_sigma=None)
    apart = replace(gnss, time=gnss.time / (1.0 - rate))
    if velocities:
        apart = replace(apart, v_n=gnss.v_n * (1.0 - rate))
    one = gnss_alignment(record, gnss).C_n0_i
    two = gnss_alignment(record, apart, Mounting(drift=Drift(rate, 0.0, 0.0))).C_n0_i
    np.testing.assert_allclose(two, one, atol=1e-9)
    assert np.abs(gnss_alignment(record, apart).C_n0_i - one).max() > 1e-3


def test_a_poorer_imu_that_loses_its_track_is_no_explanation():
    """An hour with clocks 500 ppm apart was refused for one: it rejected nearly all rows, and those that it took fitted."""
    n = 200

    def track(taken):
        at, used = np.arange(float(n)), np.arange(n) >= n - taken
        e = (
            0.05
            * np.random.default_rng(2).standard_normal((n, 3))
            * np.where(used, 0.1 if taken < n else 1.0, 100.0)[:, None]
        )
        sigma, nis = np.full((n, 3), 0.05), np.sum((e / 0.05) ** 2, axis=1)
        said = Residuals("GNSS velocity", at, e, sigma, nis, used, int(n - taken), at, np.zeros(n, dtype=bool))
        C, P = np.tile(np.eye(3), (n, 1, 1)), np.tile(np.eye(15), (n, 1, 1))
        return Track(at, C, 0.0 * e, 0.0 * e, np.zeros((n, 15)), P, Layout(), (said,))

    sound, lost = track(n), track(20)
    assert likelihood_ratio(sound.residuals, lost.residuals) > 10.0
    assert poorer_evidence(lambda spec: lost, sound, imu_spec("consumer")) == []
