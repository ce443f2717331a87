"""Innovations of any filter as evidence: how many were rejected, whether their size is that which sigma says."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from truenorth.state.evidence import Evidence, contradiction, note
from truenorth.state.limits import limit
from truenorth.state.track import Residuals

UNITS = {"GNSS position": "m", "barometer": "m", "zero rotation": "rad/s"}


def mean_nis(source: Residuals) -> float | None:
    """Mean of NIS over its number of rows, rejected measurements left out: 1 where the model is right."""
    if not source.used.any():
        return None
    return float(np.sum(source.nis[source.used]) / np.sum(source.rows[source.used]))


def innovation_evidence(sources: Iterable[Residuals]) -> list[Evidence]:
    """What the innovations of each source say of the model.

    Parameters
    ----------
    sources : iterable of Residuals
    """
    found: list[Evidence] = []
    for source in sources:
        count = len(source.time)
        if count == 0:
            continue
        rejected = int(np.sum(~source.used))
        if rejected > limit("rejected") * count:
            size = float(np.median(np.sqrt(np.nansum(source.innovation**2, axis=1))))
            unit = UNITS.get(source.name, "m/s")
            found.append(
                contradiction(
                    "innovations.rejected",
                    "source",
                    name=source.name,
                    rejected=rejected,
                    count=count,
                    scatter=size,
                    unit=unit,
                )
            )
        elif rejected:
            found.append(note("innovations.outliers", name=source.name, rejected=rejected, count=count))
        nis = mean_nis(source)
        if nis is not None and nis > limit("nis"):
            found.append(contradiction("innovations.size", name=source.name, factor=math.sqrt(nis)))
        if source.outside:
            found.append(note("innovations.outside", name=source.name, outside=source.outside))
    return found
