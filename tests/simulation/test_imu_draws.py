"""Seeds, streams and runs: the same bits, whatever else is simulated."""

import threading
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from tests.helpers import raises_naming
from truenorth.core.errors import DataError, UsageError
from truenorth.core.position import Position
from truenorth.records.specs import ImuSpec, imu_spec
from truenorth.simulation import given_errors, ideal_log, rest, simulate, simulate_runs
from truenorth.simulation.imu_errors import apply_errors
from truenorth.simulation.streams import STREAMS
from truenorth.simulation.true_errors import drawn_errors

PLACE = Position.from_degrees(40.0, 118.0)
EVERYTHING = imu_spec(Path(__file__).parents[2] / "examples" / "imu_every_term.yaml")
DEG_PER_HOUR = np.pi / 180 / 3600
UG = 9.80665e-6


@pytest.fixture(scope="module")
def ideal():
    return ideal_log(rest(PLACE, 0.3, 0.1, -0.1), rate=100.0, duration=5.0)


def bits(simulation):
    return simulation.record.gyro.tobytes() + simulation.record.accel.tobytes()


def test_streams_are_all_different_and_stay_what_they_are():
    assert len(set(STREAMS.values())) == len(STREAMS)
    first = ("gyro_bias", "accel_bias", "gyro_random_walk", "accel_random_walk")
    assert [STREAMS[name] for name in first] == [0, 1, 2, 3]


def test_the_example_has_every_term():
    terms = [item for item in fields(ImuSpec) if item.compare]
    same = {item.name for item in terms if getattr(EVERYTHING, item.name) == getattr(ImuSpec(), item.name)}
    assert same <= {"correlation_time"}, same


@pytest.mark.parametrize("kind", ["increments", "rates"])
def test_same_seed_same_bytes(ideal, kind):
    one, again = (simulate(ideal, imu=EVERYTHING, seed=5, run=2, kind=kind) for _ in range(2))
    assert bits(one) == bits(again)
    changed = [{"seed": 6, "run": 2}, {"seed": 5, "run": 3}, {"seed": 5, "run": 2, "scenario": 1}]
    assert all(bits(simulate(ideal, imu=EVERYTHING, kind=kind, **numbers)) != bits(one) for numbers in changed)


def test_runs_do_not_know_each_other_nor_the_workers(ideal):
    alone = [bits(simulate(ideal, imu=EVERYTHING, seed=5, run=run)) for run in range(7)]
    assert [bits(s) for s in simulate_runs(ideal, EVERYTHING, 7, seed=5)] == alone
    assert [bits(s) for s in simulate_runs(ideal, EVERYTHING, 7, seed=5, workers=2)] == alone
    assert [bits(s) for s in simulate_runs(ideal, EVERYTHING, [6, 1], seed=5, workers=3)] == [alone[6], alone[1]]


def test_a_longer_log_begins_like_a_shorter_one(ideal):
    longer = simulate(ideal_log(ideal.motion, rate=100.0, duration=8.0), imu=EVERYTHING, seed=1).record
    shorter = simulate(ideal, imu=EVERYTHING, seed=1).record
    # The last three intervals of the shorter one have fewer points for bandwidth and latency.
    counts = 400
    np.testing.assert_allclose(longer.gyro[:counts], shorter.gyro[:counts], rtol=0, atol=1e-15)


def test_few_logs_wait(ideal, monkeypatch):
    """With two workers at most three runs are begun beyond those taken."""
    begun, lock = [], threading.Lock()
    import truenorth.simulation.runs as module

    original = module.apply_errors

    def counted(*args, **options):
        with lock:
            begun.append(options["run"])
        return original(*args, **options)

    monkeypatch.setattr(module, "apply_errors", counted)
    for taken, _ in enumerate(simulate_runs(ideal, EVERYTHING, 20, workers=2), 1):
        assert len(begun) <= taken + 3
    assert sorted(begun) == list(range(20))
    begun.clear()
    some = simulate_runs(ideal, EVERYTHING, 20, workers=2)
    next(some)
    some.close()
    assert len(begun) <= 4


def test_no_workers(ideal):
    with pytest.raises(UsageError, match="workers=0"):
        next(simulate_runs(ideal, EVERYTHING, 2, workers=0))


TERMS = sorted({name.split("_", 1)[1] for name in STREAMS if name.startswith(("gyro", "accel"))})


