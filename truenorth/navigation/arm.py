"""An antenna that cannot sit where it is said to: its arm is estimated, and the answer says so.

A mast swings by ``w x l``, metres a second at sea. An arm that is wrong by a tenth is in each velocity, in step with the swing, and
the filter makes a delay of it, scale factors of the gyros, or a height that is off by as much as the arm: places alone do not show
an arm upward. So once the passes are done one more leaves clocks and arms open (:mod:`truenorth.navigation.second_look`). Where it
contradicts the arm, or shows nothing of a track that is lost, the passes are run from the start with that arm estimated. They count
where they contradict what was said, too, and explain the log no worse. Their sigma of height has what the arm is uncertain by.

The rule is ours.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.aiding.aids import Aid, Gnss
from truenorth.core.errors import DataError
from truenorth.estimate.slow_fit import bounded_misfit
from truenorth.navigation.given import looked_at, mounted_as
from truenorth.navigation.passes import filtered, lost, quick_swing
from truenorth.navigation.plan import Plan
from truenorth.navigation.second_look import OPEN, looser, wrong_antenna
from truenorth.state.evidence import Evidence
from truenorth.state.limits import limit
from truenorth.state.track import Track

Array = NDArray[np.float64]
Passed = tuple[Plan, dict[str, Any], Track, list[Evidence]]


def filtered_by_possible_arm(plan: Plan, given: dict[str, Any], smooth: bool) -> tuple[Passed, Track | None]:
    """The passes (:func:`truenorth.navigation.passes.filtered`), with an antenna's arm estimated that the log contradicts.

    The second is the track with all left open that is of these passes; None: there is none as yet.
    """
    done = filtered(plan, given, smooth)
    receiver = given.get(Gnss.key)
    if not isinstance(receiver, Gnss) or not (antenna := receiver.mounting) or antenna.lever_arm_sigma > 0.0:
        return done, None
    quick, loose = quick_swing(plan, given), looser_track(done[0], done[1])
    nothing = loose is None and lost(done[2])  # a wrong clock loses a track, too: the loose one shows it
    if not nothing and wrong_antenna(loose, antenna, quick) is None:
        return done, loose
    open_ = replace(antenna, lever_arm_sigma=OPEN["lever arm"].prior)
    try:
        other = filtered(plan, {**given, Gnss.key: receiver.mounted(open_)}, smooth)
    except DataError:  # the filter broke down
        return done, loose
    wrong = wrong_antenna(other[2], antenna, quick)
    if wrong is None or lost(other[2]) or not _no_worse(other[2], done[2]):
        return done, loose
    return (*other[:3], [*other[3], wrong]), None


def looser_track(plan: Plan, given: Mapping[str, Aid]) -> Track | None:
    """The track of a plan with clocks, arms, scales and mountings left open."""
    return looser(lambda loose: plan.run(plan.sources(mounted_as(given, loose))), looked_at(given))


def _no_worse(other: Track, track: Track) -> bool:
    """Whether one track explains the log as well as another by more than chance: row for row, since delays are not those of it."""
    more, before = 0.0, {r.name: r for r in track.residuals}
    for r in other.residuals:
        one, two = (int(np.sum(of.rows > 0)) for of in (before[r.name], r))
        if one and two:
            more += bounded_misfit([r]) - bounded_misfit([before[r.name]]) * two / one
    return more < limit("rival")
