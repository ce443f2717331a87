"""Every mistake in a log is one message: the file, the line, the column, what was found, what to do."""

import bz2
import contextlib
import gzip
import re
import zipfile

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.io import savemat

from truenorth.core.errors import DataError, UsageError
from truenorth.formats import read_imu, text, write_imu
from truenorth.records import ImuRecord

HEADER = "time,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z"
ROWS = [f"{k / 100:.2f},{k}e-6,2e-6,3e-6,0.1,0.2,9.8" for k in range(1, 8)]

ROWS_OF_COMMAS = [row.replace(",", ";").replace(".", ",") for row in ROWS]


def says(path, *words, error=DataError, **options):
    with pytest.raises(error) as caught:
        read_imu(path, **options)
    text = str(caught.value)
    assert "\n" not in text.strip()
    for word in (path.name, *words):
        assert word in text, text


def csv(folder, lines, name="log.csv", encoding="utf-8"):
    path = folder / name
    path.write_bytes("\n".join(lines).encode(encoding) + b"\n")
    return path


def changed(row, line):
    rows = list(ROWS)
    rows[row] = line
    return [HEADER, *rows]


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        (changed(3, "0.04,4e-6,oops,3e-6,0.1,0.2,9.8"), ["line 5", "gyro_y", "'oops'", "expected a number"]),
        (changed(3, "0.04,4e-6,,3e-6,0.1,0.2,9.8"), ["line 5", "gyro_y", "''"]),
        (changed(3, "0.04,4e-6,NaN,3e-6,0.1,0.2,9.8"), ["line 5", "gyro_y", "nan", "finite"]),
        (changed(6, "0.07,4e-6,1,3e-6,0.1,0.2,-inf"), ["line 8", "accel_z", "-inf", "finite"]),
        (changed(0, "nan,4e-6,1,3e-6,0.1,0.2,9.8"), ["line 2", "column time", "nan"]),
        (changed(3, "0.02,4e-6,2e-6,3e-6,0.1,0.2,9.8"), ["line 5", "column time", "goes back", "0.03", "0.02"]),
        (changed(3, "0.03,4e-6,2e-6,3e-6,0.1,0.2,9.8"), ["line 5", "column time", "repeats"]),
        (changed(5, "0.06,4e-6,1"), ["line 7", "3 columns", "expected 7", "cut short"]),
        (changed(2, "0.03,4e-6,1,2,3,4,5,6"), ["line 4", "8 columns", "expected 7"]),
        ([HEADER, "", *ROWS[:2], "", "", "0.03,4e-6,oops,3e-6,0.1,0.2,9.8"], ["line 7", "gyro_y", "'oops'"]),
        (["# from the lab", HEADER, "", *ROWS[:2], "", "0.03,1,nan,3,0.1,0.2,9.8"], ["line 7", "gyro_y", "nan"]),
        ([HEADER.replace("gyro_y", "turn"), *ROWS], ["'gyro_y' is missing", "found time, gyro_x, turn"]),
        ([HEADER.replace("gyro_y", "gyro_x"), *ROWS], ["'gyro_y' is missing", "gyro_x, gyro_x"]),
        (["a,b,c", "1,2,3"], ["no columns of an IMU", "a, b, c", "name the columns"]),
        (ROWS[:2], ["no columns of an IMU among 1, 2, 3, 4, 5, 6, 7"]),
        ([HEADER], ["no rows"]),
        ([HEADER, "", ""], ["no rows"]),
        ([HEADER, ROWS[0]], ["1 sample", "at least 2"]),
        (["", ""], ["empty lines only"]),
        (
            [HEADER.replace(",", ";"), *ROWS_OF_COMMAS, "0.08;1;2;3;4;5;6", "0,09;1;2;3;4;5;6"],
            ["line 9", "column time", "'0.08'"],
        ),
        ([HEADER.replace(",", " "), "0.01 1 2 3 4 5 6", "0.02 1 2 x 4 5 6"], ["line 3", "gyro_z", "'x'"]),
        (
            [HEADER.replace(",", " "), "0.01 1 2 3 4 5 6", "0.02 1 2 3 4", "0.03 1 2 3 4 5 6", "0.04 1 2 3 4 5 6"],
            ["line 3", "5 columns"],
        ),
        ([HEADER.replace(",", " "), "0.01 1 2 3 4 5 6", "0.02 1 2 nan 4 5 6"], ["line 3", "gyro_z", "nan"]),
    ],
)
def test_csv(lines, words, tmp_path):
    says(csv(tmp_path, lines), *words)


