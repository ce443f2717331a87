"""What once crashed, hung or passed for something else: each is one message of ours, in little time and memory."""

import io
import json
import struct
import sys
import zipfile
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

import truenorth
from tests.campaign.test_plan import PLAN
from tests.fuzz.test_readers import in_time
from tests.helpers import run_command
from truenorth.campaign import read_plan
from truenorth.cli import main
from truenorth.core.errors import DataError, TruenorthError, UsageError
from truenorth.core.position import Position
from truenorth.formats import read_gnss, read_imu
from truenorth.formats.names import heading_of
from truenorth.formats.sensor_kinds import kind_of
from truenorth.papers import reproduce
from truenorth.records import EncoderRecord, GnssRecord, MasterRecord, OdometerRecord
from truenorth.records.specs import imu_spec
from truenorth.simulation import rest, simulate

PLACE = Position.from_degrees(45.0, 10.0)
WHERE = ["--lat", "45", "--lon", "10"]
RECORD = simulate(rest(PLACE, 0.3), rate=10.0, duration=60.0, imu=imu_spec("navigation"), seed=1).record
TEXTS = {
    "braces": "{{ }}: 1",
    "a date": "name: 2024-13-45",
    "a tag": "name: !!python/object:os.system x",
    "brackets": "a: " + "[" * 2000,
    "anchors": "a: &a [x, x, x]\n" + "".join(f"{chr(c + 1)}: &{chr(c + 1)} [*{chr(c)}, *{chr(c)}]\n" for c in range(97, 117)),
    "itself": "a: &a [*a]",
    "nothing": "",
    "bytes": "\x00\x01",
    "long": "a: " + "9" * 5000,
}  # fmt: skip


@pytest.fixture(autouse=True)
def memory():
    """Two GiB more than there are: what asks for more fails here, and not for want of memory of the whole machine."""
    resource = pytest.importorskip("resource", reason="this system has no limit of memory")
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    pages = int(Path("/proc/self/statm").read_text().split()[0]) if Path("/proc/self/statm").exists() else None
    if pages is not None:
        resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + (2 << 30), hard))
    yield
    resource.setrlimit(resource.RLIMIT_AS, (soft, hard))


def refused(capsys, monkeypatch, *words, codes=(2, 3, 4)):
    """One line of ours, no traceback: whatever else is raised goes through the program's last resort and fails the test."""
    with in_time():
        code, said = run_command(capsys, monkeypatch, *words)
    assert code in codes, said.err
    assert said.err.startswith("truenorth: ")
    assert len(said.err.strip().splitlines()) <= 12
    return said.err


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    path = tmp_path_factory.mktemp("log") / "log.csv"
    truenorth.write_imu(RECORD, path)
    return path


