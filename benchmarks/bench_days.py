"""Logs of days on a machine with little memory: `align` and `navigate` of 48 h at 200 Hz, each allowed 2 GiB of its own.

The logs are made on the disk, at rest, in pieces: one of noise to the last digit, one of counts, as laser gyros have them. Printed
are processor time, and the most memory that is a command's own and that is the mapped file's. Run: ``python -m benchmarks days``
(Linux; 2 GiB of disk twice, minutes).
"""

from __future__ import annotations

import itertools
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from truenorth.core.blocks import row_blocks
from truenorth.core.earth import earth_rate_n, normal_gravity
from truenorth.core.mapped import write_mappable

Array = NDArray[np.float64]

HOURS, RATE, LAT = 48.0, 200.0, 45.0
LIMIT = 2 << 30  # bytes
COUNTS = {"gyro": np.radians(0.3 / 3600.0), "accel": 2e-5}  # rad, m/s: a count, what is left is counted in the next row
GYRO, ACCEL = 4e-6, 7e-4  # rad/s and m/s^2: white noise of a row at that rate, of the class navigation


def at_rest(path: Path, rows: int, rate: float = RATE, counted: bool = False) -> None:
    """Write a log, its arrays on the disk while they are made."""
    rng, wider = np.random.default_rng(1), np.sqrt(rate / RATE)
    files = {name: path.with_name(f"{name}.npy") for name in ("time", "gyro", "accel")}
    arrays = {
        name: np.lib.format.open_memmap(file, "w+", np.float64, (rows, 3) if name != "time" else (rows,))
        for name, file in files.items()
    }
    mean = {
        "gyro": earth_rate_n(np.radians(LAT)),
        "accel": np.array([0.0, 0.0, float(normal_gravity(np.radians(LAT), 0.0))]),
    }
    left = {name: np.zeros(3) for name in COUNTS}
    for part in row_blocks(rows):
        k = np.arange(part.start, part.stop)
        arrays["time"][part] = (k + 1) / rate
        for name, noise in (("gyro", GYRO), ("accel", ACCEL)):
            values = mean[name] + wider * noise * rng.standard_normal((len(k), 3))
            if counted:
                values, left[name] = in_counts(values / rate, left[name], COUNTS[name])
                values *= rate
            arrays[name][part] = values
    write_mappable(path, arrays)
    for file in files.values():
        file.unlink()


def in_counts(increments: Array, left: Array, count: float) -> tuple[Array, Array]:
    """(N, 3) increments as a counter gives them, which keeps what is left of a count for the next row, and that."""
    sums = np.vstack([left, left + np.cumsum(increments, axis=0)])
    whole = np.floor(sums / count)
    return count * np.diff(whole, axis=0), sums[-1] - count * whole[-1]


def most_memory(process: subprocess.Popen[bytes]) -> dict[str, int]:
    """MiB of anonymous memory and of files, the most of each until a process ends."""
    most = {"RssAnon": 0, "RssFile": 0}
    while process.poll() is None:
        try:
            status = Path(f"/proc/{process.pid}/status").read_text()
        except OSError:
            break
        for line in status.splitlines():
            name, _, value = line.partition(":")
            if name in most:
                most[name] = max(most[name], int(value.split()[0]) >> 10)
        time.sleep(0.05)
    return most


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        log, start = Path(folder) / "log.npz", Path(folder) / "start"
        align = ["align", str(log), "--lat", f"{LAT:g}", "--imu", "navigation"]
        commands = (
            align,
            [*align, "--to", "1200", "-o", str(start), "--force"],
            ["navigate", str(log), "--start", str(start)],
        )
        for counted, words in itertools.product((False, True), commands):
            if words is align:
                at_rest(log, round(HOURS * 3600.0 * RATE), counted=counted)
                kind = "counts" if counted else "noise to the last digit"
                print(f"  {HOURS:g} h at {RATE:g} Hz of {kind}, {log.stat().st_size >> 20} MiB on the disk")
            before = resource.getrusage(resource.RUSAGE_CHILDREN)
            process = subprocess.Popen(
                [sys.executable, "-m", "truenorth", *words],
                stdout=subprocess.DEVNULL,
                preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_DATA, (LIMIT, LIMIT)),
            )
            most = most_memory(process)
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
            said = "done" if process.wait() == 0 else f"ended with {process.returncode}"
            print(f"    {words[0]:9}{said}: {cpu:.0f} s, {most['RssAnon']} MiB its own, {most['RssFile']} MiB of files")


if __name__ == "__main__":
    main()
