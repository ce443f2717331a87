"""Each kind of alignment, its rows in chunks: the last answer is the batch's to the bit."""

import functools
import math
from dataclasses import replace

import numpy as np
import pytest

import truenorth as tn
from truenorth.core.attitude import dcm_from_euler
from truenorth.core.errors import AlignmentError, UsageError
from truenorth.live import (
    Aligner,
    AttitudeFeed,
    GnssFeed,
    IndexerFeed,
    MagnetometerFeed,
    MasterFeed,
    OdometerFeed,
    VelocityFeed,
)
from truenorth.live.aid_sources import Replayed
from truenorth.live.known_feeds import FEEDS
from truenorth.records import EncoderRecord, GnssRecord, MasterRecord
from truenorth.records.magnetometer import MagnetometerRecord
from truenorth.records.specs import imu_spec
from truenorth.simulation import Axis, Indexed, Indexer, Spin, rest, simulate, steps
from truenorth.simulation.scenario import read_scenario

PLACE = tn.Position.from_degrees(45.0, 10.0)
STRAIGHT = replace(  # no states of its gyros' axes: with them, the filter with a magnetometer is of a size of its own
    imu_spec("tactical"), gyro_scale_factor=0.0, gyro_scale_factor_asymmetry=0.0, gyro_misalignment=0.0
)
FIELD = np.array([1.5e-6, 22e-6, -42e-6])
SEAT = dcm_from_euler(0.02, -0.01, 0.03)


def still():
    sim = simulate(rest(PLACE, 0.7, 0.02, -0.03), rate=25.0, duration=60.0, imu=imu_spec("navigation"), seed=3)
    return sim.record, PLACE, "navigation", [], []


def made(name, seconds, rate, imu, **more):
    content = (
        read_scenario(name).to_mapping() | {"duration": f"{seconds:g} s", "rate": f"{rate:g} Hz", "imu": imu} | more
    )
    scenario = read_scenario(content)
    sim = scenario.simulate(seed=4)
    place = tn.Position(float(sim.truth.lat[0]), float(sim.truth.lon[0]), float(sim.truth.alt[0]))
    return sim, scenario.simulate_aiding(seed=4), place


def swaying():
    sim, _, place = made("quay", 90.0, 25.0, "navigation")
    return sim.record, place, "navigation", [], []


def indexed():
    spin = (Axis("z", Spin(math.radians(18.0))), Axis("x", Spin(math.radians(7.0))))
    sim = simulate(
        Indexed(rest(PLACE, 0.7, 0.05, -0.03), Indexer(spin)),
        rate=25.0,
        duration=80.0,
        imu=imu_spec("navigation"),
        seed=5,
    )
    return sim.record


def rotary():
    record = indexed()
    time = np.arange(0.0, 80.21, 0.1)
    encoder = EncoderRecord(time, np.radians(np.column_stack([18.0 * time, 7.0 * time])))
    return record, PLACE, "navigation", [IndexerFeed()], [tn.Indexer(encoder)]


def rotary_by_gyros():
    return indexed(), PLACE, "navigation", [tn.Indexer(None)], [tn.Indexer(None)]


def turntable():
    turn = steps([(0, math.pi)], dwell=60.0, duration=200.0, rate=math.radians(18.0))[0]
    table = Indexed(rest(PLACE, 0.6, 0.003, -0.002), Indexer((Axis("z", turn),)))
    record = simulate(table, imu=imu_spec("tactical"), rate=20.0, duration=200.0, seed=1).record
    return record, PLACE, "tactical", [tn.Positions()], [tn.Positions()]


@functools.cache
def drive():
    gnss = {"rate": "2 Hz", "position_noise": "0.5 m", "velocity_noise": "0.05 m/s"}
    return made("van", 70.0, 25.0, "tactical", gnss=gnss)


def odometer():
    sim, aiding, place = drive()
    aid = tn.Odometer(aiding["odometer"].record)
    return sim.record, place, "tactical", [OdometerFeed()], [aid]


def gnss():
    sim, aiding, _ = drive()
    return sim.record, None, "tactical", [GnssFeed()], [tn.Gnss(aiding["gnss"].record)]


def two_antennas():
    sim, aiding, _ = drive()
    record = aiding["gnss"].record
    C = sim.motion.states(record.time).C_nb
    heading = np.arctan2(C[:, 0, 1], C[:, 1, 1]) + np.radians(0.3) * np.random.default_rng(2).standard_normal(
        len(record)
    )
    turned = replace(record, heading=heading, heading_sigma=np.full(len(record), np.radians(0.3)))
    return sim.record, None, "tactical", [GnssFeed()], [tn.Gnss(turned)]


def magnetometer():
    sim, aiding, _ = drive()
    time = np.arange(0.0, 70.0, 0.2)
    C = sim.motion.states(time).C_nb
    seen = np.einsum("kji,kj->ki", C, np.tile(FIELD, (len(time), 1))) + 2.5e-7 * np.random.default_rng(
        1
    ).standard_normal((len(time), 3))
    fixes = aiding["gnss"].record
    slow = GnssRecord(fixes.time, fixes.lat, fixes.lon, fixes.alt)  # without velocities, heading is worth something
    aids = [tn.Gnss(slow), tn.Magnetometer(MagnetometerRecord(time, seen), FIELD)]
    return sim.record, None, STRAIGHT, [GnssFeed(), MagnetometerFeed(FIELD)], aids


