"""Velocities of a receiver or of a master against its positions: grid north, exchanged axes.

Positions ``p``, as complex numbers (east + i north), follow the integral ``s`` of the velocities:

    ``p = a + k s + tau v + n``,

the turn is minus the phase of ``k``. A delay ``tau`` between the two is left open within a sigma: in a circle it is a turn. The
noise ``n`` of cells is white plus a walk, the integral of the velocities' errors, which are white or last for a while. Of their
ratio nothing is known: each of a ladder has its generalised least squares, with Student's t as the turn's distribution, and its
weight by the restricted likelihood. A turn is shown where almost none of the weight has the other sign.

Source: D. A. Harville, "Maximum likelihood approaches to variance component estimation", J. Am. Stat. Assoc. 72 (1977).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.analysis.student import below
from truenorth.core.earth import radii
from truenorth.records import GnssRecord, MasterRecord
from truenorth.state.evidence import Effect, Evidence, Figure, contradiction
from truenorth.state.limits import limit

Array = NDArray[np.float64]

PIECE = 20.0  # s, of a displacement
LEAST_WAY = 20.0  # m of a piece: shorter ones do not show a direction
FEWEST = 4  # pieces of such a way, that show wrong axes
SURE = 3.0  # times what sums of velocities may err by: so much is left of them where their axes are wrong
CELLS = 60  # of a log, at most: means over them are compared
WRONG = 0.02  # of the rows, at the most, that are jumps of a receiver
FEWEST_CELLS = 4  # without a gap between them
RATIOS = (1e-3, 1e-2, 0.1, 1.0, 10.0, 100.0)  # of the walk's variance in a cell to that of the white noise
LASTING = (
    0.0,
    20.0,
    200.0,
)  # s, for which errors of velocities are correlated: noise, a receiver's filter, a master's jump
PARTS, DIFFERENT = 4, 4.0  # of a log, and sigmas by which one of them may differ from the mean of all
SINGULAR = 1e-12  # of the largest power of a column
ROUNDING = 1e-14  # of the squares of the places about their mean: of two numbers that are taken from each other
LATE = 0.1  # s, one sigma: of velocities against the positions of the same receiver
LEAST = math.radians(0.15)  # rad: a smaller turn is the drift of a receiver's positions


def gnss_evidence(gnss: GnssRecord) -> list[Evidence]:
    """What the positions of a receiver say against its velocities."""
    if gnss.v_n is None:
        return []
    rows = np.flatnonzero(gnss.has_position & np.isfinite(gnss.v_n[:, :2]).all(axis=1))
    return turn_evidence("gnss", gnss.time[rows], gnss.lat[rows], gnss.lon[rows], gnss.v_n[rows])


def master_evidence(master: MasterRecord, velocity_error: float = 0.0) -> list[Evidence]:
    """What the positions of a master say against its velocities, whose slow error has this one-sigma (m/s)."""
    if master.v_n is None or master.lat is None or master.lon is None:
        return []
    rows = np.flatnonzero(
        np.isfinite(master.v_n[:, :2]).all(axis=1) & np.isfinite(master.lat) & np.isfinite(master.lon)
    )
    return turn_evidence(
        "master", master.time[rows], master.lat[rows], master.lon[rows], master.v_n[rows], velocity_error
    )


def turn_evidence(
    source: str, time: Array, lat: Array, lon: Array, v_n: Array, velocity_error: float = 0.0
) -> list[Evidence]:
    """By how much velocities are turned, where positions contradict them; heading would be as wrong.

    Velocities of exchanged or flipped axes fit no turn at all: displacements over pieces say so, by more than sums of velocities
    may err. Where rows are so far apart that these err by as much as the way, nothing is said.

    Parameters
    ----------
    source : str
        ``gnss`` or ``master``: the evidence is named after it.
    time : (N,) array, s
    lat, lon : (N,) arrays, rad
    v_n : (N, 3) array, m/s
    velocity_error : float, m/s
        One-sigma of an error that stays: across the way it looks like a turn.
    """
    if len(time) < 2 * FEWEST_CELLS:
        return []
    R_M, R_N = radii(lat)
    # Steps each along its own east and north, as the velocities are: over 50 km at 60 deg of latitude these turn by .8 deg.
    east = np.angle(np.exp(1j * np.diff(lon))) * _between(R_N * np.cos(lat))
    at = np.append(0.0, np.cumsum(east + 1j * np.diff(lat) * _between(R_M)))
    velocity = v_n[:, 0] + 1j * v_n[:, 1]
    steps = np.diff(time)
    whole = np.append(0.0, np.cumsum(0.5 * (velocity[1:] + velocity[:-1]) * steps))
    # Over a gap nothing is known of the way.
    stretch = np.append(0, np.cumsum(steps > 3.0 * np.median(steps)))
    edges = np.searchsorted(time, np.arange(time[0], time[-1], PIECE))
    good = (np.diff(stretch[edges]) == 0) & (np.abs(np.diff(whole[edges])) > LEAST_WAY)
    p, s = np.diff(at[edges])[good], np.diff(whole[edges])[good]
    if not len(p):
        return []
    errs = float(np.sum(np.diff(_summed_error(velocity, steps, stretch)[edges])[good]))
    way = float(np.sum(np.abs(p) ** 2))
    if errs >= way:
        return []
    k = np.sum(p * np.conj(s)) / np.sum(np.abs(s) ** 2)
    left = float(np.sum(np.abs(p - k * s) ** 2))
    if len(p) >= FEWEST and left > max(limit("turned as one") * way, SURE**2 * errs):
        return [contradiction(f"{source}.velocity", "sensor_axes")]
    cells = _cells(stretch, time, at, k * whole, velocity)

    def turn(part: slice) -> Turn | None:
        number, t, places, ways, rates = (x[part] for x in cells)
        return _turn(number, t, places, ways, rates, float(np.angle(k)), velocity_error)

    count = len(cells[0])
    found = turn(slice(None))
    if found is None or abs(found.angle) < LEAST or found.otherwise > 0.5 * limit("turned velocities"):
        return []
    edges = np.linspace(0, count, PARTS + 1).astype(int)
    parts = [part for a, b in pairwise(edges) if (part := turn(slice(a, b))) is not None]
    if not _alike(parts):
        return []
    figures: dict[str, Figure] = {"angle": found.angle, "sigma": found.sigma}
    return [Evidence(f"{source}.turned", figures, "bounded", Effect(heading=abs(found.angle)), ("grid_north",))]


def _summed_error(velocity: NDArray, steps: Array, stretch: NDArray[np.intp]) -> Array:
    """(N,) variance of the sum of velocities up to each row, from what they may do between rows, m^2.

    Velocities that have nothing to do with their neighbours differ by twice their variance, and the mean of two has half of it. Of
    a vehicle that changes its velocity slowly this is too much: of a random walk three times. Rows that are wrong are few, and make
    the largest changes.
    """
    changes = np.sort(np.abs(np.diff(velocity)[np.diff(stretch) == 0]) ** 2)
    changes = changes[: len(changes) - math.ceil(WRONG * len(changes))]
    usual = float(np.mean(changes)) if len(changes) else 0.0
    return np.append(0.0, np.cumsum(0.25 * usual * steps**2))


def _between(values: Array) -> Array:
    """Means of neighbours."""
    return 0.5 * (values[1:] + values[:-1])


def _alike(parts: Sequence[Turn]) -> bool:
    """Whether the parts of a log show one turn: velocities that jump, or err for a while, are turned in a part of it."""
    if len(parts) < 2:
        return True
    angle, sigma = np.array([part[:2] for part in parts]).T
    mean = np.sum(angle / sigma**2) / np.sum(1.0 / sigma**2)
    return bool(np.all(np.abs(angle - mean) < DIFFERENT * sigma))


class Turn(NamedTuple):
    """Of velocities against positions, counter-clockwise."""

    angle: float  # rad
    sigma: float  # rad
    otherwise: float  # probability that the turn has the other sign


def _cells(stretch: NDArray[np.intp], *series: NDArray) -> tuple[NDArray, ...]:
    """Number of the stretch (M,), and means (M,) of series (N,), of at most about so many cells, none over a gap."""
    rows = max(1, math.ceil(len(stretch) / CELLS))
    edges = np.flatnonzero(np.diff(stretch, prepend=-1))
    numbers, first = [], []
    for number, (a, b) in enumerate(pairwise((*edges, len(stretch)))):
        starts = np.arange(a, b - rows + 1, rows)
        if len(starts) >= FEWEST_CELLS:
            numbers.append(np.full(len(starts), number))
            first.append(starts)
    if not first:
        return (np.zeros(0, dtype=np.intp), *(x[:0] for x in series))
    whole = np.concatenate(first)[:, None] + np.arange(rows)
    return (np.concatenate(numbers), *(x[whole].mean(axis=1) for x in series))


def _turn(
    stretch: NDArray[np.intp],
    time: Array,
    at: NDArray,
    whole: NDArray,
    velocity: NDArray,
    about: float,
    velocity_error: float,
) -> Turn | None:
    """The turn of cells (M,), `whole` turned back about so far; None where they are too few."""
    count = len(time)
    if count < FEWEST_CELLS:
        return None
    own = stretch[:, None] == np.unique(stretch)  # a place of its own for each stretch
    columns = [whole, 1j * whole, velocity, *own.T.astype(complex), *(1j * own.T)]
    since = time - time[0]
    X, y, slow = _parted(np.stack(columns, axis=1)), _parted(at), _parted(np.stack([since, 1j * since], axis=1))
    dof = 2 * count - X.shape[1]
    if dof < FEWEST_CELLS:
        return None
    X = X / (size := np.maximum(np.linalg.norm(X, axis=0), 1e-12))
    found = []
    for walk in (np.zeros((count, count)), *(r * _walk(time, stretch, lasts) for lasts in LASTING for r in RATIOS)):
        C = np.eye(count) + walk
        A, b, c = (np.concatenate([np.linalg.solve(C, half) for half in np.split(x, 2)]) for x in (X, y, slow))
        N = X.T @ A
        squares = float(b @ (y - X @ (np.linalg.pinv(N, rcond=SINGULAR, hermitian=True) @ (X.T @ b))))
        if squares <= ROUNDING * float(b @ y):
            continue  # a straight way at an even speed: nothing is left but rounding
        known = np.zeros(len(N))
        known[2] = squares / dof / (LATE * size[2]) ** 2
        inverse = np.linalg.pinv(N + np.diag(known), rcond=SINGULAR, hermitian=True)
        powers = np.linalg.eigvalsh(N + np.diag(known))
        x = inverse @ (X.T @ b)
        variance = squares / dof * inverse[1, 1] + velocity_error**2 * float(np.sum((inverse @ (X.T @ c))[1] ** 2))
        logs = (
            np.linalg.slogdet(C)[1]
            + 0.5 * float(np.sum(np.log(np.maximum(powers, SINGULAR * powers[-1]))))
            + 0.5 * dof * math.log(squares)
        )
        found.append((-about - float(x[1]) / size[1], math.sqrt(max(variance, 1e-300)) / size[1], -logs))
    if not found:
        return None
    angles, sigmas, likely = np.array(found).T
    weights = np.exp(likely - likely.max())
    weights /= weights.sum()
    angle = float(weights @ angles)
    sigma = math.sqrt(float(weights @ (sigmas**2 + (angles - angle) ** 2)))
    if abs(angle) < 3.0 * sigma:
        return Turn(angle, sigma, 0.5)
    other = [below(-math.copysign(1.0, angle) * float(t), dof) for t in angles / sigmas]
    return Turn(angle, sigma, float(weights @ other))


def _walk(time: Array, stretch: NDArray[np.intp], lasts: float) -> Array:
    """(M, M) covariance of the integral of errors that last so long (s), of variance one in a step; none over a gap."""
    first = np.searchsorted(stretch, stretch)
    since = time - time[first]
    a, b = since[:, None], since
    step = float(np.median(np.diff(time)))
    same = stretch[:, None] == stretch
    if lasts == 0.0:
        return np.asarray(np.where(same, np.minimum(a, b), 0.0) / step)
    kept = np.exp(-since / lasts)
    bend = 1.0 - kept[:, None] - kept + np.exp(-np.abs(a - b) / lasts)
    return np.asarray(np.where(same, np.minimum(a, b) - 0.5 * lasts * bend, 0.0) / step)


def _parted(values: NDArray) -> Array:
    """Real parts (2M, ...) of complex values (M, ...), then their imaginary ones."""
    return np.concatenate([values.real, values.imag])
