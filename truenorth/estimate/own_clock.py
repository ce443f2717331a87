"""The answer with a receiver's rows on the IMU's clock, where turns show that its clock is seconds or days apart.

What the turns show (:mod:`truenorth.quality.clock_apart`) may be chance, or a nose that follows the course some seconds later: the
answer has to bear it out. Rows that are shifted in vain by more than any filter finds leave it inconsistent; those that are shifted
by less are found back as a delay.

The rule is ours.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from truenorth.core.errors import AlignmentError, DataError
from truenorth.estimate.noisier import Answer
from truenorth.quality.clock_apart import clock_apart
from truenorth.records import GnssRecord, ImuRecord
from truenorth.state.evidence import Evidence, note

FAR = 10.0  # s: a delay that no filter finds
LEFT = 1.5  # s: of whole seconds a delay that is left
GPS_UTC = 18.0  # s, since 2017


def on_its_clock(solved: Callable[[GnssRecord | None], Answer], record: ImuRecord, gnss: GnssRecord | None) -> Answer:
    """The answer with a receiver's rows on the IMU's clock, where turns show that it is seconds apart; else with them as they are.

    Parameters
    ----------
    solved : callable
        The answer with these rows of the receiver.
    record : ImuRecord
    gnss : GnssRecord or None
        None: there is no receiver.

    Returns
    -------
    Alignment or Navigation
        Rows are shifted where the answer with them as they are is inconsistent, or the clock is too far apart for a filter, and the
        answer with shifted rows is neither inconsistent nor shifts them back. Its evidence says by how much.
    """
    late = None if gnss is None else clock_apart(record, gnss)
    if gnss is None or late is None:
        return solved(gnss)
    if abs(late) > FAR:  # no filter finds such a delay, so that rows which are shifted in vain are inconsistent
        return _shifted(solved, gnss, late) or solved(gnss)
    try:
        as_stamped = solved(gnss)
    except (DataError, AlignmentError):
        if (answer := _shifted(solved, gnss, late)) is None:
            raise
        return answer
    return as_stamped if as_stamped.status != "inconsistent" else _shifted(solved, gnss, late) or as_stamped


def _shifted(solved: Callable[[GnssRecord | None], Answer], gnss: GnssRecord, late: float) -> Answer | None:
    """The answer with rows so much earlier, with what there is to say of it; None where it is inconsistent, or shifts them back."""
    try:
        answer = solved(gnss.shifted(-late))
    except (DataError, AlignmentError):
        return None
    found = [item.figures.get("size", 0.0) for item in answer.evidence if item.key in ("delay.late", "delay.early")]
    if answer.status == "inconsistent" or any(float(size) > LEFT for size in found):
        return None
    return replace(answer, evidence=(*answer.evidence, *moved_by(-late)))  # type: ignore[type-var]  # a dataclass


def moved_by(offset: float) -> list[Evidence]:
    """What there is to say of a receiver's rows whose times were moved by so many seconds; nothing of none."""
    if not offset:
        return []
    key = "clock.ahead" if offset < 0.0 else "clock.behind"
    said = [note(key, "offset", urgent=True, name="GNSS", sensor="gnss", size=abs(offset), offset=offset)]
    return said + ([note("clock.gps_or_utc")] if abs(abs(offset) - GPS_UTC) < 1.0 else [])
