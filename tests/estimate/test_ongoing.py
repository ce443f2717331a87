"""The filter of a base that stays, going on: that of the whole log about the same nominal solution, whatever the chunks."""

from dataclasses import replace

import numpy as np
import pytest

from tests.runs import some
from truenorth.alignment import align
from truenorth.core.position import Position
from truenorth.errors.staying import QUIETEST_BASE, StaticModel
from truenorth.errors.sway import about_rest, with_motion
from truenorth.estimate.ongoing import BLOCK, CONTEXT
from truenorth.estimate.staying import StayingLog, prior_of
from truenorth.filters import FilterState, kalman
from truenorth.records.specs import imu_spec
from truenorth.simulation import Sway, Tone, rest, simulate

PLACE = Position.from_degrees(45.0, 10.0)
SPEC = imu_spec("navigation")
FIRST = 120.0  # s


@pytest.fixture(scope="module")
def record():
    return simulate(rest(PLACE, 0.7, 0.02, -0.03), rate=50.0, duration=200.0, imu=SPEC, seed=3).record


def rows(record, first, last):
    part = slice(max(first, 0), last)
    return replace(record, time=record.time[part], gyro=record.gyro[part], accel=record.accel[part])


def after(ongoing, record, **options):
    """All rows after the filter's end."""
    first = int(np.searchsorted(record.time, ongoing.time + 0.5 * record.interval))
    return ongoing.after(rows(record, first - CONTEXT, None), CONTEXT, **options)


def whole_log(end, record):
    """The system of all rows, linearised about what the first part found."""
    sways = end.arm is not None
    prior = prior_of(np.diag(SPEC.bias_variance), arm=end.arm, arm_sigma=30.0 if sways else 0.0)
    taken = np.concatenate([np.zeros(6), end.bias, *([end.arm] if sways else [])])
    noise = StaticModel.of(SPEC)
    log = StayingLog(record, end.C_n0_i, PLACE, noise, prior, end.interval, sways=sways, form=end.form, taken=taken)
    if sways:
        return with_motion(log.linearise(), end.interval, end.motion)
    assert end.trend is not None
    t = np.minimum(-1.0 + 2.0 * np.arange(len(log.integrals.C_mean)) / (end.fitted - 1), 1.0)
    basis = np.stack([np.ones_like(t), t], axis=1)
    lines = (basis @ end.trend[0], basis @ end.trend[1])  # of the first part, over all rows
    system = log._system(about_rest(log.integrals, lines, end.C_n0_i, PLACE.lat))
    return replace(system, R=system.R + np.diag(end.R - QUIETEST_BASE**2))


@pytest.mark.parametrize(("method", "kind"), [("kalman", "increments"), ("kalman", "rates"), ("swaying", "increments")])
def test_it_is_the_filter_of_the_whole_log_about_the_same_nominal_solution(record, method, kind):
    scale = 1.0 if kind == "increments" else 1.0 / record.interval
    record = replace(record, gyro=scale * record.gyro, accel=scale * record.accel, kind=kind)
    end = align(record.between(None, FIRST), PLACE, "navigation", method=method).ongoing
    went_on = after(end, record)
    assert went_on.disturbed == 0
    assert went_on.time == pytest.approx(190.0, abs=0.03)
    system = whole_log(end, record.between(None, went_on.time + 0.5 * record.interval))
    later = {name: getattr(system, name)[end.epochs :] for name in ("Phi", "Q", "H", "R", "S", "z")}
    found = kalman(replace(system, **later), FilterState(end.x, end.P, np.zeros(()), np.zeros(0)))
    assert went_on.epochs == len(system.z)
    # Of a sigma; the attitude about which a base sways is a line fitted to another log.
    tolerance = 1e-3 if method == "swaying" else 1e-7
    x, sigma = found.x[-1], np.sqrt(np.diag(found.P[-1]))
    assert np.max(np.abs(went_on.x - x)[:12] / sigma[:12]) < tolerance
    np.testing.assert_allclose(np.diag(went_on.P)[:12], sigma[:12] ** 2, rtol=tolerance)


