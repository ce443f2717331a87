"""What a first hour met: tables, places as numbers, axes that nobody said, and what an object shows of itself."""

import numpy as np
import pandas as pd
import pytest

import truenorth as tn
from truenorth.live import Aligner
from truenorth.simulation import rest, simulate

PLACE = (48.1, 11.6, 520.0)


@pytest.fixture(scope="module")
def log():
    at = tn.Position.from_degrees(*PLACE)
    return simulate(rest(at, 0.7), rate=50.0, duration=180.0, imu=tn.imu_spec("navigation"), seed=4).record


def in_axes_frd(record):
    names = [f"{sensor}_{axis}" for sensor in ("gyro", "accel") for axis in "xyz"]
    values = np.hstack([record.gyro, record.accel]) / record.interval
    frd = values[:, [1, 0, 2, 4, 3, 5]] * [1, 1, -1, 1, 1, -1]
    return pd.DataFrame(frd, columns=names, index=pd.Index(record.time, name="time"))


def test_axes_of_a_table_can_be_said_and_are_asked_for_where_z_points_down(log):
    table = in_axes_frd(log)
    answer = tn.align(tn.ImuRecord.of(table, axes="FRD"), PLACE, "navigation")
    assert answer.heading == pytest.approx(
        tn.align(log, PLACE, "navigation").heading, abs=1e-3
    )  # rates, not increments
    assert not any("upside down" in reason for reason in answer.reasons)
    taken = tn.align(table, PLACE, "navigation")  # as right, forward, up: upside down
    assert any("upside down" in reason for reason in taken.reasons)
    with pytest.raises(tn.UsageError, match=r"read_imu\(path, axes="):
        tn.align(table, PLACE, "navigation", axes="FRD")
    with pytest.raises(tn.UsageError, match="rename and convert"):
        tn.align(table.rename(columns={"gyro_x": "wx"}), PLACE)


def test_a_place_is_a_pair_of_numbers_everywhere():
    at = tn.Position.from_degrees(*PLACE)
    short = {"heading_sigma": 0.02, "longest": 130.0, "schemes": {"one position": ()}}
    assert tn.advise("navigation", PLACE, **short).words == tn.advise("navigation", at, **short).words
    wanted = {"speed": 200.0, "wanted": 3e-3, "manoeuvres": ["acceleration"], "longest": 30.0}
    assert str(tn.advise_manoeuvre("tactical", PLACE, **wanted)) == str(tn.advise_manoeuvre("tactical", at, **wanted))
    assert Aligner(PLACE).place == at
    with pytest.raises(tn.UsageError, match="degrees or radians"):
        Aligner((0.8, 0.2))


def test_live_objects_are_shown_in_a_line(log):
    aligner = Aligner(PLACE, "navigation", background=False)
    aligner.push(log.time[:3000], log.gyro[:3000] / log.interval, log.accel[:3000] / log.interval)
    assert repr(aligner) == "Aligner(60.0 s of rows, 1 solutions so far)"
    assert repr(aligner.answer).startswith("Answer(status: aligned, time: 60.000 s, heading: ")
    assert repr(aligner.navigator()).startswith("Navigator(")
