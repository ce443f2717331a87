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
        math.radians(5.0),
        "rad",
        "three of it are 15 deg, where small-angle models lose their second digit: x - sin x is 1 %",
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
    "heights": Limit(
        4.0,
        "sigma of both",
        "two sound heights differ by that much once in 16,000, and an answer by one of them is as far off",
    ),
    "by chance": Limit(
        2.0, "sigma", "a sound answer is that far off in one of twenty: from there on the excess is in sigma"
    ),
    "doubt": Limit(
        2.5,
        "sigma",
        "a sound IMU misses its specification by that much once in a hundred; from here on the miss is in sigma",
    ),
    "gravity in force": Limit(
        0.1,
        "1",
        "correlation of what gravity does to an accelerometer with what it measures: noise alone has .02 to .05 over minutes, "
        "the least of scale factors that were put in .14",
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
    "hemisphere refitted": Limit(
        30.0,
        "1",
        "the same, of a log with a motion fitted in each hemisphere, which takes up noise by chance: a sound ship had 20, a wrong "
        "latitude 25; between both limits it is a warning",
    ),
    "half turn": Limit(
        15.0,
        "1",
        "the same, of gyros reversed about both level axes: sound drives have -120 and less, reversed ones 19 and more",
    ),
    "height drift": Limit(
        6.6,
        "twice the logarithm of a likelihood ratio",
        "that one sound log in a hundred exceeds; what it moves is in sigma",
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
        "of a zero or a disc of an indexer's encoder: sway is alike from turn to turn, which sigma does not know",
    ),
    "jump of an encoder": Limit(
        12.0,
        "sigma of a row's noise",
        "a thousandth of that of 48 h at 100 Hz by chance, were it normal; starts and stops of an axis have longer tails",
    ),
    "slip of an encoder": Limit(
        10.0,
        "sigma",
        "of innovations that are not quite normal: sound logs, simulated and of ships in a sea of their own, have 6 to 11",
    ),
    "swing with the axes": Limit(
        2e-3,
        "1",
        "probability that a base, which swings as fast as an indexer turns, does so by as much more about the one axis by chance",
    ),
    "hint of an encoder's error": Limit(
        3.5,
        "sigma",
        "of the same noise as the limit of an indexer: chance gives it in 1e-3 of logs, and its size is in sigma",
    ),
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
    # ---- rows and stamps of a log
    "jitter": Limit(
        0.1, "of the interval", "RMS scatter of time stamps, above which a warning says that they are poor"
    ),
    "slight jitter": Limit(
        0.05, "of the interval", "the same, from which what a stamp may be off by is looked at, and is in sigma"
    ),
    "exchanged rows": Limit(
        0.01,
        "of the rows",
        "that have changed places, above which it is an error: fewer move the means of a log by less than noise does",
    ),
    "repeated rows": Limit(0.002, "of the rows", "that repeat the one before, beyond those that chance gives"),
    "led at rest": Limit(
        5.0,
        "sigma",
        "that headings of a log differ, as of a vehicle at rest and with aids that move it, before the aids are wrong",
    ),
    "rows written again": Limit(
        0.01,
        "of the rows",
        "that repeat the one before in three of four parts of a log, where coarse steps repeat many by chance",
    ),
    "held rows": Limit(
        0.1,
        "of the rows",
        "that repeat the one before, above which they may be samples that are held for several rows",
    ),
    "frozen": Limit(
        3.0,
        "longest run by chance",
        "a run of one value three times as long as the longest that chance gives: the cube of its probability",
    ),
    "coarse": Limit(0.3, "of the rows", "that repeat, above which a quantum is as large as the noise"),
    "piled": Limit(
        10, "rows at the next value", "of a vibration's peaks each is a row, and the rows at the end of a range pile up"
    ),
    # ---- units and axes against earth and gravity
    "gravity": Limit(
        0.12, "g", "local gravity, biases of cheap sensors and motion change the mean specific force by less"
    ),
    "other reading": Limit(
        4.0, "1", "times as much left unexplained as by another reading of the axes: those as given are wrong"
    ),
    "scale by tilt": Limit(
        0.35,
        "1",
        "a lever arm moves with the sway and tilts gravity by w^2 r/g, .3 for 3 m at 1 rad/s: less is no wrong unit",
    ),
    "rate seen": Limit(
        0.05, "of the rate", "one sigma of the mean rate, with which it can be compared with the earth's"
    ),
    "unit by the rate": Limit(
        0.01,
        "of the rate",
        "the same, with which a unit can be named: a third of the 3 per cent by which the rate may miss the earth's then",
    ),
    "written twice": Limit(1e-9, "1", "probability that a stretch as long comes again by chance: one in 10^9 logs"),
    "fix untrue": Limit(
        1.5, "sigma as said", "beyond it what innovations show of a fix is neither chance nor what datasheets differ by"
    ),
    "one place": Limit(
        4.0,
        "scatter of the places",
        "of places or headings that are all off to one side: their mean is four times what they scatter by",
    ),
    # ---- noise
    "one noise": Limit(
        1.5,
        "1",
        "largest over smallest density that pass for one noise: over means of 1, 2 and 4 rows, which white noise has alike",
    ),
    "noisy stretch": Limit(3.0, "usual density", "above which a stretch counts as noisy for itself"),
    "another sensor": Limit(
        4.0, "specification", "noise of another class of IMU: sensors of one datasheet scatter by less"
    ),
    "another look": Limit(
        0.2,
        "1",
        "of sound logs have a ratio that is looked at again by the filter's own response: it costs time, no answer",
    ),
    "counts at most": Limit(
        6.0, "sigma", "of one innovation, less than a step has to show: an outlier alone is no step"
    ),
    "depends on its start": Limit(
        1.5, "sigma", "by which starts that are one sigma off move the answer: of a linear filter never more than one"
    ),
    # ---- velocities against positions
    "turned as one": Limit(
        0.3, "of the squares", "of displacements, that velocities which are turned as one may leave at the most"
    ),
    "turned velocities": Limit(
        1e-4, "1", "probability that a sound log shows a turn of its velocities, of either sign"
    ),
    # ---- gyros against accelerometers and encoders
    "gyros right": Limit(
        0.05,
        "of the squares",
        "that gyros at rest would leave: what is left where the gyros are right, but for rough bases",
    ),
    "clearer tilt": Limit(3.0, "1", "times smaller squares that another reading of the axes must leave to be named"),
    "explained tilt": Limit(
        0.25, "of the squares", "that gyros at rest would leave, that this other reading may leave at the most"
    ),
    "sure delay": Limit(
        2e-5,
        "1",
        "false alarms of a small delay and of a scale factor: sigma is estimated from few pieces, of eight it is 10 sigmas",
    ),
    "clear delay": Limit(2e-4, "1", "the same of one whose effect is added to sigma: of eight pieces 7 sigmas"),
    "hint of a delay": Limit(1e-3, "1", "the same of a delay whose tilt is added to sigma, no more"),
    "scale factor": Limit(0.005, "1", "no gyro of a specification has a larger error of scale, or misalignment in rad"),
    "late sensor": Limit(0.02, "s", "a shorter delay is that of sensors' own filters"),
    "one delay": Limit(
        0.3, "of the delay", "that it may differ by between axes: a base's own motion hides or adds a part about each"
    ),
    "pushed in step": Limit(
        0.1,
        "of the squares",
        "that a delay explains, that may go with the tilt beyond it: of sound buoys, rafts and ships at the quay it is more",
    ),
    "may be pushed": Limit(
        0.25,
        "of the squares",
        "that a matrix of the gyros explains, which a push, or late gyros, may explain as well: it is in sigma then",
    ),
    "matrix": Limit(
        0.01,
        "1",
        "probability that sound gyros explain as many squares by a matrix of theirs: from here on one is searched, which decides",
    ),
    "vibrates": Limit(
        2.0,
        "variance of the gyros' noise",
        "of rates beyond what a delay tells: white noise of 1000 rows is within 1.2",
    ),
    "clearer encoder": Limit(
        4.0, "1", "times smaller squares of the base's turns that another reading of the angles must leave to be named"
    ),
    "one-sided spikes": Limit(
        4.0, "sigma", "of what noise adds to the rows around spikes: knocks and chance stay below it once in 16,000"
    ),
    "tilt of a turn": Limit(
        0.25,
        "of the squares",
        "that gravity makes of a turn: accelerometers that show less do not turn, but for an arm of half to one and a half g/w^2",
    ),
    "alternates": Limit(
        8.0, "sigma", "of the mean of all stretches: chance gives as many once in 10^8 channels (Student's t)"
    ),
    "alternates alike": Limit(
        0.5, "of the mean", "scatter of the parts of a log, which must all agree: a vibration fades"
    ),
    "alternating turn": Limit(
        0.05, "of the strongest direction", "turns about a gravity that hardly moves are not seen"
    ),
    "colour": Limit(
        0.05,
        "1",
        "mean correlation of innovations over the first lags: less changes sigma by less than its figures are worth",
    ),
    # ---- a base that stays
    "wanders": Limit(
        3.0, "bias instability", "that an accelerometer's bias is off by at some time: what is larger is a change of it"
    ),
    "motion follows": Limit(
        0.5, "1", "correlation of innovations with the next, from which the base's motion is no white noise"
    ),
    # ---- masters
    "other delay": Limit(
        3.0, "sigma", "by which a delay found by correlation must miss the given one to be taken in its place"
    ),
    "fastest base": Limit(
        10.0, "m/s", "RMS of sway and arm together: no ship or vehicle that stays moves its IMU faster"
    ),
    "upside down": Limit(0.5, "1", "cosine between z and down, above which z points down"),
    "master's gate": Limit(1e-6, "1", "probability of rejecting a sound row of a master: of 10,000 rows none"),
    "tied": Limit(0.95, "1", "correlation of two states beyond which one is not known without the other"),
    # ---- velocity logs of damping
    "outlier of a log": Limit(6.0, "sigma", "of one measurement: chance gives one in 5e8"),
    "jump of a log": Limit(
        8.0, "sigma", "of the difference of the lines on both sides, whose sigma is estimated from few rows"
    ),
    "curvature of a log": Limit(
        0.03, "m/s", "by which healthy lines may miss each other, or a healthy value its median: waves and turns"
    ),
    "slow change of a log": Limit(4.0, "sigma", "of what its slow errors change by: that is no jump"),
    "log's gate": Limit(1e-6, "1", "probability of rejecting a sound row: one in six days at 1 Hz"),
    # ---- filters
    "gate": Limit(
        1e-4, "1", "probability of rejecting a sound measurement: few enough to cost nothing, and outliers are far out"
    ),
    "ruled out": Limit(
        3.0,
        "1",
        "twice the log of a likelihood ratio, by which a log must be against a walk of a bias to rule it out, and larger ones",
    ),
    "small angles": Limit(10.0, "sigma a priori", "beyond it a small-angle model does not hold"),
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
