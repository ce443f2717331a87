"""Interrupts while workers start or work: the campaign ends soon, and no worker is left."""

import os
import random
import signal
import subprocess
import sys
import threading
import time

import pytest
import yaml

from tests.campaign.test_kills import alive, children_of
from tests.campaign.test_plan import PLAN
from truenorth.campaign import execution
from truenorth.campaign.execution import pool_of, uninterrupted

pytestmark = pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")


def test_an_interrupt_that_another_thread_receives_waits_too():
    """A worker that is being started would be left behind: nothing would send it work or its end."""
    done, passed = threading.Event(), []
    other = threading.Thread(target=done.wait)
    other.start()

    def interrupted() -> None:
        with uninterrupted():
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(0.1)
            passed.append(True)

    try:
        with pytest.raises(KeyboardInterrupt):
            interrupted()
    finally:
        done.set()
        other.join()
    assert passed
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


@pytest.mark.parametrize("started", [False, True])
def test_an_interrupt_does_not_wait_for_what_is_under_way(started):
    workers = []

    def interrupted() -> None:
        with pool_of(1) as pool:
            with uninterrupted():
                future = pool.submit(time.sleep, 60.0)
            workers.extend(pool._processes.values())
            while started and not future.running():
                time.sleep(0.01)
            raise KeyboardInterrupt

    begun = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert time.monotonic() - begun < 20.0
    assert workers
    assert not any(worker.is_alive() for worker in workers)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(8))
def test_two_interrupts_while_workers_start(tmp_path, seed):
    chance = random.Random(seed)
    (tmp_path / "plan.yaml").write_text(yaml.safe_dump(PLAN | {"runs": 400, "block": 50}), encoding="utf-8")
    command = [sys.executable, "-m", "truenorth", "campaign", "plan.yaml", "-o", "out", "--workers", "2"]
    with (tmp_path / "said").open("w") as said:
        process = subprocess.Popen(command, cwd=tmp_path, stdout=said, stderr=said, start_new_session=True)
        try:
            deadline = time.monotonic() + 60.0
            while not children_of(process.pid) and time.monotonic() < deadline:
                time.sleep(0.005)
            time.sleep(chance.uniform(0.0, 0.5))
            workers = children_of(process.pid)
            process.send_signal(signal.SIGINT)
            time.sleep(chance.choice([0.0, chance.uniform(0.0, 0.05)]))
            os.killpg(process.pid, signal.SIGINT)
            code = process.wait(timeout=10.0)
        finally:
            process.kill()
            process.wait()
    assert code in (130, -signal.SIGINT), (tmp_path / "said").read_text()
    assert workers
    deadline = time.monotonic() + 5.0
    while any(alive(worker) for worker in workers) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not any(alive(worker) for worker in workers)


def test_an_interrupt_that_leaves_a_lock_behind_is_an_interrupt(monkeypatch):
    """A second one within Python's own wait ended as an internal error: "release unlocked lock"."""

    def twice(*_, **__):
        try:
            raise KeyboardInterrupt
        except KeyboardInterrupt:
            raise RuntimeError("release unlocked lock")  # noqa: B904 (as Python does)

    monkeypatch.setattr(execution, "wait", twice)
    with pytest.raises(KeyboardInterrupt):
        execution._first_of([])

    def broken(*_, **__):
        raise RuntimeError("another one")

    monkeypatch.setattr(execution, "wait", broken)
    with pytest.raises(RuntimeError, match="another one"):
        execution._first_of([])
