"""The page in a browser, watched to convergence on the ring-laser recording; it comes back when the line or the server was gone."""

import os
import signal
import socket
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

from tests.live.browser import Browser, chromium
from tests.recordings import rlg_vehicle_xian
from truenorth.core.position import Position
from truenorth.formats import write_imu
from truenorth.live.session import Session

SHOTS = os.environ.get("SCREENSHOTS")  # a folder to look at them in

DRAWN = """(id => { const c = document.getElementById(id), d = c.getContext("2d").getImageData(0, 0, c.width, c.height).data;
  let n = 0; for (let i = 3; i < d.length; i += 4) n += d[i] > 0; return n; })"""
CANVASES = ("history", "compass", "level", "sigmas", "spectrum", "innovations")


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    """Fifteen minutes of a parked car with people in it; a ring-laser IMU."""
    chromium()
    pytest.importorskip("uvicorn")
    record, _ = rlg_vehicle_xian()
    path = tmp_path_factory.mktemp("rlg") / "log.parquet"
    write_imu(record, path)
    return path


def live(log, port, *more):
    command = [
        sys.executable,
        "-m",
        "truenorth",
        "live",
        f"replay:{log}@{more[0]}",
        "--lat",
        "34.246",
        "--alt",
        "380",
        "--imu",
        "navigation",
    ]
    command += ["--page", f":{port}", "--json", "--every", "0.5", *more[1:]]
    process = subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    assert "page: http" in process.stderr.readline()
    return process


def free_port():
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return free.getsockname()[1]


def kill(process):
    os.killpg(process.pid, signal.SIGKILL)
    process.communicate()


def look(browser, name):
    if SHOTS:
        Path(SHOTS).mkdir(exist_ok=True, parents=True)
        browser.screenshot(Path(SHOTS) / f"{name}.png")


def cut(page):
    """End every connection of a page's server, as a line that breaks does."""
    for connection in list(page._server.server_state.connections):
        connection.loop.call_soon_threadsafe(connection.transport.abort)


@pytest.mark.slow
def test_the_page_is_watched_to_convergence(log, tmp_path):
    from truenorth.live.page import serve

    goal = np.radians(0.1)
    page = serve(":0", goal)
    place = Position.from_degrees(34.246, 0.0, 380.0)
    run = Session(f"replay:{log}@20x", place, "navigation", every=0.5, share=0.5)
    thread = threading.Thread(target=lambda: run.run([page.publish]))
    try:
        with Browser(tmp_path / "browser") as browser:
            thread.start()
            browser.open(page.address)
            browser.wait("last !== null && last.status !== undefined", 120)
            first = browser.ask("last.heading_sigma_deg")
            # The line breaks: the page says so, comes back by itself, and has missed nothing.
            browser.ask("lost = 0; stream.addEventListener('error', () => { lost += 1; })")
            cut(page)
            browser.wait("lost > 0", 30)
            at = browser.ask("last.number")
            browser.wait(f"last.number > {at} + 2 && $('status').className !== 'pill lost'", 60)
            numbers = browser.ask("points.map(p => p.number)")
            assert numbers == list(range(numbers[0], numbers[-1] + 1))
            # To convergence.
            converged = "$('status').textContent === 'aligned' && $('waiting').textContent.startsWith('good to')"
            browser.wait(f"{converged} && (converged = last)", 180)
            found = browser.ask("converged")  # sigma may grow again with the next solution
            assert found["heading_sigma_deg"] < min(0.1, first)
            assert abs(found["heading_deg"] - 90.6) < 4.0 * found["heading_sigma_deg"] + 0.1
            browser.wait("innovations !== null && spectrum !== null", 30)
            shapes = ((1280, 1000, "desktop", "light"), (390, 844, "phone", "light"), (1280, 1000, "dark", "dark"))
            for width, height, name, scheme in shapes:
                browser.prefer(scheme)
                browser.resize(width, height)
                browser.wait(f"innerWidth === {width}", 10)
                browser.ask("new Promise(r => requestAnimationFrame(() => { draw(); r(true); }))")
                assert browser.ask("document.documentElement.scrollWidth <= innerWidth"), name
                for canvas in CANVASES:
                    assert browser.ask(f"{DRAWN}('{canvas}')") > 300, (name, canvas)
                ground = browser.ask("getComputedStyle(document.body).backgroundColor.match(/\\d+/g).map(Number)")
                assert (max(ground[:3]) < 80) == (scheme == "dark"), ground
                look(browser, name)
            assert all(url.startswith((page.address, "about:")) for url in browser.requests), browser.requests
            assert [text for text in browser.complaints if "net::ERR" not in text] == []
            thread.join(timeout=120)
            page.close()
            browser.wait("$('ended').textContent === 'the run has ended' && $('status').className !== 'pill lost'", 30)
    finally:
        page.close()


@pytest.mark.slow
def test_the_page_goes_on_when_the_program_was_killed_and_resumed(log, tmp_path):
    port = free_port()
    options = ("20x", "--share", "0.5", "-o", str(tmp_path / "run"))
    process = live(log, port, *options)
    try:
        with Browser(tmp_path / "browser") as browser:
            browser.open(f"http://127.0.0.1:{port}/")
            browser.wait("last !== null && last.status !== undefined && last.time_s > 100", 120)
            before = browser.ask("last.time_s")
            kill(process)
            browser.wait("$('status').className === 'pill lost'", 30)
            process = live(log, port, *options, "--resume")
            browser.wait(f"last !== null && last.status !== undefined && last.time_s > {before}", 120)
            token = browser.ask('document.documentElement.innerHTML.match(/"X-Token": "([^"]+)"/)[1]')
            assert browser.ask("RUN") == browser.ask("last.run")
            assert len(token) > 16
    finally:
        kill(process)
