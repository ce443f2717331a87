"""Android phones: the text of Google's GnssLogger, and the long table of IMU rows that is made of it (``device_imu.csv``).

A line begins with what it is: ``UncalGyro,utcTimeMillis,elapsedRealtimeNanos,x,y,z,...``. Lines ``# UncalGyro,...`` above them name
the fields; logs of older versions have fewer. Uncalibrated gyros and accelerometers are taken where there are some: the phone
changes the bias that it takes off the calibrated ones in steps, where a constant one is found by an alignment. A magnetometer
has a hard iron of several times the earth's field: the phone's estimate of it is taken off.

The rows are the gyros'. Accelerometers, which the phone samples at other times, are interpolated to them. Time is
``elapsedRealtimeNanos``, the phone's clock since it started, which rows and fixes share; a fix of an older log has UTC alone and
is brought to that clock by the rows, which have both. Where no row has that clock, time is UTC, to a millisecond.

Axes: x right, y to the top of the screen, z out of it: a phone that lies on its back heads with its top.

Source: Google, gps-measurement-tools, GnssLogger's comments in its own logs; Android, SensorEvent and Location.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from truenorth.core.errors import DataError
from truenorth.formats.sensor_folder import at_times

Array = NDArray[np.float64]

EXTRA = ""  # no decoder is needed
AXES = "RFU"
NOTES = {"imu": "rows of the gyros; accelerometers interpolated to them, which takes some of their white noise away"}
GYROS, FORCES = ("UncalGyro", "Gyro"), ("UncalAccel", "Accel")
FIELDS = ("UncalMag", "Mag")
UTC, ELAPSED, FIRST = 0, 1, 2  # fields of a sensor's row: ms, ns, the first value
FIX = ("Provider", "LatitudeDegrees", "LongitudeDegrees", "AltitudeMeters", "SpeedMps", "AccuracyMeters",
       "BearingDegrees", "UnixTimeMillis", "SpeedAccuracyMps", "BearingAccuracyDegrees", "elapsedRealtimeNanos",
       "VerticalAccuracyMeters")  # fmt: skip
OLD = {"Latitude": FIX[1], "Longitude": FIX[2], "Altitude": FIX[3], "Speed": FIX[4], "Accuracy": FIX[5],
       "(UTC)TimeInMs": FIX[7]}  # fmt: skip  # how logs of 2016 to 2020 name them
SATELLITES = "gps"  # the provider that is a receiver; others mix it with networks and with the IMU itself
OF_68 = 1.515  # of a circle that holds 68 % of the errors, in one sigma of an axis

Rows = Sequence[tuple[int, Sequence[str]]]  # the number of a line, and its cells
Lines = Mapping[str, Rows]


def tables(path: Path, part: str, topic: str | None = None) -> dict[str, dict[str, Array]]:
    """Rates and specific forces; positions and velocities of the receiver; the magnetic field.

    Raises
    ------
    DataError
        A field that is no number, with its line.
    """
    lines, named = _lines(path)
    found: dict[str, dict[str, Array]] = {"imu": {}, "mag": {}, "gnss": {}}
    gyros, forces = _sensor(path, lines, GYROS), _sensor(path, lines, FORCES)
    late = _utc_of_clock(gyros)
    if gyros is not None and forces is not None:
        clock = ELAPSED if np.isfinite(gyros[:, ELAPSED]).all() and np.isfinite(forces[:, ELAPSED]).all() else UTC
        found["imu"] = _imu(_in_order(gyros, clock), _in_order(forces, clock), clock)
    field = _sensor(path, lines, FIELDS)
    if field is not None:
        clock = UTC if late is None else ELAPSED
        found["mag"] = {"time [s]": _seconds(field, clock)}
        iron = np.nan_to_num(field[:, FIRST + 3 :])
        found["mag"] |= {f"mag_{x} [uT]": field[:, FIRST + i] - iron[:, i] for i, x in enumerate("xyz")}
    if "Fix" in lines:
        found["gnss"] = _fixes(path, lines["Fix"], named.get("Fix", FIX), late)
    return found


def _lines(path: Path) -> tuple[Lines, dict[str, tuple[str, ...]]]:
    """Cells of the lines of each kind, and the names of their fields as remarks above them say."""
    lines: dict[str, list[tuple[int, Sequence[str]]]] = defaultdict(list)
    named: dict[str, tuple[str, ...]] = {}
    wanted = {*GYROS, *FORCES, *FIELDS, "Fix"}
    with path.open(encoding="utf-8", errors="replace") as file:
        for number, line in enumerate(file, 1):
            cells = [cell.strip() for cell in line.lstrip("#").split(",")]
            if cells[0] not in wanted:
                continue
            if line.startswith("#"):
                named[cells[0]] = tuple(OLD.get(name, name) for name in cells[1:])
            elif line.endswith("\n"):  # a last line that is cut is left out
                lines[cells[0]].append((number, cells[1:]))
    return lines, named


def _sensor(path: Path, lines: Lines, kinds: Sequence[str]) -> Array | None:
    """Times, three values and what the phone says of their biases, of the first kind that is there; (N, 8), NaN where absent."""
    kind = next((name for name in kinds if lines.get(name)), None)
    may_be_empty = (UTC, ELAPSED, *range(FIRST + 3, FIRST + 6))
    return None if kind is None else _numbers(path, kind, lines[kind], range(FIRST + 6), may_be_empty)


def _numbers(path: Path, kind: str, rows: Rows, columns: Sequence[int], empty: Sequence[int] = ()) -> Array:
    """Fields of the lines of a kind; NaN for one that is empty or not there, where it may be."""
    table = np.full((len(rows), len(columns)), np.nan)
    for k, (number, cells) in enumerate(rows):
        for i, column in enumerate(columns):
            cell = cells[column] if column < len(cells) else ""
            if not cell and column in empty:
                continue
            try:
                table[k, i] = float(cell)
            except ValueError:
                raise DataError(
                    f"{path.name}: line {number}: {kind}, field {column + 2}: {cell!r}; expected a number: repair the line"
                ) from None
    return table


def _seconds(rows: Array, clock: int) -> Array:
    return rows[:, clock] * (1e-3 if clock == UTC else 1e-9)


def _in_order(rows: Array, clock: int) -> Array:
    """Rows in order of time; Android hands over batches, in which a row may come twice."""
    _, first = np.unique(rows[:, clock], return_index=True)
    return rows[first]


def _utc_of_clock(rows: Array | None) -> float | None:
    """UTC less the phone's clock, s; None where rows do not have both."""
    if rows is None or not np.isfinite(rows[:, :FIRST]).all():
        return None
    return float(np.median(_seconds(rows, UTC) - _seconds(rows, ELAPSED)))


