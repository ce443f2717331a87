"""The groups of transfer alignment and the master's rows, against a simulated master and the real mechanisation."""

from dataclasses import replace

import numpy as np
import pytest

from truenorth.alignment.transfer_filter import Assumed, Matching, master_aiding
from truenorth.core.attitude import dcm_from_rotation_vector, euler_from_dcm
from truenorth.core.errors import UsageError
from truenorth.core.position import Position
from truenorth.errors.dynamics import dynamics_of
from truenorth.errors.master import (
    ARM,
    ATTITUDE_ERROR,
    DELAY,
    FLEXURE,
    MOUNTING,
    VELOCITY_ERROR,
    MasterErrors,
    TransferModel,
)
from truenorth.estimate.linear import rows_along
from truenorth.records import MasterRecord
from truenorth.records.motion import MotionStates
from truenorth.simulation import MasterSpec, simulate_sensor
from truenorth.simulation.course import course
from truenorth.simulation.manoeuvres import straight, turn
from truenorth.state.layout import BG, DV, PHI, STATES

OF_MASTER = MasterErrors(level=1e-4, heading=1e-3, velocity=0.05, correlation_time=200.0)
ALL = TransferModel(0.0, 0.0, mounting=True, flexure_sigma=(1e-3, 2e-3, 3e-3), flexure_beta=0.7, master=OF_MASTER)
ROWS = [*range(6), *range(9, 12), *range(15, 25), *range(28, 34)]  # all but position, acceleration, rates of flexure
ARM_AS_ASSUMED, T = np.array([1.0, -3.0, 0.5]), 4.2


@pytest.fixture(scope="module")
def flight():
    """A banked turn at 200 m/s: nothing is zero."""
    legs = [*straight(3.0), *turn(np.radians(60.0), np.radians(3.0), "coordinated"), *straight(40.0)]
    return course(Position(np.radians(34.0), 0.3, 5000.0), legs, heading=np.radians(30.0), speed=200.0, slope=0.02)


def measured(motion, dx, C_mb):
    """z and H of a slave with errors `dx` against a simulated master with the delay, arm, mounting and errors of `dx`."""
    at = motion.states(np.array([T]))
    part = {name: dx[ALL.slice_of(name)] for name in ALL.groups}
    bent = dcm_from_rotation_vector(part[FLEXURE])
    heading, pitch, roll = euler_from_dcm(dcm_from_rotation_vector(part[MOUNTING]) @ C_mb @ bent)
    tau = float(part[DELAY][0])
    angles = (float(heading), float(pitch), float(roll))
    spec = MasterSpec(rate=10.0, latency=max(tau, 0.0), lever_arm=tuple(ARM_AS_ASSUMED + part[ARM]), mounting=angles)
    true = simulate_sensor(motion, spec, duration=1.0, start=T - tau).record
    C_nm = dcm_from_rotation_vector(-part[ATTITUDE_ERROR]) @ true.C_nb[:1]
    master = MasterRecord(np.array([0.0, 1.0]), C_nb=C_nm[[0, 0]], v_n=(true.v_n[:1] + part[VELOCITY_ERROR])[[0, 0]])
    slave = MotionStates(
        at.time,
        dcm_from_rotation_vector(-dx[PHI]) @ at.C_nb,
        at.v_n + dx[DV],
        at.lat,
        at.lon,
        at.alt,
        at.w_ib_b + dx[BG],
        at.f_b,
        at.w_ib_b * 0.0,
    )
    sources = master_aiding(master, ALL, Assumed(ARM_AS_ASSUMED, C_mb=C_mb), Matching(1.0, 1.0))
    sources = [
        replace(s, **{name: getattr(s, name)[:1].copy() for name in ("time", "measured", "sigma")}) for s in sources
    ]
    given = sources[0].measured.copy()
    given[0, 3:6] = master_acceleration(motion)
    sources[0] = replace(sources[0], measured=given)
    z, H = rows_along(slave, sources, ALL.ins)
    return z[0], H[0]


def master_acceleration(motion):
    def velocity(t):
        s = motion.states(np.array(t))
        w_ie = 7.292115e-5 * np.array([0.0, np.cos(s.lat), np.sin(s.lat)])
        return s.v_n - s.C_nb @ np.cross(s.w_ib_b - s.C_nb.T @ w_ie, ARM_AS_ASSUMED)

    h = 1e-3
    return (velocity(T + h) - velocity(T - h)) / (2 * h)