def attitude():
    sim, aiding, _ = drive()
    time = np.arange(0.0, 70.0, 0.5)
    record = MasterRecord(time, sim.motion.states(time).C_nb @ SEAT.T)
    mounting = tn.Mounting(C_mb=SEAT)
    aids = [tn.Gnss(aiding["gnss"].record), tn.Attitude(record, 0.003, mounting=mounting)]
    return sim.record, None, "tactical", [GnssFeed(), AttitudeFeed(0.003, mounting=mounting)], aids


def velocity():
    sim, aiding, place = made("auv", 70.0, 25.0, "tactical")
    return sim.record, place, "tactical", [VelocityFeed()], [tn.VelocityLog(aiding["velocity_log"].record)]


def master():
    content = read_scenario("transfer_flat_turn").to_mapping()
    content["motion"]["legs"][0]["duration"] = "20 s"
    legs = {**content["motion"], "legs": content["motion"]["legs"][:2]}
    sim, aiding, place = made("transfer_flat_turn", 45.0, 25.0, "tactical", motion=legs)
    record = aiding["master"].record
    sigma = np.tile(np.radians([0.05, 0.01, 0.01]), (len(record), 1))
    known = replace(record, attitude_sigma=sigma, velocity_sigma=np.full((len(record), 3), 0.02))
    return sim.record, place, "tactical", [MasterFeed()], [tn.Master(known)]


KINDS = {
    kind.__name__: functools.cache(kind)
    for kind in (
        still, swaying, rotary, rotary_by_gyros, turntable, odometer, gnss, two_antennas, magnetometer, attitude, velocity, master
    )
}  # fmt: skip


@functools.cache
def batch(kind):
    record, place, imu, _, aids = KINDS[kind]()
    return tn.align(record, place, imu, aid=aids)


def replayed(aligner, record, aids, chunk):
    """Rows of the aids in step with those of the IMU."""
    logs = [
        Replayed(aligner.feeds[aid.key].rows_of(aid.record), aligner.feeds[aid.key].add) for aid in aids if aid.record
    ]
    for first in range(0, len(record), chunk):
        part = slice(first, first + chunk)
        aligner.push(record.time[part], record.gyro[part], record.accel[part])
        for log in logs:
            log.advance(record.time[part][-1])


SOME = [13, pytest.param(1, marks=pytest.mark.slow), pytest.param(1000, marks=pytest.mark.slow)]


@pytest.mark.slow
@pytest.mark.parametrize("chunk", SOME)
@pytest.mark.parametrize("kind", list(KINDS))
def test_the_last_answer_is_the_batch_to_the_bit(kind, chunk):
    record, place, imu, feeds, aids = KINDS[kind]()
    for feed in feeds:
        if isinstance(feed, tuple(FEEDS.values())):
            feed.clear()
    with Aligner(place, imu, aid=feeds, kind=record.kind) as aligner:
        replayed(aligner, record, aids, chunk)
        found, answer = aligner.finish(), aligner.answer
    cut = [replace(aid, record=aid.record.between(None, record.time[-1] + 1e-9)) if aid.record else aid for aid in aids]
    whole = batch(kind) if all(a.record is None or len(a.record) == len(b.record) for a, b in zip(cut, aids)) else None
    whole = whole or tn.align(record, place, imu, aid=cut)
    assert found.method == whole.method
    assert found.status == whole.status
    assert np.array_equal(found.C_nb, whole.C_nb)
    assert np.array_equal(found.phi_covariance, whole.phi_covariance)
    assert answer is not None
    assert answer.counts.left_out == 0


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["rotary", "turntable"])
def test_an_imu_that_is_turned_has_the_attitude_of_its_last_solution_and_never_leaves(kind):
    record, place, imu, feeds, aids = KINDS[kind]()
    for feed in feeds:
        if isinstance(feed, IndexerFeed):
            feed.clear()
    with Aligner(place, imu, aid=feeds, kind=record.kind, background=False) as aligner:
        replayed(aligner, record, aids, 50)
        answer = aligner.answer
        if kind == "rotary":
            with pytest.raises(UsageError, match="indexer"):
                aligner.navigator()
    assert answer.time == answer.solution.time
    assert answer.left is None
    assert answer.status == "aligned"
    assert answer.time > record.time[-1] - 0.15 * record.duration


def test_an_indexer_of_which_nothing_comes_is_said():
    record = indexed()[:2000]
    with Aligner(PLACE, "navigation", aid=[IndexerFeed()], kind=record.kind, background=False) as aligner:
        aligner.push(record.time, record.gyro, record.accel)
        assert aligner.answer is None
        with pytest.raises(AlignmentError, match="encoder"):
            aligner.finish()


@pytest.mark.parametrize(
    "kind", [kind for kind in KINDS if KINDS[kind].__wrapped__ not in (still, swaying, rotary_by_gyros, turntable)]
)
def test_a_feed_holds_all_that_a_record_says(kind):
    _, _, _, feeds, aids = KINDS[kind]()
    for feed, aid in zip(feeds, aids, strict=True):
        again = feed.aid_of(feed.rows_of(aid.record)).record
        for name, values in vars(aid.record).items():
            if isinstance(values, np.ndarray):
                np.testing.assert_array_equal(getattr(again, name), values, err_msg=name)
