"""Which states a manoeuvre tells apart under velocity matching, in words."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from truenorth.analysis.observability import observability
from truenorth.earth import earth_rate_n, gravity_n, transport_rate_n
from truenorth.filters import LinearSystem
from truenorth.models.transfer import ARM, TransferModel
from truenorth.papers.transfer.filtering import METHODS, model_of, prior_of
from truenorth.papers.transfer.truth import END, TAU_SIGMA, VELOCITY_NOISE, Case
from truenorth.simulation.sensing import Moving

Array = NDArray[np.float64]
STEP = 0.5  # s
EVEN_ARM = TAU_SIGMA * 200.0  # m: the way flown in the delay's prior sigma, so that neither is favoured in the words


@dataclass(frozen=True)
class Seen:
    """What sixteen states and velocity matching tell in one manoeuvre.

    Attributes
    ----------
    rank : int
        With perfect measurements.
    words : str
        With the noise as it is: what stays above .9 of its prior sigma.
    """

    rank: int
    words: str

    def __str__(self) -> str:
        return self.words


def linear_system(
    motion: Moving, model: TransferModel, P0: Array, R: Array, stop: float, step: float = STEP
) -> LinearSystem:
    """The model along a true motion, measured every `step` (s) until `stop`, as if all went well.

    Parameters
    ----------
    motion : Motion
        Of the slave.
    model : TransferModel
    P0 : (n, n) array
    R : (6,) array
        Variances of velocity and attitude; infinite: not measured.
    stop, step : float, s
    """
    t = step * (np.arange(round(stop / step)) + 1.0)
    middle, at = motion.states(t - 0.5 * step), motion.states(t)
    f_n = np.einsum("kij,kj->ki", middle.C_nb, middle.f_b)
    T = np.full(len(t), step)
    Phi, Q = model.linearise(T, middle.C_nb, f_n, middle.v_n, middle.lat, middle.alt, middle.w_ib_b)
    w_ie, w_en = earth_rate_n(at.lat), transport_rate_n(at.lat, at.alt, at.v_n)
    w_eb, w_nb = (at.w_ib_b - np.einsum("kji,kj->ki", at.C_nb, w) for w in (w_ie, w_ie + w_en))
    a_n = np.einsum("kij,kj->ki", at.C_nb, at.f_b) - np.cross(2 * w_ie + w_en, at.v_n)
    a_n += gravity_n(at.lat, at.alt)
    H = model.observe(at.C_nb, at.v_n, a_n, w_eb, w_nb)
    z = np.where(np.isfinite(R), 0.0, np.nan)
    variance = np.where(np.isfinite(R), R, 1.0)
    return LinearSystem(
        Phi=Phi, Q=Q, H=H, R=np.diag(variance)[None], z=np.tile(z, (len(t), 1)), x0=np.zeros(model.states), P0=P0
    )


def told_by(case: Case) -> Seen:
    """What velocity matching with sixteen states tells in a case's manoeuvre."""
    scenario, method = case.scenario, METHODS["states16"]
    motion = scenario.build_motion()
    model = model_of(method, scenario.imu_spec)
    P0 = prior_of(method, model, scenario.imu_spec, motion.states(np.array(0.0)).C_nb)
    arm = model.slice_of(ARM)
    assert arm is not None
    P0[arm, arm] = EVEN_ARM**2 * np.eye(3)
    rows = VELOCITY_NOISE**2 * 0.1 / STEP  # of ten a second, in one
    R = np.array([rows] * 3 + [np.inf] * 3)
    found = observability(linear_system(motion, model, P0, R, END), model.names, model.units)
    hardly = "; ".join(map(str, found.hardly))
    words = f"what keeps more than .9 of its prior sigma: {hardly}" if hardly else "all states are told apart"
    return Seen(found.rank, words)
