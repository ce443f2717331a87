"""Scale factors and misalignments of a slave far from its master: columns of the rows, which logs ask for states, honest sigmas."""

from dataclasses import replace

import numpy as np
import pytest

from truenorth.aiding.matching import matched
from truenorth.alignment.transfer import align_transfer
from truenorth.alignment.transfer_axes import slave_axes
from truenorth.alignment.transfer_filter import Assumed, Matching, master_aiding
from truenorth.alignment.transfer_system import seen_states, system_along
from truenorth.alignment.transfer_together import as_said_together
from truenorth.core.attitude import dcm_from_rotation_vector, rotation_vector_from_dcm, skew
from truenorth.core.position import Position
from truenorth.errors.axes import accel_axes, gyro_axes, turning_axes
from truenorth.errors.master import ARM as ARM_STATES
from truenorth.errors.master import MOUNTING, TransferModel
from truenorth.estimate.linear import rows_along
from truenorth.records import MasterRecord
from truenorth.records.specs import imu_spec
from truenorth.simulation import MasterSpec, simulate, simulate_sensor
from truenorth.simulation.course import course
from truenorth.simulation.manoeuvres import s_turn, straight
from truenorth.simulation.sway import Disturbed
from truenorth.simulation.tones import Tone
from truenorth.state.layout import ACCEL_AXES, BA, GYRO_AXES
from truenorth.state.track import Track

CONSUMER, TACTICAL = imu_spec("consumer"), imu_spec("tactical")
DEG = np.radians(1.0)
ARM = np.array([3.0, -25.0, 6.0])
FORCE = np.array([0.3, -0.2, 9.8])


def ship(rng, span):
    """Under way, an S-turn at its beginning, rolling, pitching, yawing by drawn tones."""
    legs = [*straight(30.0), *s_turn(30 * DEG, 1 * DEG), *straight(span)]
    way = course(Position.from_degrees(20.0, 115.0), legs, heading=rng.uniform(0.0, 6.0), speed=rng.uniform(3.0, 12.0))
    tones = {
        name: (Tone(rng.uniform(*size) * DEG, rng.uniform(*period), rng.uniform(0.0, 6.0)),)
        for name, size, period in (
            ("heading_tones", (0.3, 2.0), (8.0, 14.0)),
            ("pitch_tones", (1.0, 4.0), (5.0, 8.0)),
            ("roll_tones", (3.0, 10.0), (7.0, 13.0)),
        )
    }
    return Disturbed(way, **tones)


@pytest.mark.parametrize(
    ("kind", "name"), [("velocity", GYRO_AXES), ("acceleration", GYRO_AXES), ("acceleration", ACCEL_AXES)]
)
def test_columns_are_the_derivative_of_the_measurement(kind, name):
    """Each of nine, by sensors whose matrix is off by 1e-5 in it: to 1e-4 of the largest."""
    model = TransferModel(axes=(gyro_axes(CONSUMER), accel_axes(CONSUMER, FORCE)))
    at = ship(np.random.default_rng(1), 60.0).states(np.array([41.3]))
    f_m, C_mb = np.array([[0.1, 0.2, 9.7]]), dcm_from_rotation_vector([0.02, -0.03, 0.1])
    master = MasterRecord(np.array([0.0, 1.0]), C_nb=at.C_nb[[0, 0]], v_n=at.v_n[[0, 0]], f_b=f_m[[0, 0]])

    def measured(M):
        off = {GYRO_AXES: {"w_ib_b": at.w_ib_b + at.w_ib_b @ M.T}, ACCEL_AXES: {"f_b": at.f_b + (at.f_b - FORCE) @ M.T}}
        found = master_aiding(master, model, Assumed(ARM, C_mb=C_mb), Matching(1.0, 1.0, kind))
        (source,) = (s for s in found if s.name == f"master {kind}")
        first = {key: getattr(source, key)[:1].copy() for key in ("time", "measured", "sigma")}
        z, H = rows_along(replace(at, **off[name]), [replace(source, **first)], model.ins)
        return z[0], H[0]

    zero, H = measured(np.zeros((3, 3)))
    columns = H[:, model.slice_of(name)]
    seen = np.stack([(measured(1e-5 * np.eye(9)[j].reshape(3, 3))[0] - zero) / 1e-5 for j in range(9)], axis=1)
    np.testing.assert_allclose(seen, columns, atol=1e-4 * np.abs(columns).max())


