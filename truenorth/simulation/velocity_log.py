"""Simulated velocity log: Doppler or electromagnetic log in body axes, or a reference velocity east, north, up."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from truenorth.core.errors import UsageError
from truenorth.records import VelocityRecord
from truenorth.records.motion import Moving
from truenorth.records.unit_spec import value
from truenorth.simulation.aiding import (
    Aided,
    Draws,
    OutlyingSpec,
    kept,
    outliers,
    rotation,
    velocity_b,
)
from truenorth.simulation.processes import gauss_markov

Array = NDArray[np.float64]
MEASURED = {"forward": [False, True, False], "level": [True, True, False], "all": [True, True, True]}


@dataclass(frozen=True, kw_only=True)
class VelocityLogSpec(OutlyingSpec[VelocityRecord]):
    """A velocity log and its errors; measured is ``(1 + scale) C v + bias + drift + noise``.

    Attributes
    ----------
    frame : {"body", "navigation"}
    axes : {"forward", "level", "all"}
        That are measured: forward alone (body axes), the two level ones, or all three.
    bias : (3,) floats, m/s
        Constant, along the axes of the frame; `bias_sigma` draws another one on top.
    drift, correlation_time : float, m/s and s
        Sigma of a first-order Gauss-Markov error of each axis.
    noise : float, m/s
        White, of each axis and row.
    scale : float
        Relative scale error; `scale_sigma` draws more.
    misalignment : (3,) floats, rad
        Rotation vector from the frame to the log's own axes; `misalignment_sigma` draws more.
    lever_arm : (3,) floats, m
        From the IMU to the log, IMU axes.
    outlier_size : float, m/s
        Sigma of an outlier.
    """

    sensor = "velocity"
    frame: Literal["body", "navigation"] = "body"
    axes: Literal["forward", "level", "all"] = "all"
    bias: tuple[float, float, float] = value("speed speed speed", "m/s m/s m/s", (0.0, 0.0, 0.0), sign="any")
    bias_sigma: float = value("speed", "m/s")
    drift: float = value("speed", "m/s")
    correlation_time: float = value("time", "s", 300.0, sign="positive")
    noise: float = value("speed", "m/s")
    scale: float = value("ratio", "%", sign="any")
    scale_sigma: float = value("ratio", "%")
    misalignment: tuple[float, float, float] = value("angle angle angle", "deg deg deg", (0.0, 0.0, 0.0), sign="any")
    misalignment_sigma: float = value("angle", "deg")
    lever_arm: tuple[float, float, float] = value("length length length", "m m m", (0.0, 0.0, 0.0), sign="any")
    outlier_size: float = value("speed", "m/s", 5.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.frame not in ("body", "navigation"):
            raise UsageError(f"frame {self.frame!r} is not known; use body or navigation")
        if self.axes not in MEASURED:
            raise UsageError(f"axes {self.axes!r} are not known; use forward, level or all")
        if self.axes == "forward" and self.frame != "body":
            raise UsageError("a log of forward speed alone measures in body axes; expected frame body, or axes level")

    def sense(self, body: Moving, times: Array, draws: Draws) -> Aided[VelocityRecord]:
        """A velocity log: the record's ``sigma`` is that of drift and noise together.

        Errors ``bias (3,), scale, misalignment (3,)``, and row by row ``drift, noise, outliers`` (N, 3).
        """
        shape = (len(times), 3)
        bias = np.asarray(self.bias) + self.bias_sigma * draws("bias").standard_normal(3)
        scale = self.scale + self.scale_sigma * draws("scale").standard_normal()
        turn = np.asarray(self.misalignment) + self.misalignment_sigma * draws("misalignment").standard_normal(3)
        drift = gauss_markov(self.drift, self.correlation_time, 1.0 / self.rate, len(times), draws("drift"))
        noise = self.noise * draws("noise").standard_normal(shape)
        wild = outliers(self, self.outlier_size, shape, draws)

        at = body.states(times)
        true = velocity_b(at, self.lever_arm)
        if self.frame == "navigation":
            true = np.einsum("kij,kj->ki", at.C_nb, true) if np.any(self.lever_arm) else at.v_n
        turned = true @ rotation(turn) if turn.any() else true
        measured = (1.0 + scale) * turned + bias + drift + noise + wild
        there, axes = kept(self, times, draws), np.array(MEASURED[self.axes])
        measured[:, ~axes] = np.nan
        sigma = float(np.hypot(self.drift, self.noise))
        record = VelocityRecord(
            times[there] + self.latency,
            measured[there],
            self.frame,
            np.where(axes, np.full(shape, sigma)[there], np.nan) if sigma > 0 else None,
            "simulation",
        )
        errors = {"drift": drift[there], "noise": noise[there], "outliers": wild[there]}
        return Aided(record, times[there], errors | {"bias": bias, "scale": scale, "misalignment": turn})