def test_three_rows_are_a_record(tmp_path):
    assert len(read_imu(csv(tmp_path, [HEADER, *ROWS[:3]]))) == 3


def test_the_fault_is_named_as_the_log_names_its_columns(tmp_path):
    lines = changed(3, "0.04,4e-6,nan,3e-6,0.1,0.2,9.8")
    lines[0] = "t,wx,wy,wz,ax,ay,az"
    ours = HEADER.split(",")
    path = csv(tmp_path, lines)
    says(path, "line 5", "column wy", columns=dict(zip(ours, lines[0].split(","))), axes="FRD")


def test_what_is_in_columns_that_are_not_needed_does_not_matter(tmp_path):
    rows = [f"{row},{word}" for row, word in zip(ROWS, ["fix", "", "nan", '"3"', "x", "y", "é"])]
    assert len(read_imu(csv(tmp_path, [f"{HEADER},gnss", *rows], encoding="latin-1"))) == len(rows)
    assert len(read_imu(csv(tmp_path, [f"{HEADER},", *(f"{row}," for row in ROWS)]))) == len(rows)
    blanks = [line.replace(",", "  ") for line in (f"{HEADER},gnss", *(f"{row},fix" for row in ROWS))]
    assert len(read_imu(csv(tmp_path, blanks))) == len(rows)


@pytest.mark.parametrize("end", ["\n", "\r\n"])
@pytest.mark.parametrize("mark", ["", "\ufeff", "# remarks, of someone\n", "\n"])
@pytest.mark.parametrize("delimiter", [",", ";", "\t", " ", " , "])
def test_csv_as_programs_write_it(end, mark, delimiter, tmp_path):
    path = tmp_path / "log.csv"
    text = mark + "\n".join([HEADER, *ROWS]).replace(",", delimiter) + "\n"
    path.write_bytes(text.replace("\n", end).encode())
    record = read_imu(path)
    assert record.time.tolist() == [k / 100 for k in range(1, 8)]
    assert record.gyro[2].tolist() == [3e-6, 2e-6, 3e-6]


def test_a_header_may_be_a_remark(tmp_path):
    assert len(read_imu(csv(tmp_path, [f"# {HEADER}", *ROWS]))) == len(ROWS)


@pytest.mark.parametrize("suffix", ["csv", "parquet", "npz", "mat", "imu", "txt", "bin", "bag", "mcap", "db3"])
def test_an_empty_file(suffix, tmp_path):
    path = tmp_path / f"log.{suffix}"
    path.touch()
    says(path, "empty")


def contents(tmp_path):
    record = ImuRecord(np.arange(1, 4) / 100, np.ones((3, 3)), np.ones((3, 3)))
    write_imu(record, tmp_path / "a.parquet")
    write_imu(record, tmp_path / "a.npz")
    with zipfile.ZipFile(tmp_path / "book", "w") as archive:
        archive.writestr("[Content_Types].xml", "<x/>")
    return {
        "csv": "\n".join([HEADER, *ROWS, ""]).encode(),
        "parquet": (tmp_path / "a.parquet").read_bytes(),
        "npz": (tmp_path / "a.npz").read_bytes(),
        "gzip": gzip.compress(b"x" * 100),
        "utf-16": HEADER.encode("utf-16"),
        "xlsx": (tmp_path / "book").read_bytes(),
        "doubles": np.arange(1, 57.0).tobytes(),
        "mat": b"MATLAB 5.0 MAT-file" + bytes(200),
        "rosbag": b"#ROSBAG V2.0\n" + bytes(200),
        "random": np.random.default_rng(1).bytes(56 * 20),
    }


TRUE = {
    ("csv", "csv"),
    ("csv", "txt"),
    ("utf-16", "csv"),
    ("utf-16", "txt"),
    ("parquet", "parquet"),
    ("npz", "npz"),
    ("doubles", "bin"),
}
KINDS = ["csv", "parquet", "npz", "gzip", "utf-16", "xlsx", "doubles", "mat", "rosbag", "random"]
SUFFIXES = ["csv", "parquet", "npz", "mat", "imu", "txt", "bin", "bag", "mcap", "db3"]