def test_gravity_on_the_axes_is_a_part_of_the_bias():
    """Before anything is seen the bias is ``nabla + M f0``: its variance, and what it says of M."""
    model = TransferModel(axes=(accel_axes(CONSUMER, FORCE),))
    P = model.prior(0.1, 0.01, CONSUMER.accel_bias, 1e-5)
    J = np.zeros((3, model.states))
    J[:, BA] = np.eye(3)
    for i in range(3):
        first = model.slice_of(ACCEL_AXES).start + 3 * i
        J[i, first : first + 3] = -FORCE
    np.testing.assert_allclose(J @ P @ J.T, CONSUMER.accel_bias**2 * np.eye(3), atol=1e-12)


def test_states_are_for_logs_that_show_them():
    """A consumer IMU has its gyros', which turn attitude, and its accelerometers' where velocity is matched; a good one none."""
    way = ship(np.random.default_rng(2), 60.0)
    slave = simulate(way, rate=50.0, duration=60.0, imu=TACTICAL, seed=1).record
    master = simulate_sensor(way, MasterSpec(), duration=60.0, seed=1).record

    def names(spec, arm, what="both"):
        return {g.name for g in slave_axes(slave, master, spec, Assumed(np.array(arm)), matched(what, master))}

    assert names(CONSUMER, ARM) == {GYRO_AXES, ACCEL_AXES}
    assert names(TACTICAL, [0.0, 1.0, 0.0]) == {GYRO_AXES}
    assert names(CONSUMER, ARM, "attitude") == {GYRO_AXES}
    straight = replace(TACTICAL, gyro_scale_factor=0.0, gyro_misalignment=0.0)
    assert names(straight, [0.0, 1.0, 0.0]) == set()
    noisy = replace(CONSUMER, gyro_random_walk=1.0)
    assert turning_axes(noisy) == ()  # lost in their noise, but for what an arm makes of them
    assert names(noisy, np.zeros(3)) == {ACCEL_AXES}
    assert names(noisy, ARM) == {GYRO_AXES, ACCEL_AXES}


def test_a_turn_of_ten_seconds_asks_for_the_axes_of_accelerometers():
    """A tactical slave on an aircraft: its level was 1.85 of its sigma off without them (20 flights). Not straight on."""
    turning = [*straight(20.0), *s_turn(20 * DEG, 3 * DEG), *straight(90.0)]
    here = Position.from_degrees(62.0, 20.0)
    fast, slow = (course(here, legs, heading=0.6, speed=150.0) for legs in (turning, straight(100.0)))
    for way, expected in ((fast, {GYRO_AXES, ACCEL_AXES}), (slow, {GYRO_AXES})):
        slave = simulate(way, rate=50.0, duration=90.0, imu=TACTICAL, seed=1).record
        master = simulate_sensor(way, MasterSpec(), duration=90.0, seed=1).record
        assert {g.name for g in slave_axes(slave, master, TACTICAL, Assumed(), matched("both", master))} == expected


@pytest.mark.slow
@pytest.mark.parametrize("runs", [24])
def test_a_cheap_slave_far_from_its_master(runs):
    """15 to 40 m: before, 8 of 8 ships had a level, a heading or an arm beyond 3 sigmas (18 at the most), 7 of them beyond 4."""
    total = 0.0
    for run in range(runs):
        rng = np.random.default_rng([43, run])
        way, toward = ship(rng, 200.0), rng.standard_normal(3) * [1.0, 1.0, 0.3]
        arm = rng.uniform(15.0, 40.0) * toward / np.linalg.norm(toward)
        late, mount = 0.05 * rng.standard_normal(), 3 * DEG * rng.standard_normal(3)
        spec = MasterSpec(clock_offset=late, lever_arm=tuple(arm), mounting=tuple(mount), velocity_noise=0.05)
        slave = simulate(way, rate=100.0, duration=200.0, imu=CONSUMER, seed=43, run=run).record
        master = simulate_sensor(way, replace(spec, attitude_noise=3e-4), duration=200.0, seed=43, run=run).record
        given = tuple(arm + 0.1 * rng.standard_normal(3))
        answer = align_transfer(slave, master, CONSUMER, lever_arm=given, lever_arm_sigma=0.3)
        phi = -rotation_vector_from_dcm(answer.C_nb @ way.states(np.array(answer.time)).C_nb.T)
        ratio = np.append(
            phi / np.sqrt(np.diag(answer.phi_covariance)),
            (answer.transfer.lever_arm - arm) / answer.transfer.lever_arm_sigma,
        )
        assert answer.status == "aligned", answer.reasons
        assert np.abs(ratio).max() < 4.0, ratio
        total += float(ratio[:3] @ ratio[:3])
    assert total / (3 * runs) < 1.0 + 3.1 * np.sqrt(2 / (3 * runs))  # false alarms 1 in 1000


