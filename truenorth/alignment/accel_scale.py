"""Does an accelerometer on an indexer read too much? Its scale factor by the filter's own response to it.

An indexer turns gravity about in the IMU's axes, so that a scale factor is no bias: it makes forces that go with the turns. An axis
along which little of gravity ever stands, that of the inner turns, shows it by the sway alone. The error of such an axis is slow
and small, and a fitted motion, or the base's drift, passes for it: .903 on that axis left heading 3.9 sigmas off, where the ratio
below is 400 and the size .912 ± .004.

Along the other axes, which gravity turns through, the fit of the base's motion takes up a half of it and more; there other checks
see it.

Whether there is one is asked of gravity alone: the noise of the accelerometers is in their readings and in the innovations, and a
scale factor of one would explain the one by the other. Its size is asked of the force as measured, which has the sway. On a base at
rest an axis of the inner turns has no force but its noise: what it measures is not what gravity would do to it, and nothing is
known of its scale factor.

An IMU whose specification names no scale factors has small ones all the same. So what was found counts by what it does.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.bias_step import matrix_signatures
from truenorth.alignment.fine import FineAlignment
from truenorth.alignment.matched import innovations_of, whitened
from truenorth.errors.staying import PHI
from truenorth.filters.gains import through
from truenorth.records.specs import ImuSpec
from truenorth.state.evidence import Effect, Evidence, Figure
from truenorth.state.limits import limit

Array = NDArray[np.float64]

BEND = 3  # degree of a polynomial: the earth turns by 15 deg in an hour
SCALES = (9, 13, 17)  # of x, y and z, in the columns of signatures of matrices


def accel_scale_evidence(fine: FineAlignment, spec: ImuSpec) -> list[Evidence]:
    """The accelerometer whose scale factor explains the innovations best, if it is likelier than chance, with the error it leaves.

    Parameters
    ----------
    fine : FineAlignment
        Of an IMU that an indexer turns about; scale factors that are states of it explain what they can.
    spec : ImuSpec
    """
    ones = replace(spec, gyro_scale_factor=0.0, gyro_misalignment=0.0, accel_scale_factor=1.0, accel_misalignment=0.0)
    both = [matrix_signatures(fine, ones, force) for force in (_gravity_i(fine), None)]
    signatures = np.concatenate([x[:, :, SCALES] for x in both if x is not None], axis=2)
    seen = innovations_of(fine)
    made, left = through(fine.gains, np.ascontiguousarray(signatures))
    white = whitened(seen.L, made)
    match, energy = np.einsum("kms,km->s", white, seen.white[..., 0]), np.sum(white**2, axis=(0, 1))
    ratio = match**2 / np.maximum(energy, 1e-300)
    best = int(np.argmax(ratio[: len(SCALES)]))
    if ratio[best] <= limit("drift"):
        return []
    gravity, axis, best = best, "xyz"[best], best + len(SCALES)
    shared = float(np.sum(white[:, :, gravity] * white[:, :, best])) / np.sqrt(energy[gravity] * energy[best])
    if shared < limit("gravity in force") or match[gravity] * match[best] <= 0.0:
        return []
    size = match[best] / energy[best]
    moved = np.abs(size * left[PHI, best])
    effect = Effect(heading=float(moved[2]), level=float(np.hypot(moved[0], moved[1])))
    figures: dict[str, Figure] = {
        "axis": axis,
        "scale": float(size),
        "sigma": float(energy[best] ** -0.5),
        "ratio": float(ratio[best]),
        "heading": effect.heading,
        "level": effect.level,
    }
    return [Evidence("bias.accel_scale", figures, "bounded", effect, ("specification", "units"))]


def _gravity_i(fine: FineAlignment) -> Array:
    """(K, 3) what gravity is of the specific force in i: it turns with the earth, and what the base does is about it."""
    log = fine.integrals
    middle = 0.5 * (log.time[1:] + log.time[:-1])
    curve = np.polynomial.polynomial.polyfit(middle, log.mean_force, BEND)
    return np.asarray(np.polynomial.polynomial.polyval(middle, curve).T)
