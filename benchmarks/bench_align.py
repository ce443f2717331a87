"""Whole-process CPU time of `truenorth align` on 900 s at 100 Hz: interpreter, imports, reading, aligning; no report."""

from __future__ import annotations

import resource
import subprocess
import sys
import tempfile
from pathlib import Path

from truenorth.core.position import Position
from truenorth.formats import write_imu
from truenorth.records.specs import imu_spec
from truenorth.simulation import rest, simulate

RUNS = 5


def main() -> None:
    """Print the median over five warm runs for each file format, with and without a specification."""
    program = str(Path(sys.executable).with_name("truenorth"))
    place = Position.from_degrees(40.0, 118.0)
    record = simulate(rest(place, 0.6), rate=100.0, duration=900.0, imu=imu_spec("navigation")).record
    with tempfile.TemporaryDirectory() as folder:
        for suffix in ("csv", "npz"):
            log = Path(folder) / f"log.{suffix}"
            write_imu(record, log)
            for extra in ([], ["--imu", "navigation"]):
                command = [program, "align", str(log), "--lat", "40", "--lon", "118", "--json", *extra]
                times = sorted(_cpu(command) for _ in range(RUNS + 1))
                print(f"align {log.name} {' '.join(extra) or 'no specification':20} {times[RUNS // 2]:.2f} s CPU")


def _cpu(command: list[str]) -> float:
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


if __name__ == "__main__":
    main()
