"""Is the base leaving? A generalised likelihood ratio test of the innovations against drift signatures.

A base that begins to drift away looks to the filter like tilt or a wrong heading, and the mean NIS does not see it.
A bank of signatures (a step of velocity, a velocity that grows; east or north; from each sixteenth of the log on) is sent
through the filter, and its innovations are matched with the real ones. A constant velocity from the very beginning cannot
be seen by anyone: north velocity v equals a heading error of v/(R w_ie cos L).

Source: A. Willsky and H. Jones, "A generalized likelihood ratio approach to the detection and estimation of jumps in
linear systems", IEEE Trans. Autom. Control 21 (1976), eqs. 13-20.

What a signature of the size found does to attitude follows from the same recursion: the state that the filter estimates from
the signature alone.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.fine import FineAlignment
from truenorth.errors.staying import PHI
from truenorth.filters.gains import through
from truenorth.state.evidence import Effect, Evidence, Figure, Kind
from truenorth.state.limits import limit

Array = NDArray[np.float64]

# Of fewer, a departure lies between two: one at .59 of a log matched with a ratio of 14 at quarters of it, of 22 close by.
ONSETS = tuple(k / 16 for k in range(1, 16))
KINDS, AXES = ("step", "ramp"), ("east", "north")
AT_ONCE = 3  # onsets that are matched together: they take memory


@dataclass(frozen=True)
class Drift:
    """The best matching drift."""

    # twice the logarithm of the likelihood ratio; chi-square with one degree of freedom where there is no drift
    ratio: float
    kind: str  # ``step`` or ``ramp`` of velocity; ``east`` or ``north``
    axis: str
    onset: float  # s; since the beginning of the log
    velocity: float  # m/s; at the end of the log
    # rad; errors that the drift leaves in the answer: the largest of all signatures that match beyond chance
    heading: float
    level: float  # rad

    @property
    def found(self) -> bool:
        """Whether it is likelier than chance."""
        return self.ratio > limit("hint")

    @property
    def sure(self) -> bool:
        """Whether chance is ruled out."""
        return self.ratio > limit("drift")

    def evidence(self) -> Evidence:
        """The drift, with its effect: another course of the same size does about as much."""
        figures: dict[str, Figure] = {
            "axis": self.axis,
            "onset": self.onset,
            "velocity": abs(self.velocity),
            "ratio": self.ratio,
            "chance": limit("hint"),
            "heading": self.heading,
            "level": self.level,
        }
        kind: Kind = "bounded" if self.sure else "known"  # what may be chance is added to sigma
        return Evidence(f"drift.{self.kind}", figures, kind, Effect(self.heading, self.level), remedies=("still_part",))


def detect_drift(fine: FineAlignment, others: Array | None = None) -> Drift:
    """Match the innovations of a fine alignment with the bank of drift signatures; `others` as of :func:`matched`."""
    ratio, size, x = matched(fine, _signatures(fine), others)
    best = int(np.argmax(ratio))
    onset, kind, axis_name = list(product(ONSETS, KINDS, AXES))[best]
    start = onset * fine.integrals.time[-1]
    turned = np.where(ratio > limit("hint"), np.abs(x[PHI] * size), 0.0)  # (3, S): E, N, U
    heading, level = turned[2].max(), np.hypot(turned[0], turned[1]).max()
    return Drift(float(ratio[best]), kind, axis_name, float(start), float(size[best]), float(heading), float(level))


def _signatures(fine: FineAlignment) -> Iterator[Array]:
    """Signatures (K, 3, 4 AT_ONCE) of some onsets at a time: of each kind, along each axis."""
    t = fine.integrals.time
    middle = (t[1:] + t[:-1]) / 2
    for first in range(0, len(ONSETS), AT_ONCE):
        courses = list(product(ONSETS[first : first + AT_ONCE], KINDS, (0, 1)))
        signature = np.zeros((len(middle), 3, len(courses)))
        for i, (onset, kind, axis) in enumerate(courses):
            start = onset * t[-1]
            since = np.maximum((middle if fine.form == "velocity" else t) - start, 0.0)
            velocity = (since > 0).astype(float) if kind == "step" else since / (t[-1] - start)
            signature[:, axis, i] = velocity if fine.form == "velocity" else np.diff(velocity)
        yield signature


def matched(
    fine: FineAlignment, signatures: Iterable[Array], others: Array | None = None
) -> tuple[Array, Array, Array]:
    """Match innovations with those that signatures in the measurements make.

    Parameters
    ----------
    signatures : iterable of (K, 3, s) arrays
        Some of them at a time: they take memory.
    others : (K, 3, M) array, optional
        Signatures, of one sigma each, of errors that the filter leaves out and any log may have: they explain what they can.

    Returns
    -------
    ratio : (S,) array
        Twice the logarithm of each likelihood ratio.
    size : (S,) array
        Of each signature, the most likely.
    x : (n, S) array
        What the filter estimates in the end of a signature of size one.
    """
    L = np.linalg.cholesky(fine.estimates.innovation_covariance)
    e = np.linalg.solve(L, fine.estimates.innovation[..., None]).ravel()

    def white(some: Array) -> tuple[Array, Array]:
        expected, x = through(fine.system, fine.gains, some)
        return np.linalg.solve(L, expected).reshape(-1, some.shape[-1]), x

    other = np.zeros((len(e), 0)) if others is None else white(others)[0]
    information = np.eye(other.shape[1]) + other.T @ other
    found: list[tuple[Array, Array, Array]] = []
    for signature in signatures:
        shape, x = white(signature)
        shared = np.linalg.solve(information, other.T @ np.column_stack([e, shape]))
        match = shape.T @ e - shape.T @ other @ shared[:, 0]
        energy = np.sum(shape**2, axis=0) - np.einsum("ks,ks->s", shape, other @ shared[:, 1:])
        energy = np.maximum(energy, 1e-300)
        found.append((match**2 / energy, match / energy, x))
    ratio, size, end = (np.concatenate(values, axis=-1) for values in zip(*found, strict=True))
    return ratio, size, end
