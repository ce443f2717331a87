"""Measurement rows against finite differences of the predicted measurement itself."""

from dataclasses import replace

import numpy as np
import pytest

from truenorth.aiding.heading import HEADING
from truenorth.aiding.magnetometer import FIELD
from truenorth.aiding.position import CONVERGING_POSITION
from truenorth.aiding.source import KINDS, Aiding, state
from truenorth.aiding.velocity import SHAKEN_VELOCITY, SMOOTHED_VELOCITY
from truenorth.aiding.wheel import COUNTED_FORWARD, SPRUNG_WHEEL, WHEEL
from truenorth.core.attitude import dcm_from_euler, dcm_from_rotation_vector
from truenorth.core.linalg import padded
from truenorth.errors.axes import gyro_axes
from truenorth.errors.group import Group
from truenorth.errors.model import InsModel
from truenorth.estimate.correct import feed_back, measure
from truenorth.estimate.memory import Model, memory
from truenorth.estimate.predict import describe
from truenorth.estimate.run import kernel_sources, with_states
from truenorth.filters.recursion import workspace
from truenorth.records.specs import imu_spec
from truenorth.state.layout import BG, GYRO_AXES
from truenorth.state.now import NOW_LENGTH, NOW_OTHER_RATE, NOW_PUSH, NOW_RATE, NOW_RATE_NOISE, NOW_TURN
from truenorth.strapdown import wander

LAT, LON, ALT = 1.2, -2.0, 500.0
MODEL = InsModel(0.0, 0.0, groups=(Group("slow gyro bias", np.full(3, 1e-6), 300.0),))
W_B = np.array([0.3, -0.2, 0.5])
DRIFTING = "velocity by another clock"

ROWS = {**KINDS, "odometer": WHEEL, "heading": HEADING, "magnetic field": FIELD, "smoothed velocity": SMOOTHED_VELOCITY}
ROWS["shaken velocity"] = SHAKEN_VELOCITY
ROWS[DRIFTING] = KINDS["velocity"]
ROWS["converging position"] = CONVERGING_POSITION
ROWS["sprung wheel"] = SPRUNG_WHEEL

LATE = {"body velocity": 0.05, "odometer": 0.05, "sprung wheel": 0.05, "shaken velocity": 0.02}


def _aiding(kind):
    states = {}
    for role, length in ROWS[kind].sizes.items():
        states |= state("sensor", role, np.ones(length))
    if kind == DRIFTING:
        states["lag"] = replace(states["lag"], drift=1e-4)
    measured = {
        "position": [LAT + 1e-6, LON - 1e-6, ALT + 3.0],
        "converging position": [LAT + 1e-6, LON - 1e-6, ALT + 3.0, 2.0, 3.0, 5.0],
        "heading": [0.3],
        "smoothed velocity": [1.0, 2.0, 3.0, 0.4, -0.3, 0.6, 0.3, -0.2, 0.4, 0.8, -0.5, 0.7],
        "shaken velocity": [1.0, 2.0, 3.0, 0.4, -0.3, 0.6, 0.3, -0.2, 0.4, 0.8, -0.5, 0.7, 0.3, -0.6, 9.1],
        "sprung wheel": [1.0, 2.0, 3.0, 0.4, -0.3, 0.6, 0.3, -0.2, 0.4, 0.8, -0.5, 0.7],
    }.get(kind, [1.0, 2.0, 3.0])
    C_mb = dcm_from_rotation_vector([0.1, -0.2, 0.3])
    figures = {"magnetic field": (0.05, 0.4, -0.9), "odometer": COUNTED_FORWARD, DRIFTING: (1.0,)}
    figures["sprung wheel"] = COUNTED_FORWARD
    arm, own = np.array([1.0, -2.0, 3.0]), figures.get(kind, ())
    return Aiding("sensor", ROWS[kind], [0.0], [measured], [[1.0] * 3], arm, C_mb, states, figures=own)


