"""Published filters on logs of a base that stays: honest where their assumptions hold, refused where they do not."""

import json
import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import yaml
from scipy.stats import chi2
from typer.testing import CliRunner

from benchmarks import which_one
from tests.runs import few_and_all, some
from truenorth import Odometer, align
from truenorth.alignment.against import against
from truenorth.alignment.in_motion import align_in_motion
from truenorth.alignment.published import FADING, STATIONARY
from truenorth.cli import app
from truenorth.core.attitude import dcm_from_euler, dcm_from_rotation_vector, misalignment
from truenorth.core.errors import AlignmentError, UsageError
from truenorth.core.position import Position
from truenorth.records import GnssRecord
from truenorth.simulation.scenario import SHIPPED, read_scenario
from truenorth.state.mounting import Mounting

HEADING = {"heading": "130 deg"}
STILL = which_one.STILL | {"rate": "50 Hz", "motion": which_one.STILL["motion"] | HEADING}
SWAY = which_one.SWAY | {"rate": "50 Hz", "motion": which_one.SWAY["motion"] | HEADING}
PLACE = Position(np.radians(45.0), np.radians(10.0))


def logs(content, runs):
    scenario = read_scenario(content)
    for run in range(runs):
        made = scenario.simulate(seed=8, run=run)
        yield made.record, scenario.imu_spec, made.motion.states(made.record.time[-1:]).C_nb[0]


@pytest.mark.slow
@few_and_all(12)
@pytest.mark.parametrize(("content", "methods"), some([(SWAY, list(FADING))], [(STILL, [*FADING, *STATIONARY])]))
def test_their_sigma_is_honest(content, methods, runs):
    """NEES within its 99.9 % band, .41 to 2.0 of 36 numbers; on the same logs.

    The factors of makf and imakf fail on a sway: their sigma must cover it, and may do so by far.
    """
    squares = {method: [] for method in methods}
    for record, spec, true in logs(content, runs):
        for method in methods:
            answer = align(record, PLACE, spec, method=method)
            assert answer.method == method
            if method not in ("makf", "imakf"):
                assert answer.status == "aligned"
            elif answer.status != "aligned":
                continue
            phi = misalignment(answer.C_nb, true)
            squares[method].append(phi @ np.linalg.solve(answer.phi_covariance, phi) / 3)
    low, high = chi2.ppf([5e-4, 1 - 5e-4], 3 * runs) / (3 * runs)
    for method, values in squares.items():
        least = 0.0 if method in ("makf", "imakf") else low
        assert least < np.mean(values) < high, (method, np.mean(values))


@pytest.mark.parametrize("method", STATIONARY)
def test_ten_and_eight_states_refuse_a_base_that_sways(method):
    record, spec, _ = next(logs(SWAY, 1))
    with pytest.raises(AlignmentError, match=r"the base is swaying.* choose another method"):
        align(record, PLACE, spec, method=method)


@pytest.mark.parametrize("method", ["imakf", "states10", "states8"])
def test_another_epoch(method):
    """On a still base any epoch has the same attitude, to what the biases found turn it by."""
    record, spec, _ = next(logs(STILL, 1))
    early, late = (align(record, PLACE, spec, method=method, at=at) for at in (record.time[3000], record.time[-1]))
    assert early.time == record.time[3000]
    np.testing.assert_allclose(early.C_nb, late.C_nb, atol=np.radians(0.2 / 60))


@cache
def driven(run):
    """Five minutes of the ring by a vehicle, with the IMU turned on it by a known mounting."""
    scenario = read_scenario("odometer_ring")
    made = scenario.simulate(seed=6, run=run)
    odometer = scenario.simulate_aiding(seed=6, run=run)["odometer"].record
    at = made.motion.states(np.array([0.0]))
    place = Position(float(at.lat[0]), float(at.lon[0]), float(at.alt[0]), 2.0, 2.0)
    return made.record.between(0.0, 300.0), odometer, place, scenario.imu_spec, made.motion


@pytest.fixture(scope="module")
def drives():
    """Of four vehicles."""
    return [driven(run) for run in range(4)]


def phi_of(answer, motion, C_bm):
    return misalignment(answer.C_nb, motion.states(np.array([answer.time])).C_nb[0] @ C_bm)


@pytest.mark.slow
@few_and_all(4, few=2)
@pytest.mark.parametrize("method", some(["sgkf"], ["ekf", "gh3"]))
def test_filters_of_the_odometer_paper(drives, method, runs):
    """NEES below its 99.95 % limit, 2.8 of 12 numbers; the IMU turned by 90 deg gives the attitude turned with it.

    Sigma may be too large: it holds a deflection of the vertical, which the simulated place does not have.
    """
    squares = []
    for record, odometer, place, spec, motion in drives[:runs]:
        answer = align_in_motion(record, spec, odometer=odometer, position=place, method=method)
        assert answer.status == "aligned", answer.reasons
        phi = phi_of(answer, motion, np.eye(3))
        squares.append(phi @ np.linalg.solve(answer.phi_covariance, phi) / 3)
        assert abs(phi[2]) < np.radians(10.0 / 60)
    assert np.mean(squares) < chi2.ppf(0.9995, 3 * runs) / (3 * runs), squares
    record, odometer, place, spec, motion = drives[0]
    C_mb = dcm_from_euler(np.radians(-90.0), 0.0, 0.0)
    turned = replace(record, gyro=record.gyro @ C_mb, accel=record.accel @ C_mb)
    usual = align(record, place, spec, aid=Odometer(odometer), method=method)
    answer = align_in_motion(
        turned, spec, odometer=odometer, position=place, method=method, wheel=Mounting(C_mb=C_mb, scale_sigma=0.03)
    )
    np.testing.assert_allclose(answer.C_nb, usual.C_nb @ C_mb, atol=1e-9)


