"""A loop that stops and goes on: chunks of 1, 7 and 1000 samples give the bits of one batch."""

from dataclasses import replace

import numpy as np
import pytest

from tests.estimate.test_run import SIGMA, SPEC, flight, gnss, start_at
from truenorth.aiding.source import Aiding, state
from truenorth.alignment.transfer_filter import LONGEST_STEP, Assumed, Matching, master_aiding, transfer_filter
from truenorth.core.attitude import dcm_from_rotation_vector
from truenorth.core.errors import UsageError
from truenorth.core.position import Position
from truenorth.errors.group import Group
from truenorth.errors.master import TransferModel
from truenorth.errors.model import InsModel
from truenorth.estimate.events import Setting
from truenorth.estimate.memory import EITHER, OVER_GROUND
from truenorth.estimate.run import begin, go_on, with_states
from truenorth.simulation import MasterSpec, simulate, simulate_sensor
from truenorth.simulation.course import course
from truenorth.simulation.manoeuvres import s_turn, straight
from truenorth.state.layout import STATES
from truenorth.state.state import Start, State
from truenorth.strapdown.increments import ImuRows

SECONDS, RATE = 24.0, 50.0


def some(source, rows):
    """Some of its measurements."""
    output = np.broadcast_to(source.output, len(source.time))[rows]
    return replace(
        source, time=source.time[rows], measured=source.measured[rows], sigma=source.sigma[rows], output=output
    )


def in_chunks(setting, start, record, size, rows, prior=None, ahead=0.0):
    """All outputs and residuals of a loop fed with so many samples at a time, and with measurements as their time comes."""
    setting = replace(setting, sources=tuple(some(source, slice(0)) for source in rows))
    state = begin(setting, start, start.time, record.interval, prior)
    tracks = []
    for first in range(0, len(record), size):
        part = slice(first, first + size)
        chunk = ImuRows(record.time[part], record.gyro[part], record.accel[part], record.kind)
        before = record.time[first - 1] + ahead if first else -np.inf
        new = [some(source, (source.time > before) & (source.time <= chunk.time[-1] + ahead)) for source in rows]
        state, track = go_on(setting, state, chunk, new, last=first + size >= len(record))
        tracks.append(track)
    return tracks


def joined(tracks, name):
    return np.concatenate([getattr(track, name) for track in tracks])


@pytest.fixture(scope="module")
def drive():
    motion = flight(60.0, SECONDS)
    record = simulate(motion, rate=RATE, duration=SECONDS, imu=SPEC, seed=7).record
    rng = np.random.default_rng(4)
    fixes = gnss(motion, SECONDS - 1.0, rng, arm=(2.0, 5.0, 1.0), offset=-0.05)
    states = state("GNSS", "lever arm", [3.0, 6.0, 3.0]) | state("GNSS", "lag", 0.2)
    time = np.arange(0.5, SECONDS, 0.5)
    height = np.full((len(time), 3), np.nan)
    height[:, 0] = motion.states(time).alt + rng.standard_normal(len(time))
    baro = Aiding("barometer", "height", time, height, np.ones((len(time), 3)), loop=20.0)
    start = start_at(motion, SIGMA * rng.standard_normal(STATES))
    return record, start, replace(fixes, states=states), baro


def assert_same(tracks, batch, size):
    for name in ("time", "C_nb", "v_n", "position", "sensors", "P"):
        np.testing.assert_array_equal(joined(tracks, name), getattr(batch, name), err_msg=f"{name}, {size}")
    for number, whole in enumerate(batch.residuals):
        parts = [track.residuals[number] for track in tracks]
        for name in ("time", "innovation", "nis", "used"):
            np.testing.assert_array_equal(joined(parts, name), getattr(whole, name))


@pytest.mark.parametrize("retimed", [True, pytest.param(False, marks=pytest.mark.slow)])
def test_chunks_give_the_bits_of_one_batch(drive, retimed):
    """With a vertical loop, a lag, a pair of second order and measurements amid samples; the re-timed ones too."""
    record, start, fixes, baro = drive
    sources = (replace(fixes, retimed=retimed), baro)
    sway = Group("sway", [0.1], frequency=0.7, damping=0.1)
    model = with_states(replace(InsModel.from_spec(SPEC), groups=(*InsModel.from_spec(SPEC).groups, sway)), sources)
    setting = Setting(model, sources, stride=10, every=3)
    _, batch = go_on(setting, begin(setting, start, 0.0, record.interval), record, last=True)
    for size in (1000, 7, 1):
        assert_same(in_chunks(setting, start, record, size, sources), batch, size)


