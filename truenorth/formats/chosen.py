"""The columns of an IMU in a log, as chosen, and which of its columns is the clock: by name, by steadiness, by behaviour."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from truenorth.core.errors import DataError
from truenorth.formats.behaviour import EPOCH
from truenorth.formats.columns import Columns, missing_column
from truenorth.formats.guesses import UnsureError
from truenorth.formats.layout import Layout
from truenorth.formats.names import clock_of, is_plain_clock, plain
from truenorth.formats.units import split
from truenorth.records import Guess
from truenorth.records.imu import Kind

Array = NDArray[np.float64]

OF_OTHERS = re.compile(
    r"(?:^|_)(?:gps|gnss|rtk|ref|reference|truth|gt|ground|odo\w*|wheel|encoder|baro\w*|mag\w*|cam\w*|image|lidar|dvl|vel|pos|pva|vicon)(?=_|\d|$)"
)
OF_IMU = re.compile(r"(?:^|_)(?:imu|acc\w*|gyr\w*|inertial|sensors?)(?=_|\d|$)")
STEADY = 0.5  # of the median step: the RMS scatter of a clock's steps, gaps left out
SECONDS = re.compile(r"(?i)(?:^|[^a-z])(?:secs?|seconds|(?:unix|epoch)[ _]?time(?:stamp)?(?:[ _]s)?)$")
FRACTIONS = {
    1e-3: re.compile(r"(?i)(?:^|[^a-z])(?:milli_?seconds?|millis|msecs?)(?:_elapsed)?$"),
    1e-6: re.compile(r"(?i)(?:^|[^a-z])(?:micro_?seconds?|micros|usecs?)(?:_elapsed)?$"),
}
COUNTER = re.compile(  # names of what counts rows, or packets of all kinds
    r"(?:^|_)(?:packets?|pkt|counter|counts?|cnt|ctr|ind(?:ex|ices)|idx|numbers?|num|no|nr|seq\w*|frames?|samples?|rows?|lines?|records?|"
    r"rec|msgs?|messages?|ids?|n)(?:_?\d+)?(?:_|$)"
)
OF_TIME = re.compile(r"(?i)time|stamp|[^a-z]ms|(?:^|[^a-z])t(?:[^a-z]|$)")
REPEATS = 0.2  # of the rows, from which a clock that repeats is coarser than any other
FEW = 2.0  # whole steps, up to which numbers without a name may be counts with some left out, or ms
MOST_COLUMNS = 200  # that are looked at where no name decides


@dataclass
class Choice:
    """The columns of an IMU in a log."""

    kind: Kind | None  # None: the names do not tell
    time: tuple[str, ...]  # one column, or two of seconds and their fraction; none where the log has no clock
    sensors: list[tuple[str, float]]  # list of (str, float); six columns, each with its sign
    units: dict[str, str] = field(default_factory=dict)  # that the headings name, of ``gyro``, ``accel`` and ``time``
    documented: bool = False  # the columns have our own names, which mean SI
    named: bool = True  # names say what the columns are; else their numbers do, which fit a rare unit by chance
    guesses: list[Guess] = field(default_factory=list)
    fraction: float = 1e-9  # s, that the second column of the time counts
    # units, and why, that the device which wrote the log always has: what the headings name wins
    device: dict[str, tuple[str, str]] = field(default_factory=dict)
    doubt: UnsureError | None = None  # of the clock, to be asked where the sensors are found
    counter: str = ""  # a column that increases as a clock does, and by its name counts

    @property
    def labels(self) -> tuple[str, ...]:
        """Seven names for messages."""
        return (self.time[0] if self.time else "time", *(name for name, _ in self.sensors))


def with_time(columns: Columns, layout: Layout, choice: Choice) -> Choice:
    """The same with its clock: the caller's, the one of that name, the steadiest of several, or the only column that increases."""
    wanted = layout.columns.get("time")
    if wanted is not None:
        if wanted in columns.names or f"{wanted}[0]" in columns.names:
            choice.time = (wanted if wanted in columns.names else f"{wanted}[0]",)
        elif layout.rate is None:
            raise missing_column(columns, "time", wanted)
        _note_unit(choice, *(clock_of(choice.time[0]) if choice.time else (False, None)))
        return choice
    if "interval" in layout.columns:
        return choice
    taken = {name for name, _ in choice.sensors}
    names = [name for name in columns.names if name not in taken]
    names = [name for name in names if not (columns.named and clock_of(name)[0] and _is_empty(columns, name))]
    if "time" in names:
        choice.time = ("time",)
        finer = _finer_clock(columns, names)
        if finer is not None:
            choice.time = (finer,)
            why = "it increases in each row, where column time does not"
            choice.guesses.append(Guess("time", finer, why, 1.0, {"columns": {"time": finer}}))
            _note_unit(choice, *clock_of(finer))
        return choice
    clocks = (
        {name: unit for name in names if (found := clock_of(name))[0] for unit in (found[1],)} if columns.named else {}
    )
    whole = [name for name, unit in clocks.items() if re.search(r"(?i)(?:^|[^a-z])secs?$", name)]
    parts = [name for name in names if re.search(r"(?i)(?:nano_?secs?|nsecs?|nanosec)$", name)]
    if whole and parts:
        choice.time = (whole[0], parts[0])
        choice.units["time"] = "s"
        choice.guesses.append(Guess("time", f"{whole[0]} + {parts[0]}", "seconds and nanoseconds by their names"))
        return choice
    if columns.named and _of_two_columns(columns, names, choice):
        return choice
    steady = {name: scatter for name in clocks if (scatter := _scatter(columns, name)) is not None}
    steady = {name: steady[name] for name in _own(columns, choice, _as_long(columns, choice, list(steady)))}
    plainly = {name: scatter for name, scatter in steady.items() if is_plain_clock(name)}
    steady = plainly or steady
    if steady:
        best = min(
            steady,
            key=lambda name: (
                steady[name] > STEADY,
                list(clocks).index(name) if steady[name] < 0.05 else 99,
                steady[name],
            ),
        )
        why = "its name" if len(steady) == 1 else f"of {', '.join(steady)} the steadiest, or the first of equals"
        choice.time = (best,)
        choice.guesses.append(Guess("time", best, why, 1.0, {"columns": {"time": best}}))
        _note_unit(choice, True, clocks[best])
        return choice
    wrong = [name for name in clocks if len(columns.column(name)) > 1 and not _stands(columns, name)]
    if wrong and layout.rate is None:
        choice.time = (wrong[0],)  # which is refused with the row that is wrong
        _note_unit(choice, True, clocks[wrong[0]])
        return choice
    if layout.rate is None:
        _clock_by_behaviour(columns, layout, choice, names)
    return choice


