"""A loop that stops and goes on: chunks of 1, 7 and 1000 samples give the bits of one batch."""

from dataclasses import replace

import numpy as np
import pytest

from tests.estimate.test_run import SIGMA, SPEC, flight, gnss, start_at
from truenorth.aiding.source import Aiding, state
from truenorth.core.errors import UsageError
from truenorth.errors.group import Group
from truenorth.errors.model import InsModel
from truenorth.estimate.events import Setting
from truenorth.estimate.run import begin, go_on, with_states
from truenorth.simulation import simulate
from truenorth.state.layout import STATES
from truenorth.strapdown.increments import ImuRows

SECONDS, RATE = 40.0, 50.0


def in_chunks(setting, start, record, size, rows):
    """All outputs and residuals of a loop fed with so many samples at a time, and with measurements as their time comes."""
    bare = tuple(replace(source, time=[], measured=np.zeros((0, 3)), sigma=np.zeros((0, 3))) for source in rows)
    setting = replace(setting, sources=bare)
    state = begin(setting, start, 0.0, record.interval)
    tracks = []
    for first in range(0, len(record), size):
        part = slice(first, first + size)
        chunk = ImuRows(record.time[part], record.gyro[part], record.accel[part], record.kind)
        before = record.time[first - 1] if first else -1.0
        new = []
        for source in rows:
            due = (source.time > before) & (source.time <= chunk.time[-1])
            new.append(replace(source, time=source.time[due], measured=source.measured[due], sigma=source.sigma[due]))
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


@pytest.mark.parametrize("retimed", [False, True])
def test_chunks_give_the_bits_of_one_batch(drive, retimed):
    """With a vertical loop, a lag, a pair of second order and measurements amid samples; the re-timed ones too."""
    record, start, fixes, baro = drive
    sources = (replace(fixes, retimed=retimed), baro)
    sway = Group("sway", [0.1], frequency=0.7, damping=0.1)
    model = with_states(replace(InsModel.from_spec(SPEC), groups=(*InsModel.from_spec(SPEC).groups, sway)), sources)
    setting = Setting(model, sources, stride=10, every=3)
    _, batch = go_on(setting, begin(setting, start, 0.0, record.interval), record, last=True)
    for size in (1000, 7, 1):
        tracks = in_chunks(setting, start, record, size, sources)
        for name in ("time", "C_nb", "v_n", "position", "sensors", "P"):
            np.testing.assert_array_equal(joined(tracks, name), getattr(batch, name), err_msg=f"{name}, {size}")
        for number, whole in enumerate(batch.residuals):
            parts = [track.residuals[number] for track in tracks]
            for name in ("time", "innovation", "nis", "used"):
                np.testing.assert_array_equal(joined(parts, name), getattr(whole, name))


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
