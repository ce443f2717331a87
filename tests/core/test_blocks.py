"""Means and levels of rows: those of NumPy, to the bit."""

import numpy as np
import pytest

from truenorth.core import blocks
from truenorth.core.blocks import FEW, levels_of, means_of


@pytest.mark.parametrize("rows", [1, 2, 3, 7, 50, FEW, FEW + 1])
@pytest.mark.parametrize("shape", [(40,), (5, 8)])
def test_means_are_those_of_numpy(rows, shape):
    cells = np.random.default_rng(rows).standard_normal((*shape, rows, 3))
    before = cells.copy()
    assert np.array_equal(means_of(cells), cells.mean(axis=-2))
    assert np.array_equal(cells, before)


def test_no_cell_has_no_mean():
    assert means_of(np.zeros((0, 4, 6))).shape == (0, 6)


@pytest.mark.parametrize("levels", [1, 2, 300, 10**9])
def test_levels_are_those_of_numpy(levels, monkeypatch):
    monkeypatch.setattr(blocks, "BLOCK", 64)
    x = 0.1 * np.random.default_rng(levels).integers(-levels // 2, levels, 1000)
    for found, expected in zip(levels_of(x), np.unique(x, return_counts=True), strict=True):
        np.testing.assert_array_equal(found, expected)
