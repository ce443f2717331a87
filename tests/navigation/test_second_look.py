"""What the data say of clocks, arms, scales and mountings that were taken for known: named with figures and the option."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from tests.helpers import start_before
from tests.navigation.test_navigate import SPEC, drive, fixes
from truenorth.aiding.aids import Gnss, Odometer, VelocityLog
from truenorth.core.attitude import dcm_from_rotation_vector
from truenorth.core.errors import DataError
from truenorth.navigation import Mounting, navigate
from truenorth.navigation.second_look import looser, second_look
from truenorth.records import OdometerRecord, VelocityRecord
from truenorth.state.wording import sentences

__all__ = ["drive"]  # the fixture of a car that turns twice


def warnings(result):
    return [reason.removeprefix("warning: ") for reason in result.reasons if reason.startswith("warning")]


def wheel_log(motion, arm=(0.0, 0.0, 0.0), noise=0.02):
    """Speed ten times a second of a wheel at an arm, along the vehicle."""
    time = np.arange(0.55, 179.0, 0.1)
    s = motion.states(time)
    v_b = np.einsum("kji,kj->ki", s.C_nb, s.v_n)
    earth = np.einsum("kji,kj->ki", s.C_nb, 7.292115e-5 * np.stack([0 * s.lat, np.cos(s.lat), np.sin(s.lat)], axis=1))
    v = v_b + np.cross(s.w_ib_b - earth, arm)
    return OdometerRecord(
        time, v[:, 1] + noise * np.random.default_rng(4).standard_normal(len(time)), "speed", source="odo.csv"
    )


@pytest.mark.slow
def test_an_antenna_of_a_metre_given_in_centimetres(drive):
    """.2, .3 and .5 m given as 20, 30, 50: the fixes are rejected, and the second look says why and what the arm is."""
    motion, record, start = drive
    gnss = fixes(motion, np.arange(1.0, 179.0), sigma=0.3, arm=(0.2, 0.3, 0.5))
    result = navigate(record, start, aid=Gnss(gnss, Mounting(lever_arm=np.array([20.0, 30.0, 50.0]))), imu=SPEC)
    assert result.status == "inconsistent"
    (words,) = warnings(result)
    assert words.startswith("the lever arm of the GNSS seems to be right +0.")
    assert "not 20,30,50: was it given in centimetres?; check the arm; metres are expected" in words
    right = navigate(record, start, aid=Gnss(gnss, Mounting(lever_arm=np.array([0.2, 0.3, 0.5]))), imu=SPEC)
    assert warnings(right) == []


@pytest.mark.slow
def test_a_wheel_given_in_centimetres_and_a_clock_are_separated(drive):
    """The car does not slide at its centre: a wheel half a metre to its left, given as 50 m."""
    motion, record, start = drive
    odometer = wheel_log(motion, (-0.5, 0.0, 0.0))

    def said(log, arm):
        return warnings(
            navigate(record, start, aid=Odometer(log, Mounting(lever_arm=np.array(arm))), imu=SPEC, altitude="fixed")
        )

    assert said(odometer, (-0.5, 0.0, 0.0)) == []
    (words,) = said(odometer, (-50.0, 0.0, 0.0))
    assert "lever arm of the odometer" in words
    assert "was it given in centimetres?" in words
    (words,) = said(odometer.shifted(0.25), (-0.5, 0.0, 0.0))
    assert words.startswith("the clock of the odometer seems 0.25")
    assert "late: shift the times of that log by -0.25" in words


@pytest.mark.slow
def test_scale_and_mounting_that_are_not_estimated(drive):
    motion, record, start = drive
    log = wheel_log(motion)
    fast = OdometerRecord(log.time, 1.03 * log.values, "speed", source="odo.csv")
    (words,) = warnings(navigate(record, start, aid=Odometer(fast, Mounting()), imu=SPEC, altitude="fixed"))
    assert words.startswith("the odometer seems to count +")
    assert words.endswith("%: let it be estimated")
    value, sigma = (float(x) for x in words.split("count +")[1].split(" %")[0].split(" ± "))
    assert abs(value - 3.0) < 4 * sigma < 1.0
    assert (
        warnings(navigate(record, start, aid=Odometer(fast, Mounting(scale_sigma=0.05)), imu=SPEC, altitude="fixed"))
        == []
    )
    turned = Mounting(C_mb=dcm_from_rotation_vector(np.array([0.0, 0.0, 0.04])))
    (words,) = warnings(navigate(record, start, aid=Odometer(log, turned), imu=SPEC, altitude="fixed"))
    assert "turned against the vehicle of the odometer" in words
    assert "give the mounting; let it be estimated" in words


@pytest.mark.parametrize(
    ("arm", "sigma", "words"),
    [
        (
            (0.0, 12.0, 0.0),
            (0.1, 2.9, 0.1),
            ["is 12 m long, and the data do not show whether it is", "metres are expected"],
        ),
        ((0.0, 12.0, 0.0), (2.9, 0.2, 2.9), []),  # shown: a ship has such arms
        ((0.0, 9.0, 0.0), (2.9, 2.9, 2.9), []),
    ],
)
def test_a_long_arm_that_the_data_do_not_show(arm, sigma, words):
    found = SimpleNamespace(
        layout=SimpleNamespace(slice_of=lambda name: slice(0, 3) if name == "GNSS lever arm" else None),
        residuals=(),
        sensors=np.zeros((1, 3)),
        sigma=np.array([sigma]),
    )
    mounting = {
        "gnss": Mounting(lever_arm=np.array(arm)),
        "odometer": Mounting(),
        "velocity": Mounting(),
        "baro": Mounting(),
    }
    said = sentences(second_look(found, found, mounting))
    assert len(said) == bool(words)
    assert all(word in said[0] for word in words)
    known = mounting | {"gnss": replace(mounting["gnss"], lever_arm_sigma=1.0)}
    assert second_look(found, found, known) == []


@pytest.mark.slow
def test_figures_of_a_model_that_does_not_hold_are_not_said(drive):
    """Vertical velocity counted downwards on a road too flat to tell by: no clock or arm is blamed for it."""
    motion, record, start = drive
    time = np.arange(0.5, 179.0, 0.5)
    v = motion.states(time).v_n + np.array([0.0, 0.0, 0.6])
    log = VelocityRecord(time, v, "navigation", source="ref.csv")
    result = navigate(record, start, aid=[Gnss(fixes(motion, time, 0.05)), VelocityLog(log)], imu=SPEC)
    assert result.status == "inconsistent"
    assert warnings(result) == []


@pytest.mark.slow
def test_fixes_that_wander_are_said_and_white_ones_are_not(drive):
    """A drift of 1.5 m over 60 s is estimated, said or not; of white fixes it is said by chance once in two million."""
    motion, record, start = drive
    time = np.arange(1.0, 179.0)
    white = fixes(motion, time, 1.0)
    rng, drift = np.random.default_rng(8), np.zeros((len(time), 3))
    for k in range(1, len(time)):
        drift[k] = np.exp(-1 / 60) * drift[k - 1] + 1.5 * np.sqrt(1 - np.exp(-2 / 60)) * rng.standard_normal(3)
    wandering = replace(
        white,
        lat=white.lat + drift[:, 1] / 6.37e6,
        lon=white.lon + drift[:, 0] / 4.27e6,
        alt=white.alt + drift[:, 2],
    )
    antenna, none = Mounting(bias_sigma=1.5, bias_time=60.0), Mounting(bias_sigma=0.0)
    for gnss, mounting, said in ((white, none, False), (wandering, none, True), (wandering, antenna, False)):
        result = navigate(record, start, aid=Gnss(gnss, mounting), imu=SPEC)
        assert any(item.key == "innovations.wander" for item in result.evidence) is said
        sigma = result.position_sigma[-1]
        assert (sigma > 0.7).all() if gnss is wandering else (sigma < 0.4).all()
        assert ("GNSS bias" in result.track.layout.groups) is (gnss is wandering)


@pytest.mark.slow
def test_a_latency_on_a_shaking_vehicle():
    """The acceleration of single samples is vibration, by which a latency seemed half as long: within 5 % of .2 s."""
    from truenorth.records.specs import imu_spec
    from truenorth.simulation.scenario import read_scenario

    van = read_scenario({**read_scenario("van").to_mapping(), "duration": "240 s"})
    simulation, spec = van.simulate(seed=3), imu_spec("industrial")
    record, truth = simulation.record, simulation.truth
    sigma = np.repeat([1e-3, 0.01, 0.3, 0.05 * spec.gyro_bias, 0.1 * spec.accel_bias], 3)
    errors = simulation.errors
    place, biases = (truth.lat[0], truth.lon[0], truth.alt[0]), (errors.gyro_bias, errors.accel_bias)
    start = start_before(record, truth.C_nb[0], truth.v_n[0], place, biases, sigma)
    late = van.simulate_aiding(seed=3)["odometer"].record.shifted(0.2)
    wheel = Mounting(
        lever_arm=np.array([-0.3, -0.8, -0.5]), scale_sigma=0.05, angle_sigma=0.05, latency_sigma=0.3, gate=0.0
    )
    result = navigate(record, start, aid=Odometer(late, wheel), imu=spec, check_clocks=False)
    assert result.estimated()["odometer lag"]["value"][0] == pytest.approx(0.2, abs=0.02)


def test_what_is_open_is_open_and_a_filter_that_breaks_down_says_nothing():
    asked = {}

    def run(loose):
        asked.update(loose)
        raise DataError("broken down")

    mounting = {name: Mounting(scale_sigma=0.2) for name in ("gnss", "odometer", "velocity", "baro")}
    assert looser(run, mounting) is None
    assert second_look(None, SimpleNamespace(), mounting) == []
    assert asked["baro"] == mounting["baro"]
    assert asked["odometer"].scale_sigma == 0.2
    assert asked["odometer"].gate == 0.0
    assert asked["odometer"].angle_sigma > 0.0
    assert asked["gnss"].lever_arm_sigma > 0.0