def _finer_clock(columns: Columns, names: Sequence[str]) -> str | None:
    """The only other clock by its name that increases in each row, where ``time`` does not; else None."""
    others = [name for name in names if name != "time" and columns.named and clock_of(name)[0]]
    others = [name for name in others if OF_OTHERS.search(plain(name)) is None]
    if not others or (time := _steps(columns, "time")) is None or time.min() > 0.0:
        return None
    steps = {name: found for name in others if (found := _steps(columns, name)) is not None}
    good = [name for name, found in steps.items() if len(found) == len(time) and found.min() > 0.0]
    coarse = np.mean(time == 0.0) > REPEATS
    good = [name for name in good if coarse or (_scatter(columns, name) or 0.0) < STEADY]
    return good[0] if len(good) == 1 else None


def _steps(columns: Columns, name: str) -> Array | None:
    """Steps of a clock; None where it has none, or cells that are no times."""
    try:
        steps = np.diff(columns.clock(name)[0])
    except DataError:
        return None
    return steps if steps.size and np.all(np.isfinite(steps)) else None


def _is_empty(columns: Columns, name: str) -> bool:
    """Whether a clock has no value in any row, as those that a program's export lists and a device does not send."""
    column = columns.column(name)
    text = not column.null_count and column.type in ("string", "large_string")
    return len(column) > 0 and (
        column.null_count == len(column) or (text and not any(map(str.strip, column.to_pylist())))
    )


def _of_two_columns(columns: Columns, names: Sequence[str], choice: Choice) -> bool:
    """Take whole seconds and their milliseconds or microseconds for the clock, where they increase as one."""
    seconds = [name for name in names if SECONDS.search(name)]
    for size, pattern in FRACTIONS.items():
        for part in [name for name in names if pattern.search(name)] if len(seconds) == 1 else []:
            try:
                whole, parts = columns.read([seconds[0], part], False).T
            except DataError:
                continue
            counts = bool(np.all((parts >= 0.0) & (parts * size < 1.0)) and np.all(whole == np.round(whole)))
            if (
                counts
                and len(whole) > 1
                and np.all(np.diff(whole + size * parts) >= 0.0)
                and np.any(np.diff(parts) < 0.0)
            ):
                choice.time, choice.fraction, choice.units["time"] = (seconds[0], part), size, "s"
                choice.guesses.append(Guess("time", f"{seconds[0]} + {part}", "seconds and their parts by their names"))
                return True
    return False


def _note_unit(choice: Choice, is_clock: bool, unit: str | None) -> None:
    if is_clock and unit is not None:
        choice.units["time"] = unit


def _scatter(columns: Columns, name: str) -> float | None:
    """RMS scatter of a clock's steps over the median one; None where it does not always increase."""
    steps = _steps(columns, name)
    if steps is None or steps.min() < 0.0 or np.median(steps) <= 0.0:
        return None
    median = float(np.median(steps))
    near = steps[steps < 3.0 * median]
    return float(np.sqrt(np.mean((near / median - 1.0) ** 2)))


