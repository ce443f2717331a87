"""Are the gyros of a base that sways, or of an IMU that turns on it, late? By the filter's own response to gyros that are.

Gravity carried by gyros that are late by ``d`` is askew by the rate times ``d``, and the attitude is that much behind. The fit of
all signed orders and delays (:mod:`truenorth.quality.tilt`) needs no filter and sees .03 s and more: what the base itself does is
all noise to it. The filter of the answer has the base's own motion among its states. The same log with gyros a little later,
integrated once more, says what a delay does to its measurements; through its gains that is a signature in its innovations, and
twice the logarithm of the likelihood ratio ``b^2 / A`` (:mod:`truenorth.estimate.responses`) is a chi-square of one degree of
freedom where the clocks agree: one of 2000 sound logs exceeds the limit of a hint. The size is what the fitted motion leaves of the
delay, .6 to 1 of it.

A moored ship, whose waves carry her as they roll her, looks like delays of .03 to .3 s (see `tilt.py`), and the axes do not tell
the two apart. So this refuses no log: tilt and turn are in sigma, however large.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from truenorth.alignment.fine import FineAlignment
from truenorth.core.position import Position
from truenorth.errors.staying import mean_velocity
from truenorth.estimate.responses import Seen, likeliest
from truenorth.filters.gains import through
from truenorth.records import ImuRecord
from truenorth.state.evidence import Effect, Evidence, Figure
from truenorth.state.limits import limit
from truenorth.strapdown.inertial import integrate

STEP = 1e-3  # s, with which is asked


def late_gyros_evidence(fine: FineAlignment, record: ImuRecord, interval: float, position: Position) -> list[Evidence]:
    """A delay of the gyros that is likelier than chance, with the tilt, and the turn about the vertical, that it makes.

    Parameters
    ----------
    fine : FineAlignment
        On the mean velocity of intervals.
    record : ImuRecord
        That it was made of.
    interval : float, s
        Of the filter.
    position : Position
    """
    later = np.stack([np.interp(record.time - STEP, record.time, x) for x in record.gyro.T], axis=1)
    as_is, late = (
        mean_velocity(integrate(log, interval), fine.C_n0_i, position.lat, position.alt)
        for log in (record, replace(record, gyro=later))
    )
    seen = through(fine.gains, ((late - as_is) / STEP)[..., None])[0]
    L = np.linalg.cholesky(fine.estimates.innovation_covariance)
    s, z = (np.linalg.solve(L, x) for x in (seen, fine.estimates.innovation[..., None]))
    ratio, size = likeliest([Seen(fine.integrals.time[1:], z[..., 0], s)])
    if ratio <= limit("hint"):
        return []
    delay = float(size[0])
    rate = record.gyro / (record.interval if record.kind == "increments" else 1.0)
    up = record.accel / np.linalg.norm(record.accel, axis=1, keepdims=True)
    about = np.sum(rate * up, axis=1)
    turned = abs(delay) / limit("shown delay")
    tilt = turned * math.sqrt(max(float(np.mean(np.sum(rate**2, axis=1) - about**2)), 0.0))
    turn = turned * math.sqrt(float(np.mean(about**2)))
    figures: dict[str, Figure] = {
        "delay": abs(delay),
        "ratio": ratio,
        "chance": limit("hint"),
        "heading": turn,
        "level": tilt,
    }
    side = "late" if delay > 0.0 else "early"
    return [Evidence(f"response.gyros_{side}", figures, "hint", Effect(heading=turn, level=tilt), ("common_clock",))]
