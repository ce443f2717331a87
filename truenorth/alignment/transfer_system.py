"""Transfer alignment as a linear system along a motion: for observability and for what a manoeuvre would tell."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from truenorth.core.earth import earth_rate_n, gravity_n, transport_rate_n
from truenorth.filters import LinearSystem
from truenorth.models.transfer import TransferModel
from truenorth.records.motion import MotionStates, Moving

Array = NDArray[np.float64]


def system_of_motion(
    motion: Moving,
    model: TransferModel,
    P0: Array,
    R: Array,
    stop: float,
    step: float = 0.5,
    start: float = 0.0,
    C_mb: Array | None = None,
) -> LinearSystem:
    """The model along a known motion, measured every `step` (s).

    Parameters
    ----------
    motion : Motion
        Of the slave.
    model : TransferModel
    P0 : (n, n) array
    R : (6,) array
        Variances of velocity and attitude; infinite: not measured.
    stop, step, start : float, s
    C_mb : (3, 3) array, optional
        Slave to master axes; the unit matrix when left out.
    """
    t = start + step * (np.arange(round((stop - start) / step)) + 1.0)
    return system_along(motion.states(t - 0.5 * step), motion.states(t), np.full(len(t), step), model, P0, R, C_mb=C_mb)


def system_along(
    middle: MotionStates,
    at: MotionStates,
    T: Array,
    model: TransferModel,
    P0: Array,
    R: Array,
    arm: Array | None = None,
    C_mb: Array | None = None,
) -> LinearSystem:
    """The model along a motion that is known at the middle and at the end of K intervals.

    Parameters
    ----------
    middle, at : MotionStates
    T : (K,) array, s
    model, P0, R
        As :func:`system_of_motion`.
    arm : (3,) array, m, optional
        As assumed; none when left out.
    C_mb : (3, 3) array, optional
        Slave to master axes; the unit matrix when left out.
    """
    f_n = np.einsum("kij,kj->ki", middle.C_nb, middle.f_b)
    Phi, Q = model.linearise(T, middle.C_nb, f_n, middle.v_n, middle.lat, middle.alt, middle.w_ib_b)
    w_ie, w_en = earth_rate_n(at.lat), transport_rate_n(at.lat, at.alt, at.v_n)
    w_eb, w_nb = (at.w_ib_b - np.einsum("kji,kj->ki", at.C_nb, w) for w in (w_ie, w_ie + w_en))
    a_n = np.einsum("kij,kj->ki", at.C_nb, at.f_b) - np.cross(2 * w_ie + w_en, at.v_n) + gravity_n(at.lat, at.alt)
    H = model.observe(at.C_nb, at.v_n, a_n, w_eb, w_nb, (0.0, 0.0, 0.0) if arm is None else arm, C_mb)
    matched = np.isfinite(R)
    return LinearSystem(
        Phi=Phi,
        Q=Q,
        H=H,
        R=np.diag(np.where(matched, R, 1.0))[None],
        z=np.tile(np.where(matched, 0.0, np.nan), (len(T), 1)),
        x0=np.zeros(model.states),
        P0=P0,
    )
