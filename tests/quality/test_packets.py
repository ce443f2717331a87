"""Packets of rows that have changed places: how long they are, and no log without them has any."""

from dataclasses import replace

import numpy as np
import pytest

from tests import recordings
from truenorth.campaign.fault_benches import BENCHES
from truenorth.quality.packets import exchanged_packets
from truenorth.quality.record_evidence import sampling_evidence

SEED = 9400


def columns(record):
    return np.ascontiguousarray(np.hstack([record.gyro, record.accel]).T)


def exchanged(record, length, share, seed=3):
    """The record with a share of its packets in each other's place, stamped as they arrive; and their first rows."""
    rng, order, first = np.random.default_rng(seed), np.arange(len(record)), []
    for k in range(0, len(record) - 2 * length, 2 * length):
        if rng.random() < share:
            order[k : k + 2 * length] = np.roll(order[k : k + 2 * length], length)
            first.append(k)
    return replace(record, gyro=record.gyro[order], accel=record.accel[order]), first


@pytest.mark.parametrize("procedure", ["rotary", "swaying"])
@pytest.mark.parametrize("length", [1, 4, 11])
def test_their_length_and_where_they_are(procedure, length):
    inputs, _ = BENCHES[procedure].draw(SEED, length)
    spoilt, first = exchanged(inputs["record"], length, 0.1)
    found = exchanged_packets(columns(spoilt))
    assert found.length == length
    assert np.isin(found.rows, first).mean() > 0.9
    assert len(found.rows) > 0.3 * len(first)


@pytest.mark.slow
@pytest.mark.parametrize("procedure", BENCHES)
def test_sound_logs_have_none(procedure):
    for run in range(3):
        assert exchanged_packets(columns(BENCHES[procedure].draw(SEED, run)[0]["record"])) is None


@pytest.mark.parametrize("name", ["rlg_vehicle_xian", "fog_gps_xian", "stim300_cart_chicago", "car_mems_odo_gnss"])
def test_recordings_have_none(name):
    """Engines, roads and footsteps jump as well; no exchange makes them smooth."""
    assert exchanged_packets(columns(getattr(recordings, name)()[0])) is None


def test_shocks_and_noise_are_no_exchange():
    rng = np.random.default_rng(1)
    data = rng.standard_normal((6, 20_000))
    assert exchanged_packets(data) is None
    rows = rng.choice(19_990, 800, replace=False)
    for k in range(8):
        data[:, rows + k] += 50.0 * rng.standard_normal((6, 800))
    assert exchanged_packets(data) is None
    assert exchanged_packets(data[:, :30]) is None
    assert exchanged_packets(0.0 * data) is None


@pytest.mark.slow
@pytest.mark.usefixtures("without_gyro_matrix")
def test_the_indexer_that_passed_in_silence():
    """Seed 8203: a tenth of packets of 4 rows, 3.02 sigmas off, `aligned`."""
    bench = BENCHES["rotary"]
    inputs, _ = bench.draw(8203, 0)
    spoilt, _ = exchanged(inputs["record"], 4, 0.13)
    answer = bench.align(inputs | {"record": spoilt})
    assert answer.status == "inconsistent"
    assert "record.reordered_rows" in [item.key for item in answer.evidence]


def test_few_are_a_warning_and_a_base_that_does_not_turn_is_not_spoilt():
    inputs, _ = BENCHES["rotary"].draw(SEED, 0)
    few, _ = exchanged(inputs["record"], 4, 0.005)
    (item,) = sampling_evidence(few, turns=True)
    assert (item.key, item.kind) == ("record.reordered_rows", "note")
    many, _ = exchanged(inputs["record"], 4, 0.2)
    assert [item.kind for item in sampling_evidence(many, turns=True)] == ["unknown"]
    assert [item.kind for item in sampling_evidence(many, turns=False)] == ["note"]
