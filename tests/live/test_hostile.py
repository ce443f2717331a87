"""Rows that cannot be, from bytes and from aiding sensors: each is counted and named, and the answer is that of the sound rows."""

import numpy as np
import pytest

import truenorth as tn
from truenorth.formats import write_imu
from truenorth.formats.layout import Layout
from truenorth.live import Aligner, GnssFeed, OdometerFeed
from truenorth.live.decode import Decoder
from truenorth.records.specs import imu_spec
from truenorth.simulation import rest, simulate
from truenorth.simulation.scenario import read_scenario

PLACE = tn.Position.from_degrees(45.0, 10.0)


@pytest.mark.parametrize("chunk", [17, 5000])
def test_a_stream_of_lines_with_all_that_can_go_wrong(chunk, tmp_path):
    """NaN, infinite, huge, repeated, late, of another clock, half a line, rubbish, bytes that are no text."""
    record = simulate(rest(PLACE, 0.7), rate=25.0, duration=40.0, imu=imu_spec("navigation"), seed=2).record
    write_imu(record, tmp_path / "log.csv")
    header, *lines = (tmp_path / "log.csv").read_bytes().splitlines(keepends=True)
    hostile, unreadable = [header], 0
    for number, line in enumerate(lines):
        time, *rest_of = line.split(b",")
        bad = {
            40: b",".join([time, b"nan", *rest_of[1:]]),
            80: b",".join([time, b"1e400", *rest_of[1:]]),
            120: b",".join([b"inf", *rest_of]),
            160: b",".join([time, b"1e30", *rest_of[1:]]),
            200: lines[199],
            240: lines[100],
            280: b",".join([b"1700000000.5", *rest_of]),
            320: line[: len(line) // 2] + b"\n",
            360: b"boot: ready, v1.2\n",
            400: b"\xff\x00\x81" + line,
            440: b"1,2,3,4,5,6,7,8,9\n",
        }.get(number % 480)
        if bad is not None:
            hostile.append(bad)
            unreadable += number % 480 >= 320
        hostile.append(line)
    data, decoder = b"".join(hostile), Decoder(Layout(), "test")
    with Aligner(PLACE, "navigation", kind=record.kind) as aligner:
        for at in range(0, len(data), chunk):
            rows = decoder.feed(data[at : at + chunk])
            aligner.push(rows[:, 0], rows[:, 1:4], rows[:, 4:])
        found, answer = aligner.finish(), aligner.answer
    assert np.array_equal(found.C_nb, tn.align(record, PLACE, "navigation").C_nb)
    assert decoder.broken == unreadable
    counts = aligner.intake.counts
    assert counts.taken == len(record)
    assert counts.taken + counts.left_out == len(hostile) - 1 - unreadable
    named = " ".join(answer.reasons)
    for words in ("not finite", "too large", "repeated", "other clock"):
        assert words in named, (words, answer.reasons)


@pytest.fixture(scope="module")
def van():
    content = read_scenario("van").to_mapping() | {"duration": "70 s", "imu": "tactical", "rate": "25 Hz"}
    content["gnss"] = {"rate": "2 Hz", "position_noise": "0.5 m", "velocity_noise": "0.05 m/s"}
    scenario = read_scenario(content)
    return scenario.simulate(seed=2).record, scenario.simulate_aiding(seed=2)


@pytest.mark.slow
def test_rows_of_aiding_sensors_that_cannot_be_are_left_out(van):
    record, aiding = van
    fixes, wheel = aiding["gnss"].record, aiding["odometer"].record
    feeds = [GnssFeed(), OdometerFeed(wheel.kind, wheel.pulse_size)]
    aids = [tn.Gnss(fixes), tn.Odometer(wheel)]
    bad = 0
    with Aligner(None, "tactical", aid=feeds, kind=record.kind) as aligner:
        for feed, aid in zip(feeds, aids, strict=True):
            rows = feed.rows_of(aid.record)
            rows = rows[rows[:, 0] <= record.time[-1]]
            for number, row in enumerate(rows):
                for at, column, value in (
                    (20, 1, 1e200),
                    (40, 1, np.inf),
                    (60, 0, np.nan),
                    (80, 0, 1.7e9),
                    (100, 0, -1e9),
                ):
                    if number % 140 == at:
                        worse = row.copy()
                        worse[column] = value
                        if at == 40:
                            worse[1:] = np.inf
                        feed.add(worse[None])
                        bad += 1
                feed.add(row[None])
                if number % 140 == 120:
                    feed.add(row[None])
                    bad += 1
        aligner.push(record.time, record.gyro, record.accel)
        found, answer = aligner.finish(), aligner.answer
    cut = [type(aid)(aid.record.between(None, record.time[-1] + 1e-9)) for aid in aids]
    whole = tn.align(record, None, "tactical", aid=cut)
    assert np.array_equal(found.C_nb, whole.C_nb)
    assert sum(feed.left_out for feed in feeds) == bad
    assert any("gnss" in reason and "left out" in reason for reason in answer.reasons)
