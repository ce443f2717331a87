"""How noisy aids are, by the innovations of a pass over the log.

Innovations of a right model are white. Errors of the model are slow against the rows of a sensor, noise of the sensor is not: half
the mean square of the *difference* of innovations that follow each other is the part that is white. Where it is ``q`` times as
large as the variances ``S = H P H' + R`` say, R is ``1 + (q - 1) S / R`` times too small, and the next pass takes it as large. What
is slow is left to the verdict (:mod:`truenorth.quality.innovations`). And of what a receiver says of its fixes, the part that is
not white is what they may share (:mod:`truenorth.quality.absolute`).

Source: R. Mehra, "On the identification of variances and adaptive Kalman filtering", IEEE Trans. Autom. Control 15 (1970).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from truenorth.aiding.source import Aiding
from truenorth.quality.whiteness import FEWEST
from truenorth.state.evidence import Evidence, note
from truenorth.state.limits import limit
from truenorth.state.track import Residuals, Track

Array = NDArray[np.float64]

LEAST_FACTOR = 1.15  # of sigma: less is what a usual value is worth
# Chi-square with one degree of freedom: half of all are smaller than the first, four fifths than the second. Noise with long tails
# has the larger scale by the second; a sixth of the rows may be outliers. A wheel's errors last for rows on end, and what is far
# out among them is no outlier: of it nineteen of twenty rows count.
QUANTILES = {0.5: 0.4549, 0.8: 1.6424}
WHEEL, WHEELS = "odometer", {0.95: 3.8415}
SPREAD = 3.0  # of that median, times the root of the count: 2.3, and differences share a row
STANDING = 0.2  # m/s: a speed below it is standing, where the IMU sees no motion either
LEAST_SQUARE = 0.05  # in parts of the variance: of differences that are expected to be nothing the scatter is no less
NEWEST, ALIKE = 30, 2.0  # rows, and times as large a sigma: measurements that are as good as the last
SAME = 1e-3  # s, by which stamps of one row may differ
LOUD = 3.0  # times its sigma, that an aid is so noisy that what a first pass found is made of noise


def noise_factors(
    track: Track, aiding: Sequence[Aiding], before: Mapping[str, Array], *, tails: bool = False
) -> dict[str, Array]:
    """By how much the noise of each source is larger than it says, (3,) by component; those that say enough are left out.

    Parameters
    ----------
    track : Track
        Of a pass with these sources.
    aiding : sequence of Aiding
        Those that are asked about.
    before : mapping
        Factors that are in their sigmas already.
    tails : bool
        Whether rows far out count, too, as they do in a pass that has no gate.
    """
    sources = {source.name: source for source in aiding if source.does == "measurement"}
    found = {}
    for residuals in track.residuals:
        if residuals.name not in sources:
            continue
        had = before.get(residuals.name, np.ones(3))
        source = sources[residuals.name]
        whole, moving = (
            _factors(part, source, 1.0 / had, tails) for part in (residuals, _on_the_move(residuals, track))
        )
        factor = had * np.maximum(whole, moving)
        if factor.max() > LEAST_FACTOR:
            found[residuals.name] = factor
    return found


def _scale_of(squares: Array, name: str) -> float:
    """The larger scale of squares by some of their quantiles; of a wheel, whose errors last for rows, of one more."""
    quantiles = QUANTILES | (WHEELS if name == WHEEL else {})
    return max(float(np.quantile(squares, share)) / usual for share, usual in quantiles.items())


def _on_the_move(residuals: Residuals, track: Track) -> Residuals:
    """Those of a vehicle that moves: a wheel that stands is exact, and says nothing of its noise."""
    speed = np.linalg.norm(track.v_n, axis=1)
    moves = np.interp(residuals.stamp, track.time, speed) > STANDING
    return replace(
        residuals,
        innovation=residuals.innovation[moves],
        sigma=residuals.sigma[moves],
        stamp=residuals.stamp[moves],
    )


def _factors(residuals: Residuals, source: Aiding, least: Array, tails: bool) -> Array:
    """(3,) by how much sigma is too small by the white part of the innovations; `least` where they are smaller."""
    e, S, R = residuals.innovation, residuals.sigma**2, _said(residuals, source)
    found = np.ones(3)
    for axis in range(3):
        difference = np.diff(e[:, axis]) ** 2 / (S[1:, axis] + S[:-1, axis])
        there = np.isfinite(difference)
        if int(there.sum()) < FEWEST:
            continue
        q = float(np.mean(difference[there])) if tails else _scale_of(difference[there], source.name)
        # Of a scale that is q times as large, or as small, the spread is as large a part: else a factor is never unlearnt.
        if abs(q - 1.0) / min(max(q, 1e-9), 1.0) < limit("chance") * SPREAD / math.sqrt(there.sum()):
            continue
        known = np.isfinite(e[:, axis]) & (R[:, axis] > 0.0)
        share = float(np.median(S[known, axis] / R[known, axis])) if known.any() else 0.0
        found[axis] = math.sqrt(max(1.0 + (q - 1.0) * share, least[axis] ** 2))
    return found


def _said(residuals: Residuals, source: Aiding) -> Array:
    """(M, 3) what a source says of the measurements of these residuals, variances; NaN of those that it does not have any more."""
    order = np.argsort(source.time, kind="stable")
    row = order[np.clip(np.searchsorted(source.time[order], residuals.stamp), 0, len(order) - 1)]
    said = source.sigma[row] ** 2
    said[residuals.stamp < source.time.min() - SAME] = np.nan
    return said


def white_part(track: Track, source: Aiding, axes: slice) -> tuple[float, float] | None:
    """White noise of some components of a source, in parts of the variance that it says, and one sigma of that part.

    Of measurements that are said to be about as good as the last ones.

    Of differences of innovations that follow each other, ``E d^2 = (S_1 + S_2) + (q - 1)(R_1 + R_2)`` where noise has the variance
    ``q R``: a regression on R. Such squares share a row with the next, and are correlated by a fourth: three in place of two.

    Parameters
    ----------
    track : Track
        Of a pass with this source.
    source : Aiding
    axes : slice
        Components that have one part together.

    Returns
    -------
    (part, sigma), or None
        None: too few measurements to say.
    """
    residuals = next((r for r in track.residuals if r.name == source.name), None)
    if residuals is None:
        return None
    used = residuals.used
    e, S, R = residuals.innovation[used, axes], residuals.sigma[used, axes] ** 2, _said(residuals, source)[used, axes]
    both, said = S[1:] + S[:-1], R[1:] + R[:-1]
    squares, share = np.diff(e, axis=0) ** 2 / both - 1.0, said / both
    known = R[np.all(R > 0.0, axis=1)]
    if not len(known):
        return None
    # How good the last ones are: better or worse ones do not say what these share.
    near = np.median(known[-NEWEST:], axis=0)
    low, high = near / ALIKE**2, near * ALIKE**2
    alike = (low < R) & (high > R)
    there = np.isfinite(squares) & np.isfinite(share) & alike[1:] & alike[:-1]
    if int(there.sum()) < FEWEST or not (weight := float(np.sum(share[there] ** 2))) > 0.0:
        return None
    part = 1.0 + float(np.sum((squares * share)[there])) / weight
    expected = np.maximum(1.0 + (part - 1.0) * share[there], LEAST_SQUARE)
    return part, math.sqrt(3.0 * float(np.sum((share[there] * expected) ** 2))) / weight


def louder(aiding: Sequence[Aiding], factors: Mapping[str, Array]) -> list[Aiding]:
    """The same sources with sigmas so many times as large."""
    return [replace(s, sigma=s.sigma * factors[s.name]) if s.name in factors else s for s in aiding]


def changed(before: Mapping[str, Array], after: Mapping[str, Array]) -> bool:
    """Whether factors have changed by what matters."""
    one = np.ones(3)
    names = before.keys() | after.keys()
    return any(np.abs(np.log(after.get(n, one) / before.get(n, one))).max() > math.log(LEAST_FACTOR) for n in names)


def noise_notes(factors: Mapping[str, Array]) -> list[Evidence]:
    """How noisy aids were found to be, for the reader: it is in sigma already."""
    return [note("noise.estimated", name=name, factor=float(factor.max())) for name, factor in factors.items()]
