"""Alignment of a base that sways, and of an IMU on an indexer: against the truth, and against what it says of itself."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from typer.testing import CliRunner

from truenorth.aiding.aids import Indexer as IndexerAid
from truenorth.alignment import align
from truenorth.alignment.encoder_angles import angles_at
from truenorth.alignment.rotary import align_rotary, angles_from_gyros
from truenorth.cli import app
from truenorth.core.attitude import rotation_vector_from_dcm
from truenorth.core.earth import earth_rate_n, ecef_axes, normal_gravity
from truenorth.core.errors import AlignmentError, DataError, UsageError
from truenorth.core.indexing import C_bs_from_angles
from truenorth.core.position import Position
from truenorth.formats import read_encoder, write_record
from truenorth.papers.rotary.truth import simulate_run
from truenorth.records import EncoderRecord, ImuRecord
from truenorth.records.specs import imu_spec
from truenorth.simulation import Axis, Indexed, Indexer, Spin, rest, simulate
from truenorth.strapdown.inertial import integrate

ARCMIN = math.radians(1 / 60)


def body_attitude(run, time):
    """True ``C_nb`` of the body against the level at the IMU's mean place."""
    at = run.motion.motion.states(np.asarray(time))
    return ecef_axes(run.place.lat, run.place.lon).T @ ecef_axes(at.lat, at.lon) @ at.C_nb


def error(answer, C_nb):
    return -rotation_vector_from_dcm(answer.C_nb @ C_nb.T) / ARCMIN


@pytest.fixture(scope="module")
def ship():
    run = simulate_run("B", 1, 3)
    return replace(run, record=run.record.between(None, 250.001))


@pytest.fixture(scope="module")
def answer(ship):
    return align_rotary(ship.record, ship.encoder, ship.place, ship.imu, offset_sigma=0.0)


def test_the_body_is_found(ship, answer):
    """4 sigma of each angle; heading is known to a tenth of an arcmin, levels to the plumb line's deflection."""
    phi = error(answer, body_attitude(ship, answer.time))
    sigma = np.sqrt(np.diag(answer.phi_covariance)) / ARCMIN
    assert answer.status == "aligned", answer.reasons
    assert np.all(np.abs(phi) < 4 * sigma), (phi, sigma)
    assert sigma[2] < 0.15
    assert np.all(np.abs(phi[:2]) < 0.02)
    assert "indexer" in answer.method_reason


def test_biases_are_said_along_the_axes_of_the_imu(ship, answer):
    """Within 4 sigma of what was put in: the indexer tells the accelerometers' within 250 s, the gyros' in part."""
    true = simulate_errors(ship)
    for found, sigma, value in (
        (answer.gyro_bias, answer.gyro_bias_sigma, true[0]),
        (answer.accel_bias, answer.accel_bias_sigma, true[1]),
    ):
        assert np.all(np.abs(found - value) < 4 * sigma)
    assert np.all(answer.accel_bias_sigma < 0.05 * np.abs(true[1]))


def simulate_errors(ship):
    from truenorth.papers.rotary.truth import scenario_of
    from truenorth.simulation import given_errors

    given = given_errors(scenario_of("B", 1, 3).errors, "errors")
    return np.asarray(given["gyro_bias"]), np.asarray(given["accel_bias"])


@pytest.mark.slow
def test_a_known_arm_gives_the_same(ship, answer):
    """The arm is shown by the sway itself; to know it changes nothing beyond a sigma."""
    aid = IndexerAid(ship.encoder, lever_arm=-ship.arm)  # from the IMU to the centre
    known = align(ship.record, ship.place, ship.imu, aid=aid)
    apart = rotation_vector_from_dcm(known.C_nb @ answer.C_nb.T) / ARCMIN
    assert np.all(np.abs(apart) < np.sqrt(np.diag(answer.phi_covariance)) / ARCMIN)


