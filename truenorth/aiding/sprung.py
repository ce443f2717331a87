"""A wheel keeps to its road, and the body above it does not: of the body's motion the wheel's constraints hold for the slow part.

Between them are springs. An uneven road lets the body heave by .05 m/s RMS at .8 to 4 Hz, and pitch by p, which at a speed V is
``-V p`` across its axes. Nothing of that is an error of the INS: the IMU shows it. A constraint that the body has no velocity
across says that it is, and in step with what shows it: the error of the constraint *is* what a scale factor of the upward
accelerometer, or of the pitch gyro, acts on. White noise of 0.1 m/s does not cover that, for errors in step with a column do not
average out.

So the constraint is that of the path, on which the body is but for its quick motion, here q, along the vehicle's axes m:

    0 = [C_mb (u - u_q + (w - w_q) x l)]_(x, z)

The quick part of the body's velocity is from the IMU and the wheel's speed V alone, that of its rate from the gyros, with ``theta =
int w dt`` and the direction ``up`` of the mean specific force along the body:

    u' = f + g theta x up - w x V,    V = C_mb' (0, V, 0);    x_q = (1 - k)^2 x

k is a smooth mean over a second (of three boxes, symmetric in time): a polynomial of third degree in time has no quick part, hence
neither biases nor the level at the start matter. Of .3 Hz a fifth is quick, of .5 Hz three quarters, from .7 Hz on all.

Source: T. Gillespie, "Fundamentals of Vehicle Dynamics" (1992), ch. 5: a body on its springs bounces and pitches at 1 to 2 Hz, its
axles hop at 10. The constraint without the quick part is ours.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from truenorth.aiding.source import Aiding
from truenorth.aiding.wheel import SPRUNG_WHEEL, WHEEL
from truenorth.core.earth import GRAVITY_EQUATOR
from truenorth.records import ImuRecord
from truenorth.strapdown.increments import increments

Array = NDArray[np.float64]

BOX = 1.2  # s, of each of the three means that make up what is slow
BLOCK, REACH = 3600.0, 6.0 * BOX  # s, looked at together, and before and behind: k twice reaches 3 boxes
LEAST = 0.1  # of what a constraint allows: of columns in step with less of it a hundredth counts
GRID = 0.02  # s, on which it is looked at: bodies on springs are slower


def of_the_path(aiding: Iterable[Aiding], record: ImuRecord) -> list[Aiding]:
    """The same sources, but for wheels of bodies that move quickly: their constraints hold for the path without that."""
    return [_on_its_path(source, record) if source.row is WHEEL else source for source in aiding]


def _on_its_path(source: Aiding, record: ImuRecord) -> Aiding:
    if not len(source.time):
        return source
    quick = quick_motion(record, source)
    across = (quick[:, :3] @ source.C_mb.T)[:, (0, 2)]
    if np.sqrt(np.mean(across**2)) < LEAST * np.median(source.sigma[:, (0, 2)]):
        return source
    return replace(source, kind=SPRUNG_WHEEL, measured=np.hstack([source.measured, quick]))


def quick_motion(record: ImuRecord, wheel: Aiding) -> Array:
    """(M, 9) what is quick of velocity, rate and specific force, body axes, m/s, rad/s and m/s^2, at the times of a wheel."""
    begins = np.arange(record.time[0], record.time[-1] + record.interval, BLOCK)
    firsts = [0, *np.searchsorted(wheel.time, begins[1:]), len(wheel.time)]
    parts = (record.between(begin - REACH, begin + BLOCK + REACH) for begin in begins)
    found = [_of_part(part, wheel, wheel.time[i:j]) for part, i, j in zip(parts, firsts[:-1], firsts[1:], strict=True)]
    return np.concatenate([np.zeros((0, 9)), *found])


def _of_part(record: ImuRecord, wheel: Aiding, at: Array) -> Array:
    """The same at some times of a wheel, of a part of the record about them."""
    dtheta, dvel = increments(record)
    time = np.arange(record.time[0] - record.steps[0], record.time[-1], max(GRID, record.interval))
    if len(time) < 2 or not len(at):
        return np.zeros((len(at), 9))
    theta, pushed = (_on_grid(record, x, time) for x in (dtheta, dvel))
    T = time[1] - time[0]
    rate, force = (np.gradient(x, T, axis=0) for x in (theta, pushed))
    up = pushed[-1] / max(float(np.linalg.norm(pushed[-1])), 1e-9)
    known = np.isfinite(wheel.measured[:, 1])
    speed = np.interp(time, wheel.time[known], wheel.measured[known, 1]) if known.any() else np.zeros(len(time))
    change = GRAVITY_EQUATOR * np.cross(theta, up) - np.cross(rate, speed[:, None] * wheel.C_mb[1])
    velocity = pushed + np.cumsum(change, axis=0) * T - 0.5 * T * change
    quick = _quick(np.hstack([velocity, rate, force]).T, quick_kernel(BOX / T))
    return np.stack([np.interp(at, time, x) for x in quick], axis=1)


def quick_kernel(rows: float) -> Array:
    """``(1 - k)^2`` with k of three boxes of so many rows."""
    box = np.ones(2 * int(0.5 * rows) + 1)
    box /= len(box)
    k = np.convolve(np.convolve(box, box), box)
    kernel = np.convolve(k, k)
    kernel[len(k) // 2 : len(k) // 2 + len(k)] -= 2.0 * k
    kernel[len(kernel) // 2] += 1.0
    return kernel


def _quick(courses: Array, kernel: Array) -> Array:
    """What is quick of courses, along the last axis; beyond its ends one goes on as if turned by half a turn about them."""
    from scipy.fft import irfft, next_fast_len, rfft

    beyond = len(kernel) // 2
    length = courses.shape[-1] + 2 * beyond
    fast = next_fast_len(length, real=True)
    of_kernel = rfft(kernel, fast)
    found = np.empty_like(courses)
    for course, quick in zip(courses, found, strict=True):
        longer = np.pad(course, beyond, mode="reflect", reflect_type="odd")
        quick[:] = irfft(rfft(longer, fast) * of_kernel, fast)[2 * beyond : length]
    return found


def _on_grid(record: ImuRecord, steps: Array, time: Array) -> Array:
    """(N, 3) sums of increments up to some times."""
    ends = np.concatenate([[record.time[0] - record.steps[0]], record.time])
    sums = np.vstack([np.zeros(3), np.cumsum(steps, axis=0)])
    return np.stack([np.interp(time, ends, column) for column in sums.T], axis=1)
