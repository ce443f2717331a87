"""Live alignment: share of a core at 1 kHz, latency of a row to the answer, memory over a day.

python -m benchmarks live [--hours 24]
"""

from __future__ import annotations

import argparse
import resource
import time

import numpy as np

from truenorth.core.position import Position
from truenorth.live import Aligner
from truenorth.records.specs import imu_spec
from truenorth.simulation import rest, simulate

PLACE = Position.from_degrees(45.0, 10.0)


def share_of_a_core(seconds: float = 120.0, rate: float = 1000.0) -> None:
    """Rows of a 1 kHz IMU pushed one by one in real time."""
    record = simulate(rest(PLACE, 0.7), rate=rate, duration=seconds, imu=imu_spec("navigation"), seed=1).record
    waits, own = np.empty(len(record)), np.empty(len(record))
    with Aligner(PLACE, "navigation", kind=record.kind) as aligner:
        begun, cpu = time.monotonic(), time.process_time()
        for i in range(len(record)):
            due = begun + (i + 1) / rate
            time.sleep(max(0.0, due - time.monotonic()))
            began = time.thread_time()
            aligner.push(record.time[i], record.gyro[i], record.accel[i])
            if i % 100 == 99:
                _ = aligner.answer
            waits[i], own[i] = time.monotonic() - due, time.thread_time() - began
        cpu, wall = time.process_time() - cpu, time.monotonic() - begun
    after, own = waits[int(60 * rate) :], own[int(60 * rate) :]
    print(
        f"{rate:g} Hz for {seconds:g} s: {100 * cpu / wall:.0f} % of a core, {aligner.solutions} solutions; row to answer, after "
        f"the first minute: median {1e3 * np.median(after):.2f} ms, 99 % {1e3 * np.quantile(after, 0.99):.1f} ms, "
        f"largest {1e3 * after.max():.0f} ms; of that our own work {1e3 * np.quantile(own, 0.99):.1f} ms at 99 %, largest "
        f"{1e3 * own.max():.0f} ms"
    )


def memory(hours: float, rate: float = 100.0) -> None:
    """A day of rows, as fast as they are taken; the process's peak memory."""
    bias, noise = np.array([1e-8, -1e-8, 5e-9]), np.random.default_rng(0)
    w = 7.292115e-5 * np.array([0.0, np.cos(PLACE.lat), np.sin(PLACE.lat)]) + bias
    block = 1000
    begun = time.monotonic()
    with Aligner(PLACE, "navigation", share=0.5) as aligner:
        for first in range(0, int(hours * 3600 * rate), block):
            times = (first + np.arange(1, block + 1)) / rate
            gyro = w + noise.normal(0.0, 3e-6, (block, 3))
            accel = np.array([0.0, 0.0, 9.8062]) + noise.normal(0.0, 1e-3, (block, 3))
            aligner.push(times, gyro, accel)
        answer = aligner.answer
        merged = aligner.log.merged
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    wall = time.monotonic() - begun
    state = "no answer" if answer is None else answer.status
    print(
        f"{hours:g} h at {rate:g} Hz: {wall:.0f} s ({hours * 3600 / wall:.0f}x), peak {peak:.0f} MiB, rows kept as increments "
        f"over {merged}, {aligner.solutions} solutions, {state}"
    )


def main() -> None:
    """Both figures."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--hours", type=float, default=24.0)
    options.add_argument("--seconds", type=float, default=120.0)
    given, _ = options.parse_known_args()
    if given.seconds:
        share_of_a_core(given.seconds)
    if given.hours:
        memory(given.hours)


if __name__ == "__main__":
    main()