def _predicted(kind, dx):
    """z and H of a state that is off by `dx`."""
    source = _aiding(kind)
    model = with_states(MODEL, [source])
    n = model.states
    s = wander.state_at(dcm_from_euler(0.4, 0.1, -0.2), [60.0, 30.0, 2.0], LAT, LON, ALT)
    # Let w wander, so that it is not ENU.
    turn = np.array([np.cos(0.3), 0.0, 0.0, np.sin(0.3)])
    from scipy.spatial.transform import Rotation

    spin = Rotation.from_quat(np.roll(turn, -1))
    s[wander.PLACE] = np.roll((Rotation.from_quat(np.roll(s[wander.PLACE], -1)) * spin).as_quat(), 1)
    s[wander.ATTITUDE] = np.roll((spin.inv() * Rotation.from_quat(np.roll(s[wander.ATTITUDE], -1))).as_quat(), 1)
    s[wander.VELOCITY] = spin.inv().apply(s[wander.VELOCITY])
    s[wander.ACCELERATION] = [1.0, -2.0, 0.5]
    aux = np.zeros(n)
    for role, group in source.states.items():  # small-angle mounting is exact for small assumed angles only
        aux[model.layout.slice_of(group.name)] = 1e-4 if role == "mounting" else 0.02
        if group.drift > 0.0:  # small as well: the row is linear in it
            aux[model.layout.slice_of(group.name).stop - 1] = 1e-4
    x = -dx.copy()
    feed_back(s, aux, x, np.zeros(0, np.int64))
    m = memory(s, aux, np.eye(n), 0.0, 1)
    wander.set_matrix(s, m.sums.C_now)
    m.means.vectors[3] = [
        0.4,
        -1.2,
        9.8,
    ]  # not by what the state is off: a bias times a compliance is of the second order
    m.means.vectors[2] = W_B + dx[BG] + dx[model.layout.slice_of("slow gyro bias")]
    w, now, R = workspace(padded(n), 3), np.zeros(NOW_LENGTH), np.ones(3)
    compiled_model = Model(
        model.dynamics, model.sensor_states, False, 0.0, 0.0, 0, np.zeros(0, dtype=np.int64), True, False
    )
    describe(m, compiled_model, now)
    now[NOW_OTHER_RATE : NOW_OTHER_RATE + 3] = m.means.vectors[2]
    measure(m, compiled_model, kernel_sources([source], model), 0, source.measured[0].copy(), now, w, R)
    return w.z.copy(), w.H[:, :n].copy(), n


@pytest.mark.parametrize("kind", list(ROWS))
def test_row_is_the_derivative_of_the_prediction(kind):
    """Central differences; steps small enough that what is left is of the second order of a small step.

    The lag enters multiplied by the change of what is measured, whose own change with attitude the row leaves out: its
    assumed value here is 20 ms, so 2 % of the effect of acceleration is granted.
    """
    z, H, n = _predicted(kind, np.zeros(18 + _extra_states(kind)))
    rows = np.isfinite(z)
    assert rows.sum() == ROWS[kind].rows
    steps = np.repeat([1e-5, 1e-3, 10.0, 1e-6, 1e-4], 3)
    steps = np.concatenate([steps, np.full(3, 1e-6), np.full(n - 18, 1e-4)])
    for state_number in range(n):
        dx = np.zeros(n)
        dx[state_number] = steps[state_number]
        plus, minus = _predicted(kind, dx)[0], _predicted(kind, -dx)[0]
        expected = (plus - minus)[rows] / (2 * steps[state_number])
        scale = max(np.abs(H[rows]).max(axis=0)[state_number], np.abs(expected).max())
        atol = 2e-3 * scale + 1e-9 + (LATE.get(kind, 0.0) if state_number < 3 else 0.0)
        # The turn of a drift by the convergence of the meridians: 2 cm/s times less than 1e-6 rad/m.
        atol += 2e-8 if kind in ("body velocity", "odometer", "sprung wheel") and 6 <= state_number < 9 else 0.0
        np.testing.assert_allclose(H[rows, state_number], expected, rtol=0, atol=atol, err_msg=f"state {state_number}")


def _extra_states(kind):
    return sum(ROWS[kind].sizes.values()) + (kind == DRIFTING)


@pytest.mark.parametrize("w", [(0.0, 0.0, 0.3), (0.05, -0.1, 0.2)])
def test_a_late_body_velocity_is_that_of_the_earlier_axes(w):
    """In a steady turn a log's velocity stays as it is, whatever its latency; the error is of its second order."""
    from scipy.spatial.transform import Rotation

    from truenorth.aiding.body_velocity import body_velocity_row

    v_b, w, arm, lag = np.array([0.3, 20.0, 0.1]), np.array(w), np.array([0.5, -1.0, 0.2]), 0.1
    C = dcm_from_euler(0.4, 0.1, -0.2)
    push = np.array([0.2, 1.0, 0.0])  # change of velocity in the turning axes
    C_mb = dcm_from_rotation_vector([0.1, -0.2, 0.3])

    def row(C, v_b, lag, aside=1.0):
        s, H, z = np.zeros(24), np.zeros((3, 32)), np.zeros(3)
        s[4:7], change_n = C @ v_b, C @ (push + np.cross(w, v_b))
        nothing = (0.0, 0.0, 0.0)
        body_velocity_row(
            s,
            C,
            tuple(w),
            tuple(change_n),
            C_mb,
            tuple(arm),
            0.02,
            nothing,
            lag,
            aside,
            -1,
            -1,
            -1,
            -1,
            31,
            np.zeros(3),
            H,
            z,
        )
        return z, H[:, 31]

    late, change = row(C, v_b, lag)
    before = row(C @ Rotation.from_rotvec(-lag * w).as_matrix(), v_b - lag * push, 0.0)[0]
    np.testing.assert_allclose(late, before, atol=1e-12)
    np.testing.assert_allclose(change, 1.02 * C_mb @ push, atol=1e-12)
    counted, change = row(C, v_b, lag, 0.0)  # of a wheel: that it does not slide holds at every moment
    np.testing.assert_allclose(counted, [row(C, v_b, 0.0)[0][0], late[1], row(C, v_b, 0.0)[0][2]], atol=1e-12)
    np.testing.assert_allclose(change, [0.0, 1.02 * (C_mb @ push)[1], 0.0], atol=1e-12)


