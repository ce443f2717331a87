"""Kalman filters that damp: on the velocity error, on its change, on both with the reference's own error, and the fusion.

All estimate the errors of one undamped INS, open loop (output correction), on the model of :mod:`truenorth.errors.marine`:

- *filter 1*: ``z = v_INS - v_ref``;
- *filter 2*: ``z = ((v_INS - v_ref)(t) - (v_INS - v_ref)(t - T))/T``, in which a constant error of the reference cancels; its
  ``H`` is the mean of rows DV of F over T, since ``(dv(t) - dv(t - T))/T`` is the mean of ``dv'``. The reference is filter 1's
  smoothed velocity (the paper's), or the raw one;
- *augmented*: filter 1 with the errors of the log as further states (:mod:`truenorth.errors.log`).

Windows of filter 2 overlap where it is updated more often than every T, and its noise is then not white; the paper's R takes
no notice. What that and the common noise of both filters cost is measured in the study (:mod:`truenorth.papers.damping`).

Source: L. Zhao, J. Li, J. Cheng, J. Harbin Inst. Technol. 50 (3), 2018, eq. 2-4; the augmented filter is not the paper's.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truenorth.core.errors import UsageError
from truenorth.damping.course import intervals, without_errors
from truenorth.damping.fix_rows import FixRows, Weighed
from truenorth.errors.log import log_rows
from truenorth.errors.marine import DV, MOTION, PHI, STATES, MarineModel
from truenorth.filters import FilterState, LinearSystem, gated, kalman
from truenorth.state.track import Track

Array = NDArray[np.float64]
Linear = tuple[Array | None, Array]  # F, where it is asked for, and Phi of K intervals, (K, n, n)

BLOCK = 3600  # epochs linearised at a time: some 20 MB
FRESH = 300  # epochs for which a filter that re-linearises does so
SETTLING = 30.0  # s, in which filter 1 finds the velocity error from what it was given at the switch


@dataclass(frozen=True)
class Estimate:
    """Errors of a course that a filter found, from the epoch on at which it was switched on.

    Attributes
    ----------
    start : int
        Epoch of the switch; rows are epochs ``start`` and on.
    x, sigma : (K+1-start, n) arrays
    P : (n, n) array
        At the last epoch.
    used : (K+1-start, 2) array
        1 for a measurement taken, 0 for one rejected by the gate, NaN for none.
    innovation, innovation_sigma : (K+1-start, 2) arrays or None
        NaN where there is no measurement; None: of a fusion.
    likelihood : float
        Logarithm of that of all measurements.
    weight : (K+1-start, n) array or None
        Of filter 1, in a fusion.
    fixes : Weighed or None
        What it made of its fixes.
    """

    start: int
    x: Array
    sigma: Array
    P: Array
    used: Array = field(repr=False)
    innovation: Array | None = field(default=None, repr=False)
    innovation_sigma: Array | None = field(default=None, repr=False)
    likelihood: float = 0.0
    weight: Array | None = field(default=None, repr=False)
    fixes: Weighed | None = field(default=None, repr=False)

    @property
    def rejected(self) -> int:
        """Measurements that the gate kept out."""
        return int(np.sum(self.used == 0.0))


@dataclass(frozen=True)
class Filter:
    """One of the filters: its model, its noise, what it knows at the switch.

    Attributes
    ----------
    model : MarineModel
        With groups of the log: the augmented filter.
    P0 : (n, n) array
        Covariance of the errors at the switch.
    sigma : float
        Of the measurement: m/s, or m/s^2 of a velocity change.
    window : float, s
        T of filter 2; 0: the velocity error itself.
    overlap : bool
        Update at every epoch, with windows that overlap and noise that is then not white, as the paper does; else at the end
        of every window only.
    relinearise : bool
        Take the model midway between the computed course and the one this filter finds, ``f(x_hat) - f(x) = F((x_hat + x)/2) e``
        to second order; else about the computed course, as the paper does.
    gate : float, optional
        Probability with which a good measurement passes a chi-square gate; no gate when left out.
    fixes : FixRows or None
        Places and headings from outside; each has a gate of its own.
    turned : bool
        The log is in body axes, and the INS's own heading has turned it: its error shows as ``phi x v``.
    """

    model: MarineModel
    P0: Array
    sigma: float
    window: float = 0.0
    overlap: bool = True
    relinearise: bool = False
    gate: float | None = None
    turned: bool = False
    fixes: FixRows | None = None

    def __post_init__(self) -> None:
        n = self.model.states
        if np.shape(self.P0) != (n, n):
            raise UsageError(f"P0 has shape {np.shape(self.P0)}, expected ({n}, {n}) as the model has states")
        if not (self.sigma > 0.0 and self.window >= 0.0):
            raise UsageError(
                f"sigma {self.sigma:g}, window {self.window:g} s; expected sigma above zero, no negative window"
            )

    def rows(self, course: Track) -> Array:
        """(K, 2, n) what of its states ``v_INS - v_log`` shows, at the epochs of a course after the first."""
        v, C = course.v_n[1:], course.C_nb[1:]
        H = np.zeros((len(v), 2, self.model.states))
        H[:, :, DV] = np.eye(2)
        H[:, :, STATES:] = -log_rows(self.model.groups, C, v)
        if self.turned:
            H[:, 0, PHI.stop - 1], H[:, 1, PHI.stop - 1] = -v[:, 1], v[:, 0]
        return H

    def lag(self, interval: float) -> int:
        """Epochs from the beginning of a window to its end; 0 without a window."""
        return max(1, round(self.window / interval)) if self.window > 0.0 else 0


class _Stream:
    """A filter that is fed block by block."""

    def __init__(self, kind: Filter, course: Track, start: int, seen: Track | None, about: Array | None) -> None:
        self.kind, self.lag, self.interval = kind, kind.lag(course.interval), course.interval
        self.seen = None if seen is None else seen[start:]
        count, n = len(course) - start, kind.model.states
        self.about = np.zeros((count, MOTION.stop)) if about is None else about
        self.x, self.sigma, self.used = np.zeros((count, n)), np.empty((count, n)), np.full((count, 2), np.nan)
        self.sigma[0] = np.sqrt(np.diagonal(kind.P0))
        self.innovation, self.innovation_sigma = np.full((count, 2), np.nan), np.full((count, 2), np.nan)
        self.state: FilterState | None = None
        self.rows = np.zeros((0, 2, n))
        self.done = 1
        self.fixes = None if kind.fixes is None else Weighed(kind.fixes)

    def feed(self, part: Track, z: Array, linear: Linear | None = None) -> None:
        """Take the next epochs: K intervals of the course, z (K, 2), and what it is linear in, where that is known."""
        if self.kind.relinearise and len(z) > FRESH:
            for begin in range(0, len(z), FRESH):
                end = min(begin + FRESH, len(z))
                self.feed(part[begin : end + 1], z[begin:end])
            return
        epochs = slice(self.done - 1, self.done + len(z))
        known = self.about[epochs]
        if self.kind.relinearise:
            last = self.x[self.done - 1, MOTION]
            before = self.x[max(self.done - len(part), 0), MOTION]
            ahead = last + (last - before if self.done > FRESH else 0.0) / 2.0  # at the middle of these epochs
            known = ahead / 2.0
            part = without_errors(part, known)
        if linear is None:
            model, along = self.kind.model, intervals(part)
            linear = model.linearise(along) if self.lag else (None, model.transitions(along))
        F, Phi = linear
        n, K = self.kind.model.states, len(Phi)
        if self.lag == 0:
            H = self.kind.rows(part if self.seen is None else without_errors(self.seen[epochs], known))
        else:
            assert F is not None  # with a window there is
            rows = np.concatenate([self.rows, F[:, DV, :n]])
            total = np.concatenate([np.zeros((1, 2, n)), np.cumsum(rows, axis=0)])
            first = len(self.rows) + 1 + np.arange(K) - self.lag
            H = (total[len(self.rows) + 1 :] - total[np.maximum(first, 0)]) / self.lag
            z = np.where((first >= 0)[:, None], z, np.nan)
            self.rows = rows[-self.lag :]
        Q = self.kind.model.noise_of(self.interval, 0.5 * (part.v_n[1:] + part.v_n[:-1]))
        at = np.zeros(0, dtype=int) if self.kind.fixes is None else self.kind.fixes.epoch - self.done
        ends = np.unique(np.append(at[(at >= 0) & (at < K)] + 1, K))  # behind each row that a fix comes with
        for begin, end in zip(np.append(0, ends[:-1]), ends, strict=True):
            some = slice(begin, end)
            self._run(Phi[some, :n, :n], Q[some] if len(Q) > 1 else Q, H[some], z[some])

    def _run(self, Phi: Array, Q: Array, H: Array, z: Array) -> None:
        """Through rows of the log, and the fixes behind the last of them."""
        kind, n, place = self.kind, self.kind.model.states, slice(self.done, self.done + len(z))
        system = LinearSystem(Phi, Q, H, kind.sigma**2 * np.eye(2)[None], z, np.zeros(n), kind.P0)
        if kind.gate is None:
            found = kalman(system, self.state, history="sigma")
            self.used[place] = np.where(np.isnan(z), np.nan, 1.0)
        else:
            found = gated(system, self.state, probability=kind.gate, history="sigma")
            self.used[place] = found.adaptation
        variance, nu = np.diagonal(found.innovation_covariance, axis1=1, axis2=2), found.innovation
        self.innovation[place], self.innovation_sigma[place] = nu, np.where(np.isfinite(nu), np.sqrt(variance), np.nan)
        self.x[place], self.sigma[place] = found.x, found.sigma
        self.state, self.done = found.state, place.stop
        if self.fixes is None:
            return
        for number in np.flatnonzero(self.fixes.fixes.epoch == place.stop - 1):
            self.state = self.fixes.take(int(number), self.state)
            self.x[place.stop - 1] = self.state.x
            self.sigma[place.stop - 1] = np.sqrt(np.diagonal(self.state.P))

    def estimate(self, start: int) -> Estimate:
        assert self.state is not None  # there is one block at least
        return Estimate(
            start,
            self.x,
            self.sigma,
            self.state.P,
            self.used,
            self.innovation,
            self.innovation_sigma,
            float(self.state.log_likelihood),
            fixes=self.fixes,
        )


def run_filters(
    course: Track,
    reference: Array,
    *,
    start: int,
    kinds: Mapping[str, Filter],
    workers: int = 1,
    about: Array | None = None,
    seen: Track | None = None,
) -> dict[str, Estimate]:
    """Run filters over a course, all switched on at one epoch.

    Parameters
    ----------
    course : Track
    reference : (K+1, 2) array, m/s
        Reference velocity east, north; NaN where absent.
    start : int
        Epoch of the switch.
    kinds : mapping of name to Filter
        A filter with a window is on the raw reference; but the one named ``filter2`` is on the velocity that ``filter1``
        smooths, as in the paper.
    workers : int
        Threads; filter 2 follows filter 1, the others are free.
    about : (K+1-start, 7) array, optional
        Errors as they are known already: the dynamics are taken midway between the computed course and the one without them, and
        what the log shows, which is linear in the true velocity, on the one without them. No filter then re-linearises.
    seen : Track, optional
        Attitude and velocity by which the log shows its errors, where these are means (:mod:`truenorth.damping.waves`).

    Raises
    ------
    UsageError
        Filter 2 without filter 1; a start beyond the course.
    """
    if "filter2" in kinds and ("filter1" not in kinds or kinds["filter1"].window > 0.0):
        raise UsageError("filter2 is on the velocity that filter1 smooths; expected both, or another name for it alone")
    if not 0 <= start < len(course) - 1:
        raise UsageError(f"start at epoch {start}; expected 0 to {len(course) - 2}")
    if about is not None:
        kinds = {name: replace(kind, relinearise=False) for name, kind in kinds.items()}
    streams = {name: _Stream(kind, course, start, seen, about) for name, kind in kinds.items()}
    z = course.v_n[:, :2] - reference
    interval = course.interval
    settling = max(1, round(SETTLING / interval))
    firm = ~silences(np.asarray(np.isnan(z).any(axis=1)), settling)

    def change(of: Array, stream: _Stream, begin: int, end: int, since: int) -> Array:
        """(end - begin, 2) of the epochs after `begin`; windows that begin before `since` or in a silence are absent."""
        lag, ends = stream.lag, np.arange(begin + 1, end + 1)
        out = np.full((len(ends), 2), np.nan)
        there = (ends - lag >= since) & firm[ends] & firm[np.maximum(ends - lag, 0)]
        if not stream.kind.overlap:
            there &= (ends - since) % lag == 0
        out[there] = (of[ends[there]] - of[ends[there] - lag]) / (lag * interval)
        return out

    smoothed = np.zeros_like(z)  # filter 1's estimate of dv: what is left of v_INS - v_ref, smoothed

    def run(begin: int, names: Sequence[str]) -> None:
        """Some of the filters through one block; those whose models move alike share one matrix."""
        end = min(begin + BLOCK, len(course) - 1)
        part = middle = course[begin : end + 1]
        if about is not None:
            known = about[begin - start : end - start + 1]
            part, middle = without_errors(part, known), without_errors(part, 0.5 * known)
        along = intervals(middle)
        last: tuple[MarineModel, Array] | None = None
        for name in names:
            stream, model, leads = streams[name], streams[name].kind.model, name == "filter1" and "filter2" in streams
            linear: Linear | None = None
            if not stream.kind.relinearise and (leads or stream.lag):
                linear = model.linearise(along)
            elif not stream.kind.relinearise:
                last = model, model.transitions(along, last)
                linear = None, last[1]
            of = z[begin + 1 : end + 1] if not stream.lag else change(z, stream, begin, end, start)
            stream.feed(part, of, linear)
            if leads:
                two, rows = streams["filter2"], slice(begin + 1, end + 1)
                smoothed[rows] = stream.x[begin + 1 - start : end + 1 - start, DV]
                same = two.kind.model == stream.kind.model and not two.kind.relinearise
                two.feed(part, change(smoothed, two, begin, end, start + settling), linear if same else None)

    free = [name for name in kinds if name != "filter2"]
    shares = [free[i::workers] for i in range(min(max(workers, 1), len(free)))]
    with ThreadPoolExecutor(len(shares)) as pool:
        for begin in range(start, len(course) - 1, BLOCK):
            list(pool.map(partial(run, begin), shares))
    return {name: stream.estimate(start) for name, stream in streams.items()}


def silences(absent: NDArray[np.bool_], settling: int) -> NDArray[np.bool_]:
    """(K+1,) epochs in a silence as long as filter 1 takes to settle, or before it has settled again."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], absent.astype(np.int8), [0]])))
    out = np.zeros(len(absent), dtype=bool)
    for first, last in zip(edges[::2], edges[1::2], strict=True):
        if last - first >= settling:
            out[first : last + settling] = True
    return out


