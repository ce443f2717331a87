"""How a base moves that goes nowhere: white motion and lightly damped oscillators, as states of a filter.

The output of an oscillator is the *velocity* of a displacement that stays bounded: its spectrum vanishes at zero frequency, so
that a filter which knows it takes no slow change of velocity for sway. Two kinds, driven by white noise n,

    order 1   x''  = -w^2 x  - 2 zeta w x'  + n,                                             output x'
    order 2   x1'' = -w^2 x1 - 2 zeta w x1' + n,   x2'' = -w^2 x2 - 2 zeta w x2' + x1',      output x2'

the second for narrow-band swell, whose spectrum falls faster on both sides of its peak. Without damping it is a sinusoid of unknown
amplitude and phase.

Source: T. I. Fossen, *Handbook of Marine Craft Hydrodynamics and Motion Control*, 2011, sec. 8.2.6 (linear approximations of
wave spectra).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.core.attitude import dcm_from_rotation_vector, rotation_vector_from_dcm
from truenorth.core.compiled import compiled
from truenorth.errors.arm import slow_heading
from truenorth.errors.staying import QUIETEST_BASE, grown, local_axes
from truenorth.filters import LinearSystem
from truenorth.strapdown.inertial import InertialIntegrals

Array = NDArray[np.float64]

# Along an axis; always as many states, the unused ones zero: one compiled filter serves all. The vertical carries no attitude: its
# strongest motion is enough there. Level, a ship may also swing on her lines, by one oscillator of the first order.
MOST_OSCILLATORS = (2, 2, 1)
AXIS_STATES = (10, 10, 4)
SMALL = 16  # states of a compiled filter that is there, too, where the motion has few

# Squares of an attitude's nine elements, about its line, of an IMU that goes round: two of a steady turn, .9 of a swing by 60 deg.
GOES_ROUND = 1.0
# rad, RMS about its line, by which a base that rests shakes at the most: one that is tilted by more shows its sensors' biases.
SHAKES = 0.01

# rad, by which a heading swings at least that shows biases: what they make of less is as small as surge in step with it.
SWINGS = math.radians(10.0)

NODES, WEIGHTS = np.polynomial.legendre.leggauss(8)  # over a step of up to half a period: exact to rounding


@dataclass(frozen=True)
class Oscillator:
    """One oscillator."""

    order: int
    sigma: float  # m/s; of the velocity that it puts out
    frequency: float  # rad/s
    damping: float  # fraction of the critical, above 0 and below 1

    @property
    def states(self) -> int:
        """Displacement and velocity, of each stage."""
        return 2 * self.order


@dataclass(frozen=True)
class AxisMotion:
    """Motion of the base along one axis."""

    white: float  # m/s; one sigma of what is white in the mean velocity of an interval
    oscillators: tuple[Oscillator, ...] = ()

    @property
    def states(self) -> int:
        """Of all oscillators."""
        return sum(item.states for item in self.oscillators)

    @property
    def sigma(self) -> float:
        """One sigma of the mean velocity of an interval, m/s."""
        return math.sqrt(self.white**2 + sum(item.sigma**2 for item in self.oscillators))

    @property
    def table(self) -> tuple[NDArray[np.int64], Array]:
        """Orders (m,), and sigma, frequency and damping (m, 3) of the oscillators: the form that kernels take."""
        orders = np.array([item.order for item in self.oscillators], dtype=np.int64)
        values = np.array([(item.sigma, item.frequency, item.damping) for item in self.oscillators])
        return orders, values.reshape(-1, 3)

    def blocks(self, interval: float) -> tuple[Array, Array, Array, Array]:
        """Transition, process noise, stationary covariance (n, n), and output row (n,), of all oscillators."""
        n = self.states
        Phi, Q, P, h = np.zeros((n, n)), np.zeros((n, n)), np.zeros((n, n)), np.zeros(n)
        fill_blocks(*self.table, interval, Phi, Q, P, h)
        return Phi, Q, P, h

    def autocovariance(self, interval: float, count: int) -> Array:
        """Of the oscillators' velocity at lags 0, 1 .. intervals, (count,), (m/s)^2; what is white is not in it."""
        acf = np.zeros(count)
        add_autocovariance(*self.table, interval, acf)
        return acf


