"""A live run with sensors that aid: from alignment to navigation, killed and resumed, asked for by the page."""

import json
import os
import signal
import socket
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request

import numpy as np
import pytest

import truenorth as tn
from truenorth.formats import write_imu
from truenorth.live.journal import Journal
from truenorth.live.known_feeds import FEEDS
from truenorth.live.navigator import Navigator
from truenorth.live.session import START, Session
from truenorth.simulation.scenario import read_scenario


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    """A van in town: an IMU's log, a receiver's and an odometer's."""
    folder = tmp_path_factory.mktemp("van")
    content = read_scenario("van").to_mapping()
    content |= {"duration": "90 s", "imu": "tactical", "rate": "50 Hz"}
    content["gnss"] = {"rate": "5 Hz", "position_noise": "0.5 m", "velocity_noise": "0.05 m/s"}
    scenario = read_scenario(content)
    sim, aiding = scenario.simulate(seed=2), scenario.simulate_aiding(seed=2)
    write_imu(sim.record, folder / "log.csv")
    for name in ("gnss", "odometer"):
        aiding[name].record.to_frame().assign(pulse_size=0.04).to_csv(folder / f"{name}.csv")
    return folder


def sources(folder):
    return {name: f"replay:{folder / name}.csv" for name in ("gnss", "odometer")}


def session(logs, speed, **options):
    aids = sources(logs)
    return Session(
        f"replay:{logs / 'log.csv'}@{speed}",
        None,
        "tactical",
        feeds=[FEEDS[key]() for key in aids],
        aids=aids,
        **options,
    )


@pytest.mark.slow
def test_a_replayed_run_on_the_move_is_the_batch_to_the_bit(logs):
    found = session(logs, "max").run()
    record, gnss = tn.read_imu(logs / "log.csv"), tn.read_gnss(logs / "gnss.csv")
    odometer = tn.read_odometer(logs / "odometer.csv")
    end = record.time[-1]
    aid = [tn.Gnss(gnss.between(None, end)), tn.Odometer(odometer.between(None, end))]
    whole = tn.align(record, imu="tactical", aid=aid)
    assert found.status == whole.status == "aligned"
    assert np.array_equal(found.C_nb, whole.C_nb)
    assert np.array_equal(found.phi_covariance, whole.phi_covariance)


@pytest.mark.slow
def test_rows_of_aids_are_kept_and_a_resumed_run_needs_no_log_of_them(logs, tmp_path):
    """The first 50 s, then a run to which only what came after them is given: the answer of the whole to the bit."""
    for half, (first, last) in {"first": (None, 50.0), "second": (50.0, None)}.items():
        (tmp_path / half).mkdir()
        write_imu(tn.read_imu(logs / "log.csv").between(first, last), tmp_path / half / "log.csv")
        for name in ("gnss", "odometer"):
            lines = (logs / f"{name}.csv").read_text().splitlines()
            header = lines[0].split(",").index("time")
            times = [float(line.split(",")[header]) for line in lines[1:]]
            kept = [line for line, t in zip(lines[1:], times) if (t <= 50.0 if half == "first" else t > 50.0)]
            (tmp_path / half / f"{name}.csv").write_text("\n".join([lines[0], *kept]) + "\n")
    folder = tmp_path / "out"
    session(tmp_path / "first", "max", folder=folder).run()
    (folder / START).mkdir()  # as a run leaves it that is killed before the start of navigation is written
    found = session(tmp_path / "second", "max", folder=folder, resume=True).run()
    whole = session(logs, "max").run()
    assert np.array_equal(found.C_nb, whole.C_nb)
    assert np.array_equal(found.phi_covariance, whole.phi_covariance)
    journal = Journal(folder, [FEEDS[key]() for key in sources(logs)], resume=True)
    assert len(journal.aids["gnss"].earlier) == len(tn.read_gnss(logs / "gnss.csv"))
    assert journal.aids["odometer"]._feed.pulse_size == 0.04


def live(*arguments):
    command = [sys.executable, "-m", "truenorth", "live", *map(str, arguments)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True)


@pytest.mark.slow
def test_navigation_killed_and_resumed_goes_on_from_the_same_alignment(logs, tmp_path):
    aids = [text for key, source in sources(logs).items() for text in (f"--{key}", source)]
    arguments = [*aids, "--imu", "tactical", "--until", "0.5 deg", "--navigate", "-o", tmp_path, "--json", "--resume"]
    for _ in range(3):
        process = live(f"replay:{logs / 'log.csv'}@4x", *arguments, "--share", "1")
        for _ in range(600):
            if (tmp_path / START).exists() or process.poll() is not None:
                break
            time.sleep(0.1)
        time.sleep(1.0)
        assert process.poll() is None, process.communicate()
        os.killpg(process.pid, signal.SIGKILL)
        process.communicate()
    process = live(f"replay:{logs / 'log.csv'}@max", *arguments)
    out, err = process.communicate(timeout=120)
    assert process.returncode == 0, err
    final = json.loads(out.splitlines()[-1])
    start = tn.load(tmp_path / START)
    record = tn.read_imu(logs / "log.csv")
    gnss, odometer = tn.read_gnss(logs / "gnss.csv"), tn.read_odometer(logs / "odometer.csv")
    from truenorth.live.onward import as_found

    aid = [
        tn.Gnss(gnss.between(None, record.time[-1]), as_found(start)["gnss"]),
        tn.Odometer(odometer.between(None, record.time[-1])),
    ]
    whole = tn.navigate(record, start, aid=aid, interval=0.2, output=1.0)
    assert final["lat_deg"] == np.degrees(whole.position[-1, 0])
    assert final["heading_deg"] == np.degrees(whole.euler[-1, 0])