@pytest.mark.parametrize(
    ("content", "suffix"), [(kind, suffix) for kind in KINDS for suffix in SUFFIXES if (kind, suffix) not in TRUE]
)
def test_a_file_that_is_not_what_its_suffix_says(content, suffix, tmp_path):
    path = tmp_path / f"log.{suffix}"
    path.write_bytes(contents(tmp_path)[content])
    says(path, error=(DataError, UsageError))


@pytest.mark.parametrize("suffix", ["parquet", "npz", "mat", "mat compressed"])
@pytest.mark.parametrize("part", [0.01, 0.3, 0.7, 0.99])
def test_a_file_that_is_cut_short(suffix, part, tmp_path):
    path = tmp_path / f"log.{suffix.split()[0]}"
    record = ImuRecord(np.arange(1, 400) / 100, *np.random.default_rng(0).normal(size=(2, 399, 3)))
    if path.suffix == ".mat":
        arrays = {"time": record.time, "gyro": record.gyro, "accel": record.accel}
        savemat(path, arrays, do_compression=suffix != "mat")
    else:
        write_imu(record, path)
    path.write_bytes(path.read_bytes()[: int(part * path.stat().st_size)])
    says(path, "cut short")


def test_a_matlab_file_that_is_cut_short_in_a_process_of_its_own(tmp_path, program):
    test_a_file_that_is_cut_short("mat compressed", 0.7, tmp_path)


def test_damage_inside_an_archive(tmp_path):
    path = tmp_path / "log.npz"
    write_imu(ImuRecord(np.arange(1, 400) / 100, np.ones((399, 3)), np.ones((399, 3))), path)
    data = bytearray(path.read_bytes())
    data[900:1000] = bytes(100)
    path.write_bytes(data)
    says(path, "damaged")


@pytest.mark.parametrize(
    "header",
    [
        b"{'descr': '<f8', 'shape': (3, # \n",
        b"{'descr': ('<f8',), 'fortran_order': False, 'shape': (3,)}\n",
        b"(" * 5000,
    ],
)
def test_a_header_of_an_archive_that_says_nothing(tmp_path, header):
    """NumPy's parser of headers has errors of its own for each."""
    path = tmp_path / "log.npz"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("time.npy", b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header + bytes(24))
    says(path, "damaged")


def test_an_archive_under_a_password(tmp_path):
    path = tmp_path / "log.npz"
    write_imu(ImuRecord(np.arange(1, 400) / 100, np.ones((399, 3)), np.ones((399, 3))), path)
    data = bytearray(path.read_bytes())
    for mark, at in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):
        data[data.index(mark) + at] |= 1
    path.write_bytes(data)
    says(path, "damaged", "encrypted")


def test_parquet_with_other_types_and_gaps(tmp_path):
    pa, pq = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    names = HEADER.split(",")
    columns = {name: pa.array([1.0, 2.0, 3.0]) for name in names}
    path = tmp_path / "log.parquet"
    pq.write_table(pa.table({**columns, "gyro_y": pa.array([1.0, None, 3.0])}), path)
    says(path, "row 2", "gyro_y", "nan")
    pq.write_table(pa.table({**columns, "gyro_y": pa.array(["a", "b", "c"])}), path)
    says(path, "gyro_y", "string", "numbers")
    stamps = pa.array(
        [1_400_000_000_010_000_000, 1_400_000_000_020_000_000, 1_400_000_000_030_000_000], pa.timestamp("ns")
    )
    pq.write_table(pa.table({**columns, "time": stamps}), path)
    np.testing.assert_allclose(read_imu(path).time - 1.4e9, [0.01, 0.02, 0.03], atol=1e-6)
    pq.write_table(pa.table({**columns, "time": pa.array([1, 2, 3], pa.int32()), "x": pa.array(["a", "b", "c"])}), path)
    assert read_imu(path, units={"time": "s"}).time.tolist() == [1.0, 2.0, 3.0]


def test_paths_and_formats(tmp_path):
    says(tmp_path / "none.csv", "No such file", error=UsageError)
    (tmp_path / "folder").mkdir()
    says(tmp_path / "folder", "folder", "metadata.yaml", error=UsageError)
    assert len(read_imu(csv(tmp_path, [HEADER, *ROWS], "log.dat"))) == len(ROWS)
    with pytest.raises(UsageError, match="choose one of csv"):
        read_imu(tmp_path / "log.dat", format="text")


