"""Errors of an indexer's encoder, by how the base turns with its angles: zero, discs out of centre, slips.

With the IMU's attitude by its gyros and the encoder's angles the base turns by ``r(t) = sway - u_o e_o - u_i e_i`` about its mean
attitude, ``u`` the directions of the axes in the base and ``e`` what their angles are off by: a zero (that of the inner angle; that
of the outer one defines the body's axes), once and twice a turn ``c cos(n a) + s sin(n a)``, and steps. All are fitted at once by
generalised least squares. The sway is what an autoregression of each axis' turns predicts: its innovations are white, and they are
what is fitted. What is left of errors of the gyros, of the mounting and of the clock is fitted too, as large as it may be.

An autoregression may take an error for sway that is as regular: it is that of what is left without the errors, as they are known
from pass to pass, and allows for a noise about as large as what is left of them. Sway may go with the axes for a while. So an error
of the angles has to stand out against patterns by which no such error turns the base: as fast, but mirrored or about other axes,
and nearly as fast, about the same ones. It has to do so with longer and shorter autoregressions, and against a line of the sway
that is nearly as fast. A disc of an axis that turns at one rate looks as a sway of that period does
(:mod:`truenorth.quality.encoder_patterns`): it is in sigma, and no contradiction.

Source: G. Jenkins, D. Watts, Spectral Analysis and its Applications, Holden-Day, 1968 (generalised least squares by whitening).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.analysis.student import student_limit
from truenorth.quality.encoder import USUAL_ZERO
from truenorth.quality.encoder_patterns import LIKE, Turns, bell, lines_in_time, own_share, patterns_of, unlike
from truenorth.quality.prediction import Whitener, prediction
from truenorth.state.evidence import Effect, Evidence, Figure, Kind
from truenorth.state.limits import limit

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

ORDERS = (30, 15)  # of autoregressions
FEWEST = 6  # samples for each of an order
SHORTEST = 40  # samples that show anything
CELL = 1.0  # s from sample to sample for what goes with the angles
FASTEST = 0.7  # rad by which an axis turns from sample to sample: twice as much is sampled well enough
NEARER = tuple(0.25 * k for k in range(-12, 13) if abs(k) > 1)  # the same, of a line
PRODUCTS = (
    1.0  # times what products of the sway show of an outer axis' pattern, a line as its own is: an error is larger
)
UNSURE = 0.99  # of the limit of an error
IN_THE_SEA = "1.2"  # twice a turn of the outer axis is as fast as waves: one of them may be it (1 of 60 made sways)
LINE = 0.3  # of an error's size, from which a line of the sway may have made it
OWN = 0.2  # of the energy of a pattern, which the fit leaves of it, from which it is one of its own
UNKNOWN = math.radians(10.0)  # rad, one sigma: of what is looked for
MOUNTED = math.radians(1.0)  # rad, one sigma: of axes and of the IMU's mounting
LATE = 1.0  # s, one sigma: of the encoder's clock
STEADY = 0.05  # of its largest rate, by which that of an axis changes: a delay is a zero there
MOST_GONE = 40  # samples in gaps
# rad, of white noise that the autoregressions of the passes allow for: a line no higher, left over from an error, is no sway
NOISES = (1.7e-4, 3.5e-5, 0.9e-5)


@dataclass(frozen=True)
class Fit:
    """Generalised least squares of the base's turns."""

    turns: Turns
    white: Whitener
    sway: Array  # (K, 3) rad: turns, less what is fitted
    left: Array  # (N, 3) whitened
    columns: Array  # (N, 3, m) whitened
    C: Array  # (m, m) covariance
    found: Array  # (m,)
    groups: dict[str, slice]  # of the columns: what is looked for, and a delay

    def group(self, name: str) -> tuple[Array, Array]:
        """What is found of a group, and its covariance."""
        part = self.groups[name]
        return self.found[part], self.C[part, part]

    def ratio(self, name: str) -> float:
        """Chi-square of a group by its degrees of freedom."""
        x, P = self.group(name)
        return float(x @ np.linalg.pinv(P, hermitian=True) @ x) / len(x)

    def gains(self, patterns: Array) -> tuple[Array, Array]:
        """Of other patterns (K, 3, n) the part that is their own, and the chi-square that each would explain, one degree each."""
        w = self.white(patterns).reshape(self.left.size, -1)
        X = self.columns.reshape(self.left.size, -1)
        both, energy = X.T @ w, np.sum(w**2, axis=0)
        own = energy - np.sum(both * (self.C @ both), axis=0)
        chi = (self.left.ravel() @ w) ** 2 / np.maximum(own, 1e-12 * energy + 1e-300)
        return own / np.maximum(energy, 1e-300), chi


