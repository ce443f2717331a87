"""Speed of the mechanisation beside python-ins, on the same increments in the same run.

A slow turn over the ellipsoid, 10 minutes at 100 Hz. Both go from increments to attitude, velocity and position after
each sample, with one-sample coning and sculling; that they agree is checked first. python-ins returns a table with
Euler angles, so its compiled loop is timed alone too. Run: ``python -m benchmarks mechanisation``.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pandas as pd
from pyins import strapdown as pyins_strapdown
from pyins import transform
from pyins.util import ACCEL_COLS, GYRO_COLS, LLA_COLS, RPH_COLS, VEL_COLS

from benchmarks.timing import best as seconds
from truenorth.core.attitude import dcm_from_euler
from truenorth.records import ImuRecord
from truenorth.strapdown.level import NavigationState, inertial_integrals, integrate_attitude, mechanise

T, COUNT, REPEATS = 0.01, 60_000, 7
C_FRD_RFU = np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, -1]])  # of vectors; north-east-down from ENU as well
LIMIT = 120.0  # ns a sample


def log() -> ImuRecord:
    """A vehicle that sways and turns: integrals of sinusoids over each interval, about 1 g along up."""
    t = T * np.arange(COUNT + 1)
    angle = np.stack([0.02 * np.sin(0.9 * t), 0.03 * np.sin(1.1 * t + 1), 0.6 * np.sin(0.05 * t)], axis=1)
    velocity = np.stack([0.5 * np.sin(0.7 * t), 0.8 * np.sin(0.3 * t), 9.798 * t], axis=1)
    return ImuRecord(t[1:], np.diff(angle, axis=0), np.diff(velocity, axis=0), "increments")


def best(call: Callable[[], object]) -> float:
    """Shortest time a sample over repeats, ns."""
    return 1e9 * seconds(call, REPEATS) / COUNT


def main() -> None:
    record = log()
    lat, lon, alt = np.radians(34.2), np.radians(108.9), 400.0
    state = NavigationState.at(dcm_from_euler(1.0, 0.01, -0.02), lat, lon, alt)

    # python-ins wants the sample before the first; its own one-sample algorithm then makes the same corrections.
    frd = np.hstack([record.gyro @ C_FRD_RFU.T, record.accel @ C_FRD_RFU.T])
    imu = pd.DataFrame(
        np.vstack([np.zeros(6), frd]), np.concatenate([[0.0], record.time]), columns=GYRO_COLS + ACCEL_COLS
    )
    rph = transform.mat_to_rph(C_FRD_RFU @ state.C_nb @ C_FRD_RFU.T)
    pva = pd.Series(
        [np.degrees(lat), np.degrees(lon), alt, 0, 0, 0, *rph], index=LLA_COLS + VEL_COLS + RPH_COLS, name=0.0
    )
    increments = pyins_strapdown.compute_increments_from_imu(imu, "increment")

    def theirs() -> pd.DataFrame:
        return pyins_strapdown.Integrator(pva).integrate(increments)

    theta, dv = (np.ascontiguousarray(increments[[f"{name}_{axis}" for axis in "xyz"]]) for name in ("theta", "dv"))
    dt = np.ascontiguousarray(increments.dt)
    lla, v, mat = np.empty((COUNT + 1, 3)), np.empty((COUNT + 1, 3)), np.empty((COUNT + 1, 3, 3))
    lla[0], v[0], mat[0] = pva[LLA_COLS], 0.0, transform.mat_from_rph(rph)

    def their_loop() -> None:
        pyins_strapdown.integrate(dt, lla, v, mat, theta, dv, 0, True)

    ours, table = mechanise(record, state), theirs().iloc[1:]
    apart = 6.4e6 * np.abs(np.radians(table[["lat", "lon"]].to_numpy()) - ours.position[:, :2]).max()
    way = T * np.linalg.norm(ours.v_n, axis=1).sum()
    assert apart < 1e-4 * way, f"{apart} m apart"
    print(f"  {apart:.3f} m apart on a way of {way:.0f} m")

    print(f"  {COUNT} samples; ns a sample")
    figures = {
        "truenorth, every sample": best(lambda: mechanise(record, state)),
        "truenorth, 1 Hz": best(lambda: mechanise(record, state, every=100)),
        "truenorth, height fixed": best(lambda: mechanise(record, state, altitude="fixed")),
        "truenorth, 2 samples an update": best(lambda: mechanise(record, state, algorithm="2")),
        "truenorth, 4 samples an update": best(lambda: mechanise(record, state, algorithm="4")),
        "truenorth, attitude alone, inertial": best(lambda: integrate_attitude(record.gyro)),
        "truenorth, inertial integrals": best(
            lambda: inertial_integrals(record.gyro, record.accel, record.steps, np.arange(0, COUNT + 1, 20))
        ),
        "python-ins, from increments to table": best(
            lambda: pyins_strapdown.Integrator(pva).integrate(
                pyins_strapdown.compute_increments_from_imu(imu, "increment")
            )
        ),
        "python-ins, its compiled loop alone": best(their_loop),
    }
    first = next(iter(figures.values()))
    for name, figure in figures.items():
        verdict = f"(limit {LIMIT:.0f})" if figure is first else f"{figure / first:6.2f} times"
        print(f"  {name:40s}{figure:8.1f}  {verdict}")


if __name__ == "__main__":
    main()
