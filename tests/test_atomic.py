"""Files are written whole or not at all: whichever call of the system fails, the old set stands or the new one."""

import builtins
import errno
import io
import os
import threading
from contextlib import contextmanager, suppress

import pytest

from truenorth.core.atomic import atomic_files, atomic_path, protected
from truenorth.core.errors import UsageError

NAMES = ("a.json", "b.csv", "c.html")


def write_set(folder, text):
    with atomic_files() as file:
        for name in NAMES:
            file(folder / name).write_text(text)


def contents(folder):
    return {path.name: path.read_text() for path in folder.iterdir()}


@contextmanager
def failing(monkeypatch, number):
    """The `number`-th call that writes, renames, links or syncs fails as on a full disk; gives the count of calls."""
    calls = [0]

    def fail_at(function, counts):
        def wrapped(*args, **kwargs):
            if counts(*args, **kwargs):
                calls[0] += 1
                if calls[0] == number:
                    raise OSError(errno.ENOSPC, "No space left on device", str(args[0]))
            return function(*args, **kwargs)

        return wrapped

    def writes(file, mode="r", *args, **kwargs):
        return any(letter in mode for letter in "wax+")

    with monkeypatch.context() as patch:
        for name in ("replace", "link", "fsync"):
            patch.setattr(os, name, fail_at(getattr(os, name), lambda *args, **kwargs: True))
        # A hidden temporary name that cannot be removed stays, and is no result.
        visible = fail_at(os.unlink, lambda path, **kwargs: not os.path.basename(path).startswith("."))
        patch.setattr(os, "unlink", visible)
        opened = fail_at(builtins.open, writes)
        patch.setattr(builtins, "open", opened)
        patch.setattr(io, "open", opened)
        yield calls


def all_or_nothing(monkeypatch, save, folder, old, new):
    """Fail each call in turn until one run comes through; after each the folder holds `old` or `new`, no temporary file."""
    for number in range(1, 1000):
        with failing(monkeypatch, number) as calls, suppress(UsageError, OSError):
            save()
        assert contents(folder) in (old, new)
        if calls[0] < number:
            assert contents(folder) == new
            return number - 1
    raise AssertionError("no end")


@pytest.mark.parametrize("before", [{}, dict.fromkeys(NAMES, "old"), {"b.csv": "old"}])
def test_whichever_call_fails_the_old_set_stands_or_the_new_one(tmp_path, monkeypatch, before):
    for name, text in before.items():
        (tmp_path / name).write_text(text)
    calls = all_or_nothing(
        monkeypatch, lambda: write_set(tmp_path, "new"), tmp_path, before, dict.fromkeys(NAMES, "new")
    )
    assert calls >= 3 * len(NAMES)


def test_an_interrupt_between_two_names_puts_the_old_ones_back(tmp_path, monkeypatch):
    write_set(tmp_path, "old")
    real, calls = os.replace, []

    def interrupted(source, target):
        calls.append(target)
        if len(calls) == 2:
            raise KeyboardInterrupt
        real(source, target)

    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", interrupted)
        with pytest.raises(KeyboardInterrupt):
            write_set(tmp_path, "new")
    assert contents(tmp_path) == dict.fromkeys(NAMES, "old")


def test_a_file_system_without_hard_links_keeps_the_old_set_too(tmp_path, monkeypatch):
    def no_links(source, target):
        raise OSError(errno.EPERM, "Operation not permitted")

    monkeypatch.setattr(os, "link", no_links)
    write_set(tmp_path, "old")
    write_set(tmp_path, "new")
    assert contents(tmp_path) == dict.fromkeys(NAMES, "new")


def test_two_threads_write_one_folder_and_each_set_is_whole(tmp_path):
    texts = [str(number) * 100_000 for number in range(4)]
    threads = [
        threading.Thread(target=lambda text=text: [write_set(tmp_path, text) for _ in range(10)]) for text in texts
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    found = contents(tmp_path)
    assert set(found) == set(NAMES)
    assert len(set(found.values())) == 1


def test_a_set_waits_until_another_stands(tmp_path, monkeypatch):
    """However the threads take turns: the second set is not between the first one's files."""
    real, threads = os.replace, []

    def replace_slowly(source, target):
        real(source, target)
        if not threads:
            threads.append(threading.Thread(target=write_set, args=(tmp_path, "second")))
            threads[0].start()
            threads[0].join(0.2)

    monkeypatch.setattr(os, "replace", replace_slowly)
    write_set(tmp_path, "first")
    threads[0].join()
    assert contents(tmp_path) == dict.fromkeys(NAMES, "second")


def test_an_input_is_not_replaced(tmp_path):
    log = tmp_path / "log.csv"
    log.write_text("measured")
    with (
        protected([log, tmp_path / "missing"]),
        pytest.raises(UsageError, match="is an input of the command"),
        atomic_path(tmp_path / "." / "log.csv") as temporary,
    ):
        temporary.write_text("result")
    assert contents(tmp_path) == {"log.csv": "measured"}
    with atomic_path(log) as temporary:  # outside the block it is a file like any other
        temporary.write_text("result")
    assert contents(tmp_path) == {"log.csv": "result"}


def test_a_folder_of_inputs_keeps_all_its_files(tmp_path):
    write_set(tmp_path, "alignment")
    with protected([tmp_path]), pytest.raises(UsageError, match="is an input of the command"):
        write_set(tmp_path, "navigation")
    assert contents(tmp_path) == dict.fromkeys(NAMES, "alignment")
