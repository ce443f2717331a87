"""The earth's rate while a vehicle rests: what its gyros must see then, whatever else the log holds.

An alignment under way follows the gyros from aid to aid, and in a minute two exchanged axes make it drift by no more than
biases could. At rest they see the earth turn: the rate along north and along the vertical is known, whatever people and an
engine shake.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.check import check_filter, check_means, sharper
from truenorth.alignment.in_motion_task import MovingTask
from truenorth.alignment.moving import fifteen
from truenorth.alignment.task import make_task
from truenorth.alignment.verdict import rate_evidence
from truenorth.coarse.inertial import oba
from truenorth.errors.staying import StaticModel
from truenorth.navigation.stops import longest_rest, seconds_at_rest
from truenorth.state.evidence import Evidence
from truenorth.state.layout import BG, PHI
from truenorth.state.track import Track
from truenorth.strapdown.inertial import integrate

Array = NDArray[np.float64]


def rest_evidence(task: MovingTask, track: Track) -> list[Evidence]:
    """Rates that contradict the earth's in the longest rest of a log on the move, by the specification of the gyros.

    Parameters
    ----------
    task : MovingTask
    track : Track
        Of the log: it says how far biases of the gyros turn the heading at its end.
    """
    longest = longest_rest(*seconds_at_rest(task.record, task.odometer, task.gnss))
    if not len(longest):
        return []
    rest = make_task(task.record.between(longest[0] - 0.5, longest[-1] + 0.5), task.position, None)
    lat, noise = task.position.lat, StaticModel.of(task.spec)
    integrals = integrate(rest.record, rest.interval)
    coarse = oba(integrals, lat, task.position.alt, history=False)
    filtered, _ = check_filter(rest, integrals, coarse.C_n0_i, noise, noise)
    check = sharper(filtered, check_means(rest.means, lat, rest.gravity), rest)
    bias = float(np.sqrt(task.spec.bias_variance[0]))
    return rate_evidence(check, bias, lat, f"specification {task.spec.name!r}", heading_by_biases(task, track))


def heading_by_biases(task: MovingTask, track: Track) -> float:
    """The part of heading's sigma at the end that the biases of the gyros make, rad.

    An estimate x answers what was believed of a constant b with ``dx / db = cov(x, b) / P0``, its covariance a posteriori by b's
    variance a priori: of the earth's rate alone ``1 / (w_ie cos L)`` towards east, of a vehicle that GNSS has seen turn next to
    nothing.
    """
    covariance = fifteen(track)[-1, PHI, BG][2]
    sigma = np.sqrt(task.spec.bias_variance[:3])
    return float(np.linalg.norm(covariance[sigma > 0.0] / sigma[sigma > 0.0]))
