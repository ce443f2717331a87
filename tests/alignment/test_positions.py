"""Alignment over positions of a turntable: honest sigmas, what turns separate, a touched table, and bad input."""

import json
import math
import re

import numpy as np
import pytest
from scipy.stats import chi2

from tests.helpers import run_command
from tests.runs import few_and_all
from truenorth.alignment import align
from truenorth.alignment.positions import align_positions, find_positions
from truenorth.alignment.task import deflection_covariance
from truenorth.alignment.touched import find_touch
from truenorth.core.attitude import UNIFORM_SIGMA, rotation_vector_from_dcm
from truenorth.core.earth import normal_gravity
from truenorth.core.errors import AlignmentError, UsageError
from truenorth.core.position import Position
from truenorth.formats import write_imu
from truenorth.quality.regimes import motion_summary
from truenorth.records import ImuRecord
from truenorth.records.specs import imu_spec
from truenorth.simulation import Axis, Indexed, Indexer, Spin, rest, simulate, steps

PLACE = Position.from_degrees(45.0, 9.0, 100.0, horizontal_sigma=0.0, vertical_sigma=0.0)


def turned(turns, spec, seed, dwell, duration=600.0, rate=20.0):
    """A log of a table whose outer axis is vertical, its inner one across."""
    axes = steps(turns, dwell=dwell, duration=duration, rate=math.radians(18.0))
    names = "zx"[: len(axes)]
    table = Indexed(
        rest(PLACE, 0.6, 0.003, -0.002), Indexer(tuple(Axis(n, a) for n, a in zip(names, axes, strict=True)))
    )
    made = simulate(table, imu=spec, rate=rate, duration=duration, seed=seed)
    return made, table.states(np.array([duration])).C_nb[0]


def errors_of(turns, spec, runs, dwell):
    """Misalignments, their covariances without the deflection of the vertical, and the answers."""
    deflection = deflection_covariance(PLACE.lat, float(normal_gravity(PLACE.lat, PLACE.alt)))
    phi, P, answers = [], [], []
    for seed in range(runs):
        made, C = turned(turns, spec, seed, dwell)
        answer = align_positions(made.record, PLACE, spec)
        phi.append(-rotation_vector_from_dcm(answer.C_nb @ C.T))
        P.append(answer.phi_covariance - deflection)
        answers.append((answer, made.errors))
    return np.array(phi), np.array(P), answers


@pytest.mark.slow
@few_and_all(12, few=6)
@pytest.mark.parametrize(
    ("grade", "turns", "dwell"),
    [
        ("navigation", [(0, math.pi)], 300.0),
        ("tactical", [(0, math.pi), (1, math.pi / 2), (1, -math.pi / 2)], 120.0),
    ],
)
def test_sigma_is_honest(grade, turns, dwell, runs):
    """NEES within its 99.8 % band; of 12 runs, 36 numbers, 15.3 to 68.0 in sum."""
    phi, P, answers = errors_of(turns, imu_spec(grade), runs, dwell)
    nees = np.einsum("ri,rij,rj->r", phi, np.linalg.inv(P), phi)
    low, high = chi2.ppf([1e-3, 1 - 1e-3], 3 * runs)
    assert low < nees.sum() < high
    for answer, errors in answers:
        assert answer.status == ("aligned" if grade == "navigation" else answer.status)
        apart = (answer.accel_bias - errors.accel.bias) / answer.accel_bias_sigma
        assert np.all(np.abs(apart) < 5.0)


@pytest.mark.slow
@few_and_all(8, few=4)
def test_without_a_specification_sigma_is_honest_too(runs):
    """Heading over its sigma: the sum of squares within its 99.9 % band, .7 to 27.9 of 8 runs; sigma may be twice as large."""
    total = 0.0
    for seed in range(20, 20 + runs):
        made, C = turned([(0, math.pi)], imu_spec("navigation"), seed, 300.0)
        answer = align_positions(made.record, PLACE)
        assert answer.status == "aligned"
        phi = -rotation_vector_from_dcm(answer.C_nb @ C.T)
        total += phi[2] ** 2 / answer.phi_covariance[2, 2]
    low, high = chi2.ppf([5e-4, 1 - 5e-4], runs)
    assert low / 4.0 < total < high


