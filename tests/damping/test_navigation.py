"""`navigate` with damping: every method at sea, near the poles, with a sick log, on a real recording, from the shell."""

import json
from dataclasses import replace

import numpy as np
import pytest
from typer.testing import CliRunner

from tests.damping.marine_case import DEG_PER_HOUR, MICRO_G, ideal_and_truth
from tests.recordings import rlg_vehicle_xian
from tests.runs import few_and_all, some
from truenorth.aiding.aids import VelocityLog
from truenorth.alignment import align
from truenorth.cli import app
from truenorth.core.errors import UsageError
from truenorth.core.units import parse
from truenorth.damping.course import errors_of, without_errors
from truenorth.damping.options import Damper
from truenorth.errors.deflection import Deflection
from truenorth.errors.log import LOGS, LogErrors
from truenorth.errors.marine import BA, BG, DP, DV, MOTION, OF_INS, PHI
from truenorth.navigation import Mounting, Start, navigate
from truenorth.records import ImuRecord, VelocityRecord
from truenorth.records.specs import ImuSpec
from truenorth.simulation import simulate
from truenorth.state.mounting import mounting_angles

SIGMA = np.zeros(13)
SIGMA[DV], SIGMA[DP], SIGMA[PHI] = 0.1, 62.0, np.radians(np.array([0.7, 0.7, 7.7]) / 60.0)
SIGMA[BG], SIGMA[BA] = 0.005 * DEG_PER_HOUR, 50.0 * MICRO_G
SPEC = ImuSpec(
    gyro_bias=0.005 * DEG_PER_HOUR,
    accel_bias=50.0 * MICRO_G,
    gyro_random_walk=parse("0.001 deg/sqrt(h)", "angle_random_walk"),
    accel_random_walk=parse("10 ug/sqrt(Hz)", "velocity_random_walk"),
)
ERROR = np.array([-0.3, 0.2])
STRAIGHT = Deflection(0.0)  # the simulated plumb line
STEADY = LogErrors(drift=0.3, drift_time=np.inf)  # what the search finds of the log below, in ten runs of the filter
METHODS = ("internal", "external", "kalman", "double", "augmented")


class Ship:
    """A voyage with drawn errors: log, start, truth."""

    def __init__(self, lat=45.78, heading=51.34, seed=1, hours=24.0):
        self.rng = np.random.default_rng(seed)
        ideal, self.truth = ideal_and_truth(lat, heading, hours=hours)
        x0 = SIGMA * self.rng.standard_normal(13)
        biases = {"gyro_bias": x0[BG], "accel_bias": x0[BA]}
        self.record = simulate(ideal, imu=ImuSpec(**_walks()), seed=seed, errors=biases).record
        begin = without_errors(self.truth[:2], -x0[:7])
        P = np.zeros((15, 15))
        P[np.ix_(OF_INS, OF_INS)] = np.diag(SIGMA**2)
        lat, lon, alt = begin.position[0]
        self.start = Start(0.0, begin.C_nb[0], begin.v_n[0], lat, lon, alt, np.zeros(3), np.zeros(3), P)

    def log(self, error=ERROR):
        v = self.truth.v_n.copy()
        v[:, :2] += error + 0.05 * self.rng.standard_normal((len(v), 2))
        return VelocityRecord(self.truth.time, v, "navigation")

    def navigate(self, damper, log=None, errors=STEADY, fixes=None):
        aid = [] if log is None else [VelocityLog(log, errors=errors)]
        return navigate(
            self.record,
            self.start,
            aid=aid if fixes is None else [*aid, fixes],
            altitude="fixed",
            imu=SPEC,
            deflection=STRAIGHT,
            damping=damper,
            output=1.0,
        )

    def errors(self, result):
        found = result.track
        return errors_of(found, self.truth[: len(found)])


def _walks():
    return {"gyro_random_walk": SPEC.gyro_random_walk, "accel_random_walk": SPEC.accel_random_walk}


@pytest.fixture(scope="module")
def ship():
    return Ship()


