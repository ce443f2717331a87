"""Records: measurements in SI units and our axes, checked when they are made."""

from typing import TYPE_CHECKING

from truenorth.core.lazy import lazy

if TYPE_CHECKING:
    from truenorth.records.base import IN_ORDER, Guess, Late, Record
    from truenorth.records.encoder import EncoderRecord
    from truenorth.records.gnss import GnssRecord, HeightRecord
    from truenorth.records.imu import COLUMNS, ImuRecord
    from truenorth.records.lost_rows import GAP_FACTOR
    from truenorth.records.odometer import OdometerRecord
    from truenorth.records.poses import MasterRecord, Trajectory
    from truenorth.records.velocity import VelocityRecord

__all__ = [
    "COLUMNS",
    "GAP_FACTOR",
    "IN_ORDER",
    "EncoderRecord",
    "GnssRecord",
    "Guess",
    "HeightRecord",
    "ImuRecord",
    "Late",
    "MasterRecord",
    "OdometerRecord",
    "Record",
    "Trajectory",
    "VelocityRecord",
]

__getattr__, __dir__ = lazy(
    __name__,
    {
        "COLUMNS": "imu",
        "EncoderRecord": "encoder",
        "GAP_FACTOR": "lost_rows",
        "GnssRecord": "gnss",
        "Guess": "base",
        "HeightRecord": "gnss",
        "IN_ORDER": "base",
        "ImuRecord": "imu",
        "Late": "base",
        "MasterRecord": "poses",
        "OdometerRecord": "odometer",
        "Record": "base",
        "Trajectory": "poses",
        "VelocityRecord": "velocity",
    },
)
