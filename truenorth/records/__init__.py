"""Records: measurements in SI units and our axes, checked when they are made."""

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
