"""What the closed loop is made of, for kernels: samples, events, sources, histories, and the memory it goes on from."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.errors.azimuth_free import lever_of
from truenorth.errors.dynamics import Dynamics
from truenorth.strapdown import wander

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

MEASURE, DISTURB, PLACE = range(3)  # what an event of a source does
ABSENT, USED, REJECTED, REOPENED = range(4)  # verdicts
# How a correction is fed back: as it is; with velocity turned (:mod:`truenorth.errors.invariant`); where nothing shows velocity
# or place over the ground, with the way and the gyros' biases turned too (:mod:`truenorth.errors.azimuth_free`); and as either of
# the last two, by which velocity the covariance knows better, that over the ground or that in the body.
AS_IT_IS, OVER_GROUND, IN_BODY, EITHER = range(4)
BACK, AHEAD = 2, 3  # samples before and after an epoch that its rate is taken from


class Samples(NamedTuple):
    """Increments of the IMU: (N,) lengths and ends of the intervals, (N, 3) rad and m/s."""

    step: Array
    end: Array
    dtheta: Array
    dvel: Array


class Events(NamedTuple):
    """What happens when: (K,) times in order, source (-1: none), output; (K, M) measured, (K, 3) variance."""

    time: Array
    source: Integers
    output: NDArray[np.bool_]
    measured: Array
    variance: Array


class Sources(NamedTuple):
    """Of each source (S,): what it does, the address of its row, figures, places of its states, limits of NIS (S, 3).

    `loop`: time constant of a vertical loop (s); `instant`: it needs the rate at its own time, `swings`: on an arm; `patience`:
    rows rejected in a row until a jump is believed, and `opens`, the first of three states that take it up; `nudge`: how much later
    than its time a row may be taken (s); `over_ground`: it shows velocity or place along east and north.
    """

    action: Integers
    row: Integers
    figures: Array
    states: Integers
    gates: Array
    loop: Array
    instant: NDArray[np.bool_]
    swings: NDArray[np.bool_]
    patience: Integers
    opens: Integers
    over_ground: NDArray[np.bool_]


class Model(NamedTuple):
    """What of the error model the kernel needs.

    `spare` (s): an event of the grid so soon after another is passed over; `opened`: no correction is fed back before `until` (s);
    `exact`: innovations are those of the motion with its errors taken off (:mod:`truenorth.estimate.apart`). `lag`: the delay of
    fixes, or -1.
    """

    dynamics: Dynamics
    sensors: Integers
    fixed_altitude: bool
    turn_scale: float
    turn_cross: float
    invariant: int  # how a correction is fed back
    drift: int  # first state of a log's drift along east and north, or -1
    covariance: bool
    held: bool
    spare: float = 0.0
    opened: bool = False
    until: float = 0.0
    exact: bool = False
    lag: int = -1


class Task(NamedTuple):
    """What the loop is given to go through."""

    samples: Samples  # from some that are done with (for rates) to the newest
    start: int  # the first that is not
    events: Events  # in order of time
    late: Events  # re-timed ones, in order of their stamps; all of one delay
    sources: Sources
    model: Model
    horizon: int  # samples to be taken: those behind it are only there for rates


class Kept(NamedTuple):
    """Histories; an axis of length 0 keeps nothing.

    `time`, `state`, `aux`, `P` are those at each output; `when`, `innovation`, `sigma`, `nis`, `verdict` those of each
    event, the re-timed ones behind the others; `Phi, Q, H, R, dx` lead from event to event, for the smoother, and `D` from the
    errors before a correction to those left after it; `lever` (J, 2) is that at each output.
    """

    time: Array
    state: Array
    aux: Array
    P: Array
    when: Array
    innovation: Array
    sigma: Array
    nis: Array
    verdict: Integers
    Phi: Array
    Q: Array
    H: Array
    R: Array
    dx: Array
    D: Array
    lever: Array


class Sums(NamedTuple):
    """Integrals over the samples since the last event."""

    C: Array  # int C_wb dt
    C_now: Array
    vectors: Array  # rows: f_w, v_w, angle and velocity increments in the body, errors taken off
    T: Array


class Memory(NamedTuple):
    """All that the loop goes on from: with it, chunks of any size give the bits of one batch.

    `s` (24,) the state of :mod:`truenorth.strapdown.wander`; `aux` (n,) what is assumed in the places of the states;
    `P` (n, n) along w; `x` (n,) errors that are known and not fed back, along w: zeros in a closed loop; `largest` (n,) variances
    so far; `sums` since the last event, `means` up to it; `done` (1,) part of the next sample that is taken; `heard` (1,) when the
    vertical loop was fed; `lever` (3,) m, the way from the place about which the vehicle turns with its azimuth, along w, and what
    that leaves out; `refused` (S,) rows rejected in a row.
    """

    s: Array
    aux: Array
    P: Array
    x: Array
    largest: Array
    sums: Sums
    means: Sums
    done: Array
    heard: Array
    lever: Array
    refused: Integers

    def copy(self) -> Memory:
        """Arrays of its own."""
        sums, means = (Sums(*(a.copy() for a in part)) for part in (self.sums, self.means))
        s, aux, P, x, largest = (a.copy() for a in self[:5])
        done, heard, lever = (a.copy() for a in self[7:10])
        return Memory(s, aux, P, x, largest, sums, means, done, heard, lever, self.refused.copy())


def memory(s: Array, aux: Array, P: Array, begin: float, sources: int, x: Array | None = None) -> Memory:
    """At the beginning; `x` (n,) are errors of the start that are known, along w."""
    n = len(aux)
    sums, means = (Sums(np.zeros((3, 3)), np.zeros((3, 3)), np.zeros((4, 3)), np.zeros(1)) for _ in range(2))
    assert len(s) == wander.LENGTH
    return Memory(
        s,
        aux,
        P,
        np.zeros(n) if x is None else np.array(x, dtype=np.float64),
        np.zeros(n),
        sums,
        means,
        np.zeros(1),
        np.array([begin]),
        np.append(lever_of(P), 0.0),
        np.zeros(sources, dtype=np.int64),
    )
