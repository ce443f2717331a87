"""When internal damping is switched off: a network without a reference takes the ship's manoeuvres for errors.

What a manoeuvre lets into the loop is ``(1 - H) v_m`` with ``v_m`` the velocity that it has changed. It is seen in the INS's own
oscillation by what that cannot do: turn the ship's head, or change velocity by more than ``3 sigma_v w_s``. The loop is left
undamped from the moment when ``|(1 - H) v_m|`` exceeds a share of what an undamped INS is off by, ``sigma_v``, until it has
fallen to half of that (hysteresis). The network goes on listening, so that it is warm when it is switched on again.

Source: D. Huang, L. Cheng, *Inertial Navigation Systems* (1986), ch. 5 (undamped in manoeuvres); the rule is derived here.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.damping.adaptive import leaked
from truenorth.damping.loop import LONGEST_STEP
from truenorth.damping.networks import SCHULER_RATE, Network
from truenorth.state.track import Track

Array = NDArray[np.float64]

MINUTE = 60.0  # s, over which waves are averaged out of changes of speed
CLEAR = 3.0  # sigmas of the INS's own oscillation, from which a change of speed is a manoeuvre
SHARE = 0.5  # of the undamped INS's sigma of velocity: what a manoeuvre may add
HYSTERESIS = 0.5


class Switch(NamedTuple):
    """At `time` (s) the loop became `damped` or not; `leak` of the manoeuvre against what was `allowed`, m/s."""

    time: float
    damped: bool
    leak: float
    allowed: float


@dataclass(frozen=True)
class Switching:
    """How far the loop is damped, and why."""

    mu: Array  # (K+1,): 1 damped, 0 undamped
    manoeuvre: Array  # (K+1, 2) m/s: velocity that manoeuvres have changed, from the beginning on
    leak: Array  # (K+1,) m/s: of it, what the network lets into the loop, and how much may be before it is switched off
    allowed: Array  # (K+1,) m/s
    switches: tuple[Switch, ...]


def switching(course: Track, network: Network, sigma: Array) -> Switching:
    """The switches of internal damping on a course.

    Parameters
    ----------
    course : Track
    network : Network
    sigma : (K+1,) array, m/s
        Of the undamped INS's velocity.
    """
    manoeuvre = manoeuvred(course, sigma)
    shown = replace(course, v_n=np.column_stack([manoeuvre, np.zeros(len(sigma))]))
    leak = np.linalg.norm(leaked(shown, network), axis=1)
    allowed = SHARE * sigma
    mu, switches, damped = np.ones(len(leak)), [], True
    for k in range(len(leak)):
        if leak[k] > allowed[k] if damped else leak[k] < HYSTERESIS * allowed[k]:
            damped = not damped
            switches.append(Switch(float(course.time[k]), damped, float(leak[k]), float(allowed[k])))
        mu[k] = damped
    return Switching(mu, manoeuvre, leak, allowed, tuple(switches))


def manoeuvred(course: Track, sigma: Array) -> Array:
    """(K+1, 2) what manoeuvres have changed of the velocity, m/s: by turns of the head, and beyond an INS's own errors."""
    stride = max(1, int(LONGEST_STEP / course.interval + 1e-9))
    coarse = course[::stride]
    v = coarse.v_n[:, :2]
    heading = np.unwrap(np.arctan2(coarse.C_nb[:, 0, 1], coarse.C_nb[:, 1, 1]))
    s, c = np.sin(np.diff(heading)), np.cos(np.diff(heading))
    turned = np.stack([c * v[:-1, 0] + s * v[:-1, 1], c * v[:-1, 1] - s * v[:-1, 0]], axis=1) - v[:-1]
    by_turn = np.concatenate([np.zeros((1, 2)), np.cumsum(turned, axis=0)])
    window = max(1, round(MINUTE / coarse.interval)) | 1
    rest = np.diff(np.stack([_averaged(column, window) for column in (v - by_turn).T], axis=1), axis=0)
    own = CLEAR * SCHULER_RATE * coarse.interval * np.interp(coarse.time[1:], course.time, sigma)
    rest[np.linalg.norm(rest, axis=1) < own] = 0.0
    total = by_turn + np.concatenate([np.zeros((1, 2)), np.cumsum(rest, axis=0)])
    return np.stack([np.interp(course.time, coarse.time, column) for column in total.T], axis=1)


def _averaged(x: Array, window: int) -> Array:
    from scipy.ndimage import uniform_filter1d

    return np.asarray(uniform_filter1d(x, window, mode="nearest"))
