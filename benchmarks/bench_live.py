"""Live alignment: share of a core at 1 kHz, latency of a row to the answer, speed and memory of a day that is replayed.

python -m benchmarks.bench_live [--hours 24] [--seconds 120]

Speeds and latencies by the wall clock are those of a machine that does nothing else; CPU times depend less on that.
"""

from __future__ import annotations

import argparse
import os
import resource
import time

import numpy as np
from numpy.typing import NDArray

from truenorth.core.position import Position
from truenorth.live import Aligner
from truenorth.records.specs import imu_spec
from truenorth.simulation import rest, simulate

PLACE = Position.from_degrees(45.0, 10.0)
ANSWER = 100  # rows between two answers


def share_of_a_core(seconds: float = 120.0, rate: float = 1000.0) -> None:
    """Rows of a 1 kHz IMU pushed one by one in real time."""
    record = simulate(rest(PLACE, 0.7), rate=rate, duration=seconds, imu=imu_spec("navigation"), seed=1).record
    waits, own = np.empty(len(record)), np.empty(len(record))
    asked = np.arange(len(record)) % ANSWER == ANSWER - 1
    with Aligner(PLACE, "navigation", kind=record.kind) as aligner:
        begun, cpu = time.monotonic(), time.process_time()
        for i in range(len(record)):
            due = begun + (i + 1) / rate
            time.sleep(max(0.0, due - time.monotonic()))
            began = time.thread_time()
            aligner.push(record.time[i], record.gyro[i], record.accel[i])
            if asked[i]:
                _ = aligner.answer
            waits[i], own[i] = time.monotonic() - due, time.thread_time() - began
        cpu, wall = time.process_time() - cpu, time.monotonic() - begun
    print(
        f"{rate:g} Hz for {seconds:g} s: {100 * cpu / wall:.0f} % of a core, {aligner.solutions} solutions; load {_load()}"
    )
    late = np.arange(len(record)) >= min(60.0, 0.5 * seconds) * rate  # compiled code is loaded by then
    for what, rows in (("each row", late), ("row to the answer that holds it", late & asked)):
        print(
            f"  {what}: wall median {_ms(waits[rows], 0.5)}, 99 % {_ms(waits[rows], 0.99)}, largest {_ms(waits[rows], 1.0)}; "
            f"CPU median {_ms(own[rows], 0.5)}, 99 % {_ms(own[rows], 0.99)}, largest {_ms(own[rows], 1.0)}"
        )


def _ms(seconds: NDArray[np.float64], part: float) -> str:
    return f"{1e3 * np.quantile(seconds, part):.2f} ms"


def _load() -> str:
    """Other work on this machine, as the mean number of programs that wanted a core."""
    return f"{os.getloadavg()[0]:.1f} on {os.cpu_count()} cores"


def memory(hours: float, rate: float = 100.0) -> None:
    """A day of rows, as fast as they are taken, an answer each second; the process's peak memory."""
    bias, noise = np.array([1e-8, -1e-8, 5e-9]), np.random.default_rng(0)
    w = 7.292115e-5 * np.array([0.0, np.cos(PLACE.lat), np.sin(PLACE.lat)]) + bias
    block = 1000
    begun, cpu, due = time.monotonic(), time.process_time(), 0.0
    with Aligner(PLACE, "navigation") as aligner:
        for first in range(0, int(hours * 3600 * rate), block):
            times = (first + np.arange(1, block + 1)) / rate
            gyro = w + noise.normal(0.0, 3e-6, (block, 3))
            accel = np.array([0.0, 0.0, 9.8062]) + noise.normal(0.0, 1e-3, (block, 3))
            aligner.push(times, gyro, accel)
            if time.monotonic() > due:
                _, due = aligner.answer, time.monotonic() + 1.0
        answer = aligner.answer
        merged = aligner.log.merged
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    wall, cpu = time.monotonic() - begun, time.process_time() - cpu
    state = "no answer" if answer is None else answer.status
    print(
        f"{hours:g} h at {rate:g} Hz: {wall:.0f} s ({hours * 3600 / wall:.0f}x) by the clock, {cpu:.0f} s "
        f"({hours * 3600 / cpu:.0f}x) of CPU, load {_load()}; peak {peak:.0f} MiB, rows kept as increments over {merged}, "
        f"{aligner.solutions} solutions, {state}"
    )


def main() -> None:
    """All figures; memory first, since what the other holds would count."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--hours", type=float, default=24.0)
    options.add_argument("--seconds", type=float, default=120.0)
    given, _ = options.parse_known_args()
    if given.hours:
        memory(given.hours)
    if given.seconds:
        share_of_a_core(given.seconds)


if __name__ == "__main__":
    main()
