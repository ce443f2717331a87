"""What the figure and the page of an alignment both draw: angles with their sigmas and floors, limits, averaged NIS."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from truenorth.core.attitude import UNIFORM_SIGMA, euler_jacobian

if TYPE_CHECKING:
    from truenorth.alignment.result import Alignment, History

Array = NDArray[np.float64]

SETTLED_FROM = 0.25  # of the log: vertical axes are scaled to what comes after
NIS_BLOCK = 10  # epochs averaged
# By components: chi_square_band(n, runs=NIS_BLOCK), for which SciPy takes .2 s to load.
NIS_BANDS = {1: (0.3246973, 2.0483177), 2: (0.9590777, 3.4169607), 3: (1.6790772, 4.6979242)}


@dataclass(frozen=True)
class Course:
    """How one angle at the answer's epoch came to be known.

    Attributes
    ----------
    name : str
    value, sigma, floor : (K,) arrays, rad
        As known at each epoch, its one-sigma, and the part of that which waiting does not improve.
    """

    name: str
    value: Array
    sigma: Array
    floor: Array


def courses(result: Alignment) -> list[Course]:
    """Heading, pitch and roll; near the vertical pitch and the combination of heading and roll that is observable.

    There ``C_nb = Rz(-combination) Rx(+-90 deg)`` (`Alignment.azimuth`), so the error of the combination is ``phi_U``.

    Raises
    ------
    ValueError
        The method kept no history.
    """
    values, sigmas = result.convergence
    h = result.history
    assert h is not None  # else `convergence` has raised
    J = euler_jacobian(result.C_nb)
    floors = np.sqrt(np.einsum("ij,kjl,il->ki", J, h.phi_floor, J))
    sigmas, floors = np.minimum(sigmas, UNIFORM_SIGMA), np.minimum(floors, UNIFORM_SIGMA)
    found = [
        Course(name, values[:, i], sigmas[:, i], floors[:, i]) for i, name in enumerate(("heading", "pitch", "roll"))
    ]
    if not result.near_vertical:
        return found
    name, value, _ = result.azimuth
    sigma, floor = (np.minimum(np.sqrt(P[:, 2, 2]), UNIFORM_SIGMA) for P in (h.phi_covariance, h.phi_floor))
    return [Course(name.replace("_", " "), value + h.departure[:, 2], sigma, floor), found[1]]


def settled_limits(middle: Array, half: Array) -> tuple[float, float]:
    """Vertical limits that show the settled part of a band well, with a margin; of epochs that have no value, the others."""
    known = np.isfinite(middle) & np.isfinite(half)
    middle, half = middle[known], half[known]
    if not len(middle):
        return -1.0, 1.0
    late = slice(int(SETTLED_FROM * len(middle)), None)
    low, high = float(np.min((middle - half)[late])), float(np.max((middle + half)[late]))
    margin = 0.15 * max(high - low, 1e-9)
    return low - margin, high + margin


def averaged_nis(history: History) -> tuple[Array, Array, float, float]:
    """Time and mean of the NIS over blocks of `NIS_BLOCK` epochs with one, and the 95 % band of such a mean.

    Empty arrays where the history is shorter than a block.
    """
    known = np.flatnonzero(np.isfinite(history.nis))
    rows = known[: len(known) // NIS_BLOCK * NIS_BLOCK].reshape(-1, NIS_BLOCK)
    return (
        history.time[rows].mean(axis=1),
        history.nis[rows].mean(axis=1),
        *NIS_BANDS[max(1, len(history.components))],
    )
