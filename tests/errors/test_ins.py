"""The INS error model against finite differences of the real mechanisation, and its noise against theory."""

from dataclasses import replace

import numpy as np
import pytest

from truenorth.core.attitude import dcm_from_rotation_vector, rotation_vector_from_dcm
from truenorth.core.earth import radii
from truenorth.core.position import Position
from truenorth.errors.intervals import Intervals
from truenorth.errors.model import InsModel
from truenorth.records import ImuRecord
from truenorth.simulation import ideal_log
from truenorth.simulation.course import course
from truenorth.simulation.manoeuvres import straight, turn
from truenorth.state.layout import BA, BG, DP, DV, PHI, STATES
from truenorth.state.state import State
from truenorth.strapdown.level import mechanise

LAT, ALT, SPEED = np.radians(60.0), 3000.0, 200.0
RATE = 50.0


@pytest.fixture(scope="module")
def flight():
    """A climbing, banked turn at 200 m/s: nothing is zero."""
    legs = [*straight(5.0), *turn(np.radians(60.0), np.radians(3.0), "coordinated"), *straight(40.0)]
    motion = course(Position(LAT, 0.3, ALT), legs, heading=np.radians(30.0), speed=SPEED, slope=0.02)
    log = ideal_log(motion, rate=RATE, duration=60.0)
    return motion, ImuRecord(log.edges[1:], log.dtheta, log.dvel, "increments")


def _start(motion, dx):
    """The state at time 0 with the errors `dx` made."""
    s = motion.states(0.0)
    R_M, R_N = radii(s.lat)
    C = dcm_from_rotation_vector(-dx[PHI]) @ s.C_nb
    lat = s.lat + dx[DP][1] / (R_M + s.alt)
    lon = s.lon + dx[DP][0] / ((R_N + s.alt) * np.cos(s.lat))
    return State.at(C, lat, lon, s.alt + dx[DP][2], s.v_n + dx[DV])


def _errors(out, base):
    """(K, 9) phi, dv, dp of one mechanisation against another."""
    phi = -rotation_vector_from_dcm(out.C_nb @ np.swapaxes(base.C_nb, 1, 2))
    R_M, R_N = radii(base.position[:, 0])
    dL, dlon, dh = (out.position - base.position).T
    h = base.position[:, 2]
    dp = np.stack([(R_N + h) * np.cos(base.position[:, 0]) * dlon, (R_M + h) * dL, dh], axis=1)
    return np.hstack([phi, out.v_n - base.v_n, dp])


def _nominal(record, base):
    """Means over half a second: what the filter works with."""
    every = 25
    C, v, p = base.C_nb, base.v_n, base.position
    C = np.concatenate([C[:1], C])
    f = np.einsum("kij,kj->ki", 0.5 * (C[1:] + C[:-1]), record.accel * RATE)
    mean = lambda a: a[: len(a) // every * every].reshape(-1, every, *a.shape[1:]).mean(axis=1)  # noqa: E731
    return np.full(len(f) // every, every / RATE), mean(C[1:]), mean(f), mean(v), mean(p[:, 0]), mean(p[:, 2]), every


STEP = {0: 1e-5, 1: 1e-3, 2: 10.0, 3: 1e-7, 4: 1e-4}


@pytest.mark.parametrize("altitude", ["free", "fixed"])
@pytest.mark.parametrize("state", range(STATES))
def test_jacobian_is_the_derivative_of_the_mechanisation(flight, state, altitude):
    """Carry each state through 60 s of flight; compare with the flight mechanised with that error really made.

    What the model leaves out (change of radii, second order of the interval) is below 1/200 of the largest effect on
    each group of states, and tilts of a nanoradian, millimetres of position are rounding of the mechanisation.
    """
    motion, record = flight
    dx = np.zeros(STATES)
    dx[state] = STEP[state // 3]
    if altitude == "fixed" and state == DV.stop - 1:
        pytest.skip("vertical velocity has no error where it is zero by definition")
    if altitude == "fixed":
        start = _start(motion, np.zeros(STATES))
        level = start.v_n * [1, 1, 0]
        base = mechanise(record, replace(start, v_n=level), altitude="fixed")
    else:
        base = mechanise(record, _start(motion, np.zeros(STATES)), altitude=altitude)
    wrong = ImuRecord(record.time, record.gyro + dx[BG] / RATE, record.accel + dx[BA] / RATE, "increments")
    start = _start(motion, dx)
    if altitude == "fixed":
        start = replace(start, v_n=start.v_n * [1, 1, 0])
    moved = mechanise(wrong, start, altitude=altitude)

    T, C, f, v, lat, alt, every = _nominal(record, base)
    Phi, _ = InsModel(0.0, 0.0, fixed_altitude=altitude == "fixed").linearise(Intervals(T, C, f, v, lat, alt))
    expected = _errors(moved, base)[every - 1 :: every]
    predicted = np.empty((len(Phi), STATES))
    x = dx
    for k in range(len(Phi)):
        x = Phi[k] @ x
        predicted[k] = x
    for group, least in ((PHI, 1e-9), (DV, 1e-7), (DP, 2e-3)):
        scale = np.max(np.abs(expected[:, group]))
        np.testing.assert_allclose(predicted[:, group], expected[:, group], rtol=0, atol=5e-3 * scale + least)