def _imu(gyros: Array, forces: Array, clock: int) -> dict[str, Array]:
    """Rows of the gyros within the accelerometers' time."""
    time, clocks = _seconds(gyros, clock), _seconds(forces, clock)
    both = (time >= clocks[0]) & (time <= clocks[-1])
    table = {"time [s]": time[both]}
    table |= {f"gyro_{x} [rad/s]": gyros[both, FIRST + i] for i, x in enumerate("xyz")}
    force = at_times(time[both], clocks, forces[:, FIRST : FIRST + 3])
    return table | {f"accel_{x} [m/s^2]": force[:, i] for i, x in enumerate("xyz")}


def _fixes(path: Path, rows: Rows, names: Sequence[str], late: float | None) -> dict[str, Array]:
    """Fixes of the receiver, on the phone's clock where rows of the IMU show it."""
    where = {name: i for i, name in enumerate(names)}
    own = [row for row in rows if row[1][where.get("Provider", 0)].lower() == SATELLITES]
    wanted = [name for name in FIX[1:] if name in where]
    values = _numbers(path, "Fix", own, [where[n] for n in wanted], [where[n] for n in wanted[2:]])
    column = dict(zip(wanted, values.T))
    absent = np.full(len(own), np.nan)
    elapsed = column.get("elapsedRealtimeNanos", absent)
    if late is not None and len(own) and np.all(np.diff(elapsed) > 0.0) and np.isfinite(elapsed).all():
        time = elapsed * 1e-9
    else:
        time = column["UnixTimeMillis"] * 1e-3 - (late or 0.0)
    level = column.get("AccuracyMeters", absent) / OF_68
    table = {
        "time [s]": time,
        "lat [deg]": column["LatitudeDegrees"],
        "lon [deg]": column["LongitudeDegrees"],
        "alt [m]": column.get("AltitudeMeters", absent),
        "speed [m/s]": column.get("SpeedMps", absent),
        "course [deg]": column.get("BearingDegrees", absent),
        "sigma_E [m]": level,
        "sigma_N [m]": level,
        "sigma_U [m]": column.get("VerticalAccuracyMeters", absent),
    }
    speed = column.get("SpeedAccuracyMps", absent)
    if np.isfinite(speed).any():
        table |= {f"sigma_V{axis} [m/s]": speed for axis in "ENU"}
    return {name: values for name, values in table.items() if np.isfinite(values).any()}
