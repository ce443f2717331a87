"""`navigate` from the user's side: starts, sensors, stops, gaps, wrong input, results on disk."""

import json
from dataclasses import replace

import numpy as np
import pytest

from truenorth.aiding.aids import Barometer, Gnss, Odometer, VelocityLog
from truenorth.alignment import align
from truenorth.core.errors import AlignmentError, DataError, UsageError
from truenorth.core.position import Position
from truenorth.errors.log import LogErrors
from truenorth.navigation import Mounting, Start, navigate
from truenorth.navigation.start import read_start, start_from_alignment
from truenorth.records import GnssRecord, HeightRecord, ImuRecord, OdometerRecord, VelocityRecord
from truenorth.records.specs import imu_spec
from truenorth.simulation import rest, simulate
from truenorth.simulation.course import course
from truenorth.simulation.manoeuvres import accelerate, straight, turn
from truenorth.state.layout import DV
from truenorth.state.mounting import mounting_angles
from truenorth.strapdown.wander import C_en

SPEC = imu_spec("tactical")
PLACE = Position.from_degrees(48.0, 11.0, 500.0)
SIGMA = np.repeat([5e-4, 0.01, 3.0, SPEC.gyro_bias, SPEC.accel_bias], 3)


@pytest.fixture(scope="module")
def drive():
    """A car that stands 30 s, drives off and turns twice; its motion, log and start."""
    legs = [
        *straight(30.0),
        *accelerate(15.0, 1.5, 0.0),
        *straight(20.0),
        *turn(np.radians(90.0), np.radians(10.0)),
        *straight(30.0),
        *turn(np.radians(-60.0), np.radians(6.0)),
        *straight(60.0),
    ]
    motion = course(PLACE, legs, heading=0.7)
    simulation = simulate(motion, rate=50.0, duration=180.0, imu=SPEC, seed=3)
    s = motion.states(0.0)
    rng = np.random.default_rng(1)
    from truenorth.core.attitude import dcm_from_rotation_vector

    C = dcm_from_rotation_vector(-SIGMA[:3] * rng.standard_normal(3)) @ s.C_nb
    start = Start(0.0, C, np.zeros(3), PLACE.lat, PLACE.lon, PLACE.alt, np.zeros(3), np.zeros(3), np.diag(SIGMA**2))
    return motion, simulation.record, start


def fixes(motion, time, sigma=1.0, seed=0, arm=(0.0, 0.0, 0.0), with_velocity=False):
    s = motion.states(time)
    rng = np.random.default_rng(seed)
    offset = s.C_nb @ np.asarray(arm) + sigma * rng.standard_normal((len(time), 3))
    lat, lon, alt = s.lat + offset[:, 1] / 6.37e6, s.lon + offset[:, 0] / (6.39e6 * np.cos(s.lat)), s.alt + offset[:, 2]
    v = s.v_n + 0.05 * rng.standard_normal((len(time), 3)) if with_velocity else None
    return GnssRecord(time, lat, lon, alt, v_n=v, position_sigma=np.full((len(time), 3), sigma), source="gnss.csv")


def metres_off(result, motion, k=-1):
    s = motion.states(result.time[k])
    lat, lon, alt = result.position[k]
    return np.array([(lon - s.lon) * 6.39e6 * np.cos(s.lat), (lat - s.lat) * 6.37e6, alt - s.alt])


