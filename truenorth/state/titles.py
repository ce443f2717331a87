"""English: a title for each finding."""

from __future__ import annotations

TITLES = {
    "aligned": "Aligned",
    "navigated": "Navigated",
    "level_only": "Levelled; heading refused",
    "not_converged": "Not converged",
    "not_observable": "Heading not observable",
    "inconsistent": "The data contradict each other",
    "base": "The data contradict a base that stays",
    "drift": "The base drifts",
    "rate": "The gyros contradict the place or their specification",
    "force": "The accelerometers contradict the place or their specification",
    "record": "The log has faults",
    "tilt": "The gyros contradict the accelerometers",
    "bias": "The biases are not what the specification allows",
    "encoder": "The indexer's angles contradict the gyros",
    "master": "The master contradicts itself",
    "gnss": "GNSS positions and velocities contradict each other",
    "table": "The table was touched",
    "noise": "The sensors are noisy for a while",
    "rival": "The sensors are not as their specification says",
    "specification": "The specification is not that of these sensors",
    "innovations": "The measurements contradict the track",
    "second_look": "The measurements contradict how their sensors sit",
    "transfer": "Master and slave contradict each other",
    "log": "The velocity log contradicts the INS",
}
