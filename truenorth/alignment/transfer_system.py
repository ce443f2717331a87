"""Transfer alignment as a linear system along a motion: for observability and for what a manoeuvre would tell."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from truenorth.aiding.matching import Translation
from truenorth.aiding.source import Aiding
from truenorth.alignment.transfer_filter import Assumed, Matching, master_aiding
from truenorth.errors.intervals import Intervals
from truenorth.errors.master import TransferModel
from truenorth.estimate.linear import rows_along
from truenorth.filters import LinearSystem
from truenorth.records import MasterRecord
from truenorth.records.motion import MotionStates, Moving
from truenorth.state.layout import DP

Array = NDArray[np.float64]


def system_of_motion(
    motion: Moving,  # of the slave
    model: TransferModel,
    P0: Array,  # (n, n)
    R: Array,  # (6,): variances of velocity (or what `translation` says) and attitude; infinite: not measured
    stop: float,  # s
    step: float = 0.5,  # s
    start: float = 0.0,  # s
    C_mb: Array | None = None,  # (3, 3): slave to master axes; the unit matrix when left out
    translation: Translation = "velocity",  # what is matched
) -> LinearSystem:
    """The model along a known motion, measured every `step` (s)."""
    t = start + step * (np.arange(round((stop - start) / step)) + 1.0)
    middle, T = motion.states(t - 0.5 * step), np.full(len(t), step)
    return system_along(middle, motion.states(t), T, model, P0, R, C_mb=C_mb, translation=translation)


def system_along(
    middle: MotionStates,
    at: MotionStates,
    T: Array,  # (K,) s
    model: TransferModel,  # as :func:`system_of_motion`
    P0: Array,
    R: Array,
    arm: Array | None = None,  # (3,) m, optional: as assumed; none when left out
    C_mb: Array | None = None,  # (3, 3): slave to master axes; the unit matrix when left out
    translation: Translation = "velocity",
) -> LinearSystem:
    """The model along a motion that is known at the middle and at the end of K intervals."""
    f_n = np.einsum("kij,kj->ki", middle.C_nb, middle.f_b)
    ins = model.ins
    Phi, Q = ins.linearise(Intervals(T, middle.C_nb, f_n, middle.v_n, middle.lat, middle.alt, middle.w_ib_b))
    r = np.zeros(3) if arm is None else np.asarray(arm, dtype=np.float64)
    master = _master_of(at, model, r, np.eye(3) if C_mb is None else np.asarray(C_mb), translation)
    _, H = rows_along(at, master, ins)
    matched = np.isfinite(R)
    seen = seen_states(model, translation)
    both = np.ix_(seen, seen)
    return LinearSystem(
        Phi=np.ascontiguousarray(Phi[:, seen][:, :, seen]),
        Q=np.ascontiguousarray(Q[:, seen][:, :, seen]),
        H=np.ascontiguousarray(H[:, :, seen]),
        R=np.diag(np.where(matched, R, 1.0))[None],
        z=np.tile(np.where(matched, 0.0, np.nan), (len(T), 1)),
        x0=np.zeros(len(seen)),
        P0=np.ascontiguousarray(P0[both]),
    )


def seen_states(model: TransferModel, translation: Translation = "velocity") -> NDArray[np.intp]:
    """All states but those of the position error, unless position is matched: else the slave's place is the master's."""
    every = np.arange(model.states)
    return every if translation == "position" else np.delete(every, DP)


def _master_of(
    at: MotionStates, model: TransferModel, arm: Array, C_mb: Array, translation: Translation
) -> list[Aiding]:
    """A master that moves as the slave does at these epochs, with its own acceleration."""
    C_nm, f_m = at.C_nb @ C_mb.T, at.f_b @ C_mb.T
    master = MasterRecord(at.time, C_nb=C_nm, v_n=at.v_n, lat=at.lat, lon=at.lon, alt=at.alt, f_b=f_m)
    found = master_aiding(master, model, Assumed(arm, C_mb=C_mb), Matching(1.0, 1.0, translation))
    return [source for source in found if source.does == "measurement"]