def looks(turns: Turns) -> bool:
    """Whether there are samples enough, and few gaps."""
    return len(turns.time) >= SHORTEST and int(np.count_nonzero(~turns.there)) <= MOST_GONE


def fitted(
    turns: Turns,
    order: int,
    more: Array | None = None,
    noises: Sequence[float] = NOISES,
    white: Whitener | None = None,
) -> Fit:
    """A fit, its autoregressions those of what it leaves.

    Parameters
    ----------
    turns : Turns
    order : int
        Of the autoregressions, in a log that is long enough.
    noises : sequence of float, rad
        That the autoregressions of the passes allow for.
    white : Whitener, optional
        Those to take, as they are.
    more : (K, 3, n) array, optional
        Columns to fit besides, group ``more``.
    """
    nuisance, sigma = _nuisance(turns)
    named = dict(patterns_of(turns)) | ({} if more is None else {"more": more})
    gone = np.flatnonzero(~turns.there)
    missing = np.zeros((len(turns.time), 3, 3 * gone.size))
    for i, row in enumerate(gone):
        missing[row, :, 3 * i : 3 * i + 3] = np.eye(3)
    X = np.concatenate([nuisance, *named.values(), missing], axis=2)
    groups, first = {}, nuisance.shape[2]
    if not steady(turns):  # the last of them
        groups["late"] = slice(first - 1, first)
    for name, columns in named.items():
        groups[name] = slice(first, first + columns.shape[2])
        first += columns.shape[2]
    weight = np.concatenate([sigma, np.full(X.shape[2] - len(sigma), UNKNOWN)]) ** -2.0
    r = _bridged(turns)
    base = X[:, :, :6]
    start = np.concatenate([base, X[:, :, len(sigma) : first]], axis=2)
    # Weighted by a bell, that sway, however large, does not leak into what is slower.
    seen = (start * bell(turns)[:, None, None]).reshape(-1, start.shape[2])
    left = r - start @ np.linalg.lstsq(seen, (r * bell(turns)[:, None]).ravel(), rcond=None)[0]
    given, order = white, min(order, len(turns.time) // FEWEST)
    for noise in noises if given is None else noises[:1]:
        white = given or prediction(left, turns.there, order, noise)
        y, W = white(r).ravel(), white(X).reshape(-1, X.shape[2])
        scale = np.sqrt(np.sum(W**2, axis=0) + weight)
        M = (W / scale).T @ (W / scale) + np.diag(weight / scale**2)
        C = np.linalg.pinv(M, rcond=1e-13, hermitian=True) / np.outer(scale, scale)
        found = C @ (W.T @ y)
        left = r - X @ found
    assert white is not None
    return Fit(turns, white, left, (y - W @ found).reshape(-1, 3), W.reshape(-1, 3, X.shape[2]), C, found, groups)


def _bridged(turns: Turns) -> Array:
    """(K, 3) turns with straight lines where there is no row: their columns take up what these miss."""
    seen = turns.there
    return np.stack([np.interp(turns.time, turns.time[seen], x[seen]) for x in turns.turn.T], axis=-1)


def _nuisance(turns: Turns) -> tuple[Array, Array]:
    """(K, 3, m) what turns the base and is no error of its angles, and one-sigmas (m,); six of them are never small."""
    K = len(turns.time)
    slow = np.linspace(-1.0, 1.0, K)[:, None, None] * np.eye(3)
    columns = [np.broadcast_to(np.eye(3), (K, 3, 3)), slow, turns.gyro]
    sigma = [np.full(6, math.pi), turns.gyro_sigma]
    inner = turns.directions[-1]
    seen = np.abs(np.einsum("kij,ki->kj", turns.C_bs, inner)[0])
    tilted = turns.C_bs[:, :, seen < 0.5]  # about the IMU's axes across the inner one
    if len(turns.directions) > 1:
        tilted = np.concatenate([tilted, np.cross(turns.directions[0], inner)[:, :, None]], axis=2)
    columns.append(tilted)
    sigma.append(np.full(tilted.shape[2], MOUNTED))
    if not steady(turns):
        columns.append(_late(turns))
        sigma.append(np.array([LATE]))
    return np.concatenate(columns, axis=2), np.concatenate(sigma)


def steady(turns: Turns) -> bool:
    """Whether the axes turn at one rate: a delay is a zero then."""
    rates = np.gradient(turns.angles, turns.step, axis=0)
    return bool(np.max(np.std(rates, axis=0)) <= STEADY * np.max(np.abs(rates)))


def _late(turns: Turns) -> Array:
    """(K, 3, 1) what an encoder that is late by a second turns the base by.

    By the rates of the moment: those from sample to sample are too small where an axis starts or stops, which is what shows a
    delay: it came out a tenth too large.
    """
    late = sum(u * rate[:, None] for u, rate in zip(turns.directions, turns.rates.T, strict=True))
    return np.asarray(late)[:, :, None]


def _shown(turns: Turns, x: Array, pattern: Array) -> float:
    """Amplitude, rad, of a pattern (K, 3, n) in a motion (K, 3), both weighted by a bell."""
    weight = bell(turns)[:, None]
    x = (x - np.sum(x * weight, axis=0) / np.sum(weight)) * weight
    w = (pattern * weight[:, :, None]).reshape(x.size, -1)
    return float(np.linalg.norm(w.T @ x.ravel() / np.sum(w**2, axis=0)))


def _line(fit: Fit, name: str) -> tuple[Array, float]:
    """(K, 3, n) the pattern nearly as fast as that of a name that the sway shows most of, and its amplitude there, rad."""
    patterns = unlike(fit.turns, name, NEARER)[1]
    return max(((each, _shown(fit.turns, fit.sway, each)) for each in patterns), key=lambda item: item[1])


def _by_products(turns: Turns, pattern: Array) -> float:
    """Amplitude, rad, of a pattern in what turns about two axes make about a third, by their products: lines of their own."""
    x = turns.turn
    products = (x[:, i] * x[:, j] for i in range(3) for j in range(i, 3))
    return max(_shown(turns, product[:, None] * axis, pattern) for product in products for axis in np.eye(3))


def beyond_chance(fit: Fit, name: str) -> float:
    """By how much a group stands out, in units of what chance and a sway that goes with the axes allow: above one it is there."""
    ratio, size = fit.ratio(name), fit.groups[name].stop - fit.groups[name].start
    noise = 1.0
    for i, patterns in enumerate(unlike(fit.turns, name)):
        own, chi = fit.gains(np.concatenate(patterns, axis=2))
        chi = chi[own > OWN]
        if not chi.size:
            continue
        mean, dof = float(np.mean(chi)), len(chi)
        allowed = (
            limit("indexer") ** 2 * max(1.0, mean) if i else f_limit(limit("swing with the axes"), size, dof) * mean
        )
        noise = max(noise, allowed)
    return ratio / max(noise, limit("indexer") ** 2)


def f_limit(chance: float, first: int, second: int) -> float:
    """What the ratio of two chi-squares, by their degrees of freedom (one or two, any), exceeds with the given probability."""
    if first == 1:
        return student_limit(chance, second) ** 2
    return float((chance ** (-2.0 / second) - 1.0) * second / 2.0)


class Standing(NamedTuple):
    """An error of the angles that stands out."""

    fit: Fit  # that shows it
    beyond: float  # by how much it is beyond chance
    like_sway: bool  # whether a sway of the base may look the same


def errors_of(turns: Turns, slip: Callable[[Turns], Array] | None = None) -> dict[str, Standing]:
    """By name what stands out."""
    turns = turns.thinned(
        min(CELL, FASTEST / max(float(np.max(np.abs(np.gradient(turns.angles, turns.step, axis=0)))), 1e-6))
    )
    if not looks(turns):
        return {}
    more = None if slip is None else slip(turns)
    fits = [fitted(turns, order, more) for order in ORDERS]
    hint = (limit("hint of an encoder's error") / limit("indexer")) ** 2
    found = {}
    for name, pattern in patterns_of(turns):
        beyond = min(beyond_chance(fit, name) for fit in fits)
        by_products = PRODUCTS * _by_products(turns, pattern) if name.startswith("1") else 0.0
        if beyond <= hint or np.linalg.norm(fits[0].group(name)[0]) < by_products:
            continue
        fit, (line, amplitude) = fits[0], _line(fits[0], name)
        size = float(np.linalg.norm(fit.group(name)[0]))
        if amplitude > LINE * size:
            fit, *others = (fitted(turns, order, _both(more, line)) for order in ORDERS)
            beyond = min(beyond, *(beyond_chance(each, name) for each in (fit, *others)))
        if beyond <= hint:
            continue
        like_sway = name != "zero" and _like_sway(turns, name, pattern, more)
        # Below all that the base sways by about as fast, or in the sea's band, it is a hint, however clear; so it is where a sway
        # looks the same.
        sure = size > amplitude and name != IN_THE_SEA and not like_sway
        found[name] = Standing(fit, beyond if sure else min(beyond, UNSURE), like_sway)
    disc, zero = found.get("1.1"), found.get("zero")
    # A sway of the outer axis' period is about no axis alone: what it makes of a zero is smaller.
    if disc is not None and zero is not None and disc.like_sway:
        sizes = [float(np.linalg.norm(item.fit.group(name)[0])) for name, item in (("zero", zero), ("1.1", disc))]
        if sizes[0] < sizes[1]:
            found["zero"] = zero._replace(beyond=min(zero.beyond, UNSURE))
    return found


def _like_sway(turns: Turns, name: str, pattern: Array, more: Array | None) -> bool:
    """Whether a sway of one line may be the disc of a name: the two are one, or what tells them apart does not show a disc."""
    lines = lines_in_time(turns, name)
    if lines is None:
        return False
    return (
        own_share(pattern, lines) < LIKE
        or min(beyond_chance(fitted(turns, order, _both(more, lines)), name) for order in ORDERS) < 1.0
    )


def _both(more: Array | None, columns: Array) -> Array:
    return columns if more is None else np.concatenate([more, columns], axis=2)


def error_evidence(
    turns: Turns, slip: Callable[[Turns], Array] | None = None, times: float = 1.0, said: float = 0.0
) -> list[Evidence]:
    """Zero and discs of an encoder that stand out.

    Between the limits of a hint and of an error chance may have shown one: its size is in sigma then.

    Parameters
    ----------
    turns : Turns
    slip : callable, optional
        By what a slip that was found turns the base (K, 3, 1), at the times of some turns.
    times : float
        By which the outer axis turns faster than the inner one: an encoder that is late turns heading by so many times a zero.
    said : float, rad
        One sigma that was said of the angles: an error of that size is in sigma already.
    """
    found = []
    for name, (fit, beyond, like_sway) in errors_of(turns, slip).items():
        x, P = fit.group(name)
        size, sigma = float(np.linalg.norm(x)), math.sqrt(float(np.trace(P)) / len(x))
        if size < limit("by chance") * said:
            continue
        kind: Kind = "hint" if beyond < 1.0 else "bounded" if size > USUAL_ZERO else "known"
        if name == "zero":
            figures: dict[str, Figure] = {"off": -float(x[0]), "sigma": sigma}
            found.append(Evidence("encoder.zero", figures, kind, Effect(max(1.0, times) * size, size), ("encoder",)))
            continue
        axis = int(name[0]) - 1
        tilted = math.sqrt(max(1.0 - float(np.mean(turns.directions[axis] @ turns.up)) ** 2, 0.0)) if axis == 0 else 1.0
        sways = float(np.max(np.linalg.norm(turns.turn, axis=1)))
        key = "encoder.disc" if name.endswith("1") else "encoder.disc_twice"
        if like_sway:
            key = "encoder.disc_or_sway"
        figures = {"axis": str(axis + 1), "size": size, "sigma": sigma}
        remedies = ("turn_back",) if like_sway else ("encoder",)
        found.append(Evidence(key, figures, kind, Effect(size, min(tilted + sways, 1.0) * size), remedies))
    return found
