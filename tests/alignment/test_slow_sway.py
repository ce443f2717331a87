"""A slow sway, and what looks like it: a base that leaves, a bias that steps; each by a log of which the truth is known."""

import math
from zlib import crc32

import numpy as np
import pytest

from tests.runs import some
from truenorth.alignment import align, slow_sway, swaying
from truenorth.alignment.matched import whitened
from truenorth.alignment.slow_sway import is_slow
from truenorth.campaign.fault import Inputs
from truenorth.campaign.fault_benches import BENCHES, Truth, misses
from truenorth.campaign.faults import FAULTS
from truenorth.core.position import Position
from truenorth.errors.sway import Oscillator
from truenorth.simulation.scenario import read_scenario


def _moored(seed: int, period: float, amplitude: float, duration: float, tones_each: int = 1) -> tuple[Inputs, Truth]:
    """A swaying base that also goes slowly to and fro, in one tone or in many about it, and its truth."""
    rng = np.random.default_rng(seed)
    scenario = dict(BENCHES["swaying"].scenario(np.random.default_rng(seed))) | {"duration": f"{duration:g} s"}
    tones = scenario["motion"]["tones"]
    for k, axis in enumerate(("east", "north")):
        slow = [{"amplitude": f"{amplitude} m", "period": f"{period} s", "phase": f"{70.0 * (seed + k):.0f} deg"}]
        for _ in range(1, tones_each):
            size, longer, phase = (
                amplitude * abs(rng.normal()) / 2.0,
                math.exp(0.4 * rng.normal()),
                rng.uniform(0.0, 360.0),
            )
            slow.append(
                {"amplitude": f"{size:.4f} m", "period": f"{longer * period:.2f} s", "phase": f"{phase:.0f} deg"}
            )
        tones[axis] = [*tones[axis], *slow]
    built = read_scenario(scenario)
    body = built.build_motion(seed, 0)
    at = body.states(np.array(0.0))
    place = Position(float(at.lat), float(at.lon), float(at.alt))
    record = built.simulate(seed=seed, run=0).record
    return {"record": record, "place": place, "imu": built.imu_spec}, lambda time: body.states(np.array(time))


@pytest.mark.slow
@pytest.mark.parametrize("seed", [2, 1, 3])
def test_a_base_that_goes_slowly_to_and_fro_is_aligned_within_its_sigma(seed: int) -> None:
    inputs, truth = _moored(seed, period=70.0, amplitude=0.1, duration=600.0)
    answer = align(inputs["record"], inputs["place"], inputs["imu"])
    assert answer.status == "aligned", answer.reasons
    assert max(float(np.abs(x).max()) for x in misses(answer, truth).values()) < 4.0


def test_a_sway_that_is_not_slow_is_not_looked_at_again() -> None:
    inputs, _ = BENCHES["swaying"].draw(3, 0)
    answer = align(inputs["record"], inputs["place"], inputs["imu"])
    assert not any(item.key == "sway.slow" for item in answer.evidence)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("fault", "run"),
    [("accel bias step", 6), ("base leaves slowly", 4), ("specification ten times too good", 6)],
)
def test_what_a_slow_oscillator_took_up_is_not_silent(fault: str, run: int) -> None:
    """By 4.6, 3.6 and 12.2 sigmas as first run: the fit of the sway explained all three."""
    inputs, truth = BENCHES["swaying"].draw(12, run)
    spoil = next(item.apply for item in FAULTS if item.name == fault)
    spoilt, _ = spoil(inputs, np.random.default_rng([12, run, crc32(f"swaying {fault}".encode())]))
    answer = align(spoilt["record"], inputs["place"], spoilt["imu"])
    worst = max(float(np.abs(x).max()) for x in misses(answer, truth).values())
    assert answer.status == "inconsistent" or worst < 3.0, answer


@pytest.mark.slow
@pytest.mark.parametrize("seed", [4, 5])
def test_sound_sensors_are_not_called_noisy_on_a_slow_sway(seed: int) -> None:
    inputs, _ = _moored(seed, period=100.0, amplitude=0.2, duration=240.0)
    answer = align(inputs["record"], inputs["place"], inputs["imu"])
    assert answer.status in ("aligned", "not_converged"), answer.reasons
    assert not any(item.key.startswith("specification.") for item in answer.evidence)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [7, 6, 8, 9])
