"""Truenorth: initial alignment and navigation of strapdown inertial navigation systems.

The public names load what they need when they are first used, so that ``import truenorth`` stays light.
"""

from __future__ import annotations

from importlib import import_module

from truenorth.core.lazy import lazy
from truenorth.core.version import __version__ as __version__

# `typing` loads slower than all else here, and the command line answers an interrupt only once this package is loaded.
TYPE_CHECKING = False
if TYPE_CHECKING:
    import typing

    from truenorth import (
        aiding as aiding,
    )
    from truenorth import (
        analysis as analysis,
    )
    from truenorth import (
        campaign as campaign,
    )
    from truenorth import (
        coarse as coarse,
    )
    from truenorth import (
        damping as damping,
    )
    from truenorth import (
        errors as errors,
    )
    from truenorth import (
        estimate as estimate,
    )
    from truenorth import (
        filters as filters,
    )
    from truenorth import (
        formats as formats,
    )
    from truenorth import (
        quality as quality,
    )
    from truenorth import (
        records as records,
    )
    from truenorth import (
        simulation as simulation,
    )
    from truenorth import (
        state as state,
    )
    from truenorth import (
        strapdown as strapdown,
    )
    from truenorth.advice import advise, advise_manoeuvre
    from truenorth.aiding.aids import Barometer, Gnss, Indexer, Master, Odometer, Positions, VelocityLog
    from truenorth.aiding.attitude import Attitude
    from truenorth.aiding.fixes import AzimuthFix, Fixes, PositionFix
    from truenorth.aiding.magnetometer import Magnetometer, earth_field
    from truenorth.alignment import Alignment, Recipe, Request, align, register_recipe
    from truenorth.campaign import run_campaign
    from truenorth.core.errors import AlignmentError, DataError, TruenorthError, UsageError
    from truenorth.core.position import Position
    from truenorth.errors.deflection import Deflection
    from truenorth.errors.log import LogErrors
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
    from truenorth.formats.magnetometer import read_magnetometer
    from truenorth.navigation import Mounting, Navigation, navigate
    from truenorth.navigation.known import known_start, start_from_master, with_heading
    from truenorth.papers import reproduce
    from truenorth.quality import inspect
    from truenorth.records import (
        EncoderRecord,
        GnssRecord,
        HeightRecord,
        ImuRecord,
        MasterRecord,
        OdometerRecord,
        Trajectory,
        VelocityRecord,
    )
    from truenorth.records.calibration import Calibration
    from truenorth.records.magnetometer import MagnetometerRecord
    from truenorth.records.specs import ImuSpec, imu_spec
    from truenorth.report import write_report
    from truenorth.results import Views, load, plot, register_result, save
    from truenorth.simulation import simulate

_HOMES = {
    "Alignment": "alignment",
    "AlignmentError": "core.errors",
    "Attitude": "aiding.attitude",
    "AzimuthFix": "aiding.fixes",
    "Barometer": "aiding.aids",
    "Calibration": "records.calibration",
    "DataError": "core.errors",
    "Deflection": "errors.deflection",
    "EncoderRecord": "records",
    "Fixes": "aiding.fixes",
    "Gnss": "aiding.aids",
    "GnssRecord": "records",
    "HeightRecord": "records",
    "ImuRecord": "records",
    "ImuSpec": "records.specs",
    "Indexer": "aiding.aids",
    "LogErrors": "errors.log",
    "Magnetometer": "aiding.magnetometer",
    "MagnetometerRecord": "records.magnetometer",
    "Master": "aiding.aids",
    "MasterRecord": "records",
    "Mounting": "navigation",
    "Navigation": "navigation",
    "Odometer": "aiding.aids",
    "OdometerRecord": "records",
    "Position": "core.position",
    "PositionFix": "aiding.fixes",
    "Positions": "aiding.aids",
    "Recipe": "alignment",
    "Request": "alignment",
    "Trajectory": "records",
    "TruenorthError": "core.errors",
    "UsageError": "core.errors",
    "VelocityLog": "aiding.aids",
    "VelocityRecord": "records",
    "Views": "results",
    "advise": "advice",
    "advise_manoeuvre": "advice",
    "align": "alignment",
    "earth_field": "aiding.magnetometer",
    "imu_spec": "records.specs",
    "inspect": "quality",
    "known_start": "navigation.known",
    "load": "results",
    "navigate": "navigation",
    "plot": "results",
    "read_encoder": "formats",
    "read_gnss": "formats",
    "read_height": "formats",
    "read_imu": "formats",
    "read_magnetometer": "formats.magnetometer",
    "read_master": "formats",
    "read_odometer": "formats",
    "read_trajectory": "formats",
    "read_velocity": "formats",
    "register_recipe": "alignment",
    "register_result": "results",
    "reproduce": "papers",
    "run_campaign": "campaign",
    "save": "results",
    "simulate": "simulation",
    "start_from_master": "navigation.known",
    "with_heading": "navigation.known",
    "write_imu": "formats",
    "write_record": "formats",
    "write_report": "report",
}

__all__ = [
    "Alignment",
    "AlignmentError",
    "Attitude",
    "AzimuthFix",
    "Barometer",
    "Calibration",
    "DataError",
    "Deflection",
    "EncoderRecord",
    "Fixes",
    "Gnss",
    "GnssRecord",
    "HeightRecord",
    "ImuRecord",
    "ImuSpec",
    "Indexer",
    "LogErrors",
    "Magnetometer",
    "MagnetometerRecord",
    "Master",
    "MasterRecord",
    "Mounting",
    "Navigation",
    "Odometer",
    "OdometerRecord",
    "Position",
    "PositionFix",
    "Positions",
    "Recipe",
    "Request",
    "Trajectory",
    "TruenorthError",
    "UsageError",
    "VelocityLog",
    "VelocityRecord",
    "Views",
    "advise",
    "advise_manoeuvre",
    "align",
    "earth_field",
    "imu_spec",
    "inspect",
    "known_start",
    "load",
    "navigate",
    "plot",
    "read_encoder",
    "read_gnss",
    "read_height",
    "read_imu",
    "read_magnetometer",
    "read_master",
    "read_odometer",
    "read_trajectory",
    "read_velocity",
    "register_recipe",
    "register_result",
    "reproduce",
    "run_campaign",
    "save",
    "simulate",
    "start_from_master",
    "with_heading",
    "write_imu",
    "write_record",
    "write_report",
]


_SUBMODULES = (
    "aiding",
    "analysis",
    "campaign",
    "coarse",
    "damping",
    "errors",
    "estimate",
    "filters",
    "formats",
    "live",
    "papers",
    "quality",
    "records",
    "simulation",
    "state",
    "strapdown",
)


_get, _ = lazy("truenorth", _HOMES)


def __getattr__(name: str) -> typing.Any:
    return import_module(f"truenorth.{name}") if name in _SUBMODULES else _get(name)


def __dir__() -> list[str]:
    return sorted(["__version__", *_HOMES, *_SUBMODULES])
