"""The motion of a base is fitted about an attitude that is right: what else is in it is attitude's error."""

from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.honesty.foreign_rows import indexed, moored
from truenorth.alignment import motion_filter, rotary
from truenorth.campaign.fault_benches import BENCHES
from truenorth.errors.staying import PHI

ROWS = 800


class Counting(motion_filter.MotionFilter):
    """A filter whose passes find attitude off by so many sigmas, innovations of such a size and a likelihood; counts the fits."""

    def __init__(self, *passes):
        self.found, self.passes, self.fits, self.motion, self.count = iter(passes), 0, 1, (), 0

    def fit(self, residual, guesses):
        self.count += 1
        return guesses

    def filtered(self):
        off, size, likely = next(self.found)
        end = np.zeros(PHI.stop)
        end[PHI.start] = off
        estimates = SimpleNamespace(
            nis=np.full(ROWS // 3, 3.0 * size), nis_rows=np.full(ROWS // 3, 3), log_likelihood=0.5 * likely
        )
        return SimpleNamespace(end=end, P=np.eye(PHI.stop), estimates=estimates)


@pytest.mark.parametrize(
    ("passes", "fits"),
    [
        ([(0.9, 0.5, 0.0), (0.5, 1.0, 100.0), (0.1, 1.0, 101.0)], 1),  # a sound log
        ([(9.0, 1.0, 0.0), (4.0, 1.0, 1.0), (0.5, 1.0, 2.0), (0.1, 1.0, 2.0)], 2),  # attitude moves
        ([(9.0, 0.4, 0.0), (0.4, 0.4, 1000.0), (0.1, 1.0, 1600.0), (0.0, 1.0, 1600.0)], 2),  # loud, and a fit gains
        ([(9.0, 0.4, 0.0), (0.4, 0.4, 1000.0), (0.1, 0.4, 1001.0), (0.0, 0.4, 1001.0)], 2),  # loud, and no fit gains
    ],
)
def test_the_motion_is_fitted_anew_while_it_explains_attitude(passes, fits):
    filter_ = Counting(*passes)
    for _ in passes:
        filter_(SimpleNamespace(z=None))
    assert filter_.count == fits


def test_a_stale_motion_is_no_end_of_the_passes():
    filter_ = Counting((0.001, 0.4, 0.0), (0.001, 1.0, 500.0))
    assert filter_.moved(filter_(SimpleNamespace(z=None))) == motion_filter.STALE
    assert filter_.moved(filter_(SimpleNamespace(z=None))) == pytest.approx(0.001)


def test_fits_have_an_end():
    filter_ = Counting(*[(9.0, 1.0, 0.0)] * 40)
    for _ in range(40):
        filter_(SimpleNamespace(z=None))
    assert filter_.count == motion_filter.MOST_FITS


@pytest.mark.slow
@pytest.mark.parametrize("run", [0, 7])
def test_innovations_of_an_indexer_have_their_size(run, monkeypatch):
    """About windowed fits alone they had .42 and .59 of it: the motion of a ship was up to twenty times too large."""
    kept, made = [], rotary.answer_of

    def spied(task, fine, *more, **said):
        kept.append(fine)
        return made(task, fine, *more, **said)

    monkeypatch.setattr(rotary, "answer_of", spied)
    bench = BENCHES["rotary"]
    inputs, _ = bench.draw(4321, run)
    assert bench.align(inputs).status == "aligned"
    rows = kept[0].estimates.nis_rows.sum()
    assert abs(kept[0].estimates.nis.sum() / rows - 1.0) < 4.0 * np.sqrt(2.0 / rows)


@pytest.mark.slow
@pytest.mark.parametrize("number", [0, 3, 7])
def test_industrial_gyros_on_an_indexer_of_a_moored_ship(number):
    """Run 7 was refused for noise that its accelerometers do not have, 8 sigmas off in level."""
    outcome = indexed(moored, "industrial", 400.0)(1127, number)
    assert not outcome.refused
    assert max(np.abs(value).max() for value in outcome.ratios.values()) < 4.0
