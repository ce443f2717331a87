"""An indexer's angles against the gyros: with the right ones the base that carries it sways about one attitude."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from truenorth.analysis.student import student_limit
from truenorth.core.attitude import dcm_from_quaternion, rotation_vector_from_dcm
from truenorth.quality.tilt import whole_cells
from truenorth.records import ImuRecord
from truenorth.state.evidence import Effect, Evidence, Kind, contradiction
from truenorth.state.limits import limit
from truenorth.strapdown.inertial_integration import integrate_attitude

Array = NDArray[np.float64]

NET_TURN = math.radians(8.0)  # of the base's mean attitude from the first third of a log to the last: more is no sway
BIASED = 4.0  # sigmas of a gyro's bias
WINDOW = 2  # turns of the outer axis in a Hann window: what the base sways by, faster than the axis turns, averages out
FEWEST_WINDOWS = 3  # that show a wobble
# of the sigma of a mean of windows that share half of their turns, by one of windows that share none: such two are alike by 1/6
SHARED = math.sqrt(4.0 / 3.0)
USUAL_ZERO = math.radians(0.05)  # rad: indexers are mounted no better, which is no fault but belongs into sigma
FEW = 1000  # rows that show the plane in which an axis turns
FASTEST = math.radians(60.0)  # rad/s RMS: no ship or vehicle that stays turns faster


def encoder_evidence(
    record: ImuRecord,
    C_sb: Callable[[Array], Array],
    others: Mapping[str, Callable[[Array], Array]],
    gyro_bias: float = 0.0,
) -> list[Evidence]:
    """Whether the base turns as no base does, and with which other reading of the angles it would not.

    Parameters
    ----------
    C_sb : callable
        Attitude (K, 3, 3) of the base in the IMU at times (s), by the angles as given.
    others : mapping
        The same by other readings of the angles, by their names.
    gyro_bias : float, rad/s
        One sigma: what it turns by itself between the thirds is no turn of the base.
    """
    theta, interval, time = whole_cells(record)
    C_is = dcm_from_quaternion(integrate_attitude(theta))
    time = np.append(time[0] - 0.5 * interval, time + 0.5 * interval)

    def turns(reading: Callable[[Array], Array]) -> tuple[float, float]:
        C = C_is @ reading(time)
        rate = rotation_vector_from_dcm(np.swapaxes(C[:-1], 1, 2) @ C[1:]) / interval
        third = len(C) // 3
        net = _mean(C[:third]).T @ _mean(C[-third:])
        return math.sqrt(float(np.mean(np.sum(rate**2, axis=1)))), float(np.linalg.norm(rotation_vector_from_dcm(net)))

    given, net = turns(C_sb)
    best, name = min((turns(reading)[0], name) for name, reading in others.items())
    if given**2 > limit("clearer encoder") * best**2:
        return [contradiction("encoder.turns", "encoder", given=given, best=best, reading=name)]
    drifted = BIASED * gyro_bias * record.duration * 2.0 / 3.0
    if net > NET_TURN + drifted or given > FASTEST:
        return [contradiction("encoder.drifts", "encoder", net=net, rate=given)]
    return []


def zero_evidence(
    record: ImuRecord, C_sb: Callable[[Array], Array], inner: Callable[[Array], Array], times: float = 1.0
) -> list[Evidence]:
    """Whether the zero of the inner axis' angle is off: the base seems to wobble about that axis, as the outer one turns it.

    By an error ``d`` of the inner angle the base is turned by ``d u(t)``, ``u`` the inner axis in the base. In each window of two
    turns of ``u``, half of it shared with the next, one ``d`` is fitted to the base's turns, weighted by Hann's window, which
    leaves out what sways faster than ``u`` turns. Its sigma is from their scatter, and from what is found about three axes that
    move as fast, and about which no such error turns the base. (An error of the outer angle's zero defines the body's axes anew:
    nothing shows it.) An encoder that is late by ``t`` looks like ``d = -t`` times the rate of the inner axis, where that goes on
    in one direction, and turns heading by ``t`` times the rate of the outer one. Where `d` changes from window to window by far
    more than what is found about the other axes, it goes with the inner angle, as of a disc that is not centred.

    Parameters
    ----------
    C_sb : callable
        Attitude (K, 3, 3) of the base in the IMU at times (s).
    inner : callable
        Direction (K, 3) of the inner axis in the base at times (s).
    times : float
        By which the outer axis turns faster than the inner one.
    """
    theta, interval, time = whole_cells(record)
    C_is = dcm_from_quaternion(integrate_attitude(theta))
    time = np.append(time[0] - 0.5 * interval, time + 0.5 * interval)
    C, u = C_is @ C_sb(time), inner(time)
    turn = np.asarray(rotation_vector_from_dcm(_mean(C).T @ C))
    swept = np.cumsum(np.linalg.norm(np.diff(u, axis=0), axis=1))
    edges = np.searchsorted(swept, 2.0 * math.pi * np.arange(int(swept[-1] / (2.0 * math.pi)) + 1))
    windows = [slice(a, b) for a, b in zip(edges[:-WINDOW], edges[WINDOW:], strict=True)]
    if len(windows) < FEWEST_WINDOWS:
        return []
    found, *others = ([_along(turn, axis, swept, part) for part in windows] for axis in (u, *_unlike(u)))
    swings = np.array(found) - np.mean(found)
    scatter = np.concatenate([swings, *others])
    off, sigma = -float(np.mean(found)), SHARED * math.sqrt(float(np.mean(scatter**2)) / len(found))
    swing, sway = (math.sqrt(float(np.mean(np.square(x)))) for x in (swings, others))
    if swing > max(USUAL_ZERO, limit("indexer") * sway):  # it goes with the inner angle: an eccentric disc
        off, sigma = math.sqrt(2.0) * swing, sway
    elif abs(off) < max(limit("indexer"), student_limit(limit("few turns"), 3 * len(found) - 1)) * sigma:
        return []
    effect = Effect(max(1.0, times) * abs(off), abs(off))
    kind: Kind = "bounded" if abs(off) > USUAL_ZERO else "known"
    return [Evidence("encoder.zero", {"off": off, "sigma": sigma}, kind, effect, ("encoder",))]


def _along(turn: Array, axis: Array, swept: Array, part: slice) -> float:
    """How much the base turns about a moving axis, in one window."""
    share = (swept[part] - swept[part.start]) / (swept[part.stop - 1] - swept[part.start])
    hann = (1.0 - np.cos(2.0 * math.pi * share))[:, None] / len(share)
    v, w = (x[part] - np.sum(hann * x[part], axis=0) for x in (axis, turn))
    return float(np.sum(hann * v * w) / np.sum(hann * v * v))


def _unlike(u: Array) -> tuple[Array, Array, Array]:
    """Axes that move as fast as u (K, 3), about which no error of the inner angle turns the base: sway alone does.

    A quarter of a turn behind u, and both of these as they would go round the other way.
    """
    about = np.linalg.svd(u[:: max(1, len(u) // FEW)], full_matrices=False)[2][2]
    p = u[0]
    q = np.cross(about, p)
    mirrored = np.outer(u @ p, p) - np.outer(u @ q, q)
    return np.cross(about, u), mirrored, np.cross(about, mirrored)


def _mean(C: Array) -> Array:
    """The rotation nearest to the mean of some."""
    U, _, Vt = np.linalg.svd(C.mean(axis=0))
    return np.asarray(U @ np.diag([1.0, 1.0, np.linalg.det(U @ Vt)]) @ Vt)
