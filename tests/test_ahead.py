"""What is compiled by a second process is what the first one will ask for."""

import subprocess
import sys

import pytest

from truenorth import align, imu_spec
from truenorth.alignment.bias_step import _follow
from truenorth.alignment.matched import _sum_back
from truenorth.alignment.motion_likelihood import _folded_autocovariances
from truenorth.cli import ahead
from truenorth.core import kernel_folder
from truenorth.core.kernel_lock import KernelLock
from truenorth.core.position import Position
from truenorth.errors.sway import fill_blocks
from truenorth.filters.gains import _fill, _parts, _through
from truenorth.filters.linear import linear_runs
from truenorth.simulation import Sway, Tone, simulate
from truenorth.strapdown.inertial_integration import _integrate_attitude

PLACE = Position.from_degrees(45.0)
SHIP = Sway(PLACE, pitch_tones=(Tone(0.1, 7.0),), roll_tones=(Tone(0.15, 9.0),), lever_arm=(1.0, 2.0, 1.0))
KERNELS = (
    linear_runs,
    _folded_autocovariances,
    fill_blocks,
    _sum_back,
    _fill,
    _parts,
    _through,
    _follow,
    _integrate_attitude,
)


def test_its_kernels_are_those_of_an_alignment():
    record = simulate(SHIP, rate=20.0, duration=80.0, imu=imu_spec("navigation"), seed=1).record
    assert align(record, PLACE, "navigation").method == "swaying"
    before = [kinds(kernel) for kernel in KERNELS]
    assert all(before)
    ahead.filter_sway()
    ahead.sway()
    ahead.match()
    ahead.turn()
    ahead._filtered(ahead.STATES)
    assert [kinds(kernel) for kernel in KERNELS] == before


def kinds(kernel):
    """Signatures but for the size, which is the first where there is one."""
    return {signature[kernel is linear_runs :] for signature in kernel.signatures}


def test_it_starts_where_the_kernels_are_not_on_the_disk(tmp_path, monkeypatch):
    started = []
    monkeypatch.setattr(kernel_folder, "write_folder", lambda: tmp_path)
    monkeypatch.setattr(ahead.os, "cpu_count", lambda: 2)
    monkeypatch.setattr(ahead.subprocess, "Popen", lambda command, **options: started.append(command))
    ahead.compile_ahead()
    assert [command[-1] for command in started] == [ahead.CODE]
    lock = KernelLock(tmp_path / ahead.NAME)
    lock.take()
    ahead.compile_ahead()  # there is one already
    assert len(started) == 1
    lock.release()
    (tmp_path / f"{ahead.LAST}-0123.kernel").touch()
    ahead.compile_ahead()
    assert len(started) == 1


def test_it_ends_behind_the_kernel_in_which_the_first_process_ends(tmp_path, monkeypatch):
    done = []
    monkeypatch.setattr(kernel_folder, "write_folder", lambda: tmp_path)
    monkeypatch.setattr(ahead, "_wait_for_end", lambda end: done.append(end))

    def job():
        done[0].set()

    monkeypatch.setattr(ahead, "JOBS", (job, lambda: done.append("more")))
    ahead.compile_last()
    assert done[1:] == []
    assert not KernelLock(tmp_path / ahead.NAME).taken()


@pytest.mark.slow
def test_it_ends_with_the_first_process():
    process = subprocess.Popen([sys.executable, "-c", ahead.CODE], stdin=subprocess.PIPE)
    process.stdin.close()
    assert process.wait(60) == 0