@pytest.mark.slow
@pytest.mark.usefixtures("without_gyro_matrix")
def test_errors_of_the_indexer_itself_are_the_bodys(ship, answer):
    """Zeros off by 2 arcmin: the body is found as far off, many sigmas, unless it is said how good the angles are."""
    off = replace(ship.encoder, angles=ship.encoder.angles + 2.0 * ARCMIN)
    aid = IndexerAid(off, lever_arm=-ship.arm, angle_sigma=2.0 * ARCMIN)
    found = align(ship.record, ship.place, ship.imu, aid=aid)
    phi = error(found, body_attitude(ship, found.time))
    known = np.diag(found.phi_covariance) - (2.0 * ARCMIN) ** 2
    assert 1.0 < np.linalg.norm(phi) < 4.0
    assert np.all(np.abs(phi) < 2.0 * np.sqrt(np.diag(found.phi_covariance)) / ARCMIN)
    assert np.sqrt(known[:2]) == pytest.approx(np.sqrt(np.diag(answer.phi_covariance)[:2]), rel=0.2)
    # Angles that are off move the arm of 33 m by 2 cm: what the check of steps sees of that may be in heading too.
    assert np.sqrt(np.diag(answer.phi_covariance)[2]) < np.sqrt(known[2]) < 2.0 * ARCMIN
    with pytest.raises(UsageError, match="angle_sigma"):
        align_rotary(ship.record, ship.encoder, ship.place, ship.imu, offset_sigma=0.0, angle_sigma=-1.0)


@pytest.mark.slow
def test_an_earlier_epoch(ship):
    """Between two samples, too: the body's own attitude there."""
    middle = align_rotary(ship.record, ship.encoder, ship.place, ship.imu, at=123.4567)
    phi = error(middle, body_attitude(ship, 123.4567))
    assert np.all(np.abs(phi) < 4 * np.sqrt(np.diag(middle.phi_covariance)) / ARCMIN)


@pytest.mark.slow
def test_a_base_that_leaves_is_said(ship):
    """A north ramp to .05 m/s over the second half."""
    record = ship.record
    acceleration = np.where(record.time > 125.0, 0.05 / 125.0, 0.0)[:, None] * np.array([0.0, 1.0, 0.0])
    C_ns = ship.C_ns(record.time)
    force = np.einsum("kji,kj->ki", C_ns, acceleration)
    leaving = ImuRecord(record.time, record.gyro, record.accel + force * record.interval, "increments")
    found = align_rotary(leaving, ship.encoder, ship.place, ship.imu)
    assert found.status == "inconsistent"
    assert any("drifts north" in reason for reason in found.reasons)


@pytest.mark.slow
def test_an_imu_that_may_be_off_the_axes_of_its_indexer_has_the_same_heading(ship, answer):
    """With a centimetre left open: known as well to 1 %, each with its own fit of the motion, where it fits."""
    free = align_rotary(ship.record, ship.encoder, ship.place, ship.imu)
    assert free.status == "aligned"
    phi = rotation_vector_from_dcm(free.C_nb @ answer.C_nb.T)
    sigma, own = (np.sqrt(np.diag(a.phi_covariance)) for a in (free, answer))
    assert np.all(np.abs(phi) < 3.0 * sigma)
    assert sigma == pytest.approx(own, rel=0.01)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_an_imu_off_the_axes_of_its_indexer(seed):
    """2 cm (one sigma), turned by 180 deg to and fro: what it swings by in a slew was taken for a tilt of five sigmas."""
    rng, step, rate = np.random.default_rng([seed, 81]), 0.02, math.radians(20.0)
    t = step * np.arange(20000)
    slews = np.arange(20.0, 390.0, 40.0)
    u = [np.clip((t - s) * rate / math.pi / 1.875, 0.0, 1.0) for s in slews]
    sign = [1.0, -1.0] * len(slews)
    angle = math.pi * sum(k * (10 * x**3 - 15 * x**4 + 6 * x**5) for k, x in zip(sign, u, strict=False))
    w = np.gradient(angle, step)
    offset, lat, up = 0.02 * rng.standard_normal(3), math.radians(45.0), np.array([0.0, 0.0, 1.0])
    C_sb = np.swapaxes(C_bs_from_angles(("z",), angle[:, None]), -1, -2)
    turn = w[:, None] * up
    swing = np.cross(np.gradient(w, step)[:, None] * up, offset) + np.cross(turn, np.cross(turn, offset))
    spec = imu_spec("tactical")
    f = normal_gravity(lat, 0.0) * up + swing + np.sqrt(spec.bias_variance[3:]) * rng.standard_normal(3)
    f += spec.accel_random_walk / math.sqrt(step) * rng.standard_normal(f.shape)
    gyro = C_sb @ earth_rate_n(lat) + turn + np.sqrt(spec.bias_variance[:3]) * rng.standard_normal(3)
    gyro += spec.gyro_random_walk / math.sqrt(step) * rng.standard_normal(f.shape)
    place, encoder = Position(lat, 0.0, 0.0), EncoderRecord(t, angle)
    answer = align_rotary(ImuRecord(t, gyro, f), encoder, place, spec, axes=("z",))
    phi = error(answer, np.eye(3)) * ARCMIN
    assert np.all(np.abs(phi[:2]) < 4.0 * np.sqrt(np.diag(answer.phi_covariance))[:2])