def test_a_known_content_needs_no_suffix(tmp_path):
    write_imu(ImuRecord(np.arange(1, 4) / 100, np.ones((3, 3)), np.ones((3, 3))), tmp_path / "a.parquet")
    assert len(read_imu((tmp_path / "a.parquet").rename(tmp_path / "a.dat"))) == 3


@pytest.mark.slow
@pytest.mark.parametrize("suffix", ["csv", "txt", "imu", "bin", "npz", "parquet"])
@settings(max_examples=100, deadline=None, derandomize=True)
@given(data=st.data())
def test_whatever_is_damaged_is_a_record_or_an_error_of_ours(suffix, data, tmp_path_factory):
    folder = tmp_path_factory.mktemp("fuzz")
    whole = {
        "csv": ("\n".join([HEADER, *ROWS]) + "\n").encode(),
        "txt": ("\n".join(row.replace(",", " ") for row in ROWS) + "\n").encode(),
        "imu": ("\n".join(" ".join([*row.split(",")[1:], row.split(",")[0]]) for row in ROWS) + "\n").encode(),
        "bin": np.column_stack([np.arange(1.0, 9.0), np.ones((8, 6))]).tobytes(),
    } | {name: content for name, content in contents(folder).items() if name in ("npz", "parquet")}
    content = bytearray(whole[suffix])
    for _ in range(data.draw(st.integers(1, 3))):
        place = data.draw(st.integers(0, len(content)))
        gone = data.draw(st.integers(0, 8))
        content[place : place + gone] = data.draw(st.binary(max_size=8) | st.sampled_from([b"\n", b",", b"-", b"e9"]))
    path = folder / f"log.{suffix}"
    path.write_bytes(content)
    with contextlib.suppress(DataError, UsageError):
        assert np.isfinite(read_imu(path).gyro).all()


def test_gyros_that_are_none_are_named(tmp_path):
    """Columns under a gyro's names with numbers of no unit: a message, found by the fuzzer as a crash."""
    rows = "".join(
        f"{k * 0.01:.2f},{1e20 * (1 + k % 3):g},0,0,0.0,0.0,{9.8 + 0.001 * (k % 5):.4f}\n" for k in range(500)
    )
    (tmp_path / "log.csv").write_text("t,wx,wy,wz,ax,ay,az\n" + rows)
    with pytest.raises(DataError, match="of a gyro in no usual unit"):
        read_imu(tmp_path / "log.csv")


@pytest.mark.parametrize("lacks", [1, 2, 3], ids=["a cell", "two", "three"])
def test_a_log_that_begins_in_the_midst_of_a_row(lacks, tmp_path):
    """A serial port is opened whenever it is: a first row without its beginning is left out, as a last one without its end."""
    rng = np.random.default_rng(3)
    numbers = [0.0, 0.0, 9.8, 0.0, 0.0, 0.0] + 0.01 * rng.normal(size=(400, 6))
    rows = [",".join(f"{x:.4f}" for x in row) + f",{261906 + 10 * k}" for k, row in enumerate(numbers)]
    whole = read_imu(csv(tmp_path, rows[1:]), axes="RFU", units="rad/s,m/s^2")
    cut = read_imu(
        csv(tmp_path, [",".join(rows[0].split(",")[lacks:]), *rows[1:]], "cut.csv"), axes="RFU", units="rad/s,m/s^2"
    )
    for key in ("time", "gyro", "accel"):
        np.testing.assert_array_equal(getattr(cut, key), getattr(whole, key))
    assert any("no whole row left out: 1, the first is line 1" in guess.value for guess in cut.taken_for)


@pytest.mark.parametrize("name", ["%IMURATECORRIMUSA", "#CORRIMUDATAA"])
def test_corrected_data_of_novatel_hold_no_gravity(tmp_path, name):
    path = tmp_path / "log.txt"
    path.write_text(f"{name},2200,1004.390;2200,1004.39,-1e-06,2e-06,1e-06,2e-05,1e-05,9e-05*7d3d1746\n" * 10)
    with pytest.raises(DataError, match=r"log.txt: holds NovAtel's corrected IMU data, .*log RAWIMUSX"):
        read_imu(path)


