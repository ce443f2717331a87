"""The paper's large-azimuth model in a closed loop with any nonlinear filter, many logs of one motion at once.

Mechanised at the rate of the IMU, filtered and corrected once a second.

Source: M. Wu, X. Tang, X. Huang, odometer-aided alignment on the move by a strong tracking Gauss-Hermite filter; the model is that
of :mod:`truenorth.errors.in_motion_azimuth`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.azimuth_mechanisation import mechanise_interval
from truenorth.core.attitude import dcm_from_quaternion, quaternion_from_dcm
from truenorth.errors import in_motion_azimuth as model
from truenorth.errors.in_motion_azimuth import AZIMUTH, DK, STATES
from truenorth.filters import (
    Estimates,
    Gate,
    NonlinearSystem,
    StrongTracking,
    cubature,
    extended,
    gauss_hermite,
    unscented,
)
from truenorth.filters.system import FilterState
from truenorth.state.layout import BA, BG, DP, DV, Layout
from truenorth.state.state import Start
from truenorth.state.track import Residuals, Track
from truenorth.strapdown import wander

Array = NDArray[np.float64]

R_SIGMA = 0.02  # m, of a displacement over a second: the paper's pulse
LOST = 0.5  # rad of tilt, by which the model has lost its meaning and the run is given up
CAP = 1.2  # of the factor of sgkf3_capped
GATE = Gate(0.9999, by="epoch", patience=20)


@dataclass(frozen=True)
class Method:
    """A filter with its options.

    Attributes
    ----------
    run : callable
        ``run(system, state, gate) -> Estimates``.
    tracking : bool
        Its adaptation begins with the factor of strong tracking.
    """

    run: Callable[[NonlinearSystem, FilterState | None, Gate | None], Estimates]
    tracking: bool = False


def reduced(order: int, tracking: StrongTracking | None = None) -> Method:
    """Gauss-Hermite nodes in the azimuth alone, with strong tracking or without."""
    return Method(
        lambda system, state, gate: gauss_hermite(
            system, state, order=order, nonlinear=[AZIMUTH], tracking=tracking, gate=gate, innovations=True
        ),
        tracking=tracking is not None,
    )


METHODS = {
    "ekf": Method(lambda system, state, gate: extended(system, state, gate=gate, innovations=True)),
    "ukf": Method(
        lambda system, state, gate: unscented(
            system, state, alpha=1.0, beta=0.0, kappa=3.0 - STATES, gate=gate, innovations=True
        )
    ),
    "ckf": Method(lambda system, state, gate: cubature(system, state, gate=gate, innovations=True)),
    "gh3": reduced(3),
    "gh5": reduced(5),
    "gh7": reduced(7),
    "sgkf3": reduced(3, StrongTracking()),
    "sgkf7": reduced(7, StrongTracking()),
    "sgkf3_capped": reduced(3, StrongTracking(cap=CAP)),
}


@dataclass(frozen=True)
class Belief:
    """What a filter of the study believes, as factors on its covariances."""

    P0: float = 1.0
    Q: float = 1.0
    R: float = 1.0


NOMINAL = Belief()


class Logs(NamedTuple):
    """Logs of R runs on one time axis."""

    steps: Array  # (N,) s
    dtheta: Array  # (R, N, 3) rad
    dvel: Array  # (R, N, 3) m/s
    wheel: Array  # (R, N) m: distance in each sample
    rows: NDArray[np.int64]  # (K+1,): samples before each epoch
    time: Array  # (K,) s: of the epochs behind the first


class Begin(NamedTuple):
    """Where B runs begin."""

    epoch: int
    starts: Sequence[Start]  # one a run, P of all 16 states
    noise: Array  # (16,) density of the process noise


class Found(NamedTuple):
    """What a filter found for B runs: the track of each, of the vehicle, whose last state is the odometer's scale."""

    tracks: tuple[Track, ...]  # at the epochs after the beginning
    lost: NDArray[np.bool_]  # (B,): given up: a tilt beyond half a radian, where the model has no meaning
    acted: Array  # (B,): share of the epochs in which a factor of strong tracking was above 1