def test_nor_are_they_where_a_ship_at_her_moorings_goes_in_many_tones(seed: int) -> None:
    """Above the sway they look white, and are as quiet as specified: what is slow and louder is a motion."""
    inputs, _ = _moored(seed, period=80.0, amplitude=0.3, duration=240.0, tones_each=6)
    answer = align(inputs["record"], inputs["place"], inputs["imu"])
    assert answer.status in ("aligned", "not_converged"), answer.reasons
    assert not any(item.key.startswith("specification.") for item in answer.evidence)


def test_slow_is_few_periods_or_none_at_all() -> None:
    swell = Oscillator(1, 0.1, 2.0 * math.pi / 8.0, 0.05)
    assert not is_slow(swell, 240.0)
    assert is_slow(swell, 40.0)
    assert is_slow(Oscillator(2, 0.1, 2.0 * math.pi / 8.0, 0.7), 240.0)


class _Asked(Exception):  # noqa: N818 (no error: the alignment need not go on)
    """What the question of an alignment of a log is asked with, of the usual motion."""


def _asked(monkeypatch: pytest.MonkeyPatch, inputs: Inputs) -> tuple:
    def remember(*given):
        raise _Asked(*given)

    with monkeypatch.context() as patched:
        patched.setattr(swaying, "slow_sway_evidence", remember)
        with pytest.raises(_Asked) as asked:
            align(inputs["record"], inputs["place"], inputs["imu"])
    return asked.value.args


def _left_by_a_bias() -> Inputs:
    inputs, _ = BENCHES["swaying"].draw(12, 6)
    spoil = next(item.apply for item in FAULTS if item.name == "accel bias step")
    spoilt, _ = spoil(inputs, np.random.default_rng([12, 6, crc32(b"swaying accel bias step")]))
    return spoilt | {"place": inputs["place"]}


@pytest.mark.parametrize("sound", some([False], [True]))
def test_what_is_left_out_changes_no_evidence(sound: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """States that nothing moves, to the same bits; a motion fitted anew to the log as it is, where nothing can come of it."""
    inputs = _moored(1, period=150.0, amplitude=0.2, duration=300.0)[0] if sound else _left_by_a_bias()
    fine, full, motion, without = _asked(monkeypatch, inputs)
    moved = slow_sway._with(fine, full(), True)
    assert moved.system.states < fine.system.states
    for cause, other in zip(slow_sway.causes(fine), slow_sway.causes(moved), strict=True):
        assert cause[:5] == other[:5]
        assert np.array_equal(cause.phi, other.phi)
        assert np.array_equal(cause.seen, other.seen)
    as_it_is = []

    def counted(seen):
        as_it_is.append(not seen.any())
        return without(seen)

    found = slow_sway.slow_sway_evidence(fine, full, motion, counted)
    assert as_it_is
    assert any(as_it_is) is not sound
    monkeypatch.setattr(slow_sway, "_is_nothing", lambda *_: False)
    assert slow_sway.slow_sway_evidence(fine, full, motion, counted) == found
    assert any(as_it_is)
    assert bool(found) is not sound


def test_departures_are_matched_two_by_two() -> None:
    rng = np.random.default_rng(1)
    K, W = 50, 3
    y, white = rng.standard_normal((K, 3, 2 * W)), rng.standard_normal((K, 3, 1))
    L = np.tril(rng.standard_normal((K, 3, 3))) + 3.0 * np.eye(3)
    energy, match = np.zeros((W, 2, 2)), np.zeros((W, 2))
    slow_sway._match_pairs(L, white, y, energy, match)
    pairs = whitened(L, y).reshape(-1, W, 2)
    assert np.allclose(energy, np.einsum("kwi,kwj->wij", pairs, pairs), rtol=1e-13)
    assert np.allclose(match, np.einsum("kwi,k->wi", pairs, white.ravel()), rtol=1e-13, atol=1e-13)
