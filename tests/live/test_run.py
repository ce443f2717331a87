"""A live run from bytes to the answer: every source, any chunks, kill -9 and resume, a page that is open while rows come."""

import json
import os
import pty
import random
import signal
import socket
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request
from dataclasses import replace

import numpy as np
import pytest

from truenorth.alignment import align
from truenorth.core.attitude import dcm_from_euler
from truenorth.core.errors import DataError, UsageError
from truenorth.core.position import Position
from truenorth.formats import write_imu
from truenorth.formats.layout import Layout
from truenorth.live.binary_rows import binary_row
from truenorth.live.decode import Decoder
from truenorth.live.journal import Journal
from truenorth.live.outputs import nmea_lines
from truenorth.live.remaining import seconds_to
from truenorth.live.session import Session
from truenorth.live.sources import open_source
from truenorth.records.specs import imu_spec
from truenorth.simulation import rest, simulate

PLACE = Position.from_degrees(45.0, 10.0)
WHERE = ["--lat", "45", "--lon", "10", "--imu", "navigation"]


@pytest.fixture(scope="module")
def record():
    return simulate(rest(PLACE, 0.7, 0.02, -0.03), rate=50.0, duration=60.0, imu=imu_spec("navigation"), seed=3).record


@pytest.fixture(scope="module")
def log(record, tmp_path_factory):
    path = tmp_path_factory.mktemp("log") / "log.csv"
    write_imu(record, path)
    return path


def rows_of(record):
    return np.column_stack([record.time, record.gyro, record.accel])


@pytest.mark.parametrize("chunk", [1, 7, 4000])
def test_csv_lines_are_the_rows_of_the_file_to_the_bit(record, log, chunk):
    text, decoder = log.read_bytes()[:40_000], Decoder(Layout(), "test")
    rows = [decoder.feed(text[at : at + chunk]) for at in range(0, len(text), chunk)]
    found = np.vstack([part for part in rows if len(part)])
    assert decoder.kind == record.kind
    assert decoder.broken == 0
    assert np.array_equal(found, rows_of(record)[: len(found)])
    assert len(found) > 100


def test_binary_rows_survive_noise_between_them(record):
    rows, noise = rows_of(record)[:50], np.random.default_rng(2)
    data = b"".join(noise.bytes(int(noise.integers(0, 30))) + binary_row(row[0], row[1:4], row[4:]) for row in rows)
    data = data.replace(binary_row(rows[20, 0], rows[20, 1:4], rows[20, 4:])[:30], b"x" * 30)
    decoder = Decoder(Layout(), "test")
    found = np.vstack([decoder.feed(data[at : at + 11]) for at in range(0, len(data), 11)])
    assert np.array_equal(found, np.delete(rows, 20, axis=0))


def test_units_axes_and_half_a_message(record):
    decoder = Decoder(Layout(units={"gyro": "deg/s", "accel": "g"}, axes="FRD"), "test")
    found = decoder.feed(
        b"time,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z\n0.01,1,2,3,0.1,0.2,-1\nrubbish\n0.02,1,2\n0.03,1,"
    )
    assert decoder.broken == 2
    np.testing.assert_allclose(found[0, 1:4], np.radians([2.0, 1.0, -3.0]))
    np.testing.assert_allclose(found[0, 4:], 9.80665 * np.array([0.2, 0.1, 1.0]))
    assert len(decoder.feed(b"2,3,0.1,0.2,-1\n")) == 1


def test_headings_of_other_devices_and_a_turned_column():
    decoder = Decoder(Layout(), "test")
    found = decoder.feed(
        b"timestamp [ms],gyroX (deg/s),gyroY (deg/s),gyroZ (deg/s),accX (g),accY (g),accZ (g)\n10,1,2,3,0,0,1\n"
    )
    np.testing.assert_allclose(found, [[0.01, *np.radians([1.0, 2.0, 3.0]), 0.0, 0.0, 9.80665]])
    decoder = Decoder(Layout(columns={"gyro_y": "-wy"}), "test")
    found = decoder.feed(b"time,gyro_x,wy,gyro_z,accel_x,accel_y,accel_z\n1,1,2,3,0,0,9\n")
    np.testing.assert_allclose(found[0, 1:4], [1.0, -2.0, 3.0])
    with pytest.raises(DataError, match="names no unit"):
        Decoder(Layout(), "test").feed(b"t_s,gyroX,gyroY,gyroZ,accX,accY,accZ\n")


