"""Errors of aiding sensors that last: a receiver's multipath and atmosphere, a wheel's slip, alike from row to row.

Taken for white noise they average out within seconds, and sigma is false: of position and velocity, and where an INS is good
enough to believe their mean, of level, heading and biases. Where innovations show them, first-order Gauss-Markov errors of their
size are estimated with the INS. What lasts longer than such a time averages out for the filter and not in truth: position is
never known better than the slow error of its fixes.

Source: P. Misra and P. Enge, *Global Positioning System*, 2nd ed., ch. 5: errors of orbits, clocks and atmosphere last for minutes
to hours, multipath for a minute.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from operator import is_
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.aiding.sensors import place_sigma
from truenorth.aiding.source import Aiding, Role
from truenorth.errors.group import Group
from truenorth.quality.whiteness import whiteness
from truenorth.records import GnssRecord
from truenorth.state.evidence import Evidence, Figure
from truenorth.state.layout import DP
from truenorth.state.track import Residuals, Track

Array = NDArray[np.float64]

FIXES, SPEEDS = "GNSS position", "GNSS velocity"
USUAL_BIAS, USUAL_TIME = 2.0, 60.0  # m, s


@dataclass(frozen=True)
class Lasting:
    """An error of a source that lasts."""

    group: Group
    white: float = 1.0  # how much of the sigma that the source says is white noise

    @property
    def across(self) -> bool:
        """Whether it acts on the first or the last axis, across a wheel's way, more than an axis without slow errors is given."""
        right, forward, up = self.group.sigma
        return max(right, up) > LEAST * forward


Slow = Mapping[str, Lasting]  # by the source's name


class _Kind(NamedTuple):
    """Where a source takes up a slow error: role, name of its states, how many, their correlation time (s)."""

    role: Role
    name: str
    axes: int
    time: float
    most: float  # SI: what is larger is no slow error but something else that is wrong
    after: tuple[Role, ...] = ()  # what of it has to be estimated already


KINDS = {
    FIXES: _Kind("bias", "GNSS bias", 3, USUAL_TIME, 20.0),
    SPEEDS: _Kind("bias", "GNSS velocity drift", 3, 20.0, 0.5),
    "odometer": _Kind(
        "bias", "odometer slip", 3, 20.0, 0.5, ("scale", "mounting")
    ),  # a wheel's, and of the body on its springs
    "velocity log": _Kind("bias", "velocity log bias", 3, 60.0, 0.2, ("scale", "mounting")),
}
LEAST = 1e-3  # of the largest axis: what an axis without slow errors is given
LEAST_ROWS = 60
MOVES = 0.5  # m/s: an antenna that is slower stands, but for a wind
BY_ROW = ("time", "innovation", "sigma", "nis", "used", "stamp", "jumped")
LAGS = 5
PIECE = 1.0  # s, over which innovations are averaged
MOST = 6.0 / 0.6745  # times the median, of sizes: six sigmas
FOLLOWED = 2.0  # times what is left in innovations: the filter has followed it


def usual_bias(record: GnssRecord | None) -> float:
    """One sigma, m, by what the receiver says of a fix: it is right about the size, and silent about how its errors follow."""
    return place_sigma(record) if record is not None and says_size(record) else USUAL_BIAS


def says_size(record: GnssRecord) -> bool:
    """Whether the receiver says how good its fixes are."""
    return record.position_sigma is not None or record.dop is not None


def slow_errors(track: Track, aiding: Iterable[Aiding]) -> tuple[dict[str, Lasting], list[Evidence]]:
    """Slow errors that innovations show and nobody spoke of, by the source's name, and what is to be said of them."""
    found: dict[str, Lasting] = {}
    said = []
    for source in aiding:
        kind = KINDS.get(source.name)
        residuals = next((r for r in track.residuals if r.name == source.name), None)
        if kind is None or kind.role in source.states or residuals is None:
            continue
        if any(role not in source.states for role in kind.after):
            continue  # what is taken for known, and may be wrong, is looked at first
        seen = _wander(residuals, kind.axes)
        if seen is None:
            continue
        correlation, size, of_rows = seen
        sigma = FOLLOWED * size
        if max(sigma.max(), FOLLOWED * of_rows) > kind.most:
            continue
        sigma = np.maximum(sigma, LEAST * sigma.max())
        found[source.name] = Lasting(Group(kind.name, sigma, kind.time, unit=residuals.unit))
        said.append(wanders(source.name, correlation, float(size.max()), residuals.unit))
    return found, said