def swing(values):
    """What swings with Schuler's period: the scatter about hourly straight lines, one number a column."""
    parts = values[: len(values) // 506 * 506].reshape(-1, 506, values.shape[1])  # 84.4 min at 10 s
    t = np.linspace(-1, 1, 506)
    A = np.stack([np.ones_like(t), t], axis=1)
    left = [part - A @ np.linalg.lstsq(A, part, rcond=None)[0] for part in parts]
    return np.sqrt(np.mean(np.array(left) ** 2, axis=(0, 1)))


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS)
def test_every_method_calms_the_oscillation(ship, method):
    """Velocity swings by less than a fifth of the free INS's from 6 h on, and errors keep inside 4.5 sigma."""
    free = ship.errors(ship.navigate(Damper("none")))
    errors = None if method == "augmented" else STEADY
    result = ship.navigate(Damper(method, azimuth=0.5 if method == "external" else 0.0), ship.log(), errors)
    left = ship.errors(result)
    late = result.time >= 6 * 3600.0
    assert swing(left[late][:, DV]).max() < 0.2 * swing(free[late][:, DV]).max()
    t = result.track
    sigma = t.sigma[:, OF_INS[MOTION]]
    if method != "internal":  # whose own motion is not in its bands
        np.testing.assert_array_less(np.abs(left[late]), 4.5 * sigma[late])


@pytest.mark.slow
@few_and_all(12, few=4)
def test_bands_of_the_network_are_its_scatter(runs):
    """Propagated through the closed loop, against voyages with a log error drawn anew; RMS/sigma in its 99.9 % band."""
    ratios = []
    for seed in range(runs):
        ship = Ship(seed=100 + seed)
        result = ship.navigate(Damper("external", azimuth=0.5), ship.log(0.3 * ship.rng.standard_normal(2)))
        t = result.track
        k = np.array([3000, 8000])
        sigma = t.sigma[np.ix_(k, OF_INS[MOTION])]
        ratios.append((ship.errors(result)[k] / sigma) ** 2)
    mean = np.mean(ratios, axis=0)
    assert np.sqrt(mean).max() < 1 + 4.7 / np.sqrt(2 * runs)  # the worst of 14 numbers, 4.7 sigma
    assert abs(np.mean(mean) - 1) < 3.3 * np.sqrt(2 / runs / 3)  # some three of seven are independent


@pytest.mark.slow
def test_the_logs_constant_error_is_found(ship):
    result = ship.navigate(Damper("augmented"), ship.log(), None)
    found, sigma = result.damping.reference_error, result.damping.reference_error_sigma
    np.testing.assert_array_less(np.abs(found - ERROR), 4.0 * sigma)
    assert sigma.max() < 0.1
    assert result.damping.lines[0] / 60 == pytest.approx(80.5, abs=3)
    before, after = result.damping.before, result.damping.after
    f = np.abs(before.frequency)
    schuler = (f > 1 / 6000) & (f < 1 / 4200)
    assert after.amplitude[schuler].max() < 0.1 * before.amplitude[schuler].max()
    assert json.dumps(result.summary(), allow_nan=False)
    assert "log error east" in result.damping.in_words()
    apart = 0.5 * result.damping.lines[1] ** 2 / 86400.0 / 60.0  # what a day tells apart
    assert f"min (to {apart:.1f} min)" in result.damping.in_words()


@pytest.mark.slow
@pytest.mark.parametrize(("lat", "heading"), some([(-45.78, 231.0)], [(79.0, 120.0), (-80.0, -30.0), (0.5, 270.0)]))
def test_both_hemispheres_east_and_west(lat, heading):
    ship = Ship(lat, heading, seed=3)
    free = ship.errors(ship.navigate(Damper("none")))
    for method in ("external", "double", "augmented"):
        result = ship.navigate(Damper(method), ship.log())
        left = ship.errors(result)
        late = result.time >= 6 * 3600.0
        assert swing(left[late][:, DV]).max() < 0.25 * swing(free[late][:, DV]).max()
        t = result.track
        sigma = t.sigma[:, OF_INS[MOTION]]
        assert (np.abs(left[late]) / sigma[late]).max() < 5.0


