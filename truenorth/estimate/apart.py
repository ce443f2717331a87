"""What rows see of a motion whose errors are kept apart: they are linear about the motion, what they are off by is not.

An open loop's columns are those of the motion that it is linear about, all the time: columns that turn with each correction show
what nothing shows. Its innovations are another matter. By its end that motion may be off by a hundred metres a second and ten
kilometres, and what is left of ``z - H x`` is the product of such errors: north of a place that is off by 10 km is turned by
.1 deg, and of 100 m/s so turned .2 m/s are left. A filter of which ``z - H x`` was white put out velocities that were ten of
their sigmas away from what the receiver measured. So innovations are what the rows say of the motion with its known errors
taken off, exactly.

The columns keep that motion's attitude, but not its velocity. Errors of velocity are small only once they are taken off: what is
multiplied with it is a scale, a mounting, a tilt, a delay, and with a velocity that is off by 30 m/s the column ``-y`` of a wheel's
scale is three times as long as the way of a car that does 10. Such a scale seems to be known to a third of its sigma, by metres
that nobody drives; that of a wheel was 57 of its sigmas off. So in the rows the vehicle moves as is known: velocity, and what
changes it (the column of a delay, in which a tilt of .05 rad leaves half a metre per second squared of gravity).

That is so once the attitude is known. Of a heading that is any, errors swing by a radian within the first fixes, and end where they
end in a filter that is linear throughout; exact innovations of such an attitude mean nothing, and a gate keeps out good fixes.

Source: G. Huang, A. Mourikis and S. Roumeliotis, "Analysis and improvement of the consistency of extended Kalman filter based
SLAM", ICRA 2008: Jacobians at first estimates, residuals at the last ones.
"""

from __future__ import annotations

from typing import Any

from truenorth.core.attitude import cross
from truenorth.core.compiled import borrowing
from truenorth.estimate.correct import feed_back, measure
from truenorth.estimate.memory import Events, Memory, Model, Samples, Sources
from truenorth.estimate.predict import describe, describe_instant
from truenorth.state.now import NOW_BEHIND, NOW_PUSH
from truenorth.strapdown.wander import set_matrix

_V = 4  # the place of the velocity in a state of :mod:`truenorth.strapdown.wander`
NEAR = 0.1  # rad, one sigma of an attitude: half of its square is what the linear rows leave out


@borrowing(forceinline=True)
def is_exact(model: Model, P: Any) -> bool:
    """Whether innovations are what rows say with the known errors taken off; by the covariance P (n, n)."""
    return model.exact and P[0, 0] < NEAR**2 and P[1, 1] < NEAR**2 and P[2, 2] < NEAR**2


@borrowing(forceinline=True)
def innovations_there(
    m: Memory,
    model: Model,
    sources: Sources,
    events: Events,
    e: int,
    samples: Samples,
    i: int,
    behind: float,
    w: Any,
    room: Any,
) -> None:
    """Put into `room.z` (3,) what measurement e is off by, the known errors taken off; the motion stays as it is.

    In `room.now`, which is described already, velocity and its change become those that are known: for the columns.

    Parameters
    ----------
    i : int
        The sample that the loop stands in.
    behind : float, s
        How long ago the stamp was.
    room : Room
        Of the loop. All but `z` and `now` is written over, as what `w` holds of a measurement is.
    """
    source, s, aux, x, force = events.source[e], m.s, m.aux, m.x, m.means.vectors[0]
    for a in range(len(s)):
        room.s[a] = s[a]
    for a in range(len(aux)):
        room.aux[a], room.x[a] = aux[a], x[a]
    turned = cross((x[0], x[1], x[2]), (force[0], force[1], force[2]))
    was = (force[0], force[1], force[2])
    feed_back(s, aux, x, model.dynamics.turns)
    set_matrix(s, m.sums.C_now)
    for a in range(3):
        room.R[a] = events.variance[e, a]
        force[a] += turned[a]
    describe(m, model, room.there)
    room.there[NOW_BEHIND] = behind
    if sources.instant[source]:
        describe_instant(samples, i, m.done[0], model, aux, room.there)
    measure(m, model, sources, source, events.measured[e], room.there, w, room.R)
    for a in range(3):
        room.z[a], force[a] = w.z[a], was[a]
        room.now[_V + a], room.now[NOW_PUSH + a] = room.there[_V + a], room.there[NOW_PUSH + a]
    for a in range(len(s)):
        s[a] = room.s[a]
    for a in range(len(aux)):
        aux[a], x[a] = room.aux[a], room.x[a]
    set_matrix(s, m.sums.C_now)
