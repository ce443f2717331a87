"""Vehicles of the foreign world, each by its own equations: on wheels, in the air, on and under water, on a rope.

Each takes a generator and a length in seconds and gives a :class:`benchmarks.honesty.foreign.World`. Commands (speeds, steering,
banks, waypoints) are drawn; the vehicle's equations of motion are integrated in steps of 10 ms and joined by splines.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.signal import lfilter

from benchmarks.honesty.foreign import STEP, World, attitude, coloured, noise, world

Array = NDArray[np.float64]
DEG, G = math.pi / 180.0, 9.80665
COARSE = 0.01  # s
BLOCK = 256  # epochs


def _grid(length: float) -> Array:
    return np.asarray(STEP * np.arange(round(length / STEP) + 1))


def _place(rng: np.random.Generator, most: float = 60.0) -> Array:
    return np.array([rng.uniform(-most, most) * DEG, rng.uniform(-180.0, 180.0) * DEG, rng.uniform(0.0, 300.0)])


def _held(rng: np.random.Generator, t: Array, draw: Callable[[], float], least: float, most: float) -> Array:
    """A command that is held for a drawn time, then another."""
    out, at = np.empty_like(t), 0.0
    while at < t[-1] + COARSE:
        last = at + rng.uniform(least, most)
        out[(t >= at) & (t < last)] = draw()
        at = last
    return out


def _follow(command: Array, quick: Array | float, most: Array | float, first: float = 0.0) -> Array:
    """What follows a command by a lag of second order (`quick`, rad/s, damped by .9), its rate limited."""
    quick, most = np.broadcast_to(quick, command.shape), np.broadcast_to(most, command.shape)
    x, rate = first, 0.0
    out = np.empty_like(command)
    for k, wanted in enumerate(command):
        pull = quick[k] ** 2 * (wanted - x) - 1.8 * quick[k] * rate
        rate = min(max(rate + pull * COARSE, -most[k]), most[k])
        x += rate * COARSE
        out[k] = x
    return out


def _spring(drive: Array, hertz: float, damping: float) -> Array:
    """A body on its springs, driven to `drive` (one unit: at rest it stays there)."""
    w = 2.0 * math.pi * hertz * STEP
    a = [1.0 + damping * w, -2.0 + w * w, 1.0 - damping * w]
    return np.asarray(lfilter([0.0, w * w, 0.0], a, drive))


def _fine(t: Array, coarse: Array, fine: Array) -> Array:
    return np.asarray(CubicSpline(t, coarse)(fine))


def _engine(rng: np.random.Generator, fine: Array, hertz: Array, push: float, turn: float) -> tuple[Array, Array]:
    """(M, 3) displacement and rotation of the IMU by an engine's line and its half: pushes, m/s^2, and rates, rad/s."""
    shift, tilt = np.zeros((2, len(fine), 3))
    for order in (1.0, 0.5, 1.5):
        w = 2.0 * math.pi * order * hertz
        phase = np.cumsum(w) * STEP + rng.uniform(0.0, 6.28)
        for axis in range(3):
            shift[:, axis] += push * rng.uniform(0.3, 1.0) / order / w**2 * np.sin(phase + rng.uniform(0.0, 6.28))
            tilt[:, axis] += turn * rng.uniform(0.3, 1.0) / order / w * np.sin(phase + rng.uniform(0.0, 6.28))
    return shift, tilt


