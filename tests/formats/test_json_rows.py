"""JSON: arrays of objects, and objects one below the other with what is nested in them."""

import json

import numpy as np
import pytest

from truenorth.core.errors import DataError, TruenorthError
from truenorth.formats import read_gnss, read_imu

COUNT = 200
TIME = 0.01 * np.arange(COUNT)
GYRO = 0.1 * np.sin(3.0 * TIME)[:, None] * [0.2, -0.5, 1.0]
ACCEL = np.array([0.3, -0.2, 9.8]) + 0.0 * GYRO
UNITS = {"gyro": "rad/s", "accel": "m/s^2", "time": "s"}


def objects(nested):
    for t, w, f in zip(TIME, GYRO, ACCEL):
        if nested == "lists":
            yield {
                "time": float(t),
                "gyro": list(w),
                "accel": list(f),
                "q": [1.0, 0.0, 0.0, 0.0],
                "path": list(range(99)),
            }
        elif nested == "names":
            sensors = {"gyro": dict(zip("xyz", w)), "accel": dict(zip("xyz", f))}
            yield {"time": float(t), "imu": sensors, "ok": True, "who": 'a, "b"\n', "none": None, "alt": float("nan")}
        else:
            yield {"time": float(t), **{f"g{a}": v for a, v in zip("xyz", w)}, **{f"a{a}": v for a, v in zip("xyz", f)}}


def write(path, text):
    path.write_text(text)
    return path


@pytest.mark.parametrize("nested", ["lists", "names", "no"])
@pytest.mark.parametrize("form", ["lines", "array", "array on one line", "array, indented", "indented"])
def test_objects_are_rows(tmp_path, nested, form):
    made = list(objects(nested))
    text = {
        "lines": "".join(json.dumps(one) + "\n" for one in made),
        "array": "[\n" + ",\n".join(map(json.dumps, made)) + "\n]\n",
        "array on one line": json.dumps(made),
        "array, indented": json.dumps(made, indent=2),
        "indented": "\n".join(json.dumps(one, indent=2) for one in made),
    }[form]
    record = read_imu(write(tmp_path / "log.json", text), units=UNITS)
    np.testing.assert_array_equal(record.time, TIME)
    np.testing.assert_array_equal(record.gyro, GYRO)
    np.testing.assert_array_equal(record.accel, ACCEL)


def test_a_receiver(tmp_path):
    rows = [{"utime": 1.7e9 + k, "fix": {"lat": 48.0 + 1e-5 * k, "lon": 11.0, "alt": 500.0}} for k in range(10)]
    record = read_gnss(
        write(tmp_path / "log.json", json.dumps(rows)),
        columns={"time": "utime"} | {name: f"fix.{name}" for name in ("lat", "lon", "alt")},
    )
    np.testing.assert_allclose(np.degrees(record.lat), 48.0 + 1e-5 * np.arange(10))


def test_a_fault_is_named_by_its_line(tmp_path):
    lines = [json.dumps(one) for one in objects("names")]
    lines[20] = lines[20].replace('"gyro"', '"gyro')
    with pytest.raises(DataError, match=r"log\.jsonl: line 21: JSON that is damaged"):
        read_imu(write(tmp_path / "log.jsonl", "\n".join(lines)), units=UNITS)
    lines = [json.dumps(one) for one in objects("names")]
    lines[30] = lines[30].replace(str(ACCEL[30, 2]), '"high"')
    with pytest.raises(DataError, match=r"line 31, column imu\.accel\.z: 'high'"):
        read_imu(write(tmp_path / "log.jsonl", "\n".join(lines)), units=UNITS)


@pytest.mark.parametrize(
    "text",
    [
        json.dumps({"rows": list(objects("lists"))}),
        json.dumps([{"time": [0.0, 0.1]}]),
        '[{"a": 1}, 3, {"a": 2}]',
        '[{"a": ' + "[" * 100000,
        '{"a": ' * 100000,
        '[{"a": ' + "9" * 10000 + "}]",
        json.dumps([{f"n{k}": k for k in range(3000)}] * 2),
        '{"a": {"b": 1',
        '[{"',
    ],
)
def test_other_json_is_refused_with_what_to_do(tmp_path, text):
    with pytest.raises(DataError, match=r"log\.json: line 1: JSON"):
        read_imu(write(tmp_path / "log.json", text))


def test_a_log_that_is_cut_anywhere(tmp_path):
    """The last object is left out; no cut ends in a traceback."""
    made = list(objects("lists"))[:60]
    for text in (json.dumps(made, indent=1), "\n".join(map(json.dumps, made))):
        for end in range(1, len(text), 389):
            path = write(tmp_path / "log.json", text[:end])
            record = read_or_none(path)
            assert record is not None or end < len(text) / 10
            if record is not None:
                np.testing.assert_array_equal(record.gyro, GYRO[: len(record)])


def read_or_none(path):
    """None of a log that is refused."""
    try:
        return read_imu(path, units=UNITS)
    except TruenorthError:
        return None


def test_objects_with_names_of_their_own_are_no_table(tmp_path):
    """20,000 objects with 2,000 names took 43 s to be refused."""
    file = tmp_path / "x.json"
    file.write_text(json.dumps([{f"k{k % 400}": 1, "time": k} for k in range(2000)]))
    with pytest.raises(DataError, match="JSON of another form"):
        read_imu(file)