def run_loop(
    logs: Logs,
    which: NDArray[np.int64],
    begin: Begin,
    method: str | Method,
    *,
    gated: bool = False,
    turned: bool = True,
    belief: Belief = NOMINAL,
) -> Found:
    """Align B runs.

    Parameters
    ----------
    which : (B,) array of int
        The log of each.
    method : str or Method
        A key of `METHODS`, or one of one's own.
    gated : bool
        Judge each epoch by its normalised innovation squared.
    turned : bool
        Turn the covariance of velocity with a correction of the azimuth; see
        :func:`truenorth.errors.in_motion_azimuth.after_correction`.
    """
    B, count, first = len(which), len(logs.rows) - 1 - begin.epoch, logs.rows[begin.epoch]
    s = np.stack([wander.state_at(a.C_nb, a.v_n, a.lat, a.lon, a.alt) for a in begin.starts])
    s[:, wander.LAST_ANGLE] = 2.0 * logs.dtheta[which, first] - logs.dtheta[which, first + 1]
    s[:, wander.LAST_VELOCITY] = 2.0 * logs.dvel[which, first] - logs.dvel[which, first + 1]
    P = belief.P0 * np.stack([start.P for start in begin.starts])
    P0 = P.copy()
    p, z, errors = np.zeros((B, model.PARAMETERS)), np.zeros((B, 3)), np.zeros((B, 7))
    tracks = tuple(_room(logs.time[begin.epoch :], float(np.sqrt(a.P[DK, DK]))) for a in begin.starts)
    lost, acted = np.zeros(B, dtype=np.bool_), np.zeros(B)
    kind = METHODS[method] if isinstance(method, str) else method
    gate, state, tracking = GATE if gated else None, None, kind.tracking
    system: NonlinearSystem | None = None
    for k in range(count):
        ends = logs.rows[begin.epoch + k : begin.epoch + k + 2]
        mechanise_interval(logs.steps, logs.dtheta, logs.dvel, logs.wheel, which, ends[0], ends[1], errors, s, p, z)
        if system is None:
            system = NonlinearSystem(
                model.transition,
                model.measurement,
                Q=belief.Q * np.diag(begin.noise * p[0, model.T])[None],
                R=belief.R * R_SIGMA**2 * np.eye(3)[None],
                z=z[:, None, :],
                x0=np.zeros(STATES),
                P0=P,
                p=p[:, None, :],
                transition_jacobian=model.transition_jacobian,
                measurement_jacobian=model.measurement_jacobian,
            )
        else:
            system = system.with_arrays(z=z[:, None, :], p=p[:, None, :])
        found = kind.run(system, state, gate)
        if tracking:
            acted += found.adaptation[:, -1, 0] > 1.0
        innovation_sigma = np.sqrt(np.einsum("bii->bi", found.innovation_covariance[:, -1]))
        for b, (said,) in enumerate(track.residuals for track in tracks):
            said.innovation[k], said.sigma[k] = found.innovation[b, -1], innovation_sigma[b]
            said.nis[k] = found.nis[b, -1]
            if gated:
                said.used[k] = found.adaptation[b, -1, int(tracking)] > 0.0
        x = found.x[:, -1]
        P = model.after_correction(x, found.P[:, -1], velocity=turned)
        gone = ~(np.all(np.isfinite(x), axis=1) & (np.abs(x[:, :2]).max(axis=1) < LOST))
        gone |= ~(np.einsum("bii->bi", P)[:, :2].max(axis=1) < LOST**2)
        lost |= gone
        x[gone], P[gone] = 0.0, P0[gone]
        C = model.correction(x) @ dcm_from_quaternion(s[:, wander.ATTITUDE])
        s[:, wander.ATTITUDE] = quaternion_from_dcm(C)
        s[:, wander.VELOCITY] -= x[:, DV]
        for b in range(B):
            wander.displace(s[b], -x[b, DP.start], -x[b, DP.start + 1], -x[b, DP.start + 2])
        errors[:, :3] += x[:, BG]
        errors[:, 3:6] += x[:, BA]
        errors[:, 6] += x[:, DK]
        state = FilterState(np.zeros((B, STATES)), P, found.state.log_likelihood, found.state.memory)
        C_nb, v_n, position, _ = wander.north(s)
        for b, track in enumerate(tracks):
            track.C_nb[k], track.v_n[k], track.position[k] = C_nb[b], v_n[b], position[b]
            track.sensors[k, BG.start :], track.P[k] = errors[b], P[b]
    return Found(tracks, lost, acted / max(count, 1))


def _room(time: Array, scale_sigma: float) -> Track:
    """A track to be filled in; `scale_sigma` is the odometer's at the start."""
    K = len(time)
    three, used = (K, 3), np.ones(K, dtype=np.bool_)
    said = Residuals(
        "odometer displacement",
        time,
        np.empty(three),
        np.empty(three),
        np.empty(K),
        used,
        outside=0,
        stamp=time,
        jumped=np.zeros(K, dtype=np.bool_),
        unit="m",
    )
    return Track(
        time,
        np.empty((*three, 3)),
        np.empty(three),
        np.empty(three),
        np.zeros((K, STATES)),
        np.empty((K, STATES, STATES)),
        Layout(("odometer scale",), ((scale_sigma,),)),
        (said,),
    )
