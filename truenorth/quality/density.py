"""How noisy are the sensors, stretch by stretch? White noise separated from the base's own motion, while it sways or turns.

Sixth differences of means over ``m`` rows leave of a smooth motion of period ``T`` only ``(2 pi m dt / T)^6``, of white noise of
density ``N`` a variance of ``924 N^2 / (m dt)``. A vibration is larger at one ``m`` than at another, white noise alike at
all: only stretches and channels that look white over all of them are given a figure.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from truenorth.core.blocks import means_of, row_blocks
from truenorth.core.earth import EARTH_RATE, GRAVITY_EQUATOR
from truenorth.core.remembered import remembered
from truenorth.quality.regimes import MotionSummary
from truenorth.quality.signals import white_noise
from truenorth.records import ImuRecord
from truenorth.records.specs import ImuSpec
from truenorth.state.evidence import Effect, Evidence, Figure
from truenorth.state.limits import limit

Array = NDArray[np.float64]

STRETCH = 8.0  # s
ROWS = (1, 2, 4)  # over which means are taken
ORDER, GAIN = 6, 924.0  # of the differences, and their squares' sum
FEWEST = 30  # differences in a stretch
TAUS = (0.02, 0.1, 0.5, 1.0, 2.0, 5.0)  # s: of the Allan deviation of a sensor at rest


def noise_densities(record: ImuRecord) -> tuple[Array, Array]:
    """Edges (S+1,) of stretches, s, and the density (S, 6) of white noise in them, rad/sqrt(s) and m/s/sqrt(s).

    NaN where the channel does not look white; no stretch at all where rows are too few or missing.
    """
    edges, density, _ = _densities(record)
    return edges, density


@remembered
def _densities(record: ImuRecord) -> tuple[Array, Array, Array]:
    """The same, and how loud (S, 6) each stretch is, white or not."""
    dt = record.interval
    rows = round(STRETCH / dt)
    count = len(record) // max(rows, 1)
    if rows < (FEWEST + ORDER) * ROWS[-1] or count < 3 or record.gaps.size:
        return np.zeros(0), np.zeros((0, 6)), np.zeros((0, 6))
    density = np.empty((len(ROWS), count, 6))
    for part in row_blocks(count * rows, rows):
        data = np.hstack([record.gyro[part], record.accel[part]]).reshape(-1, rows, 6)
        if record.kind == "increments":
            data = data / dt
        for of_m, m in zip(density[:, part.start // rows : part.stop // rows], ROWS, strict=True):
            cells = means_of(data[:, : rows // m * m].reshape(len(data), rows // m, m, 6))
            rough = np.diff(cells, n=ORDER, axis=1)
            of_m[:] = np.sqrt(np.mean(rough**2, axis=1) * m * dt / GAIN)
    low, high = density.min(axis=0), density.max(axis=0)
    start = float(record.time[0]) - dt
    edges = np.append(start, record.time[rows - 1 : count * rows : rows])
    level = np.exp(np.log(np.maximum(density, 1e-300)).mean(axis=0))
    return edges, np.where((low > 0.0) & (high < limit("one noise") * low), level, np.nan), level


def walk_density(record: ImuRecord) -> Array:
    """(6,) random walk, rad/sqrt(s) and m/s/sqrt(s), of channels whose Allan deviation is one over all `TAUS`; NaN of others."""
    scale = record.interval if record.kind == "rates" else 1.0
    total = np.cumsum(np.hstack([record.gyro, record.accel]), axis=0) * scale
    found = []
    for tau in TAUS:
        m = max(1, round(tau / record.interval))
        if len(total) // m < FEWEST:
            return np.full(6, np.nan)
        turns = np.diff(total[::m], n=2, axis=0)
        found.append(np.sqrt(0.5 * np.mean(turns**2, axis=0) / (m * record.interval)))
    low, high = np.min(found, axis=0), np.max(found, axis=0)
    return np.where(high < limit("one noise") * low, np.exp(np.log(np.maximum(found, 1e-300)).mean(axis=0)), np.nan)


def bursts(record: ImuRecord) -> tuple[Array, Array]:
    """Edges (S+1,) of stretches, s, and by what density (S, 6) they exceed the usual one of the log; zero as a rule.

    A level that the base's own motion reaches elsewhere in the log is no burst: a road that looks white for a stretch is a road.
    """
    edges, density, level = _densities(record)
    if not len(density):
        return edges, density
    known = np.where(np.isfinite(density), density, np.inf)
    usual = np.sort(known, axis=0)[: max(1, len(known) // 2)].max(
        axis=0
    )  # the median, what is not white on its upper side
    moving = np.where(np.isfinite(density), 0.0, level).max(axis=0)
    louder = np.isfinite(known) & (known > limit("noisy stretch") * usual) & (known > moving)
    return edges, np.where(
        louder,
        np.sqrt(np.maximum(np.where(louder, known, 0.0) ** 2 - np.where(np.isfinite(usual), usual, 0.0) ** 2, 0.0)),
        0.0,
    )


def burst_evidence(record: ImuRecord) -> list[Evidence]:
    """Noise for a while, on the move: the random walk that it adds to attitude, or to velocity, where no aid takes it back."""
    edges, extra = bursts(record)
    found = []
    for name, channels in (("gyro", slice(0, 3)), ("accel", slice(3, 6))):
        loud = np.flatnonzero(extra[:, channels].any(axis=1))
        if loud.size:
            walked = math.sqrt(float(np.diff(edges)[loud] @ extra[loud, channels].max(axis=1) ** 2))
            effect = Effect(heading=walked, level=walked) if name == "gyro" else Effect(velocity=walked)
            figures: dict[str, Figure] = {
                "begin": float(edges[loud[0]]),
                "end": float(edges[loud[-1] + 1]),
                "density": float(extra[:, channels].max()),
                "heading": effect.heading,
            }
            found.append(Evidence(f"noise.{name}_stretch", figures, "known", effect))
    return found


def with_noise_of(record: ImuRecord, spec: ImuSpec) -> ImuSpec:
    """A specification with the white noise of the rows of a log, where that is more by far than it says; the same one elsewhere.

    Of stretches that look white, nine of ten are quieter, and of three axes each.
    """
    _, density = noise_densities(longest_stretch(record))
    shown = np.nan_to_num(density)
    if not len(shown):
        return spec
    loud = np.quantile(shown, 0.9, axis=0)
    gyro, accel = float(loud[:3].max()), float(loud[3:].max())
    more = limit("another sensor")
    gyro = gyro if gyro > more * spec.gyro_random_walk else spec.gyro_random_walk
    accel = accel if accel > more * spec.accel_random_walk else spec.accel_random_walk
    if (gyro, accel) == (spec.gyro_random_walk, spec.accel_random_walk):
        return spec
    return replace(spec, name=f"{spec.name}, noise of the rows", gyro_random_walk=gyro, accel_random_walk=accel)


def longest_stretch(record: ImuRecord) -> ImuRecord:
    """The most rows of a record on end between two gaps; the record itself where it has none."""
    if not record.gaps.size:
        return record
    edges = np.concatenate([[0], record.gaps, [len(record)]])
    longest = int(np.argmax(np.diff(edges)))
    return record[int(edges[longest]) : int(edges[longest + 1])]


def specification_evidence(record: ImuRecord, motion: MotionSummary, spec: ImuSpec, lat: float) -> list[Evidence]:
    """Whether sensors at rest are noisier than their specification by more than any sensor is: it is not theirs then.

    Noise counts where its Allan deviation is that of a random walk from .02 to 5 s: the residual dither of a ring laser,
    quantisation and a base that trembles are louder than the walk, and bounded. At rest alone: while the base moves, only what is
    faster than its motion can be separated from it, and there a sound sensor has noise that is none of its random walk.

    Parameters
    ----------
    motion : MotionSummary
        Of the same record.
    spec : ImuSpec
        With its random walks as a filter takes them.
    lat : float, rad
    """
    if motion.overall != "still":
        return []
    noise = white_noise(record)
    said_noise = np.repeat([spec.gyro_random_walk, spec.accel_random_walk], 3)
    if (noise > limit("another sensor") * said_noise).any():
        noise = np.nan_to_num(walk_density(record))
    found = []
    for name, channels, said in (
        ("gyro", slice(0, 3), spec.gyro_random_walk),
        ("accel", slice(3, 6), spec.accel_random_walk),
    ):
        loud = float(noise[channels].max())
        if said > 0.0 and loud > limit("another sensor") * said:
            found.append(noise_evidence(name, loud, spec, lat))
    return found


def noise_evidence(name: str, loud: float, spec: ImuSpec, lat: float) -> Evidence:
    """That a sensor is so loud: what its specification says of biases is not theirs, either.

    Parameters
    ----------
    name : {"gyro", "accel"}
    loud : float, rad/sqrt(s) or m/s/sqrt(s)
    spec : ImuSpec
    lat : float, rad
    """
    said = float(getattr(spec, f"{name}_random_walk"))
    size = loud / said * math.sqrt(float(spec.bias_variance[0 if name == "gyro" else 3]))
    effect = Effect(level=size / GRAVITY_EQUATOR)
    if name == "gyro":
        effect = Effect(heading=size / max(EARTH_RATE * math.cos(lat), 1e-12))
    figures: dict[str, Figure] = {"noise": loud, "said": said, "imu": spec.name}
    return Evidence(f"specification.{name}_noise", figures, "bounded", effect, ("specification",))