@pytest.mark.parametrize("state", ROWS)
def test_rows_are_the_derivative_of_the_measurement(flight, state):
    """In the roll into the turn, with an arm and a mounting that are not small; each column within 1 %."""
    C_mb = dcm_from_rotation_vector([0.02, -0.03, 0.1])
    zero, H = measured(flight, np.zeros(ALL.states), C_mb)
    np.testing.assert_allclose(zero, 0, atol=3e-4)  # the arm on the curved earth
    dx = np.zeros(ALL.states)
    dx[state] = 1e-4 if state < 3 else 1e-2 if state < 6 else 1e-3
    seen = (measured(flight, dx, C_mb)[0] - zero) / dx[state]
    for rows in (slice(0, 3), slice(3, 6)):
        expected = H[rows, state]
        np.testing.assert_allclose(seen[rows], expected, atol=1e-2 * max(np.abs(expected).max(), 1e-3))


def test_groups_by_switches():
    counts = [
        TransferModel(0.0, 0.0, delay=d, lever_arm=r, mounting=m).states
        for d, r, m in ((0, 0, 0), (1, 0, 0), (1, 1, 0), (1, 1, 1))
    ]
    assert counts == [15, 16, 19, 22]
    assert len(ALL.names) == len(ALL.units) == ALL.states == 34
    assert ALL.names[ALL.slice_of(DELAY).start] == "tau"
    with pytest.raises(UsageError, match="flexure_beta"):
        TransferModel(0.0, 0.0, flexure_beta=0.0)
    with pytest.raises(UsageError, match="zero or more"):
        MasterErrors(level=-1.0)


def test_a_handed_over_attitude_is_wrong_by_mounting_flexure_and_master_together():
    C, C_mb = dcm_from_rotation_vector([0.1, 0.2, 2.0]), dcm_from_rotation_vector([0.0, 0.3, 1.0])
    P = ALL.prior(0.1, 1e-5, 0.0, 0.0, mounting=1e-2, C_nb=C, C_mb=C_mb)
    J = np.zeros((6, ALL.states))
    J[:3, PHI], J[:3, ALL.slice_of(MOUNTING)], J[:3, ALL.slice_of(FLEXURE)] = np.eye(3), -C @ C_mb.T, -C
    J[:3, ALL.slice_of(ATTITUDE_ERROR)] = -np.eye(3)
    J[3:, DV], J[3:, ALL.slice_of(VELOCITY_ERROR)] = np.eye(3), -np.eye(3)
    np.testing.assert_allclose(J @ P @ J.T, np.diag([1e-10] * 3 + [1e-2] * 3), atol=1e-16)


def test_a_constant_and_a_drift_are_one_process():
    """Of the variance of both at all times; over a short time it changes by as much as the drift alone: ``2 d^2 t/tau``."""
    own = MasterErrors(
        level=3e-4, heading=2e-3, velocity=0.05, attitude_drift=1e-4, velocity_drift=0.1, correlation_time=90.0
    )
    groups = TransferModel(master=own).groups
    dynamics = dynamics_of((groups[ATTITUDE_ERROR], groups[VELOCITY_ERROR]), np.zeros(STATES))
    stays = dynamics.noise[STATES:] / (2.0 * dynamics.decay[STATES:])
    constant, drift = np.array([3e-4, 3e-4, 2e-3, *[0.05] * 3]), np.repeat([1e-4, 0.1], 3)
    np.testing.assert_allclose(stays, constant**2 + drift**2)
    np.testing.assert_allclose(dynamics.noise[STATES:], 2.0 * drift**2 / 90.0)
    turned = TransferModel(master=replace(own, heading_drift=5e-4)).groups[ATTITUDE_ERROR]  # of a size of its own
    dynamics = dynamics_of((turned,), np.zeros(STATES))
    np.testing.assert_allclose(dynamics.noise[STATES:], 2.0 * np.square([1e-4, 1e-4, 5e-4]) / 90.0)
    steady = TransferModel(master=replace(own, attitude_drift=0.0)).groups[ATTITUDE_ERROR]
    assert np.isinf(steady.lasts).all()
    with pytest.raises(UsageError, match="correlation time"):
        replace(steady, correlation_time=np.array([1.0, 0.0, 1.0]))
