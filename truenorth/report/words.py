"""Words that reach a page through variables: kinds of motion, angles, sensors, verdicts. The catalogue translates them."""

WORDS = (
    "heading", "pitch", "roll", "Heading", "Pitch", "Roll", "heading minus roll", "heading plus roll",
    "Heading minus roll", "Heading plus roll", "unknown", "still", "disturbed", "swaying", "rotating", "moving",
    "warning", "error", "note", "fixed", "free", "baro", "gnss", "GNSS position", "GNSS velocity", "odometer",
    "velocity log", "barometer", "zero velocity", "zero rotation", "odometer scale", "odometer mounting", "odometer lever arm",
    "odometer lag", "GNSS lever arm", "GNSS lag", "GNSS bias", "velocity log scale", "velocity log mounting",
    "velocity log lever arm", "velocity log lag", "velocity log bias", "barometer bias", "barometer lag",
    "velocity log drift", "levelled velocity log", "deflection of the vertical", "position fix", "azimuth reset",
    "holds", "does not hold", "holds in part", "too few runs", "Aligned, with warnings", "Navigated, with warnings",
    "case", "method", "log, s", "runs", "failed", "RMS", "95 % interval", "median", "95th percentile", "Cramer-Rao bound",
    "RMS/bound", "claimed sigma", "RMS/sigma", "95 % band",
    "velocity of the base", "velocity of the master", "position of the master",
    "acceleration of the master", "attitude of the master", "odometer displacement", "height", "attitude",
    "GNSS heading", "magnetometer", "gyro scale factors", "accelerometer scale factors",
)  # fmt: skip