def _wheeled(
    rng: np.random.Generator,
    length: float,
    speed: Array,
    bend: Array,
    rough: float,
    engine: tuple[float, float, float, float],
    crab: float,
    quick: float,
    kick: Array | None = None,
    dip: float = 2.5,
) -> World:
    """A vehicle on wheels: `speed` of its rear axle, m/s, and curvature `bend`, 1/m, at steps of COARSE.

    Its springs let it dip by `dip`, deg/g, its tyres run askew by `crab`, deg s^2/m.
    """
    t, fine = COARSE * np.arange(len(speed)), _grid(length)
    s = _fine(t, np.maximum(speed, 0.0), fine)
    s = np.maximum(s, 0.0)
    yaw = _fine(t, speed * bend, fine)
    heading = rng.uniform(0.0, 6.28) + np.concatenate([[0.0], np.cumsum(0.5 * (yaw[1:] + yaw[:-1])) * STEP])
    along, across = np.gradient(s, STEP), s * yaw
    way = np.concatenate([[0.0], np.cumsum(s[:-1]) * STEP])
    knots = np.arange(0.0, way[-1] + 200.0, 20.0)
    grade, bank = (
        CubicSpline(knots, coloured(rng, len(knots), 20.0, a * DEG, 150.0, 1)[:, 0])(way) for a in (2.0, 1.5)
    )
    shaken = rough * np.minimum(s / 2.0, 1.0) * (s > 0.0)
    give = rng.uniform(0.8, 1.2)
    pitch = (
        grade
        + _spring(give * dip * DEG * (along / G + np.sin(grade)), 1.4, 0.3)
        + shaken * noise(rng, len(fine), 0.3, quick, DEG)
    )
    roll = (
        bank - _spring(give * 4.0 * DEG / G * across, 1.2, 0.3) + shaken * noise(rng, len(fine), 0.3, quick, 1.4 * DEG)
    )
    if kick is not None:
        pitch = pitch + _spring(_fine(t, kick, fine), 1.0, 0.3)
    idle, most, push, turn = engine
    hertz = idle + (most - idle) * s / max(s.max(), 1.0)
    shift, tilt = _engine(rng, fine, hertz, push, turn)
    C = attitude(heading + tilt[:, 2], pitch + tilt[:, 0], roll + tilt[:, 1])
    side = -crab * across * DEG + crab * DEG * np.sin(bank) * G  # the tyres give way sideways
    course = heading + side * (s > 0.0)
    v = np.stack([s * np.sin(course) * np.cos(grade), s * np.cos(course) * np.cos(grade), s * np.sin(grade)], axis=1)
    v[:, 2] += np.gradient(shaken * noise(rng, len(fine), 0.5, 2.0 * quick, 0.005), STEP)
    arm = np.array([rng.normal(0.0, 0.3), rng.normal(0.8, 0.4), rng.normal(0.3, 0.3)])
    return world(rng, _place(rng), v, C, arm + shift, s)


def car(rng: np.random.Generator, length: float) -> World:
    """Streets: off from rest, lights, bends; pitch and roll by its springs; its engine at 25 to 60 Hz."""
    t = COARSE * np.arange(round(length / COARSE) + 1)
    command = _held(rng, t, lambda: 0.0 if rng.random() < 0.2 else rng.uniform(5.0, 17.0), 8.0, 25.0)
    command[t < rng.uniform(6.0, 20.0)] = 0.0
    speed = _follow(command, 2.0, rng.uniform(1.2, 2.5))
    wheel = _held(rng, t, lambda: 0.0 if rng.random() < 0.5 else rng.uniform(-0.12, 0.12), 3.0, 8.0)
    bend = _follow(np.clip(wheel, -1.0, 1.0) * np.minimum(1.0, 3.0 / np.maximum(0.12 * speed**2, 1e-9)), 3.0, 0.1)
    return _wheeled(rng, length, speed, bend, rng.uniform(0.05, 0.2), (25.0, 58.0, 0.15, 0.1 * DEG), 0.1, 2.5)


def lorry(rng: np.random.Generator, length: float) -> World:
    """Roads at up to 22 m/s, with soft springs and tyres; its engine at 10 to 35 Hz."""
    t = COARSE * np.arange(round(length / COARSE) + 1)
    command = _held(rng, t, lambda: 0.0 if rng.random() < 0.2 else rng.uniform(4.0, 22.0), 10.0, 30.0)
    command[t < rng.uniform(6.0, 20.0)] = 0.0
    speed = _follow(command, 1.0, rng.uniform(0.8, 2.0))
    wheel = _held(rng, t, lambda: 0.0 if rng.random() < 0.4 else rng.uniform(-0.05, 0.05), 4.0, 12.0)
    bend = _follow(wheel * np.minimum(1.0, 2.5 / np.maximum(0.05 * speed**2, 1e-9)), 1.5, 0.05)
    engine, crab, dip = (10.0, 34.0, 0.2, 0.1 * DEG), rng.uniform(0.1, 0.4), rng.uniform(2.0, 5.0)
    return _wheeled(rng, length, speed, bend, rng.uniform(0.05, 0.2), engine, crab, 2.5, dip=dip)


