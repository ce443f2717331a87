"""The answer of navigation: the track with its uncertainty, what the aiding sensors said, and what was wrong with the data."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from truenorth.core.attitude import angle_text, euler_from_dcm, euler_sigma, to_rotation
from truenorth.core.earth import radii
from truenorth.core.position import eastward
from truenorth.core.shown import Shown
from truenorth.core.units import DEG_PER_HOUR, MICRO_G
from truenorth.errors.axes import proper_bias, standing
from truenorth.quality.innovations import mean_nis
from truenorth.records import Late
from truenorth.state.evidence import NO_EFFECT, Effect, Evidence
from truenorth.state.judge import Claim, judge
from truenorth.state.layout import BG, DP, DV, PHI, SLOW_GYRO
from truenorth.state.track import Residuals, Track, velocity_sigma
from truenorth.state.wording import sentences

if TYPE_CHECKING:
    import pandas as pd
    from scipy.spatial.transform import Rotation

    from truenorth.damping.result import Damping
    from truenorth.records import Trajectory

Array = NDArray[np.float64]
Status = Literal["navigated", "not_converged", "inconsistent"]
Altitude = Literal["fixed", "free", "baro", "gnss"]


@dataclass(frozen=True, repr=False)
class Navigation(Shown):
    """Where a vehicle was, how it was turned and how fast it went, with all that is needed to judge it.

    Attributes
    ----------
    status : str
        ``navigated``; ``not_converged``: level is not known at the end; ``inconsistent``: the measurements contradict the model.
    evidence : tuple of Evidence
        What decided the status first, with figures and with what it does to the answer.
    track : Track
        State, sensors and covariance at each output epoch, and the aiding sensors' residuals.
    altitude : str
        How height was kept: fixed, free, baro or gnss.
    smoothed : bool
        Each epoch given the whole log's measurements, not only the earlier ones.
    gaps : tuple of (float, float)
        Time and length (s) of the gaps in the IMU's log that were bridged.
    stops : int
        Seconds at rest that were used.
    imu_source : str
    source : str
    late : mapping of str to Late
        Of each aiding log with rows that stood out of order: how many were put in order.
    damping : Damping or None
        How its oscillations were damped, and what the velocity log did.
    force, acting : (3,) arrays, m/s^2 and its square
        Specific force at rest, body axes, whose effect through scale factors and misalignments the bias states hold; and
        the variance of that effect, where those are no states.
    """

    status: Status
    evidence: tuple[Evidence, ...]
    track: Track = field(repr=False)
    altitude: Altitude
    smoothed: bool
    gaps: tuple[tuple[float, float], ...]
    stops: int
    imu_source: str
    source: str
    late: Mapping[str, Late] = field(default_factory=dict)
    damping: Damping | None = None
    force: Array = field(default_factory=standing, repr=False)
    acting: Array = field(default_factory=lambda: np.zeros(3), repr=False)

    @cached_property
    def reasons(self) -> tuple[str, ...]:
        """The verdict in words, with figures; warnings too: the evidence in plain English."""
        return sentences(self.evidence)

    @property
    def time(self) -> Array:
        """(K,) s."""
        return self.track.time

    @property
    def C_nb(self) -> Array:
        """(K, 3, 3) ``v_n = C_nb @ v_b``."""
        return self.track.C_nb

    @property
    def attitude(self) -> Rotation:
        """The K attitudes as a stack of SciPy rotations from body to navigation axes."""
        return to_rotation(self.track.C_nb)

    @property
    def v_n(self) -> Array:
        """(K, 3) velocity east, north, up, m/s."""
        return self.track.v_n

    @property
    def position(self) -> Array:
        """(K, 3) latitude, longitude (rad), height (m)."""
        return self.track.position

    @cached_property
    def euler(self) -> Array:
        """(K, 3) heading, pitch, roll, rad."""
        return np.stack(euler_from_dcm(self.C_nb), axis=-1)

    @cached_property
    def euler_sigma(self) -> Array:
        """(K, 3) one-sigma of heading, pitch, roll, rad."""
        return euler_sigma(self.C_nb, self.track.P[:, PHI, PHI])

    @property
    def v_sigma(self) -> Array:
        """(K, 3) one-sigma of velocity, m/s; NaN of a vertical velocity that is not measured: where height is held."""
        return velocity_sigma(self.track.sigma)

    @property
    def position_sigma(self) -> Array:
        """(K, 3) one-sigma of position east, north, up, m."""
        return self.track.sigma[:, DP]

    @property
    def residuals(self) -> tuple[Residuals, ...]:
        """What each aiding sensor's measurements said against the prediction."""
        return self.track.residuals

    @cached_property
    def displacement(self) -> Array:
        """(K, 2) metres east and north of the start, on the ellipsoid there."""
        lat, lon, alt = self.position.T
        R_M, R_N = radii(lat[0])
        return np.stack(
            [eastward(lon, lon[0]) * (R_N + alt[0]) * np.cos(lat[0]), (lat - lat[0]) * (R_M + alt[0])], axis=1
        )

    @cached_property
    def distance(self) -> float:
        """Metres travelled, from the velocity."""
        speed = np.linalg.norm(self.v_n, axis=1)
        return float(np.sum(0.5 * (speed[1:] + speed[:-1]) * np.diff(self.time)))

    def to_frame(self) -> pd.DataFrame:
        """The track as a pandas table, index ``time``, angles in deg, biases in datasheet units."""
        import pandas as pd

        t = self.track
        columns: dict[str, Array] = {
            "lat": np.degrees(self.position[:, 0]),
            "lon": np.degrees(self.position[:, 1]),
            "alt": self.position[:, 2],
        }
        for i, axis in enumerate("ENU"):
            columns[f"V{axis}"] = self.v_n[:, i]
        for i, angle in zip((2, 1, 0), ("roll", "pitch", "heading")):
            columns[angle] = np.degrees(self.euler[:, i])
        for i, axis in enumerate("ENU"):
            columns[f"sigma_{axis}"] = self.position_sigma[:, i]
        for i, axis in enumerate("ENU"):
            columns[f"sigma_V{axis}"] = self.v_sigma[:, i]
        for i, angle in zip((2, 1, 0), ("roll", "pitch", "heading")):
            columns[f"{angle}_sigma"] = np.degrees(self.euler_sigma[:, i])
        gyro_sigma = t.bias_sigma(BG, SLOW_GYRO)
        accel_bias, accel_sigma = proper_bias(t, self.force, self.acting)
        for i, axis in enumerate("xyz"):
            columns[f"gyro_bias_{axis}_deg_h"] = t.gyro_bias[:, i] / DEG_PER_HOUR
            columns[f"gyro_bias_{axis}_sigma_deg_h"] = gyro_sigma[:, i] / DEG_PER_HOUR
            columns[f"accel_bias_{axis}_ug"] = accel_bias[:, i] / MICRO_G
            columns[f"accel_bias_{axis}_sigma_ug"] = accel_sigma[:, i] / MICRO_G
        for group, where in t.layout.groups.items():
            for i, column in enumerate(range(where.start, where.stop)):
                name = group.replace(" ", "_") + (f"_{i + 1}" if where.stop - where.start > 1 else "")
                columns[name] = t.sensors[:, column]
                columns[f"{name}_sigma"] = t.sigma[:, column]
        return pd.DataFrame(columns, index=pd.Index(self.time, name="time"))

    def innovations(self) -> pd.DataFrame:
        """Innovations of all aiding sensors as one table: time, sensor, components with sigmas, NIS, used."""
        import pandas as pd

        parts = []
        for r in self.residuals:
            part = pd.DataFrame({"time": r.time, "sensor": r.name, "unit": r.unit})
            for i in range(3):
                part[f"innovation_{i + 1}"], part[f"sigma_{i + 1}"] = r.innovation[:, i], r.sigma[:, i]
            part["nis"], part["used"] = r.nis, r.used
            parts.append(part)
        if not parts:
            return pd.DataFrame(columns=["time", "sensor", "nis", "used"])
        return pd.concat(parts, ignore_index=True)

    def trajectory(self) -> Trajectory:
        """The track as a record that formats can write."""
        from truenorth.records import Trajectory

        lat, lon, alt = self.position.T
        return Trajectory(
            time=self.time,
            C_nb=self.C_nb,
            v_n=self.v_n,
            lat=lat,
            lon=lon,
            alt=alt,
            source=f"navigation of {self.source}",
        )

    def in_brief(self) -> dict[str, str]:
        """Status, span, and where and how the vehicle was at the end."""
        (lat, lon, alt), sigma = self.position[-1], self.position_sigma[-1]
        return {
            "status": self.status,
            "span": f"{self.time[0]:.1f} to {self.time[-1]:.1f} s, {self.distance:.0f} m",
            "end": f"{np.degrees(lat):.6f}°, {np.degrees(lon):.6f}°, {alt:.1f} m",
            "sigma east, north, up": ", ".join(f"{s:.3g}" for s in sigma) + " m",
            "heading": f"{np.degrees(self.euler[-1, 0]):.4f}° ± {angle_text(float(self.euler_sigma[-1, 0]))}",
        }

    def summary(self) -> dict[str, Any]:
        """One flat dictionary in datasheet units, ready for JSON."""
        deg = np.degrees
        last, sigma = self.position[-1], self.position_sigma[-1]
        return {
            "status": self.status,
            "reasons": list(self.reasons),
            "evidence": [item.to_dict() for item in self.evidence],
            "start_s": float(self.time[0]),
            "end_s": float(self.time[-1]),
            "distance_m": self.distance,
            "lat_deg": float(deg(last[0])),
            "lon_deg": float(deg(last[1])),
            "alt_m": float(last[2]),
            "position_sigma_m": sigma.tolist(),
            "v_n_m_s": self.v_n[-1].tolist(),
            "v_n_sigma_m_s": [s if math.isfinite(s) else None for s in self.v_sigma[-1].tolist()],
            "heading_deg": float(deg(self.euler[-1, 0])),
            "pitch_deg": float(deg(self.euler[-1, 1])),
            "roll_deg": float(deg(self.euler[-1, 2])),
            "heading_sigma_deg": float(deg(self.euler_sigma[-1, 0])),
            "pitch_sigma_deg": float(deg(self.euler_sigma[-1, 1])),
            "roll_sigma_deg": float(deg(self.euler_sigma[-1, 2])),
            "altitude": self.altitude,
            "smoothed": self.smoothed,
            "gaps": [{"time_s": time, "length_s": length} for time, length in self.gaps],
            "late_rows": {name: {"rows": n, "longest_s": longest} for name, (n, longest) in self.late.items()},
            "stops_s": self.stops,
            "aiding": {
                r.name: {
                    "measurements": len(r.time),
                    "rejected": r.rejected,
                    "outside": r.outside,
                    "nis_over_rows": mean_nis(r),
                }
                for r in self.residuals
            },
            "estimated": self.estimated(),
            "imu_source": self.imu_source,
            "source": self.source,
            **({} if self.damping is None else {"damping": self.damping.summary()}),
        }

    def estimated(self) -> dict[str, dict[str, list[float]]]:
        """What was estimated of the aiding sensors at the end: value and one-sigma, SI."""
        found = {}
        for group, where in self.track.layout.groups.items():
            found[group] = {
                "value": self.track.sensors[-1, where].tolist(),
                "sigma": self.track.sigma[-1, where].tolist(),
            }
        return found

    def export(self, path: str | PathLike[str]) -> Path:
        """Write the track as .geojson, .kml or .csv, by the suffix.

        Raises
        ------
        UsageError
            Another suffix, or a folder that cannot be written to.
        """
        from truenorth.navigation.export import export

        return export(self, Path(path))


