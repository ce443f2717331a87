"""Simulated aiding sensors: without errors the truth itself; each error is what was asked for, and can be taken off again."""

from dataclasses import replace

import numpy as np
import pytest

from tests.runs import few_and_all
from tests.simulation.made import ARM, DRIVE, FERRY, LOADED, PLACE, SENSORS
from truenorth.core.attitude import dcm_from_euler, rotation_vector_from_dcm
from truenorth.core.earth import ecef_axes, ecef_from_geodetic
from truenorth.core.errors import UsageError
from truenorth.core.position import Position
from truenorth.simulation import (
    GnssSpec,
    HeightSpec,
    MasterSpec,
    OdometerSpec,
    VelocityLogSpec,
    simulate_sensor,
)
from truenorth.simulation.aiding import STREAMS, velocity_b
from truenorth.simulation.streams import STREAMS as IMU_STREAMS


@pytest.mark.parametrize("motion", [DRIVE, FERRY], ids=["drive", "ferry"])
def test_without_errors_it_is_the_truth(motion):
    odometer = simulate_sensor(motion, OdometerSpec(output="speed"), duration=60.0)
    true = velocity_b(motion.states(odometer.record.time), ARM)
    at = motion.states(simulate_sensor(motion, GnssSpec(), duration=60.0).record.time)
    np.testing.assert_array_equal(odometer.record.values, velocity_b(motion.states(odometer.sampled), 0)[:, 1])
    assert np.abs(true[:, 1] - odometer.record.values).max() > 0.01

    gnss = simulate_sensor(motion, GnssSpec(), duration=60.0).record
    height = simulate_sensor(motion, HeightSpec(), duration=60.0).record
    master = simulate_sensor(motion, MasterSpec(rate=1.0, with_sensors=True), duration=60.0).record
    level = simulate_sensor(motion, VelocityLogSpec(frame="navigation"), duration=60.0).record
    body = simulate_sensor(motion, VelocityLogSpec(), duration=60.0).record
    assert gnss.time.tolist() == height.time.tolist() == master.time.tolist() == level.time.tolist() == list(range(61))
    for found, wanted in (
        (gnss.lat, at.lat),
        (gnss.lon, at.lon),
        (gnss.alt, at.alt),
        (gnss.v_n, at.v_n),
        (height.alt, at.alt),
        (level.velocity, at.v_n),
        (master.C_nb, at.C_nb),
        (master.v_n, at.v_n),
        (master.lat, at.lat),
        (master.w_ib_b, at.w_ib_b),
        (master.f_b, at.f_b),
    ):
        np.testing.assert_array_equal(found, wanted)
    np.testing.assert_allclose(np.einsum("kij,kj->ki", at.C_nb, body.velocity), at.v_n, atol=1e-14)
    assert gnss.position_sigma is None
    assert level.sigma is None


def test_distance_is_exact():
    """A car that goes where it points has driven what its course says, and an odometer of any rate counts just that."""
    for rate in (0.2, 1.0, 10.0):
        record = simulate_sensor(DRIVE, OdometerSpec(rate=rate), duration=60.0).record
        np.testing.assert_allclose(np.cumsum(record.distance), DRIVE.distance(record.time), atol=1e-9)