def tractor(rng: np.random.Generator, length: float) -> World:
    """A field at 1 to 3 m/s: rough ground, turns at its ends, an implement that catches; its engine at 20 to 35 Hz."""
    t = COARSE * np.arange(round(length / COARSE) + 1)
    field = rng.uniform(1.2, 3.0)
    command = np.full_like(t, field)
    command[t < rng.uniform(8.0, 25.0)] = 0.0
    wheel, kick = np.zeros_like(t), np.zeros_like(t)
    at, side = rng.uniform(25.0, 50.0), rng.choice([-1.0, 1.0])
    while at < length:  # half a circle at the field's end
        radius = rng.uniform(3.5, 6.0)
        last = at + math.pi * radius / (0.7 * field)
        now = (t > at) & (t < last)
        wheel[now], command[now] = side / radius, 0.7 * field
        at, side = last + rng.uniform(20.0, 60.0), -side
    for _ in range(round(length / 12.0)):  # the implement catches
        first = rng.uniform(0.0, length)
        now = (t > first) & (t < first + rng.uniform(0.3, 1.0))
        command[now] *= rng.uniform(0.5, 0.9)
        kick[now] = -rng.uniform(0.2, 1.0) * DEG
    kick *= np.minimum(command, 1.0)
    speed, bend = _follow(command, 3.0, 1.5), _follow(wheel, 2.0, 0.15)
    return _wheeled(rng, length, speed, bend, rng.uniform(0.4, 1.0), (20.0, 34.0, 0.4, 0.3 * DEG), 0.8, 1.2, kick)


def aircraft(rng: np.random.Generator, length: float) -> World:
    """A light aircraft in coordinated turns, climbs and gusts (Dryden's spectrum, first order); a steady wind."""
    t, fine = COARSE * np.arange(round(length / COARSE) + 1), _grid(length)
    V0 = rng.uniform(35.0, 70.0)
    V = _follow(_held(rng, t, lambda: V0 * rng.uniform(0.85, 1.15), 20.0, 60.0), 0.3, 1.0, V0)
    bank = _follow(
        _held(rng, t, lambda: 0.0 if rng.random() < 0.5 else rng.choice([-1, 1]) * rng.uniform(10.0, 40.0), 8.0, 30.0)
        * DEG,
        1.2,
        12.0 * DEG,
    )
    climb = _follow(_held(rng, t, lambda: rng.uniform(-4.0, 4.0), 15.0, 40.0) * DEG, 0.6, 3.0 * DEG)
    V, bank, climb = (_fine(t, a, fine) for a in (V, bank, climb))
    turn = G * np.tan(bank) / V
    course = rng.uniform(0.0, 6.28) + np.concatenate([[0.0], np.cumsum(0.5 * (turn[1:] + turn[:-1])) * STEP])
    gust = np.stack([_spring(a, 1.0, 0.8) for a in coloured(rng, len(fine), STEP, rng.uniform(0.3, 1.2), 200.0 / V0).T])
    alpha = 4.0 * DEG * (V0 / V) ** 2 / np.cos(bank) - 0.5 * gust[2] / V
    beta = 0.5 * gust[0] / V
    air = V[:, None] * np.stack([np.sin(course) * np.cos(climb), np.cos(course) * np.cos(climb), np.sin(climb)], axis=1)
    wind = np.append(rng.uniform(0.0, 10.0) * np.array([math.sin(w := rng.uniform(0.0, 6.28)), math.cos(w)]), 0.0)
    shift, tilt = _engine(rng, fine, np.full_like(fine, rng.uniform(35.0, 45.0)), 1.0, 0.3 * DEG)
    C = attitude(
        course + beta + tilt[:, 2],
        climb + alpha * np.cos(bank) + tilt[:, 0],
        bank + 0.3 * DEG * noise(rng, len(fine), 0.2, 1.0, 1.0) + tilt[:, 1],
    )
    place = _place(rng)
    place[2] += 800.0
    return world(rng, place, air + wind + gust.T, C, np.array([0.2, -0.6, 0.1]) + shift, V)


