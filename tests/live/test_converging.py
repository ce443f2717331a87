"""Live: fixes of a receiver that starts up, poor at first and off by the same for seconds; rows say how poor they are."""

import numpy as np
import pytest

from tests.navigation.test_converging import SAME, TIME, converging
from tests.navigation.test_navigate import SPEC, drive
from truenorth.aiding.aids import Gnss
from truenorth.live import GnssFeed, Navigator
from truenorth.live.lasting import LOOKS
from truenorth.navigation import Mounting
from truenorth.quality.converging import convergence

__all__ = ["drive"]  # the fixture of a car that turns twice


def test_rows_that_come_one_by_one_are_those_of_the_log(drive):
    motion, _, _ = drive
    (source,) = Gnss(converging(motion, SAME, 0), Mounting()).sources("gnss")
    found = convergence(source)
    assert found is not None
    whole = found.of(source)
    for k in range(0, len(TIME), 40):
        (row,) = Gnss(converging(motion, SAME, 0)[k : k + 2], Mounting()).sources("gnss")
        assert np.array_equal(found.of(row).measured[:, 3:], whole.measured[k : k + 2, 3:])


@pytest.mark.slow
def test_velocity_of_a_running_answer(drive):
    """Fixes that converge were white noise to it, up to the end."""
    motion, record, start = drive
    worst = []
    for seed in range(6):
        fixes, feed = converging(motion, SAME, seed), GnssFeed(mounting=Mounting())
        run = Navigator(start, SPEC, feeds=[feed], kind=record.kind)
        for begin in np.arange(start.time, TIME[-1], 1.0):
            rows = (record.time > begin) & (record.time <= begin + 1.0)
            run.push(record.time[rows], record.gyro[rows], record.accel[rows])
            k = np.flatnonzero((fixes.time > begin - 0.1) & (fixes.time <= begin + 0.9))
            feed.push(fixes.time[k], fixes.lat[k], fixes.lon[k], fixes.alt[k], position_sigma=fixes.position_sigma[k])
            answer = run.answer
            if answer is not None and answer.time > TIME[0] + LOOKS[0] + 2.0:
                assert answer.status == "navigated"
                off = answer.motion.v_n - motion.states(answer.time).v_n
                worst.append(np.abs(off / answer.motion.v_sigma).max())
    assert max(worst) < 4.0