def test_a_late_antenna_is_shown_with_the_swing_of_the_earlier_moment():
    """By finite differences of ``v + C (w x l)`` along a motion; without the swing's change the row is off by .1 m/s."""
    from scipy.spatial.transform import Rotation

    from truenorth.aiding.velocity import velocity_row

    w, spin, push, arm, lag = (
        np.array(a) for a in ([0.3, -0.2, 0.1], [0.2, 0.4, -0.1], [0.5, -0.2, 0.1], [1.0, -2.0, 7.0], 1e-3)
    )
    C, v, nothing = dcm_from_euler(0.4, 0.1, -0.2), np.array([3.0, -2.0, 0.5]), (0.0, 0.0, 0.0)

    def row(lag, v=v, C=C, w=w):
        s = wander.state_at(C, v, LAT, LON, ALT)
        H, z = np.zeros((3, 32)), np.zeros(3)
        velocity_row(s, C, *map(tuple, (w, push, arm)), nothing, tuple(w), tuple(spin), lag, -1, 31, np.zeros(3), H, z)
        return z, H[:, 31]

    late, change = row(lag)
    before = Rotation.from_rotvec(-lag * (w - 0.5 * lag * spin))
    np.testing.assert_allclose(late, row(0.0, v - lag * push, C @ before.as_matrix(), w - lag * spin)[0], atol=1e-5)
    grown = np.cross(spin, arm) + np.cross(w, np.cross(w, arm))
    assert np.linalg.norm(grown) > 1.0
    np.testing.assert_allclose(change, push + C @ grown, atol=1e-6)


def test_a_late_place_is_that_of_the_antenna_and_not_of_the_vehicle():
    """By the place and the attitude of the earlier moment; without its swing the row is off by 4 cm, and by 2 m/s of the delay."""
    w, v, lag, noise = np.array([0.3, -0.2, 0.1]), np.array([0.3, -0.2, 0.5]), 0.02, 1e-6
    C = dcm_from_euler(0.4, 0.1, -0.2)
    source = replace(_aiding("position"), lever_arm=np.array([1.0, -2.0, 7.0]))
    model = with_states(MODEL, [source])
    where = model.layout.slice_of("sensor lag").start
    of = Model(model.dynamics, model.sensor_states, False, 0.0, 0.0, 0, np.zeros(0, dtype=np.int64), True, False)

    def row(C, lag, variance=0.0):
        s, aux = wander.state_at(C, v, LAT, LON, ALT), np.zeros(model.states)
        aux[where] = lag
        m = memory(s, aux, np.eye(model.states), 0.0, 1)
        wander.set_matrix(s, m.sums.C_now)
        room, now = workspace(padded(model.states), 3), np.zeros(NOW_LENGTH)
        describe(m, of, now)
        now[NOW_TURN : NOW_TURN + 3] = w
        now[NOW_OTHER_RATE : NOW_OTHER_RATE + 3] = w
        now[NOW_RATE_NOISE] = variance
        measure(m, of, kernel_sources([source], model), 0, source.measured[0].copy(), now, room, np.ones(3))
        return room.z.copy(), room.H[:, where].copy()

    late, column = row(C, lag)
    earlier = row(C @ dcm_from_rotation_vector(-lag * w), 0.0)[0] - lag * v
    np.testing.assert_allclose(late, earlier, atol=3e-4)  # half of its acceleration times the delay squared
    swing = C @ np.cross(w, source.lever_arm)
    assert np.linalg.norm(swing) > 2.0
    np.testing.assert_allclose(column, v + swing, atol=1e-3)
    np.testing.assert_allclose(row(C, lag, 10.0)[1], v, atol=1e-9)  # a rate within its noise
    np.testing.assert_allclose(row(C, lag, noise)[1], v + swing, atol=1e-3)