def multicopter(rng: np.random.Generator, length: float) -> World:
    """Waypoints: thrust along its z axis carries weight, acceleration and drag; rotors shake it at 70 to 110 Hz."""
    t, fine = COARSE * np.arange(round(length / COARSE) + 1), _grid(length)
    pace = rng.uniform(3.0, 9.0)
    wanted = [_held(rng, t, lambda s=s: rng.uniform(-s, s), 4.0, 12.0) for s in (pace, pace, 1.0)]
    ready = t > 5.0
    v = np.stack([_fine(t, _follow(w * ready, 1.0, 3.5), fine) for w in wanted], axis=1)
    a = np.gradient(v, STEP, axis=0)
    heading = rng.uniform(0.0, 6.28) + _fine(
        t, _follow(_held(rng, t, lambda: rng.uniform(-2.0, 2.0), 10.0, 25.0) * ready, 0.8, 0.6), fine
    )
    thrust = a + 0.25 * v + np.array([0.0, 0.0, G])
    up = thrust / np.linalg.norm(thrust, axis=1)[:, None]
    up = np.stack([_spring(x - x[0], 2.0, 0.7) + x[0] for x in up.T], axis=1)
    up /= np.linalg.norm(up, axis=1)[:, None]
    right = np.cos(heading) * up[:, 0] - np.sin(heading) * up[:, 1]
    ahead = np.sin(heading) * up[:, 0] + np.cos(heading) * up[:, 1]
    pitch, roll = -np.arcsin(ahead), np.arctan2(right, up[:, 2])
    shift, tilt = _engine(rng, fine, np.full_like(fine, rng.uniform(70.0, 110.0)), 2.0, 0.8 * DEG)
    trembling = np.stack([noise(rng, len(fine), 0.5, 4.0, 0.3 * DEG) for _ in range(3)])
    C = attitude(
        heading + tilt[:, 2] + trembling[0], pitch + tilt[:, 0] + trembling[1], roll + tilt[:, 1] + trembling[2]
    )
    return world(rng, _place(rng), v, C, np.array([0.02, 0.03, -0.03]) + shift, np.linalg.norm(v, axis=1))


def _sea(rng: np.random.Generator, fine: Array, height: float, period: float) -> Callable[..., Array]:
    """Responses to one sea of 60 waves, JONSWAP's spectrum, as they are met."""
    w = 2.0 * math.pi / period * np.sort(rng.uniform(0.6, 2.2, 60))
    peak = 2.0 * math.pi / period
    wide = np.where(w > peak, 0.09, 0.07)
    S = w**-5.0 * np.exp(-1.25 * (peak / w) ** 4) * 3.3 ** np.exp(-0.5 * ((w / peak - 1.0) / wide) ** 2)
    amplitude = np.sqrt(S * np.gradient(w))
    amplitude *= height / 4.0 / math.sqrt(0.5 * np.sum(amplitude**2))
    phase = rng.uniform(0.0, 6.28, 60)

    def response(gain: Callable[[Array], Array]) -> Array:
        # cos(a + b) = cos a cos b - sin a sin b, a of a block of epochs and b of those within: a product, not 60 cosines an epoch.
        H = gain(w)
        block = np.exp(1j * (w * fine[::BLOCK, None] + phase + np.angle(H))) * amplitude * np.abs(H)
        within = np.exp(1j * w * fine[:BLOCK, None])
        out = block.real @ within.real.T - block.imag @ within.imag.T
        return np.ascontiguousarray(out.ravel()[: len(fine)])

    return response


