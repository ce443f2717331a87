"""Time of an IMU's log in seconds: from its stamps, or from a rate; stamps of a computer that reads in bunches are refused."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.core.errors import DataError, UsageError
from truenorth.formats.behaviour import EPOCH, clock_readings, size
from truenorth.formats.bunches import even_but_for_digits, jump_of, rows_are_lost
from truenorth.formats.checks import check_finite, check_order
from truenorth.formats.chosen import Choice
from truenorth.formats.clock_face import FEWEST, clock_face, of_clock_face
from truenorth.formats.columns import Columns, missing_column
from truenorth.formats.guesses import UnsureError, take
from truenorth.formats.layout import Layout, times, unit_factor
from truenorth.records import Guess
from truenorth.records.pace import stretches

Array = NDArray[np.float64]

INTERVALS = ("ts", "Ts", "dt", "interval")
FREQUENCIES = ("fs", "Fs", "sampling_rate", "samplingRate", "sample_rate", "sampleRate", "sampling_frequency")
RATE_LINE = re.compile(r"(?:rate|frequency|freq)\b[^\d\n]{0,20}(\d+(?:\.\d+)?)\s*(?:hz\b|sps\b|$)", re.IGNORECASE)
BUNCHED = 1.2  # mean over median step, from which stamps are of a computer that read several rows at once
BUNCH_SHARE = 0.05  # of the steps that are longer than 1.5 median ones, or zero; gaps are fewer
TENTH_MS = "0.1 ms"
FASTEST_FINE, SLOWEST_FINE = 500.0, 2.0  # Hz, of an Xsens's log
SPAN = 0.02  # by which the stamps' span and that of a given rate may differ


def clock_of_log(
    columns: Columns, layout: Layout, choice: Choice, rows: int, guesses: list[Guess]
) -> tuple[Array, Layout]:
    """Time in seconds: from the stamps, or made from the rate."""
    source = columns.path.name
    if not choice.time:
        return _made(columns, layout, rows, guesses, choice.counter), layout
    raw, said = columns.clock(choice.time[0])
    if len(choice.time) == 2:
        raw = raw + choice.fraction * columns.read([choice.time[1]], False)[:, 0]
    if len(raw) != rows:
        raise DataError(f"{source}: gyro and accelerometer have {rows} rows, time {len(raw)}; expected as many of each")
    check_finite(raw[:, None], choice.labels[:1], source, columns.place)
    stated = layout.units.get("time", choice.units.get("time"))
    why = "the cells are no bare numbers"
    if said is None and "time" not in layout.units and (face := clock_face(raw)) is not None:
        written, part = face
        raw, said, why = (
            of_clock_face(raw / part),
            "times of day",
            f"written {written}: no second reaches 60, each minute begins with a jump of 40 s",
        )
    if stated == TENTH_MS and "time" not in layout.units and len(raw) > 2:
        stated = _fine(raw, source)
        if stated == "us":
            choice.device["gyro"] = ("deg/s", "an Xsens DOT's, whose clock counts microseconds, are in deg/s")
    if layout.rate is None:
        _check_bunches(raw, said, stated, source, guesses, columns.place)
    elif np.all(np.diff(raw) >= 0.0) and raw[-1] > raw[0]:
        return _evenly(raw, said, stated, layout.rate, source, guesses, columns.place), layout
    check_order(raw, choice.labels[0], source, columns.place)
    if said is not None:
        guesses.append(Guess("time", said, why))
        return raw, layout
    if len(choice.time) == 1 and (anew := columns.anew.get(choice.time[0])) is not None:
        guesses.append(Guess("clock", anew, "each step back is the usual step but for the period, and begins at zero"))
    if "time" in layout.units:
        guesses.append(Guess("unit of time", layout.units["time"], "as the caller says", 1.0, {"units": layout.units}))
        return times(raw, unit_factor("time", "rates", layout)), layout
    if stated is not None:
        guesses.append(Guess("unit of time", stated, "the heading", 1.0, {"units": {"time": stated}}))
        return times(raw, size(stated)), layout
    return times(raw, size(_unit_of_time(raw, source, guesses))), layout


def _fine(raw: Array, source: str) -> str:
    """What a count of an Xsens's ``SampleTimeFine`` is: 0.1 ms of an MTi, 1 us of a DOT; ms where others write dates there."""
    if EPOCH[0] < raw[0] * 1e-3 < EPOCH[1]:
        return "ms"
    step = float(np.median(np.diff(raw)))
    slow = [
        unit for unit in (TENTH_MS, "us") if FASTEST_FINE * step * size(unit) >= 1.0 >= SLOWEST_FINE * step * size(unit)
    ]
    readings = clock_readings(step, float(raw[0]), slow or (TENTH_MS, "us"))
    return take("unit of time", readings, [{"units": {"time": r.unit}} for r in readings], source, []).unit