class ByHand:
    """A session in a thread, whose rows come over TCP when the test sends them: nothing depends on how fast it runs."""

    def __init__(self, logs, **options):
        self.server = socket.create_server(("127.0.0.1", 0))
        self.session = session(logs, "max", every=0.05, share=1.0, **options)
        self.session.source = f"tcp://127.0.0.1:{self.server.getsockname()[1]}"
        self.header, *self.lines = (logs / "log.csv").read_bytes().splitlines(keepends=True)
        self.now, self.found = (None, None, ""), []
        self.thread = threading.Thread(target=lambda: self.found.append(self.session.run([self.see])))

    def see(self, run, answer, note):
        self.now = (run, answer, note)

    def __enter__(self):
        self.thread.start()
        self.line, _ = self.server.accept()
        self.line.sendall(self.header)
        return self

    def send(self, count):
        """The next rows."""
        self.line.sendall(b"".join(self.lines[:count]))
        del self.lines[:count]

    def wait_for(self, happened):
        """Until this holds of what was last published."""
        until = time.monotonic() + 120.0
        while not happened(*self.now):
            assert self.thread.is_alive()
            assert time.monotonic() < until, self.now
            time.sleep(0.02)

    def drive(self, happened):
        """Rows until this holds of what was published; the next ones only when the last ones have been solved for.

        The number of rows that were sent.
        """
        sent, solutions = 0, 0
        for count in np.diff([0, 1250, 1500, 1800, 2200, 2700, 3300, 4000]):
            self.send(count)
            sent += count
            self.wait_for(
                lambda run, answer, note, n=sent, m=solutions: (
                    happened(run, answer, note)
                    or (run is not None and run.intake.counts.taken == n and (run.solutions > m or run.failure))
                )
            )
            if happened(*self.now):
                return sent
            solutions = self.now[0].solutions
        self.wait_for(happened)
        return sent

    def __exit__(self, *error):
        self.line.close()
        self.thread.join()
        self.server.close()


def heading_known(run, answer, note):
    return answer is not None and answer.heading_known


def navigates(run, answer, note):
    return isinstance(run, Navigator)


@pytest.mark.slow
def test_it_goes_on_to_navigation_when_the_heading_is_good(logs, tmp_path):
    with ByHand(logs, until=np.radians(0.5), navigate=True, folder=tmp_path) as run:
        run.drive(navigates)
        run.send(len(run.lines))
    (alignment,), found = run.found, run.session.navigation
    assert alignment.euler_sigma[0] <= 1.1 * np.radians(0.5)
    assert found.status == run.now[1].status == "navigated"
    assert found.time[0] == pytest.approx(alignment.time, abs=0.03)
    assert found.time[-1] == pytest.approx(90.0, abs=0.03)
    assert tn.load(tmp_path / START).time == alignment.time
    # The rows of both parts are kept.
    kept = sum(len(rows) for _, rows in Journal(tmp_path, resume=True).earlier())
    assert kept == len(tn.read_imu(logs / "log.csv"))


@pytest.mark.slow
def test_navigation_that_begins_with_the_last_row_leaves_the_alignment(logs):
    """Rows end, heading is good, and an interrupt or the end of the stream comes without another row."""
    with ByHand(logs) as run:  # a drive that is noticed before a solution knows of it would begin navigation by itself
        sent = run.drive(heading_known)
        run.wait_for(lambda aligner, *_: aligner.intake.counts.taken == sent)
        run.session.navigate = True
        run.session.go.set()
        run.wait_for(navigates)
        _, answer, note = run.now
    (found,) = run.found
    assert found.status == answer.status == "aligned"
    assert answer.time == found.time
    assert run.session.navigation is None
    assert run.session.without == note
    assert "fewer than two rows came after the alignment at" in note


@pytest.mark.slow
def test_the_page_asks_for_navigation_by_its_token_alone(logs):
    pytest.importorskip("uvicorn")
    from truenorth.live.page import serve

    run = ByHand(logs, navigate=True)
    page = serve(":0", 0.01, run.session.go)
    try:
        with run:
            text = urllib.request.urlopen(page.address, timeout=60).read().decode()
            token = text.split('"X-Token": "')[1].split('"')[0]
            for headers in ({}, {"X-Token": "guessed"}, {"X-Token": token, "Origin": "http://elsewhere.example"}):
                with pytest.raises(urllib.error.HTTPError, match="403"):
                    urllib.request.urlopen(urllib.request.Request(page.address + "go", b"", headers), timeout=60)
            run.drive(heading_known)
            assert not run.session.go.is_set()
            urllib.request.urlopen(urllib.request.Request(page.address + "go", b"", {"X-Token": token}), timeout=60)
            assert run.session.go.is_set()
            run.wait_for(navigates)
            run.send(len(run.lines))
        assert run.session.navigation.status == "navigated"
    finally:
        page.close()