def test_rows_without_time_take_that_of_their_arrival():
    decoder = Decoder(Layout(), "test", now=iter([10.0, 10.5]).__next__)
    found = decoder.feed(b"0,0,0,0,0,9.8\n0,0,0,0,0,9.8\n")
    assert found[:, 0].tolist() == [10.0, 10.5]
    assert decoder.arrival_time


@pytest.mark.parametrize(
    ("data", "words"),
    [(b"a,b,c\n1,2,3\n", "no column gyro_x"), (b"1,2,3\n", "3 numbers"), (b"x" * 5000, "without the end")],
)
def test_what_is_no_log_is_refused(data, words):
    with pytest.raises(DataError, match=words):
        Decoder(Layout(), "test").feed(data)


@pytest.mark.parametrize(
    "text", ["carrier-pigeon:9", "udp://", "replay:missing.csv", "tcp://127.0.0.1:1", "replay:{log}@0x"]
)
def test_sources_that_cannot_be(text, log):
    with pytest.raises(UsageError, match="source"):
        open_source(text.format(log=log), Layout())


def final_of(text):
    answers = [json.loads(line) for line in text.splitlines()]
    assert answers[-1].pop("final")
    return answers[-1], answers[:-1]


def expected(record):
    return json.loads(json.dumps(align(record, PLACE, "navigation").summary()))


def same_answer(found, wanted):
    left = {key: value for key, value in found.items() if key not in ("source", "imu_source")}
    return left == {key: wanted[key] for key in left}


def live(*arguments, **options):
    command = [sys.executable, "-m", "truenorth", "live", *map(str, arguments)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **options)


@pytest.mark.parametrize(
    "how", ["replay", *(pytest.param(how, marks=pytest.mark.slow) for how in ("stdin", "udp", "tcp"))]
)
def test_every_source_gives_the_answer_of_the_file(how, record, log):
    lines = log.read_bytes().splitlines(keepends=True)
    if how == "replay":
        process = live(f"replay:{log}@max", *WHERE, "--json", "--every", "0.2")
        out, err = process.communicate(timeout=120)
    elif how == "stdin":
        with log.open("rb") as file:
            process = live("-", *WHERE, "--json", stdin=file)
            out, err = process.communicate(timeout=120)
    elif how == "udp":
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
            free.bind(("127.0.0.1", 0))
            port = free.getsockname()[1]
        process = live(f"udp://:{port}", *WHERE, "--json", "--every", "0.2")
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            assert "rows from udp" in process.stderr.readline()
            for at in range(0, len(lines), 20):
                sender.sendto(b"".join(lines[at : at + 20]), ("127.0.0.1", port))
                time.sleep(0.002)
        time.sleep(2.0)
        process.send_signal(signal.SIGTERM)
        out, err = process.communicate(timeout=120)
    else:
        with socket.create_server(("127.0.0.1", 0)) as server:
            process = live(f"tcp://127.0.0.1:{server.getsockname()[1]}", *WHERE, "--json")
            connection, _ = server.accept()
            with connection:
                connection.sendall(b"".join(lines))
        out, err = process.communicate(timeout=120)
    assert process.returncode == 0, err
    found, answers = final_of(out)
    assert same_answer(found, expected(record))
    assert "Traceback" not in err
    assert answers


def test_a_serial_line(record, log):
    """A pair of pseudo-terminals: what is written on one is read on the other."""
    pytest.importorskip("serial")
    ours, theirs = pty.openpty()
    try:
        source = iter(open_source(f"serial:{os.ttyname(theirs)}?baud=921600", Layout()))
        data, found = log.read_bytes()[:30_000], []
        for at in range(0, len(data), 1000):
            os.write(ours, data[at : at + 1000])
            found.append(next(source))
        while sum(map(len, found)) < data.count(b"\n") - 1:  # but for the header
            found.append(next(source))
    finally:
        os.close(ours)
        os.close(theirs)
    rows = np.vstack(found)
    assert np.array_equal(rows, rows_of(record)[: len(rows)])