@pytest.mark.parametrize("motion", [DRIVE, replace(DRIVE, lever_arm=(0.0, 1.0, 0.5))], ids=["centre", "arm"])
def test_points_of_the_body(motion):
    """A sensor at an arm sees what the motion of an IMU at that arm is."""
    there = replace(motion, lever_arm=tuple(np.add(motion.lever_arm, ARM)))
    gnss = simulate_sensor(motion, GnssSpec(lever_arm=ARM), duration=60.0).record
    at = there.states(gnss.time)
    place = ecef_from_geodetic(gnss.lat, gnss.lon, gnss.alt) - ecef_from_geodetic(at.lat, at.lon, at.alt)
    assert np.abs(place).max() < 1e-6
    np.testing.assert_allclose(gnss.v_n, at.v_n, atol=1e-6)

    h = 1e-3
    t = np.arange(1.37, 59.0)  # away from corners, where differences see the next piece
    ahead, behind = (there.states(t + s) for s in (h, -h))
    v_e = (
        ecef_from_geodetic(ahead.lat, ahead.lon, ahead.alt) - ecef_from_geodetic(behind.lat, behind.lon, behind.alt)
    ) / (2 * h)
    now = motion.states(t)
    v_b = np.einsum("kji,klj,kl->ki", now.C_nb, ecef_axes(now.lat, now.lon), v_e)
    # The course's table of places follows its velocity within 4e-5 m/s (3 um) where a turn sets in; a wrong arm is off by cm/s.
    np.testing.assert_allclose(velocity_b(now, ARM), v_b, atol=1e-4)
    log = simulate_sensor(motion, VelocityLogSpec(lever_arm=ARM), start=1.37, duration=57.0).record
    np.testing.assert_allclose(log.velocity, v_b, atol=1e-4)

    arm = simulate_sensor(
        motion, MasterSpec(rate=1.0, lever_arm=tuple(np.negative(ARM)), with_sensors=True), duration=60.0
    )
    np.testing.assert_allclose(arm.record.v_n, gnss.v_n, atol=1e-14)
    np.testing.assert_allclose(arm.record.f_b, at.f_b, atol=2e-6)


@pytest.mark.parametrize("sensor", SENSORS)
def test_latency_is_exact(sensor):
    kind = SENSORS[sensor]
    for latency in (0.03, -0.02, 2.0):
        late = simulate_sensor(DRIVE, kind(rate=4.0, latency=latency), duration=50.0)
        now = simulate_sensor(DRIVE, kind(rate=4.0), duration=50.0)
        rows = len(late.record)
        assert late.record.time[-1] <= 50.0
        np.testing.assert_array_equal(late.record.time, late.sampled + latency)
        for name, values in late.record.columns().items():
            np.testing.assert_array_equal(values, now.record.columns()[name][:rows])


def test_odometer_errors():
    spec = OdometerSpec(scale=0.02, mounting=(0.03, -0.01), lever_arm=ARM)
    record = simulate_sensor(DRIVE, replace(spec, output="speed"), duration=60.0).record
    forward = dcm_from_euler(0.03, -0.01, 0.0) @ [0, 1, 0]
    np.testing.assert_allclose(forward, [np.sin(0.03) * np.cos(0.01), np.cos(0.03) * np.cos(0.01), -np.sin(0.01)])
    speed = velocity_b(DRIVE.states(record.time), ARM) @ forward
    np.testing.assert_allclose(record.values, 1.02 * speed, atol=1e-13)

    drawn = simulate_sensor(DRIVE, OdometerSpec(scale_sigma=0.01, mounting_sigma=0.02, noise=0.1), duration=60.0)
    again = OdometerSpec(scale=drawn.errors["scale"], mounting=tuple(drawn.errors["mounting"]))
    clean = simulate_sensor(DRIVE, again, duration=60.0).record
    np.testing.assert_allclose(drawn.record.values - clean.values, 0.1 * drawn.errors["noise"], atol=1e-14)


def test_pulses_carry_their_residue_forwards_and_backwards():
    spec = OdometerSpec(output="pulses", pulse_size=0.07)
    run = simulate_sensor(FERRY, spec, duration=60.0)
    distance = np.cumsum(simulate_sensor(FERRY, OdometerSpec(), duration=60.0).record.values)
    counted = np.cumsum(run.record.values)
    assert counted.min() < -100
    assert counted[-1] > counted.min() + 100
    np.testing.assert_array_equal(counted, np.floor(distance / 0.07 + run.errors["phase"]))
    assert np.abs(np.cumsum(run.record.distance) - distance).max() < 0.07

    unsigned = simulate_sensor(FERRY, replace(spec, signed=False), duration=60.0).record
    assert not unsigned.signed
    assert np.cumsum(unsigned.distance)[-1] == pytest.approx(np.abs(np.diff(distance, prepend=0.0)).sum(), abs=0.07)


