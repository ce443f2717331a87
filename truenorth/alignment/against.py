"""Two answers from one log: a method that knows less of the sensors, held against the library's own choice.

A filter that believes a wrong azimuth, or knows no scale factors on a base that turns, has small innovations all the same.
"""

from __future__ import annotations

import math

import numpy as np

from truenorth.alignment.result import Alignment
from truenorth.core.attitude import rotation_vector_from_dcm
from truenorth.state.evidence import Effect, Evidence, contradiction
from truenorth.state.limits import limit


def against(own: Alignment, answer: Alignment) -> list[Evidence]:
    """What the library's own attitude says of another one at the same time.

    Given the logs, the mean square error of any answer is the covariance P of the best one and the square of the difference phi
    between them: ``E[e e^T] = P + phi phi^T``. What that is beyond the answer's own sigma is added, once chance does not explain
    it. Two answers further apart than both sigmas together allow are not both right.

    Parameters
    ----------
    own, answer : Alignment
        The library's own, and the one in question.
    """
    phi = rotation_vector_from_dcm(answer.C_nb @ own.C_nb.T)
    variance, allowed = np.diag(answer.phi_covariance), np.diag(own.phi_covariance)
    apart = float(np.max(np.abs(phi) / np.sqrt(variance + allowed)))
    level, heading = math.hypot(phi[0], phi[1]), abs(float(phi[2]))
    if apart > limit("two answers"):
        return [contradiction("answers.differ", heading=heading, level=level, sigmas=apart)]
    square = allowed + phi**2
    more = np.sqrt(np.where(square > limit("by chance") ** 2 * variance, square - variance, 0.0))
    if not more.any():
        return []
    effect = Effect(heading=float(more[2]), level=float(more[:2].max()))
    return [Evidence("answers.tight", {"heading": effect.heading, "level": effect.level}, "known", effect)]
