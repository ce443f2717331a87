"""A receiver that is led away while its vehicle stands: by its IMU the vehicle rests, by its aids it moves.

A velocity that grows by .01 m/s a second is a tilt of .06 deg to a filter that believes in it, and north is where such a tilt comes
from: a receiver led away by .5 m/s in a minute turned the heading of a parked car by 38 deg. Its IMU knows better. As of a base
that stays, the log gives a heading of its own, and a check: along north and along the vertical the gyros must see the earth's rate
to within their biases. A vehicle that did move, and turned by what the aids say, would meet both by chance alone. So where the log
as at rest is without contradiction, and its heading is another, the aids are wrong.

Gyros whose biases may be as large as the earth's rate meet both anyhow, and are not asked. Nor is the whole alignment made where a
coarse one, a tenth of its time, has about the heading of the aids, nor the search for gyros that are turned before it is needed.

A steady speed towards north turns the heading of a base that is taken to stay by ``v / (R w_ie cos L)``, and meets the check: so
much is allowed for.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from truenorth.alignment.in_motion_passes import turn_between
from truenorth.alignment.in_motion_task import MovingTask
from truenorth.alignment.moving import fifteen
from truenorth.alignment.procedure import align_base
from truenorth.alignment.result import Alignment
from truenorth.alignment.verdict import azimuth_sigmas
from truenorth.core.attitude import euler_from_dcm
from truenorth.core.earth import EARTH_RATE, radii
from truenorth.core.errors import TruenorthError
from truenorth.navigation.stops import longest_rest, stops_in
from truenorth.records import ImuRecord
from truenorth.records.specs import ImuSpec
from truenorth.state.evidence import Evidence, contradiction
from truenorth.state.layout import PHI
from truenorth.state.limits import limit
from truenorth.state.track import Track

SENSORS, NO_LAG = ("gyro", "accel"), {"bandwidth": math.inf, "latency": 0.0}
BY_CHANCE = 10.0  # biases of a gyro: a turn of the vehicle of that rate meets the earth's rate in two directions seldom


def led_at_rest_evidence(task: MovingTask, track: Track) -> list[Evidence]:
    """That the IMU rests where its aids move it, in the longest rest that the IMU alone sees.

    Parameters
    ----------
    task : MovingTask
    track : Track
        Of the log, with its aids.
    """
    longest = longest_rest(*stops_in(task.record))
    if not len(longest):
        return []
    begin = float(longest[0]) - 0.5
    inside = np.flatnonzero((track.time > begin) & (track.time < longest[-1] + 0.5))
    if not len(inside):
        return []
    end = int(inside[-1])
    lat, C = task.position.lat, track.C_nb[end]
    horizontal = EARTH_RATE * math.cos(lat)
    if 2.0 * horizontal < BY_CHANCE * math.sqrt(float(np.max(task.spec.bias_variance[:3]))):
        return []
    north = abs(float(np.mean(track.v_n[inside, 1]))) / (float(radii(lat)[0]) * horizontal)
    stretch, own = task.record.between(begin, float(track.time[end])), float(fifteen(track)[end, PHI, PHI][2, 2])

    def turned(rest: Alignment, biases: float) -> float:
        """How far its heading is off, rad; 0 where the earth's rate turns by less than so many biases between the two."""
        off = max(abs(turn_between(C, rest.C_nb)) - north, 0.0)
        return off if 2.0 * horizontal * math.sin(0.5 * off) >= biases * float(np.max(rest.gyro_bias_prior)) else 0.0

    def led(rest: Alignment | None) -> bool:
        if rest is None:
            return False
        doubt = max((item.effect.heading for item in rest.evidence), default=0.0)
        sigma = math.hypot(azimuth_sigmas(rest)[0], doubt, math.sqrt(own))
        return turned(rest, BY_CHANCE) >= limit("led at rest") * sigma

    coarse = _as_at_rest(task, stretch, method="oba")
    if coarse is not None and not turned(coarse, 0.5 * BY_CHANCE):
        return []
    if not led(_as_at_rest(task, stretch, causes=False)):
        return []
    rest = _as_at_rest(task, stretch)
    if rest is None or not led(rest):
        return []
    figures: dict[str, Any] = {
        "rest": rest.heading,
        "rest_sigma": azimuth_sigmas(rest)[0],
        "heading": float(euler_from_dcm(C)[0]),
        "begin": begin,
        "end": float(track.time[end]),
        "speed": float(np.max(np.linalg.norm(track.v_n[inside, :2], axis=1))),
    }
    return [contradiction("innovations.at_rest", **figures)]


def _as_at_rest(task: MovingTask, stretch: ImuRecord, **how: Any) -> Alignment | None:
    """The stretch aligned as of a base that stays; None where that cannot be, or is contradicted."""
    try:
        answer = align_base(stretch, task.position, _without_lags(task.spec), **how)
    except TruenorthError:
        return None
    return answer if answer.status == "aligned" else None


def _without_lags(spec: ImuSpec) -> ImuSpec:
    """Of a record whose lags and places are taken off."""
    lags: dict[str, Any] = {f"{sensor}_{term}": value for sensor in SENSORS for term, value in NO_LAG.items()}
    return replace(spec, accel_positions=None, **lags)
