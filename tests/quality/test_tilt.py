"""Tilt by gyros against tilt by accelerometers: a long arm is no scale factor, and one piece alone shows none."""

import numpy as np
import pytest

from benchmarks.once_silent import _late
from tests.runs import some
from truenorth.alignment import align
from truenorth.campaign.fault_benches import BENCHES, misses
from truenorth.core.position import Position
from truenorth.quality.regimes import motion_summary
from truenorth.quality.tilt import IDENTITY, Tilt, check_tilt
from truenorth.quality.tilt_bench import changes
from truenorth.records import ImuRecord
from truenorth.simulation.scenario import read_scenario


def test_changes_over_cells_are_exact_for_a_cubic():
    """The change of a cubic over each cell, by its means in the cells; at both ends of a piece, too."""
    edges = np.linspace(0.0, 1.1, 12)
    a = np.array([0.3, -1.0, 2.0, 1.5])
    whole = np.polynomial.Polynomial(a).integ()
    means = np.diff(whole(edges)) / np.diff(edges)
    exact = np.diff(np.polynomial.Polynomial(a)(edges))
    assert np.allclose(changes(means[None, :, None])[0, :, 0], exact, atol=1e-12)


def _swaying(tones, duration, *, lat, lon, heading, arm, **more):
    """A ship that sways in these tones, an IMU of navigation grade aboard; s, deg, m."""
    scenario = {
        "name": "ship",
        "duration": f"{duration} s",
        "position": {"lat": f"{lat} deg", "lon": f"{lon} deg"},
        "motion": {"kind": "sway", "heading": f"{heading} deg", "tones": tones},
        "lever_arm": [f"{x} m" for x in arm],
        "imu": "navigation",
    }
    return read_scenario(scenario | more)


def ship(seed, scale=0.0):
    """A ship that sways by 8, 4 and 6 deg, its IMU 14 m from its centre."""
    tones = {
        name: [{"amplitude": f"{a} deg", "period": f"{T} s"}]
        for name, a, T in (("roll", 8.0, 11.2), ("pitch", 4.0, 6.9), ("heading", 6.0, 5.1))
    }
    scenario = _swaying(tones, 200, lat=-20, lon=10, heading=130, arm=(9, -8, 7.2))
    record = scenario.simulate(seed=seed).record
    gyro = record.gyro * [1.0 + scale, 1.0, 1.0]
    return type(record)(record.time, gyro, record.accel, record.kind, record.source)


@pytest.mark.parametrize("seed", some(range(2), range(2, 4)))
def test_a_long_arm_is_no_scale_factor(seed):
    """Its acceleration, 2 m/s^2, is taken off to a thousandth: gyros of navigation grade are not off by a per cent."""
    tilt = check_tilt(ship(seed))
    assert np.all(np.abs(tilt.scale) < 2e-3), tilt
    assert tilt.evidence() == []
    off = check_tilt(ship(seed, 0.02))
    assert off.scale[0] == pytest.approx(0.02, rel=0.15)  # the arm takes a part of it, or gives
    assert [item.key for item in off.evidence()] == ["tilt.scale"]


def test_a_base_that_moves_along_with_its_sway_is_no_scale_factor():
    """A sound log drawn so: the line through its scales stands ten sigmas from zero, and gyros without such errors turn worse."""
    record = BENCHES["swaying"].draw(8202, 51)[0]["record"]
    assert check_tilt(record).evidence() == []


def test_a_turn_that_leaks_in_by_a_misalignment_is_no_scale_factor():
    """30 % of a turn of .1 deg, by one of 60 deg about another axis, is a misalignment; 30 % of turns of one size is a scale."""
    found = {"scale": np.array([0.0, 0.297, 0.0]), "scale_sigma": np.full(3, 0.009), "pieces": 8}
    leaks, scaled = (
        Tilt(0.1, 1.0, 0.1, IDENTITY, 0.0, 0.01, 0.0, turned=np.radians(turned), **found)
        for turned in ([0.2, 0.1, 60.0], [5.0, 5.0, 5.0])
    )
    assert leaks.evidence() == []
    assert [item.key for item in scaled.evidence()] == ["tilt.scale"]


def _moored(seed):
    """A ship that hardly rolls, carried by the waves that roll and pitch her: each wave makes all, in phases about their own."""
    rng = np.random.default_rng(seed)
    kinds = ("roll", "pitch", "east", "north")
    tones, late = {kind: [] for kind in kinds}, dict(zip(kinds, rng.uniform(0.0, 360.0, 4), strict=True))
    for period, phase in zip(rng.uniform(5.0, 11.0, 12), rng.uniform(0.0, 360.0, 12), strict=True):
        size = 0.3 * abs(rng.normal())
        for kind in kinds:
            unit, part = ("deg", 0.6) if kind in ("roll", "pitch") else ("m", 0.15)
            at = (phase + late[kind] + rng.normal(0.0, 50.0)) % 360.0
            tones[kind].append(
                {"amplitude": f"{part * size:.4f} {unit}", "period": f"{period:.3f} s", "phase": f"{at:.1f} deg"}
            )
    return _swaying(tones, 240, lat=50, lon=1, heading=70, arm=(1, 6, 3), rate="50 Hz")


@pytest.mark.parametrize("seed", [1, 3, 6])
def test_waves_that_carry_a_ship_as_they_roll_her_are_no_delay_and_no_scale_factor(seed):
    """Eight of eight sound logs of such ships were refused: gyros early by .57 s, or too far by 54 %."""
    found = check_tilt(_moored(seed).simulate(seed=seed).record)
    assert found is None or found.evidence() == [], found


