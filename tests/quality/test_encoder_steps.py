"""The resolution of an encoder is read from its angles, and what rounds an axis at rest is in sigma; fine ones are left alone."""

import numpy as np
import pytest

from tests.alignment.test_encoder_angles import turned as on_a_body
from truenorth.alignment.encoder_angles import carried_angles
from truenorth.campaign.fault_benches import BENCHES
from truenorth.quality.encoder_jumps import jump_evidence
from truenorth.quality.encoder_steps import ROUNDED, resolution
from truenorth.records import EncoderRecord


def positions(rng, time, onset):
    """An axis that goes from position to position; within an `onset` (s) it reaches its rate."""
    dwell, rate = rng.uniform(20.0, 60.0), np.radians(rng.uniform(3.0, 15.0))
    goes = np.clip((time % (2.0 * dwell) - dwell) / onset, 0.0, 1.0) * np.where(
        time % (4.0 * dwell) < 2.0 * dwell, 1.0, -1.0
    )
    return rng.uniform(0.0, 6.0) + np.cumsum(rate * goes) * (time[1] - time[0])


def sway(rng, time):
    return rng.uniform(0.0, 0.1) * np.sin(2.0 * np.pi * time / rng.uniform(5.0, 9.0))


@pytest.mark.parametrize("rows", [5.0, 10.0, 50.0])
@pytest.mark.parametrize("step", [0.02, 0.0879, 0.35])
def test_the_steps_of_positions_are_found(rows, step):
    """Written in full, and in thousandths of a degree: a whole number of them at most."""
    for run in range(4):
        rng = np.random.default_rng([run, round(rows), round(1e4 * step)])
        time = np.arange(0.0, 300.0, 1.0 / rows)
        own = positions(rng, time, 0.5)
        q = np.radians(step)
        counts = q * np.round(own / q)
        written = np.radians(np.round(np.degrees(counts), 3))
        for angles in (counts, written):
            (found,) = resolution(angles[:, None], (angles - own + sway(rng, time))[:, None])
            assert 0.85 * q < found < 6.0 * q


def test_no_steps_are_found_in_angles_that_have_none():
    """Of positions, with and without an onset; of an axis that spins; of one that never turns."""
    for run in range(6):
        rng = np.random.default_rng([run, 2])
        time = np.arange(0.0, 300.0, 0.1)
        spins = np.radians(rng.uniform(2.0, 18.0)) * time
        for own in (positions(rng, time, 0.5), positions(rng, time, 1e-9), spins, np.zeros_like(time)):
            assert resolution(own[:, None], sway(rng, time)[:, None]) == [0.0]
            noisy = own + 1e-4 * rng.standard_normal(len(time))
            assert resolution(noisy[:, None], (noisy - own)[:, None]) == [0.0]


def test_what_rounds_an_axis_at_rest_is_in_sigma():
    """Zeros anywhere within a step; the last row of the log stands still. Sigma was 5 and more times too small."""
    q, ratios = np.radians(0.35), []
    for run in range(12):
        _, record, encoder = on_a_body("zx", 0.02, 5700)
        zero = np.random.default_rng(run).uniform(0.0, q, 2)
        rounded = q * np.round((encoder.angles + zero) / q) - zero
        carried = carried_angles(
            EncoderRecord(encoder.time, rounded + zero), record.between(None, encoder.time[-1]), "zx"
        )
        end = float(encoder.time[-1])
        assert carried.sigma(end) == pytest.approx(ROUNDED * q, rel=0.2)
        ratios.append((rounded[-1] - encoder.angles[-1]) / carried.sigma(end))
    assert 0.6 < np.sqrt(np.mean(np.square(ratios))) < 1.4  # 24 errors: by chance beyond in less than 1e-3


def test_a_count_of_a_coarse_encoder_is_no_slip():
    """An axis that turns by nearly a step from row to row counts two now and then: 38 jumps of a sound log were found."""
    time = np.arange(0.0, 480.0, 0.02)
    q = np.radians(0.2036)
    own = np.cumsum(np.where(time % 100.0 > 94.0, np.radians(9.75), 0.0))[:, None] * 0.02
    base = (
        0.1 * np.sin(2.0 * np.pi * time / 7.0)[:, None]
    )  # faster than a twentieth of the axis: it seems to turn all along
    x = q * np.round(own / q)
    steps = resolution(x, x - own - base)
    assert steps == pytest.approx([q])
    assert len(jump_evidence(time, own + base, x - own - base)) > 10
    assert jump_evidence(time, own + base, x - own - base, steps) == []
    x[6000:] += 10.0 * q
    (found,) = jump_evidence(time, own + base, x - own - base, steps)
    assert found.figures["size"] == pytest.approx(10.0 * q, rel=0.3)


def test_an_indexer_that_spins_with_a_fine_encoder_keeps_its_sigma():
    """Noise of its rows, which turn, has the steps of one second of arc in it."""
    inputs, _ = BENCHES["rotary"].draw(5, 0)
    carried = carried_angles(inputs["encoder"], inputs["record"], ("z", "x"))
    end = float(inputs["encoder"].time[-1])
    assert carried.sigma(end) < 2.0 * max(carried.noise, ROUNDED * np.radians(1.0) / 3600.0)


@pytest.mark.parametrize("rows", [2, 4, 5, 8, 10])
def test_few_rows_show_no_step(rows):
    """An encoder's log of ten rows ended in an error of NumPy."""
    angles = 0.1 * np.arange(rows)[:, None]
    assert resolution(angles, np.zeros((rows, 1))) == [0.0]