@pytest.mark.slow
@few_and_all(3, few=1)
@pytest.mark.parametrize("method", some(["sgkf"], ["ekf", "gh3", "ckf"]))
def test_an_azimuth_that_the_closed_loop_contradicts_is_not_believed(method, runs):
    """A van in town with tactical gyros: no drive is more than four sigmas off unsaid; sgkf loses its way in the first.

    Before they were held against the closed loop, sgkf was off by up to 86 deg as `aligned`.
    """
    scenario, statuses = read_scenario(yaml.safe_load((SHIPPED / "van.yaml").read_text()) | {"imu": "tactical"}), []
    for run in range(runs):
        made = scenario.simulate(seed=3, run=run)
        odometer = scenario.simulate_aiding(seed=3, run=run)["odometer"].record
        at = made.motion.states(np.array([0.0]))
        place = Position(float(at.lat[0]), float(at.lon[0]), float(at.alt[0]), 5.0, 5.0)
        answer = align(made.record, place, scenario.imu_spec, aid=Odometer(odometer), method=method)
        off = np.abs(phi_of(answer, made.motion, np.eye(3))) / np.sqrt(np.diag(answer.phi_covariance))
        assert answer.status != "aligned" or np.all(off < 4.0), answer.reasons
        statuses.append(answer.status)
        if answer.status == "inconsistent":
            assert "the method that the library chooses finds another attitude" in " ".join(answer.reasons)
    assert method != "sgkf" or "inconsistent" in statuses


@pytest.mark.slow
def test_gyros_that_do_not_see_the_earth_turn_are_refused(drives):
    record, odometer, place, _, _ = drives[0]
    with pytest.raises(AlignmentError, match=r"which gyro errors of 100 deg/h hide: choose auto or motion"):
        align(record, place, "industrial", aid=Odometer(odometer), method="sgkf")


def test_two_answers_from_one_log():
    """What the other answer leaves is added to sigma; two that exclude each other are a contradiction; equal ones say nothing."""
    record, odometer, place, spec, _ = driven(0)
    own = align(record.between(None, 60.0), place, spec, aid=Odometer(odometer))
    sigma = np.sqrt(np.diag(own.phi_covariance))

    def other(turn, size):
        phi = np.array([0.0, 0.0, turn * sigma[2]])
        return replace(own, C_nb=dcm_from_rotation_vector(phi) @ own.C_nb, phi_covariance=size**2 * own.phi_covariance)

    assert against(own, own) == []
    assert against(own, other(1.9, 1.5)) == []
    (tight,) = against(own, other(1.0, 0.5))
    assert tight.key == "answers.tight"
    np.testing.assert_allclose(tight.effect.heading, np.sqrt(1.0 + 1.0 - 0.25) * sigma[2])
    (differs,) = against(own, other(5.0, 1.0))
    assert (differs.key, differs.kind) == ("answers.differ", "unknown")


def test_an_odometer_is_needed():
    record, _, place, spec, motion = driven(0)
    at = motion.states(record.time[::100])
    gnss = GnssRecord(record.time[::100], v_n=at.v_n, lat=at.lat, lon=at.lon, alt=at.alt)
    with pytest.raises(UsageError, match="is that of an odometer"):
        align_in_motion(record, spec, gnss=gnss, position=place, method="gh3")


@pytest.mark.slow
def test_the_command_line(tmp_path):
    """`align --method imakf` and `--method sgkf` on logs made by `simulate`."""
    run = CliRunner().invoke
    still = tmp_path / "still"
    (tmp_path / "still.yaml").write_text(yaml.safe_dump(STILL | {"duration": "120 s"}))
    made = run(app, ["simulate", str(tmp_path / "still.yaml"), "-o", str(still), "--seed", "1", "--no-plot"])
    assert made.exit_code == 0, made.output
    log = next(still.rglob("imu*"))
    place = ["--lat", "45", "--lon", "10"]
    answer = run(app, ["align", str(log), *place, "--imu", "navigation", "--method", "imakf", "--json"])
    assert answer.exit_code == 0, answer.output
    assert json.loads(answer.stdout)["method"] == "imakf"
    ring = tmp_path / "ring"
    made = run(app, ["simulate", "odometer_ring", "-o", str(ring), "--seed", "1", "--no-plot"])
    assert made.exit_code == 0, made.output
    files = [str(next(ring.rglob(f"{name}*"))) for name in ("imu", "odometer")]
    place = ["--lat", "39.9", "--lon", "116.3", "--alt", "50"]
    arguments = [files[0], "--odometer", files[1], *place, "--imu", "navigation", "--method", "sgkf", "--json"]
    answer = run(app, ["align", *arguments])
    assert answer.exit_code == 0, answer.output
    assert json.loads(answer.stdout)["method"] == "sgkf"


def test_each_published_filter_says_what_it_assumes_and_where_it_belongs():
    """A method of another base is refused with its own; factors say in which share of the epochs they acted."""
    record, spec, _ = next(iter(logs(SWAY, 1)))
    plain, faded = (align(record, PLACE, spec, method=method).method_reason for method in ("kf", "imakf"))
    assert "white noise of one size" in plain
    assert "factor" not in plain
    assert float(re.search(r"a factor acted in ([\d.]+)% of the epochs", faded)[1]) > 10.0
    with pytest.raises(UsageError, match="'sgkf' is that of a vehicle with an odometer; choose one of auto, analytic"):
        align(record, PLACE, spec, method="sgkf")
    with pytest.raises(UsageError, match="'imkf' is not known; choose one of auto"):
        align(record, PLACE, spec, method="imkf")
