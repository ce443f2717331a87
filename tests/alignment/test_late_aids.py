"""A vehicle that drives before its first fix, or before its odometer's first row: the log is used from then on."""

import numpy as np
import pytest

from tests.runs import some
from truenorth import AlignmentError, Gnss, GnssRecord, Odometer, align
from truenorth.alignment.in_motion_task import first_fix
from truenorth.core.attitude import misalignment
from truenorth.core.position import Position
from truenorth.core.yaml_file import read_mapping
from truenorth.live import Aligner
from truenorth.navigation import Mounting
from truenorth.report.page import alignment_page
from truenorth.simulation.scenario import SHIPPED, read_scenario

ANTENNA = Mounting(latency=0.1, lever_arm=np.array([0.0, -0.5, 1.2]))


def driven(duration):
    """A van that stands for half a minute, and then drives about town."""
    scenario = read_scenario(read_mapping(SHIPPED / "van.yaml") | {"duration": duration})
    made = scenario.simulate(seed=3, run=1)
    return made, {name: sensor.record for name, sensor in scenario.simulate_aiding(seed=3, run=1).items()}


@pytest.fixture(scope="module")
def drive():
    """As long as it is shipped."""
    return driven("420 s")


def off(answer, motion):
    """Error of the attitude in sigmas, (3,)."""
    phi = misalignment(answer.C_nb, motion.states(np.array([answer.time])).C_nb[0])
    return np.abs(phi) / np.sqrt(np.diag(answer.phi_covariance))


def from_on(gnss, first):
    rows = gnss.time >= first
    return GnssRecord(gnss.time[rows], gnss.lat[rows], gnss.lon[rows], gnss.alt[rows], v_n=gnss.v_n[rows])


@pytest.mark.slow
@pytest.mark.parametrize("first", some([100.0], [60.0, 200.0, 300.0]))
def test_a_first_fix_after_driving_off(drive, first):
    """Heading was off by 4 to 123 deg, and the answer `inconsistent`."""
    made, aids = drive
    answer = align(made.record, None, "industrial", aid=Gnss(from_on(aids["gnss"], first), ANTENNA))
    assert answer.status == "aligned", answer.reasons
    assert np.all(off(answer, made.motion) < 4.0)
    assert answer.euler_sigma[0] < np.radians(0.3)
    assert any(item.key == "aids.late" for item in answer.evidence)


@pytest.mark.slow
def test_a_first_fix_before_driving_off(drive):
    """What stands until then is used whole."""
    made, aids = drive
    answer = align(made.record, None, "industrial", aid=Gnss(from_on(aids["gnss"], 20.0), ANTENNA))
    assert answer.status == "aligned", answer.reasons
    assert all(item.key != "aids.late" for item in answer.evidence)


def test_a_first_fix_of_a_car_that_waits_and_has_driven_before():
    """The place of the beginning was as good as a car gets far at the speed of its first fix, none: all fixes were refused."""
    made, aids = driven("150 s")
    gnss, wheel = aids["gnss"], aids["odometer"]
    waits = gnss.time[np.argmin(np.abs(np.interp(gnss.time, wheel.time, wheel.speed)) + 99.0 * (gnss.time < 60.0))]
    late = from_on(gnss, float(waits))
    way = float(np.sum(wheel.distance[wheel.time < waits]))
    begin = first_fix(made.record, late, wheel)
    assert way > 100.0
    assert way < begin.horizontal_sigma < 1.2 * way
    answer = align(made.record, None, "industrial", aid=[Gnss(late, ANTENNA), Odometer(wheel)])
    assert answer.status == "aligned", answer.reasons
    assert np.all(off(answer, made.motion) < 4.0)


def test_a_report_of_a_log_without_fixes_at_first():
    """Half of a minute without innovations: it ended in an internal error of the report."""
    made, aids = driven("50 s")
    gnss = from_on(aids["gnss"], 25.0)
    answer = align(made.record, None, "industrial", aid=Gnss(gnss, ANTENNA), method="motion")
    assert np.isnan(answer.history.nis[:20]).all()
    assert "Innovations" in alignment_page(answer)


