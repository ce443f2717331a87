"""NMEA 0183: sentences of one epoch make a row; midnight passes; damage is named."""

from functools import reduce

import numpy as np
import pytest

import truenorth
from truenorth.core.errors import DataError

MIDNIGHT = 764380800.0  # of 23 March 1994, s since 1970
DAY = 86400.0


def sentence(body):
    return f"${body}*{reduce(lambda a, b: a ^ b, body.encode(), 0):02X}"


def gga(time, quality=1):
    return sentence(f"GPGGA,{time},4807.038,N,01131.000,W,{quality},08,0.9,545.4,M,46.9,M,,")


def rmc(time, status="A", speed="022.4", course="084.4", date="230394"):
    return sentence(f"GNRMC,{time},{status},4807.038,N,01131.000,W,{speed},{course},{date},003.1,W")


def zda(time, date="23,03,1994"):
    return sentence(f"GPZDA,{time},{date},00,00")


def vtg(speed, course):
    return sentence(f"GPVTG,{course},T,,M,{speed},N,{float(speed) * 1.852:.1f},K")


def read(tmp_path, lines, name="log.nmea"):
    path = tmp_path / name
    path.write_bytes("\r\n".join(lines).encode() + b"\r\n")
    return truenorth.read_gnss(path)


def test_the_example_of_the_standard(tmp_path):
    lines = [
        gga("123519.50"),
        sentence("GPGSA,A,3,04,05,,09,12,,,24,,,,,2.5,1.3,2.1"),
        rmc("123519.50"),
        gga("123520"),
        vtg("10", "180"),
    ]
    assert lines[0].endswith("*" + lines[0][-2:])
    record = read(tmp_path, lines)
    np.testing.assert_allclose(record.time - MIDNIGHT, [45319.5, 45320.0])
    np.testing.assert_allclose(np.degrees(record.lat), 48 + 7.038 / 60, rtol=1e-15)
    np.testing.assert_allclose(np.degrees(record.lon), -(11 + 31 / 60), rtol=1e-15)
    np.testing.assert_allclose(record.alt, 545.4 + 46.9)
    knot, course = 1852 / 3600, np.radians(84.4)
    np.testing.assert_allclose(record.v_n[0, :2], 22.4 * knot * np.array([np.sin(course), np.cos(course)]))
    np.testing.assert_allclose(record.v_n[1, :2], [0, -10 * knot], atol=1e-12)
    assert np.isnan(record.v_n[:, 2]).all()
    assert record.dop[0, 0] == 0.9
    assert record.quality.tolist() == [1, 1]


@pytest.mark.parametrize("leads", [False, True])
def test_headings_of_two_antennas(tmp_path, leads):
    """They have no time: an epoch's stands with its sentences, after them or, where the log begins so, before."""
    epochs = [[gga(f"12351{k}"), sentence(f"GPHDT,{10.0 * k},T")] for k in range(5)]
    epochs[2].insert(2, sentence("GPHDT,77.0,T"))  # a second one in an epoch is late
    epochs[3][1] = sentence("GPTHS,,V")
    lines = [line for epoch in epochs for line in (reversed(epoch[:2]) if leads else epoch)]
    record = read(tmp_path, lines)
    np.testing.assert_allclose(np.degrees(record.heading), [0.0, 10.0, 20.0, np.nan, 40.0])
    assert record.heading_sigma is None
    assert read(tmp_path, [gga("123519"), gga("123520")]).heading is None


def test_standing_no_fix_and_midnight(tmp_path):
    lines = [
        rmc("", "V", "", ""),
        vtg("5", "90"),  # of an epoch whose time is not known
        gga("235959", 0),
        rmc("235959", "V", "", ""),
        rmc("000000", "A", "0", ""),
        rmc("000001", "A", "1", "90"),
    ]
    record = read(tmp_path, lines)
    assert (record.time - MIDNIGHT).tolist() == [-1.0, 0.0, 1.0]  # the date is that of the fix
    assert record.has_position.tolist() == [False, True, True]
    assert record.has_velocity.tolist() == [False, True, True]
    assert record.v_n[1, :2].tolist() == [0.0, 0.0]


def test_the_content_tells_and_broken_ends_are_passed_over(tmp_path):
    lines = ["038,N,01131.000,W,1,08*00", gga("120000"), gga("120001"), gga("120002")[:40]]
    assert len(read(tmp_path, lines, "log.txt")) == 2
    assert len(read(tmp_path, [gga("120000")[:-9] + "*00", *lines[1:]], "log.txt")) == 2