@dataclass(frozen=True)
class Fusion:
    """The paper's fusion: by the diagonals of P, that of filter 1 enlarged by how far it has left filter 2.

    ``beta P_11 = P_11 + gamma Xbar^2`` state by state, with ``Xbar`` the mean over `samples` epochs of the difference of the
    estimates and ``gamma = 1/(1 + exp(-rate (t - t_0 - middle)))``.

    Attributes
    ----------
    rate : float, 1/s
        The paper's a.
    middle : float, s
        The paper's t_m: after the switch, when gamma is .5.
    samples : int
        The paper's N.
    """

    rate: float = 0.0005
    middle: float = 4.0 * 3600.0
    samples: int = 3600

    def __post_init__(self) -> None:
        if not (self.rate > 0.0 and self.middle >= 0.0 and self.samples >= 1):
            raise UsageError(
                f"fusion: rate {self.rate:g}, middle {self.middle:g} s, {self.samples} samples out of range"
            )

    def gamma(self, since: ArrayLike) -> Array:
        """How far the difference is trusted, at times after the switch (s)."""
        return np.asarray(1.0 / (1.0 + np.exp(-self.rate * (np.asarray(since, dtype=np.float64) - self.middle))))

    def __call__(self, one: Estimate, two: Estimate, interval: float) -> Estimate:
        """Fuse filter 1 and filter 2 of one course."""
        difference = one.x - two.x
        total = np.concatenate([np.zeros((1, difference.shape[1])), np.cumsum(difference, axis=0)])
        ends = np.arange(1, len(total))
        begins = np.maximum(ends - self.samples, 0)
        mean = (total[ends] - total[begins]) / (ends - begins)[:, None]
        gamma = self.gamma(interval * np.arange(len(difference)))
        of_one = one.sigma**2 + gamma[:, None] * mean**2
        of_two = two.sigma**2
        whole = of_one + of_two
        weight = np.divide(of_two, whole, out=np.full(whole.shape, 0.5), where=whole > 0.0)
        variance = weight * of_one
        x = weight * one.x + (1.0 - weight) * two.x
        return Estimate(one.start, x, np.sqrt(variance), np.diag(variance[-1]), one.used, weight=weight)
