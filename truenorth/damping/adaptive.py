"""Damping whose strength follows the ship: fuzzy rules on how much of a manoeuvre gets into an internal network.

An internal network takes every velocity that changes for an error: what it lets into the loop is ``(1 - H) v``. While the ship
keeps its speed that is the INS's own oscillation, up to some m/s; in a manoeuvre it is larger than the manoeuvre. Two fuzzy
sets, *calm* and *manoeuvre*, overlap between the two sizes, and the loop is damped by

    mu = m_calm/(m_calm + m_manoeuvre)        (Sugeno's rule: calm -> 1, manoeuvre -> 0)

with a loop of ``H_mu = 1 + mu (H - 1)``: an adaptive damping ratio, from the network's own to none.

Source: K. Li, J. Zhang, F. Liu, A fuzzy control inertial damping algorithm in a long-endurance inertial navigation system,
J. Harbin Eng. Univ. 33 (4), 2012 (the idea; its rules are on other quantities); T. Takagi, M. Sugeno, Fuzzy identification of
systems and its applications to modeling and control, IEEE Trans. Syst. Man Cybern. 15, 1985.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from truenorth.core.errors import UsageError
from truenorth.damping.networks import Network
from truenorth.state.track import Track

Array = NDArray[np.float64]

LONGEST_STEP = 10.0  # s


@dataclass(frozen=True)
class FuzzyDamping:
    """The two sets.

    Attributes
    ----------
    calm : float, m/s
        Up to this size of ``(1 - H) v`` it is wholly calm; above what the INS's own undamped oscillation makes of it, or the
        damping never sets in.
    manoeuvre : float, m/s
        From this size on it is wholly a manoeuvre.
    """

    calm: float = 3.5
    manoeuvre: float = 6.0

    def __post_init__(self) -> None:
        if not 0.0 < self.calm < self.manoeuvre:
            raise UsageError(f"calm {self.calm:g} m/s, manoeuvre {self.manoeuvre:g} m/s; expected 0 < calm < manoeuvre")

    def strength(self, leak: Array) -> Array:
        """``mu`` of sizes of the leak, m/s."""
        in_manoeuvre = np.clip((leak - self.calm) / (self.manoeuvre - self.calm), 0.0, 1.0)
        return np.asarray(1.0 - in_manoeuvre)

    def of_course(self, course: Track, network: Network) -> Array:
        """(K+1,) ``mu`` at the epochs of a course, for :func:`truenorth.damping.loop.network_correction`."""
        return self.strength(np.linalg.norm(leaked(course, network), axis=1))


def leaked(course: Track, network: Network) -> Array:
    """(K+1, 2) the velocity that an internal network lets into the loop, ``(1 - H) v``, m/s; it has settled at the start."""
    from scipy.linalg import expm

    stride = max(1, int(LONGEST_STEP / course.interval + 1e-9))
    coarse = course[::stride]
    A, B, C, D = network.realised()
    n, v = len(B), coarse.v_n[:, :2]
    block = np.zeros((n + 1, n + 1))
    block[:n, :n], block[:n, n] = A, B
    step = expm(block * coarse.interval)
    xi = np.linalg.solve(-A, B)[:, None] * v[0]
    out = np.empty(v.shape)
    for k in range(len(v)):
        out[k] = (1.0 - D) * v[k] - C @ xi
        xi = step[:n, :n] @ xi + step[:n, n:] * v[k]
    return np.stack([np.interp(course.time, coarse.time, column) for column in out.T], axis=1)
