"""A log of days on a machine with little memory: `align` and `navigate` of 48 h at 200 Hz, each allowed 2 GiB of its own.

The log is made on the disk, at rest, in pieces. Printed are processor time, and the most memory that is a command's own and that is
the mapped file's. Run: ``python -m benchmarks days`` (Linux; 2 GiB of disk twice, minutes).
"""

from __future__ import annotations

import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from truenorth.core.blocks import row_blocks
from truenorth.core.earth import earth_rate_n, normal_gravity
from truenorth.core.mapped import write_mappable

HOURS, RATE, LAT = 48.0, 200.0, 45.0
LIMIT = 2 << 30  # bytes
GYRO, ACCEL = 4e-6, 7e-4  # rad/s and m/s^2: white noise of a row at that rate, of the class navigation


def at_rest(path: Path, rows: int, rate: float = RATE) -> None:
    """Write a log, its arrays on the disk while they are made."""
    rng, wider = np.random.default_rng(1), np.sqrt(rate / RATE)
    files = {name: path.with_name(f"{name}.npy") for name in ("time", "gyro", "accel")}
    arrays = {
        name: np.lib.format.open_memmap(file, "w+", np.float64, (rows, 3) if name != "time" else (rows,))
        for name, file in files.items()
    }
    gravity = np.array([0.0, 0.0, float(normal_gravity(np.radians(LAT), 0.0))])
    for part in row_blocks(rows):
        k = np.arange(part.start, part.stop)
        arrays["time"][part] = (k + 1) / rate
        arrays["gyro"][part] = earth_rate_n(np.radians(LAT)) + wider * GYRO * rng.standard_normal((len(k), 3))
        arrays["accel"][part] = gravity + wider * ACCEL * rng.standard_normal((len(k), 3))
    write_mappable(path, arrays)
    for file in files.values():
        file.unlink()


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
        at_rest(log, round(HOURS * 3600.0 * RATE))
        print(f"  {HOURS:g} h at {RATE:g} Hz, {log.stat().st_size >> 20} MiB on the disk")
        align = ["align", str(log), "--lat", f"{LAT:g}", "--imu", "navigation"]
        for words in (align, [*align, "--to", "1200", "-o", str(start)], ["navigate", str(log), "--start", str(start)]):
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