def test_odometer_bounds_what_free_inertial_does_not(drive):
    """Errors of a 3 min drive stay within 4 sigma in all modes, and each sensor earns its keep."""
    motion, record, start = drive
    time = np.arange(0.55, 179.0, 0.1)
    s = motion.states(time)
    C_mb = mounting_angles(np.radians(3.0), np.radians(-2.0), 0.0)
    v_b = np.einsum("kji,kj->ki", s.C_nb, s.v_n)  # here the body is the vehicle
    speed = 1.02 * v_b[:, 1] + 0.02 * np.random.default_rng(2).standard_normal(len(time))
    odometer = OdometerRecord(time, speed, "speed", source="odo.csv")
    # The IMU sits turned in the car: its log, and its start, in its own axes.
    turned = record.rotated(C_mb.T)
    at = replace(start, C_nb=start.C_nb @ C_mb)
    free = navigate(turned, at, imu=SPEC, altitude="fixed")
    wheel = Mounting(scale_sigma=0.05, angle_sigma=np.radians(5.0))
    aided = navigate(turned, at, aid=Odometer(odometer, wheel), imu=SPEC, zupt=[(1.0, 29.0)])
    for result in (free, aided):
        assert np.all(np.abs(metres_off(result, motion)[:2]) < 4 * result.position_sigma[-1, :2])
    assert np.hypot(*aided.position_sigma[-1, :2]) < 0.2 * np.hypot(*free.position_sigma[-1, :2])
    said = aided.estimated()
    for name, true in (("odometer scale", [0.02]), ("odometer mounting", None)):
        value, sigma = (np.array(said[name][key]) for key in ("value", "sigma"))
        if true is not None:
            assert np.all(np.abs(value - true) < 4 * sigma)
        assert np.all(sigma < 0.01)
    assert aided.status == "navigated"
    assert aided.altitude == "free"
    assert any("no sensor of height" in reason for reason in aided.reasons)


@pytest.mark.slow
def test_gnss_with_a_latency_and_a_clock_offset(drive):
    """An offset of 300 ms is found with its sign; given, or as latency, it is gone."""
    motion, record, start = drive
    time = np.arange(1.0, 179.0)
    late = fixes(motion, time, sigma=0.3).shifted(0.3)
    found = navigate(record, start, aid=Gnss(late, Mounting()), imu=SPEC)
    words = [reason for reason in found.reasons if reason.startswith("warning: the clock")]
    assert len(words) == 1
    assert "late" in words[0]
    assert "latency of 0.3" in words[0] or "latency of 0.29" in words[0]
    early = navigate(record, start, aid=Gnss(late.shifted(-0.6), Mounting()), imu=SPEC)
    words = [reason for reason in early.reasons if "early: shift the times of that log by 0." in reason]
    assert words[0].split(" by ")[1][:4] in ("0.29", "0.30")
    aids = Gnss(late.shifted(-0.3)), Gnss(late, Mounting(latency=0.3)), Gnss(late, Mounting(latency_sigma=0.5))
    for aid in aids:
        result = navigate(record, start, aid=aid, imu=SPEC)
        assert not any(reason.startswith("warning: the clock") for reason in result.reasons)
        assert np.all(np.abs(metres_off(result, motion)) < 4 * result.position_sigma[-1])


def test_a_wrong_lever_arm_is_said(drive):
    motion, record, start = drive
    gnss = fixes(motion, np.arange(1.0, 179.0), sigma=0.1, arm=(1.5, 2.5, 1.0))
    wrong = navigate(record, start, aid=Gnss(gnss, Mounting()), imu=SPEC)
    assert any("lever arm of the GNSS seems to be right +1.5" in reason for reason in wrong.reasons)
    right = navigate(record, start, aid=Gnss(gnss, Mounting(lever_arm=np.array([1.5, 2.5, 1.0]))), imu=SPEC)
    assert not any("lever arm" in reason for reason in right.reasons)


