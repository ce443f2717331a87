"""A master whose velocity went through a filter, or whose stamps scatter: found as such, or in sigma."""

from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.honesty.transfer import ERRORS, aircraft, transferred
from tests.alignment.test_transfer_axes import ARM, ship
from truenorth.alignment import transfer_smoothed, transfer_verdict
from truenorth.alignment.transfer_filter import Assumed, Linear, Matching, master_aiding
from truenorth.alignment.transfer_smoothed import filter_sigmas, flatter_along
from truenorth.core.errors import UsageError
from truenorth.errors.master import DELAY, FILTER, MasterErrors, TransferModel, master_errors
from truenorth.estimate.linear import rows_along
from truenorth.records import MasterRecord
from truenorth.simulation.gnss import place_of
from truenorth.state.track import Track

AT, STEP = np.array([41.3, 42.3]), 0.02  # s


def test_what_a_filter_does_to_a_velocity_is_its_columns():
    """Late, flatter and skewed: a row of a master on an arm of a ship, taken when it held, is H x."""
    way, late, flat, skewed = ship(np.random.default_rng(1), 60.0), 0.1, 0.006, 0.0004
    model = TransferModel(filter=filter_sigmas(0.15, True))
    at = way.states(AT - late)
    then = [place_of(way.states(AT - late + k * STEP), -ARM)[3] for k in (-2, -1, 0, 1, 2)]
    jerk = (then[3] - 2.0 * then[2] + then[1]) / STEP**2
    change = (then[4] - 2.0 * then[3] + 2.0 * then[1] - then[0]) / (2.0 * STEP**3)
    linear = Linear(at.C_nb, at.C_nb, late=late, flatter=np.column_stack([jerk, change]))
    seen = then[2] + flat * jerk - skewed * change
    master = MasterRecord(AT, C_nb=at.C_nb, v_n=seen, source="made")
    sources = master_aiding(master, model, Assumed(ARM), Matching(1.0), linear)
    np.testing.assert_allclose(sources[0].time, at.time)
    z, H = rows_along(at, sources, model.ins)
    own = model.slice_of(FILTER)
    np.testing.assert_array_equal(H[:, :3, own.start], H[:, :3, model.slice_of(DELAY).start])
    np.testing.assert_allclose(H[:, :3, own.start + 1], -jerk, atol=1e-9)
    np.testing.assert_allclose(H[:, :3, own.start + 2], change, atol=1e-9)
    np.testing.assert_allclose(z[:, :3], H[:, :3, own] @ [late, flat, skewed], atol=1e-4)  # the turning of the earth
    assert np.abs(flat * jerk).max() > 1e-3


class Tone:
    """In place of `Means`: the acceleration ``cos(w t)`` east, as triangles of a half length show it, and noise."""

    frequency, size, noise = 6.0, 1.0, 0.0  # rad/s, m/s^2
    corrections = np.zeros(3)

    def __init__(self, slave, track, carried, held, arm, bend):
        self.held, self.rng = held, np.random.default_rng(3)

    def held_at(self, shift, half, bent=False):
        if bent:  # it is rigid
            return np.zeros((len(self.held), 3))
        seen = (
            self.size
            * np.sinc(self.frequency * half / (2.0 * np.pi)) ** 2
            * np.cos(self.frequency * (self.held + shift))
        )
        noise = self.noise * np.sqrt(2.0 / (3.0 * half)) * self.rng.standard_normal((3, len(seen)))
        return np.stack([seen, 0.0 * seen, 0.0 * seen], axis=1) + noise.T


def columns_of(monkeypatch, found, push, **of_motion):
    """Of a motion in place of the real one, with what a pass has found of the filter; push: density of the force's noise."""
    monkeypatch.setattr(transfer_smoothed, "Means", type("Motion", (Tone,), of_motion))
    model = TransferModel(accel_random_walk=push, filter=filter_sigmas(0.15, True))
    own = model.slice_of(FILTER)
    sensors, P, held = (
        np.zeros((4000, model.states)),
        np.zeros((4000, model.states, model.states)),
        np.arange(4000) * 0.05,
    )
    sensors[-1, own] = found
    track = Track(held, held, held, held, sensors, P, model.layout, ())
    slave = SimpleNamespace(interval=0.01)
    return held, flatter_along(slave, track, None, model, held - found[0], (np.zeros(3), 0.0), 0.05)


@pytest.mark.parametrize("constant", [0.05, 0.1])
def test_columns_find_a_filter_of_the_first_order(monkeypatch, constant):
    """Of 1 m/s^2 at 6 rad/s, and nothing is left for an arm: the next two terms of the filter are those of the means."""
    w = Tone.frequency
    held, flatter = columns_of(monkeypatch, [constant, constant**2 / 2.0, constant**3 / 3.0], 0.0)
    true = np.real(np.exp(1j * w * held) / (1j * w * (1.0 + 1j * w * constant)))
    jerk, change = (flatter[10:-10, k] for k in (0, 3))
    columns = np.column_stack([jerk, -change])
    found, *_ = np.linalg.lstsq(columns, (true - np.sin(w * (held - constant)) / w)[10:-10])
    # The next term but these, (w T)^6.
    assert found[0] == pytest.approx(constant**2 / 2.0, rel=0.01 + 0.4 * (w * constant) ** 4)
    assert found[1] == pytest.approx(constant**3 / 3.0, abs=0.4 * w**2 * constant**5)


def test_columns_are_of_the_motion_and_not_of_the_noise(monkeypatch):
    """What the filter has found chooses the means; noise makes them longer, or the columns nothing where there is no motion."""
    sound = columns_of(monkeypatch, [0.1, 0.005, 3e-4], 0.0)[1]
    noisy = columns_of(monkeypatch, [0.1, 0.005, 3e-4], 2e-3, noise=2e-3)[1]
    assert np.sum(noisy[:, 0] * sound[:, 0]) / np.sum(sound[:, 0] ** 2) == pytest.approx(1.0, abs=0.02)
    still = columns_of(monkeypatch, [0.1, 0.005, 3e-4], 2e-3, noise=2e-3, size=0.0)[1]
    known = np.sum(still[:, :3] ** 2) * (0.15**2 / np.sqrt(2.0) / 0.05) ** 2
    assert known < 0.05


def test_a_filter_is_said_by_its_time_constant():
    assert master_errors("filter=0.1 s") == MasterErrors(filter=0.1)
    assert master_errors("none").filter == MasterErrors().filter > 0.0
    assert FILTER not in TransferModel(filter=filter_sigmas(0.0, True)).groups
    late, flat, skewed = filter_sigmas(0.1, False)
    assert late == 0.0  # by velocity alone it is a delay of the master
    assert filter_sigmas(0.1, True) == (0.1, flat, skewed)
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