def _unit_of_time(raw: Array, source: str, guesses: list[Guess]) -> str:
    if len(raw) < 3:
        return "s"
    steps = np.diff(raw)
    step = float(np.median(steps))
    readings = clock_readings(step, float(raw[0]))
    if step == 1.0 and np.all(steps == 1.0):
        options: list[dict[str, Any]] = [{"units": {"time": "ms"}}, {"rate": "(rows a second)"}]
        raise UnsureError(
            f"{source}: time goes up by 1 in each row: it may be in ms (1000 rows a second) or count the rows",
            options,
            guesses,
        )
    if not readings:
        return "s"
    options = [{"units": {"time": reading.unit}} for reading in readings]
    return take("unit of time", readings, options, source, guesses).unit


def _made(columns: Columns, layout: Layout, rows: int, guesses: list[Guess], counter: str) -> Array:
    """Time of a log without any: the first row's interval ends at ``1 / rate``."""
    rate = layout.rate
    if rate is None:
        interval = interval_of(columns, layout)
        if interval is not None:
            value, name = interval
            rate = 1.0 / (value * unit_factor("time", "rates", layout))
            guesses.append(Guess("rate", f"{rate:g} Hz", f"the interval {name!r}", 1.0, {"rate": rate}))
    if rate is None and (stated := _one_value(columns, FREQUENCIES)) is not None:
        rate = stated[0]
        guesses.append(Guess("rate", f"{rate:g} Hz", f"the rate {stated[1]!r}", 1.0, {"rate": rate}))
    elif rate is None:
        above = rate_above(columns)
        if above is None:
            counted = f": column {counter!r} counts rows or packets" if counter else ""
            raise UsageError(
                f"{columns.path.name}: no time in the log{counted}; name its column (columns: {{time: ...}}) or give the rate"
            )
        rate, line = above
        guesses.append(Guess("rate", f"{rate:g} Hz", f"the line {line!r} above the table", 1.0, {"rate": rate}))
    elif layout.rate is not None:
        guesses.append(Guess("rate", f"{rate:g} Hz", "as the caller says", 1.0, {"rate": rate}))
    return np.arange(1, rows + 1) / rate


def _check_bunches(
    raw: Array, said: str | None, stated: str | None, source: str, guesses: list[Guess], place: Callable[[int], str]
) -> None:
    """Refuse stamps of a computer that read several rows at once, or of few digits: their steps say nothing of the sampling."""
    steps = np.diff(raw)
    if len(steps) < FEWEST or steps.min() < 0.0 or raw[-1] <= raw[0]:
        return
    median, mean = float(np.median(steps)), float(np.mean(steps))
    uneven = float(np.mean((steps > 1.5 * median) | (steps == 0.0)))
    rounded = steps.min() == 0.0 and even_but_for_digits(raw, mean)
    if not rounded and (mean < BUNCHED * median or uneven < BUNCH_SHARE or len(stretches(raw)) > 1):
        return
    if not rounded and rows_are_lost(raw):
        return  # the stamps say where
    unit = 1.0 if said is not None else size(stated) if stated is not None else None
    if unit is None:
        readings = clock_readings(mean, float(raw[0]))
        unit = size(readings[0].unit) if readings else 1.0
    _check_jump(raw, unit, source, place)
    rate = 1.0 / (mean * unit)
    whole = round(rate)
    rate = float(whole) if whole and abs(rate / whole - 1.0) < 0.003 else rate
    if rounded:
        raise UnsureError(
            f"{source}: the stamps have few digits, so that some repeat; {rate:.4g} rows a second come in all; if the sensor "
            "samples evenly, give its rate", [{"rate": f"{rate:.4g}"}], guesses,
        )  # fmt: skip
    by_median = "many are equal" if median == 0.0 else f"the median step is one of {1.0 / (median * unit):.0f} Hz"
    raise UnsureError(
        f"{source}: the rows are stamped in bunches: {by_median}, but {rate:.4g} rows a second come in all; if the sensor "
        "samples evenly, give its rate", [{"rate": f"{rate:.4g}"}], guesses,
    )  # fmt: skip