@pytest.mark.slow
@pytest.mark.parametrize("seed", [8, 23])
def test_a_ship_that_the_waves_shake_sway_and_accelerate_by_turns_stays_where_she_is(seed):
    """She was refused as one that moves: neither sway nor acceleration lasted from the first second to the last."""
    scenario = _moored(seed)
    record, body = scenario.simulate(seed=seed).record, scenario.build_motion(seed, 0)
    summary = motion_summary(record)
    assert summary.overall == "moving"
    assert summary.fraction("disturbed") > 0.2
    answer = align(record, Position.from_degrees(50.0, 1.0), "navigation")
    assert (answer.status, answer.method) == ("aligned", "swaying"), answer.reasons
    off = misses(answer, lambda time: body.states(np.array(time)))
    assert max(float(np.abs(x).max()) for x in off.values()) < 4.0


def test_gyros_that_are_late_are_late_about_each_axis():
    """A common delay is sure, one about each axis is a motion; where little else is left, it is in sigma."""
    each = {"by_axis_sigma": np.array([0.01, 0.01, 9.0]), "pieces": 8}

    def of(by_axis, given):
        by_axis = np.array([*by_axis, 0.0])
        return Tilt(
            given, 1.0, given, IDENTITY, float(by_axis.mean() * 1.5), 0.005, 0.01, by_axis=by_axis, **each
        ).evidence()

    for given in (0.1, 0.5):
        assert [item.kind for item in of((0.20, 0.21), given)] == ["bounded"]
    assert [item.kind for item in of((0.9, 0.3), 0.1)] == ["hint"]
    assert of((0.9, 0.3), 0.5) == []


def test_a_base_that_goes_to_and_fro_in_the_time_of_its_sway_is_no_delay():
    """A sound log, once refused: north in 6.0 s, by centimetres, as the roll; both axes show some .035 s, at 5 and 7 sigmas."""
    inputs, truth = BENCHES["swaying"].draw(5502, 39)
    found = check_tilt(inputs["record"])
    assert abs(found.delay) > 0.02
    assert all(item.kind == "hint" for item in found.evidence())
    answer = align(inputs["record"], inputs["place"], inputs["imu"])
    assert answer.status == "aligned"
    assert max(float(np.abs(x).max()) for x in misses(answer, truth).values()) < 3.0


@pytest.mark.slow
def test_late_gyros_of_an_imu_that_spins_turn_heading():
    """Gravity does not show a turn about itself: of a spin of 15 deg/s, .05 s late, heading was 10 sigmas off."""
    inputs, truth = BENCHES["rotary"].draw(8210, 2)
    answer = BENCHES["rotary"].align(_late(0.05)(inputs))
    assert any(item.key == "tilt.gyros_late" and item.effect.heading > 0.005 for item in answer.evidence)
    assert answer.status == "inconsistent" or float(np.abs(misses(answer, truth)["heading"]).max()) < 3.0


def hanging(seed, scale=1.0):
    """An IMU at the end of a rope of 12 m that swings by 3 deg in gusts, its gyros of .05 deg/sqrt(h)."""
    rng = np.random.default_rng(seed)
    step, rope, count = 0.02, 12.0, 10000
    w = np.sqrt(9.81 / rope)
    drive = rng.standard_normal((2, count)) * np.sqrt(4.0 * 0.02 * w / step)
    swing = np.zeros((2, count))  # by its equation of motion, x'' = -w^2 x - 2 z w x' + n
    rate = np.zeros((2, count))
    for k in range(1, count):
        rate[:, k] = rate[:, k - 1] + step * (drive[:, k] - w**2 * swing[:, k - 1] - 2.0 * 0.02 * w * rate[:, k - 1])
        swing[:, k] = swing[:, k - 1] + step * rate[:, k]
    swing *= np.radians(3.0) / swing.std()
    gyro = np.zeros((count, 3))
    gyro[1:, :2] = np.diff(swing, axis=1).T / step
    noise = 1.5e-5 / np.sqrt(step) * rng.standard_normal((count, 3))
    angular = np.gradient(gyro, step, axis=0)
    level = np.sin(swing)
    force = np.zeros((count, 3))
    # Gravity in the body, and what the rope's length makes of the angular acceleration; they cancel but for its damping.
    force[:, 0] = -9.81 * level[1] - rope * angular[:, 1]
    force[:, 1] = 9.81 * level[0] + rope * angular[:, 0]
    force[:, 2] = 9.81 * np.cos(swing[0]) * np.cos(swing[1]) + rope * (gyro[:, 0] ** 2 + gyro[:, 1] ** 2)
    force += 5e-4 / np.sqrt(step) * rng.standard_normal((count, 3))
    return ImuRecord(step * np.arange(1, count + 1), scale * gyro + noise, force, "rates")


@pytest.mark.parametrize("seed", some([0], range(1, 4)))
def test_noise_of_gyros_that_an_arm_multiplies_is_no_scale_factor(seed):
    """Errors in what an arm is fitted to made it too short: gyros of gondolas were 3 % wrong, at nine sigmas, and are not."""
    assert check_tilt(hanging(seed)).scale[:2] == pytest.approx([0.0, 0.0], abs=0.01)
    assert check_tilt(hanging(seed, 1.05)).scale[:2] == pytest.approx([0.05, 0.05], abs=0.015)
