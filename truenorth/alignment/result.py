"""The answer of an alignment: attitude with its uncertainty, biases, a verdict with reasons, and the history."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from truenorth.core.attitude import UNIFORM_SIGMA, angle_text, euler_from_dcm, euler_jacobian, euler_sigma, to_rotation
from truenorth.core.position import Position
from truenorth.core.shown import Shown
from truenorth.core.units import DEG_PER_HOUR, MICRO_G
from truenorth.records.specs import ImuSpec
from truenorth.state.evidence import Evidence
from truenorth.state.limits import is_estimated
from truenorth.state.wording import sentences

if TYPE_CHECKING:
    import pandas as pd
    from scipy.spatial.transform import Rotation

    from truenorth.alignment.moving import Moving
    from truenorth.alignment.table import TurntableErrors
    from truenorth.alignment.transfer_result import Transfer
    from truenorth.estimate.ongoing import Ongoing
    from truenorth.navigation.handover import Handover
    from truenorth.quality import Inspection
    from truenorth.state.track import Residuals

Array = NDArray[np.float64]
Status = Literal["aligned", "level_only", "not_converged", "not_observable", "inconsistent"]

SHORT = {"east": "E", "north": "N", "up": "U"}  # of axes, in names of columns
NEAR_VERTICAL = np.radians(85.0)  # beyond this pitch only the combination of heading and roll is known


@dataclass(frozen=True)
class History:
    """How the answer came about, one row a filter epoch.

    Attributes
    ----------
    time : (K,) array, s
    C_nb : (K, 3, 3) array
        Attitude at each epoch, as known then.
    phi_covariance : (K, 3, 3) array, rad^2
        Covariance of the misalignment (E, N, U), everything included.
    phi_floor : (K, 3, 3) array, rad^2
        The part of it that waiting does not improve.
    departure : (K, 3) array, rad
        Misalignment (E, N, U) of the attitude as known then against the final answer at the same time.
    gyro_bias, gyro_bias_sigma : (K, 3) arrays, rad/s
    accel_bias, accel_bias_sigma : (K, 3) arrays, m/s^2
    innovation, innovation_sigma : (K, 3) arrays
        A measurement seen against its prediction; NaN where absent.
    nis : (K,) array
        Normalised innovation squared; its mean is the number of components where the model is right.
    innovation_of : str
        The measurement, such as "velocity of the base" or "GNSS position".
    innovation_unit : str
        SI.
    innovation_axes : tuple of str
        Names of the components.
    """

    time: Array
    C_nb: Array
    phi_covariance: Array
    phi_floor: Array
    departure: Array
    gyro_bias: Array
    gyro_bias_sigma: Array
    accel_bias: Array
    accel_bias_sigma: Array
    innovation: Array
    innovation_sigma: Array
    nis: Array
    innovation_of: str = "velocity of the base"
    innovation_unit: str = "m/s"
    innovation_axes: tuple[str, ...] = ("east", "north", "up")

    @property
    def components(self) -> tuple[int, ...]:
        """Which of the innovation's components were measured at all."""
        return tuple(int(i) for i in np.flatnonzero(np.isfinite(self.innovation).any(axis=0)))

    @cached_property
    def euler(self) -> Array:
        """(K, 3) heading, pitch, roll, rad."""
        return np.stack(euler_from_dcm(self.C_nb), axis=-1)

    @cached_property
    def euler_sigma(self) -> Array:
        """(K, 3) one-sigma of heading, pitch, roll, rad."""
        return euler_sigma(self.C_nb, self.phi_covariance)


