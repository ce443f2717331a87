"""Random numbers of the simulator: a stream of its own for each error term of each run.

``SeedSequence(seed, spawn_key=(scenario, run, stream))``: switching a term off leaves the others' draws as they were,
and a run does not depend on how many there are or who works on them.
"""

from __future__ import annotations

import numpy as np

# Streams of the IMU by term; those of aiding sensors begin at 100, of motions at 200. Never renumbered, so that a seed keeps
# its data.
STREAMS = {
    "gyro_bias": 0,
    "accel_bias": 1,
    "gyro_random_walk": 2,
    "accel_random_walk": 3,
    "gyro_bias_instability": 4,
    "accel_bias_instability": 5,
    "gyro_scale_factor": 6,
    "accel_scale_factor": 7,
    "gyro_misalignment": 8,
    "accel_misalignment": 9,
    "gyro_turn_on_bias": 10,
    "accel_turn_on_bias": 11,
    "gyro_sample_noise": 12,
    "accel_sample_noise": 13,
    "gyro_rate_random_walk": 14,
    "accel_rate_random_walk": 15,
    "gyro_scale_factor_asymmetry": 16,
    "accel_scale_factor_asymmetry": 17,
    "gyro_g_sensitivity": 18,
    "gyro_bias_temperature": 20,
    "accel_bias_temperature": 21,
    "gyro_scale_factor_temperature": 22,
    "accel_scale_factor_temperature": 23,
}


def stream(seed: int, scenario: int, run: int, number: int) -> np.random.Generator:
    """The random generator of one term of one run."""
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence(seed, spawn_key=(scenario, run, number))))