def _as_long(columns: Columns, choice: Choice, clocks: list[str]) -> list[str]:
    """Those clocks that have a row for each of the sensors': a file of arrays holds those of other devices too.

    Where the sensors are not known yet, as many rows as most columns have; all clocks where none has.
    """
    lengths = {name: len(columns.column(name)) for name in clocks}
    if len(set(lengths.values())) < 2:
        return clocks
    sensors = [name for name, _ in choice.sensors] or list(columns.names[:MOST_COLUMNS])
    ((rows, _),) = Counter(len(columns.column(name)) for name in sensors).most_common(1)
    return [name for name in clocks if lengths[name] == rows] or clocks


def _own(columns: Columns, choice: Choice, clocks: list[str]) -> list[str]:
    """Those clocks of a file of arrays that are the sensors' own: of their struct, or not of another device by their names.

    Raises
    ------
    UnsureError
        Several are left, and their steps differ: a log is never timed by another device's clock in silence.
    """
    if not columns.rows or len(clocks) < 2:
        return clocks
    structs = {name.rpartition(".")[0] for name, _ in choice.sensors}
    own = [name for name in clocks if name.rpartition(".")[0] in structs] or clocks
    own = [name for name in own if OF_OTHERS.search(plain(name)) is None] or own
    own = [name for name in own if OF_IMU.search(plain(name)) is not None] or own
    times = {name: columns.clock(name)[0] for name in own}
    if all(np.array_equal(time, times[own[0]]) for time in times.values()):
        return own[:1]
    steps = {name: np.diff(time) for name, time in times.items()}
    first = steps[own[0]]
    if any(not _same_pace(first, other) for other in steps.values()):
        options = [{"columns": {"time": name}} for name in own]
        raise UnsureError(
            f"{columns.path.name}: columns {', '.join(own)} are clocks of different steps", options, choice.guesses
        )
    return own


def _same_pace(one: Array, other: Array) -> bool:
    """Whether the steps of two clocks are the same, in units of ten, a thousand and so on."""
    if len(one) != len(other) or not one.size or not np.median(one) > 0.0 or not np.median(other) > 0.0:
        return False
    ratio = np.log10(np.sum(one) / np.sum(other))
    return bool(abs(ratio - np.round(ratio)) < 1e-3)


def _stands(columns: Columns, name: str) -> bool:
    """Whether a clock has one value in all rows, as that of a receiver without satellites: it is no clock."""
    try:
        time = columns.clock(name)[0]
    except DataError:
        return False
    return bool(np.all(time == time[0]))


def _counts(columns: Columns, name: str, time: Array) -> bool:
    """Whether a column that increases counts rows, or by its name packets of all kinds, of which some are no rows."""
    steps = np.diff(time)
    if np.all(steps == 1.0) and not re.search(r"(?i)time|stamp|[^a-z]ms", name):
        return True
    named = columns.named and COUNTER.search(plain(split(name)[0])) is not None and OF_TIME.search(name) is None
    dated = any(EPOCH[0] < time[0] * size < EPOCH[1] for size in (1.0, 1e-3, 1e-6, 1e-9))
    return named and bool(np.all(time == np.round(time))) and not dated


def _doubt_of_skips(columns: Columns, choice: Choice, name: str) -> UnsureError | None:
    """What to ask of whole numbers that go up by 1, now and then by more: ms of a quick log, or a counter that leaves out some."""
    time, said = columns.clock(name)
    steps = np.diff(time)
    whole = said is None and bool(np.all(steps == np.round(steps)))
    if not whole or steps.min() != 1.0 or np.median(steps) > FEW or OF_TIME.search(name) is not None:
        return None
    return UnsureError(
        f"{columns.path.name}: column {name} goes up by 1 to {steps.max():.0f} from row to row: it may be in ms "
        f"({1e3 / np.mean(steps):.4g} rows a second) or count rows or packets, of which some are missing",
        [{"columns": {"time": name}, "units": {"time": "ms"}}, {"rate": "(rows a second)"}], choice.guesses,
    )  # fmt: skip


def _clock_by_behaviour(columns: Columns, layout: Layout, choice: Choice, names: Sequence[str]) -> None:
    """Take the only column that increases steadily for the clock; a row counter is not a clock."""
    steady = {name: scatter for name in names[:MOST_COLUMNS] if (scatter := _scatter(columns, name)) is not None}
    counters = [name for name in steady if _counts(columns, name, columns.clock(name)[0])]
    choice.counter = counters[0] if counters and columns.named else ""
    found = [name for name, scatter in steady.items() if scatter < STEADY and name not in counters]
    clocks = _own(columns, choice, _as_long(columns, choice, found))
    if len(clocks) == 1:
        choice.doubt = _doubt_of_skips(columns, choice, clocks[0])
        choice.time = (clocks[0],)
        choice.guesses.append(
            Guess(
                "time",
                f"column {clocks[0]}",
                "the only one that increases steadily",
                1.0,
                {"columns": {"time": clocks[0]}},
            )
        )
    elif len(clocks) > 1:
        options = [{"columns": {"time": name}} for name in clocks]
        raise UnsureError(
            f"{columns.path.name}: columns {', '.join(clocks)} all increase like a clock", options, choice.guesses
        )
