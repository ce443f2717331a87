"""Damaged inputs further in than the readers: scenarios, plans, saved results, and logs that no sensor writes, up to the answer."""

import json
import math
import os
import re
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import truenorth
from tests.campaign.test_plan import PLAN
from tests.fuzz.test_readers import EXAMPLES, SETTLED, SPICE, in_time
from truenorth.campaign import read_plan
from truenorth.core.errors import AlignmentError, DataError, TruenorthError
from truenorth.core.position import Position
from truenorth.navigation.start import read_start
from truenorth.records.specs import imu_spec
from truenorth.simulation import rest, simulate
from truenorth.simulation.scenario import read_scenario

PLACE = Position.from_degrees(45.0, 10.0)

SCENARIO = b"""name: quay
duration: 60 s
rate: 20 Hz
position: {lat: 45 deg, lon: 10 deg}
imu: navigation
motion: {kind: sway, heading: 10 deg, tones: {roll: [{amplitude: 2 deg, period: 7 s}]}}
gnss: {rate: 1 Hz, position_noise: 1 m}
"""


def spoilt(data, content):
    content = bytearray(content)
    for _ in range(data.draw(st.integers(1, 4))):
        place, gone = data.draw(st.integers(0, len(content))), data.draw(st.integers(0, 20))
        content[place : place + gone] = data.draw(st.binary(max_size=8) | st.sampled_from(SPICE))
    return bytes(content)


@pytest.mark.parametrize("kind", ["scenario", "plan"])
def test_a_damaged_scenario_or_plan(kind, tmp_path_factory):
    path = tmp_path_factory.mktemp("yaml") / f"{kind}.yaml"
    path.write_bytes(SCENARIO)
    if kind == "plan":
        path.write_text(json.dumps(PLAN))
    content = path.read_bytes()

    @SETTLED
    @given(data=st.data())
    def attempt(data):
        path.write_bytes(spoilt(data, content))
        with in_time():
            try:
                (read_scenario if kind == "scenario" else read_plan)(path)
            except TruenorthError:
                return

    attempt()


@pytest.fixture(scope="module")
def sound():
    """A minute at rest, with its answer."""
    record = simulate(rest(PLACE, 0.3), rate=20.0, duration=60.0, imu=imu_spec("navigation"), seed=1).record
    return record, truenorth.align(record, PLACE, "navigation")


def test_a_damaged_result_as_a_start(sound, tmp_path_factory):
    folder = tmp_path_factory.mktemp("result")
    truenorth.save(sound[1], folder)
    files = {path: path.read_bytes() for path in folder.iterdir()}

    @SETTLED
    @given(data=st.data())
    def attempt(data):
        hurt = data.draw(st.sampled_from(sorted(files)))
        for path, content in files.items():
            path.write_bytes(spoilt(data, content) if path == hurt else content)
        with in_time():
            try:
                start, *_ = read_start(folder)
            except TruenorthError:
                return
        assert np.isfinite(start.C_nb).all()
        assert np.isfinite(start.P).all()

    attempt()


VALUES = st.sampled_from([0.0, -1.0, 1e-300, 1e5, -1e5, 1e-3, 9.8, math.pi])