@pytest.fixture(scope="module")
def sheering():
    """A ship that sheers at anchor: turned so far that scale factors and misalignments of her gyros are states as well."""
    ship = Sway(
        PLACE,
        heading=0.7,
        heading_tones=(Tone(0.3, 100.0),),
        pitch_tones=(Tone(0.01, 6.0),),
        roll_tones=(Tone(0.03, 9.0),),
        lever_arm=(1.0, 5.0, 2.0),
    )
    return simulate(ship, rate=50.0, duration=200.0, imu=imu_spec("tactical"), seed=3).record


@pytest.mark.parametrize(
    ("method", "kind"),
    some([("swaying", "increments"), ("kalman", "rates")], [("swaying", "rates"), ("kalman", "increments")]),
)
def test_errors_of_a_turned_imu_go_on_as_in_the_filter_of_the_whole_log(sheering, method, kind):
    scale = 1.0 if kind == "increments" else 1.0 / sheering.interval
    record = replace(sheering, gyro=scale * sheering.gyro, accel=scale * sheering.accel, kind=kind)
    spec = imu_spec("tactical")
    end = align(record.between(None, FIRST), PLACE, spec, method=method).ongoing
    assert end.matrices is not None
    # Whatever the rows show of motion: their noise is that of the log.
    end = replace(end, largest=np.full(2, np.inf))
    went_on = after(end, record)
    sways = end.arm is not None
    prior = prior_of(np.diag(spec.bias_variance), spec=spec, arm=end.arm, arm_sigma=30.0 if sways else 0.0)
    taken = np.concatenate([np.zeros(6), end.bias, end.matrices, *([end.arm] if sways else [])])
    part = record.between(None, went_on.time + 0.5 * record.interval)
    log = StayingLog(
        part, end.C_n0_i, PLACE, StaticModel.of(spec), prior, end.interval, sways=sways, form=end.form, taken=taken
    )
    slow = log.integrals
    if end.trend is not None:
        t = -1.0 + 2.0 * np.arange(len(slow.C_mean)) / (end.fitted - 1)
        mean, late = (np.stack([np.ones_like(t), t], axis=1) @ line for line in end.trend)
        slow = replace(slow, C_mean=mean.reshape(-1, 3, 3), C_late=late.reshape(-1, 3, 3))
    system = log._system(slow)
    if sways:
        system = with_motion(system, end.interval, end.motion)
    else:
        system = replace(system, R=system.R + np.diag(end.R - QUIETEST_BASE**2))
    later = {name: getattr(system, name)[end.epochs :] for name in ("Phi", "Q", "H", "R", "S", "z")}
    found = kalman(replace(system, **later), FilterState(end.x, end.P, np.zeros(()), np.zeros(0)))
    assert went_on.epochs == len(system.z) > end.epochs
    x, sigma = found.x[-1], np.sqrt(np.diag(found.P[-1]))
    assert np.max(np.abs(went_on.x - x)[:30] / sigma[:30]) < 1e-3
    np.testing.assert_allclose(np.diag(went_on.P)[:30], sigma[:30] ** 2, rtol=1e-3)


def test_between_epochs_of_a_turned_imu_attitude_is_as_unsure_as_its_turn_leaves_it(sheering):
    end = align(sheering.between(None, FIRST), PLACE, "tactical", method="swaying").ongoing
    first = int(np.searchsorted(sheering.time, end.time + 0.5 * sheering.interval))
    count = round(BLOCK * end.interval / sheering.interval)
    known = rows(sheering, first - CONTEXT, first + count)
    silent = after(end, rows(sheering, 0, first + count + 2), measured=False)
    assert silent.time == pytest.approx(known.time[-1], abs=1e-6)
    (_, C_nb, P), (_, there, wanted) = end.attitude(known, CONTEXT), silent.attitude(None, 0)
    np.testing.assert_allclose(C_nb, there, atol=1e-7)
    # Between epochs biases act by the attitude as it is, in the filter by its slow part.
    np.testing.assert_allclose(np.diag(P), np.diag(wanted), rtol=0.02)


