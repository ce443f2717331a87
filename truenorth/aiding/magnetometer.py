"""A magnetometer: heading by the earth's magnetic field, its own iron and the ground's anomalies estimated along with it.

The field of a model, B (east, north, up; of length about 1), is seen through the attitude, the sensor's seat (turned by mu about
its axes), a moment late by tau, and the iron of :mod:`truenorth.errors.iron`. With ``b = C_mb C' (B + a)``, the body's rate w along
the sensor's axes, ``T = (I + tau [w x])(I + [mu x])``, ``y = T b`` and ``C_hat = (I - [phi x]) C``,

    z = (I + S) y_hat + h - m
      = (I + S) T C_mb C' (phi x B - da) - dS y - (I + S)(I + tau [w x]) dmu x b - (I + S) w x b dtau - dh + tau (I + S) dw x b

A turn of the seat is what S, which is symmetric, does not hold. All are relative to the strength of the model's field, about 50
uT.

Source: D. Gebre-Egziabher, G. Elkaim, J. Powell, B. Parkinson, "Calibration of strapdown magnetometers in magnetic field
domain", J. Aerosp. Eng. 19 (2006), sec. 2, for the iron.
"""

from __future__ import annotations

import datetime as dt
import math
from dataclasses import dataclass
from dataclasses import field as default
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from truenorth.aiding.master import from_north
from truenorth.aiding.position import convergence
from truenorth.aiding.row import AT_BIAS, AT_LAG, AT_MOUNT, AT_OWN, AT_SCALE, BODY_FRAME, MOUNT, OWN, Row, lag_now, row
from truenorth.aiding.source import Aiding
from truenorth.core.attitude import cross, times_back
from truenorth.core.compiled import compiled
from truenorth.core.errors import UsageError
from truenorth.core.position import Position
from truenorth.errors.group import Group
from truenorth.errors.iron import anomaly, hard_iron, soft_iron
from truenorth.records.magnetometer import MagnetometerRecord
from truenorth.state.mounting import Mounting
from truenorth.state.now import NOW_C, NOW_TURN, matrix_of, vector_of

Array = NDArray[np.float64]
_PHI, _DP, _BG = 0, 6, 9
NOISE, HARD, SOFT, ANOMALY, DISTANCE = 0.005, 0.1, 0.03, 0.02, 50.0  # of the field's strength; m
LATEST = 0.05  # s, one sigma of a delay: in a longer one a body that pitches turns by less than by its rate
SEAT = math.radians(0.5)  # one sigma about each axis: two chips on one board


@compiled
def _axes(figures: Any, b: Any) -> Any:
    """``C_mb b``, a tuple."""
    return (
        figures[MOUNT] * b[0] + figures[MOUNT + 1] * b[1] + figures[MOUNT + 2] * b[2],
        figures[MOUNT + 3] * b[0] + figures[MOUNT + 4] * b[1] + figures[MOUNT + 5] * b[2],
        figures[MOUNT + 6] * b[0] + figures[MOUNT + 7] * b[1] + figures[MOUNT + 8] * b[2],
    )


@compiled
def _to_sensor(figures: Any, C: Any, v: Any) -> Any:
    """``C_mb C' v``, a tuple."""
    return _axes(figures, times_back(C, v))


@compiled
def _turned(by: Any, y: Any) -> Any:
    """``(I + [by x]) y``, a tuple."""
    more = cross(by, y)
    return (y[0] + more[0], y[1] + more[1], y[2] + more[2])


@compiled
def _bent(assumed: Any, at: int, y: Any) -> Any:
    """``(I + S) y``, a tuple."""
    if at < 0:
        return y
    xx, yy, zz, xy, xz, yz = (
        assumed[at], assumed[at + 1], assumed[at + 2], assumed[at + 3], assumed[at + 4], assumed[at + 5]
    )  # fmt: skip
    return (
        y[0] + xx * y[0] + xy * y[1] + xz * y[2],
        y[1] + xy * y[0] + yy * y[1] + yz * y[2],
        y[2] + xz * y[0] + yz * y[1] + zz * y[2],
    )


@row
def _field(now: Any, figures: Any, at: Any, assumed: Any, measured: Any, H: Any, z: Any, R: Any) -> None:
    C = matrix_of(now, NOW_C)
    soft, seat, lag = at[AT_SCALE], at[AT_MOUNT], at[AT_LAG]
    a, h, mu = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    if at[AT_OWN] >= 0:
        a = vector_of(assumed, at[AT_OWN])
    if at[AT_BIAS] >= 0:
        h = vector_of(assumed, at[AT_BIAS])
    if seat >= 0:
        mu = vector_of(assumed, seat)
    w = _axes(figures, vector_of(now, NOW_TURN))
    tau = lag_now(now, assumed, lag)
    late = (tau * w[0], tau * w[1], tau * w[2])
    B = from_north(now, (figures[OWN] + a[0], figures[OWN + 1] + a[1], figures[OWN + 2] + a[2]))
    straight = _to_sensor(figures, C, B)
    there = _turned(mu, straight)
    y = _turned(late, there)
    seen = _bent(assumed, soft, y)
    for i in range(3):
        z[i] = seen[i] + h[i] - measured[i]
    for j in range(3):
        e = (1.0 * (j == 0), 1.0 * (j == 1), 1.0 * (j == 2))
        tilt = _bent(assumed, soft, _turned(late, _turned(mu, _to_sensor(figures, C, cross(e, B)))))
        faster = _bent(assumed, soft, cross(_axes(figures, e), there))
        for i in range(3):
            H[i, _PHI + j] = tilt[i]
            H[i, _BG + j] = tau * faster[i]
        if at[AT_OWN] >= 0:
            added = _bent(assumed, soft, _turned(late, _turned(mu, _to_sensor(figures, C, from_north(now, e)))))
            for i in range(3):
                H[i, at[AT_OWN] + j] = -added[i]
        if at[AT_BIAS] >= 0:
            H[j, at[AT_BIAS] + j] = -1.0
        if seat >= 0:
            askew = _bent(assumed, soft, _turned(late, cross(e, straight)))
            for i in range(3):
                H[i, seat + j] = -askew[i]
        if soft >= 0:
            H[j, soft + j] = -y[j]
    if lag >= 0:
        earlier = _bent(assumed, soft, cross(w, there))
        for i in range(3):
            H[i, lag] = -earlier[i]
    turn = convergence(now)
    for i in range(3):  # the model's north, at the computed place, turns as a heading does
        H[i, _DP], H[i, _DP + 1] = turn[0] * H[i, _PHI + 2], turn[1] * H[i, _PHI + 2]
    if soft >= 0:
        H[0, soft + 3], H[1, soft + 3] = -y[1], -y[0]
        H[0, soft + 4], H[2, soft + 4] = -y[2], -y[0]
        H[1, soft + 5], H[2, soft + 5] = -y[2], -y[1]


