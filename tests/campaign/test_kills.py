"""Workers, schedulers and whole campaigns that die: nothing is lost, nothing stands twice."""

import os
import random
import re
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pandas as pd
import pytest
import yaml

from tests.campaign.test_plan import PLAN
from truenorth.campaign import read_table, run_campaign
from truenorth.campaign.execution import work
from truenorth.campaign.store import versions
from truenorth.core.errors import UsageError


@pytest.fixture(scope="module")
def cluster():
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0") as started:
        yield started


@pytest.mark.slow
def test_a_dask_cluster_gives_the_same_bits(undisturbed, tmp_path, cluster):
    table = run_campaign(PLAN, tmp_path, scheduler=cluster.scheduler_address).table
    pd.testing.assert_frame_equal(table, undisturbed.table, check_exact=True)


@pytest.mark.slow
def test_a_cluster_started_as_the_documentation_says(undisturbed, tmp_path):
    """The three lines of docs/campaigns.md, each in a process of its own, here on one machine."""
    Client = pytest.importorskip("distributed").Client
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = str(free.getsockname()[1])
    text = (Path(__file__).parents[2] / "docs/campaigns.md").read_text(encoding="utf-8")
    lines = re.findall(r"^    ((?:dask|truenorth campaign) .*?)(?: +#.*)?$", text, re.MULTILINE)
    lines = [line.replace("8786", port).replace("host", "127.0.0.1").split() for line in lines]
    scheduler, worker, campaign = (line for line in lines if {"scheduler", "worker", "--scheduler"} & set(line))
    (tmp_path / "plan.yaml").write_text(yaml.safe_dump(PLAN), encoding="utf-8")
    quiet = {"cwd": tmp_path, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    started = [subprocess.Popen([sys.executable, "-m", *line], **quiet) for line in (scheduler, worker)]
    try:
        with Client(f"tcp://127.0.0.1:{port}", timeout="60s", set_as_default=False) as client:
            client.wait_for_workers(1, timeout=60)
        subprocess.run([sys.executable, "-m", *campaign], check=True, **quiet)
    finally:
        for process in reversed(started):
            process.terminate()
            process.wait()
    pd.testing.assert_frame_equal(read_table(tmp_path / "out"), undisturbed.table, check_exact=True)


@pytest.mark.slow
def test_a_lost_worker_of_a_cluster_loses_nothing(undisturbed, tmp_path, cluster):
    assert_a_worker_may_die(cluster, undisturbed, tmp_path)


def assert_a_worker_may_die(cluster, undisturbed, folder):
    """The first block done, a worker is killed; the table is that of an undisturbed campaign."""
    lost = []

    def kill_one(done, total):
        if done and not lost:
            lost.append(next(iter(cluster.workers.values())).pid)
            os.kill(lost[0], signal.SIGKILL)

    plan = PLAN | {"block": 1}
    table = run_campaign(plan, folder, scheduler=cluster.scheduler_address, progress=kill_one).table
    assert lost
    pd.testing.assert_frame_equal(table, undisturbed.table, check_exact=True)


@pytest.mark.slow
def test_workers_with_other_versions_are_refused(tmp_path, cluster, monkeypatch):
    monkeypatch.setattr("truenorth.campaign.execution.versions", lambda: versions() | {"numpy": "0.0"})
    with pytest.raises(UsageError, match=r"a worker of the cluster, on .* should have numpy 0\.0 \(here "):
        run_campaign(PLAN, tmp_path, scheduler=cluster.scheduler_address)
    assert not list((tmp_path / "runs").iterdir())


@pytest.mark.slow
def test_a_scheduler_that_goes_away_leaves_what_was_done(undisturbed, tmp_path):
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=":0") as cluster:

        def close(done, total):
            if done:
                cluster.close()

        with pytest.raises(UsageError, match="the scheduler went away"):
            run_campaign(PLAN | {"block": 1}, tmp_path, scheduler=cluster.scheduler_address, progress=close)
    table = run_campaign(PLAN | {"block": 1}, tmp_path).table
    pd.testing.assert_frame_equal(table, undisturbed.table, check_exact=True)