def test_height_from_a_barometer_and_from_nothing(drive):
    """The barometer's slow error is in the sigma of height; the free channel's sigma grows, the fixed one's stays."""
    motion, record, start = drive
    time = np.arange(0.2, 179.0, 0.2)
    baro = HeightRecord(time, motion.states(time).alt + 4.0 + 0.5 * np.random.default_rng(4).standard_normal(len(time)))
    barometer = Mounting(bias_sigma=5.0, bias_time=3600.0)
    held = navigate(record, start, aid=Barometer(baro, barometer), imu=SPEC)
    free = navigate(record, start, imu=SPEC, altitude="free")
    fixed = navigate(record, start, imu=SPEC)
    assert (held.altitude, free.altitude, fixed.altitude) == ("baro", "free", "fixed")
    assert free.position_sigma[-1, 2] > 10 * held.position_sigma[-1, 2]
    assert abs(metres_off(held, motion)[2]) < 4 * held.position_sigma[-1, 2]
    assert np.ptp(fixed.position[:, 2]) == 0.0
    assert fixed.position_sigma[-1, 2] == pytest.approx(3.0)
    # Its vertical velocity is taken for zero and measured by nobody: no sigma of it, where a zero would say that it is exact.
    assert np.isnan(fixed.v_sigma[:, 2]).all()
    assert fixed.summary()["v_n_sigma_m_s"] == [*fixed.v_sigma[-1, :2], None]
    assert np.isfinite(fixed.v_sigma[:, :2]).all()
    assert np.isfinite(free.v_sigma).all()


def test_a_barometer_of_another_level_has_no_good_status(drive):
    """Its first rows were rejected, and taken once the height had drifted to where it counts from."""
    motion, record, start = drive
    time = np.arange(0.2, 179.0)
    rough = replace(start, P=start.P + np.diag(np.arange(15) == 8) * 60.0**2)
    high = Barometer(HeightRecord(time, motion.states(time).alt + 120.0))
    gnss = Gnss(fixes(motion, time), Mounting())
    asked = {"imu": SPEC, "altitude": "baro", "check_clocks": False}
    alone, both, wide = (
        navigate(record, begin, aid=aid, **asked)
        for begin, aid in (
            (start, high),
            (rough, [high, gnss]),
            (rough, [replace(high, mounting=Mounting(bias_sigma=60.0, bias_time=3600.0)), gnss]),
        )
    )
    assert alone.status == both.status == "inconsistent"
    assert any(e.key == "height.first" and e.figures["apart"] == pytest.approx(120.0, abs=1.0) for e in alone.evidence)
    assert any(e.key == "height.apart" and e.figures["apart"] == pytest.approx(120.0, abs=1.0) for e in both.evidence)
    assert both.position[-1, 2] - start.alt > 100.0  # as high as the barometer says, without a row that is rejected
    assert wide.status == "navigated"


@pytest.mark.parametrize("altitude", ["gnss", "free"])
def test_height_holds_the_level_of_a_barometer_that_does_not_keep_it(drive, altitude):
    """Heights of GNSS above the ellipsoid, 45 m below those above the sea: 60 sigmas off in silence."""
    motion, record, start = drive
    time = np.arange(0.2, 179.0)
    high = Barometer(HeightRecord(time, motion.states(time).alt + 45.0))
    gnss = Gnss(fixes(motion, time), Mounting())
    asked = {"imu": SPEC, "altitude": altitude, "check_clocks": False}
    alone, both = (navigate(record, start, aid=aid, **asked) for aid in (gnss, [gnss, high]))
    assert both.status == "navigated"
    assert any(e.key == "height.either" and e.urgent for e in both.evidence)
    assert both.position_sigma[:, 2] == pytest.approx(np.hypot(45.0, alone.position_sigma[:, 2]), rel=0.02)
    assert np.array_equal(both.position, alone.position)
    assert np.array_equal(both.position_sigma[:, :2], alone.position_sigma[:, :2])


def test_stops_are_found_where_the_car_stands_and_nowhere_else(drive):
    _, record, start = drive
    result = navigate(record, start, imu=SPEC, altitude="fixed", zupt="auto")
    used = result.residuals[0]
    assert used.name == "zero velocity"
    assert 20 <= np.sum(used.used) <= 31
    assert np.all(used.time[used.used] < 31.0)


def test_a_gap_is_bridged_counted_and_believed(drive):
    """Half a second lost while standing, and while turning: the sigma grows with it; a longer one is refused."""
    _, record, start = drive
    whole = navigate(record, start, imu=SPEC)
    kept = np.ones(len(record), dtype=bool)
    kept[4500:4525] = False

    def without(kept):
        return ImuRecord(record.time[kept], record.gyro[kept], record.accel[kept], record.kind, "log.csv")

    result = navigate(without(kept), start, imu=SPEC)
    assert len(result.gaps) == 1
    assert result.gaps[0] == pytest.approx((90.0, 0.52))
    assert result.position_sigma[-1, 0] > whole.position_sigma[-1, 0]
    kept[4500:4600] = False
    with pytest.raises(DataError, match=r"log.csv: row 4501, column time: a gap of 2.020 s"):
        navigate(without(kept), start, imu=SPEC)


