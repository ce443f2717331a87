"""What the map of a navigation shows, for figures and reports: error ellipses, the unit of its axes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from truenorth.figures.thinning import evenly

if TYPE_CHECKING:
    from truenorth.navigation.result import Navigation

Array = NDArray[np.float64]

ELLIPSES = 12  # along the track
ROUND = 64  # points of an ellipse
KILO = 5000.0  # m, from which the track is drawn in kilometres


def ellipses(result: Navigation) -> list[Array]:
    """One-sigma ellipses of position at a dozen epochs, metres from the start."""
    from truenorth.state.layout import DP

    horizontal = slice(DP.start, DP.start + 2)
    rows = evenly(len(result.time), ELLIPSES)
    return [result.displacement[k] + ellipse(result.track.P[k, horizontal, horizontal]) for k in rows]


def track_unit(result: Navigation) -> tuple[float, str]:
    """Metres in the unit of the track's axes, and its name."""
    return (1000.0, "km") if np.abs(result.displacement).max() > KILO else (1.0, "m")


def ellipse(P: Array) -> Array:
    """(ROUND, 2) points of the one-sigma ellipse of a 2x2 covariance."""
    values, vectors = np.linalg.eigh(P)
    angle = np.linspace(0.0, 2.0 * np.pi, ROUND)
    axes = vectors * np.sqrt(np.maximum(values, 0.0))
    return np.stack([np.cos(angle), np.sin(angle)], axis=1) @ axes.T
