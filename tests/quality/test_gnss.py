"""Velocities against positions: an honest sigma whatever the noise, no turn in a sound log, and none taken for a delay."""

from dataclasses import replace

import numpy as np
import pytest

from truenorth.campaign.fault_benches import BENCHES
from truenorth.core.earth import radii
from truenorth.quality.gnss import master_evidence, turn_evidence

RUNS = 40


def log(rng, kind, turn=0.0, late=0):
    """Rows of a drive or of circles at 12 deg/s; velocities turned by so many degrees, and late by so many steps of .05 s."""
    step, rows = 0.05, 20 * int(rng.uniform(60.0, 300.0))
    t = step * np.arange(rows)
    rate, speed = np.full(rows, np.radians(12.0)), np.full(rows, 8.0)
    if kind != "circles":
        rate = np.radians(9.0) * ((t % 40.0) > 30.0) * np.sign(np.sin(t / 40.0))
        speed = 10.0 + 4.0 * np.sin(t / 11.0)
    v = speed * np.exp(1j * (rng.uniform(0.0, 6.0) + np.cumsum(rate) * step))
    p = np.append(0.0, np.cumsum(0.5 * (v[1:] + v[:-1]) * step))
    at = slice(10, -10, 20)
    p, v = p[at], np.roll(v, late)[at] * np.exp(1j * np.radians(turn))
    white = rng.standard_normal((4, len(p)))
    p = p + rng.choice([0.02, 1.0]) * (white[0] + 1j * white[1])
    if kind == "wandering":
        p = p + 0.3 * np.cumsum(rng.standard_normal(len(p)) + 1j * rng.standard_normal(len(p)))
    v = v + 0.05 * (white[2] + 1j * white[3])
    R_M, R_N = radii(0.7)
    return t[at], 0.7 + p.imag / R_M, p.real / R_N / np.cos(0.7), np.stack([v.real, v.imag, 0.0 * v.real], axis=1)


@pytest.mark.parametrize("there", [5, 20, 40, 50, 100])
def test_a_receiver_with_many_gaps_shows_no_turn(there):
    """So many fixes, then ten missing, over again: where no stretch is long enough for its cells, nothing is asked (it raised)."""
    t = np.arange(3000.0)
    t = t[t % (there + 10) < there]
    v = 10.0 * np.exp(0.02j * t) + 3.0 * np.exp(0.3j * t)
    p = -500.0j * np.exp(0.02j * t) - 10.0j * np.exp(0.3j * t)
    R_M, R_N = radii(0.7)
    lat, lon = 0.7 + p.imag / R_M, p.real / R_N / np.cos(0.7)
    assert not turn_evidence("gnss", t, lat, lon, np.stack([v.real, v.imag, 0.0 * t], axis=1))


def test_a_few_wrong_velocities_hide_no_exchanged_axes():
    time, lat, lon, velocity = log(np.random.default_rng(4), "drive")
    velocity[[20, 45]] = 600.0
    (found,) = turn_evidence("gnss", time, lat, lon, velocity[:, [1, 0, 2]])
    assert found.key == "gnss.velocity"


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["drive", "wandering", "circles"])
def test_a_sound_log_shows_no_turn(kind):
    """40 drawn logs of each; by chance one in 250 such tests fails."""
    rng = np.random.default_rng(1)
    assert not any(turn_evidence("gnss", *log(rng, kind, late=int(rng.integers(-6, 7)))) for _ in range(RUNS))


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "most"), [("drive", 3.4), ("wandering", 3.6)])
def test_a_turn_is_as_far_off_as_its_sigma_says(kind, most):
    """Two degrees, found in nearly all; Student's t has 20 degrees of freedom and more."""
    rng = np.random.default_rng(2)
    found = [item.figures for _ in range(RUNS) for item in turn_evidence("gnss", *log(rng, kind, 2.0))]
    assert len(found) > 0.85 * RUNS
    off = np.array([(f["angle"] - np.radians(2.0)) / f["sigma"] for f in found])
    assert np.sqrt(np.mean(off**2)) == pytest.approx(1.0, abs=0.35)
    assert np.abs(off).max() < most


@pytest.mark.parametrize("run", range(3))
def test_rows_that_are_far_apart_say_nothing_of_axes(run):
    """A vehicle that brakes and turns every 10 s: of rows 30 s apart half the way was "not the change of its positions"."""
    rng, step = np.random.default_rng(run), 0.2
    t = step * np.arange(4500)
    edges = np.arange(-10.0, t[-1] + 20.0, 10.0)
    v = [np.interp(t, edges, 6.0 * rng.standard_normal(len(edges))) for _ in range(2)]
    v_n = np.stack([*v, 0.0 * t], axis=1)
    way = np.vstack([np.zeros(3), np.cumsum(0.5 * step * (v_n[1:] + v_n[:-1]), axis=0)])
    R_M, R_N = radii(0.7)
    lat, lon = 0.7 + way[:, 1] / R_M, way[:, 0] / R_N / np.cos(0.7)
    for every, exchanged in ((1.0, True), (2.0, True), (20.0, False), (30.0, False), (60.0, False)):
        at = slice(None, None, round(every / step))
        said = v_n[at] + 0.05 * rng.standard_normal((len(t[at]), 3))
        assert turn_evidence("gnss", t[at], lat[at], lon[at], said) == [], every
        found = turn_evidence("gnss", t[at], lat[at], lon[at], said[:, [1, 0, 2]])
        assert [item.key for item in found] == ["gnss.velocity"] * exchanged, every


def test_a_long_way_at_a_high_latitude_shows_no_turn():
    """50 km in S-turns at 62 deg: east there is .8 deg off where it was at the beginning, along a parallel as along a meridian."""
    t = 0.2 * np.arange(1200)
    heading = 0.5 + 0.6 * np.sin(t / 20.0)
    v = 210.0 * np.stack([np.sin(heading), np.cos(heading), 0.0 * t], axis=1)
    way = 0.1 * (v[1:] + v[:-1])
    lat = np.radians(62.0) + np.append(0.0, np.cumsum(way[:, 1])) / radii(np.radians(62.0))[0]
    middle = 0.5 * (lat[1:] + lat[:-1])
    lon = np.append(0.0, np.cumsum(way[:, 0] / (radii(middle)[1] * np.cos(middle))))
    noise = np.random.default_rng(4).standard_normal((2, len(t))) / 6.4e6
    found = turn_evidence("master", t, lat + noise[0], lon + noise[1] / np.cos(lat), v + 0.02, 0.05)
    assert not found


@pytest.mark.parametrize("run", [5, 6])
def test_a_turned_master_that_flies_straight_for_a_while_is_found(run):
    """A straight part leaves rounding alone of positions without noise: its sigma was 1e-149 deg, which no other part was alike."""
    inputs, _ = BENCHES["transfer"].draw(12, run)
    master = inputs["master"]
    v = (master.v_n[:, 0] + 1j * master.v_n[:, 1]) * np.exp(1j * np.radians(0.7))
    turned = replace(master, v_n=np.stack([v.real, v.imag, master.v_n[:, 2]], axis=1))
    assert master_evidence(master) == []
    (found,) = master_evidence(turned)
    assert found.effect.heading == pytest.approx(np.radians(0.7), rel=0.03)
