"""Is the place in the other hemisphere? What gravity then does in the inertial frame, matched with the innovations.

At latitude -L gravity goes round the earth's axis on the cone opposite to that at L: with the same level rate, and bent the other
way, by ``g (w t)^2 sin L cos L`` along north. Where the base sways, no mean rate about the vertical shows that; gravity does.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.fine import FineAlignment
from truenorth.alignment.matched import Match, Signatures
from truenorth.core.position import Position
from truenorth.errors.staying import gravity_position, gravity_velocity
from truenorth.state.evidence import Evidence, contradiction
from truenorth.state.limits import limit

Array = NDArray[np.float64]


def hemisphere_signature(fine: FineAlignment, position: Position) -> Signatures:
    """What gravity of the other hemisphere would do from the first epoch on."""
    time, lat, alt = fine.integrals.time, position.lat, position.alt
    if fine.form == "velocity":
        off = np.diff(gravity_position(time, lat, alt) - gravity_position(time, -lat, alt), axis=0)
        off /= fine.integrals.intervals[:, None]
    else:
        off = np.diff(gravity_velocity(time, lat, alt) - gravity_velocity(time, -lat, alt), axis=0)
    none, one = np.zeros((fine.system.states, 1)), np.ones((1, 1))
    return Signatures(np.zeros(1, dtype=np.int64), none, off[:1].T, one, none, off[..., None])


def hemisphere_evidence(match: Match) -> list[Evidence]:
    """Whether the log fits the other hemisphere better: twice the logarithm of the likelihood ratio of the two."""
    ratio, size = float(match.ratio[0]), float(match.size[0])
    if size <= 0.0:
        return []
    # Of a signature of size one: 2 match - energy.
    better = ratio / size * (2.0 - 1.0 / size)
    return [contradiction("place.hemisphere", "latitude", ratio=better)] if better > limit("hemisphere") else []
