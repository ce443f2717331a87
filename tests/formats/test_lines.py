"""The lines of a text's head, divided without dividing all of it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from truenorth.formats import text


@pytest.mark.parametrize("longest", [3, 7, 1 << 22])
def test_lines_are_divided_as_python_divides_them(longest: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(text, "LONGEST_HEAD", longest)
    rng = np.random.default_rng(longest)
    for _ in range(2000):
        whole = bytes(rng.choice(list(b"a1,\r\n\n \x0b\x0c\x85"), size=rng.integers(14)).tolist())
        wanted, found = whole[:longest].splitlines(), [line[1] for line in text._lines(whole)]
        assert found in (wanted, [*wanted, b""])
        kept = whole[:longest].splitlines(keepends=True)
        assert [line[0] for line in text._lines(whole)][: len(kept)] == kept


@pytest.mark.parametrize("longest", [1, 3, 8, 1 << 16])
def test_the_end_of_a_text_is_where_its_copy_without_blanks_ends(longest: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(text, "LONGEST_LINE", longest)
    rng = np.random.default_rng(longest)
    for _ in range(2000):
        whole = bytes(rng.choice(list(b"a1 \r\n\t"), size=rng.integers(14)).tolist())
        assert text._end_of(whole, b" \t\r\n") == len(whole.rstrip(b" \t\r\n"))


ROW = b"0.%02d,1.0,2.0,3.0,4.0,5.0,9.8%s"


@pytest.mark.parametrize(
    ("end", "remark"),
    [(b"\n", b""), (b"\r\n", b""), (b"\r", b""), (b"\n", b"# a cable\n"), (b"\r\n", b"# a cable\r\n")],
)
@pytest.mark.parametrize("behind", [b"", b"\n" * 70_000])
def test_rows_are_read_alike_whatever_stands_between_and_behind_them(
    tmp_path: Path, end: bytes, remark: bytes, behind: bytes
) -> None:
    """With or without a copy of the text, a remark among the rows, and a last line that is cut."""
    rows = [ROW % (k, end) for k in range(1, 41)]
    head = b"time,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z" + end
    path = tmp_path / "log.csv"
    for last in (b"", b"0.41,1.0,2."):
        path.write_bytes(head + b"".join(rows[:20]) + remark + b"".join(rows[20:]) + last + behind)
        record = text.open_table(path)
        table = record.read(record.names)
        assert table.shape == (40, 7)
        assert np.array_equal(table[:, 0], np.arange(1, 41) / 100.0)
        assert bool(record.notes) == bool(last)