@pytest.fixture(scope="module")
def still():
    position = Position.from_degrees(40.0, 118.0)
    spin = (Axis("z", Spin(math.radians(18.0))), Axis("x", Spin(math.radians(3.0))))
    motion = Indexed(rest(position, 0.7, 0.05, -0.03), Indexer(spin))
    return simulate(motion, rate=50.0, duration=120.0, imu=simulate_run_spec(), seed=5), position


def simulate_run_spec():
    from truenorth.records.specs import imu_spec

    return imu_spec("navigation")


def test_angles_from_the_gyros_of_a_still_body(still):
    simulation, position = still
    found = align_rotary(simulation.record, None, position, "navigation")
    C_nb = simulation.motion.motion.states(np.array(0.0)).C_nb
    phi = error(found, C_nb)
    assert np.all(np.abs(phi) < 4 * np.sqrt(np.diag(found.phi_covariance)) / ARCMIN)
    integrals = integrate(simulation.record, 1.0)
    angles, off = angles_from_gyros(integrals, C_nb, position.lat, ("z", "x"))
    # Scale factors of 5 ppm on 38 rad; 4 sigma.
    np.testing.assert_allclose(angles, simulation.motion.indexer.angles(integrals.time), atol=4 * 5e-6 * 38)
    assert off < 4 * 5e-6 * 38


@pytest.mark.parametrize("axes", ["zx", "xz", "yx", "zy", "z"])
def test_angles_of_any_two_axes(axes):
    """On a body that does not turn at all: the angles come back."""
    from types import SimpleNamespace

    rng = np.random.default_rng(2)
    angles = np.cumsum(rng.uniform(-0.6, 0.6, (50, len(axes))), axis=0)
    angles -= angles[0]
    integrals = SimpleNamespace(time=np.zeros(50), C_ib=C_bs_from_angles(axes, angles))
    found, off = angles_from_gyros(integrals, np.eye(3), 0.6, tuple(axes))
    np.testing.assert_allclose(found, angles, atol=1e-9)
    assert off < 1e-6


def test_a_body_without_encoder_that_is_not_still_is_refused(ship):
    with pytest.raises(DataError, match="give the encoder's log"):
        align_rotary(ship.record.between(None, 100.0), None, ship.place, ship.imu)


def test_angles_between_and_just_beyond_the_rows():
    encoder = EncoderRecord(np.array([0.1, 0.2, 0.3]), np.array([1.0, 2.0, 4.0]), "e")
    np.testing.assert_allclose(angles_at(encoder, [0.0, 0.15, 0.35], ("z",))[:, 0], [0.0, 1.5, 5.0])
    with pytest.raises(DataError, match="expected the encoder's log to cover"):
        angles_at(encoder, [0.0, 9.0], ("z",))
    with pytest.raises(UsageError, match="outermost first"):
        angles_at(encoder, [0.1], ("z", "x"))


def test_mistakes_are_said(ship):
    with pytest.raises(AlignmentError, match="record longer"):
        align_rotary(ship.record.between(None, 30.0), ship.encoder, ship.place, ship.imu)
    with pytest.raises(UsageError, match="three numbers"):
        align_rotary(ship.record, ship.encoder, ship.place, ship.imu, lever_arm=[1.0, 2.0])


@pytest.mark.parametrize("suffix", ["csv", "parquet", "npz"])
def test_an_encoder_is_read_back(ship, tmp_path, suffix):
    path = tmp_path / f"encoder.{suffix}"
    encoder = EncoderRecord(ship.encoder.time[:2000], ship.encoder.angles[:2000], "e")
    write_record(encoder, path)
    found = read_encoder(path)
    np.testing.assert_allclose(found.angles, encoder.angles, atol=1e-12)
    single = EncoderRecord(encoder.time, encoder.angles[:, 0], "e")
    write_record(single, path)
    assert read_encoder(path).angles.ndim == 1


