"""What is compiled by a second process is what the first one will ask for."""

import subprocess
import sys

import pytest

from truenorth import align, imu_spec
from truenorth.alignment.bias_step import _follow
from truenorth.alignment.motion_likelihood import _folded_autocovariances
from truenorth.alignment.summed_back import sum_back
from truenorth.cli import ahead
from truenorth.core import kernel_folder, processor
from truenorth.core.kernel_lock import KernelLock
from truenorth.core.position import Position
from truenorth.core.ready import kind_of
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
    sum_back,
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
    assert kind_of(ahead._of_last()) in sum_back.signatures
    assert [kinds(kernel) for kernel in KERNELS] == before


def kinds(kernel):
    """Signatures but for the size, which is the first where there is one."""
    return {signature[kernel is linear_runs :] for signature in kernel.signatures}


def test_it_starts_where_the_kernels_are_not_on_the_disk(tmp_path, monkeypatch):
    started = []
    monkeypatch.setattr(kernel_folder, "write_folder", lambda: tmp_path)
    monkeypatch.setattr(ahead.os, "cpu_count", lambda: 2)
    monkeypatch.setattr(ahead.subprocess, "Popen", lambda command, **options: started.append(command))
    monkeypatch.setattr(ahead, "_ships", lambda: False)
    ahead.compile_ahead()
    assert [command[-1] for command in started] == [ahead.CODE]
    lock = KernelLock(tmp_path / ahead.NAME)
    lock.take()
    ahead.compile_ahead()  # there is one already
    assert len(started) == 1
    lock.release()
    monkeypatch.setattr(ahead, "_ships", lambda: True)
    ahead.compile_ahead()
    assert len(started) == 1
    monkeypatch.setattr(ahead, "_ships", lambda: False)
    (tmp_path / f"{ahead.LAST}-0123.kernel").touch()
    ahead.compile_ahead()
    assert len(started) == 1


def test_what_comes_with_the_package_counts_where_it_is_of_these_sources(tmp_path, monkeypatch):
    monkeypatch.setattr(processor, "SHIPPED", tmp_path)
    monkeypatch.setattr(processor, "shipped_level", lambda: "x86-64-v3")
    folder = processor.folder_of("x86-64-v3")
    folder.mkdir()
    asked = []
    monkeypatch.setattr(sum_back, "is_there", lambda *arguments: asked.append(arguments) or len(asked) > 1)
    assert not ahead._ships()
    assert asked == []
    (folder / f"{ahead.LAST}-0123.code").touch()
    assert not ahead._ships()  # of other sources
    assert ahead._ships()


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