def test_dates_count_from_1970_and_pass_midnight(tmp_path):
    """A sentence without a date is of the day of the dated one next to it; so after a day without any."""
    lines = [gga("235958"), rmc("235958"), gga("235959"), gga("000000"), rmc("000000", date="240394"), gga("000001")]
    after = [gga("190000"), rmc("190000", date="260394"), gga("190001")]  # the logger was off, longer than a day
    record = read(tmp_path, lines + after)
    expected = [DAY - 2, DAY - 1, DAY, DAY + 1, 3 * DAY + 68400, 3 * DAY + 68401]
    assert (record.time - MIDNIGHT).tolist() == expected
    by_zda = [zda("120000"), gga("120000"), gga("120001"), rmc("120001", "V", date="060180")]
    assert (read(tmp_path, by_zda).time - MIDNIGHT).tolist() == [43200.0, 43201.0]
    assert read(tmp_path, [gga("120000"), rmc("120001", date="")]).time.tolist() == [43200.0, 43201.0]
    assert read(tmp_path, [gga("235959"), gga("000000")]).time.tolist() == [86399.0, 86400.0]
    undated = [gga("120000"), rmc("120001", "V", date="99")]
    assert read(tmp_path, undated).time.tolist() == [43200.0, 43201.0]


def test_a_date_that_is_late_at_midnight(tmp_path):
    """Some receivers go on with the old date for a second."""
    days = ["230394"] * 6 + ["240394"] * 5
    clocks = [f"23595{k}" for k in range(5, 10)] + [f"00000{k}" for k in range(6)]
    record = read(tmp_path, [rmc(clock, date=day) for clock, day in zip(clocks, days, strict=True)])
    assert (record.time - MIDNIGHT).tolist() == [DAY - 5 + k for k in range(11)]


def test_a_log_that_a_spreadsheet_saved(tmp_path):
    """Commas behind the checksum, and no zeros in front of ``050420``: the checksum shows that they were there."""
    lines = [gga("090000") + ",,,,", rmc("090001", date="050420") + ",,", rmc("090002", date="050420") + ",,"]
    whole = read(tmp_path, lines)
    cut = [line.replace(",050420,", ",50420,").replace(",0900", ",900").replace(",01131.", ",1131.") for line in lines]
    saved = read(tmp_path, cut)
    for name in ("time", "lat", "lon"):
        np.testing.assert_array_equal(getattr(saved, name), getattr(whole, name))
    assert saved.time[0] == 1586077200.0  # 5 April 2020, 9:00
    with pytest.raises(DataError, match="line 2: checksum"):
        read(tmp_path, [cut[0], cut[1].replace("022.4", "022.5"), cut[2]])


@pytest.mark.parametrize(
    ("line", "words"),
    [
        (gga("120001").replace("545.4", "545.5"), ["line 2", "checksum", "damaged"]),
        (gga("12x001"), ["line 2, GGA: time '12x001'"]),
        (gga("250001"), ["line 2, GGA: time '250001'", "hhmmss"]),
        (
            sentence("GPGGA,120001,4807.038,X,01131.000,W,1,08,0.9,545.4,M,46.9,M,,"),
            ["line 2, GGA: lat", "'X'", "N or S"],
        ),
        (sentence("GPGGA,120001,4807.038,N"), ["line 2: 4 fields", "cut short"]),
        (rmc("120001", speed="fast"), ["line 2, RMC: speed 'fast'"]),
        (rmc("120001", course="1e490"), ["line 2, RMC: course '1e490'"]),
        (rmc("120001", date="310294"), ["line 2, RMC: date '310294'", "ddmmyy"]),
        (zda("120001", "23,x,1994"), ["line 2, ZDA: date '23/x/1994'", "day, month and year"]),
        (gga("115949"), ["line 2, column time", "goes back"]),
    ],
)
def test_damage_is_named(line, words, tmp_path):
    with pytest.raises(DataError) as caught:
        read(tmp_path, [gga("120000"), line, gga("120002")])
    for word in ("log.nmea", *words):
        assert word in str(caught.value), caught.value


def test_too_little(tmp_path):
    with pytest.raises(DataError, match=r"1 epoch\(s\)"):
        read(tmp_path, [gga("120000"), rmc("120000")])


def test_a_date_that_stands_still_over_midnight(tmp_path):
    """Some receivers take the date from their first fix; the clock goes on."""
    lines = []
    for k in range(60):
        now = (86370 + k) % 86400
        clock = f"{now // 3600:02d}{now // 60 % 60:02d}{now % 60:02d}.00"
        body = f"GPRMC,{clock},A,4806.60000,N,01130.00000,E,1.94,090.0,221126,,"
        check = 0
        for letter in body:
            check ^= ord(letter)
        lines.append(f"${body}*{check:02X}\n")
    file = tmp_path / "x.nmea"
    file.write_text("".join(lines))
    np.testing.assert_allclose(np.diff(truenorth.read_gnss(file).time), 1.0, atol=1e-6)