@pytest.mark.slow
def test_smoothing_is_at_least_as_good(drive):
    motion, record, start = drive
    gnss = fixes(motion, np.arange(1.0, 179.0, 5.0), sigma=1.0)
    one, two = (navigate(record, start, aid=Gnss(gnss), imu=SPEC, smooth=smooth) for smooth in (False, True))
    assert two.smoothed
    assert np.all(two.position_sigma <= one.position_sigma * (1 + 1e-9))
    np.testing.assert_allclose(two.position[-1], one.position[-1], rtol=0, atol=1e-9)
    errors = [np.mean([np.sum(metres_off(r, motion, k)[:2] ** 2) for k in range(10, 170)]) for r in (one, two)]
    assert errors[1] < errors[0]


@pytest.mark.slow
def test_only_rivals_that_may_count_are_smoothed(drive, monkeypatch):
    """Most rivals are ruled out by their innovations, which are the filter's: to smooth them takes ten times as long."""
    from truenorth.estimate import smoothing

    smooth, made = smoothing.smoothed, []
    monkeypatch.setattr(smoothing, "smoothed", lambda *given: made.append(1) or smooth(*given))
    motion, record, start = drive
    result = navigate(record, start, aid=Gnss(fixes(motion, np.arange(1.0, 179.0, 1.0))), imu=SPEC, smooth=True)
    assert result.status == "navigated"
    assert 1 <= len(made) <= 6


def test_navigation_starts_from_an_alignment_and_from_its_folder(tmp_path):
    """The folder holds what the object does; tilt and accelerometer bias stay balanced, so that little is lost at rest."""
    spec = imu_spec("navigation")
    record = simulate(rest(PLACE, 0.6, 0.02, -0.03), rate=50.0, duration=400.0, imu=spec, seed=1).record
    alignment = align(record.between(None, 200.0), PLACE, spec)
    alignment.save(tmp_path)
    begin, own = start_from_alignment(alignment), read_start(tmp_path)
    np.testing.assert_allclose(own[0].P, begin.P, rtol=1e-12, atol=0)
    assert own[1] == spec
    a, b = navigate(record, alignment), navigate(record, tmp_path)
    np.testing.assert_allclose(a.position, b.position, rtol=1e-12, atol=0)
    # Uncorrelated, the tilt alone (10 arcsec and more) would make .1 m/s in 200 s.
    loose = replace(begin, P=np.diag(np.diag(begin.P)))
    assert np.all(a.v_sigma[-1, :2] < 0.3 * navigate(record, loose, imu=spec).v_sigma[-1, :2])
    assert np.all(np.abs(a.v_n[-1, :2]) < 4 * a.v_sigma[-1, :2])


def test_a_start_without_heading_is_refused(tmp_path):
    spec = imu_spec("consumer")
    record = simulate(rest(PLACE), rate=50.0, duration=60.0, imu=spec, seed=1).record
    alignment = align(record, PLACE, spec)
    assert not alignment.heading_known
    with pytest.raises(AlignmentError, match="heading may not be used"):
        navigate(record, alignment)
    alignment.save(tmp_path)
    with pytest.raises(AlignmentError, match="no heading that may be used"):
        navigate(record, tmp_path)


def test_a_start_that_is_no_alignment_is_said_to_be_none(tmp_path):
    for content in ('{"type": "x"}', '{"scenario": "van", "seed": 0}', '{"status": "x", "heading_deg": null}'):
        (tmp_path / "summary.json").write_text(content)
        with pytest.raises(
            DataError, match=r"summary\.json: this is no alignment of ours.*folder of a saved alignment"
        ):
            read_start(tmp_path)


