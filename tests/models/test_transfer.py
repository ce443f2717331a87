"""The model of transfer alignment against finite differences of the real mechanisation and of the simulated master."""

import numpy as np
import pytest
from scipy.linalg import expm

from truenorth.core.attitude import dcm_from_rotation_vector, euler_from_dcm, rotation_vector_from_dcm
from truenorth.core.earth import earth_rate_n, transport_rate_n
from truenorth.core.errors import UsageError
from truenorth.core.position import Position
from truenorth.models.transfer import (
    ARM,
    BA,
    BG,
    DV,
    FLEX,
    MOUNT,
    PHI,
    STATES,
    TAU,
    TransferModel,
    attitude_rows,
    velocity_rows,
)
from truenorth.records import ImuRecord
from truenorth.simulation import MasterSpec, ideal_log, simulate_master
from truenorth.simulation.course import course
from truenorth.simulation.manoeuvres import straight, turn
from truenorth.strapdown.level import NavigationState, mechanise

RATE, SPAN = 50.0, 40.0
ALL = TransferModel(0.0, 0.0, mounting=True, flexure_sigma=(1e-3, 2e-3, 3e-3), flexure_beta=0.7)


@pytest.fixture(scope="module")
def flight():
    """A banked turn at 200 m/s: nothing is zero."""
    legs = [*straight(3.0), *turn(np.radians(60.0), np.radians(3.0), "coordinated"), *straight(40.0)]
    motion = course(Position(np.radians(34.0), 0.3, 5000.0), legs, heading=np.radians(30.0), speed=200.0, slope=0.02)
    log = ideal_log(motion, rate=RATE, duration=SPAN)
    return motion, ImuRecord(log.edges[1:], log.dtheta, log.dvel, "increments")


STEP = {0: 1e-3, 1: 1e-5, 2: 1e-4, 3: 1e-7}


