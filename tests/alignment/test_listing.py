"""A base that tilts evenly lists where its gyros say so; an accelerometer that drifts as far is none, and is refused."""

import math

import numpy as np
import pytest

from benchmarks.honesty.foreign import attitude, exp
from tests.runs import few_and_all, some
from truenorth import align
from truenorth.alignment.listing import LISTS, lists
from truenorth.alignment.task import make_task
from truenorth.core.attitude import rotation_vector_from_dcm
from truenorth.core.earth import EARTH_RATE, gravity_of_place
from truenorth.core.position import Position
from truenorth.records import ImuRecord
from truenorth.records.specs import imu_spec

PLACE = Position.from_degrees(40.0, 10.0)
RATE, DURATION = 20.0, 300.0
DEGREE = math.radians(1.0)


def log(run, grade="navigation", tilt=0.0, drift=0.0, swell=0.0):
    """Record, and the attitude at its end, of a base that tilts by `tilt` in all, its accelerometers drifting by `drift`.

    It turns about one axis of the body, with a swell of 8 s about the other; the attitude is worked out, not integrated.
    """
    rng = np.random.default_rng([131, run])
    spec = imu_spec(grade)
    time = np.arange(1, round(DURATION * RATE) + 1) / RATE
    start = attitude(*(np.array(x) for x in (rng.uniform(0.0, 6.28), *rng.normal(0.0, 2.0 * DEGREE, 2))))
    about = rng.uniform(0.0, 2.0 * math.pi)
    turn = np.array([math.cos(about), math.sin(about), 0.0]) * tilt / DURATION
    slow, swings = exp(time[:, None] * turn), 2.0 * math.pi / 8.0
    rocks = exp(np.outer(swell * np.sin(swings * time), [1.0, 0.0, 0.0]))
    C = start @ slow @ rocks
    rate = np.einsum("kji,j->ki", rocks, turn) + np.outer(swell * swings * np.cos(swings * time), [1.0, 0.0, 0.0])
    rate += np.einsum("kji,j->ki", C, EARTH_RATE * np.array([0.0, math.cos(PLACE.lat), math.sin(PLACE.lat)]))
    across = np.array([math.sin(about), -math.cos(about), 0.0])  # where a tilt would take gravity
    force = gravity_of_place(PLACE.lat, 0.0) * (C[:, 2] + np.outer(drift * time / DURATION, across))
    sigma = np.sqrt(spec.bias_variance)
    walks = np.repeat([spec.gyro_random_walk, spec.accel_random_walk], 3) * math.sqrt(RATE)
    felt = np.hstack([rate, force]) + sigma * rng.standard_normal(6) + walks * rng.standard_normal((len(time), 6))
    return ImuRecord(time, felt[:, :3], felt[:, 3:], source="base"), C[-1]


def found(run, given=True, grade="navigation", **world):
    """Whether the base is said to list."""
    return lists(make_task(log(run, grade, **world)[0], PLACE, None), imu_spec(grade) if given else None)


@few_and_all(40)
@pytest.mark.parametrize("given", [True, False])
@pytest.mark.parametrize("swell", [0.0, 0.1 * DEGREE])
def test_a_base_lists_where_gyros_and_gravity_agree(runs, given, swell):
    """By a degree in five minutes. Where the rate without the tilt happens to be as large as the earth's, nothing shows it."""
    assert np.mean([found(run, given, tilt=DEGREE, swell=swell) for run in range(runs)]) >= (0.9 if given else 0.75)


@few_and_all(60, few=4)
@pytest.mark.parametrize("given", [True, False])
@pytest.mark.parametrize("grade", ["navigation", "tactical"])
def test_neither_a_base_at_rest_nor_a_drift_is_a_list(runs, grade, given):
    for run in range(runs):
        assert not found(run, given, grade)
        assert not found(run, given, grade, drift=DEGREE * np.random.default_rng([132, run]).uniform(0.05, 2.0))


@pytest.mark.parametrize("run", [0, *some([], range(1, 12))])
@pytest.mark.parametrize("grade", ["navigation", "tactical"])
def test_a_base_that_lists_is_aligned(run, grade):
    """All of them were refused, level 5 sigmas off (that of the mean), or "the gyros do not see the earth turn".

    A tactical log whose rate without the tilt is as large as the earth's, by chance and to within the bias, still is.
    """
    record, C = log(run, grade, tilt=DEGREE)
    answer = align(record, PLACE, grade)
    good = {"navigation": "aligned", "tactical": "level_only"}[grade]
    assert answer.status == (good if found(run, grade=grade, tilt=DEGREE) else "inconsistent")
    if answer.status == good:
        assert answer.method_reason == LISTS
        off = rotation_vector_from_dcm(answer.C_nb @ C.T)
        sigma = np.array([answer.euler_sigma[1:].max()] * 2 + [answer.euler_sigma[0]])
        assert np.all(np.abs(off) < 4.0 * sigma)


@pytest.mark.parametrize(
    ("method", "status"),
    [("analytic", "inconsistent"), ("states10", "inconsistent"), *some([("oba", "aligned")], [("kf", "aligned")])],
)
def test_methods_of_a_still_base_are_contradicted_by_one_that_lists(method, status):
    """The mean rate is the earth's and the tilt's: heading by it is 500 sigmas off."""
    assert align(log(1, tilt=DEGREE)[0], PLACE, "navigation", method=method).status == status


def test_one_whose_accelerometer_drifts_is_refused():
    record, _ = log(3, drift=DEGREE)
    assert align(record, PLACE, "navigation").status == "inconsistent"
