"""Internal networks designed to an overshoot and a settling time, with the step and frequency responses that show it.

A constant accelerometer bias tilts a damped level channel as ``T(s) = w_s^2 H/(s^2 + w_s^2 H)`` says: from zero to its final value
``-nabla/g`` in steps of a response whose overshoot and settling time are the design's two figures. The loop ``w_s^2 H/s^2`` holds
two integrators, so that the integral of ``1 - y`` over all time is zero: *no network is without overshoot*. The price is paid
elsewhere: an internal network has no reference, and lets a manoeuvre through ``1 - H``. Among the networks that meet both figures
the one with the smallest leak, ``max |1 - H(i w)|``, is taken.

Source: D. Huang, L. Cheng, *Inertial Navigation Systems* (1986), ch. 5 (networks of second and third order); the law of the
overshoot from G. F. Franklin, J. D. Powell, A. Emami-Naeini, *Feedback Control of Dynamic Systems*, ch. 4 (type 2 systems).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from truenorth.core.errors import UsageError
from truenorth.damping.networks import SCHULER_RATE, Network, second_order, third_order

Array = NDArray[np.float64]

BAND = 0.05  # of the final value, in which the response has settled
SPAN, STEP = 6.0 * 2.0 * math.pi / SCHULER_RATE, 30.0  # s: six Schuler periods
RATES = SCHULER_RATE * np.geomspace(1e-2, 1e2, 200)  # rad/s, of the leak
DAMPINGS = (0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)
STRETCHES = (1.1, 1.2, 1.3, 1.41421356, 1.6, 1.8, 2.0, 2.5, 3.0)
OTHERS = (0.6, 1.0, 1.6, 2.5, 4.0)


@dataclass(frozen=True)
class Design:
    """A network and what it does to a level channel."""

    network: Network
    overshoot: float  # of the step response, as a part of its final value
    settling: float  # s; after which it stays within 5 % of it
    leak: float  # largest ``|1 - H|``: the part of a manoeuvre's velocity that gets into the loop


def step_response(network: Network, time: Array) -> Array:
    """(K,) tilt of a level channel after a step of the accelerometer's bias, over its final value.

    Parameters
    ----------
    time : (K,) array, s
        Evenly spaced, from zero.
    """
    from scipy.linalg import expm

    closed = np.polyadd(np.polymul((1.0, 0.0, 0.0), network.denominator), SCHULER_RATE**2 * np.array(network.numerator))
    n = len(closed) - 1
    # Controllable form with an integrator of the constant input; time in units of Schuler's rate keeps the numbers near 1.
    scale = SCHULER_RATE ** np.arange(n + 1)
    a = (closed / scale)[1:] / closed[0]
    b = np.zeros(n)
    gain = SCHULER_RATE**2 * np.array(network.numerator) / closed[0]
    b[n - len(gain) :] = gain / scale[n + 1 - len(gain) :]
    A = np.zeros((n + 1, n + 1))
    A[: n - 1, 1:n] = np.eye(n - 1)
    A[n - 1, :n], A[n - 1, n] = -a[::-1], 1.0
    P = expm(A * SCHULER_RATE * float(time[1] - time[0]))
    X = np.append(np.zeros(n), 1.0)[:, None]
    while X.shape[1] < len(time):  # x_0 .. x_{m-1}, then all of them m steps on
        X, P = np.hstack([X, P @ X]), P @ P
    return np.asarray(b[::-1] @ X[:n, : len(time)])


def judged(network: Network) -> Design:
    """Overshoot, settling time and leak of a network."""
    time = np.arange(0.0, SPAN, STEP)
    y = step_response(network, time)
    outside = np.flatnonzero(np.abs(y - 1.0) > BAND)
    settling = math.inf if outside[-1] == len(time) - 1 else float(time[outside[-1] + 1])
    leak = float(np.abs(1.0 - network.response(1j * RATES)).max())
    return Design(network, float(y.max() - 1.0), settling, leak)


def design(order: int, overshoot: float, settling: float) -> Design:
    """The network of an order that meets an overshoot and a settling time with the smallest leak.

    Parameters
    ----------
    order : {2, 3}
    overshoot : float
        As a part of the final value.
    settling : float, s

    Raises
    ------
    UsageError
        An order that is neither 2 nor 3, or no network of the order meets both; with what the nearest does.
    """
    if order not in (2, 3):
        raise UsageError(f"network of order {order}; expected 2 or 3")
    found = [judged(network) for network in _candidates(order)]
    fit = [d for d in found if d.overshoot <= overshoot and d.settling <= settling]
    if not fit:
        near = min(found, key=lambda d: max(d.overshoot / overshoot, d.settling / settling))
        raise UsageError(
            f"no network of order {order} has an overshoot of {overshoot:.0%} and settles in {settling / 60:.0f} min; the nearest "
            f"has {near.overshoot:.0%} and {near.settling / 60:.0f} min: allow more of either"
        )
    return min(fit, key=lambda d: d.leak)


def _candidates(order: int) -> Iterator[Network]:
    """Networks over a grid of poles."""
    if order == 2:
        yield from (second_order(*figures) for figures in itertools.product(DAMPINGS, STRETCHES, (0.7, 1.0, 1.5)))
    else:
        grid = itertools.product(DAMPINGS, STRETCHES, OTHERS, (1.0,), OTHERS)
        yield from (third_order(*figures) for figures in grid)