def test_two_positions_take_the_biases_out():
    """600 s with and without a turn by 180 deg: what the biases leave in level and heading."""
    spec = imu_spec("navigation")
    made, _ = turned([(0, math.pi)], spec, 3, 300.0)
    still = simulate(rest(PLACE, 0.6, 0.003, -0.002), imu=spec, rate=20.0, duration=600.0, seed=3).record
    two, one = align_positions(made.record, PLACE, spec), align(still, PLACE, spec)
    assert np.sqrt(two.phi_floor[2, 2]) < 0.15 * np.sqrt(one.phi_floor[2, 2])
    assert two.euler_sigma[0] < 0.5 * one.euler_sigma[0]
    assert [round(np.degrees(np.linalg.norm(p.turn))) for p in two.table.positions] == [0, 180]
    assert np.all(two.accel_bias_sigma[:2] < 0.5 * two.accel_bias_prior[:2])
    assert np.all(two.accel_bias_estimated[:2])
    assert not one.accel_bias_estimated[:2].any()


@pytest.mark.slow
def test_a_large_turn_needs_scale_factor_states():
    """500 ppm over 180 deg are 5.4 arcmin of heading that the answer does not have: the state takes them."""
    spec = imu_spec({"gyro": {"bias": "0.01 deg/h", "random_walk": "0.001 deg/sqrt(h)", "scale_factor": "500 ppm"},
                     "accel": {"bias": "50 ug", "random_walk": "10 ug/sqrt(Hz)"}})  # fmt: skip
    phi, P, answers = errors_of([(0, math.pi)], spec, 6, 300.0)
    assert np.all(np.abs(phi[:, 2]) < 5.0 * np.sqrt(P[:, 2, 2]))
    assert np.all(np.degrees(np.sqrt(P[:, 2, 2])) * 60 < 2.5)
    for (
        answer,
        errors,
    ) in answers:  # seen as the difference of two gyrocompassings, in which the east gyro's bias is, too
        sigma = answer.table.gyro_matrix_sigma[2, 2]
        assert sigma < 400e-6
        assert abs(answer.table.gyro_matrix[2, 2] - errors.gyro.scale_factor[2]) < 5 * sigma


@pytest.mark.slow
def test_a_touched_table_is_noticed_and_an_untouched_one_is_not():
    """A step of 1 mg in one accelerometer, which the gyros do not show; the log without it is not accused."""
    spec = imu_spec("navigation")
    record = turned([(0, math.pi)], spec, 5, 300.0)[0].record
    assert align_positions(record, PLACE, spec).table.touch is None
    accel = record.accel.copy()
    accel[record.time > 150.0, 0] += 9.8e-3 * record.interval
    answer = align_positions(ImuRecord(record.time, record.gyro, accel, record.kind), PLACE, spec)
    assert answer.status == "inconsistent"
    assert "touched" in answer.reasons[0]
    assert "align the part after it" in answer.reasons[0]
    assert answer.table.touch.time == pytest.approx(150.0, abs=15.0)
    assert answer.table.touch.size == pytest.approx(9.8e-3, rel=0.1)


def test_chance_does_not_touch_the_table():
    """White noise of any size: 2000 positions, none accused (false alarm below 1e-5 each)."""
    rng = np.random.default_rng(0)
    for count in (40, 120, 600):
        for _ in range(700):
            assert find_touch(np.arange(count), rng.standard_normal((count, 2)), 9.8) is None


def test_gyros_that_walk_touch_no_table():
    """Force of gravity alone, carried by gyros of .3 deg/sqrt(h): of 600 positions none; a step of 5 mg is found."""
    rng, walk = np.random.default_rng(1), math.radians(0.3) / 60.0
    for _ in range(600):
        carried = 9.8 * np.cumsum(walk * rng.standard_normal((300, 2)), axis=0)
        assert find_touch(np.arange(300.0), carried, 9.8, walk) is None
    stepped = carried + 0.05 * (np.arange(300.0) > 150.0)[:, None]
    assert find_touch(np.arange(300.0), stepped, 9.8, walk).time == pytest.approx(150.0, abs=10.0)


def test_a_rate_that_stays_is_no_touch_and_hides_none():
    """A MEMS on a table for two minutes, its gyros off by 30 deg/h for 300 s at a time: of 300 none; most steps of 8 mg are."""
    rng, walk, rate = np.random.default_rng(2), math.radians(0.5) / 60.0, math.radians(30.0) / 3600.0
    kept, found = math.exp(-0.5 / 300.0), 0
    for _ in range(300):
        bias = rate * rng.standard_normal((254, 2))
        for k in range(1, len(bias)):
            bias[k] = kept * bias[k - 1] + math.sqrt(1.0 - kept**2) * bias[k]
        tilt = np.cumsum(0.5 * bias + walk * math.sqrt(0.5) * rng.standard_normal(bias.shape), axis=0)
        force, time = 9.8 * tilt + 0.01 * rng.standard_normal(bias.shape), 0.5 * np.arange(254.0)
        assert find_touch(time, force, 9.8, walk, rate) is None
        stepped = force + np.array([0.08, 0.0]) * (time > 90.0)[:, None]
        found += find_touch(time, stepped, 9.8, walk, rate) is not None
    assert found > 120  # 1 where all of the rate counted


