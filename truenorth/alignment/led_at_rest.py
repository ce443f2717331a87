"""A receiver that is led away while its vehicle stands: by its IMU the vehicle rests, by its aids it moves.

A velocity that grows by .01 m/s a second is a tilt of .06 deg to a filter that believes in it, and north is where such a tilt comes
from: a receiver led away by .5 m/s in a minute turned the heading of a parked car by 38 deg. Its IMU knows better. As of a base
that stays, the log gives a heading of its own, and a check: along north and along the vertical the gyros must see the earth's rate
to within their biases. A vehicle that did move, and turned by what the aids say, would meet both by chance alone. So where the log
as at rest is without contradiction, and its heading is another, the aids are wrong.

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
    rest = _as_at_rest(task, begin, float(track.time[end]))
    if rest is None:
        return []
    lat, C = task.position.lat, track.C_nb[end]
    horizontal = EARTH_RATE * math.cos(lat)
    heading = float(euler_from_dcm(C)[0])
    off = abs(turn_between(C, rest.C_nb))
    doubt = max((item.effect.heading for item in rest.evidence), default=0.0)
    sigma = math.hypot(azimuth_sigmas(rest)[0], doubt, math.sqrt(fifteen(track)[end, PHI, PHI][2, 2]))
    off -= abs(float(np.mean(track.v_n[inside, 1]))) / (float(radii(lat)[0]) * horizontal)
    turns = 2.0 * horizontal * math.sin(0.5 * max(off, 0.0))  # between the two headings of the earth's rate
    if off < limit("led at rest") * sigma or turns < BY_CHANCE * float(np.max(rest.gyro_bias_prior)):
        return []
    figures: dict[str, Any] = {
        "rest": rest.heading,
        "rest_sigma": azimuth_sigmas(rest)[0],
        "heading": heading,
        "begin": begin,
        "end": float(track.time[end]),
        "speed": float(np.max(np.linalg.norm(track.v_n[inside, :2], axis=1))),
    }
    return [contradiction("innovations.at_rest", **figures)]


def _as_at_rest(task: MovingTask, begin: float, end: float) -> Alignment | None:
    """The stretch aligned as of a base that stays; None where that cannot be, or is contradicted."""
    try:
        answer = align_base(task.record.between(begin, end), task.position, _without_lags(task.spec))
    except TruenorthError:
        return None
    return answer if answer.status == "aligned" else None


def _without_lags(spec: ImuSpec) -> ImuSpec:
    """Of a record whose lags and places are taken off."""
    lags: dict[str, Any] = {f"{sensor}_{term}": value for sensor in SENSORS for term, value in NO_LAG.items()}
    return replace(spec, accel_positions=None, **lags)
