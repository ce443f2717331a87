"""One entry: `align` and `navigate` choose what to do by the types of the aids; arms and latencies have one meaning."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import pytest

import truenorth as tn
from tests.helpers import raises_naming
from truenorth.aiding.source import Aiding
from truenorth.alignment import Request
from truenorth.alignment.transfer import align_transfer
from truenorth.core.attitude import dcm_from_euler
from truenorth.simulation import MasterSpec, ideal_log, rest, simulate, simulate_sensor
from truenorth.simulation.course import course
from truenorth.simulation.manoeuvres import s_turn, straight

PLACE = tn.Position.from_degrees(40.0, 118.0)


@pytest.fixture(scope="module")
def still():
    return simulate(rest(PLACE, 1.0), rate=20.0, duration=120.0, imu="navigation", seed=1).record


def test_place_in_degrees_and_a_table(still):
    one = tn.align(still, PLACE, "navigation")
    two = tn.align(still.to_frame(), (40.0, 118.0), "navigation")
    np.testing.assert_array_equal(one.C_nb, two.C_nb)
    with pytest.raises(tn.UsageError, match="degrees or radians"):
        tn.align(still, (0.7, 2.0), "navigation")
    with pytest.raises(tn.UsageError, match="lat, lon, alt"):
        tn.align(still, (40.0,), "navigation")
    with pytest.raises(tn.UsageError, match="place is missing"):
        tn.align(still)
    aid = tn.Odometer(tn.OdometerRecord(still.time, np.zeros(len(still)), "speed"))
    for given in ({}, {"place": PLACE}, {"aid": aid}):
        with pytest.raises(tn.UsageError, match=r"'position' is no option .*; write place=\(lat_deg, lon_deg, alt_m\)"):
            tn.align(still, imu="navigation", position=(40.0, 118.0), **given)
    with pytest.raises(tn.UsageError, match=r"'gnss' is no option .*; write aid=Gnss\(record\)"):
        tn.align(still, PLACE, gnss=None)
    with pytest.raises(tn.UsageError, match="'passes' is no option of an alignment of a base that stays"):
        tn.align(still, PLACE, "navigation", passes=3)
    assert tn.inspect(still.to_frame()).samples == len(still)
    with pytest.raises(tn.UsageError, match="gyro_x"):
        tn.align(still.to_frame().rename(columns=lambda name: f"my_{name}"), PLACE)


def test_aids_that_no_recipe_takes(still):
    with pytest.raises(tn.UsageError, match="no recipe takes Barometer"):
        tn.align(still, PLACE, aid=tn.Barometer(None))
    with pytest.raises(tn.UsageError, match="two of one type"):
        tn.align(still, PLACE, aid=[tn.Positions(), tn.Positions()])
    with pytest.raises(tn.UsageError, match="log's end"):
        tn.align(still, PLACE, aid=tn.Positions(), at=10.0)
    with pytest.raises(tn.UsageError, match="method 'motion' is not known"):
        tn.align(still, PLACE, method="motion")
    with pytest.raises(tn.UsageError, match="not for navigation"):
        tn.navigate(still, tn.align(still, PLACE, "navigation"), aid=tn.Positions())


def test_a_method_of_ones_own(still):
    def mine(request: Request):
        return replace(tn.align(request.record, request.place, request.imu), method="")

    assert tn.align(still, PLACE, "navigation", method=mine).method == "mine"
    with pytest.raises(tn.AlignmentError, match="expected an Alignment"):
        tn.align(still, PLACE, method=lambda request: 1)


def test_a_recipe_of_ones_own(still, monkeypatch):
    from truenorth.alignment import recipes

    @dataclass(frozen=True)
    class Star:
        heading: float

    def by_star(request):
        answer = tn.align(request.record, request.place, request.imu)
        return replace(answer, C_nb=dcm_from_euler(request.aids[Star].heading, answer.pitch, answer.roll))

    monkeypatch.setattr(recipes, "RECIPES", list(recipes.RECIPES))
    tn.register_recipe(tn.Recipe("a star tracker", by_star, (Star,)))
    assert tn.align(still, PLACE, "navigation", aid=Star(0.25)).heading == pytest.approx(0.25)


@pytest.fixture(scope="module")
def slave():
    """A slave with its master .6 m to the right, 1.1 m ahead and .2 m below it, whose stamps are .04 s late."""
    motion = course(PLACE, [*straight(10.0), *s_turn(np.radians(30.0), np.radians(6.0)), *straight(10.0)], speed=40.0)
    ideal = ideal_log(motion, rate=50.0, duration=35.0)
    record = simulate(ideal, imu="tactical", seed=2).record
    spec = MasterSpec(rate=10.0, latency=0.04, lever_arm=(-0.6, -1.1, 0.2))
    return record, simulate_sensor(motion, spec, duration=35.0, seed=2).record


def test_a_master_is_the_transfer_recipe_with_the_arm_from_the_imu_to_the_master(slave):
    """`lever_arm` of the recipe goes from the master to the slave; that of a mounting from the IMU to the sensor."""
    record, master = slave
    arm = np.array([0.6, 1.1, -0.2])
    mounted = tn.Mounting(lever_arm=arm, lever_arm_sigma=0.1, angle_sigma=0.01, latency=0.04, latency_sigma=0.01)
    one = tn.align(record, imu="tactical", aid=tn.Master(master, mounted))
    two = align_transfer(
        record,
        master,
        "tactical",
        lever_arm=tuple(-arm),
        lever_arm_sigma=0.1,
        mounting_sigma=0.01,
        delay=0.04,
        delay_sigma=0.01,
    )
    np.testing.assert_array_equal(one.C_nb, two.C_nb)
    assert one.status == "aligned"


@dataclass(frozen=True)
class Fixes:
    """An aid of one's own: positions of a total station."""

    time: np.ndarray
    place: tn.Position
    key: ClassVar[str] = "station"
    record: None = None

    def sources(self, altitude):
        measured = np.tile([self.place.lat, self.place.lon, self.place.alt], (len(self.time), 1))
        return [Aiding("station", "position", self.time, measured, np.full((len(self.time), 3), 0.05))]


