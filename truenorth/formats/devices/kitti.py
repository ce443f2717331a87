"""KITTI raw data: a folder ``oxts`` with ``timestamps.txt`` and one file of thirty numbers for each sample in ``data``.

An OXTS RT3003: rates and specific forces of the vehicle's axes (front, left, up), and the system's own solution, which stands for
a receiver (``gnss``) and for a master (``poses``). Its yaw counts from east to north, its pitch is positive where the nose points
down. The unsynchronised sets hold 100 rows a second, the synchronised ones 10, too few for an IMU that turns.

Source: A. Geiger et al., "Vision meets Robotics: The KITTI Dataset", IJRR 2013; its development kit, ``dataformat.txt``.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from truenorth.core.errors import DataError

Array = NDArray[np.float64]

EXTRA = ""  # no decoder is needed
AXES = "FLU"
CLOCK, ROWS = "timestamps.txt", "data"
NUMBERS = 30
ANGLES, VELOCITY, UP, FORCE, RATE, ACCURACY = (
    3,
    6,
    10,
    11,
    17,
    23,
)  # first numbers of: roll, vn, vu, ax, wx, pos_accuracy
EPOCH = np.datetime64("1970-01-01T00:00:00", "ns")


def tables(path: Path, part: str, topic: str | None = None) -> dict[str, dict[str, Array]]:
    """Rates and specific forces; the solution's place and velocity; and with its attitude.

    Raises
    ------
    DataError
        A stamp that is no date, a file without thirty numbers, another number of files than of stamps.
    """
    time = _times(path / CLOCK)
    files = sorted((path / ROWS).glob("*.txt"))
    if len(files) != len(time):
        raise DataError(
            f"{path.name}: {len(files)} files in {ROWS} and {len(time)} stamps in {CLOCK}; expected as many"
        )
    rows = np.array([_numbers(file) for file in files]).reshape(-1, NUMBERS)
    clock = {"time [s]": time}
    place = {name: rows[:, i] for i, name in enumerate(("lat [deg]", "lon [deg]", "alt [m]"))}
    velocity = {"VN [m/s]": rows[:, VELOCITY], "VE [m/s]": rows[:, VELOCITY + 1], "VU [m/s]": rows[:, UP]}
    roll, pitch, yaw = rows[:, ANGLES : ANGLES + 3].T
    attitude = {"heading [rad]": np.mod(np.pi / 2.0 - yaw, 2.0 * np.pi), "pitch [rad]": -pitch, "roll [rad]": roll}
    sigma = {f"sigma_{axis} [m]": rows[:, ACCURACY] for axis in "ENU"}
    sigma |= {f"sigma_V{axis} [m/s]": rows[:, ACCURACY + 1] for axis in "ENU"}
    return {
        "imu": clock
        | {f"gyro_{x} [rad/s]": rows[:, RATE + i] for i, x in enumerate("xyz")}
        | {f"accel_{x} [m/s^2]": rows[:, FORCE + i] for i, x in enumerate("xyz")},
        "gnss": clock | place | velocity | sigma,
        "poses": clock | place | velocity | attitude,
    }


def _times(path: Path) -> Array:
    """Seconds since 1970 of the stamps, UTC."""
    stamps = path.read_text(encoding="ascii", errors="replace").split("\n")
    found = []
    for number, stamp in enumerate(stamps, 1):
        if not stamp.strip():
            continue
        try:
            found.append(np.datetime64(stamp.strip().replace(" ", "T"), "ns"))
        except ValueError:
            raise DataError(
                f"{path.name}: line {number}: {stamp.strip()!r}; expected a date and a time such as 2011-09-26 13:02:25.96"
            ) from None
    return np.asarray((np.array(found, dtype="datetime64[ns]") - EPOCH).astype(np.int64) * 1e-9, dtype=np.float64)


def _numbers(path: Path) -> list[float]:
    cells = path.read_text(encoding="ascii", errors="replace").split()
    try:
        numbers = [float(cell) for cell in cells]
    except ValueError:
        numbers = []
    if len(numbers) != NUMBERS:
        raise DataError(f"{path.name}: {len(cells)} cells, of them numbers {len(numbers)}; expected {NUMBERS} numbers")
    return numbers
