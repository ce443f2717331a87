"""No stray quote loses a row in silence: it is read right, or one message says where it stands."""

import numpy as np
import pytest

from truenorth.core.errors import DataError
from truenorth.formats import read_imu
from truenorth.formats.text import open_table

HEADER = "time,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z"
ROWS = [f"{k / 100:.2f},{k}e-6,2e-6,3e-6,0.1,0.2,{9.8 + k / 1000:.3f}" for k in range(1, 61)]
NOTE = "stray quotes"


@pytest.fixture
def read(tmp_path):
    def of(lines, end="\n", last=True):
        path = tmp_path / "log.csv"
        path.write_bytes((end.join(lines) + (end if last else "")).encode())
        return read_imu(path, axes="RFU")

    return of


def changed(k, row):
    return [HEADER, *ROWS[:k], row, *ROWS[k + 1 :]]


def notes(record):
    return " ".join(guess.value for guess in record.taken_for)


def same(record, sound):
    return all(np.array_equal(getattr(record, key), getattr(sound, key)) for key in ("time", "gyro", "accel"))


def at(row, cell, how):
    cells = row.split(",")
    cells[cell] = how.format(cells[cell])
    return ",".join(cells)


@pytest.mark.parametrize("k", [0, 1, 30, len(ROWS) - 1])
@pytest.mark.parametrize("quote", ['"', "'"])
def test_a_quote_at_the_edge_of_a_number_or_a_row_is_taken_off(read, k, quote):
    """In the first row, below it, in the middle and in the last row; one quote alone would take in cells or rows."""
    sound = read([HEADER, *ROWS])
    row = ROWS[k]
    wrongs = [quote + row, " " + quote + row, row + quote, quote + row + quote]
    wrongs += [at(row, cell, how) for cell in (0, 3, 6) for how in (quote + "{}", "{}" + quote)]
    for wrong in wrongs:
        record = read(changed(k, wrong))
        assert same(record, sound), wrong
        assert quote == "'" or NOTE in notes(record)
        assert quote == "'" or f"the first in line {k + 2}" in notes(record)


@pytest.mark.parametrize("mark", [";", "\t", " "])
@pytest.mark.parametrize("k", [0, 30])
def test_whatever_stands_between_the_columns(read, mark, k):
    sound = read([HEADER, *ROWS])
    lines = [line.replace(",", mark) for line in changed(k, '"' + ROWS[k])]
    assert same(read(lines), sound)
    assert same(read(lines, end="\r\n"), sound)


def test_two_stray_quotes_do_not_take_in_the_rows_between_them(read):
    """To a reader of CSV that is one cell of 21 lines."""
    lines = changed(10, '"' + ROWS[10])
    lines[31] += '"'
    assert same(read(lines), read([HEADER, *ROWS]))
    text = [HEADER + ",remark", *(row + ",ok" for row in ROWS)]
    text[11], text[31] = ROWS[10] + ',"ok', ROWS[30] + ',ok"'
    assert same(read(text), read([HEADER, *ROWS]))


def test_a_stray_quote_in_the_header(read):
    sound = read([HEADER, *ROWS])
    for header in (
        '"' + HEADER,
        HEADER + '"',
        HEADER.replace("gyro_y", '"gyro_y'),
        HEADER.replace("gyro_y", 'gyro_y"'),
    ):
        assert same(read([header, *ROWS]), sound), header


def test_rows_and_cells_in_quotes_stay_what_they_are(read):
    sound = read([HEADER, *ROWS])
    for quote in "\"'":
        record = read([HEADER, *(",".join(f"{quote}{cell}{quote}" for cell in row.split(",")) for row in ROWS)])
        assert same(record, sound)
        assert NOTE not in notes(record)


@pytest.mark.parametrize("quote", "\"'")
@pytest.mark.parametrize("mark", [",", ";", "\t"])
@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_rows_that_stand_in_quotes_as_one_cell(read, quote, mark, end):
    """Double ones were refused: no line of numbers."""
    lines = [f"{quote}{line.replace(',', mark)}{quote}" for line in (HEADER, *ROWS)]
    sound = read([HEADER, *ROWS])
    assert same(read(lines, end), sound)
    assert same(read([HEADER.replace(",", mark), *lines[1:]], end), sound)
    assert len(read([*lines[:-1], lines[-1][:20]], end, last=False)) == len(ROWS) - 1


