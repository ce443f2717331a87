"""Did a bias change on the way? The same likelihood ratio test as for a base that leaves, of steps and ramps of the six biases.

A bias that steps at an epoch, or grows from it on, moves the errors of attitude and velocity as the model says,
``d_k = Phi_k d_(k-1) + G_k s``, and is seen as ``H_k d_k``. The filter follows with what it estimates; what is left between both
is the error of the answer.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from itertools import pairwise, product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.fine import FineAlignment
from truenorth.alignment.matched import Match, Signatures
from truenorth.alignment.passing_turn import passing_turns
from truenorth.alignment.task import Task
from truenorth.alignment.touched import Touch, find_touch
from truenorth.alignment.usual import usual
from truenorth.core.attitude import length_of, rotation_vector_from_dcm
from truenorth.core.compiled import compiled
from truenorth.core.earth import EARTH_RATE
from truenorth.errors.staying import BA, BG, PHI
from truenorth.filters.gains import times
from truenorth.quality.regimes import KINDS
from truenorth.quality.signals import median_of_rows
from truenorth.records.specs import ImuSpec
from truenorth.state.evidence import Effect, Evidence, Figure, Kind
from truenorth.state.limits import limit, may_be_chance

Array = NDArray[np.float64]

AWAY = 5  # seconds from a turn: it begins and ends slowly
DRIFT_BLOCK, FEWEST_BLOCKS = 10, 6  # seconds of still base, whose means show a drift, and how many of them
FEWEST = 30  # seconds of a quiet base, in which a step of the vertical rate is looked for
ONSETS = (0.1, 0.25, 0.4, 0.55, 0.7, 0.85)
SIGNATURES = tuple(product(("step", "ramp"), ONSETS))
SENSORS = slice(BG.start, BA.stop)


def bias_step_evidence(fine: FineAlignment, spec: ImuSpec, match: Match) -> list[Evidence]:
    """The step or ramp of a bias that matches the innovations best, if it is likelier than chance, with the error it leaves.

    Scale factors and misalignments that are no states of the filter make of two sways of nearly the same period a rate
    that beats slowly. They explain what they can (:func:`matrix_signatures`). An accelerometer's bias
    wanders by its instability, which stands on the vertical for all to see: so small a step is part of that.
    """
    ratio, size, ends = match
    accel = np.arange(len(ratio)) % 6 >= 3
    ratio = np.where(accel & (np.abs(size) < wander_of(spec)), 0.0, ratio)
    best = int(np.argmax(ratio))
    if ratio[best] <= limit("hint"):
        return []
    left = np.where(ratio > limit("hint"), np.abs(ends[PHI] * size), 0.0)
    heading, level = float(left[2].max()), float(np.hypot(left[0], left[1]).max())
    return step_evidence(fine, best, float(ratio[best]), float(size[best]), heading, level)


def step_evidence(
    fine: FineAlignment, at: int, ratio: float, size: float, heading: float, level: float
) -> list[Evidence]:
    """That the bias of a signature changes, by its place among them, and by how much heading and level are off."""
    sensor = "gyro" if at % 6 < 3 else "accel"
    figures: dict[str, Figure] = {
        "axis": "xyz"[at % 3],
        "onset": SIGNATURES[at // 6][1] * float(fine.integrals.time[-1]),
        "size": abs(size),
        "ratio": ratio,
        "chance": limit("hint"),
        "heading": heading,
        "level": level,
    }
    kind: Kind = "hint" if may_be_chance(ratio) else "bounded"
    return [Evidence(f"bias.{sensor}_steps", figures, kind, Effect(heading, level), ("still_part",))]


def wander_of(spec: ImuSpec) -> float:
    """By how much an accelerometer's bias may change as its instability says, or as is usual, m/s^2."""
    usually = usual("accel", "bias_instability", spec.accel_random_walk)
    return limit("wanders") * max(spec.accel_bias_instability, usually)


def bias_signatures(fine: FineAlignment, courses: Sequence[tuple[str, float]] = SIGNATURES) -> Signatures:
    """Of each course, a step or a ramp from a part of the log on, in each of the six biases."""
    return _signatures_over(len(fine.estimates.innovation), fine.system.states, fine.system.rows, tuple(courses))


