"""Classical damping in the loop: error dynamics, eigenvalues, and the correction of an undamped INS that equals it.

With the network ``H`` in the velocity that levels the platform, its errors obey

    x' = F x + B mu (H - 1)(dv - dv_ref) - b (dv_N - dv_ref_N),        B: columns DV, rows PHI of F (the transport rate)

- *external* damping takes the reference velocity for what the network holds back, ``H v + (1 - H) v_ref``;
- *internal* damping has no reference: ``v_ref = 0``, and manoeuvres leak through ``1 - H``;
- ``mu`` switches from undamped (0) to damped (1) as slowly as one likes: ``H_mu = 1 + mu (H - 1)``;
- *azimuth* damping turns the platform by the north velocity that a wrong heading makes, ``dv_N = -R w_ie cos L phi_U``:
  ``b = -2 zeta_U/(R cos L)`` damps the 24 h oscillation with the ratio ``zeta_U``. In return a constant error ``c_N`` of the
  reference ends in the latitude, ``dL = 2 zeta_U c_N/(R w_ie)``; heading is free of it.

To first order, a damped INS and an undamped one that is corrected afterwards are the same: the difference ``x_hat`` of their
errors obeys ``x_hat' = F x_hat - B mu (H - 1) nu + b nu_N`` with ``nu = z - x_hat_v``, ``z = v_INS - v_ref``. That is how
networks act here: one navigation serves every method, and a network can be tried on a log after the fact.

Source: D. Huang, L. Cheng, *Inertial Navigation Systems* (1986), ch. 5; the correction form is derived here and tested
against the loop itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from truenorth.core import earth
from truenorth.core.errors import UsageError
from truenorth.damping.course import linearised
from truenorth.damping.fix_rows import ROWS, Weighed
from truenorth.damping.networks import SCHULER_RATE, Network
from truenorth.errors.marine import DV, MOTION, PHI, MarineModel
from truenorth.state.track import Track

Array = NDArray[np.float64]

LONGEST_STEP = 10.0  # s: fourth order keeps 48 h of Schuler oscillation to 1e-9
NORTHERNMOST = np.radians(85.0)  # for azimuth damping, whose gain grows as 1/cos L
_QUIET = MarineModel(0.0, 0.0)


@dataclass(frozen=True)
class Loop:
    """How the loop is damped.

    Attributes
    ----------
    network : Network
        Of both level channels.
    azimuth_damping : float
        Damping ratio of the 24 h oscillation; 0: none.
    """

    network: Network
    azimuth_damping: float = 0.0

    def __post_init__(self) -> None:
        if not 0.0 <= self.azimuth_damping < 1.0:
            raise UsageError(f"azimuth damping ratio {self.azimuth_damping:g}; expected 0 to below 1")

    def matrices(self, F: Array, lat: Array, mu: Array) -> tuple[Array, Array]:
        """Closed loop ``M`` (K, n, n) of errors and network states, and ``N`` (K, n, 2) that takes the reference's error.

        Parameters
        ----------
        F : (K, 7, 7) or larger array
            Of the motion states come first.
        lat : (K,) array, rad
        mu : (K,) array
            From undamped, 0, to damped, 1.
        """
        A, B, C, D = self.network.realised()
        m, n = self.network.order, MOTION.stop
        transport = np.zeros((len(F), n, 2))
        transport[:, PHI] = F[:, PHI, DV]
        M, N = np.zeros((len(F), n + 2 * m, n + 2 * m)), np.zeros((len(F), n + 2 * m, 2))
        M[:, :n, :n] = F[:, MOTION, MOTION]
        direct = mu[:, None, None] * (D - 1.0) * transport
        direct[:, PHI.stop - 1, 1] += _azimuth_gain(self.azimuth_damping, lat) * mu
        M[:, :n, DV] += direct
        N[:, :n] -= direct
        for axis in range(2):
            own = slice(n + axis * m, n + (axis + 1) * m)
            M[:, own, own] = A
            M[:, own, DV.start + axis] = B
            N[:, own, axis] = -B
            M[:, :n, own] = mu[:, None, None] * transport[:, :, axis, None] * C
        return M, N


def _azimuth_gain(damping: float, lat: Array) -> Array:
    if damping > 0.0 and np.abs(lat).max() > NORTHERNMOST:
        raise UsageError(
            f"azimuth damping at a latitude of {np.degrees(np.abs(lat).max()):.1f} deg; expected below 85 deg: nearer to the pole "
            "north velocity says nothing of heading"
        )
    R_M, _ = earth.radii(lat)
    return np.asarray(2.0 * damping / (R_M * np.cos(lat)))


@dataclass(frozen=True)
class Mode:
    """An eigenvalue of the loop, or a pair.

    Attributes
    ----------
    name : str
        ``schuler`` (two: split by Foucault), ``earth``, ``network``, ``still`` (position).
    eigenvalue : complex, 1/s
        Of a pair, the one with positive imaginary part.
    """

    name: str
    eigenvalue: complex

    @property
    def period(self) -> float:
        """Of the oscillation, s; infinite where there is none."""
        return 2.0 * np.pi / abs(self.eigenvalue.imag) if self.eigenvalue.imag else np.inf

    @property
    def damping(self) -> float:
        """Damping ratio: 0 undamped, 1 without oscillation."""
        size = abs(self.eigenvalue)
        return -self.eigenvalue.real / size if size > 0.0 else 0.0


def eigenvalues(course: Track, loop: Loop, epoch: int = -1) -> list[Mode]:
    """Modes of the damped loop about an epoch of a course; the network's own poles among them.

    Parameters
    ----------
    course : Track
    loop : Loop
    epoch : int
        Which interval.
    """
    first = epoch % (len(course) - 1)
    part = course[first : first + 2]
    F, _ = linearised(part, _QUIET)
    M, _ = loop.matrices(F, part.position[:1, 0], np.ones(1))
    return modes(M[0])


def modes(M: Array) -> list[Mode]:
    """Eigenvalues of a loop (n, n), pairs once, the fastest first, each with a name."""
    values = np.linalg.eigvals(M)
    scale = np.abs(values).max()
    kept = [complex(v) for v in values if v.imag >= -1e-12 * scale]
    kept.sort(key=abs, reverse=True)
    oscillating = [v for v in kept if abs(v.imag) > 1e-3 * earth.EARTH_RATE]
    swinging = [v for v in oscillating if -v.real < 0.9 * abs(v)] or oscillating
    schuler = sorted(swinging, key=lambda v: abs(np.log(abs(v) / SCHULER_RATE)))[:2]
    rest = [v for v in oscillating if v not in schuler]
    of_earth = sorted(rest, key=lambda v: abs(np.log(abs(v) / earth.EARTH_RATE)))[:1]

    def name(v: complex) -> str:
        if v in schuler:
            return "schuler"
        if v in of_earth:
            return "earth"
        return "still" if abs(v) < 0.1 * earth.EARTH_RATE else "network"

    return [Mode(name(v), v) for v in kept]


STILL = 1e9  # s: what moves no faster stands still, but for rounding
SPLIT = 1e-6  # of a pole: real ones that coincide are split by rounding, and do not oscillate


def in_words(modes: Sequence[Mode]) -> str:
    """Periods and damping ratios, or time constants, of all modes that move."""
    parts = []
    for m in modes:
        if m.name == "still" or abs(m.eigenvalue) * STILL < 1.0:
            continue
        label = "" if m.name == "filter" else f"{m.name} "
        if abs(m.eigenvalue.imag) > SPLIT * abs(m.eigenvalue):
            parts.append(f"{label}{m.period / 60.0:.1f} min with ratio {m.damping:.2f}")
        else:
            parts.append(f"{label}{-1.0 / m.eigenvalue.real / 60.0:.1f} min time constant")
    return ", ".join(parts)


def network_correction(
    course: Track,
    loop: Loop,
    reference: Array | None = None,
    *,
    start: float | None = None,
    ramp: float = 0.0,
    x0: Array | None = None,
    warm: bool = True,
    mu: Array | None = None,
    fixes: Weighed | None = None,
) -> Array:
    """The errors that a damping loop would have taken off the course.

    Parameters
    ----------
    course : Track
    loop : Loop
    reference : (K+1, 2) array, m/s
        Reference velocity east, north; NaN where absent, and the loop then coasts undamped. None: internal damping.
    start : float, s
        When it is switched on; at the beginning of the course when left out.
    ramp : float, s
        In which `mu` goes from 0 to 1.
    x0 : (7,) array, optional
        Errors known at the switch (of a Kalman filter): taken off there, so that nothing is left to swing.
    warm : bool
        The network has listened before it was switched on, and of internal damping to the first velocity for long; else its
        states begin at zero, the worst switch.
    mu : (K+1,) array, optional
        How far it is damped at each epoch of the course, 0 to 1, after the switch; see :mod:`truenorth.damping.adaptive`.
    fixes : Weighed, optional
        Place and heading begin anew with each of them; it keeps what it made of them.

    Returns
    -------
    (K+1, 7) array
        Estimated errors; subtract them.

    Raises
    ------
    UsageError
        Azimuth damping without a reference, or near a pole.
    """
    if reference is None and loop.azimuth_damping > 0.0:
        raise UsageError("azimuth damping needs a reference velocity: without one, north velocity is not wrong heading")
    stride = max(1, int(LONGEST_STEP / course.interval + 1e-9))
    coarse = course[::stride]
    z = course.v_n[:, :2] - (0.0 if reference is None else reference)
    z = _means(z, stride, len(coarse) - 1)
    F, _ = linearised(coarse, _QUIET)
    since = coarse.time[1:] - (coarse.time[0] if start is None else start)
    on = since > 1e-6
    damped: Array = np.asarray(np.clip(since / ramp, 0.0, 1.0) if ramp > 0.0 else on, dtype=np.float64)
    if mu is not None:
        damped = damped * np.interp(coarse.time[1:], course.time, mu)
    M, N = loop.matrices(F, coarse.position[1:, 0], damped)
    listening = np.full(len(on), True) if warm else on
    s = np.zeros(M.shape[1])
    if warm and reference is None:  # settled on the first velocity: H(0) = 1 lets nothing of it through
        A, B, _, _ = loop.network.realised()
        s[MOTION.stop :] = np.outer(z[0], np.linalg.solve(A, B)).ravel()
    out = np.zeros((len(coarse), MOTION.stop))
    steps, inputs = transition_and_input(M, N, coarse.interval)
    deaf = np.isnan(z).any(axis=1) | ~listening
    M[:, :, DV] += N
    alone, _ = transition_and_input(M[deaf], N[deaf], coarse.interval)
    coast = dict(zip(np.flatnonzero(deaf), alone))
    switched = False
    epochs = np.zeros(0, dtype=int) if fixes is None else _epoch_of(course, start) + fixes.fixes.epoch
    steps_of = np.minimum((epochs - 1) // stride, len(coarse) - 2)
    jumps, of_jumps = np.zeros((len(course), MOTION.stop)), np.zeros_like(out)  # by fixes, each from its own epoch on
    for k in range(len(coarse) - 1):
        if x0 is not None and on[k] and not switched:
            s[MOTION], s[MOTION.stop :], switched = x0, 0.0, True
            out[k] = x0
        s = coast[k] @ s if deaf[k] else steps[k] @ s + inputs[k] @ z[k]
        moved = s[MOTION] - out[k]
        for number in np.flatnonzero(steps_of == k):
            assert fixes is not None  # it has this one
            after = k + 1 - epochs[number] / stride  # of this step
            off = fixes.put_right(int(number), s[MOTION] - after * moved)
            s[ROWS] += off
            jumps[epochs[number] :, ROWS] += off
            of_jumps[k + 1 :, ROWS] += off
        out[k + 1] = s[MOTION]
    smooth = [np.interp(course.time, coarse.time, column) for column in (out - of_jumps).T]
    return np.stack(smooth, axis=1) + jumps


def _epoch_of(course: Track, start: float | None) -> int:
    return 0 if start is None else round((start - course.time[0]) / course.interval)


def _means(z: Array, stride: int, count: int) -> Array:
    """(count, 2) mean over each step, by the trapezoid of its epochs; those that are absent are left out."""
    blocks = np.stack([z[:-1], z[1:]])[:, : count * stride].reshape(2, count, stride, 2)
    there = np.isfinite(blocks)
    number = there.sum(axis=(0, 2))
    total = np.where(there, blocks, 0.0).sum(axis=(0, 2))
    return np.divide(total, number, out=np.full(total.shape, np.nan), where=number > 0)


def transition_and_input(M: Array, N: Array, h: float) -> tuple[Array, Array]:
    """Transition and input of Runge and Kutta's fourth-order step, for a loop that is constant in it."""
    eye = np.broadcast_to(np.eye(M.shape[1]), M.shape)
    hM = h * M
    half = eye + hM @ (eye / 2.0 + hM @ (eye / 6.0 + hM / 24.0))  # 1 + hM/2 + (hM)^2/6 + (hM)^3/24
    return eye + hM @ half, h * (half @ N)
