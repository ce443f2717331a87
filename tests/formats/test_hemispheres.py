"""Latitude and longitude without a sign, and the half of the earth in a column of its own."""

import numpy as np
import pytest

from truenorth.core.errors import DataError
from truenorth.formats import read_gnss

HEADS = ("INDEX,Time Stamp,LATITUDE,N/S,LONGITUDE,E/W,HEIGHT", "index,time,lat,lat_dir,long,long_dir,alt",
         "n,t,Latitude,NS,Longitude,EW,Altitude")  # fmt: skip


def write(path, head, south, west, lat=33.85):
    rows = [f"{k},{k}.0,{lat + 1e-6 * k:.7f},{south},151.2000000,{west},20.0" for k in range(20)]
    path.write_text("\n".join([head, *rows]) + "\n")
    return path


@pytest.mark.parametrize("head", HEADS)
@pytest.mark.parametrize(("south", "west"), [("N", "E"), ("S", "E"), ("s", " W"), ("N", "W")])
def test_south_and_west_are_negative(tmp_path, head, south, west):
    record = read_gnss(write(tmp_path / "log.csv", head, south, west))
    sign = -1.0 if south in "sS" else 1.0
    np.testing.assert_allclose(np.degrees(record.lat), sign * (33.85 + 1e-6 * np.arange(20)), atol=1e-9)
    np.testing.assert_allclose(np.degrees(record.lon), -151.2 if "W" in west else 151.2, atol=1e-9)


def test_a_sign_that_is_there_stays(tmp_path):
    record = read_gnss(write(tmp_path / "log.csv", HEADS[0], "S", "E", lat=-33.85))
    assert np.all(record.lat < 0.0)


def test_another_letter_is_named(tmp_path):
    with pytest.raises(DataError, match=r"line 2, column N/S: 'X'; expected N or S"):
        read_gnss(write(tmp_path / "log.csv", HEADS[0], "X", "E"))


def test_a_column_of_numbers_is_no_half(tmp_path):
    record = read_gnss(write(tmp_path / "log.csv", HEADS[2], "3", "4"))
    assert np.all(record.lat > 0.0)


def test_a_letter_against_a_sign_is_refused(tmp_path):
    """The letter won without a word: a log of Sydney with N in that column lay in the north."""
    with pytest.raises(
        DataError, match=r"line 2, column N/S: N, of a negative number; expected a number without a sign"
    ):
        read_gnss(write(tmp_path / "log.csv", HEADS[0], "N", "E", lat=-33.85))
