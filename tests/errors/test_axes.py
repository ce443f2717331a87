"""Scale factors and misalignments of an INS under way: columns against the mechanisation, the prior against the joint Gaussian."""

from dataclasses import replace

import numpy as np
import pytest

from truenorth.core.attitude import rotation_vector_from_dcm
from truenorth.core.position import Position
from truenorth.errors.axes import axis_groups, known_as_bias, standing
from truenorth.errors.intervals import Intervals
from truenorth.errors.model import InsModel
from truenorth.estimate.run import navigate_track
from truenorth.records.specs import ImuSpec, imu_spec
from truenorth.simulation import ideal_log, simulate
from truenorth.simulation.course import course
from truenorth.simulation.manoeuvres import accelerate, climb, straight, turn
from truenorth.state.layout import ACCEL_AXES, BA, DV, GYRO_AXES, PHI, STATES
from truenorth.state.state import Start

SPEC = ImuSpec(gyro_scale_factor=1e-3, gyro_misalignment=1e-3, accel_scale_factor=1e-3, accel_misalignment=1e-3)
SIZE = 1e-5
SECONDS, INTERVAL = 40.0, 0.2


@pytest.fixture(scope="module")
def drive():
    """A car that drives off, turns, climbs and turns back."""
    off = [*straight(3.0), *accelerate(12.0, 2.0, before=0.0)]
    legs = [*off, *turn(1.2, 0.2), *climb(0.05, 6.0), *turn(-0.9, 0.2), *straight(20.0)]
    motion = course(Position.from_degrees(47.0, 8.0, 400.0), legs, heading=0.7)
    record = simulate(ideal_log(motion, rate=50.0, duration=SECONDS)).record
    at = motion.states(np.array([0.0]))
    zero = np.zeros(3)
    start = Start(0.0, at.C_nb[0], at.v_n[0], at.lat[0], at.lon[0], at.alt[0], zero, zero, np.zeros((STATES, STATES)))
    return motion, record, start


def spoilt(record, sensor, matrix):
    """The record of sensors with this matrix."""
    own = getattr(record, sensor)
    return replace(record, **{sensor: own + own @ matrix.T})


def errors(track, true):
    phi = -rotation_vector_from_dcm(track.C_nb @ np.swapaxes(true.C_nb, 1, 2))
    return np.concatenate([phi, track.v_n - true.v_n], axis=1)


@pytest.mark.parametrize("element", range(9))
@pytest.mark.parametrize("name", [GYRO_AXES, ACCEL_AXES])
def test_columns_are_the_derivative_of_the_mechanisation(drive, name, element):
    """One element is really wrong: what the INS then errs by is what the covariance of that element alone says.

    Gravity acts through the accelerometer bias, which holds ``M f0``. Second order of an interval (a turn of 2 deg) is left out.
    """
    motion, record, start = drive
    model = InsModel.from_spec(SPEC, standing=standing(start.C_nb), every_axis=True)
    matrix = np.zeros(9)
    matrix[element] = SIZE
    matrix = matrix.reshape(3, 3)
    x = np.zeros(model.states)
    x[model.layout.slice_of(name)] = matrix.ravel()
    if name == ACCEL_AXES:
        x[BA] = matrix @ standing(start.C_nb)
    options = {"interval": INTERVAL, "every": 5}
    base = navigate_track(record, start, model, prior=(np.outer(x, x), np.zeros(model.states)), **options)
    wrong = spoilt(record, "gyro" if name == GYRO_AXES else "accel", matrix)
    made = errors(navigate_track(wrong, start, model, covariance=False, **options), base)
    said = np.sqrt(np.maximum(np.einsum("kii->ki", base.P)[:, :6], 0.0))
    for part in (PHI, DV):
        largest = np.abs(made[:, part]).max()
        np.testing.assert_allclose(np.abs(made[:, part]), said[:, part], rtol=0, atol=0.01 * largest + 3e-8)
    # With these errors assumed nothing is left of them.
    assumed = navigate_track(wrong, start, model, prior=(np.outer(x, x), x), **options)
    left, whole = errors(assumed, base)[-1], np.abs(made[-1])
    assert np.all(np.abs(left[PHI]) < 0.03 * whole[PHI].max() + 1e-9)
    assert np.all(np.abs(left[DV]) < 0.03 * whole[DV].max() + 1e-7)
    # The same columns where a log is linearised as a whole.
    ends = np.arange(INTERVAL, SECONDS + 0.1 * INTERVAL, INTERVAL)
    at = motion.states(ends - 0.5 * INTERVAL)
    T, f_n = np.full(len(ends), INTERVAL), np.einsum("kij,kj->ki", at.C_nb, at.f_b)
    Phi, _ = model.linearise(Intervals(T, at.C_nb, f_n, at.v_n, at.lat, at.alt, at.w_ib_b))
    for step in Phi:
        x = step @ x
    for part in (PHI, DV):
        largest = np.abs(made[:, part]).max()
        np.testing.assert_allclose(x[part], made[-1, part], rtol=0, atol=0.02 * largest + 3e-8)


