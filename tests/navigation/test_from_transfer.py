"""From a transfer to navigation: what it knows of the slave's axes goes on, tied to the level, however the slave sits."""

from dataclasses import replace

import numpy as np
import pytest

import truenorth
from benchmarks.honesty.transfer import aircraft
from truenorth.core.attitude import dcm_from_euler, misalignment
from truenorth.errors.axes import standing
from truenorth.navigation.start import force_at_rest, read_start, start_from_alignment
from truenorth.records import MasterRecord
from truenorth.records.specs import imu_spec
from truenorth.simulation import simulate, simulate_sensor
from truenorth.simulation.gnss import GnssSpec
from truenorth.state.layout import ACCEL_AXES, DP, GYRO_AXES, PHI, STATES

ON_ITS_SIDE = dcm_from_euler(0.0, 0.0, 0.5 * np.pi)  # slave to master axes
UNTIL, LENGTH = 60.0, 90.0  # s


@pytest.fixture(scope="module")
def flight():
    """An aircraft in turns, its slave on its side: motion, log, receiver, the transfer of the first part."""
    way, rng = aircraft(), np.random.default_rng(5)
    slave = simulate(way, rate=50.0, duration=LENGTH, seed=71, imu=imu_spec("consumer")).record
    slave = replace(slave, gyro=slave.gyro @ ON_ITS_SIDE, accel=slave.accel @ ON_ITS_SIDE)
    t = np.arange(0.5, UNTIL, 0.1)
    s = way.states(t)
    master = MasterRecord(
        time=t,
        C_nb=s.C_nb,
        v_n=s.v_n + 0.02 * rng.standard_normal(s.v_n.shape),
        lat=s.lat,
        lon=s.lon,
        alt=s.alt,
        source="master",
    )
    gnss = simulate_sensor(way, GnssSpec(position_noise=1.0, velocity_noise=0.05), duration=LENGTH, seed=71).record
    seat = truenorth.Mounting(C_mb=ON_ITS_SIDE, angle_sigma=0.01, lever_arm_sigma=0.5, latency_sigma=0.02)
    answer = truenorth.align(slave.between(None, UNTIL), None, "consumer", aid=[truenorth.Master(master, seat)])
    return way, slave, gnss, answer


def test_the_start_is_the_transfers_end(flight, tmp_path):
    """Attitude, biases, scale factors and misalignments, about the force as the slave sits: the same from its folder."""
    _, slave, gnss, answer = flight
    assert set(answer.transfer.known) == {GYRO_AXES, ACCEL_AXES}
    own = start_from_alignment(answer)
    answer.save(tmp_path)
    read, *_ = read_start(tmp_path)
    for start in (own, read):
        np.testing.assert_allclose(force_at_rest(start), standing(ON_ITS_SIDE))
        for name, values in answer.transfer.known.items():
            np.testing.assert_allclose(start.known[name], values)
    assert np.all(np.abs(read.P - own.P) <= 1e-8 * np.sqrt(np.outer(np.diag(own.P), np.diag(own.P))))
    track = truenorth.navigate(slave, answer, aid=[truenorth.Gnss(gnss)], check_clocks=False).track
    here = [
        *range(DP.start),
        *(k for name in own.known for k in range(track.layout.states)[track.layout.slice_of(name)]),
    ]
    there = [*range(DP.start), *range(STATES, len(own.P))]
    then = own.P[np.ix_(there, there)]
    np.testing.assert_allclose(track.P[0][np.ix_(here, here)], then, rtol=1e-6, atol=1e-9 * np.abs(then).max())


def test_what_a_transfer_has_found_of_the_axes_is_not_sought_again(flight):
    """A start without them loses attitude to axes that the transfer had found."""
    way, slave, gnss, answer = flight
    transfer = answer.transfer
    bare = replace(answer, transfer=replace(transfer, P=transfer.P[:STATES, :STATES], known={}))
    kept, lost = (
        truenorth.navigate(slave, start, aid=[truenorth.Gnss(gnss)], check_clocks=False).track
        for start in (answer, bare)
    )
    assert np.all(kept.sigma[-1, PHI] < 0.9 * lost.sigma[-1, PHI])
    off = misalignment(kept.C_nb[-1], way.states(kept.time[-1:]).C_nb[0] @ ON_ITS_SIDE)
    assert np.abs(off / kept.sigma[-1, PHI]).max() < 3.5
