"""Internal damping in hard turns: switched off and on again, never worse than none, better than always on; its bands hold it."""

import numpy as np
import pytest

from benchmarks.honesty.voyage import SPEC, voyage
from tests.runs import few_and_all
from truenorth.damping.course import errors_of
from truenorth.damping.loop import SCHULER_RATE
from truenorth.damping.networks import second_order
from truenorth.damping.options import Damper
from truenorth.damping.switching import HYSTERESIS, manoeuvred, switching
from truenorth.errors.marine import DV
from truenorth.navigation import navigate
from truenorth.state.track import Track


@pytest.fixture(scope="module")
def ship():
    return voyage(1, 0, hours=16.0)


def navigated(ship, damper):
    return navigate(
        ship.record,
        ship.start,
        altitude="fixed",
        imu=SPEC,
        damping=damper,
        interval=4.0,
        output=4.0,
        check_clocks=False,
    )


def errors(ship, result):
    found = result.track
    return errors_of(found, ship.truth[: len(found)])


def test_manoeuvres_are_separated_from_the_swing(ship):
    """Of the true course all turns are found, to the waves' minute; a swing of three sigma at Schuler's rate is none of it."""
    truth = ship.truth
    found = manoeuvred(truth, np.full(len(truth.time), 1.0))
    changed = truth.v_n[:, :2] - truth.v_n[0, :2]
    calm = np.linalg.norm(np.diff(truth.v_n[:, :2], axis=0), axis=1) < 1e-3
    calm = np.convolve(calm, np.ones(61), "same") > 60.5  # two minutes from a turn
    assert np.abs(found - changed)[1:][calm].max() < 0.3
    swing = np.sin(SCHULER_RATE * truth.time)[:, None] * np.array([1.0, 0.0, 0.0])
    straight = Track.of_motion(
        truth.time, np.broadcast_to(truth.C_nb[0], truth.C_nb.shape), truth.v_n[0] + swing, truth.position
    )
    assert np.abs(manoeuvred(straight, np.full(len(truth.time), 1.0))).max() == 0.0


def test_hysteresis(ship):
    """Off above what is allowed, on below half of it, and each switch says which."""
    found = switching(ship.truth, second_order(0.5), np.full(len(ship.truth.time), 1.0))
    assert len(found.switches) >= 4
    for k, switch in enumerate(found.switches):
        assert switch.damped == bool(k % 2)
        assert switch.leak < HYSTERESIS * switch.allowed if switch.damped else switch.leak > switch.allowed
    between = (found.leak > HYSTERESIS * found.allowed) & (found.leak < found.allowed)
    assert set(found.mu[between]) == {0.0, 1.0}  # of one size, as it came there


@pytest.mark.slow
@few_and_all(8, few=1)
def test_switching_is_no_worse_than_either(runs):
    """RMS of velocity after six hours: none, always on, switched; place, course and errors drawn in each voyage."""
    for run in range(runs):
        ship = voyage(2, run, hours=16.0)
        none, on, switched = (
            ship.velocity_error(navigated(ship, damper))
            for damper in (Damper("none"), Damper("internal", switching=False), Damper("internal"))
        )
        assert switched < 1.05 * min(none, on), (run, none, on, switched)


@pytest.mark.slow
def test_bands_hold_what_manoeuvres_add(ship):
    for switched in (True, False):
        result = navigated(ship, Damper("internal", switching=switched))
        off = np.abs(errors(ship, result)[:, DV]) / result.track.sigma[:, 3:5]
        assert off.max() < 4.5
        assert any("switched off" in reason for reason in result.reasons) == switched
