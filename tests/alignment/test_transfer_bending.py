"""Transfer alignment on a structure that bends: rows, what is known of its motion, and that a silent one is named."""

import math
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.honesty.bending import Ringing
from truenorth.alignment import transfer
from truenorth.alignment.transfer import align_transfer
from truenorth.alignment.transfer_bending import Bend
from truenorth.alignment.transfer_filter import Assumed, Linear, Matching, master_aiding
from truenorth.cli.remedies import reasons_of
from truenorth.core.position import Position
from truenorth.errors.bending import BENDING
from truenorth.errors.master import TransferModel
from truenorth.estimate.linear import rows_along
from truenorth.records import MasterRecord
from truenorth.records.flexure import DECAY, FlexureSpec
from truenorth.records.specs import imu_spec
from truenorth.simulation import MasterSpec, simulate, simulate_sensor
from truenorth.simulation.course import course
from truenorth.simulation.flexure import Flexed
from truenorth.simulation.manoeuvres import s_turn, straight, turn

DEG, ARCMIN = math.radians(1.0), math.radians(1.0 / 60.0)
K, ARM = (0.45, 0.6, 0.8), (4.0, -3.0, 0.5)
T = 4.2


@pytest.fixture(scope="module")
def bent_turn():
    """A coordinated turn at 200 m/s, a seat that bends about all axes, what the simulator knows of it."""
    way = course(
        Position(np.radians(34.0), 0.3, 5000.0),
        [*straight(3.0), *turn(np.radians(60.0), np.radians(3.0), "coordinated"), *straight(40.0)],
        heading=np.radians(30.0),
        speed=200.0,
    )
    spec = FlexureSpec(sigma=(1e-3, 2e-3, 3e-3), correlation_time=0.5, coupling=K, arm=ARM)
    return way, Flexed(way, spec, duration=10.0, seed=4)


def _rows(bent_turn, kind, k=(0.0, 0.0, 0.0), arm=(0.0, 0.0, 0.0)):
    """z and H of a row without noise: a slave on a seat that bends, assumed coupling and arm off by so much."""
    way, bent = bent_turn
    model = TransferModel(
        0.0, 0.0, flexure_sigma=(3e-3,) * 3, coupling=tuple(np.array(K) - k), coupling_sigma=0.2, mounting=True
    )
    at = bent.states(np.array([T]))
    spec = MasterSpec(rate=10.0, lever_arm=ARM, with_sensors=True)
    rows = simulate_sensor(way, spec, duration=1.0, start=T).record[:2]
    master = MasterRecord(
        np.array([0.0, 0.1]), *(getattr(rows, n)[[0, 0]] for n in ("C_nb", "v_n", "lat", "lon", "alt"))
    )
    master = replace(master, f_b=rows.f_b[[0, 0]])
    knots = T + np.arange(-300, 301) * 1e-3
    angles = bent.angles(knots)[:, [1, 2, 0]] * [1.0, 1.0, -1.0]
    bend = Bend(knots - T, angles, np.array(model.coupling), 0.2)
    linear = Linear(master.C_nb, at.C_nb[[0, 0]], bend=bend)
    said = Assumed(np.array(ARM) - arm)
    sources = master_aiding(master, model, said, Matching(1.0, np.inf, kind), linear)
    source = next(s for s in sources if s.does == "measurement")
    measured = source.measured[:1].copy()
    if kind == "velocity":
        measured[:, 44:47] = bend.at(np.zeros(1), 1)
    elif kind == "position":
        measured[:, 6:9] = bend.at(np.zeros(1))
    else:
        measured[:, 9:15] = np.hstack([bend.at(np.zeros(1), 1), bend.at(np.zeros(1), 2)])
    figures = (*source.figures[: 3 if kind == "acceleration" else 2 if kind == "velocity" else 1], *model.coupling)
    roles = {**source.states, "flexure": model.groups[BENDING]}
    source = replace(
        source, time=source.time[:1], measured=measured, sigma=source.sigma[:1], figures=figures, states=roles
    )
    z, H = rows_along(at, [source], model.ins)
    if kind == "acceleration":  # these epochs have no spin
        z = z - (at.C_nb @ np.cross(at.dw_ib_b, said.lever_arm)[..., None])[..., 0]
    return z[0], H[0], model