def test_rows_of_which_one_stands_in_quotes_are_left_to_the_rules_of_stray_ones(read):
    assert same(read(changed(30, f'"{ROWS[30]}"')), read([HEADER, *ROWS]))


def test_a_quoted_cell_may_hold_separators_and_line_ends(read):
    lines = [HEADER + ",remark", *(row + ',"calm, warm"' for row in ROWS)]
    record = read(lines)
    assert same(record, read([HEADER, *ROWS]))
    assert NOTE not in notes(record)
    lines[20] = ROWS[19] + ',"calm,\nand ""warm"""'
    assert same(read(lines), record)


def test_quotes_that_are_part_of_a_text_stay(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("\n".join([HEADER + ",place", *(row + ",59 26' 14.5\"N" for row in ROWS)]) + "\n")
    table = open_table(path)
    assert table.notes == ()
    assert table.column("place").to_pylist() == ["59 26' 14.5\"N"] * len(ROWS)


@pytest.mark.parametrize("quote", ['"', "'"])
def test_what_cannot_be_read_is_one_message_with_its_place(read, quote):
    for wrong, place in (
        (at(ROWS[30], 3, f"0.0{quote}1"), "column gyro_z"),
        (at(ROWS[30], 3, quote), "column 4" if quote == '"' else "column gyro_z"),
        (quote + "\n" + ROWS[30], "column 1" if quote == '"' else "1 columns"),
    ):
        with pytest.raises(DataError) as caught:
            read(changed(30, wrong))
        assert "log.csv: line 32" in str(caught.value)
        assert place in str(caught.value)


def test_a_remark_with_a_quote_holds_no_rows(read):
    assert same(read([HEADER, *ROWS[:30], '# "started anew', *ROWS[30:]]), read([HEADER, *ROWS]))


def test_a_last_row_cut_inside_a_quoted_cell_is_cut(read):
    quoted = [",".join(f'"{cell}"' for cell in row.split(",")) for row in ROWS]
    record = read([HEADER, *quoted[:-1], quoted[-1][:14]], last=False)
    assert len(record.time) == len(ROWS) - 1
    assert "cut, left out" in notes(record)


def test_a_first_row_that_is_no_whole_row_is_counted(read):
    """It stands where units and remarks may stand, and went with them."""
    record = read([HEADER, "0.01,1e-6", *ROWS[1:]])
    assert len(record.time) == len(ROWS) - 1
    assert "no whole row left out: 1, the first is line 2" in notes(record)


def said(k, end, mark=","):
    """A row next to what a device said in it, whose own line end stands in the cell."""
    return mark.join([ROWS[k].replace(",", mark), f'"$VNYMR,+0{k}.1,-2.5*63{end}"'])


@pytest.mark.parametrize(("end", "mark"), [("\r\n", ","), ("\n", ","), ("\r\n", ";"), ("\r\n", "\t")])
def test_a_line_end_inside_a_quoted_cell_is_no_end_of_a_row(read, end, mark):
    """A script writes the line that a VectorNav sent next to its numbers, with the line end that the device sends."""
    record = read([HEADER.replace(",", mark) + f"{mark}raw", *(said(k, end, mark) for k in range(len(ROWS)))])
    assert same(record, read([HEADER, *ROWS]))
    assert f"rows with line ends in quoted cells: {len(ROWS)}" in notes(record)


def test_lines_keep_their_numbers_where_quoted_cells_end_with_a_line(read):
    lines = [said(k, "\n") for k in range(len(ROWS))]
    lines[9] = lines[9].replace(ROWS[9].split(",")[6], "X9.8", 1)
    with pytest.raises(DataError, match=f"line {2 + 2 * 9}, column"):
        read([HEADER + ",raw", *lines])


def test_an_open_quote_is_no_cell_that_ends_with_a_line(read):
    """The next line's quote belongs to another cell: nothing is joined, and the row is mended as before."""
    record = read(changed(9, at(ROWS[9], 6, '"{}')))
    assert same(record, read([HEADER, *ROWS]))
    assert NOTE in notes(record)
