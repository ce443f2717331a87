"""NumPy .npz: ``time``, ``gyro`` and ``accel`` (or ``dtheta`` and ``dvel``), or other arrays by name.

Large arrays stay on the disk (:mod:`truenorth.core.mapped`): a log of days takes no memory by itself.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from truenorth.core.archive import check_size
from truenorth.core.errors import DataError
from truenorth.core.mapped import read_mapped, write_mappable
from truenorth.formats.layout import BLOCKS
from truenorth.records import ImuRecord, Record


def variables_of(path: Path) -> dict[str, Any]:
    """The arrays of a file by name.

    Raises
    ------
    DataError
        A damaged file.
    """
    try:
        check_size(path)
        return read_mapped(path)
    except MemoryError:
        raise DataError(f"{path.name}: its arrays do not fit into memory; expected a smaller log") from None
    except DataError:
        raise
    except Exception as error:  # zipfile, its unpackers, NumPy's parser of headers have errors of their own
        raise DataError(f"{path.name}: the NumPy archive is damaged or cut short ({error}); write it anew") from None


def write(record: Record, path: Path) -> None:
    """Write an IMU's record as ``time``, and ``gyro, accel`` or ``dtheta, dvel``; another one column by column."""
    columns = record.columns()
    if isinstance(record, ImuRecord):
        gyro, accel = BLOCKS[record.kind]
        columns = {gyro: record.gyro, accel: record.accel}
    write_mappable(path, {"time": record.time, **columns})
