"""Figures of the real recordings, to compare two versions: run it in each checkout, with the recordings in ``../shared/data``.

``python -m benchmarks.recordings > now.txt``; for the first version (commit 2416601), whose calls had other names,
``PYTHONPATH=OLD_CHECKOUT python benchmarks/recordings.py > then.txt``.
A line: status, heading, pitch, roll, one sigma of each (deg), method.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

sys.path.append(str(Path(__file__).resolve().parents[1]))

import itertools

import truenorth as tn
from tests import recordings

FIRST = hasattr(tn, "align_in_motion")  # the first version: a call for each procedure


def _windows(record: Any, length: float) -> list[Any]:
    start = record.time[0] - record.interval
    edges = start + length * np.arange(int(record.duration / length + 0.01) + 1) + 1e-6
    return [record.between(a, b) for a, b in itertools.pairwise(edges)]


def _moving(record: Any, imu: str, **aids: Any) -> Any:
    if FIRST:
        return tn.align_in_motion(record, imu, **aids)
    kinds = {"gnss": tn.Gnss, "odometer": tn.Odometer}
    return tn.align(record, imu=imu, aid=[kinds[name](aid) for name, aid in aids.items()])


def _cases() -> Iterator[tuple[str, Any]]:
    record, place = recordings.rlg_vehicle_xian()
    windows = _windows(record, 300.0)
    for k, window in enumerate(windows):
        yield f"ring laser, 300 s, window {k + 1}", partial(tn.align, window, place)
        yield f"ring laser, 300 s, window {k + 1}, navigation grade", partial(tn.align, window, place, "navigation")
    for method in ("analytic", "inertial", "oba"):
        yield f"ring laser, 300 s, {method}", partial(tn.align, windows[0], place, method=method)
    for k, window in enumerate(_windows(record, 120.0)):
        yield f"ring laser, 120 s, window {k + 1}", partial(tn.align, window, place)
    record, place, _ = recordings.navgrade_static_beijing()
    yield "laboratory", partial(tn.align, record, place)
    yield "laboratory, navigation grade", partial(tn.align, record, place, "navigation")
    record, place = recordings.fog_gps_xian()
    yield "fibre-optic gyros, engine idles, 50 s", partial(tn.align, record.between(None, 50.0), place)
    yield "the same, with GNSS", partial(_moving, record, "navigation", gnss=recordings.fog_gps_xian_gnss())
    record, place = recordings.static_adis16405()
    yield "ADIS16405, 120 s", partial(tn.align, record.between(None, 120.0), place)
    yield "ADIS16405, 10,000 s", partial(tn.align, record, place)
    for direction in ("east", "north"):
        yield f"Xsens, {direction}", partial(tn.align, *recordings.xsens_four_headings(direction))
    record, place = recordings.stim300_cart_chicago()
    yield "STIM300 on a cart, 80 s", partial(tn.align, record.between(None, record.time[0] + 80.0), place)
    yield "the same, with GNSS", partial(_moving, record, "industrial", gnss=recordings.stim300_cart_chicago_gnss())
    record, odometer, gnss = recordings.car_mems_odo_gnss()
    yield "car, odometer and GNSS", partial(_moving, record, "consumer", odometer=odometer, gnss=gnss)
    slave, master = recordings.transfer_fog_mems()
    if FIRST:
        yield "transfer", partial(tn.align_transfer, slave, master, "consumer")
    else:
        yield "transfer", partial(tn.align, slave, imu="consumer", aid=[tn.Master(master)])


def main() -> None:
    """Print a line for each recording."""
    for name, aligned in _cases():
        answer = aligned()
        angles = np.degrees([answer.heading, answer.pitch, answer.roll, *answer.euler_sigma])
        print(f"{name:48} {answer.status:14}", *(f"{x:.10g}" for x in angles), answer.method, flush=True)


if __name__ == "__main__":
    main()
