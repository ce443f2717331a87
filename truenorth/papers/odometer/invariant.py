"""The product's closed loop in the study: invariant errors, from the starts that the paper's model gets."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from truenorth.aiding.sensors import from_odometer
from truenorth.coarse.odometer import odometer_alignment
from truenorth.errors.in_motion_azimuth import STATES, correction
from truenorth.errors.model import InsModel
from truenorth.estimate.memory import AS_IT_IS, OVER_GROUND
from truenorth.estimate.run import navigate_track, with_states
from truenorth.papers.odometer.loop import LEVEL_SIGMA, POSITION_SIGMA, VELOCITY_SIGMA, Errors
from truenorth.papers.odometer.scenario import Drives
from truenorth.state.layout import DV, PHI
from truenorth.state.mounting import Mounting
from truenorth.state.prior import prior_covariance
from truenorth.state.state import Start

Array = NDArray[np.float64]

ODOMETER_NOISE, SIDEWAYS = 0.02, 0.05  # m/s, besides the pulses; a wheel's slide on a hard road
INTERVAL = 0.5  # s


def run_invariant(
    drives: Drives,
    which: NDArray[np.int64],
    phi0: Array,
    azimuth_sigma: Array,
    gated: bool = False,
    invariant: bool = True,
) -> Errors:
    """As :func:`truenorth.papers.odometer.loop.run_method`; `invariant` false feeds corrections back as ordinary errors."""
    spec = drives.spec
    model = InsModel.from_spec(spec)
    kept: dict[str, list[Array]] = {
        name: [] for name in ("phi", "velocity", "gyro_bias", "accel_bias", "sigma", "C_nb")
    }
    x0 = np.zeros((len(which), STATES))
    x0[:, PHI] = phi0
    begin = np.swapaxes(correction(x0), 1, 2) @ drives.truth.C_nb[0]
    for b, run in enumerate(which):
        angles = LEVEL_SIGMA, LEVEL_SIGMA, azimuth_sigma[b]
        P = prior_covariance(angles, VELOCITY_SIGMA, POSITION_SIGMA, spec.constant_variance)
        zero = np.zeros(3)
        start = Start(0.0, begin[b], zero, *drives.place, zero, zero, P)
        wheel = Mounting(
            scale_sigma=drives.scale_sigma,
            noise=ODOMETER_NOISE,
            slip=SIDEWAYS,
            compliance=0.0,  # the paper's vehicle is rigid
            gate=1e-4 if gated else 0.0,
        )
        aiding = from_odometer(drives.odometers[run], wheel)
        track = navigate_track(
            drives.records[run],
            start,
            with_states(model, aiding),
            aiding,
            interval=INTERVAL,
            every=round(1.0 / INTERVAL),
            invariant=OVER_GROUND if invariant else AS_IT_IS,
        )
        errors = track.errors_against(drives.truth)[1:]
        kept["phi"].append(errors[:, PHI])
        kept["velocity"].append(errors[:, DV])
        kept["gyro_bias"].append(track.gyro_bias[1:] - drives.gyro_bias[run])
        kept["accel_bias"].append(track.accel_bias[1:] - drives.accel_bias[run])
        kept["sigma"].append(track.sigma[1:, PHI])
        kept["C_nb"].append(track.C_nb[-1])
    stacked = {name: np.stack(value) for name, value in kept.items()}
    return Errors.with_sigma(
        time=drives.time,
        lost=np.zeros(len(which), dtype=bool),
        acted=np.zeros(len(which)),
        **stacked,
    )


def coarse_errors(drives: Drives, end: float) -> Array:
    """(R, 3) phi at the start, rad, of odometer-aided coarse alignment over the first `end` seconds."""
    found = []
    for record, odometer in zip(drives.records, drives.odometers, strict=True):
        coarse = odometer_alignment(record.between(0.0, end), odometer, drives.position)
        M = drives.truth.C_nb[0] @ coarse.C_n0_i.T  # `correction` of the errors sought: its inverse for small tilts
        found.append([M[2, 1], -M[2, 0], np.arctan2(M[1, 0], M[0, 0])])
    return np.array(found)
