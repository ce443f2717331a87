"""Does a sensor sit as it is said to? Angles that a filter finds far from what was said of them contradict it.

What is found at the end is right; but as long as the log had not shown it, the sensor turned the track by what was said.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from truenorth.state.evidence import Evidence, contradiction
from truenorth.state.limits import limit
from truenorth.state.track import Track

RECEIVER = "GNSS"  # its mounting is the direction from one antenna to another


def mounting_evidence(track: Track, names: Iterable[str]) -> list[Evidence]:
    """Sensors of these names whose angles come out farther from what was assumed than that may be off."""
    found = []
    for name in names:
        layout, group = track.layout, f"{name} mounting"
        at = layout.slice_of(group)
        if at is None:
            continue
        miss, prior = np.abs(track.sensors[-1, at]), np.array(layout.priors[layout.names.index(group)])
        worst = int(np.argmax(miss / prior))
        if miss[worst] > limit("mounting") * prior[worst]:
            key, remedy = (
                ("mounting.baseline", "baseline") if name == RECEIVER else ("mounting.missed", "mounting_said")
            )
            found.append(contradiction(key, remedy, name=name, miss=float(miss[worst]), prior=float(prior[worst])))
    return found