@pytest.mark.parametrize("term", TERMS)
def test_switching_a_term_off_leaves_the_others_draws(term):
    """The difference with and without a term is that term alone; what is not linear (output, response) is left out."""
    off = {f"{group}_{x}": 0.0 for group in ("gyro", "accel") for x in ("quantisation", "latency")}
    off |= {f"{group}_{x}": np.inf for group in ("gyro", "accel") for x in ("range", "bandwidth")}
    whole = replace(EVERYTHING, **off)
    names = [n for n in (f"gyro_{term}", f"accel_{term}") if n in {item.name for item in fields(whole)}]
    without = replace(whole, **dict.fromkeys(names, 0.0))
    alone = ImuSpec(
        correlation_time=whole.correlation_time,
        **{name: getattr(whole, name) for name in names},
        **{item.name: getattr(whole, item.name) for item in fields(whole) if item.name.startswith("temperature")},
    )
    ideal = np.full((50, 3), 0.01)
    a, b, c = (apply_errors(ideal, ideal, 0.01, s, seed=9)[:2] for s in (whole, without, alone))
    for group, with_term, without_term, term_alone in zip(("gyro", "accel"), a, b, c, strict=True):
        np.testing.assert_allclose(with_term - without_term, term_alone - ideal, atol=1e-14)
        assert np.any(term_alone != ideal) == (f"{group}_{term}" in names)


def test_a_given_error_leaves_the_others_draws(ideal):
    spec = ImuSpec(gyro_bias=1e-6, accel_bias=1e-3, gyro_random_walk=1e-6)
    drawn, given = simulate(ideal, imu=spec), simulate(ideal, imu=spec, errors={"gyro_bias": (1e-5, 0.0, -1e-5)})
    np.testing.assert_array_equal(given.errors.gyro_bias, [1e-5, 0.0, -1e-5])
    np.testing.assert_array_equal(given.record.accel, drawn.record.accel)
    shift = (given.errors.gyro_bias - drawn.errors.gyro_bias) * ideal.interval
    np.testing.assert_allclose(given.record.gyro - drawn.record.gyro, np.tile(shift, (500, 1)), atol=1e-16)


def test_the_true_errors_of_one_run_can_be_given_to_another(ideal):
    spec = replace(EVERYTHING, temperature_start=5.0)
    first = simulate(ideal, imu=spec, seed=1)
    second = simulate(ideal, imu=spec, seed=1, errors=first.errors.constants())
    assert bits(first) == bits(second)


def test_given_errors_in_datasheet_units():
    given = given_errors(
        {
            "gyro": {"bias": ["0.01 deg/h", "-0.01 deg/h", "0.03 deg/h"], "scale_factor": "5 ppm"},
            "accel": {
                "misalignment": [["0 arcsec", "5 arcsec", "0 arcsec"]] + [["0 arcsec"] * 3] * 2,
                "bias": "100 ug",
            },
        }
    )
    np.testing.assert_allclose(given["gyro_bias"], np.array([0.01, -0.01, 0.03]) * DEG_PER_HOUR, rtol=1e-14)
    np.testing.assert_allclose(given["gyro_scale_factor"], [5e-6] * 3)
    np.testing.assert_allclose(given["accel_bias"], [100 * UG] * 3)
    assert given["accel_misalignment"][0, 1] == pytest.approx(5 * np.pi / 180 / 3600)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ({"gyros": {}}, ["did you mean 'gyro'"]),
        ({"gyro": "1 deg/h"}, ["file.gyro", "expected the groups"]),
        ({"gyro": {"random_walk": "1 deg/sqrt(h)"}}, ["gyro.random_walk", "not known"]),
        ({"gyro": {"bias": ["1 deg/h", "1 deg/h"]}}, ["gyro.bias", "2 values; expected 3"]),
        ({"gyro": {"bias": ["1 deg/h", "1 deg", "1 deg/h"]}}, ["gyro.bias[2]", "angular rate"]),
        ({"accel": {"bias": 1.0}}, ["accel.bias", "no unit"]),
        ({"accel": {"misalignment": "1 arcsec"}}, ["accel.misalignment", "3 rows of 3"]),
        ({"accel": {"misalignment": [["1 arcsec"] * 3] * 3}}, ["accel_misalignment", "diagonal", "scale_factor"]),
    ],
)
def test_mistakes_in_given_errors_are_named(content, said):
    with raises_naming(DataError, *said):
        given_errors(content, "file")


def test_misalignments_are_drawn_without_a_diagonal_and_one_run_does_not_touch_another():
    spec = imu_spec("tactical")
    first, second = (drawn_errors(spec, seed=1, run=run) for run in (1, 2))
    assert np.all(np.diag(first.gyro.misalignment) == 0.0)
    assert first.gyro.misalignment.any()
    kept = first.gyro.bias.copy()
    second.gyro.bias[:] = 0.0
    np.testing.assert_array_equal(drawn_errors(spec, seed=1, run=1).gyro.bias, kept)
