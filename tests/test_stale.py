"""Fixes that are written again while the vehicle goes on are no measurements; those of a vehicle that stands are."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import truenorth
from truenorth.aiding.aids import Gnss
from truenorth.live import GnssFeed
from truenorth.navigation.given import by_key
from truenorth.records import GnssRecord
from truenorth.records.stale import without_stale

Array = NDArray[np.float64]
LAT, LON = 48.0, 11.0


def log(path: Path, time: Array, north: Array, speed: Array | None = None, digits: int = 9) -> GnssRecord:
    """Fixes `north` (m) of a place, as a receiver writes them, with their speed."""
    lines = ["time,lat,lon,alt" + ("" if speed is None else ",VE,VN,VU")]
    for k, (t, away) in enumerate(zip(time, north, strict=True)):
        row = f"{t:.2f},{LAT + away / 111_200.0:.{digits}f},{LON:.{digits}f},500.0"
        lines.append(row + ("" if speed is None else f",0.0,{speed[k]:.3f},0.0"))
    (path / "gnss.csv").write_text("\n".join(lines) + "\n")
    return truenorth.read_gnss(path / "gnss.csv")


def driven(scatter: float = 0.5) -> tuple[Array, Array, Array]:
    """100 s: 30 s at rest, then 12 m/s; time, way, speed."""
    time = np.arange(100.0)
    speed = np.where(time > 30.0, 12.0, 0.0)
    rng = np.random.default_rng(5)
    return time, np.cumsum(speed) + rng.normal(0.0, scatter, 100), speed + rng.normal(0.0, 0.05, 100)


@pytest.mark.parametrize("with_speed", [True, False])
def test_a_receiver_that_hangs(tmp_path: Path, with_speed: bool) -> None:
    time, north, speed = driven()
    north[50:62], speed[50:62] = north[49], speed[49]
    record = log(tmp_path, time, north, speed if with_speed else None)
    assert record.stale == 12
    assert len(record) == 88
    assert not np.isin(record.time, time[50:62]).any()
    assert "12 fixes are the one before" in " ".join(record.notes)


def test_one_that_hangs_at_rest_and_wakes_far_away(tmp_path: Path) -> None:
    time, north, speed = driven()
    north[20:45], speed[20:45] = north[19], 0.0
    speed[19] = 0.0
    record = log(tmp_path, time, north, speed)
    assert record.stale == 25
    assert len(record) == 75


@pytest.mark.parametrize("with_speed", [True, False])
def test_a_logger_that_is_faster_than_the_receiver(tmp_path: Path, with_speed: bool) -> None:
    time, north, speed = driven()
    moving = slice(31, None)
    often = time[moving][:, None] + 0.1 * np.arange(10)
    held = [np.repeat(a[moving], 10) for a in (north, speed)]
    record = log(tmp_path, often.ravel(), held[0], held[1] if with_speed else None)
    np.testing.assert_allclose(record.time[record.time < 99.0], time[moving][:-1])


def test_velocities_of_their_own_stay(tmp_path: Path) -> None:
    time, north, speed = driven()
    north[50:62] = north[49]  # the places hang, the velocities do not
    record = log(tmp_path, time, north, speed)
    assert record.stale == 12
    assert len(record) == 100
    assert record.has_velocity.all()
    assert np.count_nonzero(record.has_position) == 88


@pytest.mark.parametrize("with_speed", [True, False])
def test_a_fix_that_is_held_at_rest_stays(tmp_path: Path, with_speed: bool) -> None:
    time, north, speed = driven(scatter=0.0)
    north[:31], speed[:31] = 0.0, 0.0
    brakes = np.clip((north - north[80]) / 40.0, 0.0, None)
    north -= 40.0 * (brakes - 1.0 + np.exp(-brakes)) * (time > 80)  # comes to a stop
    record = log(tmp_path, time, north, speed if with_speed else None)
    assert record.stale == 0
    assert len(record) == 100


def test_places_of_few_digits_stay(tmp_path: Path) -> None:
    time, north, speed = driven()
    slow = log(tmp_path, time, north / 30.0, speed / 30.0, digits=5)  # 0.4 m/s by steps of 1.1 m
    assert np.count_nonzero(np.diff(slow.lat) == 0.0) > 20
    assert slow.stale == 0


@pytest.mark.parametrize("with_speed", [True, False])
def test_a_logger_of_a_walker_and_of_a_rest(tmp_path: Path, with_speed: bool) -> None:
    """A second of a walk is no way that stands out, and a rest none at all: most places come again, so each repeat is a copy."""
    time, north, speed = driven()
    often = (time[:, None] + 0.1 * np.arange(10)).ravel()
    held = [np.repeat(a, 10) for a in (north / 10.0, speed / 10.0)]
    record = log(tmp_path, often, held[0], held[1] if with_speed else None)
    np.testing.assert_allclose(record.time, time)


def test_places_of_any_unit_with_few_digits_stay() -> None:
    """Arc seconds by tenths: 3 m along north, 2 m along east; a walker makes several rows of each."""
    time, tenth = np.arange(0.0, 300.0, 0.2), np.radians(0.1 / 3600.0)
    lat = np.radians(LAT) + tenth * np.round(1.2 * time / 3.09)
    record = GnssRecord(time, lat, np.full(1500, np.radians(LON)), np.full(1500, 500.0))
    assert without_stale(record) is record


def test_a_receiver_that_lets_go_of_its_fix_at_rest_stays() -> None:
    time = np.arange(1000.0)
    place = np.radians(LAT) + 4.0 / 6.37e6 * (time // 30.0 % 2.0)
    speeds = np.random.default_rng(4).normal(0.0, 0.02, (1000, 3))
    record = GnssRecord(time, place, np.full(1000, np.radians(LON)), np.full(1000, 500.0), speeds)
    assert without_stale(record) is record


def test_a_rest_before_a_gap_stays() -> None:
    time = np.concatenate([np.arange(40.0), 100.0 + np.arange(60.0)])
    away = np.where(time < 50.0, 0.0, 800.0 + 10.0 * (time - 100.0))
    record = GnssRecord(time, np.radians(LAT) + away / 6.37e6, np.full(100, np.radians(LON)), np.full(100, 500.0))
    assert without_stale(record) is record


def test_headings_of_a_receiver_that_hangs_are_left_out_too() -> None:
    time, north, speed = driven()
    north[50:62], speed[50:62] = north[49], speed[49]
    heading = np.random.default_rng(2).normal(0.0, 0.003, 100)
    heading[50:62] = heading[49]
    level = np.column_stack([0.0 * speed, speed, 0.0 * speed])
    record = GnssRecord(
        time,
        np.radians(LAT) + north / 6.37e6,
        np.full(100, np.radians(LON)),
        np.full(100, 500.0),
        level,
        heading=heading,
    )
    assert len(without_stale(record)) == 88


def hung() -> GnssRecord:
    """Fixes of a program, not of a file; the receiver repeats that of 50 s for a dozen seconds."""
    time, north, speed = driven()
    north[50:62], speed[50:62] = north[49], speed[49]
    lat = np.radians(LAT) + north / 6_371_000.0
    zero = np.zeros(len(time))
    return GnssRecord(time, lat, zero + np.radians(LON), zero + 500.0, v_n=np.stack([zero, speed, zero], axis=1))


def test_navigation_takes_no_fix_twice() -> None:
    aid = by_key(Gnss(hung()))["gnss"]
    assert aid.record.stale == 12
    assert by_key(aid)["gnss"].record is aid.record
    for source in aid.sources("gnss"):
        assert not ((source.time >= 50.0) & (source.time < 62.0)).any()


def test_a_feed_takes_no_fix_twice_before_the_next_one_comes() -> None:
    record, feed, sent = hung(), GnssFeed(), dict[str, float]()
    came = []
    for row in range(len(record)):
        feed.push(record.time[row], record.lat[row], record.lon[row], record.alt[row], v_n=record.v_n[row])
        for source in feed.measurements("gnss", None, sent, -1.0):
            came += source.time.tolist() if source.name == "GNSS position" else []
    assert sorted(set(record.time) - set(came)) == list(np.arange(50.0, 62.0))