@pytest.mark.slow
@pytest.mark.parametrize("kills", [3, 20])
def test_killed_and_resumed_the_last_answer_is_the_same_to_the_bit(kills, record, log, tmp_path):
    folder, chance = tmp_path / "out", random.Random(kills)
    arguments = [f"replay:{log}@20x", *WHERE, "-o", str(folder), "--json", "--resume"]
    for _ in range(kills):
        process = live(*arguments, start_new_session=True)
        time.sleep(chance.uniform(1.0, 6.0))
        os.killpg(process.pid, signal.SIGKILL)
        process.communicate()
    process = live(*arguments)
    out, err = process.communicate(timeout=120)
    assert process.returncode == 0, err
    assert same_answer(final_of(out)[0], expected(record))
    kept = np.vstack([rows for _, rows in Journal(folder, resume=True).earlier()])
    assert np.array_equal(kept, rows_of(record))


def test_rows_of_an_earlier_run_are_not_overwritten(log, tmp_path):
    session = Session(f"replay:{log}@max", PLACE, "navigation", folder=tmp_path)
    session.run()
    with pytest.raises(UsageError, match="earlier run"):
        session.run()


def test_it_stops_when_the_heading_is_good(log):
    answers = []
    goal = np.radians(1.0)
    session = Session(f"replay:{log}@30x", PLACE, "navigation", until=goal, every=0.05, share=1.0)
    found = session.run([lambda aligner, answer, note: answers.append(answer)])
    assert found.euler_sigma[0] <= 1.1 * goal
    assert found.time < 60.0
    waits = [answer.remaining(goal) for answer in answers if answer is not None]
    assert waits[-1] == 0.0
    # A time that has passed without the wish being met is not "now".
    sigma = float(found.euler_sigma[0])
    late = seconds_to(found, sigma, 0.9 * sigma, found.time + 1000.0)
    assert 0.0 < seconds_to(found, sigma, 0.9 * sigma, found.time) < 60.0 < late
    assert seconds_to(found, sigma, sigma, found.time) == 0.0


def test_nmea_has_its_checksum_and_heading(log):
    answers = []
    Session(f"replay:{log}@max", PLACE, "navigation", every=1e-3).run([lambda a, answer, n: answers.append(answer)])
    heading, attitude = nmea_lines(answers[-1])
    text, checksum = heading[1:].split("*")
    total = 0
    for letter in text:
        total ^= ord(letter)
    assert total == int(checksum, 16)
    assert text == f"HEHDT,{np.degrees(answers[-1].euler[0]):.4f},T"
    assert attitude.split(",")[2:5] == [
        f"{np.degrees(answers[-1].euler[0]):.3f}",
        "T",
        f"{np.degrees(answers[-1].euler[2]):+.3f}",
    ]


@pytest.mark.parametrize(
    ("at", "stamp"), [(119.9996, "000200.000"), (86399.9999, "000000.000"), (3661.5, "010101.500")]
)
def test_nmea_is_rounded_before_it_is_written(at, stamp, log):
    """It had seconds of 60.000 and a heading of 360.000."""
    answers = []
    Session(f"replay:{log}@max", PLACE, "navigation", every=1e-3).run([lambda a, answer, n: answers.append(answer)])
    north = replace(answers[-1], time=at, C_nb=dcm_from_euler(2.0 * np.pi - 1e-8, 0.0, 0.0))
    heading, attitude = nmea_lines(north)
    assert heading.startswith("$HEHDT,0.0000,T")
    assert attitude.split(",")[1:3] == [stamp, "0.000"]


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["udp", "tcp"])
def test_lines_go_to_a_socket(kind, log):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM if kind == "udp" else socket.SOCK_STREAM) as line:
        line.settimeout(60.0)
        line.bind(("127.0.0.1", 0))
        port = line.getsockname()[1]
        if kind == "tcp":
            line.close()
        process = live(f"replay:{log}@20x", *WHERE, "--json", "--every", "0.1", "--to", f"{kind}://127.0.0.1:{port}")
        assert "rows from" in process.stderr.readline()
        if kind == "udp":
            answers = [json.loads(line.recv(65536))]
        else:
            with socket.create_connection(("127.0.0.1", port), timeout=60.0) as client:
                lines = client.makefile().read().splitlines()
            answers = [json.loads(text) for text in lines]
            assert answers[-1]["final"]
        out, err = process.communicate(timeout=120)
    assert process.returncode == 0, err
    assert out == ""
    assert answers[0]["status"] in ("aligned", "not_converged", "level_only")


