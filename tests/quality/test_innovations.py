"""Innovations as evidence: a few rows scatter, and are judged by chance."""

import numpy as np
import pytest

from truenorth.quality.innovations import innovation_evidence
from truenorth.state.evidence import Effect
from truenorth.state.track import Residuals


def residuals(e):
    """Two components in each row, of sigma 1."""
    e = np.asarray(e, dtype=float)
    count = len(e)
    padded = np.column_stack([e, np.full(count, np.nan)])
    sigma = np.where(np.isfinite(padded), 1.0, np.nan)
    nis, time = np.nansum(padded**2, axis=1), np.arange(count, dtype=float)
    return Residuals("position fix", time, padded, sigma, nis, np.ones(count, bool), 0, time, np.zeros(count, bool))


def named(e):
    return [item.key for item in innovation_evidence([residuals(e)], Effect(heading=1e-3))]


@pytest.mark.parametrize("count", [1, 2, 5, 20, 400])
def test_sound_rows_are_not_too_large_by_chance(count):
    """Of a thousand sound sources none: the chance of one is 6e-4; of two fixes, one in twenty has a mean NIS above three."""
    rng = np.random.default_rng(11)
    assert not any("innovations.size" in named(rng.standard_normal((count, 2))) for _ in range(1000))


@pytest.mark.parametrize(("count", "factor"), [(1, 8.0), (2, 6.0), (5, 4.0), (400, 1.9)])
def test_too_large_ones_are(count, factor):
    """Every component so many sigmas."""
    assert "innovations.size" in named(np.full((count, 2), factor))
