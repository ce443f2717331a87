"""Rows far noisier than specified, on a base that sways: sigma by as much of that noise as the log allows.

White noise is as dense under the sway as above it; a vibration that looks white is not, nor is what rounding a motion leaves. Above
the sway a spectrum shows how noisy the rows are. Under it the likelihood of the log rules out more noise than that, no less:
gyros 24 times as noisy as said make a log with a sway of degrees as likely. So such a log is filtered again with the noise of its
rows, halved until the log allows it, and by as much as sigma is larger then, and the answer another, it is unsure.
"""

from __future__ import annotations

import copy
from typing import TYPE_CHECKING

import numpy as np

from truenorth.alignment.sway_noise import SENSORS, louder_walks, white_above_sway
from truenorth.errors.staying import PHI
from truenorth.errors.sway import with_motion
from truenorth.filters import kalman
from truenorth.records.specs import ImuSpec
from truenorth.state.evidence import Effect, Evidence, Figure
from truenorth.state.limits import limit

if TYPE_CHECKING:
    from truenorth.alignment.swaying import SwayAlignment

LOUDEST = 1000.0  # times what was said: sensors of all classes lie as far apart


def loud_rows_evidence(fine: SwayAlignment, spec: ImuSpec) -> list[Evidence]:
    """That rows are louder than specified, and what the log lets that do to heading and level."""
    seen = white_above_sway(fine.about)
    if seen is None or fine.noisier:
        return []
    left = {sensor: min(seen[sensor], LOUDEST) for sensor in SENSORS if seen[sensor] > limit("another sensor")}
    least = 2.0 * float(fine.estimates.log_likelihood) - limit("ruled out")
    while left:
        louder = copy.copy(fine.about)
        louder.noise = louder_walks(fine.about.noise, left)
        found = kalman(with_motion(louder.linearise(), fine.estimator.interval, fine.motion, spare=False))
        if 2.0 * float(found.log_likelihood) > least:
            break
        left = {sensor: 0.5 * factor for sensor, factor in left.items() if factor > 2.0}
    if not left:
        return []
    moved = found.x[-1][PHI] - fine.end[PHI]
    more = np.diag(found.P[-1])[PHI] - np.diag(fine.P)[PHI] + moved**2
    size = np.sqrt(np.maximum(more, 0.0))
    effect = Effect(heading=float(size[2]), level=float(size[:2].max()))
    return [
        Evidence(
            f"specification.{sensor}_rows",
            _figures(spec, sensor, seen[sensor], factor) | {"heading": effect.heading, "level": effect.level},
            "hint",
            effect,
            ("specification",),
        )
        for sensor, factor in left.items()
    ]


def _figures(spec: ImuSpec, sensor: str, seen: float, allowed: float) -> dict[str, Figure]:
    said = float(getattr(spec, f"{sensor}_random_walk"))
    return {"noise": seen * said, "allowed": allowed * said, "said": said, "imu": spec.name}