@lru_cache(maxsize=8)
def _signatures_over(count: int, n: int, rows: int, courses: tuple[tuple[str, float], ...]) -> Signatures:
    """The same over so many epochs, of so many states and rows of a measurement. Nobody writes to them."""
    begin = np.repeat([round(onset * count) for _, onset in courses], 6)
    steps = np.repeat([course == "step" for course, _ in courses], 6)
    every = np.tile(np.eye(6), len(courses))
    state, course = np.zeros((n, len(begin))), np.zeros((n, 6))
    state[SENSORS] = every * steps
    course[SENSORS] = np.eye(6)
    after = every * np.where(steps, 0.0, 1.0 / (count - begin))
    return Signatures(begin, state, np.zeros((rows, len(begin))), after, course, np.zeros((count, rows, 6)))


def matrix_signatures(fine: FineAlignment, spec: ImuSpec, force_i: Array | None = None) -> Array | None:
    """Signatures (K, 3, 18) of scale factors and misalignments of one sigma; None where the specification has none.

    Parameters
    ----------
    fine : FineAlignment
    spec : ImuSpec
    force_i : (K, 3) array, m/s^2, optional
        Mean specific force of each interval in i; as measured where it is left out, with the noise of the accelerometers.
    """
    one = np.eye(3, dtype=np.bool_)
    gyro = np.where(one, spec.gyro_scale_factor, spec.gyro_misalignment)
    accel = np.where(one, spec.accel_scale_factor, spec.accel_misalignment)
    if not (gyro.any() or accel.any()):
        return None
    log = fine.integrals
    turn = rotation_vector_from_dcm(np.swapaxes(log.C_ib[:-1], 1, 2) @ log.C_ib[1:])
    rate, force = (
        turn / log.intervals[:, None],
        np.einsum("kji,kj->ki", log.C_mean, log.mean_force if force_i is None else force_i),
    )
    bias = np.zeros((len(rate), 6, 18))
    for i, j in product(range(3), range(3)):
        bias[:, i, 3 * i + j] = gyro[i, j] * (rate[:, j] - rate[:, j].mean())
        bias[:, 3 + i, 9 + 3 * i + j] = accel[i, j] * (force[:, j] - force[:, j].mean())
    return seen_of(fine, bias)


def seen_of(fine: FineAlignment, bias: Array) -> Array:
    """Measurements (K, 3, S) of errors of the six sensors (K, 6, S)."""
    Phi, H = (np.ascontiguousarray(x) for x in (fine.system.Phi, fine.system.H))
    d = np.zeros((fine.system.states, bias.shape[2]))
    signature = np.empty((len(bias), H.shape[-2], bias.shape[2]))
    _follow(Phi, H, np.ascontiguousarray(bias), SENSORS.start, d, signature)
    return signature


@compiled
def _follow(Phi: Any, H: Any, bias: Any, sensors: int, d: Any, signature: Any) -> None:
    """Measurements (K, m, S) and last state (n, S) of sensor errors (K, 6, S)."""
    before = np.zeros_like(d)
    for k in range(signature.shape[0]):
        for j in range(d.shape[1]):
            for i in range(len(d)):
                before[i, j] = d[i, j]
            for i in range(6):
                before[sensors + i, j] = bias[k, i, j]
        times(Phi[min(k, len(Phi) - 1)], before, d)
        times(H[min(k, len(H) - 1)], d, signature[k])


def turn_evidence(task: Task) -> list[Evidence]:
    """On a quiet base: a step of the rate about the vertical. No force shows it, and heading turns with it.

    Between two turns of the base, and away from them: where the IMU turns, its rate steps.
    """
    motion = task.motion
    if motion.overall not in ("still", "disturbed"):
        return []
    turns = (motion.kind == KINDS.index("rotating")) | passing_turns(motion)
    if turns.any():
        turns = np.convolve(turns, np.ones(2 * AWAY + 1), "same") > 0.0
    found = []
    edges = [0, *((turns[1:] != turns[:-1]).nonzero()[0] + 1).tolist(), len(turns)]
    for begin, end in pairwise(edges):
        part = slice(begin, end)
        if end - begin < FEWEST or turns[begin]:
            continue
        up = motion.specific_force[part].mean(axis=0)
        rate = motion.rate[part] @ (up / length_of(up))
        along = np.zeros((end - begin, 2))
        along[:, 0] = rate
        step = find_touch(motion.time[part], along, 0.0)
        found += [step] if step is not None and _stays(step, motion.time[part], rate) else []
    if not found:
        return []
    last = float(motion.time[-1])
    turned, step = max(((item.size * max(0.0, last - item.time), item) for item in found), key=lambda pair: pair[0])
    figures: dict[str, Figure] = {"onset": step.time, "size": step.size, "heading": turned}
    return [Evidence("bias.vertical_steps", figures, "bounded", Effect(heading=turned), ("still_part",))]


