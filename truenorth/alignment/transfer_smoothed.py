"""A master whose velocity went through a filter: later than its attitude, and flatter where the acceleration changes.

Of a filter whose impulse response has the mean `lambda`, the variance ``2 chi`` and the third moment about the mean ``6 kappa`` the
first terms of a motion are, with dots for derivatives,

    v_filtered(t) = v(t - lambda) + chi v.. - kappa v... + ..

of one of the first order ``lambda = T``, ``chi = T^2 / 2``, ``kappa = T^3 / 3`` (with `lambda` taken to the first power alone, by
attitude and velocity, ``T^2`` and ``T^3``). `lambda` is a delay, the others are none. An aircraft that rolls into a coordinated
turn at a rate `p` has ``v.. = g p`` across: an arm ``g chi`` up, 5 cm of a filter of .1 s, up to 7 of its sigmas. What begins
and ends such a roll is ``v...``, which drew delay and arm forward along each other.

The slave's noise must not part arm and `chi`. So with the master's specific force `f`, a mean,

    v.. = C (w x f) + C f.,        C (w x f) = (column of the arm) f

and only what the body's turning does not make, ``C f.``, is taken from means: those over `b` about ``t + h`` less those about
``t - h``, with ``b = h / 2``, which hold nothing of the noise at the row itself. Of densities `q` and `walk` of the sensors' noise

    N_chi = K (2 q^2 / h^3 + 16 |r|^2 walk^2 / h^5) / sigma^2,    N_kappa = K (24 q^2 / h^5 + 192 |r|^2 walk^2 / h^7) / sigma^2

over K rows of noise `sigma` would be taken for knowledge (of ``v...``, a second difference of such means): `h` is the shortest with
which that is little against what is known of them.

Sources: moments of an impulse response, A. Papoulis, "The Fourier integral and its applications" (1962), chapter 7; the
rule is ours.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.transfer_columns import Means
from truenorth.alignment.transfer_nominal import Carried
from truenorth.alignment.transfer_turns import HALVES
from truenorth.errors.master import ARM, FILTER, TransferModel
from truenorth.records import ImuRecord
from truenorth.state.track import Track

Array = NDArray[np.float64]

FALSE = 0.5  # of what is known before: so much more a column of noise may be thought to show


def flatter_along(
    slave: ImuRecord, track: Track, carried: Carried, model: TransferModel, held: Array, lever_arm: Array, sigma: float
) -> Array | None:
    """(M, 9) the master's specific force, body axes, m/s^2; ``C f.``, m/s^3, and ``v...``, m/s^4, n; NaN near the ends of a log.

    None where its velocity is taken as it is.

    Parameters
    ----------
    carried : Carried
        The attitude along the motion that a pass has found.
    held : (M,) array, s
        When a master's rows held.
    lever_arm : (3,) array, m
        As assumed before the log.
    sigma : float, m/s
        Noise of a row.
    """
    own = track.layout.slice_of(FILTER)
    if own is None:
        return None
    P, at = track.P[-1], track.layout.slice_of(ARM)
    arm = lever_arm + (0.0 if at is None else track.sensors[-1, at])
    reach = float(arm @ arm) + (0.0 if at is None else float(np.trace(P[at, at])))
    means, walk, push = Means(slave, track, carried, held, arm), model.gyro_random_walk, model.accel_random_walk

    def short(known: float, of_push: int, of_walk: int, order: int) -> float:
        """The shortest h with which noise is little against what is known, its variance ``of q^2 / h^order + ..``."""
        for h in HALVES:
            variance = of_push * push**2 / h**order + of_walk * reach * walk**2 / h ** (order + 2)
            if 0.5 * h > 2.0 * slave.interval and len(track) * (known / sigma) ** 2 * variance < FALSE:
                return h
        return HALVES[-1]

    _, flat, skew = model.filter
    h = short(flat, 2, 16, 3)
    (late, C_late), (now, C), (early, C_early) = (means.held_at(shift, 0.5 * h) for shift in (h, 0.0, -h))
    f = np.einsum("kji,kj->ki", C, now)
    turned = np.einsum("kij,kj->ki", C_late - C_early, f)
    changed = (late - early - turned) / (2.0 * h)
    h = short(skew, 24, 192, 5)
    late, now, early = (means.held_at(shift, 0.5 * h)[0] for shift in (h, 0.0, -h))
    return np.column_stack([f, changed, (late - 2.0 * now + early) / h**2])


def filter_sigmas(constant: float, attitude: bool) -> tuple[float, float, float]:
    """Sigmas of `FILTER`, s, s^2 and s^3, by that of the time constant of a filter of the first order, s.

    By velocity alone (no `attitude`) its mean delay is one of the master.
    """
    return (constant, constant**2, 3.0 * constant**3) if attitude else (0.0, math.sqrt(0.5) * constant**2, constant**3)
