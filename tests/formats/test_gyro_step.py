"""The step of a gyro's numbers: a standard full scale over 2^15 in one unit only."""

import numpy as np
import pytest

from tests.runs import some
from truenorth.formats import UnsureError, read_imu
from truenorth.formats.behaviour import DEG, GYRO_UNITS, size
from truenorth.formats.gyro_step import FINE, STANDARD, likelihood, step_of

UNITS = GYRO_UNITS["rates"]
FORMS = {
    "as it is": lambda v: v,
    "float32": lambda v: v.astype(np.float32).astype(np.float64),
    "without a bias": lambda v: v - [0.1234, 0.077, 0.01],
    **{f"{digits} decimals": lambda v, digits=digits: np.round(v, digits) for digits in range(1, 8)},
}
QUICK = ["as it is", "float32", "without a bias", "2 decimals", "5 decimals"]


def counted(rng, step, unit, motion, rows=4000):
    """Rates in a unit whose gyro counts steps of so many deg/s."""
    rates = rng.normal([0.5, -0.3, 0.2], motion, (rows, 3))
    return np.round(rates / step) * step * DEG / size(unit)


@pytest.mark.parametrize("form", some(QUICK, [form for form in FORMS if form not in QUICK]))
def test_every_usual_step_speaks_for_its_own_unit_or_for_none(form):
    rng = np.random.default_rng(5)
    seen = 0
    for step in STANDARD:
        for unit in ("rad/s", "deg/s"):
            for motion in (0.1, 5.0, 60.0):
                found, unsure = step_of(FORMS[form](counted(rng, step, unit, motion)))
                ratios = {other: likelihood(found * size(other) / DEG, unsure)[0] for other in UNITS} if found else {}
                assert all(ratio < 1.0 for other, ratio in ratios.items() if other != unit), (step, unit, motion)
                seen += ratios.get(unit, 0.0) > 1.0
    whole = 6 * len(STANDARD)
    assert seen > 0.8 * whole or "decimals" in form, seen


def test_steps_of_any_size_are_seldom_near_a_standard_one():
    """Over four decades 0.03 % are near enough to count at all, and 0.003 % so near that they decide."""
    steps = np.geomspace(1e-4, 1.0, 100_001)
    ratios = np.array([likelihood(float(step), 0.0)[0] for step in steps])
    assert np.mean(ratios > 1.0) < 4e-4
    assert np.mean(ratios > 1000.0) < 3e-5
    decimals = np.multiply.outer([1.0, 2.0, 2.5, 4.0, 5.0, 8.0], 10.0 ** -np.arange(6.0)).ravel()
    for unit in UNITS:
        assert all(likelihood(float(step) * size(unit) / DEG, 0.0)[0] < 1.0 for step in decimals), unit


def test_what_has_no_step_has_none():
    rng = np.random.default_rng(6)
    assert step_of(rng.normal(0.0, 1.0, (4000, 3)))[0] == 0.0
    filtered = counted(rng, 2000 / 2**15, "deg/s", 5.0)
    assert step_of(filtered)[0] == pytest.approx(2000 / 2**15, rel=FINE)
    assert step_of(np.sqrt(0.5) * filtered[1:] + np.sqrt(0.3) * filtered[:-1])[0] == 0.0
    one_axis = np.column_stack([filtered[:, 0], rng.normal(0.0, 1.0, (4000, 2))])
    assert step_of(one_axis)[0] == 0.0
    each_its_own = filtered * [1.0, 1.002, 0.997]  # calibrated
    assert step_of(each_its_own)[0] == 0.0
    assert step_of(np.zeros((4000, 3)))[0] == 0.0


@pytest.mark.parametrize("unit", ["rad/s", "deg/s"])
def test_a_car_that_hardly_turns(tmp_path, unit):
    """Its bias explained deg/s at 99 %, whatever the unit was: 0.0010653 is no step of a gyro in deg/s."""
    rng = np.random.default_rng(7)
    time = 0.01 * np.arange(3000)
    accel = rng.normal([0.0, 0.0, 9.81], 0.005, (3000, 3))
    rows = np.column_stack([time, accel, counted(rng, 2000 / 2**15, unit, 0.12, 3000)])

    def written(numbers):
        text = "\n".join(",".join(f"{value:.9g}" for value in row) for row in numbers)
        (tmp_path / "log.csv").write_text(f"time,f_x,f_y,f_z,g_x,g_y,g_z\n{text}\n")
        return tmp_path / "log.csv"

    record = read_imu(written(rows))
    guess = next(guess for guess in record.taken_for if guess.what == "unit of the gyros")
    assert guess.value == unit
    assert "one step of the numbers is 2000 deg/s / 2^15" in guess.why
    smeared = rows + np.concatenate([np.zeros(4), [1e-4, 1e-4, 1e-4]]) * rng.normal(0.0, 0.1, (3000, 7))
    with pytest.raises(UnsureError, match="unit of the gyros"):
        read_imu(written(smeared))