def test_wrong_input_is_found_and_said(drive, tmp_path):
    motion, record, start = drive
    time = np.arange(1.0, 179.0)
    good = fixes(motion, time, with_velocity=True)
    with pytest.raises(DataError, match=r"no overlap.*one clock"):
        navigate(record, start, aid=Gnss(good.between(None, 25.0).shifted(1e6)), imu=SPEC)
    ned = replace(good, v_n=good.v_n[:, [1, 0, 2]] * [1, 1, -1])
    with pytest.raises(DataError, match="north, east, down"):
        navigate(record, start, aid=Gnss(ned), imu=SPEC)
    exchanged = replace(good, lat=good.lon, lon=good.lat, v_n=None)
    with pytest.raises(DataError, match=r"gnss\.csv: row \d, columns lat and lon: 11\..*exchanged they fit"):
        navigate(record, start, aid=Gnss(exchanged), imu=SPEC)
    high = HeightRecord(time, np.full(len(time), 900.0), source="baro.csv")
    with pytest.raises(DataError, match=r"baro\.csv: row 3, column alt: 900\.0 m, 400 m from"):
        navigate(record, start, aid=Barometer(high), imu=SPEC)
    with pytest.raises(UsageError, match="centimetres"):
        Mounting(lever_arm=np.array([120.0, 50.0, 80.0]))
    with pytest.raises(UsageError, match="expected one of fixed, free, baro, gnss"):
        navigate(record, start, imu=SPEC, altitude="up")
    with pytest.raises(UsageError, match="without a barometer"):
        navigate(record, start, imu=SPEC, altitude="baro")
    with pytest.raises(UsageError, match="without a specification"):
        navigate(record, start)
    with pytest.raises(DataError, match=r"but the alignment holds at 500\.000 s"):
        navigate(record, replace(start, time=500.0), imu=SPEC)
    with pytest.raises(DataError, match="cannot be read"):
        navigate(record, tmp_path / "nothing")
    (tmp_path / "summary.json").write_text(json.dumps({"heading_deg": 1.0}))
    with pytest.raises(DataError, match="write the alignment again"):
        navigate(record, tmp_path)


@pytest.mark.slow
def test_files_with_late_rows_navigate_as_sorted_ones(drive, tmp_path):
    """Neighbours of a GNSS log and of an odometer's counter exchanged: the same bits, and it is said."""
    from truenorth.formats import read_gnss, read_odometer, write_record

    motion, record, start = drive
    record, time = record.between(None, 60.0), np.arange(0.5, 59.0, 0.5)
    write_record(fixes(motion, time, with_velocity=True), tmp_path / "gnss.csv")
    total = np.cumsum(np.linalg.norm(motion.states(time).v_n, axis=1)) * 0.5
    rows = [f"{t},{x}" for t, x in zip(time, total)]
    (tmp_path / "odo.csv").write_text("\n".join(["time,distance_total", *rows]) + "\n")
    results = []
    for _ in range(2):
        gnss, odometer = read_gnss(tmp_path / "gnss.csv"), read_odometer(tmp_path / "odo.csv")
        results.append(navigate(record, start, aid=[Gnss(gnss), Odometer(odometer)], imu=SPEC))
        for name in ("gnss.csv", "odo.csv"):
            header, *lines = (tmp_path / name).read_text().splitlines()
            lines[10:100:3], lines[11:101:3] = lines[11:101:3], lines[10:100:3]
            (tmp_path / name).write_text("\n".join([header, *lines]) + "\n")
    right, found = results
    np.testing.assert_array_equal(found.position, right.position)
    np.testing.assert_array_equal(found.C_nb, right.C_nb)
    np.testing.assert_array_equal(found.track.P, right.track.P)
    assert found.summary()["late_rows"] == {name: {"rows": 30, "longest_s": 0.5} for name in ("gnss", "odometer")}
    assert right.summary()["late_rows"] == {}
    assert [r for r in found.reasons if r not in right.reasons] == [
        f"{name}: 30 rows stood after rows of later times, by up to 0.5 s: put in order"
        for name in ("gnss.csv", "odo.csv")
    ]