@compiled
def fill_blocks(orders: Any, values: Any, interval: float, Phi: Any, Q: Any, P: Any, h: Any) -> int:
    """Write the blocks of all oscillators along the diagonals; the number of their states.

    Parameters
    ----------
    orders, values
        As in :attr:`AxisMotion.table`.
    interval : float, s
    Phi, Q, P : (n, n) arrays, n no less than the states
        Zero on entry.
    h : (n,) array
    """
    end = 0
    for m in range(len(orders)):
        end += 2 * orders[m]
        # A first place of 0 would be a type of its own to Numba, which compiles for it apart.
        _fill(orders[m], values[m, 0], values[m, 1], values[m, 2], interval, end - 2 * orders[m], Phi, Q, P)
        h[end - 1] = 1.0
    return end


@compiled
def _fill(
    order: int, sigma: float, w: float, zeta: float, interval: float, first: int, Phi: Any, Q: Any, P: Any
) -> None:
    damp = 2.0 * zeta * w
    stages = _stages(w, zeta, interval)
    for a in range(order):
        for i in range(2):
            for j in range(2):
                Phi[first + 2 * a + i, first + 2 * a + j] = stages[0][2 * i + j]
                if a == 1:
                    Phi[first + 2 + i, first + j] = stages[1][2 * i + j]
    # The Lyapunov equation by hand. A stage driven by white noise: E[x'^2] = w^2 E[x^2], nothing between them. Behind it, as
    # multiples of E[x2'^2]: E[x1'^2] = 2 damp^2, E[x1' x2'] = damp = w^2 E[x1 x2], E[x1 x2'] = 0 = E[x1' x2].
    variance = sigma**2
    white = 2.0 * damp * variance  # density of the noise that drives the first stage
    last = first + 2 * (order - 1)
    P[last, last], P[last + 1, last + 1] = variance / w**2, variance
    if order == 2:
        white *= 2.0 * damp**2
        P[first, first], P[first + 1, first + 1] = 2.0 * damp**2 * variance / w**2, 2.0 * damp**2 * variance
        P[first, last] = P[last, first] = damp * variance / w**2
        P[first + 1, last + 1] = P[last + 1, first + 1] = damp * variance
    # What an interval adds: int exp(A s) n exp(A' s) ds.
    for k in range(len(NODES)):
        weight = 0.5 * interval * white * WEIGHTS[k]
        reached = _stages(w, zeta, 0.5 * interval * (1.0 + NODES[k]))
        for i in range(2 * order):
            for j in range(2 * order):
                Q[first + i, first + j] += weight * reached[i // 2][2 * (i % 2) + 1] * reached[j // 2][2 * (j % 2) + 1]


@compiled
def _stages(w: float, zeta: float, t: float) -> Any:
    """``exp(A t)`` of one stage, and ``int_0^t exp(A (t - s)) B exp(A s) ds``, where B takes x1' to x2''; by rows.

    B is minus the derivative of A by twice the decay, so that the integral is minus that of ``exp(A t)``.
    """
    decay = zeta * w
    turn = w * math.sqrt(1.0 - zeta**2)
    fade = math.exp(-decay * t)
    c, s = fade * math.cos(turn * t), fade * math.sin(turn * t) / turn
    dc, ds = -t * c + decay * t * s, -t * s - decay / turn**2 * (t * c - s)  # by the decay
    return (
        (c + decay * s, s, -(w**2) * s, c - decay * s),
        (-0.5 * (dc + s + decay * ds), -0.5 * ds, 0.5 * w**2 * ds, -0.5 * (dc - s - decay * ds)),
    )


@compiled
def add_autocovariance(orders: Any, values: Any, interval: float, acf: Any) -> None:
    """Add the autocovariances of the oscillators' velocities at lags 0, 1 .. intervals to `acf`.

    With decay d and turn b, and u = d / b: ``exp(-d t) (cos bt - u sin bt)`` of the first order,
    ``exp(-d t) ((1 + d t (1 - u^2)) cos bt + (u^3 - 2 d t u) sin bt)`` of the second: its value and first three derivatives
    at zero are those of the states' covariance.
    """
    for m in range(len(orders)):
        variance, w, zeta = values[m, 0] ** 2, values[m, 1], values[m, 2]
        decay, turn = zeta * w, w * math.sqrt(1.0 - zeta**2)
        u = decay / turn
        fade = math.exp(-decay * interval)
        c_step, s_step = fade * math.cos(turn * interval), fade * math.sin(turn * interval)
        c, s = 1.0, 0.0
        for k in range(len(acf)):
            dt = decay * interval * k
            if orders[m] == 1:
                acf[k] += variance * (c - u * s)
            else:
                acf[k] += variance * ((1.0 + dt * (1.0 - u**2)) * c + (u**3 - 2.0 * dt * u) * s)
            c, s = c * c_step - s * s_step, c * s_step + s * c_step


def motion_first(states: int, axis: int) -> int:
    """The first state of the motion along an axis, of a system of so many states whose last ones are its base's motion."""
    return states - sum(AXIS_STATES[axis:])


def with_motion(
    system: LinearSystem, interval: float, motion: Sequence[AxisMotion], *, spare: bool = True
) -> LinearSystem:
    """The system with the motion of its base as states.

    Parameters
    ----------
    system : LinearSystem
        Whose R holds the variance of the quietest base.
    interval : float, s
    motion : three AxisMotion
        Along E, N, U; none quieter than that.
    spare : bool
        Whether each axis has as many states as it may use, those that no oscillator uses zero. Without them, where `SMALL` states
        are enough, a likelihood takes an eighth of the time, to the same bits.

    Returns
    -------
    LinearSystem
        Of 24 more states, or of as many as are used.
    """
    used = tuple(item.states for item in motion)
    small = not spare and system.states + sum(used) <= SMALL
    sizes = used if small else AXIS_STATES
    bigger = grown(system, system.states + sum(sizes))
    white = np.zeros(3)
    for axis, item in enumerate(motion):
        first = system.states + sum(sizes[:axis])
        part = slice(first, first + item.states)
        Phi, Q, P, h = item.blocks(interval)
        bigger["Phi"][:, part, part], bigger["Q"][:, part, part] = Phi, Q
        bigger["P0"][part, part], bigger["H"][:, axis, part] = P, h
        white[axis] = item.white
    return system.with_made(**bigger, R=system.R + np.diag(white**2 - QUIETEST_BASE**2))


def without_sway(integrals: InertialIntegrals, C_sb: Array | None = None) -> InertialIntegrals:
    """The integrals with the base's sway averaged out of the attitude by which biases act; an indexer's turning stays.

    A bias seen from a base that sways makes a velocity of the sway's own periods, tenths of a mm/s of 100 ug. So do scale
    factors, a centre of rotation that was found wrongly, and the IMU's size: a filter that believed the signature of the bias would
    claim levels of arcseconds. What is left to show a bias is its mean, and an indexer's modulation.

    An IMU that something turns round and round without saying so has no line to sway about: it is left as it is. The mean attitude
    of one that spins would leave biases no level part, and level no uncertainty by them.

    Parameters
    ----------
    integrals : InertialIntegrals
    C_sb : (K+1, 3, 3) array, optional
        Attitude of the base in the IMU at the integrals' times; the two are one when left out.
    """
    turned = None if C_sb is None else _half_way(C_sb)
    basis = _line(len(integrals.C_mean))

    def slow(C: Array) -> Array:
        base = C if turned is None else C @ turned
        trend = sway_trend(base)
        about = (basis @ trend).reshape(-1, 3, 3)
        if np.mean(np.sum((base - about) ** 2, axis=(1, 2))) > GOES_ROUND:
            return C
        return about if turned is None else about @ np.swapaxes(turned, 1, 2)

    return replace(integrals, C_mean=slow(integrals.C_mean), C_late=slow(integrals.C_late))


def without_rocking(integrals: InertialIntegrals, C_n0_i: Array, lat: float) -> InertialIntegrals:
    """The integrals of a base whose heading swings slowly, and whose rocking is averaged out of the attitude by which biases act.

    Of gyros that do not see the earth turn. What is slower than the sea in heading stays, as they show it: biases turn with it, and
    a pass by their mean attitude left innovations that followed each other, of boats that swing by 30 deg in 150 s, and some looked
    like accelerometers that step. A heading that goes round and round is followed, too.

    Parameters
    ----------
    integrals : InertialIntegrals
    C_n0_i : (3, 3) array
        Attitude at the start.
    lat : float, rad
    """
    middle = (integrals.time[1:] + integrals.time[:-1]) / 2
    slow = slow_heading(integrals.C_mean, middle, C_n0_i, lat)
    slow *= float(np.ptp(slow)) > SWINGS
    turn = dcm_from_rotation_vector(slow[:, None] * [0.0, 0.0, -1.0])
    back = np.swapaxes(turn, 1, 2) @ local_axes(integrals.time, lat) @ C_n0_i
    mean, late = ((turn @ np.mean(back @ C, axis=0)) for C in (integrals.C_mean, integrals.C_late))
    off = np.swapaxes(turn, 1, 2) @ mean - back @ integrals.C_mean
    if np.mean(np.sum(off**2, axis=(1, 2))) > GOES_ROUND:
        return integrals
    return about_rest(integrals, (mean, late), C_n0_i, lat)


def without_shaking(integrals: InertialIntegrals, C_n0_i: Array, lat: float) -> InertialIntegrals:
    """The integrals of a base that rests, its shaking averaged out of the attitude by which biases act.

    An engine tilts and pushes a truck in step. A filter that took the push for a bias seen from a tilting base had 104 mg and a
    level 6 deg off, 4.6 of its sigmas.

    Parameters
    ----------
    integrals : InertialIntegrals
    C_n0_i : (3, 3) array
        Attitude at the start.
    lat : float, rad
    """
    trend = rest_trend(integrals, C_n0_i, lat)
    if trend is None:
        return integrals
    basis = _line(len(integrals.C_mean))
    return about_rest(integrals, (basis @ trend[0], basis @ trend[1]), C_n0_i, lat)


def about_rest(
    integrals: InertialIntegrals, lines: tuple[Array, Array], C_n0_i: Array, lat: float
) -> InertialIntegrals:
    """The integrals with attitudes (K, 9) in the local frame, of its means and late means, as those by which biases act."""
    back = np.swapaxes(local_axes(integrals.time, lat) @ C_n0_i, 1, 2)
    C_mean, C_late = (back @ line.reshape(-1, 3, 3) for line in lines)
    return replace(integrals, C_mean=C_mean, C_late=C_late)


def rest_trend(integrals: InertialIntegrals, C_n0_i: Array, lat: float) -> tuple[Array, Array] | None:
    """(2, 9) each, the lines about which means and late means of a base's attitude in the local frame shake; None: it tilts."""
    C_n = local_axes(integrals.time, lat) @ C_n0_i
    mean, late = C_n @ integrals.C_mean, C_n @ integrals.C_late
    trend = sway_trend(mean)
    off = mean.reshape(len(mean), 9) - _line(len(mean)) @ trend
    # A turn by an angle moves the nine elements by twice the square of that.
    return None if np.mean(np.sum(off**2, axis=1)) > 2.0 * SHAKES**2 else (trend, sway_trend(late))


def sway_trend(C: Array) -> Array:
    """(2, 9) the straight line, over -1 to 1, about which attitudes (K, 3, 3) sway; the ends of the log count less."""
    basis = _line(len(C))
    root = np.sqrt(1.0 - basis[:, 1] ** 2 + 1e-9)
    return np.asarray(np.linalg.lstsq(root[:, None] * basis, root[:, None] * C.reshape(len(C), 9), rcond=None)[0])


def _line(count: int) -> Array:
    """(count, 2) one and time from -1 to 1."""
    t = np.linspace(-1.0, 1.0, count)
    return np.stack([np.ones_like(t), t], axis=1)


def _half_way(C: Array) -> Array:
    """(K, 3, 3) attitudes half way between K + 1 ones."""
    step = rotation_vector_from_dcm(C[1:] @ np.swapaxes(C[:-1], 1, 2))
    return dcm_from_rotation_vector(0.5 * step) @ C[:-1]