@dataclass(frozen=True, repr=False)
class Alignment(Shown):
    """Attitude of the body at one epoch, with all that is needed to judge it.

    Attributes
    ----------
    status : str
        ``aligned``, ``level_only``, ``not_converged``, ``not_observable`` or ``inconsistent``.
    evidence : tuple of Evidence
        What decided the status first, with figures and with what it does to the answer.
    method, method_reason : str
        The method that gave the answer, and why it was taken.
    time : float, s
        Epoch of the attitude, on the record's clock.
    C_nb : (3, 3) array
        ``v_n = C_nb @ v_b``; n is ENU, b is RFU.
    phi_covariance : (3, 3) array, rad^2
        Covariance of the misalignment ``phi`` (E, N, U), ``C_nb_hat = (I - [phi x]) C_nb``; everything included.
    phi_floor : (3, 3) array, rad^2
        The part of it that waiting does not improve: sensor bias, deflection of the vertical, position.
    gyro_bias, gyro_bias_sigma, gyro_bias_prior : (3,) arrays, rad/s
    accel_bias, accel_bias_sigma, accel_bias_prior : (3,) arrays, m/s^2
        Measured minus true; the prior sigma is what the IMU's specification says.
    position : Position
    imu : ImuSpec
        The specification used; `imu_source` says where it came from.
    duration : float, s
        Length of data used.
    disturbance : (3,) array, m/s
        RMS velocity of the base's own motion (E, N, U); NaN where the method does not see it. By means both level ones are the
        largest of any direction.
    pays_until : float or None, s
        Length of data after which the random part of heading's sigma is below half its floor.
    history : History or None
    inspection : Inspection or None
    source : str
    moving : Moving or None
        Velocity, and how the wheel sits, of an alignment on the move; `position` is then that at the epoch.
    transfer : Transfer or None
        Delay, lever arm and mounting against a master, of a transfer alignment.
    table : TurntableErrors or None
        Of an alignment over positions of a turntable.
    handover : Handover or None
        Joint covariance of attitude and biases, from which navigation goes on.
    ongoing : Ongoing or None
        The end of the filter, which goes on with the rows that come.
    """

    status: Status
    evidence: tuple[Evidence, ...]
    method: str
    method_reason: str
    time: float
    C_nb: Array
    phi_covariance: Array
    phi_floor: Array
    gyro_bias: Array
    gyro_bias_sigma: Array
    gyro_bias_prior: Array
    accel_bias: Array
    accel_bias_sigma: Array
    accel_bias_prior: Array
    position: Position
    imu: ImuSpec
    imu_source: str
    duration: float
    disturbance: Array
    pays_until: float | None = None
    history: History | None = field(default=None, repr=False)
    inspection: Inspection | None = field(default=None, repr=False)
    source: str = ""
    moving: Moving | None = field(default=None, repr=False)
    transfer: Transfer | None = field(default=None, repr=False)
    table: TurntableErrors | None = field(default=None, repr=False)
    handover: Handover | None = field(default=None, repr=False)
    ongoing: Ongoing | None = field(default=None, repr=False)

    @cached_property
    def reasons(self) -> tuple[str, ...]:
        """The verdict in words, with figures: the evidence in plain English."""
        return sentences(self.evidence)

    @property
    def residuals(self) -> tuple[Residuals, ...]:
        """What the aiding sensors' or the master's measurements said against the prediction; none of a base that stays."""
        if self.transfer is not None:
            return self.transfer.residuals
        return () if self.moving is None else self.moving.track.residuals

    @property
    def attitude(self) -> Rotation:
        """The attitude as a SciPy rotation from body to navigation axes."""
        return to_rotation(self.C_nb)

    @cached_property
    def euler(self) -> Array:
        """(3,) heading, pitch, roll, rad."""
        return np.array(euler_from_dcm(self.C_nb))

    @cached_property
    def euler_sigma(self) -> Array:
        """(3,) one-sigma of heading, pitch, roll, rad."""
        return euler_sigma(self.C_nb, self.phi_covariance)

    @cached_property
    def euler_sigma_floor(self) -> Array:
        """(3,) the part of `euler_sigma` that waiting does not improve, rad."""
        return euler_sigma(self.C_nb, self.phi_floor)

    @property
    def heading(self) -> float:
        """Heading of the forward (y) axis, clockwise from true north, rad."""
        return float(self.euler[0])

    @property
    def pitch(self) -> float:
        """Pitch, nose up positive, rad."""
        return float(self.euler[1])

    @property
    def roll(self) -> float:
        """Roll, right side down positive, rad."""
        return float(self.euler[2])

    @cached_property
    def convergence(self) -> tuple[Array, Array]:
        """Heading, pitch and roll at the answer's epoch as each earlier epoch would have given them, and their sigmas.

        (K, 3) arrays, rad: the base's own motion is taken out, so that convergence is seen on a swaying ship too.
        """
        if self.history is None:
            raise ValueError(f"method {self.method!r} gives one answer and keeps no history")
        J = euler_jacobian(self.C_nb)
        sigma = np.sqrt(np.einsum("ij,kjl,il->ki", J, self.history.phi_covariance, J))
        return self.euler + self.history.departure @ J.T, sigma

    @property
    def heading_known(self) -> bool:
        """Whether the heading may be used."""
        return self.status == "aligned"

    @property
    def near_vertical(self) -> bool:
        """Whether pitch is so near +-90 deg that only the combination of heading and roll is known."""
        return bool(abs(self.pitch) > NEAR_VERTICAL)

    @cached_property
    def azimuth(self) -> tuple[str, float, float]:
        """Near-vertical pitch: name, value and sigma (rad) of the combination of heading and roll that is observable.

        At pitch +90 deg ``C_nb = Rz(roll - heading) Rx(90 deg)``, at -90 deg ``Rz(-roll - heading) Rx(-90 deg)``:
        only heading - roll, or heading + roll, has a meaning; its error is that about the vertical.
        """
        sign = -1.0 if self.pitch > 0 else 1.0
        name = "heading_minus_roll" if sign < 0 else "heading_plus_roll"
        value = (self.heading + sign * self.roll) % (2 * np.pi)
        return name, float(value), float(min(np.sqrt(self.phi_covariance[2, 2]), UNIFORM_SIGMA))

    @property
    def gyro_bias_estimated(self) -> NDArray[np.bool_]:
        """(3,) whether the data showed this bias, or only the specification does."""
        return is_estimated(self.gyro_bias_sigma, self.gyro_bias_prior)

    @property
    def accel_bias_estimated(self) -> NDArray[np.bool_]:
        """(3,) whether the data showed this bias, or only the specification does."""
        return is_estimated(self.accel_bias_sigma, self.accel_bias_prior)

    def in_brief(self) -> dict[str, str]:
        """Status, method, the angles with their sigmas."""
        shown = {"status": self.status, "method": self.method, "time": f"{self.time:.3f} s"}
        for i, name in enumerate(("heading", "pitch", "roll")):
            value = f"{np.degrees(self.euler[i]):.4f}°" if i or self.heading_known else "refused"
            shown[name] = f"{value} ± {angle_text(float(self.euler_sigma[i]))}"
        return shown

    def summary(self) -> dict[str, Any]:
        """One flat dictionary in datasheet units, ready for JSON; a heading that may not be used is None."""
        deg = np.degrees
        heading_sigma, pitch_sigma, roll_sigma = deg(self.euler_sigma)
        result: dict[str, Any] = {
            "status": self.status,
            "reasons": list(self.reasons),
            "evidence": [item.to_dict() for item in self.evidence],
            "method": self.method,
            "method_reason": self.method_reason,
            "time_s": self.time,
            "duration_s": self.duration,
            "pitch_deg": float(deg(self.pitch)),
            "roll_deg": float(deg(self.roll)),
            "heading_deg": float(deg(self.heading)) if self.heading_known else None,
            "pitch_sigma_deg": float(pitch_sigma),
            "roll_sigma_deg": float(roll_sigma),
            "heading_sigma_deg": float(heading_sigma),
            "pitch_sigma_floor_deg": float(deg(self.euler_sigma_floor[1])),
            "roll_sigma_floor_deg": float(deg(self.euler_sigma_floor[2])),
            "heading_sigma_floor_deg": float(deg(self.euler_sigma_floor[0])),
            "heading_pays_until_s": self.pays_until,
            "gyro_bias_deg_h": (self.gyro_bias / DEG_PER_HOUR).tolist(),
            "gyro_bias_sigma_deg_h": (self.gyro_bias_sigma / DEG_PER_HOUR).tolist(),
            "gyro_bias_estimated": self.gyro_bias_estimated.tolist(),
            "accel_bias_ug": (self.accel_bias / MICRO_G).tolist(),
            "accel_bias_sigma_ug": (self.accel_bias_sigma / MICRO_G).tolist(),
            "accel_bias_estimated": self.accel_bias_estimated.tolist(),
            "disturbance_m_s": [float(v) if np.isfinite(v) else None for v in self.disturbance],
            "imu": self.imu.name,
            "imu_source": self.imu_source,
            "lat_deg": float(deg(self.position.lat)),
            "lon_deg": float(deg(self.position.lon)),
            "alt_m": self.position.alt,
            "source": self.source,
        }
        if self.moving is not None:
            result |= self.moving.summary()
            if not self.heading_known:
                result["vehicle_heading_deg"] = None
        if self.near_vertical:
            name, value, sigma = self.azimuth
            result[f"{name}_deg"] = float(deg(value)) if self.heading_known else None
            result[f"{name}_sigma_deg"] = float(deg(sigma))
            result["C_nb"] = self.C_nb.tolist()
        if self.transfer is not None:
            result |= self.transfer.summary()
        if self.table is not None:
            result |= self.table.summary(self.heading_known)
        return result

    def to_frame(self) -> pd.DataFrame:
        """The history as a pandas table, index ``time``, datasheet units named in the columns.

        Raises
        ------
        ValueError
            The method kept no history.
        """
        import pandas as pd

        columns = self.history_columns()
        return pd.DataFrame(columns, index=pd.Index(columns.pop("time"), name="time"))

    def history_columns(self) -> dict[str, Array]:
        """The columns of :meth:`to_frame`, `time` the first of them."""
        if self.history is None:
            raise ValueError(f"method {self.method!r} gives one answer and keeps no history")
        h = self.history
        columns: dict[str, Array] = {"time": h.time}
        for i, angle in enumerate(("heading", "pitch", "roll")):
            columns[f"{angle}_deg"] = np.degrees(h.euler[:, i])
            columns[f"{angle}_sigma_deg"] = np.degrees(h.euler_sigma[:, i])
        for i, axis in enumerate("xyz"):
            columns[f"gyro_bias_{axis}_deg_h"] = h.gyro_bias[:, i] / DEG_PER_HOUR
            columns[f"gyro_bias_{axis}_sigma_deg_h"] = h.gyro_bias_sigma[:, i] / DEG_PER_HOUR
            columns[f"accel_bias_{axis}_ug"] = h.accel_bias[:, i] / MICRO_G
            columns[f"accel_bias_{axis}_sigma_ug"] = h.accel_bias_sigma[:, i] / MICRO_G
        unit = h.innovation_unit.replace("/", "_")
        for i in h.components:
            axis = SHORT.get(h.innovation_axes[i], h.innovation_axes[i])
            columns[f"innovation_{axis}_{unit}"] = h.innovation[:, i]
            columns[f"innovation_{axis}_sigma_{unit}"] = h.innovation_sigma[:, i]
        columns["nis"] = h.nis
        return columns
