"""A slip of an indexer's encoder, at once or over seconds, in a gap of its log or near the end.

Of what :mod:`truenorth.quality.encoder_errors` fits. A step of an axis' angle turns the base by ``u H(t - t0)``. Whitened by the
sway's autoregression each sample is tried as t0: with ``e`` the innovations and ``g = A' e`` these filtered backwards, the fit of a
step from t0 on is a sum of ``u g`` over all that follows. Where one stands out, it is fitted anew as a ramp, with autoregressions
that do not have it in. A base that is knocked turns about other axes as well, or back within seconds.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from truenorth.quality.encoder import USUAL_ZERO
from truenorth.quality.encoder_errors import NOISES, Fit, fitted, looks
from truenorth.quality.encoder_patterns import Turns
from truenorth.quality.prediction import filtered_back, step_energies
from truenorth.state.evidence import Effect, Evidence, Figure, Kind
from truenorth.state.limits import limit

Array = NDArray[np.float64]

GRIDS = ((0.2, 40), (1.0, 30))  # s from sample to sample, and the order of the autoregressions
OVER = (0.0, 0.3, 0.6, 1.2, 2.4, 4.0)  # s that a slip may take
ABOUT = 3.0  # s about the sample that stood out, in which it may begin
SURE = 2.0  # times the limit of a slip, below which one is in sigma, however large
WORTH = 0.6  # of the limit of a slip, from which one is fitted
CLEAR = 1e-6  # of a step's energy, that the fit has to leave of it
ALONG = 0.3  # of a slip, by which the base may turn across the axis at the same time
BACK = (2.0, 8.0)  # s, of a base that turns back after a knock
DOUBT = 3.0  # sigmas
LASTING = 0.5  # how much less it may be on the coarser grid: a knock does not last
SMALLEST = math.radians(1e-3)  # rad: less is in no sigma


@dataclass(frozen=True)
class Slip:
    """A step of one angle: of which axis, from when on (s), over how long (s), by how much and its one-sigma (rad)."""

    axis: int
    at: float
    over: float
    size: float
    sigma: float

    def turns(self, turns: Turns) -> Array:
        """(K, 3, 1) what it turns the base by, by the radian."""
        return _ramp(turns, self.axis, self.at, self.over)

    def evidence(self) -> Evidence:
        """Of its whole size: the body is as far off."""
        figures: dict[str, Figure] = {
            "axis": str(self.axis + 1),
            "size": -self.size,
            "sigma": self.sigma,
            "time": self.at,
        }
        sure = abs(self.size) > SURE * limit("slip of an encoder") * self.sigma
        kind: Kind = "hint" if not sure else "bounded" if abs(self.size) > USUAL_ZERO else "known"
        return Evidence("encoder.slips", figures, kind, Effect(abs(self.size), abs(self.size)), ("encoder",))


def slip_of(turns: Turns) -> Slip | None:
    """The slip that stands out; none of a sound encoder."""
    for cell, order in GRIDS:
        thin = turns.thinned(cell)
        if not looks(thin):
            continue
        fit = fitted(thin, order, noises=NOISES[-1:])
        z = _steps(fit)
        axis, row = (int(i) for i in np.unravel_index(np.argmax(np.abs(z)), z.shape))
        if abs(z[axis, row]) > WORTH * limit("slip of an encoder"):
            found = _fitted_slip(turns, axis, float(thin.time[row]))
            if found is not None:
                return found
    return None


def _steps(fit: Fit) -> Array:
    """(A, K) by how many of its sigmas a step of each axis from each sample on is there."""
    white, back = fit.white, filtered_back(fit.left, fit.white)
    columns = filtered_back(fit.columns, white)
    z = []
    for u in fit.turns.directions:
        score = np.cumsum(np.sum(u * back, axis=1)[::-1])[::-1]
        both = np.cumsum(np.einsum("ki,kim->km", u, columns)[::-1], axis=0)[::-1]
        energy = step_energies(u, white)
        own = energy - np.sum((both @ fit.C) * both, axis=1)
        z.append(np.where(own > CLEAR * energy, score / np.sqrt(np.maximum(own, 1e-300)), 0.0))
    return np.array(z)


def _ramp(turns: Turns, axis: int, at: float, over: float) -> Array:
    """(K, 3, 1) what a slip by a radian turns the base by."""
    share = np.clip((turns.time - at) / over, 0.0, 1.0) if over else (turns.time >= at).astype(float)
    return (share[:, None] * turns.directions[axis])[:, :, None]


def _fitted_slip(turns: Turns, axis: int, near: float) -> Slip | None:
    """The ramp that fits best about a time (s); None where it is no slip."""
    grids = [(turns.thinned(cell), order) for cell, order in GRIDS]
    (fine, order), (coarse, slower) = grids if looks(grids[0][0]) else (grids[1], grids[1])
    starts = fine.time[np.abs(fine.time - near) <= ABOUT] - 0.5 * fine.step
    tried = [(float(at), over) for over in OVER for at in starts]
    ramps = np.concatenate([_ramp(fine, axis, *item) for item in tried], axis=2)
    fit = fitted(fine, order, noises=NOISES[-1:])
    for _ in range(2):  # without the slip the autoregression is another one, and so is the slip
        best = int(np.argmax(fit.gains(ramps)[1]))
        with_it = fitted(fine, order, ramps[:, :, best : best + 1])
        fit = fitted(fine, order, white=with_it.white)
    size, sigma = _size(with_it)
    slip = Slip(axis, *tried[best], size, sigma)
    if abs(size) < max(SMALLEST, limit("slip of an encoder") * sigma):
        return None
    share = np.linalg.norm(ramps[:, :, best], axis=1)
    any_way = fitted(fine, order, share[:, None, None] * np.eye(3), white=with_it.white)
    x, P = any_way.group("more")
    u = fine.directions[axis][int(np.argmax(share > 0.0))]
    across = x - u * (u @ x)
    if float(np.linalg.norm(across)) > ALONG * abs(size) + DOUBT * math.sqrt(float(np.trace(P))):
        return None
    ramp, since = slip.turns(coarse), np.maximum(coarse.time - slip.at, 0.0)[:, None, None]
    lasting, unsure = _size(
        fitted(coarse, slower, np.concatenate([ramp, *(ramp * np.exp(-since / T) for T in BACK)], axis=2))
    )
    return slip if abs(lasting - size) < LASTING * abs(size) + DOUBT * unsure else None


def _size(fit: Fit) -> tuple[float, float]:
    x, P = fit.group("more")
    return float(x[0]), math.sqrt(float(P[0, 0]))