def bomb(path, rows=10**11):
    """An archive of a kilobyte whose header says that its arrays have so many rows."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, shape in (
            ("time", f"({rows},)"),
            ("gyro", f"({rows}, 3)"),
            ("accel", f"({rows}, 3)"),
            ("tree", f"({rows},)"),
        ):
            header = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}".encode()
            header += b" " * (63 - (len(header) + 10) % 64) + b"\n"
            archive.writestr(f"{name}.npy", b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header + bytes(100))
    return path


def test_an_archive_that_promises_more_than_memory(tmp_path):
    with in_time(), pytest.raises(DataError, match="GiB"):
        read_imu(bomb(tmp_path / "log.npz"))
    with in_time(), pytest.raises(DataError, match=r"result\.npz"):
        truenorth.load(bomb(tmp_path / "result.npz").parent)


@pytest.mark.parametrize(
    "text", ["duration: 1e6 s\nrate: 100 kHz", "duration: 60 s\nrate: 2e9 Hz", "duration: 1e9 s\nrate: 100 Hz"]
)
def test_a_scenario_of_1e11_samples(text, tmp_path, capsys, monkeypatch):
    path = tmp_path / "scenario.yaml"
    path.write_text(f"name: x\n{text}\nposition: {{lat: 45 deg}}\nimu: navigation\nmotion: {{kind: rest}}\n")
    said = refused(capsys, monkeypatch, "simulate", path, "-o", tmp_path / "out")
    assert "samples" in said or "116 days" in said


@pytest.mark.parametrize("text", TEXTS)
@pytest.mark.parametrize("where", ["specification", "layout", "scenario", "plan", "search"])
def test_yaml_from_anybody(where, text, log, tmp_path, capsys, monkeypatch):
    path = tmp_path / "log.yaml"
    path.write_text(TEXTS[text])
    out = ["-o", tmp_path / "out"]
    if where == "layout":
        (tmp_path / "log.csv").write_bytes(log.read_bytes())
    words = {
        "specification": ["align", log, *WHERE, "--imu", path],
        "layout": ["align", tmp_path / "log.csv", *WHERE, "--imu", "navigation"],
        "scenario": ["simulate", path, *out],
        "plan": ["campaign", path, *out],
        "search": ["tune", path, *out],
    }
    allowed = (0, 2, 3, 4) if (where, text) == ("layout", "nothing") else (2, 3, 4)
    if 0 in allowed:
        run_command(capsys, monkeypatch, *words[where])
    else:
        refused(capsys, monkeypatch, *words[where])


FOREIGN = {
    "a list": "[1, 2]",
    "a number": "7",
    "a word": '"aligned"',
    "nothing": "{}",
    "null": "null",
    "no JSON": "{",
    "not UTF-8": b"\xff\xfe{}",
    "NaN": '{"heading_deg": NaN, "navigation": NaN}',
    "other types": '{"heading_deg": 1, "navigation": [], "status": {}}',
    "a heading alone": '{"heading_deg": 1.0, "navigation": {"C_nb": "x"}}',
    "deep": "[" * 100_000,
}


@pytest.mark.parametrize("text", FOREIGN)
def test_a_start_or_a_manifest_that_is_not_ours(text, log, tmp_path, capsys, monkeypatch):
    content = FOREIGN[text] if isinstance(FOREIGN[text], bytes) else FOREIGN[text].encode()
    start, campaign = tmp_path / "start", tmp_path / "campaign"
    for folder, name in ((start, "summary.json"), (campaign, "manifest.json")):
        folder.mkdir()
        (folder / name).write_bytes(content)
    (tmp_path / "plan.yaml").write_text(json.dumps(PLAN))
    refused(capsys, monkeypatch, "navigate", log, "--start", start)
    refused(capsys, monkeypatch, "campaign", tmp_path / "plan.yaml", "-o", campaign, "--workers", "1")


@pytest.mark.parametrize(
    "option", ["log", "--gnss", "--odometer", "--indexer", "--master", "--imu", "scenario", "plan", "--start"]
)
def test_a_device_without_an_end(option, log, tmp_path, capsys, monkeypatch):
    zero = "/dev/zero"
    words = {
        "log": ["align", zero, *WHERE],
        "--start": ["navigate", log, "--start", zero],
        "scenario": ["simulate", zero, "-o", tmp_path / "out"],
        "plan": ["campaign", zero, "-o", tmp_path / "out"],
        "--imu": ["align", log, *WHERE, "--imu", zero],
    }
    refused(capsys, monkeypatch, *words.get(option, ["align", log, *WHERE, "--imu", "navigation", option, zero]))


def test_quoted_cells_are_the_numbers_in_them(log, tmp_path):
    lines = log.read_text().splitlines()
    quoted = [lines[0], *(",".join(f'"{cell}"' for cell in line.split(",")) for line in lines[1:])]
    (tmp_path / "log.csv").write_text("\n".join(quoted) + "\n")
    assert np.array_equal(read_imu(tmp_path / "log.csv").gyro, read_imu(log).gyro)


@pytest.mark.parametrize("digits", ["٠١٢٣٤٥٦٧٨٩", "०१२३४५६७८९", "０１２３４５６７８９"])
def test_digits_of_other_scripts_are_named(digits, log, tmp_path):
    head, *rows = log.read_text().splitlines()
    text = "\n".join([head, *(row.translate(str.maketrans("0123456789", digits)) for row in rows)])
    (tmp_path / "log.csv").write_text(text, encoding="utf-8")
    with pytest.raises(DataError, match=r"log\.csv"):
        read_imu(tmp_path / "log.csv")


def test_nmea_with_semicolons(tmp_path):
    row = "$GPGGA;{:06d}.00;4806.0;N;01130.0;E;1;08;1.0;500.0;M;45.0;M;;\r\n"
    (tmp_path / "log.nmea").write_text("".join(row.format(100000 + k) for k in range(20)))
    with pytest.raises(TruenorthError, match=r"log\.nmea"):
        read_gnss(tmp_path / "log.nmea")


def others(time, values):
    """A record of each kind that is not an IMU's, with these values in a column of numbers."""
    C_nb = np.broadcast_to(np.eye(3), (len(time), 3, 3))
    return {
        "encoder": lambda: EncoderRecord(time, np.stack([values, values], axis=1)),
        "odometer": lambda: OdometerRecord(time, values),
        "gnss": lambda: GnssRecord(time, 0.7 + 1e-9 * values, 0.1 + 0 * values, 100.0 + values),
        "master": lambda: MasterRecord(time, C_nb, np.stack([values] * 3, axis=1)),
    }


