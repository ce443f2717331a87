"""Rows of aiding logs out of order: put in order within a bound and counted, refused beyond it by their line."""

import numpy as np
import pytest

import truenorth
from tests.formats.test_aiding import CASES, RECORDS, N, log
from tests.formats.test_nmea import MIDNIGHT, gga, read, rmc
from truenorth.core.errors import DataError
from truenorth.formats import write_record
from truenorth.formats.order import LONGEST_LATE
from truenorth.records import Late

# Late are rows 0, 11, 10 and, six rows of 1/3 s each, 20.
SHUFFLED = np.r_[1, 0, 2:10, 12, 11, 10, 13:20, 21:27, 20, 27:N]


@pytest.mark.parametrize(("kind", "number"), CASES)
def test_shuffled_rows_make_the_record_of_the_sorted_ones(kind, number, tmp_path):
    assert sorted(SHUFFLED) == list(range(N))
    write_record(RECORDS[kind][number], tmp_path / "sorted.csv")
    header, *rows = (tmp_path / "sorted.csv").read_text().splitlines()
    path = log(tmp_path, "\n".join([header, *(rows[i] for i in SHUFFLED)]) + "\n", "shuffled.csv")
    reader = getattr(truenorth, f"read_{kind}")
    right, found = reader(tmp_path / "sorted.csv"), reader(path)
    for name in ("time", *right.groups()):
        np.testing.assert_array_equal(getattr(found, name), getattr(right, name))
    assert right.late == Late(0, 0.0)
    assert right.notes == ()
    assert found.late == Late(4, pytest.approx(2.0))
    assert found.notes == ("shuffled.csv: 4 rows stood after rows of later times, by up to 2 s: put in order",)
    assert found.shifted(5.0).late == found.between(found.time[2], None).late == found.late


def test_counters_and_turns_are_counted_on_in_order(tmp_path):
    path = log(tmp_path, "time,distance_total\n1,10\n3,31\n2,20\n4,40\n")
    record = truenorth.read_odometer(path)
    assert (record.time.tolist(), record.values.tolist()) == ([2.0, 3.0, 4.0], [10.0, 11.0, 9.0])
    path = log(tmp_path, "time,angle_1\n1,340\n4,10\n3,355\n2,350\n")
    np.testing.assert_allclose(np.degrees(truenorth.read_encoder(path).angles), [340, 350, 355, 370])


@pytest.mark.parametrize(
    ("times", "words"),
    [
        ((100.0, 103.0, 100.0), ["line 4, column t", "time repeats (100, then 100)"]),
        (
            (100.0, 120.0, 121.0, 109.0),
            ["line 5, column t", "(121, then 109), by 12 s", "late by 10 s at most", "split it"],
        ),
    ],
)
def test_what_cannot_be_put_in_order_is_refused_by_its_line(times, words, tmp_path):
    path = log(tmp_path, "t,alt\n" + "".join(f"{t},1\n" for t in times))
    with pytest.raises(DataError) as caught:
        truenorth.read_height(path)
    for word in ("log.csv", *words):
        assert word in str(caught.value), caught.value
    assert LONGEST_LATE == 10.0


def test_the_place_of_a_fault_is_that_in_the_file(tmp_path):
    with pytest.raises(DataError, match="line 2, column alt: nan"):
        truenorth.read_height(log(tmp_path, "time,alt\n3,\n2,5\n1,6\n"))


def test_nmea_over_midnight(tmp_path):
    record = read(tmp_path, [gga("235957"), rmc("000001"), gga("235959"), rmc("000000"), gga("000002")])
    assert (record.time - MIDNIGHT).tolist() == [-3.0, -1.0, 0.0, 1.0, 2.0]
    assert record.has_velocity.tolist() == [False, False, True, True, False]
    assert record.late == Late(2, 2.0)
    with pytest.raises(DataError, match=r"line 2, column time: time goes back \(43200, then 43189\), by 11 s"):
        read(tmp_path, [gga("120000"), gga("115949"), gga("120002")])
