"""The drives of the study: the ring, a straight road, wheel slip, a stop at the end; the logs of many runs, and their truth."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.azimuth_filters import Logs
from truenorth.core.position import Position
from truenorth.records import ImuRecord, OdometerRecord
from truenorth.records.specs import ImuSpec
from truenorth.simulation.scenario import Scenario, read_scenario
from truenorth.simulation.streams import stream
from truenorth.state.track import Track

Array = NDArray[np.float64]

SLIPS, SLIP_TIME, SLIP_SIZE = 6, 1.5, 0.3
STANDING = 300.0  # s of static alignment after the drive, the paper's reference
STOPPED = 615.0  # s: the ring's drive and its stop have ended
BIAS_STEP = 9.80665e-3  # m/s^2: 1 mg
SLIP_STREAM, START_STREAM = 310, 311


def ring() -> Scenario:
    """The shipped scenario."""
    return read_scenario("odometer_ring")


def changed(**content: Any) -> Scenario:
    """The ring with other content."""
    return read_scenario({**ring().to_mapping(), **content})


def straight() -> Scenario:
    """Ten minutes straight on, at a steady speed."""
    legs = [
        {"kind": "straight", "duration": "5 s"},
        {"kind": "accelerate", "to": "10 m/s", "acceleration": "1 m/s^2"},
        {"kind": "straight", "duration": "600 s"},
    ]
    return changed(motion={"kind": "legs", "heading": "40 deg", "legs": legs})


def with_stop() -> Scenario:
    """The ring, then a stop and five minutes at rest."""
    content = ring().to_mapping()
    more = [
        {"kind": "accelerate", "to": "0 m/s", "acceleration": "1 m/s^2"},
        {"kind": "straight", "duration": f"{STANDING + 60.0} s"},
    ]
    return changed(
        motion={**content["motion"], "legs": [*content["motion"]["legs"], *more]}, duration=f"{STOPPED + STANDING} s"
    )


def with_walk(walk: str) -> Scenario:
    """The ring with another random walk of the gyros."""
    content = ring().to_mapping()
    imu = dict(content["imu"])
    return changed(imu={**imu, "gyro": {**imu["gyro"], "random_walk": walk}})


@dataclass(frozen=True)
class Drives:
    """The logs of R runs of one motion, and the truth at the ends of the K filter intervals."""

    scenario: Scenario
    records: list[ImuRecord]  # lists of the records
    odometers: list[OdometerRecord]  # lists of the records
    steps: Array  # (N,) s
    dtheta: Array  # (R, N, 3)
    dvel: Array  # (R, N, 3)
    wheel: Array  # (R, N) m: distance in each sample
    rows: NDArray[np.int64]  # (K+1,): samples before each epoch
    time: Array  # (K,) s
    truth: Track  # K+1 epochs, the start first
    gyro_bias: Array  # (R, 3): true
    accel_bias: Array  # (R, 3)

    @property
    def spec(self) -> ImuSpec:
        """Of the IMU."""
        return self.scenario.imu_spec

    @property
    def logs(self) -> Logs:
        """As the loop of the paper's model takes them."""
        return Logs(self.steps, self.dtheta, self.dvel, self.wheel, self.rows, self.time)

    @property
    def scale_sigma(self) -> float:
        """Of the odometer."""
        return float(self.scenario.aiding_specs["odometer"].scale_sigma)  # type: ignore[attr-defined]

    @property
    def position(self) -> Position:
        """At the start, known well: what the filters of the study are given."""
        return Position(*self.place)

    @property
    def place(self) -> tuple[float, float, float]:
        """Of the start."""
        lat, lon, alt = self.truth.position[0].tolist()
        return lat, lon, alt


def drive(scenario: Scenario, runs: int, seed: int, *, until: float | None = None) -> Drives:
    """Simulate the logs of a scenario.

    Parameters
    ----------
    scenario : Scenario
    runs, seed : int
    until : float, s, optional
        Of the drive; the whole without it.
    """
    ideal = scenario.ideal()
    records, odometers, gyro, accel = [], [], [], []
    for run in range(runs):
        simulated = scenario.simulate(seed=seed, run=run, ideal=ideal)
        record = simulated.record
        if until is not None:
            record = record.between(0.0, until)
        odometers.append(scenario.simulate_aiding(seed=seed, run=run)["odometer"].record)
        records.append(record)
        gyro.append(simulated.errors.gyro_bias)
        accel.append(simulated.errors.accel_bias)
    interval = ideal.interval
    count = len(records[0])
    edges: Array = interval * np.arange(count + 1.0)
    per_second = round(1.0 / interval)
    rows = np.arange(0, count + 1, per_second)
    return Drives(
        scenario,
        records,
        odometers,
        np.full(count, interval),
        np.stack([r.gyro for r in records]),
        np.stack([r.accel for r in records]),
        _by_sample(odometers, edges),
        rows.astype(np.int64),
        edges[rows[1:]],
        Track.along(ideal.motion.states(edges[rows])),
        np.stack(gyro),
        np.stack(accel),
    )


def slipping(drives: Drives, seed: int) -> Drives:
    """The same drives with six windows of 1.5 s, drawn for each run, in which the wheel counts 30 % too much."""
    content, duration = drives.scenario.to_mapping(), drives.scenario.duration
    odometers = []
    for run in range(len(drives.records)):
        begins = stream(seed, 0, run, SLIP_STREAM).uniform(20.0, duration - 20.0, SLIPS)
        slips = [[f"{t} s", f"{t + SLIP_TIME} s", f"{100 * SLIP_SIZE} %"] for t in begins]
        own = read_scenario({**content, "odometer": {**content["odometer"], "slips": slips}})
        odometers.append(own.simulate_aiding(seed=seed, run=run)["odometer"].record)
    edges = np.append(0.0, np.cumsum(drives.steps))
    return replace(drives, odometers=odometers, wheel=_by_sample(odometers, edges))


def stepping(drives: Drives) -> Drives:
    """The same drives; the bias of the y accelerometer changes abruptly at half time."""
    dvel, half = drives.dvel.copy(), len(drives.steps) // 2
    dvel[:, half:, 1] += BIAS_STEP * drives.steps[half:]
    return replace(drives, dvel=dvel)


def coarser(drives: Drives, every: int) -> Drives:
    """The same drives with filter intervals that take so many of theirs together."""
    at = slice(None, None, every)
    return replace(
        drives,
        rows=drives.rows[at],
        time=drives.time[every - 1 :: every],
        truth=drives.truth[at],
    )


def _by_sample(odometers: list[OdometerRecord], edges: Array) -> Array:
    """(R, N) distance in each sample, m: an odometer's row shared evenly."""
    ways = [np.interp(edges, np.append(0.0, o.time), np.append(0.0, np.cumsum(o.distance))) for o in odometers]
    return np.diff(np.stack(ways), axis=1)


def starts(runs: int, seed: int, azimuth: float, level_sigma: float) -> Array:
    """(R, 3) what each run begins with, rad: drawn tilts, and the azimuth to one side or the other."""
    draws = [stream(seed, 0, run, START_STREAM) for run in range(runs)]
    phi = np.stack([rng.standard_normal(3) for rng in draws])
    return np.column_stack([level_sigma * phi[:, :2], azimuth * np.sign(phi[:, 2])])