@pytest.mark.slow
@pytest.mark.parametrize("fed_back", [OVER_GROUND, EITHER])
def test_chunks_of_invariant_errors_give_the_bits_of_one_batch(drive, fed_back):
    """As alignment on the move with an odometer runs the loop: from a heading 60 deg off."""
    record, start, fixes, _ = drive
    turn = dcm_from_rotation_vector([0.0, 0.0, np.radians(60.0)])
    P = start.P.copy()
    P[2, 2] = 1.0
    start = replace(start, C_nb=turn @ start.C_nb, v_n=turn @ start.v_n, P=P)
    setting = Setting(with_states(InsModel.from_spec(SPEC), [fixes]), (fixes,), stride=10, every=3, invariant=fed_back)
    _, batch = go_on(setting, begin(setting, start, 0.0, record.interval), record, last=True)
    for size in (1000, 7, 1):
        assert_same(in_chunks(setting, start, record, size, (fixes,)), batch, size)


@pytest.mark.slow
def test_chunks_of_transfer_alignment_give_the_bits_of_one_batch():
    """A master's place, velocity and attitude, re-timed by a delay that is being found; mounting, arm and flexure."""
    legs = [*straight(5.0), *s_turn(0.4, 0.08), *straight(SECONDS)]
    flight = course(Position(0.8, 0.2, 500.0), legs, heading=0.5, speed=60.0)
    slave = simulate(flight, rate=RATE, duration=SECONDS, imu=SPEC, seed=7).record
    spec = MasterSpec(latency=0.03, lever_arm=(0.5, 1.0, -0.3), mounting=(0.02, -0.01, 0.015), velocity_noise=0.05)
    master = simulate_sensor(flight, spec, duration=SECONDS, seed=3).record
    model = TransferModel(1e-6, 1e-4, mounting=True, flexure_sigma=(1e-3, 1e-3, 1e-3))
    at = flight.states(slave.time[:1] - slave.steps[0])
    P = model.prior(0.1, 1e-3, 1e-2, 1e-5, tau=0.05, arm=1.0, mounting=0.05, C_nb=at.C_nb[0])
    start = Start.of(State.at(at.C_nb[0], at.lat[0], at.lon[0], at.alt[0], at.v_n[0]), P)
    sources = tuple(master_aiding(master, model, Assumed(), Matching(0.05, 1e-3, gate=1e-6), None, slave))
    batch = transfer_filter(slave, master, model, start, Matching(0.05, 1e-3, gate=1e-6))
    setting = Setting(model.ins, sources, stride=round(LONGEST_STEP * RATE), every=0)
    assert len(batch.time) > 10 * SECONDS - 2
    for size in (1000, 7, 1):
        tracks = in_chunks(setting, start, slave, size, sources, (P, np.zeros(model.states)), ahead=0.2)
        assert_same(tracks, batch, size)


def test_a_state_is_left_as_it_was(drive):
    record, start, fixes, _ = drive
    setting = Setting(with_states(InsModel.from_spec(SPEC), [fixes]), (fixes,), stride=10)
    first, _ = go_on(setting, begin(setting, start, 0.0, 1.0 / RATE), record[:500])
    before = [a.copy() for a in (first.memory.s, first.memory.P)]
    once, again = (go_on(setting, first, record[500:], last=True)[1] for _ in range(2))
    np.testing.assert_array_equal(once.P, again.P)
    for a, b in zip(before, (first.memory.s, first.memory.P), strict=True):
        np.testing.assert_array_equal(a, b)


def test_what_it_cannot_take_is_refused(drive):
    record, start, fixes, baro = drive
    setting = Setting(with_states(InsModel.from_spec(SPEC), [fixes]), (fixes,), stride=10)
    state, _ = go_on(setting, begin(setting, start, 0.0, 1.0 / RATE), record[:100], last=True)
    with pytest.raises(UsageError, match="at its end"):
        go_on(setting, state, record[100:])
    with pytest.raises(UsageError, match="no source of this loop"):
        go_on(setting, begin(setting, start, 0.0, 1.0 / RATE), record[:100], [baro])
