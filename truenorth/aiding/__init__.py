"""Measurements that aid an INS: one compiled row a file, and what turns a record into them."""

from typing import TYPE_CHECKING

from truenorth.core.lazy import lazy

if TYPE_CHECKING:
    from truenorth.aiding.aids import Barometer, Gnss, Indexer, Master, Odometer, Positions, VelocityLog
    from truenorth.aiding.attitude import Attitude
    from truenorth.aiding.fixes import AzimuthFix, Fixes, PositionFix
    from truenorth.aiding.magnetometer import Magnetometer
    from truenorth.aiding.row import Row
    from truenorth.aiding.source import Aiding

__all__ = [
    "Aiding",
    "Attitude",
    "AzimuthFix",
    "Barometer",
    "Fixes",
    "Gnss",
    "Indexer",
    "Magnetometer",
    "Master",
    "Odometer",
    "PositionFix",
    "Positions",
    "Row",
    "VelocityLog",
]

__getattr__, __dir__ = lazy(
    __name__,
    {
        "Aiding": "source",
        "Attitude": "attitude",
        "AzimuthFix": "fixes",
        "Barometer": "aids",
        "Fixes": "fixes",
        "Gnss": "aids",
        "Indexer": "aids",
        "Magnetometer": "magnetometer",
        "Master": "aids",
        "Odometer": "aids",
        "PositionFix": "fixes",
        "Positions": "aids",
        "Row": "row",
        "VelocityLog": "aids",
    },
)
