"""The paper does not state the signs of its biases: which of them fit its table 2 best."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from truenorth.damping.course import errors_of
from truenorth.damping.filters import Filter, run_filters
from truenorth.damping.prior import paper_prior
from truenorth.errors.marine import BA, BG, MarineModel
from truenorth.papers.damping.methods import SWITCH, left_of
from truenorth.papers.damping.truth import LOG_NOISE, Voyage

Array = NDArray[np.float64]
BIASES = {"accelerometer x": BA.start, "accelerometer y": BA.start + 1} | {
    f"gyro {axis}": BG.start + i for i, axis in enumerate("xyz")
}


@dataclass(frozen=True)
class Fit:
    """Signs of the biases and how far filter 1 is from table 2 with them, in units of the table's own RMS by column."""

    signs: tuple[int, ...]
    misfit: float

    def __str__(self) -> str:
        """In words."""
        return ", ".join(f"{name} {'+' if sign > 0 else '-'}" for name, sign in zip(BIASES, self.signs, strict=True))


def search(
    voyage: Voyage,
    table: Mapping[float, Sequence[float]],
    read: Callable[[Array, Array], Array],
    progress: Callable[[str], None],
) -> list[Fit]:
    """All combinations of signs, the best first.

    The errors of filter 1 are linear in the biases and in the log's error, so that one run a bias and two logs do for all.

    Parameters
    ----------
    voyage : Voyage
    table : mapping of the log's error (m/s) to the paper's seven columns
    read : callable
        ``read(time, errors)``: the seven columns of (K+1, 7) errors.
    progress : callable
    """
    x0 = voyage.paper_errors()
    logs = list(table)
    theirs = np.array([table[c] for c in logs])
    progress("signs of the biases")
    at = {c: read(voyage.truth.time, left_by_filter1(voyage, x0, c)) for c in (logs[0], logs[-1])}
    slope = (at[logs[-1]] - at[logs[0]]) / (logs[-1] - logs[0])
    turned = []
    for index in BIASES.values():
        x = x0.copy()
        x[index] = -x[index]
        turned.append(read(voyage.truth.time, left_by_filter1(voyage, x, logs[0])) - at[logs[0]])
    base = at[logs[0]] + np.subtract(logs, logs[0])[:, None] * slope
    scale = np.sqrt(np.mean(theirs**2, axis=0))
    fits = []
    for signs in itertools.product((1, -1), repeat=len(BIASES)):
        ours = base + sum(change for sign, change in zip(signs, turned, strict=True) if sign < 0)
        fits.append(Fit(signs, float(np.sqrt(np.mean(((ours - theirs) / scale) ** 2)))))
    return sorted(fits, key=lambda fit: fit.misfit)


def left_by_filter1(voyage: Voyage, x0: Array, c: float) -> Array:
    """(K+1, 7) errors that filter 1 leaves, rad and m/s."""
    course = voyage.navigate(x0)
    start = round(SWITCH / course.interval)
    kind = Filter(MarineModel.of_paper(), paper_prior(course, start), LOG_NOISE / np.sqrt(course.interval))
    found = run_filters(course, voyage.reference(c), start=start, kinds={"filter1": kind})["filter1"]
    return left_of(voyage, errors_of(course, voyage.truth), found.x)
