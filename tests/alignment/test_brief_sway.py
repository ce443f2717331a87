"""A log of less than a minute in a sea: a heading that nobody knows, a slow turn, waves that are no white noise."""

import math
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.honesty import vehicles
from benchmarks.honesty.foreign import log, sensed
from truenorth.alignment import align
from truenorth.alignment import procedure as steps
from truenorth.alignment.bias_step import bias_signatures
from truenorth.alignment.brief_sway import bent_by_heading
from truenorth.alignment.coloured import made
from truenorth.alignment.drift import drift_signatures
from truenorth.alignment.matched import innovations_of, matched
from truenorth.core.earth import EARTH_RATE
from truenorth.core.position import Position
from truenorth.records.specs import imu_spec


def at_sea(vehicle, grade, seed, run, length):
    rng = np.random.default_rng([seed, run, 9])
    true = vehicle(rng, length)
    return sensed(rng, true, imu_spec(grade), 100.0), true, Position(*true.place.mean(axis=0).tolist())


def off(answer, true):
    """(3,) misalignment, rad; level alone, whatever heading."""
    C = true.at(answer.time)[2]
    phi = -log(answer.C_nb @ C.T)
    phi[:2] = answer.C_nb[:2] @ np.cross(answer.C_nb[2], C[2])
    return phi


@pytest.fixture(scope="module")
def raft():
    """A raft of 30 s whose heading is not known to a radian, and the fine alignment that it is answered with."""
    record, true, place = at_sea(vehicles.raft, "navigation", 5, 0, 29.6)
    kept = []
    with pytest.MonkeyPatch.context() as patch:
        aligned = steps.fine_align
        patch.setattr(steps, "fine_align", lambda *a, **k: kept.append(aligned(*a, **k)) or kept[-1])
        answer = align(record, place, "navigation")
    return kept[-1], answer, true, place


def test_level_bends_with_a_heading_that_nobody_knows(raft):
    """To second order: what the wrong level rate of such a heading leaves along north is the error that there is."""
    fine, answer, true, place = raft
    phi = off(answer, true)
    assert abs(phi[2]) > 1.0
    bent = np.sqrt(np.diag(bent_by_heading(fine, place.lat))[:2])
    assert bent[1] > 5.0 * bent[0]  # along its own north
    linear = np.sqrt(np.diag(fine.P)[1])
    assert abs(phi[1]) > 4.0 * linear  # which the linear filter does not know
    assert np.abs(phi[:2] / np.sqrt(np.diag(answer.phi_covariance)[:2])).max() < 3.0


def test_nothing_bends_where_heading_is_known(raft):
    fine, _, _, place = raft
    P = fine.estimates.P.copy()
    P[-1] *= 1e-6
    known = replace(fine, estimates=replace(fine.estimates, P=P))
    off, none = (math.sqrt(bent_by_heading(item, place.lat).trace()) for item in (fine, known))
    assert none < 1e-3 * off
    assert off < 2.0 * EARTH_RATE * fine.integrals.time[-1]  # nothing turns farther


def test_signatures_are_made_as_they_are_matched(raft):
    """``sum y nu`` and ``sum y^2`` of what is made in full are the match and the energy that are summed from the end back."""
    seen = innovations_of(raft[0])
    for bank in (drift_signatures(raft[0]), bias_signatures(raft[0])):
        which = np.array([0, 7, len(bank.epoch) - 1])
        y, match = made(seen, bank, which), matched(seen, bank)[0]
        size = match.size[which]
        assert np.allclose(np.einsum("skm,km->s", y, seen.white[:, :, 0]) * size, match.ratio[which], rtol=1e-6)
        assert np.allclose(np.einsum("skm,skm->s", y, y) * size**2, match.ratio[which], rtol=1e-6)


@pytest.mark.parametrize(
    ("vehicle", "grade", "seed", "run", "length"),
    [
        pytest.param(vehicles.buoy, "navigation", 8, 0, 58.3, id="buoy that swings"),
        pytest.param(vehicles.buoy, "tactical", 8, 2, 43.2, id="buoy that turns", marks=pytest.mark.slow),
        pytest.param(vehicles.raft, "navigation", 5, 5, 20.9, id="raft in waves"),
    ],
)
def test_a_short_log_at_sea_is_not_refused(vehicle, grade, seed, run, length):
    """They were: for a base that moves, which swung, and for biases that change, which were waves."""
    record, true, place = at_sea(vehicle, grade, seed, run, length)
    answer = align(record, place, grade)
    assert answer.status in ("aligned", "level_only", "not_converged"), answer.reasons
    assert np.abs(off(answer, true)[:2] / np.sqrt(np.diag(answer.phi_covariance)[:2])).max() < 4.0
