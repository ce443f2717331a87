"""Zero, discs and slips of an indexer's encoder, by how the base turns: exact in what is made, and none in pure sway; both ways."""

from dataclasses import replace

import numpy as np
import pytest

from tests.runs import few_and_all, some
from truenorth.core.attitude import dcm_from_rotation_vector
from truenorth.core.earth import EARTH_RATE
from truenorth.core.indexing import C_bs_from_angles
from truenorth.quality.encoder import encoder_evidence
from truenorth.quality.encoder_errors import error_evidence, errors_of, f_limit
from truenorth.quality.encoder_patterns import Turns
from truenorth.quality.encoder_slips import slip_of
from truenorth.quality.prediction import filtered_back, prediction, step_energies
from truenorth.records import ImuRecord

ARCSEC = np.radians(1.0) / 3600.0


def sea(rng, time, size):
    """A rough sea of lines of 4 to 20 s about each axis, rad."""
    x = np.zeros((len(time), 3))
    for axis in range(3):
        for _ in range(30):
            period = 1.0 / rng.uniform(1 / 20, 1 / 4)
            x[:, axis] += rng.normal(0.0, size / np.sqrt(30)) * np.sin(2 * np.pi * (time / period + rng.random()))
    return x


def made(
    rng, axes=2, size=0.02, duration=300.0, off=lambda time, angles: 0.0 * angles, noise=ARCSEC, way=lambda time: time
):
    """Turns of a base with axes z and x that spin on it, `off` (K, A) what the angles are off by, `way` (s) how they go on."""
    time = np.arange(0.0, duration, 0.1)
    rates = np.radians(rng.uniform([8.0, 2.0], [18.0, 6.0]))[:axes]
    angles = np.outer(way(time), rates) + rng.uniform(0.0, 6.0, axes)
    C = C_bs_from_angles("zx"[:axes], angles)
    directions = (np.broadcast_to([0.0, 0.0, 1.0], (len(time), 3)), C[:, :, 0])[:axes]
    turn = sea(rng, time, size) + noise * rng.standard_normal((len(time), 3))
    turn -= sum(u * e[:, None] for u, e in zip(directions, off(time, angles).T, strict=True))
    there = np.ones(len(time), dtype=bool)
    bias = np.cumsum(C, axis=0) * 0.1
    rates = np.gradient(angles, 0.1, axis=0)
    up = np.array([0.0, 0.0, 1.0])
    return Turns(time, turn, there, angles, C, tuple(directions), bias, np.full(3, 5e-8), up, rates)


@few_and_all(60, few=4)
def test_sway_is_no_error(runs):
    """Of 0.003 to 3 deg, axes of one and two."""
    for run in range(runs):
        rng = np.random.default_rng([run, 1])
        turns = made(rng, axes=1 + run % 2, size=np.radians(0.003 * 1000.0 ** rng.random()))
        assert [item for item in error_evidence(turns) if item.kind != "hint"] == []
        assert slip_of(turns) is None


@few_and_all(30, few=3)
def test_noise_of_an_axis_that_rests_is_no_disc(runs):
    """15 arcsec of noise about one angle: a disc of half a radian would turn the base as that noise does."""
    for run in range(runs):
        rng = np.random.default_rng([run, 9])
        turns = made(rng, size=np.radians(0.003 * 100.0 ** rng.random()))
        noise = 15.0 * ARCSEC * rng.standard_normal(len(turns.time))
        angles = np.column_stack([turns.angles[:, 0], turns.angles[0, 1] + noise])
        C = C_bs_from_angles("zx", angles)
        off = C[:, :, 0] * noise[:, None]
        turns = replace(
            turns, turn=turns.turn - off, angles=angles, C_bs=C, directions=(turns.directions[0], C[:, :, 0])
        )
        assert not {"2.1", "2.2"} & errors_of(turns).keys()


