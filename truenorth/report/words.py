"""Words that reach a page through variables: kinds of motion, angles, sensors, verdicts. The catalogue translates them."""

from __future__ import annotations

from truenorth.core.language import retold, translated

WORDS = (
    "heading", "pitch", "roll", "Heading", "Pitch", "Roll", "heading minus roll", "heading plus roll",
    "Heading minus roll", "Heading plus roll", "unknown", "still", "disturbed", "swaying", "rotating", "moving",
    "warning", "error", "note", "fixed", "free", "baro", "gnss", "GNSS position", "GNSS velocity", "odometer",
    "velocity log", "barometer", "zero velocity", "zero rotation", "odometer scale", "odometer mounting", "odometer lever arm",
    "odometer lag", "odometer compliance", "GNSS lever arm", "GNSS lag", "GNSS velocity lag", "GNSS unseen arm", "GNSS bias",
    "GNSS mounting", "velocity log scale",
    "velocity log mounting", "velocity log lever arm", "velocity log lag", "velocity log bias", "barometer bias", "barometer lag",
    "velocity log drift", "levelled velocity log", "deflection of the vertical", "position fix", "azimuth reset",
    "holds", "does not hold", "holds in part", "too few runs", "Aligned, with warnings", "Navigated, with warnings",
    "case", "method", "log, s", "runs", "failed", "RMS", "95 % interval", "median", "95th percentile", "Cramer-Rao bound",
    "RMS/bound", "claimed sigma", "RMS/sigma", "95 % band",
    "velocity of the base", "velocity of the master", "position of the master",
    "acceleration of the master", "attitude of the master", "odometer displacement", "height", "attitude",
    "GNSS heading", "magnetometer", "gyro scale factors", "accelerometer scale factors",
)  # fmt: skip

# Why a method was taken and where a specification is from: clauses, which semicolons join.
WHY = (
    "asked for",
    "the log is {0} s long, too short for a filter ({1} s): mean values only",
    "the base is still: the filter weighs sensor noise and bias as it should, from the first second on",
    "the base is disturbed: mean rates would be off, the inertial frame is not",
    "the base sways: mean rates mean nothing, the inertial frame follows every motion",
    "the base lists: it tilts steadily, as its gyros bear out",
    "the base is {0}: only the inertial frame follows it",
    "the base is {0}: only the inertial frame follows it (where a turntable does it, the aid `Positions()` shows more)",
    "its own motion is fitted to the log",
    "the gyros do not see the earth turn: the mean force levels, nothing finds north",
    "{0} was asked for, but the gyros do not see the earth turn: the mean force levels, nothing finds north",
    "the IMU turns, and its gyros do not see the earth turn: scale factors, misalignments and the arm from the axis are "
    "fitted, nothing finds north (where a turntable does it, the aid `Positions()` shows more)",
    "velocity form",
    "velocity form: the level specific force is coloured (Ljung-Box {0}, white noise stays below {1}), so the base moves a "
    "little",
    "accelerometer form: the level specific force is white (Ljung-Box {0} of {1}), so the base does not move beyond the noise "
    "of its sensors",
    "the base may sway: its own motion is fitted to the log",
    "the IMU turns on an indexer ({0}), {1}",
    "angles from the gyros of a still body",
    "angles of {0} axes from {1}",
    "{0} position in the log, turns between them by the gyros",
    "{0} positions in the log, turns between them by the gyros",
    "{0} states, closed loop over {1} rows of {2}",
    "gyro errors of {0} deg/h let the earth's rate tell heading",
    "gyro errors of {0} deg/h hide the earth's rate: motion has to tell heading",
    "asked for, a published filter to be compared, which assumes: {0}",
    "a factor acted in {0} of the epochs",
    "what the base moves is white noise of one size",
    "what the base moves is white in the accelerometers",
    "a still base and a level IMU",
    "the wheel sits at the IMU, its mounting is known, and its noise is white",
    "nonlinear in the azimuth alone",
    "larger innovations are noise",
    "larger innovations are news of the state",
    "larger innovations are news of the state and of its noise",
    "the lever arm is as given",
    "the lever arm is of length zero, as none is given",
    "inferred from the log",
    "specification {0}",
    "preset industrial, since none was given",
    "preset consumer, since none was given and the log speaks against industrial",
)


def clauses(reason: str) -> str:
    """A reason of several clauses in the language in force."""
    return translated("; ").join(retold(clause) for clause in reason.split("; "))
