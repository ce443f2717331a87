"""Passes about a nominal solution: how they come to rest."""

from dataclasses import dataclass

import numpy as np
import pytest

from truenorth.estimate.batch import settle


@dataclass
class Found:
    end: np.ndarray


class Bent:
    """Of an error s a pass finds `share` times what is there: beyond 2 the passes go to and fro and grow."""

    def __init__(self, share):
        self.s, self.share = np.array([1.0, -3e-6]), share

    def linearise(self):
        return self.s

    def correct(self, x):
        self.s = self.s - x


@pytest.mark.parametrize(("share", "most"), [(1.0, 3), (0.6, 8), (1.9, 12), (2.1, 12), (2.6, 16)])
def test_passes_come_to_rest(share, most):
    """Undamped, a share of 2.1 grows by a tenth each pass; one of 1.9 takes 37 passes."""
    log = Bent(share)
    last = settle(log, lambda system: Found(share * system), lambda found: float(np.abs(found.end[0])), most=most)
    assert last.moved < 0.02
    assert last.passes < most or share == 1.0


def test_what_goes_on_one_way_is_not_damped():
    """Steps that grow, all one way: the far solution is reached in full steps."""
    log, steps = Bent(1.0), iter([0.1, 0.2, 0.4, 0.8, 0.0])
    last = settle(log, lambda system: Found(np.full(2, next(steps))), lambda found: float(found.end[0]), most=9)
    assert last.passes == 5
    assert np.allclose(log.s, [1.0 - 1.5, -3e-6 - 1.5])


@pytest.mark.parametrize("share", [1.5, 2.3])
def test_passes_that_go_round_come_to_rest(share):
    """Two states that turn each other: steps never go straight back, and undamped they end in a circle for ever."""

    class Round:
        s = np.array([1.0, 0.3])

        def linearise(self):
            # Far from rest a pass finds the error turned, and no more than a step of one.
            turned = np.array([self.s[0] - share * self.s[1], self.s[1] + share * self.s[0]])
            return turned / max(1.0, float(np.linalg.norm(turned)))

        def correct(self, x):
            self.s = self.s - x

    log = Round()
    last = settle(log, Found, lambda found: float(np.abs(found.end).max()), most=200)
    assert last.moved < 0.02
    assert last.passes < 200
