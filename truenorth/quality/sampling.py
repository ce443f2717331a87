"""Faults of the log itself: clock jitter, gaps, repeated rows, frozen and saturated channels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from truenorth.core.earth import GRAVITY_EQUATOR
from truenorth.core.remembered import remembered
from truenorth.quality.again import Again, rows_again
from truenorth.quality.clipped import PERIOD, ROUNDING, clipped_at, finest, largest, roughness
from truenorth.quality.packets import exchanged_packets
from truenorth.quality.repeats import chance_of_repeat, repeats_of
from truenorth.quality.stuck import stands_alone
from truenorth.records import COLUMNS, ImuRecord
from truenorth.state.limits import limit

Array = NDArray[np.float64]
Severity = Literal["error", "warning", "note"]

NOISELESS = 1e-7  # of the same: noise and quantum of every sensor are larger
FEWEST = 20  # rows that say whether there is noise
FROZEN_TIME = 1.0  # s, and 10 rows: a shorter run of one value is not called frozen
AROUND, WITHIN = 4, 3.0  # stretches to either side that a run is compared with, and their standard deviations


@dataclass(frozen=True)
class Finding:
    """One thing that is wrong, or worth knowing, about a record.

    Parameters
    ----------
    severity : {"error", "warning", "note"}
        An error makes results from the record wrong; a warning may.
    code : str
        Stable name of the kind of finding, such as ``gaps`` or ``accel_unit``.
    message : str
        What was found, what was expected, and what to do.
    """

    severity: Severity
    code: str
    message: str


@dataclass(frozen=True)
class Sampling:
    """Clock and values of a record, as figures."""

    jitter_rms: float  # s; deviation of the steps from the nominal interval, gaps left out
    jitter_max: float  # s
    gap_times: Array  # (g,) s: time after each gap and the length of the step that bridges it
    gap_lengths: Array  # (g,) s
    repeated_rows: int  # rows equal to the row before in all six channels
    longest_runs: NDArray[np.intp]  # (6,): longest run of one value in each channel, rows
    longest_at: NDArray[np.intp]  # (6,): its first row
    saturated_rows: NDArray[np.intp]  # (6,): rows at a clipped extreme of each channel; 0 where nothing is clipped


@remembered
def check_sampling(record: ImuRecord) -> tuple[Sampling, list[Finding]]:
    """Look for faults of clock, logging and range.

    Returns
    -------
    sampling : Sampling
    findings : list of Finding
    """
    findings: list[Finding] = []
    jitter_rms, jitter_max = _clock(record, findings)
    data = [*record.gyro.T, *record.accel.T]  # one after the other: of a long log all six at once are much memory
    exchanged = _exchanged(record, data)
    same = np.array([x[1:] == x[:-1] for x in data])
    repeats: list[Finding] = []
    repeated = _repeated(record, same, repeats)
    # Of a simulation at rest rows are equal where rounding lets them be.
    findings += [] if repeats and _without_noise(data, same) else repeats
    findings += exchanged
    found: list[Finding] = []
    runs, at = _frozen(record, data, same, found)
    saturated = _saturated(record, data, found)
    if any(finding.code in ("frozen", "saturated") for finding in found) and _without_noise(data, same):
        saturated[:] = 0
        found = [
            Finding("note", "no_noise", "no channel has noise; expected a sensor's: the log is simulated without it")
        ]
    elif (again := rows_again(record)) is not None and not _without_noise(data, same):
        findings.append(_again(record, again))
    findings += found
    gaps = record.gaps
    sampling = Sampling(jitter_rms, jitter_max, record.time[gaps], record.steps[gaps], repeated, runs, at, saturated)
    return sampling, findings


def _clock(record: ImuRecord, findings: list[Finding]) -> tuple[float, float]:
    regular = np.delete(record.steps, record.gaps) - record.interval
    rms, largest = float(np.sqrt(np.mean(regular**2))), float(np.max(np.abs(regular)))
    gaps = record.gaps
    if gaps.size:
        longest = gaps[np.argmax(record.steps[gaps])]
        lost = float(np.sum(record.steps[gaps] - record.interval))
        findings.append(
            Finding(
                "warning",
                "gaps",
                f"{gaps.size} gap(s), {lost:.3g} s lost in all, the longest of {record.steps[longest]:.3g} s before "
                f"row {longest + 1} (t = {record.time[longest]:.3f} s); expected a row every "
                f"{record.interval:.4g} s: use a stretch without gaps (`record.between`), or repair the log",
            )
        )
    if rms > limit("jitter") * record.interval:
        findings.append(
            Finding(
                "warning",
                "jitter",
                f"the time steps scatter by {rms * 1e3:.3g} ms RMS ({largest * 1e3:.3g} ms at most) about "
                f"{record.interval * 1e3:.4g} ms; expected a steady clock: if the sensor samples evenly and the "
                "computer stamped the rows, give the sensor's rate instead (`rate`)",
            )
        )
    elif rms > limit("slight jitter") * record.interval:
        text = f"the time steps scatter by {rms * 1e3:.3g} ms RMS about {record.interval * 1e3:.4g} ms"
        findings.append(Finding("note", "jitter", text))
    if (record.interval >= 1.0 or record.interval < 2e-5) and not _weighs(record):
        guess = "milliseconds or ticks" if record.interval >= 1.0 else "another unit"
        findings.append(
            Finding(
                "warning",
                "time_unit",
                f"a row every {record.interval:.4g} s; expected more than 1 and up to 10,000 rows a second: time is probably in "
                f"{guess}; convert it to seconds or give `rate`",
            )
        )
    return rms, largest


def _weighs(record: ImuRecord) -> bool:
    """Whether increments of velocity are those of gravity over the time that the stamps say: it is in seconds then."""
    if record.kind != "increments":
        return False
    force = float(np.median(np.linalg.norm(record.accel[1:] / record.steps[1:, None], axis=1)))
    return 0.5 < force / GRAVITY_EQUATOR < 2.0


def _again(record: ImuRecord, again: Again) -> Finding:
    first, second = (
        f"{row + 1} to {row + again.length} (from {record.time[row]:.3f} s on)" for row in (again.first, again.again)
    )
    return Finding(
        "error",
        "rows_again",
        f"rows {second} are rows {first} to the last digit; expected new noise in each row: a piece of the log was written "
        "twice; take one of them",
    )


def _repeated(record: ImuRecord, same: NDArray[np.bool_], findings: list[Finding]) -> int:
    repeated, beyond = repeats_of(same)
    if beyond:
        share = 100.0 * beyond
        findings.append(
            Finding(
                "warning" if share > 5.0 else "note",
                "repeated_rows",
                f"{repeated} rows ({share:.1f} %, more than chance gives) repeat the row before in all six channels; "
                "expected new values in each row: the log may be written faster than the sensor samples; log at the sensor's rate",
            )
        )
    return repeated


def _exchanged(record: ImuRecord, data: Sequence[Array]) -> list[Finding]:
    packets = exchanged_packets(data)
    if packets is None:
        return []
    length, first = packets.length, int(packets.rows[0])
    share = 2.0 * length * len(packets.rows) / len(record)
    return [
        Finding(
            "error" if share > limit("exchanged rows") else "warning",
            "reordered_rows",
            f"packets of {length} row(s) have changed places with the next at {len(packets.rows)} places at least, first "
            f"before row {first + 1} (t = {record.time[first]:.3f} s): exchanged back the log is smooth there; expected rows in "
            "the order in which they were measured: order them by the sensor's own counter or clock",
        )
    ]


def _frozen(
    record: ImuRecord, data: Sequence[Array], same: NDArray[np.bool_], findings: list[Finding]
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Longest run of each channel and where it begins; a finding where chance does not explain it."""
    chance = np.minimum(chance_of_repeat(same), 0.98)
    by_chance = np.log(len(record)) / -np.log(np.maximum(chance, 1e-3))
    runs, at = np.empty(6, dtype=np.intp), np.empty(6, dtype=np.intp)
    for channel, name in enumerate(COLUMNS[record.kind]):
        runs[channel], first = _longest_run(same[channel])
        at[channel] = first
        least = max(10.0, FROZEN_TIME / record.interval)
        alone = runs[channel] > least and stands_alone(data, same, channel, first, int(runs[channel]))
        most = least if alone else max(least, limit("frozen") * by_chance[channel])
        if runs[channel] == len(record):
            dead = _is_dead(data, channel)
            # Where the other sensor has noise, no simulation without noise made the log.
            coarse = not dead and min(map(np.ptp, data[3:] if channel < 3 else data[:3])) > 0.0
            findings.append(
                Finding(
                    "error" if dead else "warning" if coarse else "note",
                    "constant_channel" if dead else "no_noise",
                    f"{name} is {data[channel][0]:g} in all {len(record)} rows; expected a sensor's noise: the "
                    + ("channel is dead or not connected" if dead else "log is simulated without noise, or coarse"),
                )
            )
        elif runs[channel] > most and (
            alone or chance[channel] < limit("coarse") or _loses(data[channel], first, int(runs[channel]))
        ):
            findings.append(
                Finding(
                    "warning",
                    "frozen",
                    f"{name} stays at {data[channel][first]:g} for {runs[channel]} rows from row {first + 1} "
                    f"(t = {record.time[first]:.3f} s); expected at most about {most:.0f} equal values: the sensor "
                    "or the log was stuck; leave this stretch out",
                )
            )
    return runs, at


