"""The plan of one navigation: what its passes over the log have in common, and what they have learnt of its aids."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, partial

import numpy as np
from numpy.typing import NDArray

from truenorth.aiding.aids import Aid
from truenorth.aiding.source import Aiding
from truenorth.aiding.sprung import of_the_path
from truenorth.errors.model import InsModel
from truenorth.estimate.run import navigate_track, with_states
from truenorth.navigation.given import fed_back
from truenorth.navigation.result import Altitude
from truenorth.quality.aid_noise import louder
from truenorth.quality.converging import with_convergence
from truenorth.quality.slow_aids import Slow, with_slow
from truenorth.quality.stamps import with_scatter
from truenorth.quality.swing import with_unseen_arm
from truenorth.records import ImuRecord
from truenorth.state.state import Start
from truenorth.state.track import Track

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Plan:
    """One navigation, ready to run with any set of measurements."""

    record: ImuRecord
    start: Start
    model: InsModel
    altitude: Altitude
    always: Sequence[Aiding]  # gaps and stops
    interval: float
    every: int
    askew: float  # scale factors and misalignments of the gyros by their specification, whatever a rival's are
    slow: Slow = field(default_factory=dict)  # errors of aids that innovations have shown
    factors: Mapping[str, Array] = field(default_factory=dict)  # of a wheel's noise, so shown
    swings: bool = False  # of an antenna at a known place, which the receiver's velocities do not show in full
    late: bool = False  # what the receiver shows late is its antenna's slow swing, too
    shaken: bool = False  # all of that swing: the antenna shakes more quickly than its delay was known
    delay_spread: float = 0.0  # s, one sigma of what else that delay may be
    unseen: float = 0.0  # share of that swing which is in their noise
    swung: Mapping[str, Array] = field(default_factory=dict)  # what that adds to their sigmas
    stamps: float = 0.0  # s, one sigma of the receiver's stamps, as innovations have shown it
    stamped: Mapping[str, Array] = field(default_factory=dict)  # what that adds to its sigmas

    def sources(self, given: Mapping[str, Aid]) -> list[Aiding]:
        """Measurements of all aids."""
        said = [source for a in given.values() for source in a.sources(self.altitude)]
        loud = louder(with_slow(with_convergence(said), self.slow), self.factors)
        return with_scatter(with_scatter(loud, self.swung), self.stamped)

    def run(self, sensors: Sequence[Aiding], smooth: bool = False) -> Track:
        """Filter with these measurements; smooth once that is asked for (:meth:`Track.whole`): it takes ten times as long."""
        shown = with_unseen_arm(sensors, self.record, self.askew, known=self.swings, late=self.late, shaken=self.shaken)
        used = [*of_the_path(shown, self.record), *self.always]
        navigated = partial(
            navigate_track,
            self.record,
            self.start,
            with_states(self.model, used),
            used,
            interval=self.interval,
            every=self.every,
            invariant=fed_back(used),
        )
        return replace(navigated(), smoothing=cache(partial(navigated, smooth=True)) if smooth else None)

    def finest(self) -> Track:
        """Free, at every interval, without covariance."""
        return navigate_track(self.record, self.start, self.model, interval=self.interval, every=1, covariance=False)
