"""Our mechanisation against python-ins on that project's own sine-velocity motion, an hour at 100 Hz."""

from dataclasses import replace

import numpy as np
import pytest

from truenorth.core.attitude import rotation_vector_from_dcm
from truenorth.core.earth import normal_gravity
from truenorth.errors.model import InsModel
from truenorth.estimate.run import navigate_track
from truenorth.records import ImuRecord
from truenorth.state.state import Start, State
from truenorth.strapdown.level import mechanise

SWAP = np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, -1]])  # NED and ENU, FRD and RFU, both ways


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::pandas.errors.Pandas4Warning")  # that project calls what pandas drops
@pytest.mark.parametrize("kind", ["increment", "rate"])
def test_no_farther_from_the_truth_than_python_ins(kind):
    """Ours deviates less in every state: from increments by 50 times and more, from rates (their trapezoid) by 7."""
    sim = pytest.importorskip("pyins.sim")
    from pyins import earth, strapdown, transform

    true, imu = sim.generate_sine_velocity_motion(
        1e-2, 3600, [55, 37, 1500], [5, -3, 0.2], velocity_change_amplitude=1, sensor_type=kind
    )
    theirs = strapdown.Integrator(true.iloc[0], True).integrate(strapdown.compute_increments_from_imu(imu, kind))
    their_error = transform.compute_state_difference(theirs, true).abs().max(axis=0)

    columns = ["gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z"]
    time, values = imu.index.to_numpy(), imu[columns].to_numpy()
    kinds = {"increment": "increments", "rate": "rates"}
    record = ImuRecord(time, values[:, :3] @ SWAP, values[:, 3:] @ SWAP, kinds[kind])[1:]
    # The log holds their gravity (linear in height): 1.5e-5 m/s^2 from ours, which the free vertical channel makes 750 m.
    # Along the truth the difference is known; with it taken out both integrate the same log under their own gravity.
    at_lat, at_alt = true["lat"].to_numpy(), true["alt"].to_numpy()
    more = normal_gravity(np.radians(at_lat), at_alt) - earth.gravity(at_lat, at_alt)
    up_b = (SWAP @ transform.mat_from_rph(true[["roll", "pitch", "heading"]].to_numpy()) @ SWAP)[:, 2]
    push = (more[:, None] * up_b)[1:]
    if kind == "increment":
        push = 0.5 * 1e-2 * (push + (more[:, None] * up_b)[:-1])
    record = replace(record, accel=record.accel + push)
    first = true.iloc[0]
    lat, lon, alt = np.radians(first["lat"]), np.radians(first["lon"]), first["alt"]
    C_nb = SWAP @ transform.mat_from_rph(first[["roll", "pitch", "heading"]]) @ SWAP
    v_n = SWAP @ first[["VN", "VE", "VD"]].to_numpy()
    start = Start(0.0, C_nb, v_n, lat, lon, alt, np.zeros(3), np.zeros(3), np.eye(15))
    track = navigate_track(record, start, InsModel(0.0, 0.0), covariance=False, interval=1.0, every=1)
    level = mechanise(record, State.at(C_nb, lat, lon, alt, v_n), every=100)

    for name, t, C, v, position in (
        ("wander", track.time, track.C_nb, track.v_n, track.position),
        ("local level", level.time, level.C_nb, level.v_n, level.position),
    ):
        at = true.iloc[np.searchsorted(time, t - 1e-4)] if t[0] > 0 else true.iloc[np.searchsorted(time, t + 1e-4) - 1]
        d = position - np.stack([np.radians(at["lat"]), np.radians(at["lon"]), at["alt"]], axis=1)
        metres = np.abs(d * [6.37e6, 6.39e6 * np.cos(lat), 1.0]).max(axis=0)
        speed = np.abs(v - at[["VE", "VN", "VD"]].to_numpy() * [1, 1, -1]).max(axis=0)
        C_true = SWAP @ transform.mat_from_rph(at[["roll", "pitch", "heading"]].to_numpy()) @ SWAP
        turned = np.degrees(np.abs(rotation_vector_from_dcm(C @ np.swapaxes(C_true, 1, 2))).max())
        print(name, kind, "ours: north, east, up m", metres, "V m/s", speed, "deg", turned)
        print("python-ins:", their_error.to_dict())
        assert metres[0] <= their_error["north"]
        assert metres[1] <= their_error["east"]
        assert metres[2] <= their_error["down"]
        assert speed[0] <= their_error["VE"]
        assert speed[1] <= their_error["VN"]
        assert turned <= max(their_error[["roll", "pitch", "heading"]])