@pytest.mark.parametrize(("kind", "close"), [("velocity", 2e-3), ("position", 2e-4), ("acceleration", 0.1)])
def test_a_row_of_a_seat_that_bends_is_zero_and_its_column_the_derivative(bent_turn, kind, close):
    """Of the true arm and coupling; without the coupling (k = 1, an arm that is rigid) it is tens of that off."""
    zero, H, model = _rows(bent_turn, kind)
    np.testing.assert_allclose(zero, 0.0, atol=close)
    rigid = _rows(bent_turn, kind, k=tuple(np.array(K) - 1.0))[0]
    assert np.max(np.abs(rigid - zero)) > 5.0 * close
    at = model.slice_of(BENDING)
    for axis in range(3):
        off = np.zeros(3)
        off[axis] = 0.01
        seen = (_rows(bent_turn, kind, k=off)[0] - zero) / 0.01
        size = max(np.abs(H[:, at]).max(), 1e-6)
        np.testing.assert_allclose(seen, H[:, at][:, axis], atol=2e-2 * size)


def _flight(bends, seed=2, seconds=60.0, frequency=2.0, coupling=0.5, arm=(6.0, 0.5, 0.2)):
    way = course(
        Position.from_degrees(62.0, 20.0, 3000.0),
        [*straight(10.0), *s_turn(20 * DEG, 3 * DEG), *straight(60.0)],
        heading=0.6,
        speed=150.0,
    )
    lasts = DECAY / (2.0 * math.pi * frequency)
    spec = FlexureSpec(sigma=(0.0, 0.0, bends), correlation_time=lasts, coupling=(coupling,) * 3, arm=arm)
    bent = Ringing(way, spec, duration=seconds + 1.0, seed=seed) if bends else way
    slave = simulate(bent, rate=100.0, duration=seconds, imu=imu_spec("tactical"), seed=seed).record
    of_master = MasterSpec(clock_offset=0.02, lever_arm=arm, velocity_noise=0.05, attitude_noise=ARCMIN)
    master = simulate_sensor(way, of_master, duration=seconds, seed=seed).record
    said = FlexureSpec(sigma=(0.2 * DEG,) * 3, correlation_time=lasts)
    return slave, master, said, bent


def _worst(answer, bent, arm=(6.0, 0.5, 0.2)):
    """Largest error of level, heading, delay and arm by its sigma."""
    t, C = answer.transfer, bent.states(np.array(answer.time)).C_nb
    off = answer.C_nb @ C.T
    phi = np.array([off[1, 2], off[2, 0], off[0, 1]])
    found = [*phi / np.sqrt(np.diag(answer.phi_covariance)), (t.delay - 0.02) / t.delay_sigma]
    return float(np.max(np.abs([*found, *((t.lever_arm - arm) / t.lever_arm_sigma)])))


@pytest.fixture
def without_rivals(monkeypatch):
    monkeypatch.setattr(transfer, "_rivals", lambda *_: [])


@pytest.mark.usefixtures("without_rivals")
def test_a_seat_that_bends_unsaid_is_named_and_a_rigid_one_is_not():
    """A wing of .2 deg at 2 Hz: passes that do not settle, and whatever they make of the arm; the first reason is what to say."""
    slave, master, _, _ = _flight(0.2 * DEG)
    answer = align_transfer(slave, master, "tactical", lever_arm_sigma=10.0)
    assert answer.status == "inconsistent"
    assert answer.evidence[0].key == "transfer.bends"
    figures = answer.evidence[0].figures
    assert figures["size"] == pytest.approx(0.2 * DEG, rel=0.15)
    assert figures["frequency"] == pytest.approx(2.0, rel=0.15)
    assert "--flexure '0.1" in reasons_of(answer)[0] or "--flexure '0.2" in reasons_of(answer)[0]
    slave, master, _, _ = _flight(0.0)
    sound = align_transfer(slave, master, "tactical", lever_arm_sigma=10.0)
    assert sound.status == "aligned"
    assert "transfer.bends" not in [item.key for item in sound.evidence]


@pytest.mark.usefixtures("without_rivals")
@pytest.mark.parametrize("matching", ["both", "position+attitude"])
def test_said_to_bend_it_is_aligned_and_the_coupling_found(matching):
    """Within 4 sigmas each; the coupling about the axis that bends, .5 of .7 ± .2, within 4 of its own."""
    slave, master, said, bent = _flight(0.2 * DEG)
    answer = align_transfer(slave, master, "tactical", matching=matching, lever_arm_sigma=10.0, flexure=said)
    assert answer.status == "aligned"
    assert _worst(answer, bent) < 4.0
    t = answer.transfer
    assert t.coupling_sigma[1] < 0.16
    assert abs(t.coupling[1] - 0.5) < 4.0 * t.coupling_sigma[1]
    assert t.summary()["coupling"] == t.coupling.tolist()
