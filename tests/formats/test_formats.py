"""Every format reads back what was written, in SI units and our axes; what is damaged is named."""

import numpy as np
import pytest

from truenorth.core import mapped
from truenorth.core.errors import DataError, UsageError
from truenorth.formats import read_imu, write_imu
from truenorth.records import ImuRecord

FRD_TO_RFU = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])


@pytest.fixture(params=["rates", "increments"])
def record(request) -> ImuRecord:
    rng = np.random.default_rng(2)
    return ImuRecord(np.arange(1, 201) / 100, *rng.standard_normal((2, 200, 3)), request.param)


def _same(a: ImuRecord, b: ImuRecord) -> None:
    assert a.kind == b.kind
    np.testing.assert_array_equal(a.time, b.time)
    np.testing.assert_array_equal(a.gyro, b.gyro)
    np.testing.assert_array_equal(a.accel, b.accel)


@pytest.mark.parametrize("suffix", ["csv", "parquet", "npz"])
def test_written_and_read_to_the_bit(record, tmp_path, suffix):
    path = tmp_path / f"log.{suffix}"
    write_imu(record, path)
    _same(read_imu(path), record)
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


@pytest.mark.parametrize("record", ["rates"], indirect=True)
def test_units_axes_and_names_by_options(record, tmp_path):
    path = tmp_path / "log.csv"
    table = np.column_stack([record.time, np.degrees(record.gyro @ FRD_TO_RFU), record.accel @ FRD_TO_RFU / 9.80665])
    names = ["t", "wx", "wy", "wz", "ax", "ay", "az"]
    np.savetxt(path, table, delimiter=";", header=";".join(names), comments="", fmt="%.17g")
    ours = ["time", "gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z"]
    columns = dict(zip(ours, names, strict=True))
    read = read_imu(path, columns=columns, units="deg/s,g", axes="FRD")
    np.testing.assert_allclose(read.gyro, record.gyro, rtol=1e-14, atol=1e-15)
    np.testing.assert_allclose(read.accel, record.accel, rtol=1e-14, atol=1e-15)

    (tmp_path / "log.yaml").write_text(f"columns: {columns}\nunits: 'deg/s,g'\naxes: FRD\n")
    _same(read_imu(path), read)
    assert len(read_imu(path, columns={"time": "t"})) == len(record)
    (tmp_path / "log.yaml").write_text("colums: {}\n")
    with pytest.raises(DataError, match="colums"):
        read_imu(path)


def test_a_rate_makes_the_time(record, tmp_path):
    path = tmp_path / "log.csv"
    write_imu(record, path)
    lines = [",".join(line.split(",")[1:]) for line in path.read_text().splitlines()]
    path.write_text("\n".join(lines) + "\n")
    with pytest.raises(UsageError, match="give the rate"):
        read_imu(path)
    read = read_imu(path, rate=100.0)
    np.testing.assert_allclose(read.time, record.time, rtol=1e-14)


def test_psins_text(record, tmp_path):
    path = tmp_path / "log.imu"
    np.savetxt(
        path, np.column_stack([record.gyro, record.accel, record.time]), header="gx gy gz ax ay az t", fmt="%.17g"
    )
    read = read_imu(path)
    assert read.kind == "increments"
    np.testing.assert_array_equal(read.gyro, record.gyro)
    np.testing.assert_array_equal(read.time, record.time)
    np.savetxt(path, np.column_stack([record.gyro, record.accel]), fmt="%.17g")
    with pytest.raises(UsageError, match="give the rate"):
        read_imu(path)
    np.testing.assert_allclose(read_imu(path, rate=100).time, record.time, rtol=1e-14)


def test_kf_gins_text_and_binary(record, tmp_path):
    table = np.column_stack([record.time, record.gyro @ FRD_TO_RFU, record.accel @ FRD_TO_RFU])
    text, binary = tmp_path / "log.txt", tmp_path / "log.bin"
    np.savetxt(text, table, fmt="%.17g")
    table.astype("<f8").tofile(binary)
    for path in (text, binary):
        read = read_imu(path, format="kf-gins" if path is text else None)
        assert read.kind == "increments"
        np.testing.assert_allclose(read.gyro, record.gyro, rtol=0, atol=1e-16)
        np.testing.assert_allclose(read.accel, record.accel, rtol=0, atol=1e-16)
    binary.write_bytes(binary.read_bytes()[:-9])
    with pytest.raises(DataError, match="199 rows of 56 and 47 bytes over"):
        read_imu(binary)


@pytest.mark.slow
def test_mat_and_npz_by_variable(record, tmp_path):
    from scipy.io import savemat

    gyro, accel = ("gyro", "accel") if record.kind == "rates" else ("dtheta", "dvel")
    path = tmp_path / "log.mat"
    savemat(path, {"w": record.gyro, "f": record.accel, "t": record.time})
    units = "rad/s,m/s^2" if record.kind == "rates" else "rad,m/s"
    read = read_imu(path, columns={gyro: "w", accel: "f", "time": "t"}, units=units)
    _same(read, record)
    with pytest.raises(DataError, match="gravity"):
        read_imu(path)
    archive = tmp_path / "log.npz"
    np.savez(archive, **{gyro: record.gyro[:, :2], accel: record.accel, "time": record.time})
    with pytest.raises(DataError, match=r"gyro_x|dtheta_x"):
        read_imu(archive)


@pytest.mark.parametrize("suffix", ["parquet", "npz", "mat", "bag"])
def test_text_under_a_binary_name(tmp_path, suffix):
    path = tmp_path / f"log.{suffix}"
    path.write_text("time,gyro_x\n1,2\n")
    with pytest.raises(DataError, match="another format"):
        read_imu(path)


@pytest.mark.parametrize("suffix", ["parquet", "npz"])
def test_a_file_that_is_cut_short(record, tmp_path, suffix, monkeypatch):
    """An archive whose arrays stay on the disk, too: its end is what says where they are."""
    monkeypatch.setattr(mapped.read_mapped, "__defaults__", (1000,))
    path = tmp_path / f"log.{suffix}"
    write_imu(record, path)
    path.write_bytes(path.read_bytes()[:-100])
    with pytest.raises(DataError, match="damaged"):
        read_imu(path)


def test_wrong_encoding_and_unknown_suffix(tmp_path):
    path = tmp_path / "log.csv"
    names = "température,time,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z\n"
    path.write_bytes((names + "20,0.1,1,2,3,4,5,6\n20,0.2,1,2,3,4,5,6\n").encode("latin-1"))
    assert len(read_imu(path)) == 2
    other = tmp_path / "log.dat"
    other.write_bytes(bytes(100))
    with pytest.raises(UsageError, match="names no format"):
        read_imu(other)
    with pytest.raises(UsageError, match=r"\.csv, \.parquet or \.npz"):
        write_imu(ImuRecord(np.array([0.0, 1.0]), np.zeros((2, 3)), np.zeros((2, 3))), tmp_path / "log.xyz")