def under_way(track: Track, moving: Track | None = None, *, rest: bool = False) -> Track:
    """The track with innovations of a vehicle that moves, of sources that have many of one that stands as well; else the same one.

    Multipath of an antenna that stands changes as the satellites move, within minutes: its fixes seem to have next to no noise,
    and an error that stays. On the move it changes with the place, within seconds. Looked at as one, the rest hides the drive.

    Parameters
    ----------
    track : Track
    moving : Track, optional
        By whose speed it moves; the track's own where left out.
    rest : bool
        Those of a vehicle that stands, in their place.
    """
    by = track if moving is None else moving
    moves = np.linalg.norm(by.v_n[:, :2], axis=1) > MOVES
    found = []
    for residuals in track.residuals:
        there = (np.interp(residuals.stamp, by.time, moves) > 0.5) != rest
        if min(np.sum(there), np.sum(~there)) >= LEAST_ROWS:
            rows = {name: getattr(residuals, name)[there] for name in BY_ROW}
            found.append(replace(residuals, **rows))
        else:
            found.append(residuals)
    return track if all(map(is_, found, track.residuals)) else replace(track, residuals=tuple(found))


def wanders(name: str, correlation: float, size: float, unit: str) -> Evidence:
    """That the errors of a source last."""
    figures: dict[str, Figure] = {"name": name, "correlation": correlation, "wander": size, "unit": unit}
    return Evidence("innovations.wander", figures)


def _wander(residuals: Residuals, axes: int) -> tuple[float, Array, float] | None:
    """Mean correlation over the first lags, and the root of what means that follow each other have in common; None: chance.

    The last is the largest of what rows have in common: a clock that is late shows in them, and not in means over its changes.
    """
    rows = residuals.rows > 0
    e, sigma = residuals.innovation[rows, :axes], residuals.sigma[rows, :axes]
    there = np.isfinite(e).all(axis=0)  # heights are left out where height is held
    e, sigma = e[:, there], sigma[:, there]
    if len(e) < LEAST_ROWS or not e.size:
        return None
    # Rows that were rejected may be the slow error itself; outliers count as its largest.
    most = MOST * np.median(np.abs(e), axis=0)
    e = np.clip(e, -most, most)
    of_rows = math.sqrt(max(float(_alike(e).max()) / len(e), 0.0))
    e, sigma = _means(residuals.time[rows], e, sigma)
    if len(e) < LEAST_ROWS:
        return None
    # Axis by axis, too: a wheel's constraints are mostly far better kept than sigma says, and would hide its slip.
    each = [whiteness(own[:, None]) for own in (e / sigma).T]
    if all(seen.growth <= 1.0 for seen in (whiteness(e / sigma), *each)):  # white, or no more than sigma says
        return None
    larger = np.array([own.size * own.colour > 1.0 for own in each])
    if not larger.any():
        return None
    alike = larger * _alike(e)
    correlation = float(np.mean((alike / np.sum(e**2, axis=0))[larger]))
    if correlation <= 0.0 or alike.max() <= 0.0:
        return None
    size = np.zeros(axes)
    size[there] = np.sqrt(np.maximum(alike, 0.0) / len(e))
    return correlation, size, of_rows


def _alike(e: Array) -> Array:
    """(m,) sums of products of rows (M, m) that follow each other, the mean of the first lags."""
    return np.asarray(np.mean([np.sum(e[lag:] * e[:-lag], axis=0) for lag in range(1, LAGS + 1)], axis=0))


def _means(time: Array, e: Array, sigma: Array) -> tuple[Array, Array]:
    """Innovations (M, m) averaged over pieces of `PIECE`, and one sigma of such means if they are white.

    A wheel that counts pulses rounds a way: what one row has too little the next has too much. Row by row that hides a slip, which
    is far smaller; of means over seconds little of it is left.
    """
    first = np.flatnonzero(np.diff(np.floor((time - time[0]) / PIECE), prepend=-1.0))
    count = np.diff(first, append=len(e))[:, None]
    return np.add.reduceat(e, first) / count, np.sqrt(np.add.reduceat(sigma**2, first)) / count


def with_slow(aiding: Sequence[Aiding], slow: Slow) -> list[Aiding]:
    """The same sources with these slow errors among their states, and the white noise that is left of what they say."""
    return [_with_one(s, slow[s.name]) if s.name in slow else s for s in aiding]


def _with_one(source: Aiding, lasting: Lasting) -> Aiding:
    states = {**source.states, KINDS[source.name].role: lasting.group}
    return replace(source, sigma=lasting.white * source.sigma, states=states)


def one_less(slow: Slow) -> list[Slow]:
    """These slow errors without each of them in turn."""
    return [{name: lasting for name, lasting in slow.items() if name != left_out} for left_out in slow]


def as_lasting(track: Track, aiding: Iterable[Aiding]) -> Track:
    """The track with position known no better than the slow error of its fixes."""
    fixes = next((source for source in aiding if source.name == FIXES and "bias" in source.states), None)
    if fixes is None or not len(track.P):
        return track
    P, at = track.P.copy(), np.arange(DP.start, DP.stop)
    P[:, at, at] = np.maximum(P[:, at, at], np.asarray(fixes.states["bias"].sigma) ** 2)
    return replace(track, P=P)