def test_lines_that_a_spreadsheet_fills_up_are_no_rows(tmp_path):
    time = 0.01 * np.arange(2000)
    roll = 0.5 * np.sin(0.8 * time)
    rows = np.column_stack(
        [time, 9.81 * np.sin(roll), 0 * time, 9.81 * np.cos(roll), 0 * time, -np.gradient(roll, time), 0 * time]
    )
    above = ["Format=4,,,,,,", "Sensor,738,Label,Lumbar,,,", "Rate,100,,,,,", "time,ax,ay,az,gx,gy,gz"]
    path = tmp_path / "log.csv"
    path.write_text("\n".join([*above, *(",".join(f"{x:.6f}" for x in row) for row in rows)]) + "\n")
    record = read_imu(path)
    np.testing.assert_allclose(record.accel, rows[:, 1:4], atol=1e-5)


@pytest.mark.parametrize("broken", ["0.⁰1", "٠.١", "1.#QNAN"])
@pytest.mark.parametrize("rows", [1, 120])
def test_rows_of_broken_numbers_are_no_header(tmp_path, broken, rows):
    """Of columns that only the header names: x and y were exchanged, `aligned`, 700 sigmas off."""
    log = tmp_path / "log.csv"
    whole = [f"{0.01 * k:.2f},0.0001,0.0002,0.0003,0.001,0.002,{0.098 + 1e-5 * (k % 7):.5f}" for k in range(1, 2001)]
    lines = [",".join([broken] * 7) if k < rows else line for k, line in enumerate(whole)]
    log.write_text("\n".join(["time,dtheta_y,dtheta_x,dtheta_z,dvel_y,dvel_x,dvel_z", *lines]), encoding="utf-8")
    with pytest.raises(DataError, match=f"line 2: '{re.escape(broken)}' is no number"):
        read_imu(log)


def test_a_packed_line_without_an_end_is_refused_before_it_is_unpacked(tmp_path, monkeypatch):
    path = tmp_path / "log.csv.gz"
    with gzip.open(path, "wb", 1) as file:
        file.write(b"time,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z\n" + bytes([48]) * (1 << 22))
    monkeypatch.setattr(text, "text_of", lambda path: pytest.fail("unpacked"))
    with pytest.raises(DataError, match=r"log\.csv\.gz: line 2: longer than 64 KiB"):
        read_imu(path)


@pytest.mark.parametrize("name", ["log.parquet", "log.csv.bz2"])
def test_short_memory_is_not_called_a_damaged_file(tmp_path, monkeypatch, name):
    import pyarrow as pa

    def short(*_, **__):
        raise pa.lib.ArrowMemoryError("malloc of size 4096 failed")

    path = tmp_path / name
    write_imu(ImuRecord(np.arange(1.0, 5.0), np.zeros((4, 3)), np.ones((4, 3))), tmp_path / "log.parquet")
    if name.endswith("bz2"):
        path.write_bytes(bz2.compress("\n".join([HEADER, *ROWS]).encode()))
        monkeypatch.setattr(pa, "CompressedInputStream", short)
    else:
        monkeypatch.setattr("pyarrow.parquet.ParquetFile", short)
    with pytest.raises(MemoryError):
        read_imu(path)


MIXED = "time [s],gyro_x [rad/s],gyro_y [rad/s],gyro_z [rad/s],accel_x [{}],accel_y [{}],accel_z [{}]"


@pytest.mark.parametrize("units", [("g", "m/s^2", "m/s^2"), ("mg", "mg", "g")])
def test_headings_of_one_sensor_in_several_units_are_refused(tmp_path, units):
    """A tenth of g among metres a second squared has the norm of gravity, and level was 43 sigmas off in silence."""
    path = csv(tmp_path, [MIXED.format(*units), *ROWS])
    says(path, "several units", f"accel_x [{units[0]}]", f"accel_z [{units[2]}]", "`units`")
    assert read_imu(path, units={"accel": "m/s^2"}).accel[0, 2] == 9.8


def test_one_unit_may_be_written_in_two_ways(tmp_path):
    path = csv(tmp_path, [MIXED.format("m/s2", "m/s^2", "m/s^2"), *ROWS])
    assert read_imu(path).accel[0, 2] == 9.8