@pytest.mark.parametrize("lag", [-0.1, 0.1])
def test_a_late_place_of_a_vehicle_that_turns_is_on_its_curve(lag):
    """``p(t - tau) = p - tau v + a tau^2/2``: at 25 deg of bank .1 s leave the tangent by 23 mm, more than the noise of a fix."""
    v, push = np.array([60.0, 30.0, 2.0]), np.array([-2.0, 4.1, 0.0])
    source = replace(_aiding("position"), lever_arm=np.zeros(3))
    model = with_states(MODEL, [source])
    where = model.layout.slice_of("sensor lag").start
    of = Model(model.dynamics, model.sensor_states, False, 0.0, 0.0, 0, np.zeros(0, dtype=np.int64), True, False)

    def row(lag):
        s, aux = wander.state_at(dcm_from_euler(0.4, 0.1, -0.2), v, LAT, LON, ALT), np.zeros(model.states)
        aux[where] = lag
        m = memory(s, aux, np.eye(model.states), 0.0, 1)
        wander.set_matrix(s, m.sums.C_now)
        room, now = workspace(padded(model.states), 3), np.zeros(NOW_LENGTH)
        describe(m, of, now)
        now[NOW_PUSH : NOW_PUSH + 3] = push
        measure(m, of, kernel_sources([source], model), 0, source.measured[0].copy(), now, room, np.ones(3))
        return room.z.copy(), room.H[:, where].copy()

    late, column = row(lag)
    np.testing.assert_allclose(late, row(0.0)[0] - lag * v + 0.5 * lag**2 * push, atol=1e-3)
    np.testing.assert_allclose(column, v - lag * push, atol=1e-2)


@pytest.mark.parametrize("kind", ["velocity", "smoothed velocity", "body velocity", "odometer"])
def test_scale_and_axes_of_gyros_are_in_the_swing_of_a_sensor_on_its_arm(kind):
    """``w_hat = (I + M) w``: a row by the rate as measured, M being assumed, is that by the true rate; its columns are the change.

    The noise of the rate adds its variance along the columns of a bias.
    """
    source = _aiding(kind)
    model = with_states(replace(MODEL, groups=(*MODEL.groups, gyro_axes(imu_spec("consumer")))), [source])
    axes, n = model.layout.slice_of(GYRO_AXES), model.states
    s = wander.state_at(dcm_from_euler(0.4, 0.1, -0.2), [60.0, 30.0, 2.0], LAT, LON, ALT)
    of = Model(model.dynamics, model.sensor_states, False, 0.0, 0.0, 0, -1, True, False)
    assert of.sensors[2] == axes.start

    def row(w_b, M, noise=0.0):
        aux = np.zeros(n)
        aux[axes] = M.ravel()
        if kind == "smoothed velocity":  # what M does to the quick part is in D
            aux[model.layout.slice_of("sensor filter")] = np.cross(M, source.lever_arm, axis=0).ravel()
        m = memory(s, aux, np.eye(n), 0.0, 1)
        wander.set_matrix(s, m.sums.C_now)
        w, now, R = workspace(padded(n), 3), np.zeros(NOW_LENGTH), np.ones(3)
        describe(m, of, now)
        for place in (NOW_RATE, NOW_OTHER_RATE):
            now[place : place + 3] = w_b
        now[NOW_TURN : NOW_TURN + 3] += w_b
        now[NOW_RATE_NOISE] = noise
        measure(m, of, kernel_sources([source], model), 0, source.measured[0].copy(), now, w, R)
        return w.z.copy(), w.H[:, :n].copy(), R

    M = 0.01 * np.array([[1.0, -2.0, 0.5], [0.3, -0.8, 1.1], [-1.5, 0.7, 0.4]])
    true, H, R = row(W_B, np.zeros((3, 3)))
    np.testing.assert_allclose(row((np.eye(3) + M) @ W_B, M)[0], true, atol=6e-4)  # squares of M
    if kind != "smoothed velocity":
        np.testing.assert_allclose(row(W_B, M)[0] - true, -H[:, axes] @ M.ravel(), atol=1e-12)
    assert np.abs(H[:, axes] @ M.ravel()).max() > 0.01
    np.testing.assert_array_equal(R, np.ones(3))
    noisy = row(W_B, M, 1e-4)
    np.testing.assert_allclose(noisy[2], 1.0 + 1e-4 * np.sum(noisy[1][:, BG] ** 2, axis=1))
