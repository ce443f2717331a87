"""The last passes of an alignment by motion: open loops about the motion that the passes before have found.

A vehicle that goes round in a steady circle feels the same force and the same rate all the time. Any attitude fits both, if the
biases make up for it: ``C (f - nabla) = a - g``, ``C (w - eps) = w_n``. A closed loop corrects its attitude as it goes. With each
correction of heading by ``h`` the columns of what is fixed to the body turn by ``h`` against those of north and east, and what
nothing shows seems to be shown a little: the level of a consumer IMU was known to .6 deg where a bias of its gyros and of its
accelerometers leave 1.2, and was up to five of these off. So the last passes feed nothing back. They are linear about the motion
that the whole log leads back to, with its biases, axes, arm and delay, and with the *prior* covariance, whose heading is any. What
lies between the prior's values and those is an error that is known at the start. That is Gauss and Newton's method on the log, and
the prior counts once. What a row is off by is not linear: by the end of such a loop places are off by kilometres
(:mod:`truenorth.estimate.apart`). Where a vehicle on tracks or with a wheel turns quickly, more than that is not linear: the loop
comes to rest with a heading, an arm and a delay that make up for one another, or knows heading better than the closed loop does.
Where the log speaks against such a loop it is not taken. Of a log longer than gyros carry an attitude, or than a place by dead
reckoning stays near, the first part is open; then the loop is closed.

Sources: as of :mod:`truenorth.alignment.transfer_nominal`, which does the same for a slave and its master.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from truenorth.aiding.sprung import of_the_path
from truenorth.alignment.in_motion_passes import fits_worse, turn_between
from truenorth.alignment.in_motion_start import Guess, backtracked, start_at
from truenorth.alignment.in_motion_task import INTERVAL, OUTPUT, MovingTask
from truenorth.alignment.transfer_nominal import carried_for
from truenorth.core.attitude import UNIFORM_SIGMA, dcm_from_euler, dcm_from_rotation_vector, rotation_vector_from_dcm
from truenorth.core.errors import DataError
from truenorth.errors.axes import known_as_bias
from truenorth.errors.model import InsModel
from truenorth.estimate.batch import OpenPass, settle
from truenorth.estimate.run import navigate_track, with_states
from truenorth.state.layout import ACCEL_AXES, BA, BG, PHI
from truenorth.state.state import Start
from truenorth.state.track import Track

Array = NDArray[np.float64]

SETTLED = 0.1  # of a sigma: a pass that moves attitude, arms and delays by less is the last
SITS = (" lag", " lever arm")  # groups of each aid
MOST = 12  # passes
NEAR = 3.0  # sigmas, within which an open loop has found what the closed one has
SURER = 0.9  # of the closed loop's sigma of heading: one that feeds nothing back knows no more
LONGEST = 300.0  # s of a loop that feeds nothing back: a poor IMU's place is then off by a kilometre


@dataclass(frozen=True)
class _Motion:
    """How the motion begins that a loop is linear about."""

    C_nb: Array  # (3, 3) at the start
    values: Array  # (n,) in the places of the states


class _Log:
    """A log, and the motion that it is linear about: the loop does it row by row."""

    def __init__(self, motion: _Motion) -> None:
        self.motion = motion

    def linearise(self) -> _Motion:
        """The motion."""
        return self.motion

    def correct(self, x: Array) -> None:
        """Take what was found off it."""
        values = self.motion.values + x
        values[PHI] = 0.0
        self.motion = _Motion(np.asarray(dcm_from_rotation_vector(x[PHI]) @ self.motion.C_nb), values)


def open_track(task: MovingTask, first: Guess, track: Track) -> Track | None:
    """The track of a loop that is linear about what a closed one has found.

    Parameters
    ----------
    task : MovingTask
    first : Guess
        Where the first pass began: its level is the prior, of its heading nothing is known.
    track : Track
        Of the last closed loop.

    Returns
    -------
    Track or None
        None where it does not come to rest, or not at what the log says: no motion near the one found fits the log best.
    """
    used = of_the_path(task.aiding(gated=True), task.record)
    if any(source.loop > 0.0 for source in used):
        return None
    model = with_states(task.model, used)
    until = float(task.record.time[0]) + min(carried_for(task.record, model), LONGEST)

    def once(motion: _Motion) -> OpenPass:
        start, level, P, values = _prior(task, first, motion, model)
        off = values - motion.values
        off[PHI] = rotation_vector_from_dcm(level @ motion.C_nb.T)
        found = navigate_track(
            task.record,
            start,
            model,
            used,
            interval=INTERVAL,
            every=max(1, round(OUTPUT / INTERVAL)),
            prior=(P, motion.values),
            open_until=until,
            exact=True,
            off=off,
        )
        back = _led_back(task, model, found, until)
        error = back.values - motion.values
        error[PHI] = rotation_vector_from_dcm(back.C_nb @ motion.C_nb.T)
        return OpenPass(found, error, [name for name in found.layout.names if name.endswith(SITS)])

    try:
        last = settle(
            _Log(_led_back(task, model, track, until)), once, lambda each: each.moved, enough=SETTLED, most=MOST
        )
    except DataError:  # the filter broke down
        return None
    if last.moved >= SETTLED or _is_astray(last.found.track, track):
        return None
    return last.found.track


def _is_astray(found: Track, track: Track) -> bool:
    """Whether an open loop has another attitude than the closed one, or a surer heading, and the log speaks against it."""
    off = rotation_vector_from_dcm(found.C_nb[-1] @ track.C_nb[-1].T)
    open_sigma, sigma = found.sigma[-1, PHI], track.sigma[-1, PHI]
    another = bool(np.any(np.abs(off) > NEAR * np.maximum(open_sigma, sigma)))
    surer = bool(open_sigma[2] < SURER * sigma[2])
    return (another or surer) and fits_worse(track, found)


def _led_back(task: MovingTask, model: InsModel, track: Track, until: float) -> _Motion:
    """The motion that a track leads back to, from as late as the gyros carry an attitude; constants as the end knows them."""
    row = max(1, int(np.searchsorted(track.time, until, side="right")))
    values, span = np.zeros(model.states), float(task.record.duration)
    for part in (BG, BA):
        values[part] = track.sensors[row - 1, part]
    for group in model.groups:
        had, own = track.layout.slice_of(group.name), model.layout.slice_of(group.name)
        constant = np.isinf(group.lasts).all() and np.isinf(group.correlation_distance) and group.frequency == 0.0
        if had is not None and own is not None and constant and group.walk == 0.0:
            values[own] = track.sensors[-1, had]
            if group.drift > 0.0:  # what has grown is less at the beginning
                first = slice(own.start, own.start + len(group.sigma))
                values[first] -= values[first.stop : own.stop] * span
    return _Motion(backtracked(task.record, track[:row]), values)


def _prior(task: MovingTask, first: Guess, motion: _Motion, model: InsModel) -> tuple[Start, Array, Array, Array]:
    """Where the motion begins, the guess turned to its heading, covariance and values of all states before the log."""
    any_heading = Guess(motion.C_nb, first.level_sigma, UNIFORM_SIGMA)
    start = start_at(
        task.record, any_heading, task.begin, task.spec, task.odometer, task.gnss, task.wheel, task.antenna
    )
    P, values = model.prior(start.P), np.zeros(model.states)
    for group in model.groups:
        if group.name == ACCEL_AXES:
            P, values = known_as_bias(P, values, group, model.layout.first_of(ACCEL_AXES), None)
    return start, dcm_from_euler(turn_between(first.C_nb, motion.C_nb), 0.0, 0.0) @ first.C_nb, P, values
