"""Is the base leaving? A generalised likelihood ratio test of the innovations against drift signatures.

A base that begins to drift away looks to the filter like tilt or a wrong heading, and the mean NIS does not see it.
A bank of signatures (a step of velocity, a velocity that grows; east or north; from 1/4, 1/2, 3/4 of the log on) is sent
through the filter, and its innovations are matched with the real ones. A constant velocity from the very beginning cannot
be seen by anyone: north velocity v equals a heading error of v/(R w_ie cos L).

Source: A. Willsky and H. Jones, "A generalized likelihood ratio approach to the detection and estimation of jumps in
linear systems", IEEE Trans. Autom. Control 21 (1976), eqs. 13-20.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.fine import FineAlignment

Array = NDArray[np.float64]

ONSETS = (0.25, 0.5, 0.75)
THRESHOLD = 25.0  # chi-square with one degree of freedom, 12 signatures: false alarm below 1e-5 a log


@dataclass(frozen=True)
class Drift:
    """The best matching drift.

    Attributes
    ----------
    ratio : float
        Twice the logarithm of the likelihood ratio; chi-square with one degree of freedom where there is no drift.
    kind, axis : str
        ``step`` or ``ramp`` of velocity; ``east`` or ``north``.
    onset : float, s
        Since the beginning of the log.
    velocity : float, m/s
        At the end of the log.
    """

    ratio: float
    kind: str
    axis: str
    onset: float
    velocity: float

    @property
    def found(self) -> bool:
        """Whether chance is ruled out."""
        return self.ratio > THRESHOLD

    def __str__(self) -> str:
        how = "a step to" if self.kind == "step" else "growing to"
        return (
            f"the base drifts {self.axis}: from about {self.onset:.0f} s on its velocity shows {how} "
            f"{abs(self.velocity):.2g} m/s (likelihood ratio {self.ratio:.0f}, chance gives {THRESHOLD:.0f} at most): align a "
            "part in which it stays"
        )


def detect_drift(fine: FineAlignment) -> Drift:
    """Match the innovations of a fine alignment with the bank of drift signatures."""
    t = fine.integrals.time
    middle = (t[1:] + t[:-1]) / 2
    names, columns = [], []
    for onset in ONSETS:
        start = onset * t[-1]
        since = np.maximum((middle if fine.form == "velocity" else t) - start, 0.0)
        for kind, velocity in (("step", (since > 0).astype(float)), ("ramp", since / (t[-1] - start))):
            shape = velocity if fine.form == "velocity" else np.diff(velocity)
            for axis in (0, 1):
                z = np.zeros((len(middle), 3))
                z[:, axis] = shape
                names.append((kind, ("east", "north")[axis], start))
                columns.append(z)
    signature = np.stack(columns, axis=-1)  # (K, 3, 12)

    gain, _, step = fine.gains
    H_Phi = fine.system.H @ fine.system.Phi
    expected = np.empty_like(signature)
    x = np.zeros((step.shape[1], signature.shape[2]))
    for k in range(len(signature)):
        expected[k] = signature[k] - H_Phi[k] @ x
        x = step[k] @ x + gain[k] @ signature[k]

    weighted = np.linalg.solve(fine.estimates.innovation_covariance, expected)
    match = np.einsum("kis,ki->s", weighted, fine.estimates.innovation)
    energy = np.einsum("kis,kis->s", weighted, expected)
    ratio = match**2 / energy
    best = int(np.argmax(ratio))
    kind, axis_name, start = names[best]
    return Drift(float(ratio[best]), kind, axis_name, float(start), float(match[best] / energy[best]))