@pytest.mark.slow
def test_an_odometer_that_begins_late(drive):
    """The place that is given is that of the beginning: by then the vehicle is elsewhere."""
    made, aids = drive
    wheel = aids["odometer"].between(100.0, None)
    place = Position(np.radians(48.137), np.radians(11.575), 520.0, 5.0, 5.0)
    answer = align(made.record, place, "industrial", aid=Odometer(wheel))
    assert answer.status in ("aligned", "level_only"), answer.reasons
    assert np.all(off(answer, made.motion) < 4.0)
    assert any(item.key == "aids.late" for item in answer.evidence)
    assert answer.position.horizontal_sigma > 50.0


@pytest.mark.parametrize("steady", [False, True])
def test_too_few_seconds_of_fixes_after_a_drive_are_refused_as_that(steady):
    """The whole log was used, unaided drive included: 3 of 30 answers 9 to 16 sigmas off, 18 refused for other reasons.

    A drive that is straight and even looks like a base that is shaken: there the receiver says that it is a drive.
    """
    made, gnss = straight_on() if steady else under_way()
    with pytest.raises(AlignmentError, match=r"only 7\.\d s of the log are aided, and the vehicle drives before that"):
        align(made.record.between(None, gnss.time[0] + 7.5), None, "industrial", aid=Gnss(gnss, ANTENNA))
    answer = align(made.record, None, "industrial", aid=Gnss(gnss, ANTENNA))
    assert answer.status in ("aligned", "level_only"), answer.reasons
    assert np.all(off(answer, made.motion) < 4.0)
    assert any(item.key == "aids.late" for item in answer.evidence)


def test_a_running_alignment_waits_for_more_of_them():
    made, gnss = under_way()
    record, said, fix = made.record.between(None, gnss.time[0] + 15.0), [], 0
    with Aligner(None, "industrial", kind=record.kind, background=False) as aligner:
        for first in range(0, len(record), 100):
            part = slice(first, first + 100)
            aligner.push(record.time[part], record.gyro[part], record.accel[part])
            upto = int(np.searchsorted(gnss.time, record.time[part][-1] - 0.3))
            if upto > fix:
                rows = slice(fix, upto)
                aligner.push_gnss(gnss.time[rows], gnss.lat[rows], gnss.lon[rows], gnss.alt[rows], v_n=gnss.v_n[rows])
                fix = upto
            said.append((float(record.time[part][-1]) - gnss.time[0], aligner.answer, aligner.failure))
    early = [(answer, failure) for since, answer, failure in said if 4.0 < since < 9.0]
    assert early
    assert all(answer is None and "of the log are aided" in failure for answer, failure in early)
    _, answer, failure = said[-1]
    assert answer is not None
    assert failure == ""
    assert answer.status in ("aligned", "level_only")


def under_way():
    """A van that drives off at once, and its fixes from half a minute on."""
    mapping = read_mapping(SHIPPED / "van.yaml") | {"duration": "70 s"}
    mapping["motion"] = mapping["motion"] | {"wait": "0 s"}
    scenario = read_scenario(mapping)
    return scenario.simulate(seed=3, run=1), from_on(scenario.simulate_aiding(seed=3, run=1)["gnss"].record, 30.0)


def straight_on():
    """A van on a straight road at one speed for 45 s, which then goes about; fixes from half a minute on."""
    legs = [{"kind": "straight", "duration": "45 s"}]
    for angle in (60.0, -80.0, 70.0):
        legs += [
            {"kind": "turn", "angle": f"{angle:g} deg", "rate": "15 deg/s"},
            {"kind": "straight", "duration": "6 s"},
        ]
    mapping = read_mapping(SHIPPED / "van.yaml") | {"duration": "70 s"}
    mapping["motion"] = {"kind": "legs", "heading": "70 deg", "speed": "12 m/s", "legs": legs}
    mapping["position"] = {"lat": "48 deg", "lon": "11 deg"}
    scenario = read_scenario(mapping)
    return scenario.simulate(seed=3, run=1), from_on(scenario.simulate_aiding(seed=3, run=1)["gnss"].record, 30.0)