def test_only_what_matters_is_a_state():
    noisy = replace(SPEC, gyro_random_walk=0.1, accel_random_walk=0.1)
    assert axis_groups(ImuSpec(), standing()) == ()
    assert [group.name for group in axis_groups(SPEC, standing())] == [GYRO_AXES, ACCEL_AXES]
    assert axis_groups(noisy, standing()) == ()
    assert len(axis_groups(noisy, standing(), always=True)) == 2
    quiet = InsModel.from_spec(SPEC, standing=standing())
    assert quiet.turn_noise == (0.0, 0.0)
    assert min(InsModel.from_spec(noisy, standing=standing()).turn_noise) > 0.0
    assert min(InsModel.from_spec(SPEC).turn_noise) > 0.0


@pytest.mark.parametrize("known", [False, True])
def test_prior_is_that_of_the_joint_gaussian(known):
    """The bias ``nabla + M f0`` as levelling knows it (`known`: measured with an error, tilt hanging on it), by hand."""
    spec = imu_spec("consumer")
    force = np.array([1.0, -2.0, 9.5])
    model = InsModel.from_spec(spec, standing=force)
    group = model.groups[model.layout.names.index(ACCEL_AXES)]
    own = model.layout.slice_of(ACCEL_AXES)
    # nabla (3), M (9), phi (3)
    joint = np.diag(np.concatenate([np.full(3, spec.accel_bias**2), group.sigma**2, np.zeros(3)]))
    see = np.hstack([np.eye(3), np.kron(np.eye(3), force), np.zeros((3, 3))])
    constant = np.diag(see @ joint @ see.T)
    state = see
    if known:
        noise = 0.2 * np.diag(constant)
        gain = joint @ see.T @ np.linalg.inv(see @ joint @ see.T + noise)
        joint = joint - gain @ see @ joint
    tilt = -0.1 * see  # levelled: phi is what the bias says
    rows = np.vstack([tilt, state, np.hstack([np.zeros((9, 3)), np.eye(9), np.zeros((9, 3))])])
    wanted = rows @ joint @ rows.T
    at = [*range(3), *range(STATES)[BA], *range(own.start, own.stop)]
    P = model.prior(np.zeros((STATES, STATES)))
    values = np.zeros(model.states)
    if known:
        P[np.ix_(at[:6], at[:6])] = wanted[:6, :6]
        values[BA] = [0.1, 0.2, 0.3]
    else:
        P[BA, BA] = spec.accel_bias**2 * np.eye(3)
        wanted[:3], wanted[:, :3] = 0.0, 0.0
    P, values = known_as_bias(P, values, group, own.start, constant if known else None)
    np.testing.assert_allclose(P[np.ix_(at, at)], wanted, rtol=1e-9, atol=1e-18)
    np.testing.assert_allclose(
        np.kron(np.eye(3), force) @ values[own], values[BA] * (1.0 - spec.accel_bias**2 / constant)
    )