@pytest.mark.slow
@pytest.mark.parametrize("method", some(["double"], ["external", "kalman", "augmented"]))
def test_a_sick_log(ship, method):
    """Outliers, a jump of 1.1 m/s and two hours of silence: named, and what is left is near to a healthy log's."""
    healthy = ship.log()
    v = healthy.velocity.copy()
    hit = ship.rng.random(len(v)) < 0.01
    hit[3990:4010] = False
    v[hit, :2] += 5.0 * np.sign(ship.rng.standard_normal((hit.sum(), 2)))
    v[4000:, :2] += [0.5, -1.0]
    keep = np.ones(len(v), dtype=bool)
    keep[5000:5720] = False
    sick = VelocityRecord(healthy.time[keep], v[keep], "navigation")
    good, bad = (ship.navigate(Damper(method), log, None) for log in (healthy, sick))
    text = " ".join(bad.reasons)
    assert "outliers" in text
    assert "jumps by +0." in text
    assert "silent for 72" in text
    one, two = ship.errors(good), ship.errors(bad)
    silent = (good.time > 50_000.0) & (good.time <= 57_200.0)
    sigma = bad.track.sigma[silent]
    assert (np.abs(two[silent, DV]) / sigma[:, 3:5]).max() < 4.5  # it coasts, and knows how badly
    assert np.abs(two[silent, DV]).max() < 3.0  # no worse than undamped
    after = good.time > 57_200.0 + 3 * 3600.0
    assert np.abs(two[after, DV]).max() < np.abs(one[after, DV]).max() + 0.2
    assert np.abs(two[after, DP]).max() < 2.0 * np.abs(one[after, DP]).max() + 3000.0
    assert np.degrees(np.abs(two[after, PHI.stop - 1]).max()) < np.degrees(np.abs(one[after, PHI.stop - 1]).max()) + 0.1


@pytest.mark.slow
@pytest.mark.parametrize("method", some(["kalman"], ["external"]))
@pytest.mark.parametrize("factor", some([0.0], [1.0 / 0.514444]))
def test_a_log_that_cannot_be_this_ships(ship, method, factor):
    """Dead, or knots taken for m/s: nothing in the log itself is amiss, and it is not believed in silence."""
    log = ship.log()
    result = ship.navigate(Damper(method), VelocityRecord(log.time, factor * log.velocity, "navigation"))
    assert result.status == "inconsistent"
    assert "m/s is expected: check its units" in result.reasons[0] + result.reasons[1]
    assert ship.navigate(Damper(method), log).status == "navigated"


@pytest.mark.slow
def test_a_switch_later_than_the_start(ship):
    result = ship.navigate(Damper("augmented", start=9000.0), ship.log())
    free = ship.navigate(Damper("none"))
    before = result.time < 9000.0
    np.testing.assert_array_equal(result.v_n[before], free.v_n[before])
    late = result.time >= 4 * 3600.0
    left, sigma = ship.errors(result)[late], result.track.sigma[late]
    assert (np.abs(left[:, DV]) / sigma[:, 3:5]).max() < 4.5
    assert result.damping.switch == pytest.approx(9000.0, abs=10.0)


@pytest.mark.slow
def test_a_real_recording():
    """A parked vehicle with people and engine: 300 s of alignment, 600 s of navigation, a zero log that is .1 m/s wrong.

    The free INS has 6.1 m after ten minutes and .009 m/s RMS; the 15-state filter 2.7 m and .005, the log's error found to 1 cm/s.
    """
    record, place = rlg_vehicle_xian()
    start = align(record.between(None, 300.0), place, "navigation")
    time = np.arange(300.0, 900.0)
    noise = 0.02 * np.random.default_rng(0).standard_normal((len(time), 2))
    log = VelocityRecord(time, np.column_stack([0.1 + noise, np.zeros(len(time))]), "navigation")
    found = {
        method: navigate(record, start, aid=VelocityLog(log), altitude="fixed", damping=Damper(method))
        for method in ("none", "kalman", "augmented")
    }
    away = {m: np.linalg.norm(r.displacement[-1]) for m, r in found.items()}
    speed = {m: np.sqrt(np.mean(r.v_n[:, :2] ** 2)) for m, r in found.items()}
    assert away["augmented"] < 0.6 * away["none"] < 6.0
    assert speed["augmented"] < 0.65 * speed["none"]
    assert away["kalman"] > 40.0  # it believes the log
    assert found["augmented"].damping.reference_error == pytest.approx([0.1, 0.1], abs=0.015)
    k = found["augmented"]
    assert (np.abs(k.displacement[-1]) < 3 * k.position_sigma[-1, :2]).all()
    assert (np.abs(k.v_n[-1, :2]) < 3 * k.v_sigma[-1, :2]).all()


