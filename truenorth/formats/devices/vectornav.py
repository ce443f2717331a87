"""VectorNav's ASCII messages: VNDTV, VNIMU, VNMAR, VNYMR or VNQMR (IMU), VNGPS (receiver), VNINS (solution).

A message is ``$VNIMU,x,y,...*66``: its fields, and the exclusive or of what stands between ``$`` and ``*``. Of the IMU's
messages the first of that list is taken: increments, rates that the device has not compensated, then those that it has. Only
VNDTV tells time, as the sum of its intervals; for the others `rate` makes it (40 Hz as delivered), so that no message may be
missing: a damaged one within the log is an error. Axes FRD.

Source: VectorNav, "VN-200 User Manual", UM004, section 5 and 7 (ASCII messages).
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from functools import reduce
from operator import xor
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from truenorth.core.errors import DataError

Array = NDArray[np.float64]

EXTRA = ""  # no decoder is needed
AXES = "FRD"
RATES = {"VNIMU": (6, 3), "VNMAR": (6, 3), "VNYMR": (9, 6), "VNQMR": (10, 7)}  # first fields of gyros, accelerometers
FIELD = {"VNMAR": 0, "VNYMR": 3, "VNQMR": 4, "VNIMU": 0}  # of the magnetometer, gauss; compensated first
STEPS, FIXES, SOLUTION = "VNDTV", "VNGPS", "VNINS"
LENGTH = {"VNIMU": 11, "VNMAR": 9, "VNYMR": 12, "VNQMR": 13, STEPS: 7, FIXES: 15, SOLUTION: 15}
MODE = 2  # field of VNGPS: 0 and 1 are no fix
STATUS = 2  # field of VNINS: bits, in hexadecimal digits


def tables(path: Path, part: str, topic: str | None = None) -> dict[str, dict[str, Array]]:
    """What each kind of message holds.

    Raises
    ------
    DataError
        A wrong sum, too few fields, a field that is no number, with its line; the last line may be cut.
    """
    rows = _rows(path)
    return {"imu": _imu(rows), "mag": _field(rows), "gnss": _fixes(rows), "poses": _solution(rows)}


def _rows(path: Path) -> dict[str, Array]:
    """Numbers of the messages of each kind, (N, fields)."""
    found: dict[str, list[list[float]]] = defaultdict(list)
    lines = path.read_bytes().splitlines(keepends=True)
    for number, line in enumerate(lines, 1):
        start = line.find(b"$VN")
        body, star, check = line[start + 1 :].strip().partition(b"*")
        cells = body.decode("ascii", "replace").split(",")
        if start < 0 or cells[0] not in LENGTH:
            continue
        if number == len(lines) and not line.endswith((b"\n", b"\r")):
            break
        said = f"{path.name}: line {number}: {cells[0]}"
        expected = f"{reduce(xor, body):02X}"
        if not star or (len(check) == 2 and check.decode("ascii", "replace").upper() != expected):
            raise DataError(
                f"{said} with checksum {check.decode(errors='replace')!r}; expected {expected}: the message is damaged"
            )
        if len(cells) - 1 < LENGTH[cells[0]]:
            raise DataError(f"{said} with {len(cells) - 1} fields; expected {LENGTH[cells[0]]}: the message is damaged")
        found[cells[0]].append(_numbers(said, cells))
    return {kind: np.array(values) for kind, values in found.items()}


def _numbers(said: str, cells: Sequence[str]) -> list[float]:
    numbers = []
    for i, cell in enumerate(cells[1 : LENGTH[cells[0]] + 1]):
        try:
            numbers.append(float(int(cell, 16)) if (cells[0], i) == (SOLUTION, STATUS) else float(cell))
        except ValueError:
            raise DataError(f"{said}, field {i + 1}: {cell!r}; expected a number: the message is damaged") from None
    return numbers


def _imu(rows: dict[str, Array]) -> dict[str, Array]:
    if STEPS in rows:
        steps = rows[STEPS]
        table = {"time [s]": np.cumsum(steps[:, 0])}
        table |= {f"dtheta_{x} [deg]": steps[:, 1 + i] for i, x in enumerate("xyz")}
        return table | {f"dvel_{x} [m/s]": steps[:, 4 + i] for i, x in enumerate("xyz")}
    kind = next((name for name in RATES if name in rows), None)
    if kind is None:
        return {}
    gyro, accel = RATES[kind]
    table = {f"gyro_{x} [rad/s]": rows[kind][:, gyro + i] for i, x in enumerate("xyz")}
    return table | {f"accel_{x} [m/s^2]": rows[kind][:, accel + i] for i, x in enumerate("xyz")}


def _field(rows: dict[str, Array]) -> dict[str, Array]:
    kind = next((name for name in FIELD if name in rows), None)
    return {} if kind is None else {f"mag_{x} [gauss]": rows[kind][:, FIELD[kind] + i] for i, x in enumerate("xyz")}


def _fixes(rows: dict[str, Array]) -> dict[str, Array]:
    """Time of week, place, velocity and their sigmas, where there is a fix."""
    if FIXES not in rows:
        return {}
    fixed = rows[FIXES][rows[FIXES][:, MODE] >= 2]
    names = "time [s]", "", "", "", "lat [deg]", "lon [deg]", "alt [m]", "VN [m/s]", "VE [m/s]", "VD [m/s]", \
        "sigma_N [m]", "sigma_E [m]", "sigma_U [m]", "sigma_VN [m/s]"  # fmt: skip
    table = {name: fixed[:, i] for i, name in enumerate(names) if name}
    return table | {f"sigma_V{axis} [m/s]": fixed[:, 13] for axis in "EU"}


def _solution(rows: dict[str, Array]) -> dict[str, Array]:
    if SOLUTION not in rows:
        return {}
    names = "time [s]", "", "", "heading [deg]", "pitch [deg]", "roll [deg]", "lat [deg]", "lon [deg]", "alt [m]", \
        "VN [m/s]", "VE [m/s]", "VD [m/s]"  # fmt: skip
    table = {name: rows[SOLUTION][:, i] for i, name in enumerate(names) if name}
    angles = {f"sigma_{angle} [deg]": rows[SOLUTION][:, 12] for angle in ("heading", "pitch", "roll")}
    return table | angles | {f"sigma_V{axis} [m/s]": rows[SOLUTION][:, 14] for axis in "ENU"}