def _resonance(rng: np.random.Generator, size: float, period: float, damping: float) -> Callable[[Array], Array]:
    n, p = 2.0 * math.pi / period, rng.uniform(0.0, 6.28)
    return lambda w: size * n * n * np.exp(1j * p) / (n * n - w * w + 2j * damping * n * w)


def ship(rng: np.random.Generator, length: float, moored: bool = False, arm: float | None = None) -> World:
    """A ship in a sea of 60 waves; moored, it also swings slowly on its lines; under way it turns now and then."""
    t, fine = COARSE * np.arange(round(length / COARSE) + 1), _grid(length)
    sea = _sea(rng, fine, rng.uniform(0.4, 1.2) if moored else rng.uniform(0.8, 3.5), rng.uniform(5.0, 10.0))
    roll = sea(_resonance(rng, 2.5 * DEG, rng.uniform(8.0, 13.0), 0.08))
    pitch = sea(_resonance(rng, 1.0 * DEG, rng.uniform(4.5, 7.0), 0.3))
    yaw = sea(_resonance(rng, 0.4 * DEG, 8.0, 0.5))
    carried = np.stack([sea(_resonance(rng, size, 5.0, 0.6)) for size in (0.4, 0.3, 0.6)], axis=1)
    moves = np.gradient(carried, STEP, axis=0)
    heading = rng.uniform(0.0, 6.28) + yaw
    if moored:
        for axis in range(2):  # on its lines
            w = 2.0 * math.pi / rng.uniform(50.0, 150.0)
            moves[:, axis] += rng.uniform(0.1, 0.6) * w * np.cos(w * fine + rng.uniform(0.0, 6.28))
        w = 2.0 * math.pi / rng.uniform(60.0, 200.0)
        heading += rng.uniform(0.1, 0.8) * DEG * np.sin(w * fine + rng.uniform(0.0, 6.28))
        speed = np.zeros_like(fine)
    else:
        turn = _held(rng, t, lambda: 0.0 if rng.random() < 0.5 else rng.uniform(-2.0, 2.0) * DEG, 30.0, 60.0)
        turn = _fine(t, _follow(turn, 0.3, 0.3 * DEG), fine)
        heading += np.concatenate([[0.0], np.cumsum(0.5 * (turn[1:] + turn[:-1])) * STEP])
        pace = _follow(_held(rng, t, lambda: rng.uniform(3.0, 10.0), 60.0, 120.0), 0.1, 0.1, rng.uniform(3.0, 10.0))
        speed = _fine(t, pace, fine)
        roll += _spring(3.0 * DEG * speed * turn / 0.3, 0.1, 0.2)
        heading += -0.1 * turn * 10.0  # it drifts outward
    along = np.stack([np.sin(heading - yaw), np.cos(heading - yaw), np.zeros_like(fine)], axis=1)
    shift, tilt = _engine(rng, fine, np.full_like(fine, rng.uniform(20.0, 40.0)), 0.05, 0.02 * DEG)
    C = attitude(heading + tilt[:, 2], pitch + tilt[:, 0], roll + tilt[:, 1])
    way = rng.standard_normal(3) * np.array([0.3, 1.0, 0.5])
    sits = (rng.uniform(2.0, 12.0) if arm is None else arm) * way / np.linalg.norm(way)
    return world(rng, _place(rng), speed[:, None] * along + moves, C, sits + shift, speed)


