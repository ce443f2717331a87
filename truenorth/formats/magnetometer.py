"""Reader of magnetometers' logs."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from truenorth.core.errors import DataError
from truenorth.formats import devices
from truenorth.formats.aiding import TIME, FilePath, Pairs, made, open_log, turned, whole
from truenorth.formats.detect import AIDING_SUFFIXES, format_of
from truenorth.formats.quantities import Quantity
from truenorth.records.magnetometer import MagnetometerRecord

AXES = tuple(
    Quantity(f"mag_{axis}", "flux_density", "T", (f"m{axis}", f"mag{axis}", f"magn_{axis}", f"field_{axis}"), (), "mag")
    for axis in "xyz"
)
SIZES = {"T": 1.0, "gauss": 1e-4, "uT": 1e-6, "mgauss": 1e-7, "nT": 1e-9}
WEAKEST, STRONGEST = 15e-6, 100e-6  # T, of the earth and what a vehicle adds or takes: less than a decade


def read_magnetometer(
    path: FilePath,
    *,
    format: str | None = None,
    columns: Pairs | None = None,
    units: Pairs | None = None,
    axes: str | None = None,
    topic: str | None = None,
) -> MagnetometerRecord:
    """Read the log of a magnetometer: ``time``, ``mag_x, mag_y, mag_z``.

    Where neither the header nor `units` says in what (T, gauss, uT, mgauss, nT), the size of the earth's field does. Of the logs
    of devices PX4's, ArduPilot's, MAVLink's and ROS bags hold one.

    Parameters
    ----------
    path, format, columns, units
        As for :func:`truenorth.read_odometer`; `units` also ``"mag=uT"``.
    axes : str, optional
        Where x, y and z point, such as ``"FRD"``; when left out those of the device, and RFU in a table.
    topic : str, optional
        Of a ROS bag with several magnetometers.

    Raises
    ------
    UsageError, DataError
        As for :func:`truenorth.read_odometer`; a field that is in no unit the earth's.
    """
    given = {"columns": columns, "units": units, "axes": axes, "topic": topic}
    found, others = open_log(path, format, (TIME, *AXES), given, "mag")
    names = [q.name for q in AXES]
    values = whole(found, *names)
    if values is None:
        raise found.missing("time and mag_x, mag_y, mag_z")
    field = turned(values, others.get("axes") or _axes_of(path, format))
    assert field is not None  # values are there
    typical = float(np.median(np.linalg.norm(field, axis=1)))
    if all(found.factors[name] == 1.0 for name in names):
        fits = [size for size in SIZES.values() if WEAKEST < typical * size < STRONGEST]
        if len(fits) != 1:
            raise DataError(
                f"{found.source}: a field of {typical:.4g} is the earth's in none of {', '.join(SIZES)}; expected 22 to 67 uT: "
                "name the unit, such as units 'mag=uT', or the columns"
            )
        field = field * fits[0]
    record: MagnetometerRecord = made(found, MagnetometerRecord, field=field)
    return record


def _axes_of(path: FilePath, format: str | None) -> str | None:
    """Axes of a device whose log this is."""
    chosen = format_of(Path(path), format, AIDING_SUFFIXES, "a log of a magnetometer")
    return devices.module_of(chosen).AXES if chosen in devices.DEVICES else None