@pytest.mark.parametrize("kind", ["encoder", "odometer", "gnss", "master"])
def test_arrays_of_callers(kind):
    """A masked value is absent, dates are seconds, what the caller writes later is not the record's, text is named."""
    time, values = 0.5 * np.arange(1.0, 9.0), np.linspace(1.0, 2.0, 8)
    dates = np.datetime64("2024-03-05T10:00:00", "ns") + (1e9 * time).astype("timedelta64[ns]")
    assert others(dates, values)[kind]().time[0] == 1709632800.5
    mine = time.copy()
    record = others(mine, values)[kind]()
    mine[0] = -7.0
    assert record.time[0] == 0.5
    masked = np.ma.masked_array(values, mask=[0, 0, 1, 0, 0, 0, 0, 0])
    if kind in ("encoder", "odometer"):
        with pytest.raises(DataError, match="row 3"):
            EncoderRecord(time, np.ma.stack([masked, masked], axis=1)) if kind == "encoder" else OdometerRecord(
                time, masked
            )
    with pytest.raises(TruenorthError):
        others(np.array(["a"] * 8), values)[kind]()


CALLS = {
    "align without a record": lambda: truenorth.align(None, PLACE, "navigation"),
    "align at a text": lambda: truenorth.align(RECORD, "45 N", "navigation"),
    "align with a number for an IMU": lambda: truenorth.align(RECORD, PLACE, 5),
    "align with a list for an IMU": lambda: truenorth.align(RECORD, PLACE, ["navigation"]),
    "align by no method": lambda: truenorth.align(RECORD, PLACE, "navigation", method="by eye"),
    "align with a record for an aid": lambda: truenorth.align(RECORD, PLACE, "navigation", aid=RECORD),
    "align with a text for an aid": lambda: truenorth.align(RECORD, PLACE, "navigation", aid=["gnss"]),
    "align at no time": lambda: truenorth.align(RECORD, PLACE, "navigation", at=float("nan")),
    "navigate from nothing": lambda: truenorth.navigate(RECORD, None),
    "navigate from a text": lambda: truenorth.navigate(RECORD, "start"),
    "navigate without a record": lambda: truenorth.navigate([1, 2], None),
    "inspect a text": lambda: truenorth.inspect("log.csv"),
    "inspect nothing": lambda: truenorth.inspect(None),
    "read nothing": lambda: truenorth.read_imu(None),
    "read a number": lambda: truenorth.read_imu(3.0),
    "read bytes that are no path": lambda: truenorth.read_imu("\0"),
    "save a number": lambda: truenorth.save(3, "out"),
    "plot a text": lambda: truenorth.plot("x"),
    "load a number": lambda: truenorth.load(3),
    "a place of text": lambda: Position.from_degrees("45", "10"),
    "a place of NaN": lambda: Position.from_degrees(float("nan"), 10.0),
    "advise on nothing": lambda: truenorth.advise(None, PLACE, 0.01),
    "a campaign of nothing": lambda: truenorth.run_campaign(None, io.StringIO()),
    "a study of nothing": lambda: reproduce(None),
    "simulate nothing": lambda: truenorth.simulate(None, rate=10.0, duration=1.0, imu="navigation"),
}