FIELD = Row(
    "magnetic field",
    _field,
    {"bias": 3, "scale": 6, "own": 3, "mounting": 3, "lag": 1},
    unit="earth's field",
    axes=BODY_FRAME,
)


def earth_field(place: Position | tuple[float, ...], date: dt.date | float) -> Array:
    """The earth's magnetic field by the World Magnetic Model.

    Parameters
    ----------
    place : Position or (lat, lon[, alt])
        Of numbers: degrees and metres.
    date : date or float
        A date, or a decimal year, 2010 to 2030.

    Returns
    -------
    (3,) array, T
        East, north, up.

    Raises
    ------
    UsageError
        No library of the model is installed, or the date is outside the models.
    """
    try:
        from pygeomag import GeoMag
    except ImportError:
        raise UsageError(
            "the World Magnetic Model is missing; expected pip install 'truenorth[magnetometer]'"
        ) from None
    at = Position.of(place)
    year = date if isinstance(date, int | float) else date.year + (date.timetuple().tm_yday - 1) / 365.25
    try:
        model = GeoMag(base_year=year)
        found = model.calculate(np.degrees(at.lat), np.degrees(at.lon), at.alt / 1000.0, year)
    except (ValueError, KeyError, OSError) as error:
        raise UsageError(f"magnetic field in {year:.2f}: {error}; expected a date from 2010 to 2030") from None
    return np.array([found.y, found.x, -found.z], dtype=np.float64) * 1e-9


@dataclass(frozen=True)
class Magnetometer:
    """A magnetometer on the vehicle.

    Attributes
    ----------
    record : MagnetometerRecord
    field : (3,) array, T
        Of the earth at the place, east, north, up; see :func:`earth_field`.
    noise : float
        White, of each axis; this and the following relative to the field's strength.
    hard_iron : float
        One sigma of what the vehicle's magnets and currents add, each axis; what is left where it was calibrated.
    soft_iron : float
        One sigma of scale factors and what the vehicle's iron bends.
    anomaly : float
        One sigma of what the ground adds, each axis.
    anomaly_distance : float, m
        Way along which that changes.
    mounting : Mounting
        ``C_mb``: IMU's to the sensor's axes; `angle_sigma`: how far off that may be, about each axis, half a degree where nothing
        is said; its latency and gate.
    """

    record: MagnetometerRecord
    field: Array
    noise: float = NOISE
    hard_iron: float = HARD
    soft_iron: float = SOFT
    anomaly: float = ANOMALY
    anomaly_distance: float = DISTANCE
    mounting: Mounting = default(default_factory=lambda: Mounting(angle_sigma=SEAT))
    key: ClassVar[str] = "magnetometer"

    def __post_init__(self) -> None:
        sigmas = (self.hard_iron, self.soft_iron, self.anomaly)
        if not (self.noise > 0.0 and self.anomaly_distance > 0.0 and all(0.0 <= x < 1.0 for x in sigmas)):
            raise UsageError(
                f"magnetometer: noise {self.noise:g}, iron and anomaly {sigmas}, distance {self.anomaly_distance:g} m; "
                "expected a noise and a distance above zero, parts of the earth's field from 0 to 1"
            )
        if self.mounting.latency_sigma > LATEST:
            raise UsageError(
                f"magnetometer: a latency known to {self.mounting.latency_sigma:g} s; expected {LATEST:g} s or better: "
                "say how late its stamps are (`Mounting(latency=)`)"
            )

    def sources(self, altitude: str) -> list[Aiding]:
        """Fields, relative to the model's strength."""
        strength = float(np.linalg.norm(self.field))
        groups = {
            "bias": hard_iron(self.hard_iron),
            "scale": soft_iron(self.soft_iron),
            "own": anomaly(self.anomaly, self.anomaly_distance),
            "mounting": Group("magnetometer seat", np.full(3, self.mounting.angle_sigma), unit="rad"),
            "lag": Group("magnetometer lag", np.array([self.mounting.latency_sigma]), unit="s"),
        }
        return [
            Aiding(
                "magnetometer",
                FIELD,
                self.record.time - self.mounting.latency,
                self.record.field / strength,
                np.full((len(self.record), 3), self.noise),
                C_mb=self.mounting.C_mb,
                states={role: g for role, g in groups.items() if g.sigma.any()},  # type: ignore[misc]  # roles, all
                gate=self.mounting.gate,
                figures=tuple(np.asarray(self.field) / strength),
            )
        ]