@pytest.mark.parametrize("text", ["udp://:9000", "tcp://", "http://127.0.0.1:80", "tcp://192.0.2.1:9000"])
def test_places_for_lines_that_cannot_be(text):
    from truenorth.live.sending import open_sink

    with pytest.raises(UsageError, match=r"expected udp|cannot be opened"):
        open_sink(text)


def test_the_page_shows_answers_to_its_own_origin_alone(log):
    pytest.importorskip("uvicorn")
    from truenorth.live.page import serve

    page = serve(":0", 0.01)
    try:
        run = threading.Thread(
            target=lambda: Session(f"replay:{log}@60x", PLACE, "navigation", every=0.1).run([page.publish])
        )
        run.start()
        text = urllib.request.urlopen(page.address, timeout=10).read().decode()
        assert "http" not in text.replace("Truenorth", "")
        stream = urllib.request.urlopen(page.address + "events", timeout=30)
        events = []
        while len(events) < 5 or events[-1].get("status") is None:
            line = stream.readline().decode()
            if line.startswith("data: "):
                events.append(json.loads(line[6:]))
        assert events[-1]["status"] in ("aligned", "not_converged", "level_only")
        seen = events[-1]["number"]
        again = urllib.request.Request(
            page.address + "events", headers={"Last-Event-ID": f"{events[-1]['run']}-{seen}"}
        )
        later = urllib.request.urlopen(again, timeout=30)
        run.join()
        numbers = []
        while not numbers:
            line = later.readline().decode()
            if line.startswith("data: "):
                numbers.append(json.loads(line[6:])["number"])
        assert numbers[0] == seen + 1
        for headers in ({"Origin": "http://elsewhere.example"}, {"Host": "elsewhere.example"}):
            with pytest.raises(urllib.error.HTTPError, match="403"):
                urllib.request.urlopen(urllib.request.Request(page.address, headers=headers), timeout=10)
        with pytest.raises(urllib.error.HTTPError, match="405"):
            urllib.request.urlopen(urllib.request.Request(page.address, data=b"x"), timeout=10)
    finally:
        page.close()


@pytest.mark.parametrize("address", ["8080x", ":99999", "nowhere.invalid:80"])
def test_page_addresses_that_cannot_be(address):
    from truenorth.live.page import serve

    with pytest.raises(UsageError, match="page address"):
        serve(address, 0.01)


def test_before_the_first_answer_the_page_says_what_it_waits_for_and_what_failed():
    pytest.importorskip("uvicorn")
    from truenorth.live import Aligner
    from truenorth.live.page import serve

    page = serve(":0", 0.01)
    try:
        with Aligner(PLACE, "navigation") as aligner:
            aligner.failure = "the log cannot be aligned"
            page.publish(aligner, None, "2 lines could not be read")
        event = json.loads(page._events[-1][1])
    finally:
        page.close()
    assert event["waiting"] == "the first answer comes after 20 s of log"
    assert event["note"] == "2 lines could not be read; the log cannot be aligned"
    assert "status" not in event


def test_a_page_says_that_its_run_has_ended():
    pytest.importorskip("uvicorn")
    from truenorth.live.page import serve

    page = serve(":0", 0.01)
    stream = urllib.request.urlopen(page.address + "events", timeout=30)
    page.close()
    events = [json.loads(line[6:]) for line in stream.read().decode().splitlines() if line.startswith("data: ")]
    assert events[-1]["ended"] is True


@pytest.mark.parametrize(
    ("status", "sigma", "floor", "words"),
    [
        ("navigated", 0.05, 0.0, "heading good to 0.1 deg"),
        ("inconsistent", 0.05, 0.01, "heading may not be used; the findings say why"),
        ("aligned", 0.3, 0.12, "0.1 deg is out of reach: the floor of these gyros is 0.12 deg"),
    ],
)
def test_a_wish_is_spoken_of_in_degrees(status, sigma, floor, words):
    from truenorth.live.answer import Answer
    from truenorth.live.intake import Counts
    from truenorth.live.outputs import waiting

    class Solution:
        history, euler_sigma_floor = None, np.radians([floor, 0.0, 0.0])

    sigmas, floors = np.radians([sigma, 0.01, 0.01]), np.radians([floor, 0.0, 0.0])
    answer = Answer(100.0, np.eye(3), sigmas, floors, status, (), Solution(), Counts())
    assert waiting(answer, np.radians(0.1)) == words