@pytest.mark.parametrize("call", CALLS)
def test_wrong_types_are_errors_of_ours(call):
    with in_time(), pytest.raises((TruenorthError, UsageError)):
        CALLS[call]()


def parquet(path, rows, record=RECORD):
    """A table of the documented columns with the first rows of a record, or so many rows of zeros, which take no room."""
    names = ["time", *(f"{kind}_{axis}" for kind in ("dtheta", "dvel") for axis in "xyz")]
    if rows <= len(record):
        columns = np.column_stack([record.time, record.gyro, record.accel])[:rows].T
        pq.write_table(pa.table(list(columns), names), path)
        return path
    group = pa.table([np.zeros(1 << 20)] * len(names), names)
    with pq.ParquetWriter(path, group.schema) as writer:
        for _ in range(rows >> 20):
            writer.write_table(group)
    return path


def test_tables_without_rows_of_one_row_and_of_more_than_memory(tmp_path, monkeypatch):
    with pytest.raises(DataError, match="no rows"):
        read_imu(parquet(tmp_path / "log.parquet", 0))
    np.savez(tmp_path / "one.npz", time=RECORD.time[:1], dtheta=RECORD.gyro[:1], dvel=RECORD.accel[:1])
    with pytest.raises(DataError, match="no columns of an IMU"):
        read_imu(tmp_path / "one.npz")
    monkeypatch.setattr("truenorth.formats.parquet.LARGEST", 8 << 20)
    with in_time(), pytest.raises(DataError, match="cut it into parts"):
        read_imu(parquet(tmp_path / "large.parquet", 1 << 21))


@pytest.mark.parametrize(
    "text",
    [
        lambda: ",".join(f"c{k}" for k in range(1_000_000)) + "\n" + ",".join(["1"] * 1_000_000),
        lambda: "0" * 10_000_000,
        lambda: "time," + "x" * 200_000 + "\n1,2\n",
        lambda: "\n".join([",".join(["1.5"] * 900)] * 60),
    ],
    ids=["columns", "line", "name", "many columns"],
)
def test_a_text_that_is_no_table_of_a_sensor(text, tmp_path):
    (tmp_path / "log.csv").write_text(text())  # made here: each worker collects
    with in_time(), pytest.raises(DataError, match=r"log\.csv") as error:
        read_imu(tmp_path / "log.csv")
    assert len(str(error.value)) < 1500


def test_names_of_columns_are_no_orders_to_the_terminal(tmp_path):
    (tmp_path / "log.csv").write_text("time,\x1b[31mx\x1b]0;title\x07\n" + "".join(f"{k},1\n" for k in range(20)))
    with pytest.raises(DataError, match=r"no columns of an IMU among time, \?\[31mx"):
        read_imu(tmp_path / "log.csv")


def test_rows_a_lifetime_apart(log, tmp_path, capsys, monkeypatch):
    head, *rows = log.read_text().splitlines()
    late = [",".join([str(float(row.split(",")[0]) + 1e9), *row.split(",")[1:]]) for row in rows[300:]]
    (tmp_path / "log.csv").write_text("\n".join([head, *rows[:300], *late]))
    said = refused(capsys, monkeypatch, "align", tmp_path / "log.csv", *WHERE, "--imu", "navigation")
    assert "row 301, column time: 1000000000 s after the row before" in said
    refused(capsys, monkeypatch, "inspect", tmp_path / "log.csv")