def test_slip_counts_in_its_window_alone():
    clean = simulate_sensor(DRIVE, OdometerSpec(), duration=60.0).record
    run = simulate_sensor(DRIVE, OdometerSpec(slips=((20.03, 21.57, 0.3), (40.0, 41.0, -1.0))), duration=60.0)
    extra = run.record.values - clean.values
    slipped = DRIVE.distance(np.array([20.03, 21.57, 40.0, 41.0]))
    outside = (clean.time <= 20.0) | ((clean.time > 21.6) & (clean.time < 40.05)) | (clean.time > 41.05)
    assert np.abs(extra[outside]).max() < 1e-12
    assert extra[clean.time < 30].sum() == pytest.approx(0.3 * (slipped[1] - slipped[0]), abs=1e-9)
    assert extra[clean.time > 30].sum() == pytest.approx(-(slipped[3] - slipped[2]), abs=1e-9)
    locked = (clean.time > 40.05) & (clean.time < 41.05)
    np.testing.assert_allclose(run.record.values[locked], 0.0, atol=1e-14)


def test_random_slips_and_lost_pulses():
    """Numbers of events over 200 runs; false alarms below 1 in 1e5 (4.5 sigma) each."""
    spec = OdometerSpec(rate=1.0, slip_rate=0.1, slip_duration=1.5, slip_size=0.3)
    counts = [len(simulate_sensor(DRIVE, spec, duration=60.0, run=run).errors["slips"]) for run in range(200)]
    assert abs(np.mean(counts) - 6.0) < 4.5 * np.sqrt(6.0 / 200)
    for start, stop, size in simulate_sensor(DRIVE, spec, duration=60.0).errors["slips"]:
        assert (stop - start, size) == pytest.approx((1.5, 0.3))

    spec = OdometerSpec(output="pulses", lost=0.05)
    lossy, whole = (simulate_sensor(DRIVE, s, duration=60.0) for s in (spec, replace(spec, lost=0.0)))
    np.testing.assert_array_equal(lossy.record.values + lossy.errors["lost"], whole.record.values)
    n = whole.record.values.sum()
    assert abs(lossy.errors["lost"].sum() - 0.05 * n) < 4.5 * np.sqrt(n * 0.05 * 0.95)


@pytest.mark.parametrize("frame", ["body", "navigation"])
def test_velocity_errors_are_as_their_model_says(frame):
    spec = VelocityLogSpec(
        frame=frame,
        rate=2.0,
        bias=(0.1, -0.3, 0.02),
        bias_sigma=0.05,
        drift=0.2,
        noise=0.05,
        scale=0.01,
        scale_sigma=0.01,
        misalignment=(0.01, 0.02, -0.03),
        misalignment_sigma=0.01,
        outlier_rate=0.1,
    )
    run = simulate_sensor(DRIVE, spec, duration=60.0, seed=5)
    at, e = DRIVE.states(run.sampled), run.errors
    true = velocity_b(at, 0) if frame == "body" else at.v_n
    C = dcm_from_rotation(e["misalignment"])
    model = (1 + e["scale"]) * true @ C + e["bias"] + e["drift"] + e["noise"] + e["outliers"]
    np.testing.assert_allclose(run.record.velocity, model, atol=1e-13)
    np.testing.assert_allclose(run.record.sigma, np.hypot(0.2, 0.05))
    forward = simulate_sensor(DRIVE, VelocityLogSpec(axes="forward", noise=0.1), duration=60.0).record
    assert forward.measured.tolist() == [False, True, False]
    np.testing.assert_array_equal(np.isfinite(forward.sigma), np.isfinite(forward.velocity))


def dcm_from_rotation(v):
    from scipy.spatial.transform import Rotation

    return Rotation.from_rotvec(v).as_matrix()