def test_a_reference_in_wrong_axes_is_refused(drive):
    """North, east, down handed in as east, north, up, with no position to tell by."""
    motion, record, start = drive
    time = np.arange(0.5, 179.0, 0.5)
    v = motion.states(time).v_n
    swapped = VelocityRecord(time, v[:, [1, 0, 2]] * [1, 1, -1], "navigation", source="ref.csv")
    with pytest.raises(DataError, match=r"ref\.csv: velocities change otherwise.* taken for north, east, down"):
        navigate(record, start, aid=VelocityLog(swapped), imu=SPEC, altitude="fixed")
    right = VelocityRecord(time, v, "navigation", source="ref.csv")
    assert navigate(record, start, aid=VelocityLog(right), imu=SPEC, altitude="fixed").status == "navigated"


def test_results_on_disk(drive, tmp_path):
    import pandas as pd

    motion, record, start = drive
    gnss = fixes(motion, np.arange(1.0, 179.0))
    result = navigate(record, start, aid=Gnss(gnss), imu=SPEC)
    paths = result.save(tmp_path)
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted(p.name for p in paths)
    track = pd.read_parquet(tmp_path / "track.parquet")
    assert track.index.name == "time"
    np.testing.assert_allclose(track["lat"], np.degrees(result.position[:, 0]))
    assert len(pd.read_parquet(tmp_path / "innovations.parquet")) == 178
    line = json.loads((tmp_path / "track.geojson").read_text())["features"][0]["geometry"]
    np.testing.assert_allclose(line["coordinates"][-1][:2], np.degrees(result.position[-1, 1::-1]), atol=1e-8)
    page = (tmp_path / "report.html").read_text()
    assert "GNSS position" in page
    assert "http://" not in page.split("<main>")[1].split("<script")[0]
    for suffix in ("kml", "csv"):
        assert result.export(tmp_path / f"track.{suffix}").stat().st_size > 1000
    with pytest.raises(UsageError, match="suffix"):
        result.export(tmp_path / "track.gpx")
    assert result.plot().axes
    at = result.trajectory()
    assert len(at) == len(result.time)


def test_a_track_over_the_date_line_is_two_lines():
    from truenorth.navigation.export import _lines

    class Crossing:
        time = np.arange(5.0)
        position = np.stack(
            [np.full(5, 0.1), np.radians([179.99, 179.995, -180.0, -179.995, -179.99]), np.zeros(5)], axis=1
        )

    lines = _lines(Crossing())
    assert [len(line) for line in lines] == [2, 3]
    assert C_en(0.0, np.pi)[0, 2] == pytest.approx(-1.0)


@pytest.mark.slow
def test_a_log_of_which_nothing_is_said_may_be_in_a_current(drive):
    """A drift of .5 m/s east: in sigma where nobody says what log it is, and said; with none stated, it is in the velocity."""
    motion, record, start = drive
    time = np.arange(0.5, 179.0, 0.5)
    s = motion.states(time)
    shown = np.einsum("kji,kj->ki", s.C_nb, s.v_n + np.array([0.5, 0.0, 0.0]))
    log = VelocityRecord(time, shown, "body", source="log.csv")
    results = {
        errors: navigate(record, start, aid=VelocityLog(log, errors=errors), imu=SPEC) for errors in (None, "em")
    }
    for errors, result in results.items():
        off = (result.v_n[-1] - motion.states(result.time[-1]).v_n) / result.track.sigma[-1, DV]
        assert np.abs(off).max() < 4.0
        assert ("log.kind_unsaid" in {item.key for item in result.evidence}) == (errors is None)
    np.testing.assert_array_equal(results[None].track.P, results["em"].track.P)
    sure = navigate(record, start, aid=VelocityLog(log, errors=LogErrors()), imu=SPEC)
    assert sure.track.sigma[-1, DV.start] < 0.3 * results[None].track.sigma[-1, DV.start]