def test_a_tilt_within_the_log_goes_no_further(record):
    """Its line would: biases would act by an attitude that is degrees off an hour later, and level seem known by that."""
    end = align(record.between(None, FIRST), PLACE, "navigation").ongoing
    tilt = np.zeros((2, 9))
    tilt[1, 5] = 0.01
    tilted = tuple(line + tilt for line in end.trend)
    stays = tuple(np.stack([line.sum(axis=0), np.zeros(9)]) for line in tilted)
    one, two = (after(replace(end, trend=trend), record) for trend in (tilted, stays))
    np.testing.assert_allclose(one.x, two.x, rtol=0, atol=1e-9 * np.sqrt(np.diag(two.P)).max())
    np.testing.assert_allclose(one.P, two.P, rtol=1e-9, atol=1e-12 * np.abs(two.P).max())


def test_chunks_give_the_same(record):
    end = align(record.between(None, FIRST), PLACE, "navigation").ongoing
    whole, now = after(end, record), end
    for stop in (141.0, 141.3, 177.77, 200.0):
        now = after(now, record.between(None, stop))
    assert now.time == whole.time
    np.testing.assert_allclose(now.x, whole.x, rtol=0.0, atol=1e-9 * np.sqrt(np.diag(whole.P)).max())
    np.testing.assert_allclose(now.P, whole.P, rtol=1e-9, atol=1e-12 * np.abs(whole.P).max())


def test_attitude_between_epochs_is_that_of_the_integration(record):
    end = align(record.between(None, FIRST), PLACE, "navigation").ongoing
    first = int(np.searchsorted(record.time, end.time + 0.5 * record.interval))
    part = rows(record, first - CONTEXT, first + 333)
    time, C_nb, P = end.attitude(part, CONTEXT)
    assert time == part.time[-1]
    wanted = align(record.between(None, FIRST), PLACE, "navigation").C_nb  # the base is still
    np.testing.assert_allclose(C_nb, wanted, atol=5e-6)
    _, _, before = end.attitude(None, 0)
    assert np.all(np.diag(P)[:2] >= np.diag(before)[:2])


def test_a_base_that_is_shaken_now_counts_less(record):
    end = align(record.between(None, FIRST), PLACE, "navigation").ongoing
    accel = record.accel.copy()
    then = (record.time > 135.0) & (record.time < 150.0)
    accel[then, 1] += 0.05 * record.interval * np.sin(2.0 * record.time[then])  # increments
    calm, shaken = after(end, record), after(end, replace(record, accel=accel))
    assert 1 <= shaken.disturbed <= 3
    sigma = np.sqrt(np.diag(end.P))
    assert np.max(np.abs(shaken.x - calm.x)[:3] / sigma[:3]) < 1.0
    silent = after(end, record, measured=False)
    assert silent.P[2, 2] > 1.3 * calm.P[2, 2]


@pytest.mark.parametrize(("rate", "first"), [(1000.0, 21.0), (128.2, 45.3), (33.0, 30.03)])
def test_rates_whose_rows_do_not_fall_on_the_intervals(rate, first):
    record = simulate(rest(PLACE, 0.7), rate=rate, duration=75.0, imu=SPEC, seed=2).record
    end = align(record.between(None, first), PLACE, "navigation").ongoing
    went_on = after(end, record)
    assert record.time[-1] - went_on.time < 11.5 * end.interval
    sigma = np.sqrt(np.diag(end.P))
    assert np.all(np.abs(went_on.x - end.x)[:3] < 5.0 * sigma[:3])
