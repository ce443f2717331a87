"""The newest innovations, in their sigmas, for the page: where they leave two sigmas often, the model is not what happens."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment import Alignment
from truenorth.state.track import Residuals

Array = NDArray[np.float64]

POINTS = 150  # epochs of a source


def newest_innovations(solution: Alignment | None, residuals: Sequence[Residuals]) -> list[dict[str, Any]]:
    """Of each source: of the loop under way, else of the last solution.

    Returns
    -------
    list of dict
        ``of``, ``time_s`` and, for each axis that is measured, ``sigmas``.
    """
    history = None if solution is None else solution.history
    if residuals:
        return [_shown(r.name, r.time, r.innovation / r.sigma) for r in residuals if len(r.time)]
    if history is None:
        return []
    return [_shown(history.innovation_of, history.time, history.innovation / history.innovation_sigma)]


def _shown(of: str, time: Array, sigmas: Array) -> dict[str, Any]:
    axes = [axis[-POINTS:] for axis in sigmas.T if np.isfinite(axis[-POINTS:]).any()]
    values = [[float(v) if np.isfinite(v) else None for v in axis] for axis in axes]
    return {"of": of, "time_s": time[-POINTS:].tolist(), "sigmas": values}
