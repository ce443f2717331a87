"""Tilt by gyros against tilt by accelerometers, while a base sways or turns: exchanged, flipped, late and scaled axes.

Carried by the right gyros into axes that do not turn, the specific force of a base that stays is gravity's reaction, the lever
arm's ``(w' x + w x w x) r``, and the base's own accelerations, whose mean is zero. Wrong gyros leave gravity swinging in these
axes. Each reading of the columns (48 signed orders, times shifts of the gyros against the accelerometers) is tried: over short
pieces, so that biases and the earth do not matter, a constant and a slope are taken off, then the best arm for all, and what is
left is compared. Where the columns as given stand, a small delay of all gyros and a scale factor of each are fitted: of a scale
error ``k`` the tilt swings by ``k`` times the sway. A base that sways with one period hides it in the arm, ``k g / w^2``.

A ship's accelerations are made by the waves that make her roll and pitch, and go with these: of a moored one, that hardly rolls,
they are half of what the tilt makes. So they pass for a delay, but for another one about each axis, which the gyros of one clock do
not have, or for one that leaves much of what goes with the tilt (:mod:`truenorth.quality.pushed`); and for scale errors, which only
a base shows whose gyros explain nearly all of gravity's swing.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from itertools import permutations, product

import numpy as np
from numpy.typing import NDArray

from truenorth.analysis.student import student_limit
from truenorth.core.earth import GRAVITY_EQUATOR
from truenorth.quality.one_sign import OneSign, one_sign
from truenorth.quality.pushed import NO_PUSH, Push, push_in_step
from truenorth.quality.tilt_bench import TiltBench, shifted
from truenorth.records import ImuRecord
from truenorth.state.evidence import ANY_EFFECT, Effect, Evidence, Figure
from truenorth.state.limits import limit
from truenorth.strapdown.increments import increments

Array = NDArray[np.float64]

CELL = 0.1  # s, over which rates and forces are averaged
PIECE = 20.0  # s, of a constant and a slope: biases and the earth turn gravity by less than a straight line
MOST_TIME = 160.0  # s of a log that are looked at: its middle
LEAST_TURN = math.radians(0.3)  # rad, RMS of the turns in a piece: below it nothing is said
SHIFTS = (-0.6, -0.4, -0.2, 0.2, 0.4, 0.6)  # s, by which gyros may be late, tried with the columns as given
IDENTITY = "+x +y +z"


@dataclass(frozen=True)
class Tilt:
    """What the readings leave.

    Attributes
    ----------
    given : float, m/s^2
        RMS of specific force that the gyros as given do not explain.
    unturned : float, m/s^2
        The same with the gyros at rest.
    best : float, m/s^2
        Of the best reading.
    axes : str
        The best reading of the gyro columns x, y, z, such as ``+y +x +z``.
    delay, delay_sigma : float, s
        By which the gyros are late with the columns as given, and its one-sigma.
    tilt : float, rad
        RMS of the tilt that such a delay makes.
    scale, scale_sigma : (3,) arrays
        Errors of the gyros' scale factors, and their one-sigmas; infinite where gyros without these errors turn no better.
    turned : (3,) array, rad
        RMS of the turns about each axis in a piece.
    pieces : int
        From whose scatter the sigmas are.
    by_axis, by_axis_sigma : (3,) arrays, s
        The delay by the turns about each axis alone, and its one-sigma.
    turn : float, rad
        RMS of the turn about the vertical that the delay makes: gravity does not show it, and an IMU that spins on its base has it
        all along.
    pushed : Push
        Of a rough base: what goes with its tilt and is no delay.
    sign : OneSign or None
        A gyro whose sign is wrong by level force alone: of a base that hardly turns about it, heave is more than it leaves.
    """

    given: float
    unturned: float
    best: float
    axes: str
    delay: float
    delay_sigma: float
    tilt: float
    scale: Array = field(default_factory=lambda: np.zeros(3))
    scale_sigma: Array = field(default_factory=lambda: np.full(3, np.inf))
    turned: Array = field(default_factory=lambda: np.zeros(3))
    pieces: int = 2
    by_axis: Array = field(default_factory=lambda: np.zeros(3))
    by_axis_sigma: Array = field(default_factory=lambda: np.full(3, np.inf))
    turn: float = 0.0
    pushed: Push = NO_PUSH
    sign: OneSign | None = None

    def evidence(self) -> list[Evidence]:
        """Another reading that explains what the one given does not."""
        figures: dict[str, Figure] = {
            "given": self.given,
            "best": self.best,
            "axes": self.axes,
            "delay": abs(self.delay),
        }
        explains = self.best**2 < min(self.given**2 / limit("clearer tilt"), limit("explained tilt") * self.unturned**2)
        if explains and self.axes != IDENTITY:
            return [_other_axes(figures)]
        if self.sign is not None:
            signs = [-1.0 if i == self.sign.axis else 1.0 for i in range(3)]
            figures |= {"given": self.sign.given, "best": self.sign.left, "axes": _columns((0, 1, 2), signs)}
            return [_other_axes(figures)]
        late = "tilt.gyros_late" if self.delay > 0.0 else "tilt.gyros_early"
        alone = self.pushed.share <= limit("pushed in step")
        if explains and alone:
            return [Evidence(late, figures, "unknown", ANY_EFFECT, ("common_clock",))]
        found = []
        sure, clear, hint = (
            student_limit(chance, self.pieces - 1)
            for chance in (limit("sure delay"), limit("clear delay"), limit("hint of a delay"))
        )
        agree = self._axes_agree(0.0 if self.rough else clear)  # on a rough base it has to be seen
        if abs(self.delay) >= max(limit("late sensor"), hint * self.delay_sigma) and (agree or not self.rough):
            certain = agree and alone and abs(self.delay) >= sure * self.delay_sigma and self._on_two_axes(sure)
            # What the gyros do not explain may be the base's own, and have hidden as much of a delay as it may have made.
            own = self.pushed.level or self.given  # heave hides none
            level = self.tilt if certain else math.hypot(self.tilt, own / GRAVITY_EQUATOR)
            effect = Effect(heading=self.turn, level=level)
            found.append(Evidence(late, figures, "bounded" if certain else "hint", effect, ("common_clock",)))
        off = np.abs(self.scale)
        for i in np.flatnonzero(off >= np.maximum(least_scale(self.turned), clear * self.scale_sigma)):
            size = float(off[i] * self.turned[i])
            figures = {"axis": "xyz"[i], "scale": float(self.scale[i]), "sigma": float(self.scale_sigma[i])}
            found.append(Evidence("tilt.scale", figures, "bounded", Effect(heading=size, level=size), ("units",)))
        return found

    @property
    def rough(self) -> bool:
        """Whether the base's own accelerations are much of what the gyros should explain."""
        return self.given**2 > limit("gyros right") * self.unturned**2

    def _axes_agree(self, clear: float) -> bool:
        """Whether the two axes that show a delay best show the same one: one clock has one delay, a base's own motion any."""
        best = np.argsort(self.by_axis_sigma)[:2]
        (one, other), sigma = self.by_axis[best], float(np.linalg.norm(self.by_axis_sigma[best]))
        return bool(abs(one - other) <= max(limit("one delay") * abs(self.delay), clear * sigma))

    def _on_two_axes(self, sure: float) -> bool:
        """Whether turns about two axes show it: a base that goes to and fro in the time of a sway looks like it about one."""
        shown = (self.by_axis * np.sign(self.delay) >= sure * self.by_axis_sigma) & (self.by_axis_sigma > 0.0)
        return bool(np.count_nonzero(shown) > 1)


