"""A zip archive with one text file for each sensor, as phones export it: read as its folder is."""

import zipfile

import numpy as np
import pytest

from tests.formats.test_sensor_folder import TIME, phone, tilted, write
from truenorth.core.errors import DataError
from truenorth.formats import content, read_gnss, read_imu, zipped

PLACE = "latitude,longitude,altitude,speed,bearing,horizontalAccuracy,verticalAccuracy"


@pytest.fixture
def folder(tmp_path):
    gyro, accel = tilted(TIME)
    made = tmp_path / "recording"
    phone(made / "Gyroscope.csv", TIME, gyro)
    phone(made / "TotalAcceleration.csv", TIME, accel)
    seconds = TIME[::100]
    stamps = np.round(seconds * 1e9).astype(np.int64).tolist()
    rows = [(48.0 + 1e-5 * k, 11.0, 500.0, 1.1, 0.0, 5.0, 8.0) for k in range(len(seconds))]
    write(made / "Location.csv", "time," + PLACE, stamps, *zip(*rows))
    return made


def packed(folder, below="", more=None):
    path = folder.parent / "walk.zip"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for file in sorted(folder.iterdir()):
            archive.write(file, f"{below}{file.name}")
        for name, text in (more or {}).items():
            archive.writestr(name, text)
    return path


@pytest.mark.parametrize("below", ["", "2026-11-27/"])
def test_it_is_read_as_its_folder(folder, below):
    path = packed(folder, below, {"meta/device.csv": "property,value\n", "__MACOSX/._Gyroscope.csv": "x"})
    of_zip, of_folder = read_imu(path), read_imu(folder)
    for name in ("time", "gyro", "accel"):
        np.testing.assert_array_equal(getattr(of_zip, name), getattr(of_folder, name))
    assert "walk.zip" in of_zip.source
    there, here = read_gnss(path), read_gnss(folder)
    assert len(there.time) == 30
    np.testing.assert_array_equal(there.lat, here.lat)
    np.testing.assert_array_equal(here.lat, read_gnss(folder / "Location.csv").lat)


def test_a_single_log_is_read_as_it_is(folder):
    (gyro, accel), one = tilted(TIME), folder.parent / "one"
    write(
        one / "log.csv",
        "time,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z",
        TIME.tolist(),
        *gyro.T.tolist(),
        *accel.T.tolist(),
    )
    np.testing.assert_array_equal(read_imu(packed(one)).gyro, read_imu(one / "log.csv").gyro)


def test_what_is_beside_the_archive_says_how_it_is_read(folder):
    path = packed(folder)
    path.with_suffix(".yaml").write_text("axes: FRD\n")
    (folder.parent / "recording.yaml").write_text("axes: FRD\n")
    np.testing.assert_array_equal(read_imu(path).gyro, read_imu(folder).gyro)


@pytest.mark.parametrize("what", ["no log", "damaged", "cut", "locked", "too large"])
def test_what_cannot_be_read_is_one_message(folder, what, monkeypatch):
    path, said = packed(folder), "damaged"
    whole = path.read_bytes()
    if what == "no log":
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("xl/workbook.xml", "<workbook/>")
        said = "a zip archive without one log in it"
    elif what == "damaged":
        middle = len(whole) // 4
        path.write_bytes(whole[:middle] + bytes(64) + whole[middle + 64 :])
    elif what == "cut":
        path.write_bytes(whole[: len(whole) // 2])
    elif what == "locked":
        at = whole.index(b"PK\x01\x02") + 8
        path.write_bytes(whole[:at] + b"\x01" + whole[at + 1 :])
        said = "locked by a password"
    else:
        monkeypatch.setattr(zipped, "LARGEST", 1000)
        said = "holds more than"
    with pytest.raises(DataError, match=f"walk.zip: .*{said}"):
        read_imu(path)


def test_nothing_stays_and_nothing_is_written_outside(folder, tmp_path, monkeypatch):
    monkeypatch.setattr(zipped.tempfile, "tempdir", str(tmp_path / "place"))
    (tmp_path / "place").mkdir()
    read_imu(packed(folder, more={"../outside.csv": "a\n1\n", "/root.csv": "a\n1\n"}))
    assert not list((tmp_path / "place").iterdir())
    assert not (tmp_path / "outside.csv").exists()
    assert content.LARGEST == zipped.LARGEST
