"""What of a state vector can be observed and what cannot, in words: ``r_forward + 200 m/s * tau``.

A null space says in numbers which changes of the state no measurement sees. Read are its complement's rows, the
combinations that *are* seen, brought to reduced echelon form: each is led by a state of its own and else holds only
the states that cannot be separated from others, so that it is as short as it can be. States come in the caller's order:
the first are given in terms of the last.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truenorth.core.errors import UsageError
from truenorth.core.units import Dimension, parse_unit

Array = NDArray[np.float64]

DIGITS = 3  # of a coefficient


@dataclass(frozen=True)
class Combination:
    """A weighted sum of states."""

    names: tuple[str, ...]  # of its states; the first has the coefficient 1
    coefficients: tuple[float, ...]  # SI
    units: tuple[str, ...]  # of the coefficients; empty for a pure number

    def __str__(self) -> str:
        text = self.names[0]
        for name, coefficient, unit in zip(self.names[1:], self.coefficients[1:], self.units[1:]):
            size = f"{abs(coefficient):.{DIGITS}g}"
            factor = "" if size == "1" and not unit else f"{size} {unit} * " if unit else f"{size} * "
            text += f" {'-' if coefficient < 0 else '+'} {factor}{name}"
        return text


@dataclass(frozen=True)
class Entangled:
    """States that the measurements do not separate.

    Attributes
    ----------
    states : tuple of str
        All of them, in the caller's order.
    free : tuple of str
        As many of them as there are directions nobody sees: were these known, so would be the others.
    observable : tuple of Combination
        What is seen of them; none where a state is not seen at all.
    """

    states: tuple[str, ...]
    free: tuple[str, ...]
    observable: tuple[Combination, ...]

    def __str__(self) -> str:
        if not self.observable:
            return f"{_listed(self.states)} {'is' if len(self.states) == 1 else 'are'} not seen at all"
        said = _listed([str(c) for c in self.observable])
        be = "is" if len(self.observable) == 1 else "are"
        return f"of {_listed(self.states)} only {said} {be} observable"


def entangled_states(
    null: ArrayLike, scale: ArrayLike, names: Sequence[str], units: Sequence[str], negligible: float = 1e-6
) -> tuple[Entangled, ...]:
    """Groups of states that an unobservable subspace ties together; states that are in none are observable.

    Parameters
    ----------
    null : (n, p) array
        Directions that are not seen, in columns, state units.
    scale : (n,) array
        Size of each state, such as its prior sigma: what is small is judged against it.
    names, units : n str
        Of the states; units as in "m/s^2", states in SI.
    negligible : float
        Coefficients below this, each state in units of its `scale`, are left out.

    Raises
    ------
    UsageError
        Numbers of names or units that do not fit, an unknown unit, or a scale that is not positive.
    """
    directions, size = np.asarray(null, dtype=np.float64), np.asarray(scale, dtype=np.float64)
    n = len(size)
    if directions.ndim != 2 or len(directions) != n or len(names) != n or len(units) != n:
        raise UsageError(
            f"null has shape {directions.shape} with {len(names)} names, {len(units)} units and {n} scales; expected "
            "(n, p) with n of each"
        )
    if not np.all(size > 0.0):
        raise UsageError(f"scale of {names[int(np.argmin(size))]} is {size.min()}, expected a positive size")
    dimensions = [parse_unit(unit)[1] for unit in units]
    if directions.shape[1] == 0:
        return ()

    pivots, free, echelon = _reduced_echelon(_complement(directions / size[:, None]), negligible)
    tied = np.abs(echelon) > negligible  # (pivots, free)
    groups = []
    for f_in, p_in in _components(tied):
        members = sorted([free[f] for f in f_in] + [pivots[p] for p in p_in])
        seen = []
        for p in p_in:
            states = [pivots[p], *(free[f] for f in f_in if tied[p, f])]
            weights = np.array([1.0, *(echelon[p, f] for f in f_in if tied[p, f])]) / size[states]
            seen.append(_combination(states, weights, names, dimensions))
        groups.append(
            Entangled(tuple(names[i] for i in members), tuple(names[free[f]] for f in f_in), tuple(seen)),
        )
    return tuple(groups)


def _complement(directions: Array) -> Array:
    """(n - p, n) orthonormal rows that no direction has a part in."""
    U, s, _ = np.linalg.svd(directions)
    return U[:, int(np.sum(s > 1e-12 * s[0])) :].T


def _reduced_echelon(rows: Array, negligible: float) -> tuple[list[int], list[int], Array]:
    """Columns that lead, the others, and the others' coefficients in the reduced echelon form."""
    rest = rows.copy()
    pivots: list[int] = []
    for j in range(rows.shape[1]):
        column = rest[:, j]
        length = np.linalg.norm(column)
        if length > negligible and len(pivots) < len(rows):
            pivots.append(j)
            rest = rest - np.outer(column, column @ rest) / length**2
    free = [j for j in range(rows.shape[1]) if j not in pivots]
    # As many pivots as rows but for columns below `negligible`; least squares passes over what those hold.
    return pivots, free, np.asarray(np.linalg.lstsq(rows[:, pivots], rows[:, free], rcond=None)[0])


def _components(tied: NDArray[np.bool_]) -> list[tuple[list[int], list[int]]]:
    """Connected parts of the graph between free columns and pivots, each with its free columns and its pivots."""
    left, parts = set(range(tied.shape[1])), []
    while left:
        f_in, p_in, grown = {min(left)}, set[int](), True
        while grown:
            p_new = {int(p) for p in np.flatnonzero(tied[:, sorted(f_in)].any(axis=1))}
            f_new = f_in | {int(f) for f in np.flatnonzero(tied[sorted(p_new)].any(axis=0))}
            grown, f_in, p_in = f_new != f_in or p_new != p_in, f_new, p_new
        left -= f_in
        parts.append((sorted(f_in), sorted(p_in)))
    return parts


def _combination(states: list[int], weights: Array, names: Sequence[str], dimensions: list[Dimension]) -> Combination:
    """The sum with its first coefficient 1; of two states the one leads that leaves the other at 1 or more."""
    order = list(range(len(states)))
    if len(states) == 2 and abs(weights[1]) < abs(weights[0]):
        order.reverse()
    lead = order[0]
    return Combination(
        tuple(names[states[i]] for i in order),
        tuple(float(weights[i] / weights[lead]) for i in order),
        tuple(_quotient(dimensions[states[lead]], dimensions[states[i]]) for i in order),
    )


def _quotient(a: Dimension, b: Dimension) -> str:
    """SI unit of a quotient, such as ``m/s^2``; angles count as numbers."""
    above: list[str] = []
    below: list[str] = []
    for symbol, exponent in zip(("m", "s", "K"), (x - y for x, y in zip(a[1:], b[1:]))):
        if exponent:
            (above if exponent > 0 else below).append(symbol + _exponent(abs(exponent)))
    text = " ".join(above)
    if below:
        text += "/" + (below[0] if len(below) == 1 else f"({' '.join(below)})")
    return text


def _exponent(power: Fraction) -> str:
    return "" if power == 1 else f"^{power}" if power.denominator == 1 else f"^({power})"


def _listed(words: Sequence[str]) -> str:
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"
