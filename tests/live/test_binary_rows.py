"""Binary rows alone and between sentences, in chunks of any size: nothing is lost, and no message is made of their bytes."""

import numpy as np
import pytest

from tests.live.test_devices import epoch, in_pieces, ubx_bytes
from tests.runs import some
from truenorth.formats.layout import Layout
from truenorth.live.binary_rows import BinaryRows, binary_row
from truenorth.live.decode import Decoder
from truenorth.live.feeds import GnssFeed
from truenorth.live.listening import Listener
from truenorth.live.messages import PROTOCOLS

CHUNKS = pytest.mark.parametrize("chunk", [1, 7, 64, 4096, 1 << 20])
EPOCHS = 30


def rows_of(seed, count=100 * EPOCHS):
    random = np.random.default_rng(seed)
    time = 43200.0 + 0.01 * np.arange(count)
    return np.column_stack([time, 1e-3 * random.standard_normal((count, 3)), random.standard_normal((count, 3))])


def as_bytes(rows):
    return [binary_row(row[0], row[1:4], row[4:]) for row in rows]


def chunks(data, size):
    return (data[at : at + size] for at in range(0, len(data), size))


@CHUNKS
def test_rows_and_what_stands_between_them(chunk):
    """All of it comes back, in order; a row that is damaged is no row."""
    random = np.random.default_rng(5)
    rows = rows_of(1, 200)
    between = [random.bytes(int(random.integers(0, 40))) + b"T" * int(random.integers(0, 3)) for _ in rows]
    whole = as_bytes(rows)
    damaged = [part[:40] + bytes([part[40] ^ 1]) + part[41:] if k % 50 == 9 else part for k, part in enumerate(whole)]
    data = b"".join(x for pair in zip(between, damaged, strict=True) for x in pair)
    cut, found, rest = BinaryRows(), [], b""
    for part in chunks(data, chunk):
        new, other = cut.feed(part)
        found += new
        rest += other
    rest += cut.given_back()
    good = [k for k in range(len(rows)) if k % 50 != 9]
    assert np.array_equal(found, rows[good])
    assert rest == b"".join(b + (d if k % 50 == 9 else b"") for k, (b, d) in enumerate(zip(between, damaged)))


@CHUNKS
def test_rows_are_not_taken_for_messages_of_a_device(chunk):
    """Numbers hold the first bytes of every protocol by chance: 145 of 200 logs in reads of 64 KiB were those of a device."""
    syncs = [sync for begins, _, _ in PROTOCOLS.values() for sync in begins]
    for seed, sync in enumerate(syncs):
        rows = rows_of(seed, 50)
        data = bytearray(b"".join(as_bytes(rows)))
        value = np.frombuffer((sync + bytes(8))[:6] + b"\xf0\x3f", dtype="<f8")[0]  # a number that begins so
        rows[3, 4] = value
        data[3 * 64 : 4 * 64] = binary_row(rows[3, 0], rows[3, 1:4], rows[3, 4:])
        decoder = Decoder(Layout(), "test")
        found = np.vstack([decoder.feed(part) for part in chunks(bytes(data), chunk)])
        assert np.array_equal(found, rows), sync
        assert decoder.broken == 0


@CHUNKS
def test_damaged_rows_are_counted_whatever_the_chunks(chunk):
    """By each stretch that is no row; where another sensor shares the stream, by the rows whose check does not fit."""
    rows = rows_of(6, 300)
    parts = [
        part[:30] + bytes([part[30] ^ 1]) + part[31:] if k % 40 == 7 else part for k, part in enumerate(as_bytes(rows))
    ]
    parts[100] = b"noise" + parts[100]
    damaged = len(range(7, 300, 40))
    for others, lost in (([], damaged + 1), ([lambda data: None], damaged)):
        decoder = Decoder(Layout(), "test")
        decoder.others += others
        found = np.vstack([decoder.feed(part) for part in chunks(b"".join(parts), chunk)])
        assert len(found) == len(rows) - damaged
        assert decoder.broken == lost


@pytest.mark.parametrize("chunk", some([7, 64, 4096, 1 << 20], [1]))
def test_sentences_between_rows(chunk):
    """A byte of a row that is the end of a line or a dollar sign cost the next sentence: 10 to 20 % of the fixes."""
    rows, data = rows_of(3), b""
    for k, second in enumerate(np.split(rows, EPOCHS)):
        data += b"".join(as_bytes(second)) + b"".join(epoch(k, 43200.0 + k))
    decoder, feed = Decoder(Layout(), "test"), GnssFeed()
    listener = Listener(feed, "test", shared=True)
    decoder.others.append(listener.hear)
    found = np.vstack([decoder.feed(part) for part in chunks(data, chunk)])
    assert np.array_equal(found, rows)
    np.testing.assert_allclose(feed.rows[:, 0], 43200.0 + np.arange(EPOCHS))
    assert listener.broken == 0
    assert decoder.broken == 0


def test_text_that_ends_as_a_row_begins():
    """What waits for the rest of a row comes with the next bytes."""
    text = b"T,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z\n" + b"".join(
        b"%g,1,2,3,4,5,6\n" % (0.01 * k) for k in range(20)
    )
    decoder = Decoder(Layout(columns={"time": "T"}), "test")
    found = np.vstack(in_pieces(text, decoder.feed, longest=3))
    np.testing.assert_allclose(found[:, 0], 0.01 * np.arange(20))


@pytest.mark.slow
@pytest.mark.parametrize("first", ["rows", "a message"])
@CHUNKS
def test_messages_of_a_receiver_between_rows(chunk, first):
    """Two bytes of a row that begin a message swallowed up to 64 KiB; a message in front made the stream the receiver's."""
    fixes = [part for part in ubx_bytes(pytest.importorskip("pyubx2")) if part[2:4] == b"\x01\x07"][:EPOCHS]
    rows, parts = rows_of(4), []
    rows[150, 2] = np.frombuffer(b"\xb5\x62\x01\x07\xff\xff\xf0\x3f", dtype="<f8")[0]
    for fix, second in zip(fixes, np.split(rows, EPOCHS), strict=True):
        both = b"".join(as_bytes(second)), fix
        parts += both if first == "rows" else both[::-1]
    data = b"".join(parts)
    decoder, feed, alone = Decoder(Layout(), "test"), GnssFeed(), GnssFeed()
    listener = Listener(feed, "test", shared=True)
    decoder.others.append(listener.hear)
    found = np.vstack([decoder.feed(part) for part in chunks(data, chunk)])
    assert np.array_equal(found, rows)
    Listener(alone, "test").hear(b"".join(fixes))
    assert np.array_equal(feed.rows, alone.rows, equal_nan=True)
