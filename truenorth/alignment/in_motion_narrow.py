"""Biases that a pass begins with more narrowly than they are known, where the one before has found them; that is taken off again.

A closed loop is linear about what it knows so far. At rest nothing parts a tilt from a bias of the accelerometers: with ``nabla``
along the body's axes and ``g phi x u + C nabla = 0`` no row sees it. But wherever the loop corrects its heading by ``psi``, C turns
and the tilt that the covariance knows does not: rows then see ``psi x C nabla``, as if the vehicle had turned. A consumer IMU that
did not know its gyros to begin with wandered by 20 mrad in 35 s of rest, and by that knew its accelerometers, of 28 mg, to 15.

With biases that begin where the pass before has ended, and hardly move from there, the loop is linear about what the whole log
says, as is Gauss and Newton's method. So narrow a prior is no knowledge, and is taken off again. It is a Gaussian, as is the one of
the specification, ``N(0, W)``, whose place it takes: of the constant biases ``y = E x`` about ``c``, as ``N(c, S)``. Their ratio is
what the posterior is to be multiplied by,

    P^-1 <- P^-1 - E' D E,   x = P E' (S^-1 (y - c) - W^-1 y),   D = S^-1 - W^-1

with the new P in x, and the likelihood of the log by its mean under the old posterior, with ``G = E P E'``

    -2 ln L <- -2 ln L + ln |W S^-1| + ln |1 - D G| + y' W^-1 y - (y - c)' S^-1 (y - c) - r' G_new r,   r = S^-1 (y - c) - W^-1 y

Both are exact of a linear system whose y stays as it is. So they are of what each epoch knew, too (ours).

Source of the defect: G. Huang, A. Mourikis, S. Roumeliotis, "Observability-based rules for designing consistent EKF SLAM
estimators", Int. J. Robotics Research 29 (2010).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.in_motion_task import MovingTask
from truenorth.core.attitude import dcm_from_rotation_vector
from truenorth.errors.axes import constant_biases, standing
from truenorth.state.layout import BA, BG, DV, PHI
from truenorth.state.track import Track

Array = NDArray[np.float64]

NARROWER = 0.1  # of the sigma that the pass before has found: the loop then hardly moves what it is linear about
LEAST = 1e-3  # of a bias's sigma by the specification: of what is narrower, ``1 - D G`` is lost in rounding


def as_found(task: MovingTask, track: Track) -> Array:
    """(6,) variances with which the next pass begins its constant biases: a part of how this track knows them at its end.

    A row that is off by what this leaves open is off by less than a sigma: all rows together know it no better. A bias that walks
    is no constant: what its end is known by says less of its beginning, and stays as it is specified.
    """
    wide = task.spec.constant_variance
    found = NARROWER**2 * np.diag(track.P[-1])[BG.start : BA.stop]
    return np.where(task.model.noise[BG.start : BA.stop] > 0.0, wide, np.clip(found, LEAST**2 * wide, wide))


@dataclass(frozen=True)
class Narrowed:
    """A prior of the constant biases of gyros and accelerometers, and the one about zero whose place it takes; SI.

    Attributes
    ----------
    centre : (6,) array
        About which a pass begins.
    narrow : (6,) array
        Variances that it begins with.
    wide : (6,) array
        Those of the specification, no smaller; where they are zero there is no bias.
    """

    centre: Array
    narrow: Array
    wide: Array

    def taken_off(self, track: Track) -> Track:
        """The track, its covariance with it, as if the pass had begun with biases about zero, as specified."""
        E = constant_biases(track.layout, standing())
        tied = track.P @ E.T
        P = track.P + tied @ self._more(E @ tied) @ np.swapaxes(tied, 1, 2)
        P = 0.5 * (P + np.swapaxes(P, 1, 2))
        x = np.einsum("kij,lj,kl->ki", P, E, self._pull(track.sensors @ E.T))
        C_nb = np.stack([dcm_from_rotation_vector(phi) @ C for phi, C in zip(x[:, PHI], track.C_nb, strict=True)])
        sensors = track.sensors.copy()
        sensors[:, BG.start :] += x[:, BG.start :]
        return replace(track, C_nb=C_nb, v_n=track.v_n - x[:, DV], sensors=sensors, P=P)

    def misfit(self, track: Track) -> float:
        """What `taken_off` adds to minus twice the log-likelihood of a track, by its end as the filter left it."""
        E = constant_biases(track.layout, standing())
        y, G = E @ track.sensors[-1], E @ track.P[-1] @ E.T
        pull = self._pull(y)
        twice = self._by(y**2, self.wide) - self._by((y - self.centre) ** 2, self.narrow)
        twice += np.log(self._by(self.wide, self.narrow), out=np.zeros(6), where=self.wide > 0.0)
        _, shrunk = np.linalg.slogdet(np.eye(6) - self._sharper @ G)
        return float(twice.sum() + shrunk - pull @ (G + G @ self._more(G) @ G) @ pull)

    def _by(self, value: Array, variance: Array) -> Array:
        """A value (..., 6) by a variance; zero where there is no bias."""
        return np.divide(value, variance, out=np.zeros(np.shape(value)), where=self.wide > 0.0)

    @property
    def _sharper(self) -> Array:
        """``D``, (6, 6)."""
        return np.diag(self._by(np.ones(6), self.narrow) - self._by(np.ones(6), self.wide))

    def _more(self, G: Array) -> Array:
        """``(1 - D G)^-1 D``: with the columns of ``P E'`` on both sides, by how much the covariance (..., 6, 6) grows."""
        D = self._sharper
        return np.asarray(np.linalg.solve(np.eye(6) - D @ G, np.broadcast_to(D, G.shape)))

    def _pull(self, y: Array) -> Array:
        """``r``, (..., 6)."""
        return self._by(y - self.centre, self.narrow) - self._by(y, self.wide)