@pytest.mark.parametrize("state", range(STATES))
def test_dynamics_are_the_derivative_of_the_mechanisation(flight, state):
    """Within 1/200 of the largest effect on velocity and on attitude: the position error is left out."""
    motion, record = flight
    s = motion.states(0.0)
    dx = np.zeros(ALL.states)
    dx[state] = STEP[state // 3]

    def carried(dx):
        C = dcm_from_rotation_vector(-dx[PHI]) @ s.C_nb
        start = NavigationState.at(C, float(s.lat), float(s.lon), float(s.alt), s.v_n + dx[DV])
        moved = ImuRecord(record.time, record.gyro + dx[BG] / RATE, record.accel + dx[BA] / RATE, "increments")
        return mechanise(moved, start)

    base, moved = carried(np.zeros(ALL.states)), carried(dx)
    every = 10
    at = motion.states(record.time.reshape(-1, every).mean(axis=1) - 0.5 / RATE)
    f = np.einsum("kij,kj->ki", at.C_nb, at.f_b)
    T = np.full(len(f), every / RATE)
    Phi, _ = ALL.linearise(T, at.C_nb, f, at.v_n, at.lat, at.alt, at.w_ib_b)
    predicted = []
    for step in Phi:
        dx = step @ dx
        predicted.append(dx)
    rows = slice(every - 1, None, every)
    phi = -rotation_vector_from_dcm(moved.C_nb[rows] @ np.swapaxes(base.C_nb[rows], 1, 2))
    for group, seen, least in ((DV, moved.v_n[rows] - base.v_n[rows], 1e-7), (PHI, phi, 1e-9)):
        atol = 5e-3 * np.max(np.abs(seen)) + least
        np.testing.assert_allclose(np.array(predicted)[:, group], seen, rtol=0, atol=atol)


def _measured(motion, t, dx, arm, C_mb):
    """What the model calls z, of a slave with errors `dx` and a simulated master with the delay, arm and mounting of `dx`."""
    at = motion.states(t)
    true_mb = (
        dcm_from_rotation_vector(dx[ALL.slice_of(MOUNT)]) @ C_mb @ dcm_from_rotation_vector(dx[ALL.slice_of(FLEX)])
    )
    heading, pitch, roll = euler_from_dcm(true_mb)
    tau = float(dx[ALL.places[TAU]])
    spec = MasterSpec(
        rate=10.0,
        latency=max(tau, 0.0),
        lever_arm=tuple(arm + dx[ALL.slice_of(ARM)]),
        mounting=(float(heading), float(pitch), float(roll)),
    )
    master = simulate_master(motion, spec, duration=1.0, start=float(t) - tau).record
    C = dcm_from_rotation_vector(-dx[PHI]) @ at.C_nb
    w_ie, w_en = earth_rate_n(at.lat), transport_rate_n(at.lat, at.alt, at.v_n)
    w_ib = at.w_ib_b + dx[BG]
    w_eb, w_nb = w_ib - at.C_nb.T @ w_ie, w_ib - at.C_nb.T @ (w_ie + w_en)
    H, z = np.zeros((6, ALL.states)), np.zeros((2, 3))
    args = arm, ALL.places
    velocity_rows(C, at.v_n + dx[DV], np.zeros(3), w_eb, *args, master.v_n[0], H[:3], z[0])
    attitude_rows(C, w_nb, master.C_nb[0] @ C_mb, master.C_nb[0], ALL.places, H[3:], z[1])
    return z.ravel()


@pytest.mark.parametrize("state", [*range(ALL.states - 3)])
def test_rows_are_the_derivative_of_the_measurement(flight, state):
    """In the roll into the turn, with an arm and a mounting that are not small; each column within 1 %."""
    motion, _ = flight
    t, arm = np.array(4.2), np.array([1.0, -3.0, 0.5])
    C_mb = dcm_from_rotation_vector([0.02, -0.03, 0.1])
    at = motion.states(t)
    h = 1e-3
    w_ie, w_en = earth_rate_n(at.lat), transport_rate_n(at.lat, at.alt, at.v_n)
    w_eb, w_nb = (at.w_ib_b - at.C_nb.T @ w for w in (w_ie, w_ie + w_en))

    def master_velocity(t):
        s = motion.states(np.array(t))
        return s.v_n - s.C_nb @ np.cross(s.w_ib_b - s.C_nb.T @ earth_rate_n(s.lat), arm)

    a = (master_velocity(t + h) - master_velocity(t - h)) / (2 * h)
    H = ALL.observe(at.C_nb[None], at.v_n[None], a[None], w_eb[None], w_nb[None], arm, C_mb)[0]
    dx = np.zeros(ALL.states)
    dx[state] = {0: 1e-2, 1: 1e-4, 2: 1e-2, 3: 1e-3}.get(state // 3, 1e-3)
    zero = _measured(motion, t, np.zeros(ALL.states), arm, C_mb)
    np.testing.assert_allclose(zero, 0, atol=3e-4)  # the arm on the curved earth
    seen = (_measured(motion, t, dx, arm, C_mb) - zero) / dx[state]
    np.testing.assert_allclose(seen[:3], H[:3, state], atol=1e-2 * max(np.abs(H[:3, state]).max(), 1e-3))
    np.testing.assert_allclose(seen[3:], H[3:, state], atol=1e-2 * max(np.abs(H[3:, state]).max(), 1e-3))


def test_flexure_is_a_second_order_gauss_markov_process():
    T, beta = 0.3, ALL.flexure_beta
    args = (np.array([T]), np.eye(3)[None], np.zeros((1, 3)), np.zeros((1, 3)), np.array([0.5]), np.array([0.0]))
    Phi, Q = ALL.linearise(*args, np.zeros((1, 3)))
    at = ALL.places[FLEX]
    own = expm(np.array([[0.0, 1.0], [-(beta**2), -2 * beta]]) * T)
    for i in range(3):
        pair = np.ix_([at + i, at + 3 + i], [at + i, at + 3 + i])
        np.testing.assert_allclose(Phi[0][pair], own, atol=1e-14)
        still = ALL.flexure_sigma[i] ** 2 * np.diag([1.0, beta**2])
        np.testing.assert_allclose(own @ still @ own.T + Q[0][pair], still, atol=1e-18)


def test_states_by_switches():
    counts = [
        TransferModel(0.0, 0.0, delay=d, lever_arm=r, mounting=m).states
        for d, r, m in ((0, 0, 0), (1, 0, 0), (1, 1, 0), (1, 1, 1))
    ]
    assert counts == [12, 13, 16, 19]
    assert len(ALL.names) == len(ALL.units) == ALL.states == 25
    assert ALL.names[12] == "tau"
    with pytest.raises(UsageError, match="flexure_beta"):
        TransferModel(0.0, 0.0, flexure_beta=0.0)


def test_a_handed_over_attitude_is_wrong_by_mounting_and_flexure_together():
    C, C_mb = dcm_from_rotation_vector([0.1, 0.2, 2.0]), dcm_from_rotation_vector([0.0, 0.3, 1.0])
    P = ALL.prior(0.1, 1e-5, 0.0, 0.0, mounting=1e-2, C_nb=C, C_mb=C_mb)
    J = np.zeros((3, ALL.states))
    J[:, PHI], J[:, ALL.slice_of(MOUNT)], J[:, ALL.slice_of(FLEX)] = np.eye(3), -C @ C_mb.T, -C
    np.testing.assert_allclose(J @ P @ J.T, 1e-10 * np.eye(3), atol=1e-16)