def check_tilt(record: ImuRecord, C_sb: Callable[[Array], Array] | None = None, accel_bias: float = 0.0) -> Tilt | None:
    """Try all readings of the gyros on the middle of a record.

    Parameters
    ----------
    C_sb : callable, optional
        Attitude (K, 3, 3) of the base in the IMU at times (s): of an IMU that turns on it.
    accel_bias : float, m/s^2
        One sigma.

    Returns
    -------
    Tilt or None
        None where the IMU does not turn enough, or the record is too short.
    """
    cells = _cells(record)
    if cells is None:
        return None
    theta, force, interval, middle = cells
    bench = TiltBench(
        force, interval, None if C_sb is None else C_sb(middle.ravel()).reshape(*middle.shape, 3, 3), accel_bias
    )
    turned = np.cumsum(theta - theta.mean(axis=1, keepdims=True), axis=1)
    turns = np.sqrt(np.mean(turned**2, axis=(0, 1)))
    if float(np.linalg.norm(turns)) < LEAST_TURN:
        return None
    return replace(_read(bench, theta, turns), sign=one_sign(bench, theta))


def _read(bench: TiltBench, theta: Array, turns: Array) -> Tilt:
    """All readings but a sign by level force; `turns`: RMS of the turns about each axis."""
    interval, turns_within = bench.interval, bench.C_sb is not None
    unturned, given = bench.left(np.zeros_like(theta)), bench.left(theta)
    best, axes, delay = given, IDENTITY, 0.0
    few = [(o, s) for o, s in READINGS if _is_near(o, s)]
    likely = min(bench.left(theta[..., order] * signs) for order, signs in few)
    rough = given**2 > limit("gyros right") * unturned**2
    for order, signs in READINGS if rough or 1.5 * likely**2 < given**2 else []:
        left = bench.left(theta[..., order] * signs)
        if left < 0.99 * best:
            best, axes = left, _columns(order, signs)
    may_be_pushed = rough and not turns_within  # a base that turns within itself, on an indexer, goes with no wave
    squares = {shift: bench.left(shifted(theta, shift / interval)) ** 2 for shift in SHIFTS if rough} | {0.0: given**2}
    shift = min(squares, key=squares.__getitem__)
    if squares[shift] < min(0.98 * best**2, 0.5 * given**2):
        delay, small = _lowest(squares, shift)
        pushed = push_in_step(bench, theta, shifted(theta, delay / interval)) if may_be_pushed else NO_PUSH
        tilt = abs(delay) * bench.rate(theta)
        turn = abs(delay) * bench.rate_up(theta)
        return Tilt(given, unturned, math.sqrt(small), IDENTITY, delay, 0.0, tilt, turn=turn, pushed=pushed)
    if given >= unturned:
        # Gyros that leave more than if they were at rest turn something else than gravity: no small error is what is wrong.
        return Tilt(given, unturned, best, axes, 0.0, 0.0, 0.0)
    little, sigma = bench.small(theta)
    late = float(little[0])
    tilt = abs(late) * bench.rate(theta)
    # Scale factors are fitted on a straight line, and the base's motion along the sway may pass for them. With half of what was
    # found taken off, and with all, the gyros must turn better and better.
    clear = student_limit(limit("clear delay"), len(theta) - 1)
    scale, sigma_scale = little[1:4], sigma[1:4]
    wrong = np.where(np.abs(scale) >= np.maximum(least_scale(turns), clear * sigma_scale), scale, 0.0)
    if wrong.any():
        half, whole = (theta / np.maximum(1.0 + part * wrong, 0.1) for part in (0.5, 1.0))
        better = bench.left(whole) < bench.left(half) < given
        # An arm takes up most of a scale error, and of a push as well: a base that is not rough may be pushed all the same.
        pushed_so = not turns_within and push_in_step(bench, theta, whole).share > limit("pushed in step")
        if not better or may_be_pushed or pushed_so:
            sigma_scale = np.full(3, np.inf)
        # Of an indexer the angles must say so, too: the waves that push its base leave some of that in the tilt as it spins.
        by_angles = bench.scales_by_angles(theta)
        if by_angles is not None:
            sigma_scale = np.where(by_angles * wrong < 0.5 * wrong**2, np.inf, sigma_scale)
    each = little[4:], sigma[4:]
    turn = abs(late) * bench.rate_up(theta)
    pushed = push_in_step(bench, theta, shifted(theta, late / interval)) if may_be_pushed else NO_PUSH
    one_delay = given, unturned, best, axes, late, float(sigma[0]), tilt
    return Tilt(*one_delay, scale, sigma_scale, turns, len(theta), *each, turn, pushed)


