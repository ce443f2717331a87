"""What several test files do: run the command, take known lines out of a signal, change an array."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import pytest


def run_command(capsys, monkeypatch, *arguments):
    """Exit code of ``truenorth`` with these arguments, and what it printed (``out`` and ``err``)."""
    from truenorth.cli import main

    monkeypatch.setattr(sys, "argv", ["truenorth", *map(str, arguments)])
    code = 0
    try:
        main()
    except SystemExit as stop:
        code = int(stop.code or 0)
    return code, capsys.readouterr()


def assert_lines(time, signal, lines, left, without):
    """A constant and lines (name to rad/s) leave less than `left` of a signal; without any one of them more than `without`."""

    def share(names):
        columns = [np.ones_like(time)]
        for name in names:
            columns += [np.cos(lines[name] * time), np.sin(lines[name] * time)]
        A = np.stack(columns, axis=1)
        return np.std(signal - A @ np.linalg.lstsq(A, signal)[0]) / np.std(signal)

    assert share(list(lines)) < left
    for name in lines:
        assert share([other for other in lines if other != name]) > without


@contextmanager
def raises_naming(kind: type[Exception], *words: str) -> Iterator[None]:
    """What is done raises this error, and its message has each of the words."""
    with pytest.raises(kind) as error:
        yield
    missing = [word for word in words if word not in str(error.value)]
    assert missing == [], str(error.value)


def changed(a, index, value):
    """A copy of an array with one element or row changed."""
    a = np.array(a)
    a[index] = value
    return a


def come_back(motion, rate, duration, **options):
    """Errors of an ideal IMU through the strapdown from its true start: times, attitude (rad), velocity (m/s), position (m)."""
    from truenorth.core.attitude import rotation_vector_from_dcm
    from truenorth.simulation import simulate
    from truenorth.state.state import State
    from truenorth.strapdown.level import mechanise

    start = motion.states(0.0)
    begin = State.at(start.C_nb, start.lat, start.lon, start.alt, start.v_n)
    computed = mechanise(simulate(motion, rate=rate, duration=duration).record, begin, **options)
    true = motion.states(computed.time)
    turned = rotation_vector_from_dcm(computed.C_nb @ np.swapaxes(true.C_nb, 1, 2))
    moved = computed.position - np.stack([true.lat, true.lon, true.alt], -1)
    moved[:, :2] *= 6.37e6
    return computed.time, turned, computed.v_n - true.v_n, moved


def start_before(record, C_nb, v_n, place, biases, sigma):
    """A start of navigation an interval before a record's first row; `place` holds lat, lon, alt, `sigma` the fifteen states'."""
    from truenorth.state.state import Start

    lat, lon, alt = map(float, place)
    return Start(float(record.time[0] - record.interval), C_nb, v_n, lat, lon, alt, *biases, np.diag(sigma**2))