@pytest.mark.slow
def test_industrial_gyros_touch_no_table():
    """Two positions: two of the first seven were refused for a table that somebody touched."""
    spec = imu_spec("industrial")
    for seed in range(7):
        answer = align_positions(turned([(0, math.pi / 2)], spec, seed, 240.0)[0].record, PLACE, spec)
        assert answer.status == "level_only", answer.reasons
        np.testing.assert_allclose(answer.history.phi_covariance[:, 2, 2], UNIFORM_SIGMA**2)


def test_positions_are_found_in_the_gyros():
    made, _ = turned([(0, math.pi / 2), (1, -math.pi / 2)], imu_spec("tactical"), 1, 40.0, duration=200.0)
    found = find_positions(motion_summary(made.record))
    assert len(found) == 5
    for start, stop in found[:-1]:
        assert stop - start == pytest.approx(40.0, abs=2.5)


def test_a_table_that_never_rests_is_refused():
    table = Indexed(rest(PLACE, 0.6), Indexer((Axis("z", Spin(0.3)),)))
    record = simulate(table, imu=imu_spec("tactical"), rate=20.0, duration=60.0).record
    with pytest.raises(AlignmentError, match="no position of 5 s"):
        align_positions(record, PLACE, "tactical")


def test_a_log_of_two_seconds_is_refused():
    with pytest.raises(AlignmentError, match="no position of 5 s"):
        align_positions(simulate(rest(PLACE), rate=20.0, duration=2.0).record, PLACE, "tactical")


def test_a_base_that_drives_off_is_no_table():
    record = turned([(0, math.pi)], imu_spec("navigation"), 4, 60.0, duration=180.0)[0].record
    accel = record.accel.copy()
    accel[(record.time > 150.0) & (record.time < 160.0), 1] += 0.5 * record.interval
    answer = align_positions(ImuRecord(record.time, record.gyro, accel, record.kind), PLACE, "navigation")
    assert answer.status == "inconsistent"
    assert any("moves" in reason for reason in answer.reasons)


def test_options_that_make_no_sense():
    record = simulate(rest(PLACE), rate=20.0, duration=30.0).record
    with pytest.raises(UsageError, match="arm_sigma"):
        align_positions(record, PLACE, arm_sigma=-1.0)
    with pytest.raises(UsageError, match="heading limit"):
        align_positions(record, PLACE, heading_limit=0.0)


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    path = tmp_path_factory.mktemp("table") / "table.csv"
    write_imu(turned([(0, math.pi)], imu_spec("navigation"), 2, 140.0, duration=300.0)[0].record, path)
    return path


class TestCommand:
    def test_prints_positions(self, capsys, monkeypatch, log):
        code, out = run_command(
            capsys, monkeypatch, "align", log, "--lat", 45, "--imu", "navigation", "--positions", "auto"
        )
        assert code == 0
        assert "turned, deg" in out.out
        assert "179.9" in out.out or "180.0" in out.out

    def test_json_and_folder(self, capsys, monkeypatch, log, tmp_path):
        where = ("--lat", 45, "--imu", "navigation", "--positions", "auto")
        code, out = run_command(capsys, monkeypatch, "align", log, *where, "--json", "-o", tmp_path / "out")
        assert code == 0
        found = json.loads(out.out)
        assert found["method"] == "positions"
        assert len(found["positions"]) == 2
        assert found["touched_at_s"] is None
        page = (tmp_path / "out" / "report.html").read_text()
        assert "Positions" in page
        assert re.search(r">turned, deg<.*?<td[^>]*>–</td>.*?<td[^>]*>1\d\d\.\d{3}</td>", page, re.DOTALL)

    @pytest.mark.parametrize(
        ("more", "text"),
        [
            (("--positions", "three"), "expected auto"),
            (("--positions", "auto", "--method", "oba"), "does not go with"),
            (("--positions", "auto", "--at", "50"), "--at does not go with"),
        ],
    )
    def test_what_does_not_go_together(self, capsys, monkeypatch, log, more, text):
        code, out = run_command(capsys, monkeypatch, "align", log, "--lat", 45, *more)
        assert code == 2
        assert text in out.err