def buoy(rng: np.random.Generator, length: float) -> World:
    """A buoy on its chain in a rough sea of 60 waves: it follows their slope, and swings about the vertical by tens of degrees."""
    fine = _grid(length)
    sea = _sea(rng, fine, rng.uniform(0.5, 1.5), rng.uniform(4.0, 7.0))
    roll = sea(_resonance(rng, 3.0 * DEG, rng.uniform(3.0, 5.0), 0.3))
    pitch = sea(_resonance(rng, 3.0 * DEG, rng.uniform(3.0, 5.0), 0.3))
    moves = np.gradient(
        np.stack([sea(_resonance(rng, size, 4.0, 0.7)) for size in (0.5, 0.5, 0.7)], axis=1), STEP, axis=0
    )
    w = 2.0 * math.pi / rng.uniform(60.0, 150.0)
    swing = rng.uniform(10.0, 25.0) * DEG * np.sin(w * fine + rng.uniform(0.0, 6.28))
    heading = rng.uniform(0.0, 6.28) + swing + sea(_resonance(rng, 1.0 * DEG, 5.0, 0.5))
    sits = rng.uniform(0.2, 1.0) * rng.standard_normal(3)
    return world(
        rng, _place(rng), moves, attitude(heading, pitch, roll), np.tile(sits, (len(fine), 1)), np.zeros_like(fine)
    )


def _hung(up: Array, heading: Array) -> Array:
    """(M, 3, 3) attitude of a body whose z axis has these east and north parts (2, M)."""
    z = np.sqrt(1.0 - np.sum(up**2, axis=0))
    right = np.cos(heading) * up[0] - np.sin(heading) * up[1]
    ahead = np.sin(heading) * up[0] + np.cos(heading) * up[1]
    return attitude(heading, -np.arcsin(ahead), np.arctan2(right, z))


def raft(rng: np.random.Generator, length: float) -> World:
    """A round raft on its line in a sea of 60 waves from about one side: it follows slope and water, each with its own lag.

    Linear waves on deep water: the surface accelerates level by ``-g`` times its slope. What follows both perfectly feels no tilt.
    """
    fine = _grid(length)
    sea = _sea(rng, fine, rng.uniform(0.3, 1.5), rng.uniform(4.0, 8.0))
    way = rng.uniform(0.0, 6.28) + rng.uniform(0.1, 0.6) * rng.standard_normal(60)
    quick, damping = 2.0 * math.pi / rng.uniform(1.5, 3.5), rng.uniform(0.15, 0.5)
    part, lag = rng.uniform(0.5, 1.0), rng.uniform(0.0, 0.6)
    push = rng.uniform(0.3, 1.0), rng.uniform(0.0, 0.6)

    def tilts(w: Array) -> Array:
        return np.asarray(part * quick**2 / (quick**2 - w * w + 2j * damping * quick * w))

    def goes(w: Array) -> Array:  # velocity by the level acceleration of the water
        return np.asarray(push[0] / (1.0 + 1j * push[1] * w) / (1j * w))

    up, moves = np.zeros((2, len(fine))), np.zeros((len(fine), 3))
    for axis, along in enumerate((np.sin(way), np.cos(way))):
        up[axis] = sea(lambda w, along=along: 1j * w * w / G * along * tilts(w))
        moves[:, axis] = sea(lambda w, along=along: 1j * w * w * along * goes(w))
    moves[:, 2] = sea(lambda w: 1j * w / (1.0 + 1j * lag * w))
    w = 2.0 * math.pi / rng.uniform(60.0, 150.0)
    heading = rng.uniform(0.0, 6.28) + rng.uniform(2.0, 15.0) * DEG * np.sin(w * fine + rng.uniform(0.0, 6.28))
    sits = np.tile(rng.uniform(0.2, 1.0) * rng.standard_normal(3), (len(fine), 1))
    return world(rng, _place(rng), moves, _hung(up, heading), sits, np.zeros_like(fine))


def gondola(rng: np.random.Generator, length: float) -> World:
    """A gondola on a rope of 5 to 20 m, in gusts: it swings as a pendulum does, in antiphase with gravity, and twists."""
    fine, rope = _grid(length), rng.uniform(5.0, 20.0)
    hertz, damping = math.sqrt(G / rope) / (2.0 * math.pi), rng.uniform(0.005, 0.03)
    gusts = coloured(rng, len(fine), STEP, 1.0, rng.uniform(3.0, 10.0), 2).T
    up = np.stack([_spring(a, hertz, damping) for a in gusts])
    up *= rng.uniform(0.3, 3.0) * DEG / np.std(up)
    twist = _spring(coloured(rng, len(fine), STEP, 1.0, 10.0, 1)[:, 0], 1.0 / rng.uniform(15.0, 40.0), 0.05)
    heading = rng.uniform(0.0, 6.28) + rng.uniform(2.0, 10.0) * DEG / np.std(twist) * twist
    sits = np.tile([0.3 * rng.standard_normal(), 0.3 * rng.standard_normal(), -rope], (len(fine), 1))
    C = _hung(up, heading)
    return world(rng, _place(rng), np.zeros((len(fine), 3)), C, sits, np.zeros_like(fine))