LONG = "9" * 400
NAMED = {
    "log": ["align", LONG, *WHERE],
    "specification": ["align", "{log}", *WHERE, "--imu", LONG],
    "output": ["align", "{log}", *WHERE, "--imu", "navigation", "-o", LONG],
    "path of output": ["align", "{log}", *WHERE, "--imu", "navigation", "-o", "a/" * 3000],
    "start": ["navigate", "{log}", "--start", LONG],
    "scenario": ["simulate", LONG, "-o", "never"],
    "plan": ["campaign", LONG, "-o", "never"],
    "search": ["tune", LONG, "-o", "never"],
    "no source": ["live", "", *WHERE],
    "replay of nothing": ["live", "replay:", *WHERE],
    "no address": ["live", "udp://[", *WHERE],
    **{f"{kind} source": ["live", f"{kind}:{LONG}", *WHERE] for kind in ("replay", "follow", "bag", "serial")},
    "aiding source": ["live", "replay:{log}@max", *WHERE, "--imu", "navigation", "--gnss", f"replay:{LONG}"],
    "sigma": ["align", "{log}", *WHERE, "--imu", "navigation", "--position-sigma", "1e308"],
    "rate": ["align", "{log}", *WHERE, "--imu", "navigation", "--rate", "1e-320"],
}


@pytest.mark.parametrize("what", NAMED)
def test_names_and_figures_that_nothing_has(what, log, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    refused(capsys, monkeypatch, *(word.format(log=log) for word in NAMED[what]))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("where", ["imu", "scenarios"])
def test_a_name_within_a_file_that_nothing_has(where, tmp_path):
    change = {"scenarios": [PLAN["scenarios"][0] | {"imu": LONG}]} if where == "imu" else {"scenarios": [LONG]}
    with pytest.raises(DataError, match="999"):
        read_plan(PLAN | change)


def test_a_log_whose_name_has_a_line_end(log, tmp_path, capsys, monkeypatch):
    named = tmp_path / "new\nline.csv"
    named.write_bytes(log.read_bytes())
    assert run_command(capsys, monkeypatch, "live", f"replay:{named}@max", *WHERE, "--imu", "navigation")[0] in (0, 4)


@pytest.mark.parametrize(
    "content",
    [
        b"\xff\x00,",
        b"procedure,fault,seed,run,size,outcome,worst,reason\nstill,none,x,0,1,harmless,0.1,\n",
        b"a,b\n",
        None,
    ],
    ids=["bytes", "no number", "other columns", "folder"],
)
def test_trials_that_are_not_ours(content, tmp_path, capsys, monkeypatch):
    path = tmp_path / "trials.csv"
    path.mkdir() if content is None else path.write_bytes(content)
    words = ["faults", "--procedure", "still", "--fault", "none", "--runs", "1"]
    refused(capsys, monkeypatch, *words, "-o", tmp_path)
    refused(capsys, monkeypatch, *words, "--before", "/dev/zero")
    refused(capsys, monkeypatch, *words, "--before", tmp_path / "nothing.csv")


def test_a_closed_standard_output(log, monkeypatch):
    monkeypatch.setattr(sys, "argv", ["truenorth", "align", str(log), *WHERE, "--imu", "navigation"])
    monkeypatch.setattr(sys, "stdout", None)
    try:
        main()
    except SystemExit as stop:
        assert stop.code in (0, 4)  # noqa: PT017


@pytest.mark.parametrize(
    "word", ["9" * 400, "b_" * 200, "imu9" * 100, "a1_" * 130, "gyro_" + "9" * 400, "loggingtime" * 40]
)
def test_a_heading_of_hundreds_of_characters_is_read_in_time(word):
    """Digits were tried in all ways in which they make tokens: 23 of them took 97 s."""
    with in_time():
        for text in (word, f"{word}!", f"x{word}", f"{word}_acc_x"):
            heading_of(text)
            kind_of(text)
