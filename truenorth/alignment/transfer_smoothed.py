"""A master whose velocity went through a filter: later than its attitude, and flatter where the acceleration changes.

Of a filter whose impulse response has the mean `lambda`, the variance ``2 chi`` and the third moment about the mean ``6 kappa`` the
first terms of a motion are, with dots for derivatives,

    v_filtered(t) = v(t - lambda) + chi v.. - kappa v... + ..

of one of the first order ``lambda = T``, ``chi = T^2 / 2``, ``kappa = T^3 / 3``. `lambda` is a delay, the others are none. An
aircraft that rolls into a coordinated turn at a rate `p` has ``v.. = g p`` across: an arm ``g chi`` up, 5 cm of a filter of .1 s.
What begins and ends such a roll is ``v...``, which drew delay and arm forward along each other. So a row of velocity is taken
where it holds, at ``t - lambda`` as found by the pass before, and its attitude at `t`: a line from `t` is 1 cm/s off after .1 s of
such a roll, and what tilt and biases do until `t` is 4 mm/s of a slave that is .3 deg off.

Derivatives are those of the master's specific force `f`, n: means over `b` about ``t + h`` less those about ``t - h``, with
``b = h / 2``, and the second difference of such means. Such a mean holds derivatives of two orders more,

    chi (v.. + .1875 h^2 v....) - kappa (v... + .1042 h^2 v.....)

which a filter does, too: of one of the first order the next two terms are those of ``h = 2 T`` and ``h = 3.25 T``. Longer
means make a motion smaller than it is (a roll in 2 s with `h` of .4 s: to two thirds), and what they leave out is taken for an
arm. So `h` is that of the filter as found, and longer only where the sensors' noise, of densities `q` and `walk`,

    N_chi = K (2 q^2 / h^3 + 16 |r|^2 walk^2 / h^5) / sigma^2,    N_kappa = K (24 q^2 / h^5 + 192 |r|^2 walk^2 / h^7) / sigma^2

over K rows of noise `sigma`, is not little both against what was known before and against what the column knows, G. The column is
then what is expected of it, ``1 - N / G`` of it (as in :mod:`truenorth.alignment.transfer_columns`).

Sources: moments of an impulse response, A. Papoulis, "The Fourier integral and its applications" (1962), chapter 7; the
rules are ours.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.transfer_bending import Bend
from truenorth.alignment.transfer_columns import Means
from truenorth.alignment.transfer_nominal import Carried
from truenorth.alignment.transfer_turns import HALVES
from truenorth.errors.master import ARM, FILTER, TransferModel
from truenorth.records import ImuRecord
from truenorth.state.track import Track

Array = NDArray[np.float64]

FALSE = 0.5  # of what is known before: so much more a column of noise may be thought to show
SHARE = 0.02  # of what a column knows, that may be noise where that is more
FLAT, SKEWED = 2.0, 3.25  # time constants of a filter of the first order whose next terms these means have
STEPS = 16  # lengths that are tried: of twice the right one a roll in 2 s is a third smaller
LONGEST = 0.2  # s: of the time constant by which the means are chosen


def flatter_along(
    slave: ImuRecord,
    track: Track,
    carried: Carried,
    model: TransferModel,
    held: Array,
    said: tuple[Array, float],
    sigma: float,
    bend: Bend | None = None,
) -> Array | None:
    """(M, 6) ``v..``, m/s^3, and ``v...``, m/s^4, of the master, n; NaN near the ends of a log; None where it has no filter.

    Parameters
    ----------
    carried : Carried
        The attitude along the motion that a pass has found.
    held : (M,) array, s
        When a master's velocities held.
    said : (3,) array, float, m
        Lever arm and its sigma, before the log.
    sigma : float, m/s
        Noise of a row.
    bend : Bend, optional
        How its seat bends.
    """
    own = track.layout.slice_of(FILTER)
    if own is None:
        return None
    (lever_arm, arm_sigma), at = said, track.layout.slice_of(ARM)
    arm = lever_arm + (0.0 if at is None else track.sensors[-1, at])
    # Not of the arm as found: longer means by it would move it, to and fro.
    reach = float(lever_arm @ lever_arm) + 3.0 * arm_sigma**2
    constant = min(math.sqrt(2.0 * max(float(track.sensors[-1, own][1]), 0.0)), LONGEST)
    means, walk, push = Means(slave, track, carried, held, arm, bend), model.gyro_random_walk, model.accel_random_walk
    lengths = [h for h in HALVES if h > 2.0 * slave.interval]

    def shown(
        ideal: float, known: float, derivative: Callable[[float, bool], Array], noise: tuple[int, int, int]
    ) -> Array:
        """(M, 3) a derivative by the shortest means whose noise is little, and what of it is no noise."""
        of_push, of_walk, order = noise
        shortest = max(ideal, 2.0 * lengths[0])
        column = np.zeros((len(held), 3))
        for h in np.geomspace(shortest, max(shortest, lengths[-1]), STEPS):
            column, bent = derivative(h, False), derivative(h, True)
            there = np.isfinite(column).all(axis=1)
            each = of_push * push**2 / h**order + of_walk * reach * walk**2 / h ** (order + 2)
            of_noise = len(track) * each + np.nansum(bent**2)
            N, G = (known / sigma) ** 2 * np.array([of_noise, np.sum(column[there] ** 2)])
            column = column * max(0.0, 1.0 - N / max(G, 1e-300))
            if max(FALSE, SHARE * G) > N:
                break
        return column

    def first(h: float, bent: bool) -> Array:
        after, before = (means.held_at(shift, 0.5 * h, bent) for shift in (h, -h))
        return np.asarray((after - before) / (2.0 * h))

    def second(h: float, bent: bool) -> Array:
        after, now, before = (means.held_at(shift, 0.5 * h, bent) for shift in (h, 0.0, -h))
        return np.asarray((after - 2.0 * now + before) / h**2)

    _, flat_sigma, skew_sigma = model.filter
    changes = (
        shown(FLAT * constant, flat_sigma, first, (2, 16, 3)),
        shown(SKEWED * constant, skew_sigma, second, (24, 192, 5)),
    )
    return np.column_stack(changes)


def filter_sigmas(constant: float, attitude: bool) -> tuple[float, float, float]:
    """Sigmas of `FILTER`, s, s^2 and s^3, by that of the time constant of a filter of the first order, s.

    By velocity alone (no `attitude`) its mean delay is one of the master.
    """
    return (constant if attitude else 0.0, math.sqrt(0.5) * constant**2, constant**3)