@few_and_all(400, few=100)
def test_gnss_errors_have_the_covariance_that_the_record_states(runs):
    """One row of each run, so that drift is independent: each of three by a chi-square of so many, within 4.5 sigma (1 in 1e4)."""
    spec = GnssSpec(position_noise=1.0, position_drift=2.0, velocity_noise=0.03, velocity_drift=0.04, vertical=2.0)
    nees = np.zeros((2, 3))
    for run in range(runs):
        record = simulate_sensor(DRIVE, spec, duration=2.0, start=30.0, seed=9, run=run).record
        at = DRIVE.states(record.time)
        place = ecef_from_geodetic(record.lat, record.lon, record.alt) - ecef_from_geodetic(at.lat, at.lon, at.alt)
        error = np.einsum("kji,kj->ki", ecef_axes(at.lat, at.lon), place)
        nees += [
            (error[-1] / record.position_sigma[-1]) ** 2,
            ((record.v_n - at.v_n)[-1] / record.velocity_sigma[-1]) ** 2,
        ]
    assert np.all(np.abs(nees / runs - 1.0) < 4.5 * np.sqrt(2 / runs))
    assert record.position_sigma[0].tolist() == pytest.approx([np.sqrt(5), np.sqrt(5), 2 * np.sqrt(5)])


@pytest.mark.parametrize("sensor", ["velocity", "gnss", "height", "master"])
def test_outages(sensor):
    kind = SENSORS[sensor]
    record = simulate_sensor(DRIVE, kind(rate=2.0, outages=((10.0, 20.0), (59.0, 99.0))), duration=60.0).record
    assert not np.any((record.time >= 10.0) & (record.time < 20.0))
    assert (record.time[-1], len(record)) == (58.5, 98)
    gaps = kind(rate=1.0, outage_rate=0.02, outage_duration=5.0)
    holes = [len(simulate_sensor(DRIVE, gaps, duration=60.0, run=k).record) for k in range(100)]
    mean = np.mean(holes)  # of 61 rows each of about 1.2 outages takes 5; the overlaps and those at the end take fewer
    assert 61 - 6.0 - 0.1 < mean < 61 - 3.5
    with pytest.raises(UsageError, match="outages leave less than two rows"):
        simulate_sensor(DRIVE, kind(outages=((0.0, 99.0),)), duration=60.0)


def test_outliers():
    """Their number is binomial: within 4.5 sigma (1 in 1e5), and each is of its size."""
    run = simulate_sensor(DRIVE, GnssSpec(rate=20.0, outlier_rate=0.1), duration=60.0)
    hit = np.any(run.errors["outliers"] != 0, axis=1)
    n = len(hit)
    assert abs(hit.sum() - 0.1 * n) < 4.5 * np.sqrt(n * 0.09)
    east = run.errors["outliers"][hit, 0]
    assert abs((east**2).mean() / 900 - 1) < 4.5 * np.sqrt(2 / hit.sum())


def test_a_barometer_lags_as_a_first_order_filter_does():
    """Heave ``A sin(w t + p)`` from rest at t = 0: the closed solution of ``lag y' + y = x``."""
    A, w, p, lag = 0.8, 2 * np.pi / 8.0, 2.0, 1.7
    for rate in (0.3, 5.0):
        run = simulate_sensor(FERRY, HeightSpec(rate=rate, lag=lag), duration=60.0)
        t = run.record.time
        gain, shift = 1 / np.hypot(1, w * lag), np.arctan(w * lag)
        settled = lambda t: gain * np.sin(w * t + p - shift)  # noqa: B023, E731
        y = A * (settled(t) + (np.sin(p) - settled(0.0)) * np.exp(-t / lag))
        np.testing.assert_allclose(run.record.alt - PLACE.alt, y, atol=1e-10)


def test_height_errors():
    spec = HeightSpec(bias=3.0, bias_sigma=1.0, drift=2.0, noise=0.5, outlier_rate=0.05)
    run = simulate_sensor(DRIVE, spec, duration=60.0, seed=4)
    e = run.errors
    model = DRIVE.states(run.sampled).alt + e["bias"] + e["drift"] + e["noise"] + e["outliers"]
    np.testing.assert_allclose(run.record.alt, model, atol=1e-12)
    assert e["bias"] != 3.0
    assert run.record.sigma[0] == pytest.approx(np.hypot(2.0, 0.5))


NO_ERROR = ("output", "outlier_size", "slip_size")
TERMS = [(sensor, item) for sensor, spec in LOADED.items() for item in spec.to_mapping() if item not in NO_ERROR]


