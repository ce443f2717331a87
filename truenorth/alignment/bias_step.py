"""Did a bias change on the way? The same likelihood ratio test as for a base that leaves, of steps and ramps of the six biases.

A bias that steps at an epoch, or grows from it on, moves the errors of attitude and velocity as the model says,
``d_k = Phi_k d_(k-1) + G_k s``, and is seen as ``H_k d_k``. The filter follows with what it estimates; what is left between both
is the error of the answer.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.drift import matched
from truenorth.alignment.fine import FineAlignment
from truenorth.alignment.task import Task
from truenorth.alignment.touched import find_touch
from truenorth.core.compiled import compiled
from truenorth.errors.staying import BA, BG, PHI
from truenorth.filters.gains import times
from truenorth.state.evidence import Effect, Evidence, Figure, Kind
from truenorth.state.limits import limit

Array = NDArray[np.float64]

FEWEST = 30  # seconds of a quiet base, in which a step of the vertical rate is looked for
ONSETS = (0.1, 0.25, 0.4, 0.55, 0.7, 0.85)
SENSORS = slice(BG.start, BA.stop)


def bias_step_evidence(fine: FineAlignment) -> list[Evidence]:
    """The step or ramp of a bias that matches the innovations best, if it is likelier than chance, with the error it leaves."""
    Phi, H = fine.system.Phi, fine.system.H
    count, n = len(fine.estimates.innovation), fine.system.states
    first = np.array([round(onset * count) for onset in ONSETS])
    d = np.zeros((n, 2 * len(first) * 6))
    signature = np.empty((count, H.shape[-2], d.shape[1]))
    _begin(np.ascontiguousarray(Phi), np.ascontiguousarray(H), first, SENSORS.start, d, signature)
    ratio, size, x = matched(fine, signature)
    best = int(np.argmax(ratio))
    if ratio[best] <= limit("hint"):
        return []
    left = np.where(ratio > limit("hint"), np.abs((d[PHI] - x[PHI]) * size), 0.0)
    heading, level = float(left[2].max()), float(np.hypot(left[0], left[1]).max())
    axis, sensor = best % 3, "gyro" if best % 6 < 3 else "accel"
    figures: dict[str, Figure] = {
        "axis": "xyz"[axis],
        "onset": ONSETS[best // 6 % len(ONSETS)] * float(fine.integrals.time[-1]),
        "size": abs(float(size[best])),
        "ratio": float(ratio[best]),
        "chance": limit("hint"),
        "heading": heading,
        "level": level,
    }
    kind: Kind = "bounded" if ratio[best] > limit("drift") else "known"  # what may be chance is added to sigma
    return [Evidence(f"bias.{sensor}_steps", figures, kind, Effect(heading, level), ("still_part",))]


@compiled
def _begin(Phi: Any, H: Any, first: Any, sensors: int, d: Any, signature: Any) -> None:
    """Measurements (K, m, 12 S) and last state (n, 12 S) of biases that change from the epochs `first` (S,) on.

    Columns: steps of size one, then ramps that are one at the end, of each of the six biases from each onset.
    """
    count, before = signature.shape[0], np.zeros_like(d)
    for k in range(count):
        before[:] = d
        for kind in range(2):
            for i in range(len(first)):
                size = 1.0 if k >= first[i] else 0.0
                if kind == 1:
                    size = max(0.0, (k - first[i]) / (count - first[i]))
                for j in range(6):
                    column = 6 * (len(first) * kind + i) + j
                    before[sensors : sensors + 6, column] = 0.0
                    before[sensors + j, column] = size
        times(Phi[min(k, len(Phi) - 1)], before, d)
        times(H[min(k, len(H) - 1)], d, signature[k])


def turn_evidence(task: Task) -> list[Evidence]:
    """On a quiet base: a step of the rate about the vertical. No force shows it, and heading turns with it."""
    motion = task.motion
    if motion.overall not in ("still", "disturbed") or len(motion.time) < FEWEST:
        return []
    up = motion.specific_force.mean(axis=0)
    rate = motion.rate @ (up / np.linalg.norm(up))
    found = find_touch(motion.time, np.stack([rate, 0.0 * rate], axis=1), 0.0)
    if found is None:
        return []
    turned = found.size * max(0.0, float(motion.time[-1]) - found.time)
    figures: dict[str, Figure] = {"onset": found.time, "size": found.size, "heading": turned}
    return [Evidence("bias.vertical_steps", figures, "bounded", Effect(heading=turned), ("still_part",))]
