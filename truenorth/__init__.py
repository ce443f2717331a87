"""Truenorth: initial alignment and navigation of strapdown inertial navigation systems.

The public names load what they need when they are first used, so that ``import truenorth`` stays light.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from truenorth.core.version import __version__ as __version__
from truenorth.results import Views, load, plot, register_result, save

if TYPE_CHECKING:
    from truenorth.advice import advise, advise_manoeuvre
    from truenorth.alignment import (
        Alignment,
        align,
        align_in_motion,
        align_positions,
        align_rotary,
        align_transfer,
    )
    from truenorth.campaign import run_campaign
    from truenorth.core.errors import AlignmentError, DataError, TruenorthError, UsageError
    from truenorth.core.position import Position
    from truenorth.formats import (
        read_encoder,
        read_gnss,
        read_height,
        read_imu,
        read_master,
        read_odometer,
        read_trajectory,
        read_velocity,
        write_imu,
        write_record,
    )
    from truenorth.navigation import Mounting, Navigation, navigate
    from truenorth.quality import inspect
    from truenorth.records import (
        GnssRecord,
        HeightRecord,
        ImuRecord,
        MasterRecord,
        OdometerRecord,
        Trajectory,
        VelocityRecord,
    )
    from truenorth.records.calibration import Calibration
    from truenorth.records.specs import ImuSpec, imu_spec
    from truenorth.report import write_report
    from truenorth.simulation import simulate

_HOMES = {
    "Alignment": "alignment",
    "AlignmentError": "core.errors",
    "Calibration": "records.calibration",
    "DataError": "core.errors",
    "GnssRecord": "records",
    "HeightRecord": "records",
    "ImuRecord": "records",
    "ImuSpec": "records.specs",
    "MasterRecord": "records",
    "Mounting": "navigation",
    "Navigation": "navigation",
    "OdometerRecord": "records",
    "Position": "core.position",
    "Trajectory": "records",
    "TruenorthError": "core.errors",
    "UsageError": "core.errors",
    "VelocityRecord": "records",
    "advise": "advice",
    "advise_manoeuvre": "advice",
    "align": "alignment",
    "align_in_motion": "alignment",
    "align_positions": "alignment",
    "align_rotary": "alignment",
    "align_transfer": "alignment",
    "imu_spec": "records.specs",
    "inspect": "quality",
    "navigate": "navigation",
    "read_encoder": "formats",
    "read_gnss": "formats",
    "read_height": "formats",
    "read_imu": "formats",
    "read_master": "formats",
    "read_odometer": "formats",
    "read_trajectory": "formats",
    "read_velocity": "formats",
    "run_campaign": "campaign",
    "simulate": "simulation",
    "write_imu": "formats",
    "write_record": "formats",
    "write_report": "report",
}

__all__ = [
    "Alignment",
    "AlignmentError",
    "Calibration",
    "DataError",
    "GnssRecord",
    "HeightRecord",
    "ImuRecord",
    "ImuSpec",
    "MasterRecord",
    "Mounting",
    "Navigation",
    "OdometerRecord",
    "Position",
    "Trajectory",
    "TruenorthError",
    "UsageError",
    "VelocityRecord",
    "Views",
    "advise",
    "advise_manoeuvre",
    "align",
    "align_in_motion",
    "align_positions",
    "align_rotary",
    "align_transfer",
    "imu_spec",
    "inspect",
    "load",
    "navigate",
    "plot",
    "read_encoder",
    "read_gnss",
    "read_height",
    "read_imu",
    "read_master",
    "read_odometer",
    "read_trajectory",
    "read_velocity",
    "register_result",
    "run_campaign",
    "save",
    "simulate",
    "write_imu",
    "write_record",
    "write_report",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'truenorth' has no attribute {name!r}")
    value = getattr(import_module(f"truenorth.{_HOMES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted([*globals(), *_HOMES])