@pytest.mark.slow
def test_no_cluster(tmp_path):
    with pytest.raises(UsageError, match="no Dask scheduler answers there"):
        run_campaign(PLAN, tmp_path, scheduler="tcp://127.0.0.1:1")


def _killed_and_resumed(folder, kills, undisturbed, seed):
    """Start the command, kill it -9 at random moments, start it again; then to the end."""
    (folder / "plan.yaml").write_text(yaml.safe_dump(PLAN))
    command = [
        sys.executable,
        "-m",
        "truenorth",
        "campaign",
        str(folder / "plan.yaml"),
        "-o",
        str(folder / "out"),
        "--workers",
        "1",
    ]
    chance = random.Random(seed)
    for _ in range(kills):
        process = subprocess.Popen(
            command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
        )
        time.sleep(chance.uniform(0.5, 4.0))
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    pd.testing.assert_frame_equal(read_table(folder / "out"), undisturbed.table, check_exact=True)
    assert not [path for path in (folder / "out" / "runs").iterdir() if "part" in path.name]


@pytest.mark.slow
def test_killed_and_started_again_it_ends_as_if_nothing_had_been(undisturbed, tmp_path):
    _killed_and_resumed(tmp_path, 2, undisturbed, 1)


@pytest.mark.slow
def test_killed_at_twenty_moments(undisturbed, tmp_path):
    _killed_and_resumed(tmp_path, 20, undisturbed, 2)


@pytest.mark.slow
def test_a_worker_that_dies_is_replaced(undisturbed, tmp_path, monkeypatch):
    """The first worker process to touch the marker's place kills itself, once."""
    marker = tmp_path / "dying"
    marker.touch()
    monkeypatch.setenv("TRUENORTH_TEST_MARKER", str(marker))
    monkeypatch.setattr("truenorth.campaign.execution.work", dying_work)
    table = run_campaign(PLAN, tmp_path / "out", workers=2).table
    assert not marker.exists()
    pd.testing.assert_frame_equal(table, undisturbed.table, check_exact=True)


@pytest.mark.slow
def test_workers_end_with_their_parent(tmp_path):
    """Killed -9, a campaign leaves no process behind."""
    (tmp_path / "plan.yaml").write_text(yaml.safe_dump(PLAN | {"runs": 400, "block": 50}))
    command = [sys.executable, "-m", "truenorth", "campaign", "plan.yaml", "-o", "out", "--workers", "2"]
    process = subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    deadline = time.monotonic() + 60.0
    while len(children_of(process.pid)) < 2 and time.monotonic() < deadline:
        time.sleep(0.05)
    workers = children_of(process.pid)
    assert len(workers) >= 2
    time.sleep(2.0)  # they have started, and work
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    deadline = time.monotonic() + 20.0
    while any(alive(worker) for worker in workers) and time.monotonic() < deadline:
        time.sleep(0.1)
    assert not any(alive(worker) for worker in workers)


def children_of(pid):
    try:
        text = Path(f"/proc/{pid}/task/{pid}/children").read_text()
    except FileNotFoundError:
        pytest.skip("this system has no /proc with the children of a process")
    return [int(word) for word in text.split()]


def alive(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().split(")")[-1].split()[0] != "Z"
    except FileNotFoundError:
        return False


@pytest.mark.slow
def test_the_only_worker_of_a_cluster_dies_and_is_replaced(undisturbed, tmp_path):
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=":0") as cluster:
        assert_a_worker_may_die(cluster, undisturbed, tmp_path)


def dying_work(plan, block):
    marker = Path(os.environ["TRUENORTH_TEST_MARKER"])
    try:
        marker.unlink()
    except FileNotFoundError:
        return work(plan, block)
    os.kill(os.getpid(), signal.SIGKILL)
    return None
