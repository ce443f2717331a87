"""Single rows to one side: errors that move a mean; knocks, pulses of a counter and noise, which do not."""

import numpy as np
import pytest

from truenorth.campaign.faults import run_faults
from truenorth.quality.spikes import one_sided

INTERVAL, ROWS = 0.02, 12_000
TIME = INTERVAL * np.arange(ROWS)
SEEDS = range(20)


def noise(rng):
    return rng.standard_normal(ROWS)


def sway(rng):
    return 3000.0 * np.sin(2.0 * np.pi * TIME / rng.uniform(5.0, 9.0) + rng.uniform(0.0, 6.0))


def places(rng, count=150):
    return rng.choice(np.arange(100, ROWS - 100), count, replace=False)


def ringing(rng, at, size):
    """What a base on springs answers to a push of one row: its velocity comes back to nothing."""
    since = INTERVAL * np.arange(1, 200)
    answer = np.exp(-since / 0.15)
    answer *= -1.0 / answer.sum()
    values = np.zeros(ROWS)
    for k in at:
        values[k] += size
        rest = answer[: ROWS - k - 1]
        values[k + 1 : k + 1 + len(rest)] += size * rest
    return values


@pytest.mark.parametrize("size", [9.0, 60.0])
@pytest.mark.parametrize("base", [lambda rng: 0.0, sway])
def test_errors_to_one_side_move_the_mean_by_what_is_said(base, size):
    for seed in SEEDS:
        rng = np.random.default_rng([1, seed])
        values = noise(rng) + base(rng)
        at = places(rng)
        values[at] += size
        count, mean = one_sided(values, INTERVAL)
        assert count == pytest.approx(len(at), rel=0.3)
        assert mean == pytest.approx(size * len(at) / ROWS, rel=0.3)


def test_knocks_after_which_the_base_is_at_rest_again_are_none():
    for seed in SEEDS:
        rng = np.random.default_rng([2, seed])
        assert one_sided(noise(rng) + ringing(rng, places(rng, 40), 60.0), INTERVAL) == (0, 0.0)


def test_pulses_of_a_counter_are_none():
    """Counts of a rate of a fiftieth of a step, with noise of a hundredth of one, turned a little by a calibration."""
    for seed in SEEDS:
        rng = np.random.default_rng([3, seed])
        whole = np.cumsum(rng.uniform(0.01, 0.05) + 0.05 * rng.standard_normal(ROWS))
        pulses = np.diff(np.round(whole), prepend=0.0)
        assert one_sided(pulses + 0.01 * rng.standard_normal(ROWS), INTERVAL) == (0, 0.0)


def test_noise_and_spikes_to_both_sides_are_none():
    for seed in SEEDS:
        rng = np.random.default_rng([4, seed])
        values = noise(rng) + sway(rng) * rng.integers(2)
        assert one_sided(values, INTERVAL) == (0, 0.0)
        at = places(rng)
        values[at] += 9.0 * np.where(np.arange(len(at)) % 2, 1.0, -1.0)
        assert one_sided(values, INTERVAL) == (0, 0.0)
    assert one_sided(np.zeros(10), INTERVAL) == (0, 0.0)


@pytest.mark.slow
@pytest.mark.parametrize("procedure", ["still", "swaying", "rotary"])
def test_none_passes_in_silence(procedure):
    assert [t for t in run_faults([procedure], ["spikes"], runs=12, seed=13) if t.outcome == "silent"] == []