@pytest.mark.parametrize("sensor", SENSORS)
def test_the_same_seed_gives_the_same_bytes(sensor):

    def bits(**key):
        return b"".join(
            column.tobytes()
            for column in simulate_sensor(DRIVE, LOADED[sensor], duration=60.0, **key).record.columns().values()
        )

    assert bits() == bits()
    assert len({bits(seed=s, run=r, scenario=c) for s, r, c in ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1))}) == 4


@pytest.mark.parametrize(("sensor", "term"), TERMS)
def test_switching_one_term_off_leaves_the_others(sensor, term):
    kind = SENSORS[sensor]
    full = simulate_sensor(DRIVE, LOADED[sensor], duration=60.0)
    off = simulate_sensor(DRIVE, replace(LOADED[sensor], **{term: getattr(kind(), term)}), duration=60.0)
    assert full.record.columns().keys() == off.record.columns().keys()
    common, rows, others = np.intersect1d(full.sampled, off.sampled, return_indices=True)
    assert len(common) == min(len(full.sampled), len(off.sampled))
    changed = 0
    for name, error in full.errors.items():
        if isinstance(error, np.ndarray) and len(error) == len(full.sampled):
            same = np.array_equal(error[rows], off.errors[name][others])
        else:
            same = np.array_equal(error, off.errors[name])
        changed += not same
    touched = {"jumps": 2, "jump_rate": 2, "schuler": 3}.get(term, 1)  # jumps also stand in a list of their own
    assert changed <= (2 if sensor == "odometer" else touched)  # of other pulses others are lost
    assert changed or term == "outage_rate"


def test_streams_are_those_of_nobody_else():
    numbers = list(STREAMS.values())
    assert len(set(numbers)) == len(numbers)
    assert min(numbers) >= 100 > max(IMU_STREAMS.values())
    assert max(numbers) < 200  # where those of motions begin


def test_too_short_a_log():
    with pytest.raises(UsageError, match="two rows at least"):
        simulate_sensor(DRIVE, GnssSpec(latency=59.5), duration=60.0)
    with pytest.raises(UsageError, match=r"GnssSpec: rate is nan"):
        GnssSpec(rate=np.nan)


def test_truth_as_a_record_and_as_a_file(tmp_path):
    """What a run's folder holds reads back; between its samples it is the motion, to the order of interpolation."""
    from truenorth import read_trajectory, write_record

    truth = DRIVE.states(np.arange(0.0, 60.0, 0.1)).trajectory()
    write_record(truth, tmp_path / "truth.parquet")
    read = read_trajectory(tmp_path / "truth.parquet")
    np.testing.assert_allclose(read.lat, truth.lat, rtol=4e-16)
    times = np.arange(0.05, 59.0, 1.0)
    at, true = read.at(times), DRIVE.states(times)
    place = ecef_from_geodetic(at.lat, at.lon, at.alt) - ecef_from_geodetic(true.lat, true.lon, true.alt)
    assert np.abs(place).max() < 1e-5
    assert np.abs(rotation_vector_from_dcm(at.C_nb @ np.swapaxes(true.C_nb, 1, 2))).max() < 5e-4


@pytest.mark.parametrize("output", ["distance", "pulses", "speed"])
def test_an_odometer_outage_leaves_the_other_rows_as_they_were(output):
    from truenorth.simulation import rest

    motion = rest(Position.from_degrees(40.0, 10.0))
    whole = simulate_sensor(motion, OdometerSpec(output=output, noise=0.3), duration=10.0)
    lacking = simulate_sensor(motion, OdometerSpec(output=output, noise=0.3, outages=((2.0, 5.0),)), duration=10.0)
    there = (whole.sampled < 2.0) | (whole.sampled >= 5.0)
    assert 0 < np.count_nonzero(~there) < len(there)
    np.testing.assert_array_equal(lacking.record.time, whole.record.time[there])
    np.testing.assert_array_equal(lacking.record.values, whole.record.values[there])
    np.testing.assert_array_equal(lacking.errors["noise"], whole.errors["noise"][there])
