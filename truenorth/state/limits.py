"""Every limit of a verdict, in one table, with the reason for it."""

from __future__ import annotations

import math
from typing import Any, NamedTuple


class Limit(NamedTuple):
    """A threshold: its value, its unit, and why it is what it is."""

    value: float
    unit: str
    reason: str


LIMITS: dict[str, Limit] = {
    # ---- what the judge does with an effect
    "negligible": Limit(0.3, "sigma", "adds 4 % to sigma: less than the figures of sigma are worth"),
    "bound": Limit(1.0, "sigma", "a suspicion of up to one sigma leaves the answer within three of them: it is added"),
    "growth": Limit(
        5.0, "sigma", "an error five times as large as all others together is not a correction of the model"
    ),
    # ---- what an answer must reach
    "level": Limit(
        math.radians(3.0), "rad", "beyond it the small-angle models of all procedures lose their second digit"
    ),
    "pole": Limit(0.1, "1", "cosine of 84 deg latitude, from which the place, not the gyro, is what hides north"),
    "not estimated": Limit(
        0.9,
        "sigma a priori",
        "the data took a fifth of its variance at most: what is known of it is what was said of it",
    ),
    # ---- checks of the sensors against earth and gravity
    "specification": Limit(5.0, "sigma", "a sound IMU misses its specification by that much once in a million"),
    "other axes": Limit(
        0.1,
        "g",
        "beyond its specification no accelerometer is that far off, and axes that are not those of the body show it easily",
    ),
    "two answers": Limit(
        3.0,
        "sigma of both",
        "two sound answers from one log differ by that much less than once in a hundred, over three axes",
    ),
    "by chance": Limit(
        2.0, "sigma", "a sound answer is that far off in one of twenty: from there on the excess is in sigma"
    ),
    "doubt": Limit(
        2.5,
        "sigma",
        "a sound IMU misses its specification by that much once in a hundred; from here on the miss is in sigma",
    ),
    "drift": Limit(
        25.0, "1", "likelihood ratio, chi-square with 1 degree of freedom, 60 signatures: 4e-5 false alarms at most"
    ),
    "hint": Limit(
        12.0,
        "1",
        "the same, of which chance gives as much in 5e-4 of signatures: its effect is added to sigma, however large",
    ),
    "hemisphere": Limit(
        15.0,
        "1",
        "twice the log of a likelihood ratio; a sound log exceeds it in less than one of 1,800, by Markov's inequality",
    ),
    "half turn": Limit(
        15.0,
        "1",
        "the same, of gyros reversed about both level axes: sound drives have -120 and less, reversed ones 19 and more",
    ),
    "rival": Limit(
        10.0,
        "1",
        "twice the log of a likelihood ratio; a sound log exceeds it in less than one of 148, by Markov's inequality: up to the "
        "limit of a drift, which one of 268,000 exceeds, a hint whose effect is added to sigma, however large",
    ),
    "touched": Limit(
        10.0,
        "usual scatter",
        "of the steps of the level force between blocks of a position: a false alarm in less than 1e-5 of logs with Gaussian noise",
    ),
    "carried": Limit(
        5.0, "sigma", "of how gyros carry the level force askew between these blocks: chance passes it in 4e-5 of logs"
    ),
    "indexer": Limit(
        7.0,
        "sigma",
        "of a wobble of the zero of an indexer's angles: sway is alike from turn to turn, which sigma does not know",
    ),
    "few turns": Limit(2e-4, "1", "false alarms of a sound indexer, of whose few turns that sigma is estimated"),
    "start at rest": Limit(
        8.0,
        "sigma",
        "a start is refused outright, with no filter to weigh it: one whose sigmas are half of what they should be still "
        "passes in all but one of 15,000 logs, an axis",
    ),
    # ---- measurements of aiding sensors and masters
    "rejected": Limit(
        0.2, "1", "of a sensor's measurements; a sound one loses 1e-4 to the gate, a poor road some per cent"
    ),
    "nis": Limit(
        3.0, "1", "mean over its rows, beyond which sigma is 1.7 times too small: model and data do not agree"
    ),
    "misfit": Limit(
        3.5,
        "sigma",
        "of a clock, an arm or a mounting taken for known: chance gives it in 5e-4, and what it does is in sigma",
    ),
    "clear misfit": Limit(6.0, "sigma", "the same, which chance gives in 2e-9: worth a warning"),
    "mounting": Limit(5.0, "sigma", "by which a delay, an arm or a mounting may miss what was said of it"),
    "log": Limit(5.0, "sigma", "between INS and velocity log for half of the time: of sound ones one in a million"),
    # ---- innovations
    "step": Limit(
        1e-3,
        "1",
        "probability that a step of a sound receiver is seen at any row: false alarms of the whole are below 1 %",
    ),
    "chance": Limit(5.0, "sigma", "a statistic of innovations this far out is chance once in two million tests"),
}


def limit(name: str) -> float:
    """The value of a limit."""
    return LIMITS[name].value


def is_estimated(sigma: Any, prior: Any) -> Any:
    """Whether the data showed a state, by its sigma now and before: floats or arrays."""
    return sigma < limit("not estimated") * prior


def may_be_chance(ratio: float) -> bool:
    """Whether sound logs have such a likelihood ratio now and then: what it shows is a hint, and refuses no log."""
    return ratio <= limit("drift")
