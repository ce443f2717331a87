"""A master whose velocity went through a filter, or whose stamps scatter: found as such, or in sigma."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.honesty.transfer import ERRORS, aircraft, transferred
from tests.alignment.test_transfer_axes import ARM, ship
from truenorth.alignment import transfer_verdict
from truenorth.alignment.transfer_filter import Assumed, Linear, Matching, master_aiding
from truenorth.alignment.transfer_smoothed import filter_sigmas
from truenorth.core.attitude import skew
from truenorth.core.errors import UsageError
from truenorth.errors.master import DELAY, FILTER, MasterErrors, TransferModel, master_errors
from truenorth.estimate.linear import rows_along
from truenorth.records import MasterRecord
from truenorth.simulation.gnss import place_of

AT, STEP = np.array([41.3, 42.3]), 0.02  # s


def test_what_a_filter_does_to_a_velocity_is_its_columns():
    """Late, flatter where the acceleration changes, and skewed: derivatives of the velocity of the master, on an arm of a ship."""
    way = ship(np.random.default_rng(1), 60.0)
    model = TransferModel(filter=filter_sigmas(0.15, True))
    at = way.states(AT)
    v = np.stack([place_of(way.states(AT + k * STEP), -ARM)[3] for k in (-2, -1, 0, 1, 2)])
    jerk, change = (v[3] - 2.0 * v[2] + v[1]) / STEP**2, (v[4] - 2.0 * v[3] + 2.0 * v[1] - v[0]) / (2.0 * STEP**3)
    turned = np.einsum("kij,kj->ki", at.C_nb, np.cross(at.w_ib_b, at.f_b))
    flatter = np.column_stack([at.f_b, jerk - turned, change])
    linear = Linear(at.C_nb, at.C_nb, flatter=flatter)
    master = MasterRecord(AT, C_nb=at.C_nb, v_n=v[2], source="made")
    found = master_aiding(master, model, Assumed(ARM), Matching(1.0), linear)
    H = rows_along(at, found, model.ins)[1]
    own = model.slice_of(FILTER)
    np.testing.assert_array_equal(H[:, :3, own.start], H[:, :3, model.slice_of(DELAY).start])
    np.testing.assert_allclose(H[:, :3, own.start + 1], -jerk, atol=2e-3)  # but for the turning of the earth
    np.testing.assert_allclose(H[:, :3, own.start + 2], change, atol=1e-9)


def test_noise_of_a_rate_parts_no_flatter_velocity_from_an_arm():
    """A force that turns with the body is an arm along it, whatever the gyros say: both columns are of one rate."""
    way = ship(np.random.default_rng(1), 60.0)
    at = way.states(AT)
    noisy = replace(at, w_ib_b=at.w_ib_b + 0.3)
    linear = Linear(at.C_nb, at.C_nb, flatter=np.column_stack([at.f_b, np.zeros((2, 6))]))
    master = MasterRecord(AT, C_nb=at.C_nb, v_n=at.v_n, source="made")
    model = TransferModel(filter=filter_sigmas(0.15, False))
    H = rows_along(noisy, master_aiding(master, model, Assumed(ARM), Matching(1.0), linear), model.ins)[1]
    arm, flat = model.slice_of("master lever arm"), model.slice_of(FILTER).start + 1
    np.testing.assert_allclose(H[:, :3, flat], -np.einsum("kij,kj->ki", H[:, :3, arm], at.f_b), atol=1e-12)
    assert np.abs(H[:, :3, flat] - -np.einsum("kij,kj->ki", at.C_nb @ skew(at.w_ib_b), at.f_b)).max() > 0.1


def test_a_filter_is_said_by_its_time_constant():
    assert master_errors("filter=0.1 s") == MasterErrors(filter=0.1)
    assert master_errors("none").filter == MasterErrors().filter > 0.0
    assert FILTER not in TransferModel(filter=filter_sigmas(0.0, True)).groups
    late, flat, skewed = filter_sigmas(0.1, False)
    assert late == 0.0  # by velocity alone it is a delay of the master
    # What a time constant of one or two sigmas does lies within two of theirs.
    assert 0.1**2 / 2.0 < flat < 0.2**2 / 2.0 < 3.0 * flat
    assert 0.1**3 / 3.0 < skewed < 0.2**3 / 3.0 < 3.0 * skewed
    with pytest.raises(UsageError, match="sigmas of zero or more"):
        MasterErrors(filter=-1.0)


@pytest.mark.slow
@pytest.mark.parametrize("grade", ["tactical", "consumer"])
@pytest.mark.parametrize("matching", ["velocity", "both"])
def test_a_filter_of_a_tenth_of_a_second_is_no_arm(grade, matching):
    """The arm was up to 7.5 sigmas off by velocity, and 14 m by both (seed 5502)."""
    for run in range(2):
        answer = transferred(aircraft, ERRORS, grade, matching=matching, constant=0.1)(91, run)
        assert not answer.refused
        assert all(np.nanmax(np.abs(ratio)) < 4.0 for ratio in answer.ratios.values())


@pytest.mark.parametrize(
    ("values", "sigmas", "slow"),
    [
        ((0.1, 0.01, 0.001), (0.004, 0.001, 4e-4), False),
        ((0.2, 0.03, 0.006), (0.004, 0.001, 4e-4), True),
        ((0.13, 0.015, 0.002), (0.01, 0.005, 1e-3), False),
        ((0.0, 0.005, 0.0), (0.0, 0.001, 2e-4), False),
        ((0.0, 0.02, 0.002), (0.0, 0.002, 2e-4), True),
        ((0.0, 0.02, 0.002), (0.0, 0.007, 2e-4), False),
        ((0.0, -0.002, 0.0), (0.0, 0.001, 2e-4), False),
    ],
)
def test_a_slow_filter_is_named(values, sigmas, slow):
    """By the delay of velocity behind attitude where both are there, else by how flat it is: of .2 s the arm was 11 sigmas off."""
    layout = SimpleNamespace(slice_of=lambda name: slice(1, 4))
    P = np.diag([1.0, *np.square(sigmas)])[None]
    track = SimpleNamespace(layout=layout, P=P, sensors=np.array([[0.0, *values]]))
    found = transfer_verdict._filtered(track)
    assert [item.key for item in found] == (["transfer.filter"] if slow else [])


@pytest.mark.slow
@pytest.mark.parametrize("matching", ["velocity", "both"])
def test_stamps_that_scatter_are_noise_in_turns(matching):
    """Two S-turns alike: it was a matter of chance which of them the other log's was taken for, 93 s apart (`aligned`)."""
    for run in range(2):
        answer = transferred(aircraft, ERRORS, "tactical", matching=matching, scatter=0.02)(5502, run)
        assert not answer.refused
        assert all(np.nanmax(np.abs(ratio)) < 4.0 for ratio in answer.ratios.values())
