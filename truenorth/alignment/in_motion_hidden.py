"""Level of a vehicle whose heading its log does not tell: passes that hold a heading, and others all round that fit as well.

With velocities in body axes alone (an odometer, a Doppler log) nothing but the earth's rate tells heading. Where the gyros hide
that, any heading is as good as another, and so is the level that goes with it. A filter that may correct its heading does not
know that: with each correction the columns of biases, which are fixed to the body, turn against those of tilts, which are not, and
that passes for knowledge of both. A consumer IMU that drove S-turns knew its level to .3 deg and was up to ten of these off.

Of one that hardly turns level is that of gravity (:mod:`truenorth.alignment.in_motion_level`). Where the log speaks against that,
the heading is held: it is where north shall be, not an error. A pass so held finds level and biases as the turns between them
tell, and the passes go on until the level that the next begins with is the one that it leads back to. Each is linear about the
biases of the one before, and hardly leaves them: a loop that finds its gyros' biases anew turns its heading, and takes that for a
turn. What so narrow a beginning says is taken off at the end, and that biases are about zero, as the specification says, put in its
place (:mod:`truenorth.alignment.in_motion_narrow`). What the earth's rate does tell of heading, and what a wrong one does to level,
is then read from passes held at headings all round (ours).
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.in_motion_level import with_level_biases
from truenorth.alignment.in_motion_narrow import Narrowed, as_found
from truenorth.alignment.in_motion_passes import Pass, begun, fits_worse, once_more
from truenorth.alignment.in_motion_spread import Spread
from truenorth.alignment.in_motion_start import HEADINGS, Guess, led_back
from truenorth.alignment.in_motion_task import MovingTask
from truenorth.core.attitude import dcm_from_euler
from truenorth.core.earth import EARTH_RATE
from truenorth.core.errors import DataError
from truenorth.estimate.rivals import misfit
from truenorth.state.layout import BA, BG, PHI
from truenorth.state.track import Track

Array = NDArray[np.float64]

HIDDEN = math.radians(20.0)  # one sigma of heading: products of it with a tilt are no small part of the tilt
HELD = math.radians(0.1)  # one sigma of a heading that is held: it moves by less than errors of second order
SETTLED = 0.1  # of its sigma, by which the level of the next pass may still differ
MOST = 12  # passes


def hidden_from(task: MovingTask) -> bool:
    """Whether the log tells no heading: velocities in body axes alone, and gyros that hide the earth's rate."""
    return task.gnss is None and not task.more and shown_by_the_earth(task) > HIDDEN


def shown_by_the_earth(task: MovingTask) -> float:
    """One sigma of heading, rad, by gyros whose constant biases are known: their noise and the slow parts of biases are left."""
    spec = task.spec
    slow = float(np.max(spec.bias_variance[:3] - spec.constant_variance[:3]))
    rate = math.sqrt(spec.gyro_random_walk**2 / task.record.duration + max(slow, 0.0))
    return rate / max(EARTH_RATE * math.cos(task.position.lat), 1e-12)


def of_level(task: MovingTask, found: Pass, first: Guess, spread: Spread) -> tuple[MovingTask, Guess, Track, Spread]:
    """Task, guess, track and spread whose level holds where nothing tells the heading.

    Level is that of gravity, as uncertain as the accelerometers' biases, unless the log speaks against that, since the vehicle has
    turned. Then it is that of passes with a held heading; where they do not settle, or something else may tell heading, it stays
    as it was found, and where nothing does, as uncertain as the biases again.

    Parameters
    ----------
    task : MovingTask
    found : Pass
        The last of the passes that hold no heading.
    first : Guess
        Of the first pass.
    spread : Spread
        Of the bank.
    """
    hidden = hidden_from(task)
    if hidden:  # a bank that is surer took the products of errors for knowledge
        spread = spread.and_more(shown_by_the_earth(task))
    by_gravity = _by_gravity(task, found, first)
    if by_gravity is not None:
        return *by_gravity, spread
    if not hidden:
        return task, found.guess, found.track, spread
    held = _with_heading_held(task, found, first)
    if held is None:
        return task, found.guess, with_level_biases(task, found.track), spread.and_more(found.sigma)
    last, all_round = held
    return task, last.guess, last.track, all_round.and_more(shown_by_the_earth(task))


class _Held(NamedTuple):
    """A pass that held a heading, and minus twice its log-likelihood but for a constant."""

    of: Pass
    cost: float


def _with_heading_held(task: MovingTask, found: Pass, first: Guess) -> tuple[Pass, Spread] | None:
    """The last of the passes that hold a heading, and what headings all round say; None where level does not settle."""
    try:
        last = _held(task, replace(found.guess, heading_sigma=HELD))
        for _ in range(MOST):
            before, last = last, _held(task, _led_on(last.of, task, first))
            if _moved(before.of.track, last.of.track) < SETTLED:
                return _of_all_round(task, last)
    except DataError:  # the filter broke down
        pass
    return None


def _led_on(last: Pass, task: MovingTask, first: Guess) -> Guess:
    """Where the next pass begins: about all the biases that the last one found, more narrowly than it knows them."""
    track = last.track
    return replace(
        led_back(track, last.back, task.spec, first),
        heading_sigma=HELD,
        gyro_bias=track.sensors[-1, BG],
        accel_bias=track.sensors[-1, BA],
        bias_variance=as_found(task, track),
    )


def _held(task: MovingTask, guess: Guess) -> _Held:
    wide = task.spec.constant_variance
    narrow = wide if guess.bias_variance is None else guess.bias_variance
    prior = Narrowed(np.concatenate([guess.gyro_bias, guess.accel_bias]), narrow, wide)
    track = task.run(guess, gated=True)
    return _Held(begun(task, guess, prior.taken_off(track)), misfit(track.residuals) + prior.misfit(track))


def _moved(before: Track, after: Track) -> float:
    """Of its sigma, by which level at the end differs between two passes."""
    up, sigma = after.C_nb[-1, 2], after.sigma[-1, PHI][:2]
    tilt = (after.C_nb[-1] @ np.cross(up, before.C_nb[-1, 2]))[:2]
    return float(np.max(np.abs(tilt) / sigma))


def _of_all_round(task: MovingTask, last: _Held) -> tuple[Pass, Spread]:
    """The best of passes held at headings all round, and the spread of those that explain the log as well."""
    held, guess = [last], last.of.guess
    for k in range(1, HEADINGS):
        turn = dcm_from_euler(2.0 * math.pi * k / HEADINGS, 0.0, 0.0)
        try:
            held.append(_held(task, replace(guess, C_nb=turn @ guess.C_nb)))
        except DataError:  # the filter breaks down: this heading is none
            continue
    cost = np.array([each.cost for each in held])
    weight = np.exp(-0.5 * (cost - cost.min()))
    best = int(np.argmin(cost))
    spread = Spread.of([each.of.track.C_nb[-1] for each in held], best, weight / weight.sum())
    return held[best].of, spread.and_more(2.0 * math.pi / HEADINGS / math.sqrt(12.0))


def _by_gravity(task: MovingTask, found: Pass, first: Guess) -> tuple[MovingTask, Guess, Track] | None:
    """Task, guess and track of a pass that takes no tilt for a bias; None where the log speaks against it."""
    held = task.with_level_biases_held()
    try:
        last = once_more(held, begun(held, first, held.run(first, gated=False)), first)
        other = with_level_biases(task, last.track)
    except DataError:  # the filter broke down
        return None
    return None if fits_worse(found.track, other) else (held, last.guess, other)
