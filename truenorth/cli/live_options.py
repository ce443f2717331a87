"""Options of `truenorth live`: sensors that aid, and what turns the IMU, each with a source of its own."""

from __future__ import annotations

import datetime as dt
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

from truenorth.cli.aiding_options import GYROS, Baseline, IndexerAxes, IndexerSigma, KnownLatency
from truenorth.cli.attitude_options import (
    AttitudeMounting,
    AttitudeSigma,
    MagnetometerAxes,
    MagnetometerIron,
    date_of,
    of_attitude,
)
from truenorth.cli.fields import Sets, arm, given, plain
from truenorth.cli.options import option

if TYPE_CHECKING:
    from truenorth.core.position import Position
    from truenorth.live.feed import Feed
    from truenorth.live.regime import Turner


@dataclass(frozen=True)
class Turned:
    """What turns the IMU on a base that stays."""

    PANEL: ClassVar = "What turns the IMU"
    indexer: Annotated[
        str | None,
        option("Source of an indexer's angles: CSV; or 'gyros': the body is still, the gyros show how the IMU turns."),
    ] = None
    indexer_axes: IndexerAxes = "z,x"
    indexer_sigma: IndexerSigma = "0 arcsec"
    positions: Annotated[str | None, option("auto: a turntable takes the IMU from position to position.")] = None

    def sources(self) -> dict[str, str]:
        """By the key of the feed."""
        return {} if self.indexer in (None, GYROS) else {"indexer": str(self.indexer)}

    def feeds(self) -> list[Feed]:
        """The encoder."""
        from truenorth.live.indexer_feed import IndexerFeed

        return [IndexerFeed(**given(self, "indexer"))] if self.sources() else []

    def turner(self) -> Turner | None:
        """A turntable, or an indexer without an encoder."""
        from truenorth.aiding.aids import Indexer
        from truenorth.cli.aiding_options import Turntable
        from truenorth.core.errors import UsageError

        if self.positions is not None and self.indexer is not None:
            raise UsageError("--positions and --indexer: expected one thing that turns the IMU")
        if self.indexer == GYROS:
            return Indexer(None, **given(self, "indexer"))
        return next(iter(Turntable(self.positions).aids()), None)


@dataclass(frozen=True)
class Aids:
    """Sensors that aid, each with a source of its own: `same` is that of the IMU's rows."""

    PANEL: ClassVar = "Sensors that aid"
    gnss: Annotated[str | None, option("Source of fixes: NMEA, UBX, SBF, NovAtel, MAVLink or CSV.")] = None
    odometer: Annotated[str | None, option("Source of an odometer's rows: CSV.")] = None
    velocity: Annotated[str | None, option("Source of a velocity log's rows: CSV.")] = None
    baro: Annotated[str | None, option("Source of heights: CSV; in navigation.")] = None
    master: Annotated[str | None, option("Source of another INS's solution on the same vehicle: CSV.")] = None
    master_sigma: Annotated[
        str | None,
        option("Slow errors of that solution: navigation or tactical; without it what its rows say."),
        Sets("master", plain("errors")),
    ] = None
    magnetometer: Annotated[
        str | None, option("Source of a magnetometer's rows: CSV or a device; on the move and in navigation.")
    ] = None
    magnetometer_axes: MagnetometerAxes = None
    magnetometer_iron: MagnetometerIron = None
    date: Annotated[str | None, option("Of the rows, YYYY-MM-DD, for the earth's field; today without it.")] = None
    attitude: Annotated[
        str | None, option("Source of another system's heading, pitch and roll: CSV; needs --attitude-sigma.")
    ] = None
    attitude_sigma: AttitudeSigma = None
    attitude_mounting: AttitudeMounting = None
    lever_arm: Annotated[str | None, option("IMU to antenna, m: right,forward,up."), Sets("antenna", arm)] = None
    latency: KnownLatency = None
    baseline: Baseline = None

    def sources(self) -> dict[str, str]:
        """By the key of the feed."""
        keys = ("gnss", "odometer", "velocity", "baro", "master", "magnetometer", "attitude")
        return {key: getattr(self, key) for key in keys if getattr(self, key) is not None}

    def feeds(self, place: Position | None, imu_source: str) -> list[Feed]:
        """What keeps their rows; `place` is where the earth's field is taken."""
        from truenorth.live.known_feeds import FEEDS
        from truenorth.live.master_feed import MasterFeed

        found: list[Feed] = []
        for key in self.sources():
            if key == "magnetometer":
                found.append(self._magnetometer(place, imu_source))
            elif key == "attitude":
                found.append(self._attitude())
            elif key == "master":
                found.append(MasterFeed(**given(self, "master")))
            else:
                found.append(FEEDS[key]())
            if key == "gnss":
                found[-1].mounting = self._antenna()
        return found

    def _antenna(self) -> Any:
        from dataclasses import replace

        from truenorth.alignment.in_motion_task import usual_antenna

        said = given(self, "antenna")
        return replace(usual_antenna(None), **said) if said else None

    def _magnetometer(self, place: Position | None, imu_source: str) -> Feed:
        from truenorth.aiding.magnetometer import earth_field
        from truenorth.core.errors import UsageError
        from truenorth.live.attitude_feeds import MagnetometerFeed

        if place is None:
            raise UsageError("--magnetometer without a place; expected --lat and --lon: north of the needle is there")
        if self.date is None and imu_source.startswith("replay:"):
            raise UsageError("--magnetometer without a date; expected --date YYYY-MM-DD of the log that is replayed")
        date = dt.datetime.now(dt.UTC).date() if self.date is None else date_of(self.date)
        field = earth_field(place, date)
        return MagnetometerFeed(field, axes=self.magnetometer_axes, **given(self, "magnetometer"))

    def _attitude(self) -> Feed:
        from truenorth.live.attitude_feeds import AttitudeFeed

        return AttitudeFeed(**of_attitude(self))