def gravity_evidence(task: Task, C_nb: Array, spec: ImuSpec) -> list[Evidence]:
    """On a still base: gravity that moves steadily in the IMU's axes. The base tilts, or an accelerometer drifts.

    A tilt rate ``b / g`` about east looks like a heading that is off by ``b / (g w_ie cos L)``: filters that let the base move
    take a drift for a tilt. No log of gyros and accelerometers tells them apart, and a base that is still hardly tilts. One
    whose people get in and out does, in steps that the gyros see: what they saw is taken off the forces (:func:`tilted`).
    """
    motion = task.motion
    count = len(motion.time) // DRIFT_BLOCK
    turns = motion.fraction("rotating") > 0.0 or passing_turns(motion).any()
    if motion.overall != "still" or count < FEWEST_BLOCKS or turns:  # an IMU that was turned has no one attitude
        return []
    force = (motion.specific_force @ C_nb.T)[: count * DRIFT_BLOCK, :2].reshape(count, DRIFT_BLOCK, 2).mean(axis=1)
    time = DRIFT_BLOCK * (np.arange(count) - 0.5 * (count - 1.0))  # s
    tilt, steady = tilted(task, C_nb)
    force -= task.gravity * tilt
    b = time @ force / (time @ time)
    left = force - force.mean(axis=0) - np.outer(time, b)
    variance = (left**2).sum(axis=0) / ((count - 2.0) * (time @ time))
    span = float(motion.time[-1] - motion.time[0])
    instability = max(spec.accel_bias_instability, usual("accel", "bias_instability", spec.accel_random_walk))
    wanders = max(spec.gyro_bias_instability, usual("gyro", "bias_instability", spec.gyro_random_walk))
    # Two values of a bias that wanders, far apart, differ by its instability times sqrt(2). A gyro that wanders tilts what it
    # carries.
    carried = task.gravity**2 * (steady**2 + wanders**2)
    ratio = float(((span * b) ** 2 / (span**2 * (variance + carried) + 2.0 * instability**2)).sum())
    moved = span * length_of(b)  # m/s^2
    if ratio <= limit("drift"):
        return []
    heading = abs(float(b[1])) / (task.gravity * EARTH_RATE * math.cos(task.position.lat))
    effect = Effect(heading=heading, level=moved / task.gravity)
    figures: dict[str, Figure] = {"moved": moved, "tilt": effect.level, "ratio": ratio, "heading": heading}
    return [Evidence("bias.gravity_drifts", figures, "known", effect, ("still_part",))]


def tilted(task: Task, C_nb: Array) -> tuple[Array, Array]:
    """What a base tilted by besides a steady turn, as its gyros saw it, and one sigma of that turn.

    A constant rate is that of the earth, or of a tilt that nobody can tell from it: the median of the differences between
    blocks, of which people who get in and out make few. A mean would take each step for a steady turn of the whole log, and a walk
    fitted to the differences drowns in the rocking of gusts.

    Returns
    -------
    tilt : (B, 2) array, rad
        Level force east and north by gravity, in each block of `DRIFT_BLOCK` seconds.
    sigma : (2,) array, rad/s
    """
    angle = np.cumsum(task.motion.rate @ C_nb.T, axis=0)
    count = len(angle) // DRIFT_BLOCK
    level = np.stack([-angle[:, 1], angle[:, 0]], axis=1)
    tilt = level[: count * DRIFT_BLOCK].reshape(count, DRIFT_BLOCK, 2).mean(axis=1)
    d = tilt[1:] - tilt[:-1]
    steady = median_of_rows(d.T)[:, 0]
    scatter = median_of_rows(np.abs(d - steady).T)[:, 0] / 0.6745
    # A median of normal values scatters by sqrt(pi/2) times what their mean does.
    sigma = scatter * math.sqrt(0.5 * math.pi / len(d)) / DRIFT_BLOCK
    return tilt - np.outer(np.arange(count), steady), sigma


def _stays(step: Touch, time: Array, rate: Array) -> bool:
    """Whether the rate is another one from then on: a base that is nudged turns for a moment."""
    before, after = rate[time < step.time - AWAY], rate[time > step.time + AWAY]
    return bool(len(before) and len(after) and abs(np.median(after) - np.median(before)) > 0.5 * step.size)
