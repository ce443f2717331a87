"""How large a receiver's slow errors are, for how long they last, and how much of what it says of itself is white noise.

That there are slow errors is seen in innovations (:mod:`truenorth.quality.slow_aids`). Their size is not: a filter that takes a
slow error for motion has followed it, and innovations show what it has left. So the log is filtered again with other sizes and
times, and those that make it likeliest are taken, as far as they are usual of receivers: for each source the white noise, in
parts of what the receiver says, and sigma and correlation time of a first-order Gauss-Markov error. Velocities are smoothed in
the loops that track their signals, over seconds; where places have slow errors, velocities are asked for theirs.

Steps are taken in logarithms, along one figure at a time, to the top of the parabola through three likelihoods, and only upward. A
measurement that the gate keeps out costs what the gate allows, whatever its size: outliers choose no noise.

Source: R. Mehra, "Approaches to adaptive filtering", IEEE Trans. Autom. Control 17 (1972), maximum likelihood by innovations. What
is usual of receivers is ours.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable

import numpy as np
from numpy.typing import NDArray

from truenorth.aiding.source import Aiding
from truenorth.analysis.chi_square import chi_square_limit
from truenorth.core.errors import DataError
from truenorth.errors.group import Group
from truenorth.quality.slow_aids import FIXES, KINDS, LEAST, SPEEDS, Lasting, Slow, wanders
from truenorth.state.evidence import Evidence
from truenorth.state.limits import limit
from truenorth.state.track import Residuals, Track

Array = NDArray[np.float64]

# White noise in parts of what is said, sigma of the slow error in parts of that, its time, s; and by which factor they may differ
USUAL = {FIXES: ((0.5, 0.9, 60.0), (3.0, 1.5, 2.5)), SPEEDS: ((0.9, 0.4, 8.0), (1.5, 2.0, 2.5))}
FIRST = math.log(2.0)  # the first step, of all figures; half as long in each sweep
SWEEPS = 3
FARTHEST = 2.0  # steps, to the top of a parabola
GAINED = 0.5  # of twice the log-likelihood, in a sweep that is worth another one


def usual(aiding: Iterable[Aiding]) -> dict[str, Lasting]:
    """Slow errors as they are usual of receivers, next to all that these say of their noise, by the source's name.

    Of receivers of whose errors no log has shown how they last.
    """
    return {s.name: lasting_of(s, 1.0, *USUAL[s.name][0][1:]) for s in _unsaid(aiding)}


def fitted(
    run: Callable[[Slow], Track], slow: Slow, aiding: Iterable[Aiding], *, said: bool
) -> tuple[Slow, list[Evidence]]:
    """These slow errors, those of a receiver as large and as long as the log makes likeliest; what is new is to be said.

    Parameters
    ----------
    run : callable
        Filters the log, or a part of it, with other slow errors.
    slow : mapping of str to Lasting
        That innovations have shown, by the source's name.
    aiding : iterable of Aiding
        Sources without them.
    said : bool
        Whether the receiver says how good its fixes are: else what was seen in innovations is the usual size of their slow error.
    """
    sources = {s.name: s for s in _unsaid(aiding)}
    names = [name for name in sources if name in slow or name == SPEEDS]
    if not any(name in slow for name in names):
        return slow, []
    middle, spread = (np.log([USUAL[name][k] for name in names]) for k in (0, 1))
    if not said and FIXES in slow:
        seen = slow[FIXES].group.sigma[0] / _level(sources[FIXES])
        middle[names.index(FIXES), 1], spread[names.index(FIXES), 1] = math.log(seen), math.log(3.0)

    def as_said(x: Array) -> dict[str, Lasting]:
        return {**slow, **{name: lasting_of(sources[name], *np.exp(row)) for name, row in zip(names, x, strict=True)}}

    def misfit(x: Array) -> float:
        try:
            track = run(as_said(x))
        except DataError:  # the filter broke down
            return math.inf
        return bounded_misfit(track.residuals) + float(np.sum(((x - middle) / spread) ** 2))

    found = as_said(lowest(misfit, middle))
    new = [(name, *_correlation(found[name], sources[name])) for name in names if name not in slow]
    unit = {name: sources[name].row.unit for name in names}
    return found, [wanders(name, r, size, unit[name]) for name, r, size in new if r > limit("colour")]


def _unsaid(aiding: Iterable[Aiding]) -> list[Aiding]:
    """Sources of a receiver of whose slow errors nothing was said."""
    return [s for s in aiding if s.name in USUAL and KINDS[s.name].role not in s.states]


def lowest(misfit: Callable[[Array], float], start: Array) -> Array:
    """Where a misfit is lowest, near its start: along one figure at a time, by the parabola through three values."""
    x, best, length = start.copy(), misfit(start), FIRST
    for _ in range(SWEEPS):
        before = best
        for at in np.ndindex(x.shape):
            step = np.zeros_like(x)
            step[at] = length
            below, above = misfit(x - step), misfit(x + step)
            tried = [(below, x - step), (above, x + step)]
            bend = below + above - 2.0 * best
            if bend > 0.0 and math.isfinite(bend):
                top = x + min(max(0.5 * (below - above) / bend, -FARTHEST), FARTHEST) * step
                tried.append((misfit(top), top))
            least, where = min(tried, key=lambda found: found[0])
            if least < best:
                best, x = least, where
        if before - best < GAINED:
            break
        length *= 0.5
    return x


def bounded_misfit(residuals: Iterable[Residuals]) -> float:
    """Minus twice the log-likelihood of measurements, but for a constant; none counts for more than the gate allows."""
    most = np.array([0.0, *(chi_square_limit(limit("gate"), rows) for rows in (1, 2, 3))])
    total = 0.0
    for r in residuals:
        rows = r.rows
        total += float(
            np.sum(np.minimum(np.where(rows > 0, r.nis, 0.0), most[rows])) + 2.0 * np.nansum(np.log(r.sigma))
        )
    return total


def _correlation(lasting: Lasting, source: Aiding) -> tuple[float, float]:
    """Of rows that follow each other, and sigma of what lasts."""
    size, white = float(lasting.group.sigma[0]), lasting.white * _level(source)
    apart = float(np.median(np.diff(np.sort(source.time))))
    return size**2 / (size**2 + white**2) * math.exp(-apart / lasting.group.lasts[0]), size


def _level(source: Aiding) -> float:
    """What a source says of east and north, one sigma."""
    return float(np.median(source.sigma[:, :2]))


def lasting_of(source: Aiding, white: float, size: float, time: float) -> Lasting:
    """White noise and slow error of a source, in parts of its sigma along the level; heights err more by what it says of them."""
    there = np.isfinite(source.measured[:, : source.row.rows]).any(axis=0)
    axes = np.where(there, np.median(source.sigma, axis=0) / _level(source), LEAST)
    kind = KINDS[source.name]
    return Lasting(Group(kind.name, size * _level(source) * axes, time, unit=source.row.unit), white)
