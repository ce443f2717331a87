"""Advice before data: against the sigmas of alignments of simulated logs, its own budget, and the shell."""

import json
import math

import numpy as np
import pytest

from tests.helpers import run_command
from truenorth.advice import advise
from truenorth.advice.positions import SCHEMES
from truenorth.alignment import align
from truenorth.alignment.positions import align_positions
from truenorth.core.errors import UsageError
from truenorth.core.position import Position
from truenorth.estimate.poorer import poorer
from truenorth.records.specs import imu_spec
from truenorth.simulation import Axis, Indexed, Indexer, rest, simulate, steps

PLACE = Position.from_degrees(45.0, 0.0)


@pytest.fixture(scope="module")
def navigation():
    return advise("navigation", PLACE, math.radians(1.8 / 60))


def at(scheme, T):
    return float(np.exp(np.interp(math.log(T), np.log(scheme.time), np.log(scheme.sigma))))


@pytest.mark.slow
def test_one_position_is_what_an_alignment_says(navigation):
    """Sigma of heading after 300 s, with the quiet base's velocity that the alignment found itself."""
    record = simulate(rest(PLACE), imu=imu_spec("navigation"), rate=20.0, duration=300.0, seed=4).record
    assert at(navigation.schemes[0], 300.0) == pytest.approx(
        align(record, PLACE, "navigation").euler_sigma[0], rel=0.05
    )


@pytest.mark.slow
def test_two_positions_are_what_an_alignment_says(navigation):
    (axis,) = steps([(0, math.pi)], dwell=290.0, duration=599.0, rate=math.radians(10.0), start=(0.0,))
    table = Indexed(rest(PLACE), Indexer((Axis("z", axis),)))
    record = simulate(table, imu=imu_spec("navigation"), rate=20.0, duration=598.0, seed=4).record
    sigma = align_positions(record, PLACE, "navigation").euler_sigma[0]
    assert at(navigation.schemes[1], 598.0) == pytest.approx(sigma, rel=0.1)


def test_the_parts_add_up(navigation):
    for scheme in navigation.schemes:
        assert sum(scheme.share.values()) == pytest.approx(1.0, abs=1e-6)
        assert min(scheme.share.values()) > -1e-9


def test_what_is_reached_and_what_is_in_the_way(navigation):
    one, two, four = navigation.schemes
    assert one.reached is None
    assert next(iter(one.share)) == "gyro bias"  # waiting does not improve it
    assert one.least[1] > 1.5 * navigation.wanted
    assert two.reached == pytest.approx(440.0, rel=0.1)
    assert four.reached < two.reached
    assert navigation.best is four
    assert at(two, two.reached) == pytest.approx(navigation.wanted, rel=1e-6)
    assert next(iter(two.share)) != "gyro bias"
    assert "four positions" in navigation.words[0]


def test_out_of_reach_says_what_is_in_the_way():
    found = advise("tactical", PLACE, math.radians(0.1), schemes={"one position": ()}, longest=600.0)
    assert found.best is None
    assert "out of reach" in found.words[0]
    assert "gyro bias" in found.words[0]


@pytest.mark.slow
def test_what_would_reach_it_does():
    """The IMU that is named reaches the wish in the scheme that is named, and one a tenth poorer does not."""
    two, wanted = {"two positions, 180 deg apart": (180.0,)}, math.radians(0.2)
    found = advise("tactical", PLACE, wanted, schemes=two, longest=600.0)
    assert "times as good (gyro" in found.words[1]
    assert advise(found.would.imu, PLACE, wanted, schemes=two, longest=600.0).best is not None
    short = poorer(found.would.imu, 1.1)
    assert advise(short, PLACE, wanted, schemes=two, longest=600.0).best is None


@pytest.mark.slow
def test_no_imu_sees_through_a_deflected_plumb_line():
    found = advise("navigation", PLACE, math.radians(4.0 / 3600), schemes={"one position": ()}, longest=600.0)
    assert found.would == "deflection of the vertical"
    assert "no better IMU alone would" in found.words[1]


def test_a_restless_base_takes_longer(navigation):
    two = {"two positions, 180 deg apart": SCHEMES["two positions, 180 deg apart"]}
    moved = advise("navigation", PLACE, navigation.wanted, disturbance=0.02, schemes=two)
    assert moved.schemes[0].reached is None or moved.schemes[0].reached > 1.3 * navigation.schemes[1].reached


@pytest.mark.parametrize(
    ("given", "text"),
    [
        ({"heading_sigma": 0.0}, "heading_sigma"),
        ({"disturbance": -1.0}, "disturbance"),
        ({"longest": 30.0}, "longest"),
        ({"schemes": {}}, "no schemes"),
        ({"schemes": {"many": (10.0,) * 30}}, "positions in 60 s"),
    ],
)
def test_what_makes_no_sense(given, text):
    with pytest.raises(UsageError, match=text):
        advise("navigation", PLACE, **{"heading_sigma": 0.01} | given)


@pytest.mark.slow
def test_the_command(capsys, monkeypatch, tmp_path):
    where = ("--lat", 45, "--imu", "navigation", "--longest", 900)
    code, out = run_command(
        capsys, monkeypatch, "advise", *where, "--heading", 0.03, "--json", "-o", tmp_path / "advice"
    )
    assert code == 0
    assert json.loads(out.out)["best"] == "four positions, 90 deg apart"
    assert {path.name for path in (tmp_path / "advice").iterdir()} == {"advice.json", "advice.png"}


def test_the_command_for_manoeuvres(capsys, monkeypatch, tmp_path):
    where = ("--lat", 34, "--imu", "tactical")
    code, out = run_command(
        capsys, monkeypatch, "advise", *where, "--heading", 0.2, "--speed", 200, "--json", "-o", tmp_path
    )
    said = json.loads(out.out)["manoeuvres"]
    assert code == 0
    assert said["straight"]["reached_s"] is None  # heading is not observed without an acceleration
    assert 20.0 < said["flat turn"]["reached_s"] < 40.0  # the turn begins at 20 s
    assert {path.name for path in tmp_path.iterdir()} == {"advice.json", "advice.png"}
    code, out = run_command(capsys, monkeypatch, "advise", *where, "--heading", 0.2, "--attitude-noise", 3)
    assert code == 2
    assert "expected --speed with it" in out.err


@pytest.mark.slow
def test_advice_after_an_alignment(capsys, monkeypatch, tmp_path):
    from truenorth.formats import write_imu

    record = simulate(rest(PLACE), imu=imu_spec("navigation"), rate=10.0, duration=60.0, seed=1).record
    write_imu(record, tmp_path / "log.csv")
    code, out = run_command(
        capsys, monkeypatch, "align", tmp_path / "log.csv", "--lat", 45, "--imu", "navigation", "--advise", 0.03
    )
    assert code == 0
    assert "advice: 1.80 arcmin of heading" in out.out