def _other_axes(figures: dict[str, Figure]) -> Evidence:
    return Evidence("tilt.axes", figures, "unknown", ANY_EFFECT, ("imu_axes",))


def least_scale(turned: Array) -> Array:
    """(3,) the smallest scale error that is more than a sound gyro's: turns about the other axes leak in by its misalignment."""
    return np.asarray(limit("scale factor") * np.linalg.norm(turned) / np.maximum(turned, 1e-12))


READINGS = list(product(permutations(range(3)), product((1.0, -1.0), repeat=3)))


def _is_near(order: tuple[int, ...], signs: tuple[float, ...]) -> bool:
    """One exchange, one sign, or a cycle."""
    return (order == (0, 1, 2) and sum(signs) == 1.0) or (order != (0, 1, 2) and sum(signs) == 3.0)


def _lowest(squares: dict[float, float], at: float) -> tuple[float, float]:
    """Where the parabola through the lowest point and its neighbours is lowest, and its value there."""
    shifts = sorted(squares)
    k = min(max(shifts.index(at), 1), len(shifts) - 2)
    x, y = np.array(shifts[k - 1 : k + 2]), np.array([squares[s] for s in shifts[k - 1 : k + 2]])
    a, b, c = np.polyfit(x, y, 2)
    low = float(np.clip(-b / (2.0 * a), x[0], x[-1])) if a > 0.0 else at
    return low, max(float(a * low**2 + b * low + c), 1e-12)