def test_navigation_takes_an_aid_of_ones_own(still):
    start = tn.align(still.between(None, 60.0), PLACE, "navigation")
    free = tn.navigate(still, start, altitude="free")
    aided = tn.navigate(still, start, aid=Fixes(np.arange(61.0, 119.0), PLACE), altitude="free")
    assert [r.name for r in aided.residuals] == ["station"]
    assert aided.position_sigma[-1].max() < 0.05 < free.position_sigma[-1].max()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"calibration": "x"}, ["calibration is 'x'", "expected a Calibration"]),
        ({"at": "x"}, ["at is 'x'", "expected an epoch", "number of seconds"]),
        ({"method": 3}, ["method is 3", "expected a name", "callable"]),
    ],
)
def test_an_option_of_another_type_is_named(still, options, words):
    with raises_naming(tn.UsageError, *words):
        tn.align(still, PLACE, "navigation", **options)


@pytest.mark.filterwarnings("error")
def test_a_place_of_other_than_numbers_is_named():
    with raises_naming(tn.UsageError, "lat is '48'", "expected a number, in rad"):
        tn.Position("48", 0.0, 0.0)
    with raises_naming(tn.UsageError, "lat is masked", "expected a number"):
        tn.Position(np.ma.masked, 0.0, 0.0)
    with raises_naming(tn.UsageError, "alt is None", "in m"):
        tn.Position(0.8, 0.0, None)
    with raises_naming(tn.UsageError, "'48'", "expected degrees"):
        tn.Position.from_degrees("48", 0.0, 0.0)
    with raises_naming(tn.UsageError, "masked", "expected a Position"):
        tn.Position.of([48.0, np.ma.masked])
    assert tn.Position(np.float32(0.5), np.array(0.25), np.int64(3)).alt == 3