def test_wrapped_angles_are_counted_on(tmp_path):
    (tmp_path / "e.csv").write_text("time,angle_1\n0.1,350\n0.2,355\n0.3,1\n0.4,6\n")
    np.testing.assert_allclose(np.degrees(read_encoder(tmp_path / "e.csv").angles), [350, 355, 361, 366])
    (tmp_path / "bad.csv").write_text("time,angle_2\n0.1,350\n0.2,355\n")
    with pytest.raises(DataError, match="angle_1"):
        read_encoder(tmp_path / "bad.csv")


def test_the_command(ship, tmp_path):
    for name, record in (("imu.parquet", ship.record), ("encoder.parquet", ship.encoder)):
        write_record(record.between(None, 70.0), tmp_path / name)
    arguments = ["align", str(tmp_path / "imu.parquet"), "--lat", repr(math.degrees(ship.place.lat)), "--json"]
    more = [
        "--indexer",
        str(tmp_path / "encoder.parquet"),
        "--lever-arm",
        "10,30,10",
        "--to",
        "60",
        "--indexer-sigma",
        "1 arcsec",
    ]
    result = CliRunner().invoke(app, arguments + more)
    assert result.exit_code == 0, result.output
    summary = json.loads(result.stdout)
    C = body_attitude(ship, 60.0)
    heading = math.degrees(math.atan2(C[0, 1], C[1, 1])) % 360.0
    assert abs(summary["heading_deg"] - heading) < 4 * summary["heading_sigma_deg"]
    wrong = CliRunner().invoke(app, [*arguments, "--indexer", "gyros", "--lever-arm", "10,x"])
    assert isinstance(wrong.exception, UsageError)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["imakf", "kf", "sakf"])
def test_published_filters_find_the_body_on_an_indexer(ship, method):
    """The lever arm known, as their paper has it: within what they say, and far from it where the arm is left out."""
    record = ship.record.between(None, 300.0)
    aid = IndexerAid(ship.encoder, lever_arm=tuple(-ship.arm))
    answer = align(record, ship.place, ship.imu, aid=aid, method=method)
    off, sigma = error(answer, body_attitude(ship, answer.time)), np.sqrt(np.diag(answer.phi_covariance)) / ARCMIN
    assert answer.method == method
    assert "the lever arm is as given" in answer.method_reason
    assert np.all(np.abs(off) < 4.0 * sigma)
    without = align(record, ship.place, ship.imu, aid=IndexerAid(ship.encoder), method=method)
    assert without.phi_covariance[2, 2] > 4.0 * answer.phi_covariance[2, 2]


def test_a_published_filter_on_an_indexer_by_the_command_line(ship, tmp_path):
    write_record(ship.record.between(None, 80.0), tmp_path / "imu.csv")
    write_record(ship.encoder.between(None, 81.0), tmp_path / "encoder.csv")
    arm = ",".join(f"{x:g}" for x in ship.arm)
    where = ["--lat", "40", "--lon", "118", "--imu", "navigation", "--indexer", str(tmp_path / "encoder.csv")]
    asked = ["align", str(tmp_path / "imu.csv"), *where, "--lever-arm", arm, "--json", "--method"]
    result = CliRunner().invoke(app, [*asked, "imakf"])
    assert result.exit_code == 0, result.output
    assert json.loads(result.stdout)["method"] == "imakf"
    result = CliRunner().invoke(app, [*asked, "states8"])
    assert "choose one of auto, swaying" in str(result.exception)


def test_a_method_of_a_base_is_refused_on_an_indexer(ship):
    with pytest.raises(
        UsageError, match="'states10' is that of a still base and a level IMU; choose one of auto, swaying, kf"
    ):
        align(ship.record, ship.place, ship.imu, aid=IndexerAid(ship.encoder), method="states10")


@pytest.mark.slow
@pytest.mark.parametrize(("case", "run"), [("A", 2), ("A", 4), ("B", 1), ("B", 5)])
def test_a_minute_on_an_indexer_with_nothing_said_of_the_imu(case, run):
    """`inconsistent` before: biases as large as the indexer's rate were allowed, and the sway's fit took them for motion."""
    ship = simulate_run(case, run, 3)
    answer = align(ship.record.between(None, 60.0), ship.place, aid=IndexerAid(ship.encoder))
    assert answer.status == "aligned", answer.reasons
    off = error(answer, body_attitude(ship, answer.time)) / (np.sqrt(np.diag(answer.phi_covariance)) / ARCMIN)
    assert np.all(np.abs(off) < 4.0)