def whole_cells(record: ImuRecord) -> tuple[Array, float, Array]:
    """Turns (K, 3) of even cells of a whole record, rad; their length, s; the times of their middles (K,), s."""
    rows = max(1, round(CELL / record.interval))
    count, interval = len(record) // rows, rows * record.interval
    dtheta = increments(record)[0][: count * rows].reshape(count, rows, 3).sum(axis=1)
    time = record.time[: count * rows].reshape(count, rows)
    return dtheta, interval, 0.5 * (time[:, 0] - record.interval + time[:, -1])


def _cells(record: ImuRecord) -> tuple[Array, Array, float, Array] | None:
    """Turns (rad) and mean specific forces (m/s^2) of even cells of the record's middle, by pieces (P, L, 3), and their times."""
    middle = 0.5 * (record.time[0] + record.time[-1])
    first, last = np.searchsorted(record.time, [middle - 0.5 * MOST_TIME, middle + 0.5 * MOST_TIME])
    rows = max(1, round(CELL / record.interval))
    interval = rows * record.interval
    length = round(PIECE / interval)
    pieces = (last - first) // (rows * length)
    if pieces < 3:
        return None
    part = slice(first, first + pieces * length * rows)
    dtheta, dvel = (x[part].reshape(pieces, length, rows, 3).sum(axis=2) for x in increments(record))
    time = record.time[part].reshape(pieces, length, rows)
    return dtheta, dvel / interval, interval, 0.5 * (time[..., 0] - record.interval + time[..., -1])


def _columns(order: Sequence[int], signs: Sequence[float]) -> str:
    """What the columns x, y, z hold when axis i is column ``order[i]`` times ``signs[i]``."""
    names = [""] * 3
    for axis, (column, sign) in enumerate(zip(order, signs, strict=True)):
        names[column] = ("+" if sign > 0 else "-") + "xyz"[axis]
    return " ".join(names)