def last_sigma(track: Track) -> Effect:
    """One sigma of each output at the last epoch."""
    sigma = track.sigma[-1]
    heading = float(euler_sigma(track.C_nb[-1], track.P[-1, PHI, PHI])[0])
    return Effect(heading, float(sigma[PHI][:2].max()), float(sigma[DV].max()), float(sigma[DP].max()))


def judged_navigation(result: Navigation, evidence: Sequence[Evidence], least: Array | None = None) -> Navigation:
    """The verdict on a navigation by its last epoch; what the evidence adds to sigma is in its covariance, as a share of it.

    On the way sigmas of the first m states grow by (K, m) times at `least`, unless the model is contradicted.
    """
    claim = last_sigma(result.track)
    least = None if least is None or np.all(least == 1.0) else least  # days of covariances are not copied for nothing
    verdict = judge(Claim(claim), evidence)
    status: Status = verdict.status("navigated")  # type: ignore[assignment]  # heading has no limit here
    if status != "inconsistent" and (verdict.added != NO_EFFECT or least is not None):
        states = result.track.P.shape[-1]
        growth = with_others(np.ones((len(result.track), 0)) if least is None else least, states)
        if verdict.added != NO_EFFECT:
            grows = {name: s / own for (name, s), (_, own) in zip(verdict.sigma.items(), claim.items(), strict=True)}
            of_states = np.ones(growth.shape[1])
            of_states[PHI] = grows["level"], grows["level"], grows["heading"]
            of_states[DV], of_states[DP] = grows["velocity"], grows["position"]
            growth = np.maximum(growth, of_states)
        P = growth[:, :, None] * result.track.P * growth[:, None, :]
        result = replace(result, track=replace(result.track, P=P))
    return replace(result, status=status, evidence=verdict.evidence)


def with_others(growth: Array, states: int) -> Array:
    """(K, n) the growth of the first states, none of the others."""
    return np.concatenate([growth, np.ones((len(growth), states - growth.shape[-1]))], axis=1)
