"""Whether the heights of a receiver drift away, by how the filter itself would follow them.

The same log with heights that rise by ``k t``, and velocities that do not: what that adds to the innovations of all sources is the
signature of a drift. Twice the logarithm of the likelihood ratio of the drift that fits best is a chi-square of one degree of
freedom where nothing drifts. It is asked for with each of the slow errors left out that innovations have shown, too: such an error
takes a drift up, but not its size. The way that heights go with velocities is the same where the velocities are wrong all along:
nothing says which.

Sound receivers have slow errors of height (multipath, atmosphere), which look like that. So a drift refuses no log: what it moves
the answer by is in sigma, and where one sound log in a hundred shows as much by chance, too.

Source: A. Willsky and H. Jones, "A generalized likelihood ratio approach to the detection and estimation of jumps in linear
systems", IEEE Trans. Autom. Control 21 (1976); signatures by passes of the filter are ours.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from truenorth.core.errors import DataError
from truenorth.estimate.responses import likeliest_of
from truenorth.estimate.rivals import moved
from truenorth.records import GnssRecord
from truenorth.state.evidence import Evidence, Figure
from truenorth.state.limits import limit
from truenorth.state.track import Track

STEP = 1e-4  # m/s, with which a pass asks: so small that no gate decides otherwise


def height_evidence(
    run: Callable[[GnssRecord], Track],
    first: Track,
    receiver: GnssRecord,
    without: Sequence[Callable[[GnssRecord], Track]] = (),
) -> list[Evidence]:
    """The drift of a receiver's heights against its velocities, where it is likelier than chance.

    Parameters
    ----------
    run : callable
        The same filter with another record of the receiver.
    first : track
        With the record as it is.
    receiver : GnssRecord
    without : sequence of callable
        As `run`, each without one of the slow errors that the innovations have shown.

    Returns
    -------
    list of Evidence
        None, or one.
    """
    if receiver.v_n is None:
        return []
    try:
        ratio, rate = likeliest_of((run, *without), first, receiver, _level, STEP)
        if ratio <= limit("height drift"):
            return []
        effect = moved(first, run(_level(receiver, rate)))
    except DataError:  # the filter broke down: no explanation
        return []
    figures: dict[str, Figure] = {"size": abs(rate) * receiver.duration, "rate": rate, "ratio": ratio}
    return [Evidence("gnss.height_drifts", figures, "hint", effect, ("sensor_axes",))]


def _level(receiver: GnssRecord, rate: float) -> GnssRecord:
    """The receiver as it would be without heights that rise at this rate (m/s)."""
    return replace(receiver, alt=receiver.alt - rate * (receiver.time - receiver.time[0]))