@few_and_all(30, few=3)
@pytest.mark.parametrize("name", ["zero", "1.1", "2.1", "2.2"])
def test_an_error_is_found_as_large_as_it_is(name, runs):
    """0.05 to 0.3 deg through a sway of 0.3 deg; what is no hint within four of its sigmas and a hundredth of itself.

    Twice a turn of the outer axis is as fast as the sea, and is not asked for. Twice a turn of the inner axis may be, too: one of
    thirty is missed, and the size of a hint is off by up to a half.
    """
    missed = 0
    for run in range(runs):
        rng = np.random.default_rng([run, 2])
        size, phase = np.radians(rng.uniform(0.05, 0.3)), rng.uniform(0.0, 6.0)

        def off(time, angles, size=size, phase=phase):
            if name == "zero":
                return size * np.array([[0.0, 1.0]]) + 0.0 * angles
            axis, n = int(name[0]) - 1, int(name[-1])
            return size * np.cos(n * angles[:, [axis]] - phase) * np.eye(2)[axis]

        found = errors_of(made(rng, size=np.radians(0.3), off=off)).get(name)
        if found is None:
            missed += 1
            continue
        fit, beyond, like_sway = found
        assert like_sway == (name == "1.1")  # the axes turn at one rate
        if beyond < 1.0:
            continue
        x, P = fit.group(name)
        true = -size * np.array([1.0] if name == "zero" else [np.cos(phase), np.sin(phase)])
        assert np.all(np.abs(x - true) < 4.0 * np.sqrt(np.diag(P)) + 0.01 * size)
    assert missed <= (runs // 30 if name == "2.2" else 0)


@pytest.mark.parametrize("period", [1.0, 1.02])
def test_a_base_that_swings_as_fast_as_the_axis_turns_is_not_its_disc(period):
    """It swings about the other axes as well, or not quite as fast."""
    rng = np.random.default_rng(3)
    turns = made(rng, axes=1)
    swing = np.radians(0.3) * np.stack(
        [np.cos(turns.angles[:, 0] * period + phase) for phase in (0.0, 1.0, 2.0)], axis=1
    )
    swung = Turns(**{**vars(turns), "turn": turns.turn + swing})
    assert [item for item in error_evidence(swung) if item.kind != "hint"] == []


@few_and_all(12, few=2)
@pytest.mark.parametrize("size", [0.1, 1.0, 8.0])
@pytest.mark.parametrize("axes", [1, 2])
def test_a_sway_of_the_axis_period_is_in_sigma(axes, size, runs):
    """About the outer axis, once a turn of it to the last digit: a disc looks the same, and neither is a contradiction."""
    for run in range(runs):
        rng = np.random.default_rng([run, 9])

        def off(time, angles, rng=rng):
            return np.radians(size) * np.cos(angles[:, [0]] - rng.uniform(0.0, 6.0)) * np.eye(axes)[0]

        (found,) = error_evidence(made(rng, axes, np.radians(0.05), off=off))
        assert (found.key, found.kind) == ("encoder.disc_or_sway", "hint")
        assert found.effect.heading == pytest.approx(np.radians(size), rel=0.1)


def there_and_back(time):
    """Three ways of 100 s and a bit, the second one back."""
    return np.interp(time, [0.0, 97.0, 201.0, 300.0], [0.0, 97.0, -7.0, 92.0])


@few_and_all(12, few=2)
def test_an_axis_that_turns_back_tells_its_disc_from_a_sway(runs):
    """0.2 deg: a disc goes back with the axis, and is one; a sway of its period goes on, and is none."""
    for run in range(runs):
        rng = np.random.default_rng([run, 10])
        phase = rng.uniform(0.0, 6.0)

        def disc(time, angles, phase=phase):
            return np.radians(0.2) * np.cos(angles - phase)

        found = error_evidence(made(rng, 1, np.radians(0.05), off=disc, way=there_and_back))
        assert [(item.key, item.kind) for item in found] == [("encoder.disc", "bounded")]

        def sway(time, angles, phase=phase):
            rate = np.abs(angles[1] - angles[0]) / 0.1
            return np.radians(0.2) * np.cos(rate * time[:, None] - phase)

        found = error_evidence(made(rng, 1, np.radians(0.05), off=sway, way=there_and_back))
        assert [item for item in found if item.kind != "hint"] == []


@few_and_all(30, few=4)
@pytest.mark.parametrize("over", some([0.5], [0.0, 2.0]))
def test_a_slip_is_found_as_large_as_it_is(over, runs):
    for run in range(runs):
        rng = np.random.default_rng([run, 4])
        axis, at, size = int(rng.integers(2)), rng.uniform(30.0, 290.0), np.radians(rng.uniform(0.1, 0.5))

        def off(time, angles, axis=axis, at=at, size=size):
            share = np.clip((time - at) / over, 0.0, 1.0) if over else (time >= at).astype(float)
            return size * share[:, None] * np.eye(2)[axis]

        turns = made(rng, size=np.radians(0.3), off=off)
        slip = slip_of(turns)
        assert slip is not None
        assert slip.axis == axis
        assert slip.size == pytest.approx(-size, rel=0.3)
        assert abs(slip.at - at) < 3.0
        assert slip.evidence().figures["size"] == -slip.size


@pytest.mark.slow
@few_and_all(10, few=2)
def test_a_slip_in_a_gap(runs):
    for run in range(runs):
        rng = np.random.default_rng([run, 5])
        turns = made(rng, off=lambda time, angles: np.radians(0.1) * (time > 150.0)[:, None] * [0.0, 1.0])
        turns = Turns(**{**vars(turns), "there": np.abs(turns.time - 150.0) > 1.0})
        sound = made(np.random.default_rng([run, 5]))
        assert slip_of(turns).size == pytest.approx(-np.radians(0.1), rel=0.1)
        assert slip_of(Turns(**{**vars(sound), "there": turns.there})) is None


@few_and_all(4, few=1)
def test_a_base_that_is_knocked_does_not_slip(runs):
    """Turned for good by 0.1 deg about all axes, or about one, and back within seconds."""
    for run in range(runs):
        rng = np.random.default_rng([run, 6])
        turns = made(rng)
        since = turns.time - 140.0
        stays = (since > 0.0)[:, None] * np.radians([0.1, -0.1, 0.1])
        assert slip_of(Turns(**{**vars(turns), "turn": turns.turn + stays})) is None
        back = np.where(since > 0.0, np.exp(-np.maximum(since, 0.0) / 2.0), 0.0)[:, None] * np.radians([0.0, 0.0, 0.1])
        assert slip_of(Turns(**{**vars(turns), "turn": turns.turn + back})) is None


def test_what_was_said_of_the_angles_is_in_sigma_already():
    turns = made(np.random.default_rng(7), off=lambda time, angles: np.radians([[0.0, 0.1]]) + 0.0 * angles)
    assert error_evidence(turns)
    assert error_evidence(turns, said=np.radians(0.1)) == []


def test_energies_of_whitened_steps():
    """Against each step whitened; and the filter backwards is the transpose of the one forwards."""
    rng = np.random.default_rng(8)
    x, u = np.cumsum(rng.standard_normal((80, 3)), axis=0), rng.standard_normal((80, 3))
    white = prediction(x, np.ones(80, dtype=bool), 6)
    steps = [np.sum(white(u * (np.arange(80) >= t0)[:, None]) ** 2) for t0 in range(80)]
    np.testing.assert_allclose(step_energies(u, white), steps, rtol=1e-9, atol=1e-9)
    lag_by_lag = sum(white.a[lag] / white.sigma * x[6 - lag : 80 - lag] for lag in range(7))
    np.testing.assert_allclose(white(x), lag_by_lag, rtol=1e-12, atol=1e-12)
    e = rng.standard_normal((74, 3))
    assert np.sum(e * white(u)) == pytest.approx(np.sum(filtered_back(e, white) * u))


def test_limits_of_a_ratio_of_chi_squares():
    """F(0.99; 1, 8) and F(0.99; 2, 8), by tables."""
    assert f_limit(0.01, 1, 8) == pytest.approx(11.26, abs=0.01)
    assert f_limit(0.01, 2, 8) == pytest.approx(8.65, abs=0.01)


def test_a_base_turns_with_the_earth():
    """Within 48 minutes by more than any sway: sound logs of an hour were refused."""
    time = np.arange(1.0, 7201.0)
    rate = np.tile(EARTH_RATE * np.array([0.0, 0.6, 0.8]), (len(time), 1))
    record = ImuRecord(time, rate, np.tile([0.0, 0.0, 9.8], (len(time), 1)), "rates", "made")

    def still(at):
        return np.broadcast_to(np.eye(3), (len(at), 3, 3))

    def leaving(at):
        return dcm_from_rotation_vector(np.outer(at, [0.0, 0.0, 2e-4]))

    assert encoder_evidence(record, still, {"again": still}) == []
    assert [item.key for item in encoder_evidence(record, leaving, {"again": leaving})] == ["encoder.drifts"]