def _loses(values: Array, first: int, rows: int) -> bool:
    """Whether a run of one value adds up to what the stretches of its length before and behind it do not.

    A coarse sensor that carries its remainders on stays at one count for long where that is its mean.
    """
    behind = values[first + rows :]
    stretches = np.concatenate(
        [part[: len(part) // rows * rows].reshape(-1, rows)[:AROUND] for part in (values[:first][::-1], behind)]
    )
    if not len(stretches):
        return True
    sums = stretches.sum(axis=1)
    expected = PERIOD * finest(stretches) + WITHIN * float(np.std(sums))
    return not abs(rows * float(values[first]) - float(sums.mean())) <= expected


def _longest_run(same: NDArray[np.bool_]) -> tuple[int, int]:
    """How many rows the longest run of one value has, and its first row; `same`: of the rows that repeat the one before."""
    repeats = np.flatnonzero(same)  # few, as a rule
    if not repeats.size:
        return 1, 0
    starts = np.append(0, np.flatnonzero(np.diff(repeats) > 1) + 1)
    lengths = np.diff(np.append(starts, len(repeats)))
    longest = int(np.argmax(lengths))
    return int(lengths[longest]) + 1, int(repeats[starts[longest]])


def _without_noise(data: Sequence[Array], same: NDArray[np.bool_]) -> bool:
    """Whether a simulation without noise made the log: values that stay, and that follow a line where they do not.

    A sensor or a log that is stuck for a while has noise elsewhere, in these channels or in others; a coarse quantum, which may
    hide the noise of a sensor at rest, shows in its steps.
    """
    changes: NDArray[np.bool_] = ~np.asarray(same.all(axis=0))
    inside = changes[1:] & changes[:-1]
    if np.count_nonzero(inside) < FEWEST:
        return False
    size = np.repeat([largest(data[:3]), largest(data[3:])], 3)
    rough = np.array([np.median(roughness(x)[inside], overwrite_input=True) for x in data])
    steps = (np.abs(np.diff(x)) for x in data)
    smallest = np.array([np.min(step, initial=np.inf, where=step > 0.0) for step in steps])
    return bool(np.all(rough <= NOISELESS * size) and np.any(smallest <= NOISELESS * size))


def _is_dead(data: Sequence[Array], channel: int) -> bool:
    """Whether a constant channel is dead: its sensor's other channels have noise, or all three are zero.

    Where none of the three has noise beyond rounding, the log comes from a simulation without noise.
    """
    sensor = data[:3] if channel < 3 else data[3:]
    size = largest(sensor)
    return size == 0.0 or bool(max(np.ptp(x) for x in sensor) > ROUNDING * size)


def _saturated(record: ImuRecord, data: Sequence[Array], findings: list[Finding]) -> NDArray[np.intp]:
    """Rows of each channel at which it is clipped."""
    rows = np.zeros(6, dtype=np.intp)
    unit = ("rad/s", "m/s^2") if record.kind == "rates" else ("rad a row", "m/s a row")
    for channel, name in enumerate(COLUMNS[record.kind]):
        for extreme in clipped_at(data[channel]):
            rows[channel] += extreme.rows
            findings.append(
                Finding(
                    "error",
                    "saturated",
                    f"{name} stands at its extreme {extreme.value:.4g} {unit[channel // 3]} in {extreme.rows} rows (the "
                    f"next value inside in {extreme.inside}); expected a tail that thins out: the sensor's range is "
                    "exceeded; use a sensor of larger range or leave this stretch out",
                )
            )
    return rows