def turned_alike(s, C_nb, model):
    """States of a slave whose seat, arm and sensors are turned by s, and its attitude: nothing else of it changes."""
    x = np.zeros(model.states)
    for name, value in ((GYRO_AXES, skew(s).ravel()), (ACCEL_AXES, skew(s).ravel()), (ARM_STATES, -skew(s) @ ARM)):
        x[model.slice_of(name)] = value
    x[BA], x[model.slice_of(MOUNTING)] = skew(s) @ FORCE, s
    return x, C_nb @ dcm_from_rotation_vector(s)


def test_what_only_was_said_stays_as_it_was_said():
    """A filter that took the turning of all for known is brought back, with the covariance that was said; else nothing changes."""
    model = TransferModel(mounting=True, axes=(gyro_axes(CONSUMER), accel_axes(CONSUMER, FORCE)))
    said = Assumed(ARM, 0.3, C_mb=np.eye(3), mounting_sigma=3 * DEG)
    C_nb, s = dcm_from_rotation_vector([0.1, 0.2, 2.0]), np.array([0.001, -0.00075, 0.0015])
    x, turned = turned_alike(s, C_nb, model)
    P = 1e-12 * np.eye(model.states)
    track = Track(np.zeros(1), turned[None], np.zeros((1, 3)), np.zeros((1, 3)), x[None], P[None], model.layout, ())
    back = as_said_together(track, model, said, True)
    np.testing.assert_allclose(rotation_vector_from_dcm(back.C_nb[0] @ C_nb.T), 0.0, atol=1e-5)
    np.testing.assert_allclose(back.sensors[0], 0.0, atol=1e-4)  # of 2e-2; to the second order in s
    sigma = 0.5 * DEG
    information = (4.0 / sigma**2 + 1.0 / (3 * DEG) ** 2) * np.eye(3) - skew(ARM) @ skew(ARM) / 0.3**2
    np.testing.assert_allclose(C_nb.T @ back.P[0][:3, :3] @ C_nb, np.linalg.inv(information), rtol=2e-2, atol=1e-8)
    # What is left of the gyros' turn against the rest moves the likeliest turn of all, by its weight.
    P[model.slice_of(GYRO_AXES), model.slice_of(GYRO_AXES)] = (0.2 * DEG) ** 2 * np.eye(9)
    more = as_said_together(replace(track, P=P[None]), model, said, True).P[0][:3, :3] - back.P[0][:3, :3]
    weight = np.linalg.inv(information) * 2.0 / sigma**2
    np.testing.assert_allclose(C_nb.T @ more @ C_nb, 0.5 * (0.2 * DEG) ** 2 * weight @ weight, rtol=2e-2, atol=1e-9)
    known = replace(model, mounting=False)
    assert as_said_together(track, known, said, True) is track


def test_nothing_measured_shows_seat_arm_and_sensors_turned_alike():
    """The rows' columns, and those of the INS, along that turning are nothing: of 1e-3 at the most of what its parts do."""
    model = TransferModel(delay=False, mounting=True, axes=(gyro_axes(CONSUMER), accel_axes(CONSUMER, FORCE)))
    t = np.arange(40.0, 44.0, 0.05)
    way = ship(np.random.default_rng(1), 60.0)
    R = np.full(6, 1e-4)
    system = system_along(
        way.states(t - 0.025), way.states(t), np.full(len(t), 0.05), model, np.eye(model.states), R, arm=ARM
    )
    seen = seen_states(model)
    parts, whole = [], 0.0
    x = turned_alike(1e-3 * np.array([1.0, -2.0, 0.5]), np.eye(3), model)[0][seen]
    x[:3] = way.states(t[0] - 0.05).C_nb @ (1e-3 * np.array([1.0, -2.0, 0.5]))
    for part in (x, np.where(np.arange(len(x)) < 3, x, 0.0)):
        z, state = [], part
        for k in range(len(t)):
            state = system.Phi[k] @ state
            z.append(system.H[k] @ state)
        parts.append(np.abs(z).max(axis=0))
    whole, of_attitude = parts
    assert np.all(whole < 5e-3 * of_attitude.max()), (whole, of_attitude)
