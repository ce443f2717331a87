"""Faults that once passed in silence, of the sizes they had then: what each procedure says of them now.

Run: ``python -m benchmarks.once_silent``. The column "before" was measured by a reviewer on an earlier version, on logs of
their own (error, and sigma then); "now" is this version on three drawn logs of each procedure
(`truenorth/campaign/fault_benches.py`).
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from truenorth.campaign.fault_benches import BENCHES, misses
from truenorth.campaign.faults import GOOD
from truenorth.core.errors import TruenorthError
from truenorth.records import ImuRecord

Inputs = dict[str, Any]
DEG = np.pi / 180.0
SEED, RUNS = 8210, 3


@dataclass(frozen=True)
class Row:
    """A fault of one size on one procedure."""

    bench: str
    name: str
    before: str  # error and sigma then
    spoil: Callable[[Inputs], Inputs]


def _imu(change: Callable[[ImuRecord], ImuRecord]) -> Callable[[Inputs], Inputs]:
    return lambda i: i | {"record": change(i["record"])}


def _columns(sensor: str, order: list[int], signs: tuple[float, ...] = (1.0, 1.0, 1.0)) -> Callable[[Inputs], Inputs]:
    return _imu(lambda r: replace(r, **{sensor: getattr(r, sensor)[:, order] * np.array(signs)}))


def _fast(r: ImuRecord) -> ImuRecord:
    return replace(r, time=r.time[0] + (r.time - r.time[0]) / 1.02)


def _late(seconds: float) -> Callable[[Inputs], Inputs]:
    def change(r: ImuRecord) -> ImuRecord:
        rows = max(1, round(seconds / r.interval))
        return ImuRecord(r.time[rows:], r.gyro[:-rows], r.accel[rows:], r.kind, r.source)

    return _imu(change)


def _held(r: ImuRecord) -> ImuRecord:
    rows = 10 * (np.arange(len(r)) // 10)
    return replace(r, gyro=r.gyro[rows], accel=r.accel[rows])


def _clipped(r: ImuRecord) -> ImuRecord:
    """The liveliest gyro at .7 of its largest value."""
    gyro = r.gyro.copy()
    axis = int(np.argmax(np.abs(gyro).max(axis=0)))
    most = 0.7 * np.abs(gyro[:, axis]).max()
    gyro[:, axis] = np.clip(gyro[:, axis], -most, most)
    return replace(r, gyro=gyro)


def _step(r: ImuRecord) -> ImuRecord:
    gyro = r.gyro.copy()
    unit = r.interval if r.kind == "increments" else 1.0
    gyro[len(gyro) // 2 :, 2] += 5.0 * DEG / 3600.0 * unit
    return replace(r, gyro=gyro)


def _turned(degrees: float) -> Callable[[Inputs], Inputs]:
    def spoil(i: Inputs) -> Inputs:
        v, a = i["gnss"].v_n, degrees * DEG
        C = np.array([[np.cos(a), -np.sin(a), 0.0], [np.sin(a), np.cos(a), 0.0], [0.0, 0.0, 1.0]])
        return i | {"gnss": replace(i["gnss"], v_n=v @ C.T)}

    return spoil


def _start(change: Callable[[Any], Any]) -> Callable[[Inputs], Inputs]:
    return lambda i: i | {"start": change(i["start"])}


def _negative(start: Any) -> Any:
    P = start.P.copy()
    P[0, 0] = -P[0, 0]
    return replace(start, P=P)


ROWS = (
    Row("swaying", "gyro x and y exchanged", "80.8 deg, .08", _columns("gyro", [1, 0, 2])),
    Row("swaying", "sign of gyro y", "-9.3 deg, .08", _columns("gyro", [0, 1, 2], (1.0, -1.0, 1.0))),
    Row("swaying", "a gyro clipped", ".48 deg, .055", _imu(_clipped)),
    Row("rotary", "IMU clock 2 % fast", "71 deg, 1.4", _imu(_fast)),
    Row(
        "rotary",
        "encoder angles exchanged",
        "-77 deg, 1.2",
        lambda i: i | {"encoder": replace(i["encoder"], angles=i["encoder"].angles[:, ::-1])},
    ),
    Row("rotary", "gyros .5 s late", "12 deg, 1.5", _late(0.5)),
    Row("rotary", "gyros .05 s late", "1.36 deg, .15", _late(0.05)),
    Row("rotary", "samples held for 10 rows", ".96 deg, .011", _imu(_held)),
    Row("gnss", "velocities turned by .5 deg", ".45 deg, .027", _turned(0.5)),
    Row("gnss", "velocities turned by 1 deg", ".89 deg, .027", _turned(1.0)),
    Row("gnss", "velocities turned by 2 deg", "1.75 deg, .027", _turned(2.0)),
    Row("transfer", "accelerometers x and y exchanged", "38.5 deg, 1.3", _columns("accel", [1, 0, 2])),
    Row(
        "transfer",
        "master's V_E and V_N exchanged",
        "8.5 deg, 1.7",
        lambda i: i | {"master": replace(i["master"], v_n=i["master"].v_n[:, [1, 0, 2]])},
    ),
    Row("transfer", "slave's clock 2 % fast", "1.12 deg, .024", _imu(_fast)),
    Row("odometer", "a gyro clipped", "level .7 deg, 300 sigmas", _imu(_clipped)),
    Row("odometer", "a bias step of 5 deg/h", "-.2 deg, .026", _imu(_step)),
    Row("navigate", "a start whose matrix is zero", "`navigated`", _start(lambda s: replace(s, C_nb=np.zeros((3, 3))))),
    Row("navigate", "a start with a negative variance", "`navigated`", _start(_negative)),
    Row("navigate", "a start in the other hemisphere", "`navigated`", _start(lambda s: replace(s, lat=-s.lat))),
)


def outcome(row: Row, run: int) -> tuple[str, float]:
    """``refused``, a status, ``warned``, ``within`` or ``SILENT``; and the largest error in its sigma."""
    bench = BENCHES[row.bench]
    inputs, truth = bench.draw(SEED, run)
    try:
        answer = bench.align(row.spoil(inputs))
    except TruenorthError:
        return "refused", np.nan
    worst = max(float(np.abs(x).max()) for x in misses(answer, truth).values())
    if answer.status not in GOOD:
        return answer.status, worst
    if any(item.urgent for item in answer.evidence):
        return "warned", worst
    return ("within" if worst <= 4.0 else "SILENT"), worst


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=RUNS)
    runs = parser.parse_args().runs
    print("| procedure | fault | before: error, sigma | now |\n| --- | --- | --- | --- |")
    for row in ROWS:
        found = [outcome(row, run) for run in range(runs)]
        words = [what if what != "within" else f"good, {worst:.1f} sigma" for what, worst in found]
        print(f"| {row.bench} | {row.name} | {row.before} | {'; '.join(words)} |", flush=True)


if __name__ == "__main__":
    main()
