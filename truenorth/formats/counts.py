"""How large one count of a log is, and which program wrote it in which units, where lines above its table say so.

- Gyroflow's ``.gcsv``: ``gscale`` in rad/s, ``ascale`` in g, ``tscale`` in s.
- The table of Betaflight's and iNAV's explorer of flight logs: ``acc_1G``, the counts of gravity.
- Xsens's MT Manager writes remarks (``// Start Time``, ``// Sample rate``, ``// Firmware Version``) above columns ``Acc_X`` ..
  ``Gyr_X`` ..; its gyros are in rad/s. The app of an Xsens DOT has other lines there, and deg/s.

Source: Gyroflow, documentation of its log format; Betaflight, ``blackbox.c``; Xsens, MT Manager User Manual, MT0216P.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

SCALES = {"gscale": ("gyro", "rad/s"), "ascale": ("accel", "g"), "tscale": ("time", "s")}
ORIENTATION = re.compile(r'\W*orientation"?\s*[,;:=\t ]\s*"?([XYZxyz]{3})"?\W*', re.IGNORECASE)
MT_MANAGER = re.compile(
    r"\s*//\s*(?:mt manager|xda) version\b|\s*//\s*(?:start time|firmware version)\s*:", re.IGNORECASE
)
LINE = re.compile(r'\W*(gscale|ascale|tscale|acc_1g)"?\s*[,;:=\t ]\s*"?([\d.]+(?:e[+-]?\d+)?)"?\W*', re.IGNORECASE)


def counts_above(above: Sequence[str]) -> dict[str, str]:
    """Units of ``gyro``, ``accel`` and ``time``, such as ``0.000488281 g``, that the lines above a table name."""
    found: dict[str, str] = {}
    for line in above:
        match = LINE.fullmatch(line.strip())
        if match is None or not float(match[2]) > 0.0:
            continue
        if match[1].lower() == "acc_1g":
            found["accel"] = f"{1.0 / float(match[2]):.9g} g"
        else:
            sensor, unit = SCALES[match[1].lower()]
            found[sensor] = f"{float(match[2]):.9g} {unit}"
    return found


def orientation_above(above: Sequence[str]) -> str | None:
    """How Gyroflow's log says that its sensor sits in the camera, such as ``YxZ``: small letters turn a sign; None: it does not.

    The camera's axes are no vehicle's. What is read are the sensor's own axes, and a note says so.
    """
    found = (ORIENTATION.fullmatch(line.strip()) for line in above)
    return next((match[1] for match in found if match is not None and set(match[1].lower()) == set("xyz")), None)


def device_above(above: Sequence[str], gyros: Sequence[str]) -> dict[str, tuple[str, str]]:
    """Unit of the ``gyro``, and why, that what wrote a log always writes, by the lines above its table."""
    if tuple(gyros) == ("Gyr_X", "Gyr_Y", "Gyr_Z") and any(MT_MANAGER.match(line) for line in above):
        return {"gyro": ("rad/s", "by the lines above the table Xsens's MT Manager wrote it, in rad/s")}
    return {}
