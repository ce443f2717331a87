"""A slow sway, and what looks like it: a base that leaves, a bias that steps; each by a log of which the truth is known."""

import math
from zlib import crc32

import numpy as np
import pytest

from tests.runs import some
from truenorth.alignment import align
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


@pytest.mark.parametrize("seed", [1, *some([], [2, 3])])
def test_a_base_that_goes_slowly_to_and_fro_is_aligned_within_its_sigma(seed: int) -> None:
    inputs, truth = _moored(seed, period=70.0, amplitude=0.1, duration=600.0)
    answer = align(inputs["record"], inputs["place"], inputs["imu"])
    assert answer.status == "aligned", answer.reasons
    assert max(float(np.abs(x).max()) for x in misses(answer, truth).values()) < 4.0


def test_a_sway_that_is_not_slow_is_not_looked_at_again() -> None:
    inputs, _ = BENCHES["swaying"].draw(3, 0)
    answer = align(inputs["record"], inputs["place"], inputs["imu"])
    assert not any(item.key == "sway.slow" for item in answer.evidence)


@pytest.mark.parametrize(
    ("fault", "run"),
    some([("accel bias step", 6)], [("base leaves slowly", 4), ("specification ten times too good", 6)]),
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
    assert not any(item.key.startswith("specification.") for item in answer.evidence)


@pytest.mark.parametrize("seed", [6, *some([], [7, 8, 9])])
def test_nor_are_they_where_a_ship_at_her_moorings_goes_in_many_tones(seed: int) -> None:
    """Above the sway they look white, and are as quiet as specified: what is slow and louder is a motion."""
    inputs, _ = _moored(seed, period=80.0, amplitude=0.3, duration=240.0, tones_each=6)
    answer = align(inputs["record"], inputs["place"], inputs["imu"])
    assert not any(item.key.startswith("specification.") for item in answer.evidence)


def test_slow_is_few_periods_or_none_at_all() -> None:
    swell = Oscillator(1, 0.1, 2.0 * math.pi / 8.0, 0.05)
    assert not is_slow(swell, 240.0)
    assert is_slow(swell, 40.0)
    assert is_slow(Oscillator(2, 0.1, 2.0 * math.pi / 8.0, 0.7), 240.0)