def diver(rng: np.random.Generator, length: float) -> World:
    """An underwater vehicle at 1 to 2 m/s: legs, turns at some deg/s, dives; a slow swell and its own swaying."""
    t, fine = COARSE * np.arange(round(length / COARSE) + 1), _grid(length)
    command = np.full_like(t, rng.uniform(1.0, 2.0))
    command[t < 10.0] = 0.0
    speed = np.maximum(_fine(t, _follow(command, 0.5, 0.2), fine), 0.0)
    turn = _held(rng, t, lambda: 0.0 if rng.random() < 0.6 else rng.uniform(-6.0, 6.0) * DEG, 10.0, 30.0)
    turn = _fine(t, _follow(turn, 1.0, 3.0 * DEG), fine) * np.minimum(speed, 1.0)
    dive = _fine(t, _follow(_held(rng, t, lambda: rng.uniform(-10.0, 10.0), 20.0, 60.0) * DEG, 0.5, 3.0 * DEG), fine)
    dive = dive * np.minimum(speed, 1.0)
    sway = [noise(rng, len(fine), 0.08, 0.3, a * DEG) for a in (0.4, 0.6, 0.3)]
    heading = rng.uniform(0.0, 6.28) + np.concatenate([[0.0], np.cumsum(0.5 * (turn[1:] + turn[:-1])) * STEP])
    course = heading - 0.3 * turn  # it slides through its turns
    v = speed[:, None] * np.stack([np.sin(course) * np.cos(dive), np.cos(course) * np.cos(dive), np.sin(dive)], axis=1)
    v += np.stack([np.gradient(noise(rng, len(fine), 0.06, 0.2, a), STEP) for a in (0.05, 0.05, 0.1)], axis=1)
    C = attitude(heading + sway[2], dive + sway[0], sway[1])
    place = _place(rng)
    place[2] = -50.0
    return world(rng, place, v, C, np.array([0.1, 0.3, 0.0]) + np.zeros_like(v), speed)


def parked(rng: np.random.Generator, length: float) -> World:
    """A car whose engine idles, gusts that rock it, and people who get in and out: it tilts by some arc minutes."""
    t, fine = COARSE * np.arange(round(length / COARSE) + 1), _grid(length)
    base = [rng.uniform(-3.0, 3.0) * DEG for _ in range(2)]
    load = np.zeros((2, len(t)))
    for _ in range(rng.integers(0, 5)):
        load[:, t > rng.uniform(10.0, length)] += rng.normal(0.0, 3.0, (2, 1)) / 60.0 * DEG
    tilts = [
        _spring(_fine(t, _follow(load[k], 6.0, 0.5 * DEG), fine), 1.5, 0.2)
        + noise(rng, len(fine), 0.5, 3.0, rng.uniform(0.1, 1.0) / 60.0 * DEG)
        for k in range(2)
    ]
    on = rng.random() < 0.5
    shift, tilt = _engine(rng, fine, np.full_like(fine, rng.uniform(22.0, 30.0)), 0.1 * on, 0.05 * DEG * on)
    heading = np.full_like(fine, rng.uniform(0.0, 6.28))
    C = attitude(heading + tilt[:, 2], base[0] + tilts[0] + tilt[:, 0], base[1] + tilts[1] + tilt[:, 1])
    arm = np.array([0.2, 0.5, 0.6])
    return world(rng, _place(rng), np.zeros((len(fine), 3)), C, arm + shift, np.zeros_like(fine))
