"""How a filter itself would follow what may have happened to its log, and how likely that is by its innovations.

The same log with a small change is filtered once more: what that adds to the innovations of all sources, by the size of the change,
is its signature ``s``. Of changes that add up, of sizes ``x``, twice the logarithm of the likelihood ratio of the sizes that fit
best is ``b^T A^-1 b``, ``A = sum s^T s``, ``b = sum s^T z``, over the normalised innovations ``z``: a chi-square of as many
degrees of freedom as there are sizes where nothing has happened.

Source: A. Willsky and H. Jones, "A generalized likelihood ratio approach to the detection and estimation of jumps in linear
systems", IEEE Trans. Autom. Control 21 (1976); signatures by passes of the filter are ours.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.estimate.rivals import likelihood_ratio
from truenorth.quality.led_away import no_outlier
from truenorth.quality.whiteness import whiteness

if TYPE_CHECKING:
    from truenorth.records import GnssRecord
    from truenorth.state.track import Residuals, Track

Array = NDArray[np.float64]


class Seen(NamedTuple):
    """Of the measurements of a source: times (K,), normalised innovations (K, m), n changes of size 1 (K, m, n)."""

    time: Array
    z: Array
    s: Array

    def begun(self, later: float) -> Seen:
        """As if the changes began so much later (s)."""
        K = len(self.time)
        moved = [np.interp(self.time - later, self.time, row, left=0.0) for row in self.s.reshape(K, -1).T]
        return self._replace(s=np.stack(moved, axis=1).reshape(self.s.shape))


def likeliest(seen: Sequence[Seen], precision: float = 0.0) -> tuple[float, Array]:
    """Twice the logarithm of the likelihood ratio of the sizes (n,) that fit best, and these sizes; zeros where none shows.

    A source whose innovations are coloured, or too large, without the changes carries so much less information.

    Parameters
    ----------
    seen : sequence of Seen
    precision : float
        One over the variance that a size may have. The ratio with it is the smaller: no chance is more likely by it.
    """
    n = seen[0].s.shape[-1] if seen else 0
    shares, ratio = [1.0] * len(seen), 0.0
    size: Array = np.zeros(n)
    for _ in range(2):
        weighed = list(zip(shares, seen, strict=True))
        A = precision * np.eye(n) + sum(w * np.einsum("kmi,kmj->ij", s, s) for w, (_, _, s) in weighed)
        b = sum((w * np.einsum("kmi,km->i", s, z) for w, (_, z, s) in weighed), np.zeros(n))
        if not seen or np.linalg.matrix_rank(A) < n:
            return 0.0, size
        size = np.linalg.solve(A, b).astype(np.float64)
        ratio = float(b @ size)
        shares = [1.0 / whiteness(z - s @ size).growth ** 2 for _, z, s in seen]
    return ratio, size


def signatures_of(first: Sequence[Residuals], passes: Sequence[Sequence[Residuals]], step: float) -> list[Seen]:
    """What changes of size 1 add to the innovations of each source that all passes have.

    Parameters
    ----------
    first : sequence of Residuals
        Of the log as it is.
    passes : n sequences of Residuals
        Each of the log without one change of size `step`.
    """
    found = [_signature(r, [_same(r, others) for others in passes], step) for r in first]
    return [item for item in found if item is not None]


def likeliest_of(
    runs: Sequence[Callable[[GnssRecord], Track]],
    first: Track,
    receiver: GnssRecord,
    without: Callable[[GnssRecord, float], GnssRecord],
    step: float,
) -> tuple[float, float]:
    """Twice the logarithm of the likelihood ratio of a change of a receiver's log, and its size; zeros where none shows.

    Parameters
    ----------
    runs : sequence of callable
        The filter with another record of the receiver; then the same, each without one of the slow errors that the innovations
        have shown, since such an error takes up what may be a change.
    first : Track
        Of the first of these, with the record as it is.
    receiver : GnssRecord
    without : callable
        The record as it would be without a change of this size.
    step : float
        Size of the change that a pass asks with.

    Raises
    ------
    DataError
        A filter broke down.
    """
    found = (0.0, 0.0)
    for run in runs:
        track = first if run is runs[0] else run(receiver)
        before = min(likelihood_ratio(first.residuals, track.residuals), 0.0)
        ratio, size = likeliest(signatures_of(track.residuals, [run(without(receiver, step)).residuals], step))
        found = max(found, (ratio + before, float(size[0]) if ratio > 0.0 else 0.0))
    return found


def _same(source: Residuals, others: Sequence[Residuals]) -> Residuals | None:
    return next((r for r in others if r.name == source.name), None)


def _signature(source: Residuals, others: Sequence[Residuals | None], step: float) -> Seen | None:
    """Of one source.

    A gate may have taken the first rows of a step for outliers: they count, as one outlier does that is no step.
    """
    there = [r for r in others if r is not None and np.array_equal(r.stamp, source.stamp)]
    if len(there) < len(others) or not len(source.time):
        return None
    alike = np.all([(r.used == source.used) & (r.rows == source.rows) for r in there], axis=0) & (source.rows > 0)
    axes = np.isfinite(source.innovation[alike]).all(axis=0)
    z, *moved = ((r.innovation[alike] / r.sigma[alike])[:, axes] for r in (source, *there))
    if not z.size:
        return None
    s = np.stack([(z - other) / step for other in moved], axis=-1)
    return Seen(source.time[alike], no_outlier(z), s)