@settings(SETTLED, max_examples=max(5, EXAMPLES // 10))
@given(data=st.data())
def test_an_answer_holds_no_nan(sound, data):
    """Stretches, channels and clocks spoilt by any amount: an error of ours, or an answer of numbers that JSON can hold."""
    record = sound[0]
    time, gyro, accel = record.time.copy(), record.gyro.copy(), record.accel.copy()
    for _ in range(data.draw(st.integers(1, 3))):
        first = data.draw(st.integers(0, len(record) - 1))
        rows = slice(first, first + data.draw(st.sampled_from([1, 5, 100, len(record)])))
        values, axis = (gyro, accel)[data.draw(st.integers(0, 1))], data.draw(st.integers(0, 2))
        match data.draw(st.integers(0, 5)):
            case 0:
                values[rows, axis] = data.draw(VALUES)
            case 1:
                values[rows] *= data.draw(VALUES)
            case 2:
                values[rows, axis] += data.draw(VALUES)
            case 3:
                values[rows] = values[rows][:, ::-1]
            case 4:
                time = time * data.draw(st.sampled_from([1e-6, 1e-3, 10.0, 1e3, 1e9]))
            case 5:
                time[rows] += data.draw(st.sampled_from([1e-4, 0.3, 100.0]))
    spec = data.draw(st.sampled_from(["navigation", "consumer", None]))
    with in_time():
        try:
            answer = truenorth.align(replace(record, time=time, gyro=gyro, accel=accel), PLACE, spec)
        except TruenorthError:
            return
    json.dumps(answer.summary(), allow_nan=False)
    assert np.isfinite(answer.C_nb).all()
    assert np.isfinite(answer.phi_covariance).all()
    assert not re.search(r"\b(nan|inf|None)\b", " ".join(answer.reasons)), answer.reasons


def run(*arguments, cwd=None):
    """The command in a process of its own: exit code and the last line that it says; never a traceback, never a signal."""
    done = subprocess.run(
        [sys.executable, "-m", "truenorth", *map(os.fspath, arguments)],
        capture_output=True,
        cwd=cwd,
        timeout=60,
        env=os.environ | {"PYTHONIOENCODING": "utf-8"},
    )
    text = done.stderr.decode(errors="replace")
    assert "Traceback" not in text, text
    assert done.returncode >= 0, f"signal {-done.returncode}"
    return done.returncode, text


HOSTILE = {
    "a device": lambda folder: "/dev/zero",
    "a name that is not UTF-8": lambda folder: write(folder / os.fsdecode(b"log\xff.csv"), b"time,gyro_x\n1,2\n"),
    "digits of another script": lambda folder: write(folder / "log.csv", table("٠٫١")),
    "quoted cells": lambda folder: write(folder / "log.csv", table('"0.1"')),
    "values of 1e200": lambda folder: write(folder / "log.csv", table("1e200")),
    "NMEA with a semicolon": lambda folder: write(
        folder / "log.nmea", b"$GPGGA;100000.00;4806.0;N;01130.0;E;1;08\r\n" * 5
    ),
    "braces": lambda folder: write(folder / "log.yaml", b"{{ }}"),
    "brackets": lambda folder: write(folder / "log.csv", b"[" * 2000),
}


def write(path, content):
    path.write_bytes(content)
    return path


def table(cell):
    rows = "".join(f"{0.01 * k:.2f},{cell},0.1,0.1,0.1,0.1,9.8\n" for k in range(1, 200))
    return ("time,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z\n" + rows).encode()


@pytest.mark.slow
@pytest.mark.parametrize("name", HOSTILE)
def test_a_hostile_file_is_one_message(name, tmp_path):
    code, text = run("align", HOSTILE[name](tmp_path), "--lat", "45", "--lon", "10", "--imu", "navigation")
    assert code in (0, 1, 2, 3, 4), text
    if name not in ("quoted cells", "values of 1e200"):
        assert code != 0
    assert len(text.strip().splitlines()) <= 12


@pytest.mark.slow
@pytest.mark.parametrize(
    "text",
    [
        b"name: x\nduration: 1e6 s\nrate: 1e8 Hz\nposition: {lat: 45 deg}\nimu: navigation\nmotion: {kind: rest}\n",
        b"a: &a [x, x, x]\n" + b"".join(b"%c: &%c [*%c, *%c, *%c]\n" % (c + 1, c + 1, c, c, c) for c in range(97, 115)),
        b"name: x\nduration: 2024-01-01\n",
        b"name: x\nduration: !!python/object:os.system ls\n",
        b"[" * 2000,
    ],
    ids=["1e14 samples", "anchors", "date", "tag", "brackets"],
)
def test_a_hostile_scenario_is_one_message(text, tmp_path):
    code, said = run("simulate", write(tmp_path / "scenario.yaml", text), "-o", tmp_path / "out")
    assert code not in (0, 70), said
    assert len(said.strip().splitlines()) <= 12


def test_dead_gyros_are_named(sound):
    record = sound[0]
    with pytest.raises(AlignmentError, match="all gyros read zero in every row: are they dead"):
        truenorth.align(replace(record, gyro=0.0 * record.gyro), PLACE, "navigation")


def test_a_specification_that_says_nothing_is_no_perfect_imu(sound):
    with pytest.raises(DataError, match=r"a perfect IMU is ImuSpec\(\)"):
        truenorth.align(sound[0], PLACE, {})


@pytest.mark.parametrize("wrong", [None, 3, "log.csv", [1, 2], {"time": 1}])
def test_what_is_no_record_is_named(wrong):
    with pytest.raises(TruenorthError, match="record"):
        truenorth.align(wrong, PLACE, "navigation")
