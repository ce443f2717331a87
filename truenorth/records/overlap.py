"""Two logs that have no time in common: whose clocks count from where, and what to add to one of them.

A clock counts from 1970, from midnight, from Sunday (the GPS week, some seconds ahead of UTC), or from where it was switched on; it
shows the time of a zone; a receiver whose week number has run over is 1024 weeks behind. Where one of these explains how far two
logs are apart, they overlap once it is undone.
"""

from __future__ import annotations

from collections.abc import Iterator

from truenorth.core.errors import DataError

HOUR, DAY, WEEK = 3600.0, 86400.0, 604800.0
DATED = 3e8  # s since 1970: beyond it a clock holds a date
SUNDAY = 3.0 * DAY  # 4 January 1970
LEAP = 18.0  # s, of GPS time ahead of UTC, since 2017
ROLLED = 1024.0 * WEEK
ZONES = 14  # hours from UTC, at most
BRIEF = 0.25 * DAY  # s, both logs together: one in four logs of any other clock would overlap by chance
SHARE = 0.5  # of the shorter log that overlaps, where a shift explains how far they are apart

Span = tuple[float, float]


def no_overlap(name: str, of_aid: Span, log: str, of_log: Span) -> DataError:
    """The error for an aiding log that ends before the IMU's log begins, or begins after its end; spans in s."""
    shift = shift_of(of_aid, of_log)
    if shift is None:
        return DataError(
            f"{name}: runs from {of_aid[0]:.3f} s to {of_aid[1]:.3f} s, {log} from {of_log[0]:.3f} s to {of_log[1]:.3f} s: no "
            "overlap; expected one clock: shift the aiding log onto the IMU's (`record.shifted`)"
        )
    return DataError(
        f"{name}: runs from {of_aid[0]:.3f} s to {of_aid[1]:.3f} s, {log} from {of_log[0]:.3f} s to {of_log[1]:.3f} s: no overlap; "
        f"expected one clock: {shift:.0f} s added to the times of the aiding log bring it onto the IMU's (`record.shifted`)"
    )


def shift_of(of_aid: Span, of_log: Span) -> float | None:
    """What to add to the times of an aid, s, where clocks that count from elsewhere explain how far it is apart; else None."""
    return next((shift for shift in _shifts(of_aid[0], of_log[0]) if _together(of_aid, of_log, shift)), None)


def _together(of_aid: Span, of_log: Span, shift: float) -> bool:
    least = SHARE * min(of_aid[1] - of_aid[0], of_log[1] - of_log[0])
    return min(of_aid[1] + shift, of_log[1]) - max(of_aid[0] + shift, of_log[0]) >= least


def days_apart(of_aid: Span, of_log: Span) -> float:
    """What to add to the times of an aid, s, where one of two clocks counts from 1970 and surely the other from midnight; else 0.

    A clock that counts from where it was switched on shows small numbers, and logs of hours overlap by chance; on the first day of
    the GPS week that clock shows the same, but for leap seconds.
    """
    if (of_aid[0] > DATED) == (of_log[0] > DATED) or min(of_aid[0], of_log[0]) < HOUR:
        return 0.0
    if of_aid[1] - of_aid[0] + of_log[1] - of_log[0] > BRIEF:
        return 0.0
    shifts = list(_shifts(of_aid[0], of_log[0]))
    found = [shift for shift in shifts if shift % DAY == 0.0 and _together(of_aid, of_log, shift)]
    near = [shift for shift in shifts if found and abs(shift - found[0]) < HOUR]
    return found[0] if len(near) == 1 else 0.0


def _shifts(aid: float, log: float) -> Iterator[float]:
    """Whole days to a clock of the day, weeks to one of the GPS week, and what two clocks with dates may be apart by."""
    if (aid > DATED) != (log > DATED):
        early, late = sorted((aid, log))
        sign = 1.0 if log > DATED else -1.0
        if 0.0 <= early < 2.0 * DAY:
            yield sign * DAY * ((late + DAY / 2 - early) // DAY)
        if 0.0 <= early < WEEK:
            yield sign * (SUNDAY - LEAP + WEEK * ((late - SUNDAY + LEAP + WEEK / 2 - early) // WEEK))
    elif aid > DATED:
        yield from (sign * ROLLED for sign in (1.0, -1.0))
        yield from (sign * HOUR * k for k in range(1, ZONES + 1) for sign in (1.0, -1.0))