def _check_jump(raw: Array, unit: float, source: str, place: Callable[[int], str]) -> None:
    """Refuse stamps that jump where their rate is asked for or given: neither the rows before nor those behind have it."""
    found = jump_of(raw) if len(raw) > FEWEST else None
    if found is not None:
        row, rest = found
        raise DataError(
            f"{source}: {place(row + 1)}: the stamps jump by {(raw[row + 1] - raw[row]) * unit:.4g} s, while without that "
            f"{1.0 / (rest * unit):.4g} rows a second come; expected rows of one run: keep the rows before or behind, or name "
            "another column of the time"
        )


def _evenly(
    raw: Array,
    said: str | None,
    stated: str | None,
    rate: float,
    source: str,
    guesses: list[Guess],
    place: Callable[[int], str],
) -> Array:
    """Rows at a given rate, from where the stamps begin: no row is stamped before it was taken."""
    found = stretches(raw)
    if len(found) > 1:
        row, ratio = found[1].first + 1, found[1].pace / found[0].pace
        raise DataError(
            f"{source}: from row {row} on the steps of the stamps are {ratio:.3g} times as long as before: the rate of the rows "
            f"changes; expected one rate where a rate is given ({rate:g} Hz): leave it out, the stamps are followed then"
        )
    steps = float(raw[-1] - raw[0]) / (len(raw) - 1)
    if said is None and stated is None:
        stated = min(("s", "ms", "us", "ns"), key=lambda unit: abs(np.log(steps * size(unit) * rate)))
    stamps = raw * (1.0 if said is not None or stated is None else size(stated))
    _check_jump(stamps, 1.0, source, place)
    even = np.arange(len(raw)) / rate
    span = float(stamps[-1] - stamps[0])
    if abs(span / even[-1] - 1.0) > SPAN:
        raise DataError(
            f"{source}: {len(raw)} rows at {rate:g} Hz last {even[-1]:.6g} s, their stamps span {span:.6g} s; expected the same: "
            f"rows are missing, or the rate is {(len(raw) - 1) / span:.6g} Hz"
        )
    guesses.append(
        Guess("time", f"even, {rate:g} Hz", "the rate is given: stamps give only the start", 1.0, {"rate": rate})
    )
    return even + float(np.min(stamps - even))


def rate_above(columns: Columns) -> tuple[float, str] | None:
    """The sampling rate that a line above the table names, and the line."""
    for line in columns.above:
        match = RATE_LINE.search(line.strip())
        if match is not None and float(match[1]) > 0.0:
            return float(match[1]), line.strip()
    return None


def _one_value(columns: Columns, candidates: Sequence[str]) -> tuple[float, str] | None:
    """The positive value that a variable of one value holds, and its name."""
    for name in candidates:
        if name in columns.names:
            values = columns.read([name], False)
            if values.size == 1 and 0.0 < values.item() < np.inf:
                return float(values.item()), name
    return None


def interval_of(columns: Columns, layout: Layout) -> tuple[float, str] | None:
    """The sampling interval that a variable of one value holds, and its name."""
    names: Mapping[str, str] = layout.columns
    if "interval" not in names:
        return _one_value(columns, INTERVALS)
    name = names["interval"]
    if name not in columns.names:
        raise missing_column(columns, "interval", name)
    found = _one_value(columns, [name])
    if found is None:
        values = columns.read([name], False)
        raise DataError(f"{columns.path.name}: interval {name!r} is {values[:3, 0]}; expected one positive time")
    return found
