"""A vehicle that drives before its first fix, or before its odometer's first row: the log is used from then on."""

import numpy as np
import pytest

from tests.runs import some
from truenorth import Gnss, GnssRecord, Odometer, align
from truenorth.core.attitude import misalignment
from truenorth.core.position import Position
from truenorth.core.yaml_file import read_mapping
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