@pytest.mark.slow
def test_a_log_in_body_axes_mounted_askew(ship):
    """Forward and right as the hull has them, the IMU turned in it by 20 deg: the same answer as in navigation axes."""
    log = ship.log()
    C_mb = mounting_angles(np.radians(20.0), 0.0, 0.0)
    v_b = np.einsum("kij,ki->kj", ship.truth.C_nb, log.velocity)
    body = VelocityRecord(log.time, v_b @ C_mb.T, "body")
    options = {"altitude": "fixed", "imu": SPEC, "damping": Damper("augmented"), "output": 1.0}
    one = navigate(ship.record, ship.start, aid=VelocityLog(log, errors=STEADY), **options)
    askew = VelocityLog(body, Mounting(C_mb=C_mb), replace(LOGS["em"], drift_time=np.inf))
    two = navigate(ship.record, ship.start, aid=askew, **options)
    late = one.time > 12 * 3600.0
    assert np.abs(one.v_n - two.v_n)[late].max() < 0.05  # the INS's heading error of .1 deg turns 12.8 m/s by .02
    with pytest.raises(UsageError, match="its arm alone"):
        navigate(ship.record, ship.start, aid=VelocityLog(body, Mounting(scale_sigma=0.01)), **options)
    with pytest.raises(UsageError, match="expected 10 s at most"):
        navigate(ship.record, ship.start, aid=VelocityLog(body), **options | {"output": 40.0})


def test_rows_of_a_long_log_are_close_enough():
    """Of 60 h a track has a row every 10.8 s by default, and damping takes 10 s at most: not refused."""
    from truenorth.navigation.procedure import _intervals

    long = ImuRecord(np.linspace(10.0, 216e3, 100), np.zeros((100, 3)), np.tile([0.0, 0.0, 9.8], (100, 1)))
    assert _intervals(long, None, None) == (1.0, 11)
    assert _intervals(long, None, None, True) == (1.0, 8)


@pytest.mark.slow
def test_a_ramp_throws_the_switch_slowly(ship):
    """Halfway through it, half the network: the track lies between the undamped and the damped one."""
    log = ship.log()
    slow, fast = (ship.navigate(Damper("external", ramp=ramp), log) for ramp in (7200.0, 0.0))
    free = ship.navigate(Damper("none"))
    early = slow.time < 1800.0
    apart = [np.abs(r.v_n - free.v_n)[early].max() for r in (slow, fast)]
    assert 0.0 < apart[0] < 0.5 * apart[1]
    late = slow.time > 12 * 3600.0
    assert swing(ship.errors(slow)[late][:, DV]).max() < 0.2 * swing(ship.errors(free)[late][:, DV]).max()


def test_what_is_refused(ship):
    with pytest.raises(UsageError, match="expected one of none, internal"):
        Damper("strong")
    with pytest.raises(UsageError, match="ramp of -1 s"):
        Damper("external", ramp=-1.0)
    with pytest.raises(UsageError, match="it needs a reference"):
        Damper("internal", azimuth=0.5)
    with pytest.raises(UsageError, match="velocity=record"):
        ship.navigate(Damper("double"))
    with pytest.raises(UsageError, match="height is held at sea"):
        navigate(ship.record, ship.start, altitude="free", imu=SPEC, damping=Damper("none"))
    with pytest.raises(UsageError, match="no aiding sensor, no stops"):
        navigate(ship.record, ship.start, altitude="fixed", zupt=[(0.0, 900.0)], imu=SPEC, damping=Damper("none"))


def test_from_the_shell(tmp_path):
    """At the quay for ten minutes, with a report."""
    from truenorth.core.position import Position
    from truenorth.formats import write_imu
    from truenorth.records.specs import imu_spec
    from truenorth.simulation import rest

    place = Position.from_degrees(48.0, 11.0)
    record = simulate(rest(place, 0.6), rate=20.0, duration=800.0, imu=imu_spec("navigation"), seed=2).record
    write_imu(record, tmp_path / "log.parquet")
    align(record.between(None, 200.0), place, "navigation").save(tmp_path / "start")
    time = np.arange(200, 800)
    rows = "\n".join(f"{t},0.1,0.1,0.0" for t in time)
    (tmp_path / "speed.csv").write_text(f"time,VE,VN,VU\n{rows}\n")
    base = ["navigate", str(tmp_path / "log.parquet"), "--start", str(tmp_path / "start"), "--velocity"]
    base += [str(tmp_path / "speed.csv"), "--damping"]
    done = CliRunner().invoke(app, [*base, "augmented", "--log-drift", "0.2 m/s", "-o", str(tmp_path / "out")])
    assert done.exit_code == 0, done.output
    assert "damping: augmented from 200 s on" in done.output
    page = (tmp_path / "out" / "report.html").read_text()
    assert "Spectrum of the velocity" in page
    assert "Errors of the log" in page
    assert "Modes of" not in page  # a filter has none of its own here
    said = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert said["damping"]["reference_error_m_s"] == pytest.approx([0.1, 0.1], abs=0.03)
    wrong = CliRunner().invoke(app, [*base, "strong"])
    assert isinstance(wrong.exception, UsageError)
